//! Linear BVH on the device: hierarchy with boxes, costs and collapsing bottom-up in one pass (Apetrei 2014).
//!
//! `glsl/bvh/lbvh.glsl` is the device's side; the twin is [`super::twin::lbvh`]: the same bytes.

use super::encode::Encode;
use super::geometry::Input;
use crate::gpu::arguments;
use crate::gpu::{Step, shaders};

/// The dispatch behind [`Encode::steps`]. Label: `hierarchy`.
pub(super) fn steps(encode: &Encode, input: &Input, arguments: &arguments::Build) -> Vec<Step> {
    let kernel = encode.reading_kernel(&shaders::BVH_LBVH_HIERARCHY, input);
    vec![Step::new("hierarchy", kernel, arguments, encode.tiles())]
}

/// The whole build by `workers` workgroups of one dispatch. Label: `build`.
pub(super) fn persistent_steps(
    encode: &Encode,
    input: &Input,
    arguments: &arguments::Build,
    workers: u32,
) -> Vec<Step> {
    let (reset, all) = (&shaders::BVH_LBVH_RESET, &shaders::BVH_LBVH_PERSISTENT);
    vec![
        Step::new("build", encode.reset_kernel(reset), arguments, 1),
        Step::new("build", encode.reading_kernel(all, input), arguments, workers),
    ]
}
