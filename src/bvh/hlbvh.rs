//! HLBVH on the device: treelets of the radix tree under a top that the surface area heuristic splits, level by level.
//!
//! Pantaleoni and Luebke 2010; Garanzha, Pantaleoni, McAllister 2011. `glsl/bvh/hlbvh.glsl` is the device's side; the twin is
//! [`super::twin::hlbvh`] with [`Bvh2::collapsed`](super::layout::Bvh2::collapsed): the same bytes.

use super::builder::Treelets;
use super::encode::Encode;
use super::geometry::Input;
use crate::gpu::arguments;
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

/// The dispatches behind [`Encode::steps`]. Label: `hierarchy`.
pub(super) fn steps(encode: &Encode, treelets: &Treelets, input: &Input, arguments: &arguments::Build) -> Vec<Step> {
    let step = |shader, arguments: &arguments::Build, groups| {
        Step::new("hierarchy", kernel(encode, treelets, shader, input), arguments, groups)
    };
    let of_level = |shader, level, groups| {
        step(shader, &arguments::Build { level, ..*arguments }, groups)
    };
    let (levels, tiles, groups) = (levels(encode.count), encode.tiles(), groups(encode));
    let before_top = [
        step(&shaders::BVH_HLBVH_TREELETS, arguments, tiles),
        step(&shaders::BVH_HLBVH_COUNT, arguments, tiles),
        step(&shaders::BVH_HLBVH_SCAN, arguments, 1),
        step(&shaders::BVH_HLBVH_GATHER, arguments, tiles),
    ];
    let top = (0..levels).map(|level| of_level(&shaders::BVH_HLBVH_SPLIT, level, groups));
    let behind = [&shaders::BVH_HLBVH_FINISH, &shaders::BVH_HLBVH_WEIGH].map(|shader| of_level(shader, levels, groups));
    before_top.into_iter().chain(top).chain(behind).collect()
}

/// The whole build by `workers` workgroups of one dispatch. Label: `build`.
pub(super) fn persistent_steps(
    encode: &Encode,
    treelets: &Treelets,
    input: &Input,
    arguments: &arguments::Build,
    workers: u32,
) -> Vec<Step> {
    let step = |shader, groups| Step::new("build", kernel(encode, treelets, shader, input), arguments, groups);
    vec![step(&shaders::BVH_HLBVH_RESET, 1), step(&shaders::BVH_HLBVH_PERSISTENT, workers)]
}
