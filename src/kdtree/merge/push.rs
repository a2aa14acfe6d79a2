//! Objects' own trees on their way down the static one.

use super::Object;
use crate::gpu::arguments;
use crate::gpu::shaders::{self, Shader};
use crate::gpu::{Kernel, Step};
use crate::kdtree::builder::KdSchedule;
use crate::kdtree::layout::MAX_DEPTH;

/// As `glsl/kdtree/merge/state.glsl` and `merge.glsl` have them.
pub(super) const SEED_BYTES: u64 = 12;
/// Of the items of two steps, and of leaves in leaves.
pub(super) const ITEM_BYTES: u64 = 3 * 76;
/// Each goes down in one of two trees.
const STEPS: u32 = 2 * MAX_DEPTH + 1;

/// The steps by which the trees of `objects`, each with its first tile, become pairs; none where no object has one. `step`
/// makes one of a phase, a shader, a level and a number of workgroups.
pub(super) fn steps(
    seeds: u64,
    schedule: KdSchedule,
    (workgroup, groups): (u32, u32),
    objects: impl Iterator<Item = (Object, u32)>,
    step: impl Fn(&'static str, &'static Shader, u32, u32) -> Step,
) -> Vec<Step> {
    let trees = objects.filter_map(|(object, first_tile)| Some((object.tree?, first_tile)));
    let seed = |(number, (tree, first_tile))| {
        let seed = arguments::MergeSeed { seed: seeds + SEED_BYTES * number as u64, tree, first_tile };
        Step::new("push", Kernel::new(&shaders::KDTREE_MERGE_SEED, workgroup, &[]), &seed, 1)
    };
    let mut steps: Vec<Step> = trees.enumerate().map(seed).collect();
    if steps.is_empty() {
        return steps;
    }
    if schedule == KdSchedule::Persistent {
        steps.push(step("push", &shaders::KDTREE_MERGE_PUSH_PERSISTENT, 0, groups));
    } else {
        // Most steps have few items or none.
        let few = groups.div_ceil(4);
        steps.extend((0..STEPS).map(|level| step("push", &shaders::KDTREE_MERGE_PUSH, level, few)));
        steps.push(step("push", &shaders::KDTREE_MERGE_MEET, 0, groups));
    }
    steps
}
