//! Builds across levels: a task pool in which tasks of all levels run at once (Papay 2025, sections 7.2, 9.3 and 9.8,
//! algorithms 6 and 7), for [`KdSchedule::AcrossLevels`](super::builder::KdSchedule::AcrossLevels).
//!
//! A task is a cell with its references. Workers take chunks of large tasks, and build small ones by themselves, where nothing is
//! searched for; each takes the memory that it needs of one arena while it builds. Nodes find their places at the end, level by
//! level, so the bytes are those of the other schedules. `glsl/kdtree/across/` is the device's side.
//!
//! Without room for all, the status says [`OUT_OF_ROOM`](crate::bvh::layout::status::OUT_OF_ROOM), and some cells are leaves:
//! which of them depends on who was first.

use super::builder::{BuildRoom, KdEstimate, KdOptions, KdShape, STATE_BYTES, TILE, stack_bytes};
use super::layout;
use crate::bvh::geometry::Input;
use crate::gpu::Step;
use crate::gpu::arguments;
use crate::gpu::shaders::{self, Shader};

/// As `glsl/kdtree/across/` has them.
const ACROSS_BYTES: u64 = 1024;
const POOL_BYTES: u64 = 256;
const SLOT_BYTES: u64 = 12;
const TASK_BYTES: u64 = 96;
const OWN_TASKS: u64 = 64;
const TILE_BYTES: u64 = 16;
/// A reference, and its sides.
const PIECE_BYTES: u64 = 28 + 4;
const KEPT_AT_A_TIME: u32 = 64;
/// The most references of the arena: sides name them in 30 bits.
const MOST: u64 = (1 << 30) - 2;

/// More of the arena than a build has used: the next one may use more, as other workers are first.
pub(super) const MARGIN: f32 = 1.25;

/// Those that build across levels. Their workgroups are narrow.
pub(super) const SHADERS: [&Shader; 4] = [
    &shaders::KDTREE_ACROSS_RESET,
    &shaders::KDTREE_ACROSS_ROOT,
    &shaders::KDTREE_ACROSS_BUILD,
    &shaders::KDTREE_ACROSS_PLACE,
];

/// What there is room for: `level_references` is the arena's, `tasks` the number of slots, `subtrees` that of workers.
pub(super) fn room(options: &KdOptions, count: u32, shape: &KdShape) -> BuildRoom {
    let estimate = options.estimate.unwrap_or(KdEstimate::for_exact(options.exact));
    let each = |of_each: f32, more: u64, most: u64| {
        let wanted = (f64::from(of_each.max(0.0)) * f64::from(count)).ceil() as u64;
        (wanted + more).min(most) as u32
    };
    let workers = shape.subtree_groups;
    let nodes =
        each(estimate.level_nodes + estimate.subtree_nodes, 256 + u64::from(options.more.nodes), layout::MAX_NODES);
    let references = (estimate.cut_references + estimate.subtree_references).max(1.0);
    let references = each(references, 512 + u64::from(options.more.references), layout::MAX_REFERENCES);
    // Workers keep some of it, those that have work.
    let kept = workers.min(count / KEPT_AT_A_TIME + 1) * KEPT_AT_A_TIME;
    BuildRoom {
        level_references: each(estimate.arena.max(1.0), u64::from(kept) + 64, MOST),
        // Of Papay's pool: a multiple of the workers' invocations.
        tasks: workers * shape.narrow,
        chunks: 0,
        subtrees: workers,
        level_nodes: nodes,
        nodes,
        cut_references: references,
        references,
        records: (u64::from(count) + u64::from(options.more.records)).min(u32::MAX.into()) as u32,
    }
}

/// Bytes of the scratch memory with an arena of so many references.
fn scratch_of(options: &KdOptions, room: &BuildRoom, arena: u64) -> u64 {
    let (slots, workers) = (u64::from(room.tasks), u64::from(room.subtrees));
    STATE_BYTES
        + ACROSS_BYTES
        + POOL_BYTES
        + slots * (SLOT_BYTES + TASK_BYTES)
        + workers * (OWN_TASKS * TASK_BYTES + stack_bytes(options.exact.into()))
        + (arena.div_ceil(TILE.into()) + 1) * TILE_BYTES
        + arena * PIECE_BYTES
}

/// Bytes of the scratch memory.
pub(super) fn scratch(options: &KdOptions, room: &BuildRoom) -> u64 {
    scratch_of(options, room, room.level_references.into()).next_multiple_of(16)
}

/// How many references the arena has in so many bytes of scratch memory, which are no fewer than [`scratch`].
pub(super) fn grown(options: &KdOptions, room: &BuildRoom, bytes: u64) -> u32 {
    let tiles = u64::from(TILE);
    let rest = bytes.saturating_sub(scratch_of(options, room, 0) + 2 * TILE_BYTES);
    let arena = rest * tiles / (PIECE_BYTES * tiles + TILE_BYTES);
    arena.clamp(room.level_references.into(), MOST) as u32
}

/// The steps of a build.
pub(super) fn steps(shape: &KdShape, options: &KdOptions, input: &Input, arguments: &arguments::KdBuild) -> Vec<Step> {
    let step = |phase, shader: &'static Shader, groups| {
        Step::new(phase, shape.kernel(shader, options, input), arguments, groups)
    };
    let (groups, workers) = (shape.groups, shape.subtree_groups);
    let resetting = arguments.task_capacity.div_ceil(16 * shape.narrow).clamp(1, groups);
    vec![
        step("encode", &shaders::KDTREE_ACROSS_RESET, resetting),
        step("encode", &shaders::KDTREE_BUILDER_COUNT, groups),
        step("encode", &shaders::KDTREE_BUILDER_PLAN, 1),
        step("encode", &shaders::KDTREE_BUILDER_RECORDS, groups),
        step("encode", &shaders::KDTREE_ACROSS_ROOT, 1),
        step("pool", &shaders::KDTREE_ACROSS_BUILD, workers),
        step("place", &shaders::KDTREE_ACROSS_PLACE, workers),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_arena_has_all_of_the_memory_that_it_is_given_and_no_more() {
        let options = KdOptions::DEFAULT;
        let room = BuildRoom {
            level_references: 1000,
            tasks: 64,
            chunks: 0,
            subtrees: 8,
            level_nodes: 1,
            nodes: 1,
            cut_references: 1,
            references: 1,
            records: 1,
        };
        let least = scratch(&options, &room);
        assert_eq!(grown(&options, &room, least), 1000, "what was asked for is what there is");
        for more in [1, 100, 4096, 1 << 20, 1 << 34] {
            let arena = u64::from(grown(&options, &room, least + more));
            assert!(scratch_of(&options, &room, arena) <= least + more, "{more} bytes more: {arena}");
            let is_all = arena == MOST || scratch_of(&options, &room, arena + 8) > least + more;
            assert!(is_all, "{more} bytes more: {arena}");
        }
    }
}
