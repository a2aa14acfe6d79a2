//! Finishing a tree of single primitives: subtrees become leaves where that is cheaper, records go to the order of a walk.
//!
//! Meister and Bittner 2018, section 4, for the collapsing. `glsl/bvh/collapse.glsl` is the device's side; the twin is
//! [`Bvh2::collapsed`](super::layout::Bvh2::collapsed): the same bytes.

use super::encode::Encode;
use super::geometry::Input;
use crate::gpu::arguments;
use crate::gpu::{Step, shaders};

/// The dispatches that finish a tree whose weights are known. Label: `collapse`.
pub(super) fn place_steps(encode: &Encode, input: &Input, arguments: &arguments::Build) -> Vec<Step> {
    let kernels = [
        encode.kernel(&shaders::BVH_COLLAPSE_ABOVE),
        encode.kernel(&shaders::BVH_COLLAPSE_PLACE),
        encode.reading_kernel(&shaders::BVH_COLLAPSE_RECORDS, input),
    ];
    kernels.map(|kernel| Step::new("collapse", kernel, arguments, encode.tiles())).into()
}

/// The one dispatch that does what [`weigh_steps`] and [`place_steps`] do, for a tree of few primitives. Label: `collapse`.
pub(super) fn alone_step(encode: &Encode, input: &Input, arguments: &arguments::Build) -> Step {
    Step::new("collapse", encode.reading_kernel(&shaders::BVH_COLLAPSE_ALONE, input), arguments, 1)
}

/// Writes the records of a tree that has the numbers of its primitives in their place to the address `records`. Label: `collapse`.
pub(super) fn numbered_step(encode: &Encode, input: &Input, arguments: &arguments::Build, records: u64) -> Step {
    let kernel = encode.reading_kernel(&shaders::BVH_COLLAPSE_NUMBERED, input);
    Step::new("collapse", kernel, &arguments::Build { scratch: records, ..*arguments }, encode.tiles())
}

/// The dispatches that find the weights of any tree. Label: `collapse`.
pub(super) fn weigh_steps(encode: &Encode, arguments: &arguments::Build) -> Vec<Step> {
    [&shaders::BVH_COLLAPSE_PARENTS, &shaders::BVH_COLLAPSE_WEIGH]
        .map(|shader| Step::new("collapse", encode.kernel(shader), arguments, encode.tiles()))
        .into()
}
