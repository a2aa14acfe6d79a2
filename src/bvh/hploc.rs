//! H-PLOC on the device: PLOC within each node of the radix tree, bottom-up in one pass (Benthin et al. 2024).
//!
//! `glsl/bvh/hploc.glsl` is the device's side; the twin is [`super::host::hploc`] with
//! [`Bvh2::collapsed`](super::layout::Bvh2::collapsed): the same bytes.

use super::builder::Window;
use super::encode::{Arguments, Encode};
use super::geometry::Input;
use crate::gpu::{Kernel, Step, shaders};

fn kernel(encode: &Encode, window: &Window, shader: &'static shaders::Shader, input: &Input) -> Kernel {
    encode.reading_kernel_with(shader, input, &[window.size, window.radius])
}

/// The kernel of [`steps`].
pub(super) fn kernels(encode: &Encode, window: &Window, input: &Input) -> Vec<Kernel> {
    vec![kernel(encode, window, &shaders::BVH_HPLOC_HIERARCHY, input)]
}

/// The dispatch behind [`Encode::steps`]. Label: `hierarchy`.
pub(super) fn steps(encode: &Encode, window: &Window, input: &Input, arguments: &Arguments) -> Vec<Step> {
    let kernel = kernel(encode, window, &shaders::BVH_HPLOC_HIERARCHY, input);
    vec![Step::new("hierarchy", kernel, arguments, encode.tiles())]
}

/// The kernels of [`persistent_steps`].
pub(super) fn persistent_kernels(encode: &Encode, window: &Window, input: &Input) -> Vec<Kernel> {
    vec![encode.reset_kernel(&shaders::BVH_HPLOC_RESET), kernel(encode, window, &shaders::BVH_HPLOC_PERSISTENT, input)]
}

/// The whole build by `workers` workgroups of one dispatch. Label: `build`.
pub(super) fn persistent_steps(
    encode: &Encode,
    window: &Window,
    input: &Input,
    arguments: &Arguments,
    workers: u32,
) -> Vec<Step> {
    let kernels = persistent_kernels(encode, window, input);
    kernels
        .into_iter()
        .zip([1, workers])
        .map(|(kernel, groups)| Step::new("build", kernel, arguments, groups))
        .collect()
}
