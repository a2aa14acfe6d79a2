//! Objects that move are merged into a kd-tree on the device, and taken out again, in the caller's command buffer and memory
//! (Papay 2025, section 10.3).
//!
//! [`Merger::record`] puts triangles into a tree of what stands still: the leaves that they touch are built again, as tasks of
//! the builder ([`super::builder`]), and put where the leaves were; all else stays where it is. [`Merger::restore`] writes back
//! what was overwritten. So objects come and go by a restore and a merge of those that are then to be there; [`Objects`] keeps
//! the list.
//!
//! There are two ways to those leaves, and the merged tree is the same by both. Triangles find them each by itself; or an
//! object has a kd-tree of its own ([`Object::tree`]), and that is pushed down the static one, many triangles at once.
//!
//! The structure needs room: [`Merger::room`] gives it, [`KdTree::with_room`](super::layout::KdTree::with_room) or
//! [`KdOptions::more`](super::builder::KdOptions::more) make it. [`super::twin::merge`] is the twin, `glsl/kdtree/merge.glsl`
//! the device's side.

mod estimate;
mod objects;
pub(crate) mod push;

pub use estimate::{MergeEstimate, MergeOptions, MergeReport};
pub use objects::{Object, Objects};

use super::builder::{self, KdSchedule, KdShape};
use super::layout::{KdHeader, MAX_DEPTH, SpareRoom};
use super::termination::leaf_size;
use crate::bvh::geometry::{Input, Source};
use crate::gpu::arguments;
use crate::gpu::radix_sort::{self, Sort, SortBuffers};
use crate::gpu::shaders::{self, Shader};
use crate::gpu::{Context, Kernel, Recorder, Region, Step, fill};
use crate::{Error, Result};
use bytemuck::Zeroable;
use std::ops::Range;

/// The most that one merge takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MergeCapacity {
    /// The most objects.
    pub objects: u32,
    /// The most triangles of all objects together.
    pub triangles: u32,
}

/// Bytes that a merge needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MergeSizes {
    /// Bytes of scratch memory: free again when the merge has run and its report has been read.
    pub scratch: u64,
    /// Bytes for what the merge overwrites: kept until the static tree is restored.
    pub undo: u64,
    /// Alignment of all addresses.
    pub alignment: u64,
}

/// The memory that a merge works in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MergeMemory {
    /// The static tree with its room; the merge makes it the merged one.
    pub structure: Region,
    /// Scratch memory, of [`Merger::sizes`].
    pub scratch: Region,
    /// Memory for what is overwritten, of [`Merger::sizes`].
    pub undo: Region,
}

/// Merges into one static tree.
#[derive(Debug, Clone)]
pub struct Merger {
    options: MergeOptions,
    most: MergeCapacity,
    primitive_count: u32,
    structure_bytes: u64,
    schedule: KdSchedule,
    shape: KdShape,
    sort: radix_sort::SortShape,
    room: builder::BuildRoom,
    plan: MergePlan,
}

/// How much a merge has, but for what is in the structure already.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct MergePlan {
    pairs: u32,
    items: u32,
    marked: u32,
    level_nodes: u32,
    subtree_nodes: u32,
    cut_references: u32,
    subtree_references: u32,
}

/// As `glsl/kdtree/merge/state.glsl` has them.
pub(super) const MERGE_AT: u64 = 3072;
const PAIR_BYTES: u64 = 32;
const MARKED_BYTES: u64 = 40;
const UNDONE_BYTES: u64 = 12;

/// So many of each triangle and of 64 more; at most a quarter of what 32 bits count.
fn each(of_each: f32, triangles: u32) -> u32 {
    (f64::from(of_each.max(0.0)) * (f64::from(triangles) + 64.0)).ceil().min(f64::from(1 << 30)) as u32
}

impl MergePlan {
    fn of(estimate: &MergeEstimate, triangles: u32) -> MergePlan {
        let of = |of_each: f32| each(of_each, triangles).max(1);
        let marked = of(estimate.marked);
        MergePlan {
            pairs: of(estimate.pairs),
            items: of(estimate.items),
            marked,
            // Roots, and pairs of empty leaves and their siblings.
            level_nodes: of(estimate.build.level_nodes).saturating_add(marked.saturating_mul(3)),
            subtree_nodes: of(estimate.build.subtree_nodes),
            cut_references: of(estimate.build.cut_references),
            subtree_references: of(estimate.build.subtree_references),
        }
    }
}

impl Merger {
    /// The room that a structure must have in addition to the static tree.
    pub fn room(options: &MergeOptions, most: MergeCapacity) -> SpareRoom {
        let plan = MergePlan::of(&options.estimate, most.triangles);
        SpareRoom {
            nodes: plan.level_nodes + plan.subtree_nodes,
            references: plan.cut_references + plan.subtree_references,
            records: most.triangles,
        }
    }

