//! Finishing a tree of single primitives: subtrees become leaves where that is cheaper, records go to the order of a walk.
//!
//! Meister and Bittner 2018, section 4, for the collapsing. `glsl/bvh/collapse.glsl` is the device's side; the twin is
//! [`Bvh2::collapsed`](super::layout::Bvh2::collapsed): the same bytes.

use super::encode::{Arguments, Encode};
use super::geometry::Input;
use crate::gpu::{Kernel, Step, shaders};

/// Primitives of a treelet, which one invocation walks with a stack in shared memory: as many as a quarter of that has room for.
pub(super) fn treelet(encode: &Encode) -> u32 {
    const STACK_ENTRY_BYTES: u32 = 8;
    (encode.shared_memory / 4 / (STACK_ENTRY_BYTES * encode.shape.workgroup)).clamp(2, 32)
}

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
    let of = |shader| encode.reading_kernel_with(shader, input, &[0, 0, treelet(encode)]);
    [&shaders::BVH_COLLAPSE_PLACE, &shaders::BVH_COLLAPSE_RECORDS].map(of).into()
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
