//! Linear BVH on the device: hierarchy with boxes, costs and collapsing bottom-up in one pass (Apetrei 2014).
//!
//! `glsl/bvh/lbvh.glsl` is the device's side; the twin is [`super::host::lbvh`]: the same bytes.

use super::encode::{Arguments, Encode};
use super::geometry::Input;
use crate::gpu::{Kernel, Step, shaders};

/// The kernel behind [`Encode`]'s.
pub(super) fn kernels(encode: &Encode, input: &Input) -> Vec<Kernel> {
    vec![encode.reading_kernel(&shaders::BVH_LBVH_HIERARCHY, input)]
}

/// The dispatch behind [`Encode::steps`]. Label: `hierarchy`.
pub(super) fn steps(encode: &Encode, input: &Input, arguments: &Arguments) -> Vec<Step> {
    let kernel = encode.reading_kernel(&shaders::BVH_LBVH_HIERARCHY, input);
    vec![Step::new("hierarchy", kernel, arguments, encode.tiles())]
}

/// The kernels of [`persistent_steps`].
pub(super) fn persistent_kernels(encode: &Encode, input: &Input) -> Vec<Kernel> {
    vec![encode.kernel(&shaders::BVH_LBVH_RESET), encode.reading_kernel(&shaders::BVH_LBVH_PERSISTENT, input)]
}

/// The whole build by `workers` workgroups of one dispatch. Label: `build`.
pub(super) fn persistent_steps(encode: &Encode, input: &Input, arguments: &Arguments, workers: u32) -> Vec<Step> {
    let kernels = persistent_kernels(encode, input);
    kernels
        .into_iter()
        .zip([1, workers])
        .map(|(kernel, groups)| Step::new("build", kernel, arguments, groups))
        .collect()
}