    /// Merges into the structure with the primitives and the room of `still`; its other fields are not read.
    ///
    /// # Errors
    /// An option out of range; the structure has less room than [`Merger::room`].
    pub fn new(context: &Context, options: &MergeOptions, still: &KdHeader, most: MergeCapacity) -> Result<Merger> {
        options.build.check()?;
        let SpareRoom { nodes, references, records } = Merger::room(options, most);
        for (what, has, needs) in [
            ("nodes", still.node_room, nodes),
            ("references", still.reference_room, references),
            ("records", still.record_room, records),
        ] {
            if has < needs {
                return Err(Error::Argument(format!(
                    "the structure has room for {has} {what}, {} triangles of objects alone need {needs}; build it with more room",
                    most.triangles
                )));
            }
        }
        // Marked leaves have few references each: all that a pool across levels could do is build them, which the other does.
        let schedule = match options.build.schedule_on(context) {
            KdSchedule::AcrossLevels => KdSchedule::Persistent,
            schedule => schedule,
        };
        let shape = KdShape::of(context, &options.build, most.triangles.saturating_mul(4), schedule);
        let plan = MergePlan::of(&options.estimate, most.triangles);
        let chunk = shape.chunk();
        let level_references =
            each(options.estimate.build.level_references, most.triangles).max(most.triangles).max(64);
        let large = level_references / (options.build.exact + 1) + 1;
        let tiles = most.triangles.div_ceil(chunk) + most.objects;
        let room = builder::BuildRoom {
            level_references,
            tasks: (2 * large).max(plan.marked),
            chunks: (level_references / chunk + large + 1).max(tiles + 1),
            subtrees: each(options.estimate.build.subtrees, most.triangles).max(plan.marked),
            level_nodes: still.node_room - plan.subtree_nodes,
            nodes: still.node_room,
            cut_references: still.reference_room - plan.subtree_references,
            references: still.reference_room,
            records: still.record_room,
        };
        let sort = radix_sort::SortShape::of(context);
        Ok(Merger {
            options: *options,
            most,
            primitive_count: still.primitive_count,
            structure_bytes: still.offsets().bytes,
            schedule,
            shape,
            sort,
            room,
            plan,
        })
    }

    /// Bytes of scratch and undo memory: what [`Merger::record`] uses at most.
    pub fn sizes(&self) -> MergeSizes {
        let marked = self.plan.marked;
        let undo = size_of::<KdHeader>() as u64 + 4 + UNDONE_BYTES * u64::from(marked);
        MergeSizes { scratch: self.places(0).bytes, undo: undo.next_multiple_of(16), alignment: 16 }
    }

    /// Where in the scratch memory the [`MergeReport`] is, in bytes.
    pub fn report_range(&self) -> Range<u64> {
        MERGE_AT..MERGE_AT + size_of::<MergeReport>() as u64
    }

    fn places(&self, scratch: u64) -> Places {
        let MergePlan { pairs, items, marked, .. } = self.plan;
        let mut at = scratch + self.shape.scratch(&self.options.build, &self.room);
        let mut take = |bytes: u64| {
            let begin = at;
            at += bytes.next_multiple_of(16);
            begin
        };
        let keys = 8 * u64::from(pairs);
        Places {
            pairs: take(PAIR_BYTES * u64::from(pairs)),
            marked: take(MARKED_BYTES * u64::from(marked)),
            seeds: take(push::SEED_BYTES * u64::from(self.most.objects)),
            items: take(push::ITEM_BYTES * u64::from(items)),
            keys: [take(keys), take(keys)],
            values: [take(keys / 2), take(keys / 2)],
            table: take(4 * self.sort.most_table_words(pairs)),
            pair_tiles: take(4 * u64::from(pairs.div_ceil(builder::TILE) + 1)),
            bytes: at - scratch,
        }
    }

    /// Records the merge of `objects`, in any order, into the static tree at `memory.structure`, which nothing is merged into.
    ///
    /// The caller makes the inputs and the structure visible to compute shaders before, and places a barrier (compute shader
    /// write to whatever reads the structure or the report, writes the scratch memory or restores) behind. Where there is no
    /// room for the items, the pairs, the leaves or their references, nothing is merged; where there is none for the levels
    /// below, nodes are leaves; the status says so in both cases. Labels: `encode`; `push` where an object has a tree, `find`
    /// where one has none; `sort`; `unique` where one has a tree; `mark`; those of the builder's levels, `place` and `hook`, or
    /// `build` where the schedule is persistent.
    ///
    /// # Errors
    /// The memory is too small; more objects or triangles than the merger is for; several geometries in one; primitives that are
    /// numbered twice; a pipeline could not be made.
    pub fn record(&self, recorder: &mut Recorder<'_>, memory: MergeMemory, objects: &[Object]) -> Result<()> {
        let mut objects = objects.to_vec();
        objects.sort_by_key(|object| object.first_primitive);
        self.check(&objects)?;
        let sizes = self.sizes();
        let scratch = memory.scratch.checked("scratch memory for a merge", sizes.scratch, sizes.alignment)?;
        let (structure, undo) = (self.structure_of(&memory)?, self.undo_of(&memory)?);
        recorder.chains(&[self.steps([structure, scratch, undo], &objects)])
    }

