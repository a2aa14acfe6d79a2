//! HLBVH on the device: treelets of the radix tree under a top that the surface area heuristic splits, level by level.
//!
//! Pantaleoni and Luebke 2010; Garanzha, Pantaleoni, McAllister 2011. `glsl/bvh/hlbvh.glsl` is the device's side; the twin is
//! [`super::host::hlbvh`] with [`Bvh2::collapsed`](super::layout::Bvh2::collapsed): the same bytes.

use super::builder::Treelets;
use super::encode::{Arguments, Encode};
use super::geometry::Input;
use crate::gpu::{Kernel, Step, shaders};

/// Levels of the top that are recorded. On the host, tops of three scenes have 15 to 18 levels; of what is left behind so many
/// here, a workgroup finishes each task alone.
fn levels(count: u32) -> u32 {
    /// `LEVELS` in hlbvh.glsl.
    const MOST: u32 = 32;
    (u32::BITS - count.leading_zeros() + 6).min(MOST)
}

/// Workgroups that share what only the device knows the number of.
fn groups(encode: &Encode) -> u32 {
    encode.tiles().min(encode.sharers)
}

/// Bytes behind the clusters: what names each task of two levels. A task has two treelets at least.
pub(super) const fn tasks_bytes(count: u64) -> u64 {
    4 * count
}

fn kernel(encode: &Encode, treelets: &Treelets, shader: &'static shaders::Shader, input: &Input) -> Kernel {
    /// `BY_COUNT` in hlbvh.glsl: pipelines do not depend on the number of primitives.
    const BY_COUNT: u32 = u32::MAX;
    let constants = [treelets.primitives, treelets.bits.unwrap_or(BY_COUNT)];
    encode.reading_kernel_with(shader, input, &constants)
}

/// Shaders and workgroups up to the top, and behind it.
fn before_top(encode: &Encode) -> [(&'static shaders::Shader, u32); 4] {
    [
        (&shaders::BVH_HLBVH_TREELETS, encode.tiles()),
        (&shaders::BVH_HLBVH_COUNT, encode.tiles()),
        (&shaders::BVH_HLBVH_SCAN, 1),
        (&shaders::BVH_HLBVH_GATHER, encode.tiles()),
    ]
}

fn behind_levels(encode: &Encode) -> [(&'static shaders::Shader, u32); 2] {
    [(&shaders::BVH_HLBVH_FINISH, groups(encode)), (&shaders::BVH_HLBVH_WEIGH, groups(encode))]
}

/// The kernels of [`steps`].
pub(super) fn kernels(encode: &Encode, treelets: &Treelets, input: &Input) -> Vec<Kernel> {
    let shaders = before_top(encode).into_iter().chain(behind_levels(encode)).map(|(shader, _)| shader);
    shaders.chain([&shaders::BVH_HLBVH_SPLIT]).map(|shader| kernel(encode, treelets, shader, input)).collect()
}

/// The dispatches behind [`Encode::steps`]. Label: `hierarchy`.
pub(super) fn steps(encode: &Encode, treelets: &Treelets, input: &Input, arguments: &Arguments) -> Vec<Step> {
    let step = |shader, arguments: &Arguments, groups| {
        Step::new("hierarchy", kernel(encode, treelets, shader, input), arguments, groups)
    };
    let of_level = |shader, level, groups| {
        // A word of the sort, which has run.
        step(shader, &Arguments { columns: level, ..*arguments }, groups)
    };
    let levels = levels(encode.count);
    let before = before_top(encode).into_iter().map(|(shader, groups)| step(shader, arguments, groups));
    let top = (0..levels).map(|level| of_level(&shaders::BVH_HLBVH_SPLIT, level, groups(encode)));
    let behind = behind_levels(encode).into_iter().map(|(shader, groups)| of_level(shader, levels, groups));
    before.chain(top).chain(behind).collect()
}

/// The kernels of [`persistent_steps`].
pub(super) fn persistent_kernels(encode: &Encode, treelets: &Treelets, input: &Input) -> Vec<Kernel> {
    [&shaders::BVH_HLBVH_RESET, &shaders::BVH_HLBVH_PERSISTENT]
        .map(|shader| kernel(encode, treelets, shader, input))
        .into()
}

/// The whole build by `workers` workgroups of one dispatch. Label: `build`.
pub(super) fn persistent_steps(
    encode: &Encode,
    treelets: &Treelets,
    input: &Input,
    arguments: &Arguments,
    workers: u32,
) -> Vec<Step> {
    let kernels = persistent_kernels(encode, treelets, input);
    kernels
        .into_iter()
        .zip([1, workers])
        .map(|(kernel, groups)| Step::new("build", kernel, arguments, groups))
        .collect()
}
