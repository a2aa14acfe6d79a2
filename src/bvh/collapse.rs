//! Finishing a tree of single primitives: subtrees become leaves where that is cheaper, records go to the order of a walk.
//!
//! Meister and Bittner 2018, section 4, for the collapsing. `glsl/bvh/collapse.glsl` is the device's side; the twin is
//! [`Bvh2::collapsed`](super::layout::Bvh2::collapsed): the same bytes.

use super::encode::{Arguments, Encode};
use super::geometry::Input;
use crate::gpu::{Kernel, Step, shaders};

/// Bytes of the weights of so many primitives: `Weights` in weights.glsl.
pub(super) const fn weights_bytes(count: u64) -> u64 {
    16 * count
}

/// Bytes behind the weights that [`weigh_steps`] needs: costs and arrivals.
pub(super) const fn weigh_bytes(count: u64) -> u64 {
    8 * count
}

/// The kernels of [`place_steps`].
pub(super) fn place_kernels(encode: &Encode, input: &Input) -> Vec<Kernel> {
    let tree = [&shaders::BVH_COLLAPSE_ABOVE, &shaders::BVH_COLLAPSE_PLACE].map(|shader| encode.kernel(shader));
    tree.into_iter().chain([encode.reading_kernel(&shaders::BVH_COLLAPSE_RECORDS, input)]).collect()
}

/// The dispatches that finish a tree whose weights are known. Label: `collapse`.
pub(super) fn place_steps(encode: &Encode, input: &Input, arguments: &Arguments) -> Vec<Step> {
    let kernels = place_kernels(encode, input).into_iter();
    kernels.map(|kernel| Step::new("collapse", kernel, arguments, encode.tiles())).collect()
}

const WEIGH: [&shaders::Shader; 2] = [&shaders::BVH_COLLAPSE_PARENTS, &shaders::BVH_COLLAPSE_WEIGH];

/// The kernels of [`weigh_steps`].
pub(super) fn weigh_kernels(encode: &Encode) -> Vec<Kernel> {
    WEIGH.iter().map(|shader| encode.kernel(shader)).collect()
}

/// The dispatches that find the weights of any tree. Label: `collapse`.
pub(super) fn weigh_steps(encode: &Encode, arguments: &Arguments) -> Vec<Step> {
    WEIGH.iter().map(|shader| Step::new("collapse", encode.kernel(shader), arguments, encode.tiles())).collect()
}