    fn structure_of(&self, memory: &MergeMemory) -> Result<u64> {
        memory.structure.checked("memory of a kd-tree that is merged into", self.structure_bytes, 16)
    }

    fn undo_of(&self, memory: &MergeMemory) -> Result<u64> {
        let sizes = self.sizes();
        memory.undo.checked("memory for what a merge overwrites", sizes.undo, sizes.alignment)
    }

    /// Records the way back: the structure has the bytes of the static tree again, and behind its counts what a merge left there.
    ///
    /// The caller places a barrier before, behind the merge and what reads the merged tree, and one behind.
    ///
    /// # Errors
    /// The memory is too small; a pipeline could not be made.
    pub fn restore(&self, recorder: &mut Recorder<'_>, memory: MergeMemory) -> Result<()> {
        let (structure, undo) = (self.structure_of(&memory)?, self.undo_of(&memory)?);
        let setup = arguments::MergeSetup { structure, undo, ..arguments::MergeSetup::zeroed() };
        let groups = self.plan.marked.div_ceil(16 * self.shape.workgroup).clamp(1, self.shape.groups);
        let kernel = Kernel::new(&shaders::KDTREE_MERGE_RESTORE, self.shape.workgroup, &[]);
        recorder.chains(&[vec![Step::new("restore", kernel, &setup, groups)]])
    }

    /// Objects in the order of their primitives.
    fn check(&self, objects: &[Object]) -> Result<()> {
        let triangles: u64 = objects.iter().map(|object| u64::from(object.input.primitive_count)).sum();
        if objects.len() > self.most.objects as usize || triangles > u64::from(self.most.triangles) {
            return Err(Error::Argument(format!(
                "{} objects of {triangles} triangles; the merger is for {} of {}; make one for more",
                objects.len(),
                self.most.objects,
                self.most.triangles
            )));
        }
        let mut end = u64::from(self.primitive_count);
        for object in objects {
            if !matches!(object.input.source, Source::One(_)) {
                return Err(Error::Argument("an object is one geometry; make several objects of several".into()));
            }
            if let Some(tree) = object.tree.filter(|tree| *tree == 0 || tree % 16 != 0) {
                return Err(Error::Argument(format!(
                    "an object's tree is at address {tree:#x}; it must be a multiple of 16 and not 0"
                )));
            }
            let first = u64::from(object.first_primitive);
            let next = first + u64::from(object.input.primitive_count);
            if first < end || next > u64::from(u32::MAX) {
                return Err(Error::Argument(format!(
                    "an object has primitives {first}..{next}, those before end at {end}; number them apart"
                )));
            }
            end = next;
        }
        Ok(())
    }

    fn steps(&self, [structure, scratch, undo]: [u64; 3], objects: &[Object]) -> Vec<Step> {
        let Places { pairs, marked, seeds, items, keys, values, table, pair_tiles, .. } = self.places(scratch);
        let triangles: u32 = objects.iter().map(|object| object.input.primitive_count).sum();
        let bits_of = |most: u32| 32 - most.leading_zeros();
        // Leaves are numbered by parent and side from 1 on, and no key is that of a place without a pair.
        let record_bits = bits_of(triangles.saturating_sub(1));
        let bits = record_bits + bits_of(2 * self.room.nodes + 2);
        let pair_capacity = each(self.options.estimate.pairs, triangles).clamp(1, self.plan.pairs);
        let sort = Sort { count: pair_capacity, bits, identity: false };
        let sorting = radix_sort::steps(&self.sort, &SortBuffers { keys, values, table }, &sort);
        let sorted = sorting.len() / radix_sort::STEPS_OF_A_PASS % 2;
        let key_words = if bits > 32 { 2 } else { 1 };
        let has_tree = |object: &Object| object.tree.is_some();
        let tiles = |object: &Object| object.input.primitive_count.div_ceil(self.shape.chunk());
        let primitive_end = objects.last().map_or(0, |last| last.first_primitive + last.input.primitive_count);
        let setup = arguments::MergeSetup {
            structure,
            state: scratch,
            undo,
            pairs,
            keys,
            values,
            marked,
            seeds,
            items,
            pair_tiles,
            pair_capacity,
            marked_capacity: self.plan.marked,
            record_bits,
            key_words_and_sorted: key_words | (sorted as u32) << 2,
            tiles: objects.iter().map(tiles).sum(),
            primitive_end,
            seed_count: objects.iter().filter(|object| has_tree(object)).count() as u32,
            item_capacity: self.plan.items,
        };
        let groups = self.shape.groups;
        let counted = |primitives| Object { input: Input::mesh(0, 0, 0, primitives), first_primitive: 0, tree: None };
        let none = counted(0);
        let step_of = |object: &Object, first_tile, phase, shader: &'static Shader, level, groups| {
            let kernel = self.shape.kernel(shader, &self.options.build, &object.input);
            let mut arguments =
                arguments::KdBuild::new(&self.options.build, &self.room, &object.input, structure, scratch);
            arguments.level = level;
            arguments.first_tile = first_tile;
            arguments.first_primitive = object.first_primitive;
            arguments.depth_limit = MAX_DEPTH;
            arguments.leaf_size = leaf_size(self.primitive_count);
            Step::new(phase, kernel, &arguments, self.shape.groups_of(shader, groups))
        };
        let step = |phase, shader: &'static Shader, level, groups| step_of(&none, 0, phase, shader, level, groups);
        let first_tile = |i: usize| objects[..i].iter().map(tiles).sum::<u32>();
        let of_objects = |shader: &'static Shader| {
            let of = |(i, object)| step_of(object, first_tile(i), "encode", shader, 0, tiles(object).min(groups));
            objects.iter().enumerate().map(of).collect::<Vec<Step>>()
        };
        let mut steps = vec![
            Step::new("encode", Kernel::new(&shaders::KDTREE_MERGE_SETUP, self.shape.workgroup, &[]), &setup, 1),
            step("encode", &shaders::KDTREE_MERGE_RESET, 0, 1),
        ];
        steps.extend(of_objects(&shaders::KDTREE_BUILDER_COUNT));
        steps.push(step("encode", &shaders::KDTREE_MERGE_PLAN, 0, 1));
        steps.extend(of_objects(&shaders::KDTREE_BUILDER_RECORDS));
        steps.push(fill::step("encode", keys[0], pair_capacity * key_words, u32::MAX));
        let each_first_tile = objects.iter().enumerate().map(|(i, object)| (*object, first_tile(i)));
        steps.extend(push::steps(seeds, self.schedule, (self.shape.workgroup, groups), each_first_tile, step));
        // Neighbours without trees are taken together: their tiles follow from the number of their primitives.
        let mut at = 0;
        for neighbours in objects.chunk_by(|a, b| has_tree(a) == has_tree(b)) {
            let first = at;
            at += neighbours.iter().map(tiles).sum::<u32>();
            if !has_tree(&neighbours[0]) {
                let all = counted((at - first) * self.shape.chunk());
                steps.push(step_of(&all, first, "find", &shaders::KDTREE_MERGE_FIND, 0, groups));
            }
        }
        steps.extend(sorting);
        if setup.seed_count > 0 {
            steps.push(step("unique", &shaders::KDTREE_MERGE_UNIQUE, 0, groups));
            steps.push(step("unique", &shaders::KDTREE_MERGE_MOVE, 0, groups));
        }
        let mark = [
            &shaders::KDTREE_MERGE_MARK,
            &shaders::KDTREE_MERGE_LEAVES,
            &shaders::KDTREE_MERGE_DESCRIBE,
            &shaders::KDTREE_MERGE_TASKS,
        ];
        steps.extend(mark.map(|shader| step("mark", shader, 0, groups)));
        if self.schedule == KdSchedule::Persistent {
            steps.push(step("build", &shaders::KDTREE_MERGE_BUILD_PERSISTENT, 0, groups));
            return steps;
        }
        steps.push(step("mark", &shaders::KDTREE_MERGE_GATHER, 0, groups));
        // Leaves have few references: below the first level little is left, and at most of them nothing.
        let few = groups.div_ceil(4);
        steps.extend(builder::levels(MAX_DEPTH, groups, |phase, shader, level, groups| {
            step(phase, shader, level, if level == 0 { groups } else { few })
        }));
        steps.push(step("place", &shaders::KDTREE_MERGE_ORDER, 0, groups));
        steps.push(step("place", &shaders::KDTREE_BUILDER_PLACE, 0, groups));
        steps.push(step("hook", &shaders::KDTREE_MERGE_HOOK, 0, groups));
        steps
    }
}

/// What lies in the scratch memory behind that of a build.
struct Places {
    pairs: u64,
    marked: u64,
    seeds: u64,
    items: u64,
    keys: [u64; 2],
    values: [u64; 2],
    table: u64,
    pair_tiles: u64,
    bytes: u64,
}
