//! kd-trees built on the device in the caller's command buffer and memory: `kd-gpu`.
//!
//! [`KdBuilder::sizes`] gives the memory that a build needs, [`KdBuilder::record`] records the build. How many references and
//! nodes a tree has shows only when it is built, so the sizes go by an [`KdEstimate`]; where that was too little, nodes are
//! leaves, the status says so ([`OUT_OF_ROOM`](crate::bvh::layout::status::OUT_OF_ROOM)), and the [`KdReport`] says what would
//! have been enough.
//!
//! Min-max binning above, level by level (Papay 2025, sections 9.4 to 9.6); cells of few references are split exactly, by one
//! workgroup to their leaves. [`super::twin::builder`] is the twin,
//! `glsl/kdtree/builder.glsl` the device's side.
//!
//! Trees have the bytes of the twin on every device: the reciprocals that they depend on are correctly rounded, by the device or
//! by integers ([`crate::gpu::Tuning::exact_division`]). Where a device flushes subnormal numbers, inputs must not lead to any.

use super::across;
use super::layout::{self, KdHeader, KdNode};
use super::merge::MERGE_AT;
use super::termination::{Costs, depth_limit, leaf_size};
use crate::bvh::geometry::{Input, Planned, Primitives};
use crate::gpu::arguments::{self, KD_MERGE_BYTES, KD_STATE_BYTES};
use crate::gpu::shaders::{self, Shader};
use crate::gpu::{Context, KdTuning, Kernel, Recorder, Region, Sizes, Step, task_pool};
use crate::{Error, Result};
use bytemuck::{Pod, Zeroable};
use std::ops::Range;

/// What to build, beside the triangles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KdOptions {
    /// Bins along each axis, 2 to [`KdOptions::MOST_BINS`].
    pub bins: u32,
    /// References up to which a cell is split exactly, [`KdOptions::LEAST_EXACT`] to [`KdOptions::MOST_EXACT`].
    pub exact: u32,
    /// The costs by which the best plane is chosen.
    pub costs: Costs,
    /// How the phases are recorded; `None` takes what measured faster ([`KdOptions::schedule_on`]).
    pub schedule: Option<KdSchedule>,
    /// Workgroups of a persistent dispatch, 1 or more; `None` takes what keeps the device busy.
    pub workgroups: Option<u32>,
    /// What the memory goes by; `None` takes [`KdEstimate::for_exact`].
    pub estimate: Option<KdEstimate>,
    /// Extra room in the structure for objects that will be merged into it: [`super::merge`].
    pub more: layout::SpareRoom,
    /// Geometries: what [`Source::Several`](crate::bvh::geometry::Source::Several) has, otherwise 1.
    pub geometry_count: u32,
    /// `vk::BuildAccelerationStructureFlagsKHR` for the header.
    pub build_flags: u32,
}

/// How the phases of a build or a merge are recorded. The result is the same bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum KdSchedule {
    /// One dispatch per phase of each level, with barriers between. Works on every device.
    Chain,
    /// One persistent dispatch that draws tasks from a pool, level by level. The device must keep running workgroups that it has
    /// started.
    Persistent,
    /// A pool in which tasks of all levels run at once, and memory that is taken while the tree is built: [`super::across`]. The
    /// device must keep running workgroups that it has started. A merge runs as by [`KdSchedule::Persistent`].
    AcrossLevels,
}

impl std::fmt::Display for KdSchedule {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            KdSchedule::Chain => "chain",
            KdSchedule::Persistent => "persistent",
            KdSchedule::AcrossLevels => "across-levels",
        })
    }
}

impl KdOptions {
    /// Bins and exact splits that measured well (docs/notes/kdtree.md), everything else chosen.
    pub const DEFAULT: KdOptions = KdOptions {
        bins: 128,
        exact: 32,
        costs: Costs::DEFAULT,
        schedule: None,
        workgroups: None,
        estimate: None,
        more: layout::SpareRoom { nodes: 0, references: 0, records: 0 },
        geometry_count: 1,
        build_flags: 0,
    };
    /// The most bins: their counters lie in a workgroup's shared memory.
    pub const MOST_BINS: u32 = 256;
    /// The least number of references that an exact split may have: it bounds the tasks of a level.
    pub const LEAST_EXACT: u32 = 4;
    /// The most: looking at every plane takes time by the square.
    pub const MOST_EXACT: u32 = 64;

    /// The schedule on the device of `context`; of a merge, too. The pool across levels on a CPU: workgroups take what is left as they
    /// come, where those of a dispatch have their shares, whichever core is slower; on deep trees it takes 0.94 to 0.99 of the time of
    /// the pool by levels, on others as long (docs/notes/kdtree.md). No GPU was measured, and a chain asks nothing of one's progress.
    pub fn schedule_on(&self, context: &Context) -> KdSchedule {
        let measured = if context.tuning.kd.persistent { KdSchedule::AcrossLevels } else { KdSchedule::Chain };
        self.schedule.unwrap_or(measured)
    }

    /// # Errors
    /// [`Error::Argument`] names the option that cannot be used, and what can.
    pub fn check(&self) -> Result<()> {
        if !(2..=KdOptions::MOST_BINS).contains(&self.bins) {
            return Err(Error::Argument(format!(
                "{} bins; a kd-tree is built by 2 to {}",
                self.bins,
                KdOptions::MOST_BINS
            )));
        }
        if !(KdOptions::LEAST_EXACT..=KdOptions::MOST_EXACT).contains(&self.exact) {
            return Err(Error::Argument(format!(
                "exact splits of {} references; it is {} to {}",
                self.exact,
                KdOptions::LEAST_EXACT,
                KdOptions::MOST_EXACT
            )));
        }
        if self.workgroups == Some(0) {
            return Err(Error::Argument("no workgroups; a build has 1 or more".into()));
        }
        match [self.costs.c_t, self.costs.c_i].into_iter().find(|&cost| !Costs::check(cost)) {
            Some(cost) => Err(Error::Argument(format!("a cost of {cost} cannot be used; take 0.001 to 1000"))),
            None => Ok(()),
        }
    }
}

impl Default for KdOptions {
    fn default() -> KdOptions {
        KdOptions::DEFAULT
    }
}

/// How much a tree has, of each primitive. [`KdReport::estimate`] makes one that suffices for the scene that was built.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KdEstimate {
    /// References of a level.
    pub level_references: f32,
    /// Nodes of all levels above the subtrees of few references, their roots among them.
    pub level_nodes: f32,
    /// Nodes of those subtrees below their roots.
    pub subtree_nodes: f32,
    /// References that leaves would have if no cell was split any more, at the level where that is most.
    pub cut_references: f32,
    /// References of the subtrees.
    pub subtree_references: f32,
    /// Subtrees.
    pub subtrees: f32,
    /// Of a build by [`KdSchedule::AcrossLevels`], what tasks, nodes and subtrees take of its arena at a time: in references, of 32
    /// bytes each. The others have none.
    pub arena: f32,
}

impl KdEstimate {
    /// For a scene of which nothing is known. The fewer references are split exactly, the more subtrees there are.
    pub fn for_exact(exact: u32) -> KdEstimate {
        KdEstimate {
            level_references: 2.0,
            level_nodes: 16.0 / exact as f32,
            subtree_nodes: 3.0,
            cut_references: 3.0,
            subtree_references: 6.0,
            subtrees: 8.0 / exact as f32,
            arena: KdEstimate::ARENA,
        }
    }

    /// [`KdEstimate::arena`] of a scene of which nothing is known.
    const ARENA: f32 = 6.0;
}

/// What a build needed, in the scratch memory at [`KdBuilder::report_range`] when it has run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct KdReport {
    /// Bits of [`crate::bvh::layout::status`].
    pub status: u32,
    /// References of the largest level, with what straddles a plane twice.
    pub level_references: u32,
    /// Nodes of all levels.
    pub level_nodes: u32,
    /// Nodes of subtrees below their roots.
    pub subtree_nodes: u32,
    /// References of all leaves if nothing was split any more, at the level where that is most.
    pub cut_references: u32,
    /// References of subtrees.
    pub subtree_references: u32,
    /// Subtrees.
    pub subtrees: u32,
    /// One more than the level that was split no further for want of room, or 0. What the levels below it would have needed is not
    /// known: a build by [`KdReport::estimate`] comes farther, and reports it.
    ///
    /// Of a build by [`KdSchedule::AcrossLevels`] 1 for want of room: then the counts above are what there was room for, of what was
    /// short, and half of that of other things. It has no `level_references`; its `cut_references` are those of leaves outside of
    /// subtrees.
    pub ended: u32,
    /// References of the arena that a build by [`KdSchedule::AcrossLevels`] has used. The number depends on which worker was first.
    pub arena: u32,
    /// Times that a workgroup took a task, or chunks of one, out of a pool: N_R in the tables of Papay 2025. A chain has as many
    /// tasks, and no pool.
    pub retrievals: u32,
    /// Steps of tasks that a workgroup went on with by itself instead: N_SR there. 0 by levels.
    pub skipped_retrievals: u32,
}

impl KdReport {
    /// What suffices exactly for the scene of this many primitives; twice what was asked for if levels were cut off.
    pub fn estimate(&self, primitive_count: u32) -> KdEstimate {
        let more = if self.ended > 0 { 2.0 } else { 1.0 };
        let each =
            |count: u32| (f64::from(count) * more / f64::from(primitive_count.max(1))) as f32 * (1.0 + f32::EPSILON);
        KdEstimate {
            level_references: each(self.level_references),
            level_nodes: each(self.level_nodes),
            subtree_nodes: each(self.subtree_nodes),
            cut_references: each(self.cut_references),
            subtree_references: each(self.subtree_references),
            subtrees: each(self.subtrees),
            arena: if self.arena == 0 { KdEstimate::ARENA } else { each(self.arena) * across::MARGIN },
        }
    }
}

/// The builder, for one device, its options and a number of triangles.
#[derive(Debug, Clone)]
pub struct KdBuilder {
    options: KdOptions,
    schedule: KdSchedule,
    count: u32,
    shape: KdShape,
    room: BuildRoom,
}

/// How work is cut for a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct KdShape {
    pub workgroup: u32,
    /// Invocations of a workgroup that has a subtree, or little else than one subgroup can do.
    pub narrow: u32,
    items: u32,
    pub groups: u32,
    /// Workgroups that build subtrees.
    pub subtree_groups: u32,
}

/// How much there is room for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct BuildRoom {
    pub level_references: u32,
    pub tasks: u32,
    pub chunks: u32,
    pub subtrees: u32,
    /// Nodes of levels, and those that there are before.
    pub level_nodes: u32,
    /// Of the structure.
    pub nodes: u32,
    /// References of all leaves if nothing was split any more, and those that there are before.
    pub cut_references: u32,
    /// Of the structure.
    pub references: u32,
    /// Of the structure.
    pub records: u32,
}

/// As `glsl/kdtree/` has them.
pub(super) const STATE_BYTES: u64 = 3584;
const _: () = assert!(KD_STATE_BYTES <= MERGE_AT && MERGE_AT + KD_MERGE_BYTES <= STATE_BYTES);
const REPORT_AT: u64 = size_of::<task_pool::State>() as u64;
const REFERENCE_BYTES: u64 = 28;
const TASK_BYTES: u64 = 60;
/// What a workgroup has for a subtree of up to `exact` references.
pub(super) const fn stack_bytes(exact: u64) -> u64 {
    36 * MAX_DEPTH
        + REFERENCE_BYTES * exact * MAX_DEPTH
        + size_of::<KdNode>() as u64 * (MOST_NODES + 2)
        + 4 * (MOST_NODES / 2 + 2) * exact
}
pub(super) const TILE: u32 = 256;
const SUMS_BYTES: u64 = 36;
const SUBTREE_BYTES: u64 = 40;
const MAX_DEPTH: u64 = layout::MAX_DEPTH as u64;
const MOST_NODES: u64 = 254;
/// The most triangles: references of a level are numbered twice over in 30 bits.
pub const MAX_COUNT: u32 = 1 << 27;

impl BuildRoom {
    pub fn of(options: &KdOptions, count: u32, chunk: u32) -> BuildRoom {
        let KdEstimate {
            level_references,
            level_nodes,
            subtree_nodes,
            cut_references,
            subtree_references,
            subtrees,
            ..
        } = options.estimate.unwrap_or(KdEstimate::for_exact(options.exact));
        // A little more where a scene is small, and what the layout can name at most.
        let each = |of_each: f32, at_least: u32, most: u64| {
            let wanted = (f64::from(of_each.max(0.0)) * f64::from(count)).ceil() as u64 + u64::from(at_least);
            wanted.min(most) as u32
        };
        let level = each(level_references.max(1.0), 64, 1 << 29);
        let large = level / (options.exact + 1) + 1;
        let more = |of: u32, more: u32, most: u64| (u64::from(of) + u64::from(more)).min(most) as u32;
        let level_nodes = more(each(level_nodes, 16, layout::MAX_NODES / 4), options.more.nodes, layout::MAX_NODES / 4);
        let cut_references = each(cut_references.max(1.0), 64, layout::MAX_REFERENCES / 2);
        let cut_references = more(cut_references, options.more.references, layout::MAX_REFERENCES / 2);
        BuildRoom {
            level_references: level,
            tasks: 2 * large,
            chunks: (level / chunk + large + 1).max(count.div_ceil(chunk) + 1),
            subtrees: each(subtrees, 16, 1 << 28),
            level_nodes,
            nodes: level_nodes + each(subtree_nodes, 256, layout::MAX_NODES / 4 * 3),
            cut_references,
            references: cut_references + each(subtree_references, 512, layout::MAX_REFERENCES / 2),
            records: more(count, options.more.records, u32::MAX.into()),
        }
    }
}

impl KdShape {
    pub fn of(context: &Context, options: &KdOptions, count: u32, schedule: KdSchedule) -> KdShape {
        let tuning = &context.tuning.kd;
        // Two invocations look at the two parts of a reference.
        let narrow = context.limits.subgroup_size.max(2);
        let most = |groups: u32| (count / options.exact).clamp(1, groups.max(1));
        // A stack is as large as what 256 triangles or so have besides: more than 1,024 where they are little among the rest.
        let subtree_groups = most(tuning.subtree_groups.min((count / 256).max(1024)));
        if schedule == KdSchedule::Persistent {
            let groups = options.workgroups.unwrap_or(most(tuning.groups));
            return KdShape { workgroup: narrow, groups, subtree_groups: groups, ..KdShape::with(narrow, tuning) };
        }
        let subtree_groups = match schedule {
            KdSchedule::AcrossLevels => options.workgroups.unwrap_or(subtree_groups),
            _ => subtree_groups,
        };
        KdShape { narrow, groups: most(tuning.groups), subtree_groups, ..KdShape::with(tuning.group.max(2), tuning) }
    }

    fn with(workgroup: u32, tuning: &KdTuning) -> KdShape {
        KdShape {
            workgroup,
            narrow: workgroup,
            items: (tuning.chunk / tuning.group).max(1),
            groups: 1,
            subtree_groups: 1,
        }
    }

    fn is_narrow(shader: &Shader) -> bool {
        let narrow = [&shaders::KDTREE_BUILDER_SUBTREES, &shaders::KDTREE_BUILDER_PLACE, &shaders::KDTREE_MERGE_GATHER];
        narrow.contains(&shader) || across::SHADERS.contains(&shader)
    }

    /// Workgroups of `shader` where others of the phase have `groups`: as many invocations, as far as each workgroup has memory for
    /// what waits.
    pub fn groups_of(&self, shader: &Shader, groups: u32) -> u32 {
        let narrower = (self.workgroup / self.narrow).max(1);
        if KdShape::is_narrow(shader) { groups.saturating_mul(narrower).min(self.subtree_groups) } else { groups }
    }

    pub fn chunk(&self) -> u32 {
        self.workgroup * self.items
    }

    pub fn kernel(&self, shader: &'static Shader, options: &KdOptions, input: &Input) -> Kernel {
        let source = input.source_constant(Primitives::Triangles);
        // The fourth is of other kernels that read primitives.
        let constants = [self.items, options.bins, options.exact, 0, source];
        let workgroup = if KdShape::is_narrow(shader) { self.narrow } else { self.workgroup };
        Kernel::new(shader, workgroup, &constants)
    }

    /// Scratch memory of a build with so much room.
    pub fn scratch(&self, options: &KdOptions, room: &BuildRoom) -> u64 {
        let BuildRoom { level_references, tasks, chunks, subtrees, level_nodes, nodes, references, .. } = *room;
        let of = |count: u32, bytes: u64| u64::from(count) * bytes;
        let counters = of(level_references / self.chunk() + 1, 4 * (6 * u64::from(options.bins) + 1));
        let stack = stack_bytes(options.exact.into());
        let tiles = |count: u32| count.div_ceil(TILE);
        let scratch = STATE_BYTES
            + of(level_references, 2 * REFERENCE_BYTES + 4)
            + of(tasks, 2 * TASK_BYTES)
            + of(subtrees, SUBTREE_BYTES)
            + of(chunks + 1, 8)
            + counters
            + of(tiles(chunks), 4)
            + of(tiles(chunks) + 1, 8)
            + of(tiles(tasks) + 1, SUMS_BYTES)
            + of(tiles(subtrees), 8)
            + of(nodes - level_nodes, size_of::<KdNode>() as u64)
            + of(references, 4)
            + of(self.subtree_groups, stack);
        scratch.next_multiple_of(16)
    }
}

impl arguments::KdBuild {
    /// Of a build with so much room; `depth_limit` and `leaf_size` go by what `input` has.
    pub(super) fn new(
        options: &KdOptions,
        room: &BuildRoom,
        input: &Input,
        structure: u64,
        scratch: u64,
    ) -> arguments::KdBuild {
        let (geometry, formats) = input.for_kernels();
        let count = input.primitive_count;
        arguments::KdBuild {
            vertices: geometry.vertices,
            indices: geometry.indices,
            transform: geometry.transform,
            structure,
            state: scratch,
            vertex_stride: geometry.vertex_stride,
            vertex_count: geometry.vertex_count,
            formats,
            primitive_count: count,
            c_t: options.costs.c_t,
            c_i: options.costs.c_i,
            bin_part: 2.0 / options.bins as f32,
            depth_limit: depth_limit(count),
            leaf_size: leaf_size(count),
            level: 0,
            reference_capacity: room.level_references,
            task_capacity: room.tasks,
            chunk_capacity: room.chunks,
            subtree_capacity: room.subtrees,
            node_room: room.nodes,
            level_node_room: room.level_nodes,
            reference_room: room.references,
            cut_room: room.cut_references,
            build_flags: options.build_flags,
            record_room: room.records,
            first_tile: 0,
            first_primitive: 0,
        }
    }
}

/// The steps of all levels. `step` makes one of a phase, a shader, a level and a number of workgroups.
pub(super) fn levels(
    depth_limit: u32,
    groups: u32,
    step: impl Fn(&'static str, &'static Shader, u32, u32) -> Step,
) -> Vec<Step> {
    let of_level: [(&'static str, &'static Shader); 5] = [
        ("subtrees", &shaders::KDTREE_BUILDER_SUBTREES),
        ("bin", &shaders::KDTREE_BUILDER_BIN),
        ("classify", &shaders::KDTREE_BUILDER_CLASSIFY),
        ("scan", &shaders::KDTREE_BUILDER_SCAN),
        ("distribute", &shaders::KDTREE_BUILDER_DISTRIBUTE),
    ];
    let level = |level| of_level.map(|(phase, shader)| step(phase, shader, level, groups));
    (0..=depth_limit).flat_map(level).collect()
}

impl KdBuilder {
    /// A builder of `primitive_count` triangles on the device of `context`.
    ///
    /// # Errors
    /// An option out of range; more triangles than [`MAX_COUNT`].
    pub fn new(context: &Context, options: &KdOptions, primitive_count: u32) -> Result<KdBuilder> {
        options.check()?;
        if primitive_count > MAX_COUNT {
            return Err(Error::Argument(format!(
                "{primitive_count} triangles: a kd-tree holds at most {MAX_COUNT}; split the mesh"
            )));
        }
        let schedule = options.schedule_on(context);
        let shape = KdShape::of(context, options, primitive_count, schedule);
        let room = match schedule {
            KdSchedule::AcrossLevels => across::room(options, primitive_count, &shape),
            _ => BuildRoom::of(options, primitive_count, shape.chunk()),
        };
        Ok(KdBuilder { options: *options, schedule, count: primitive_count, shape, room })
    }

    /// The schedule that is used: that of the options, or the choice for the device.
    pub fn schedule(&self) -> KdSchedule {
        self.schedule
    }

    /// Triangles that it is for.
    pub fn count(&self) -> u32 {
        self.count
    }

    /// Bytes of the structure and of the scratch memory: exactly what [`KdBuilder::record`] uses. A build by
    /// [`KdSchedule::AcrossLevels`] that is given more scratch memory has so much more for what it takes as it goes.
    pub fn sizes(&self) -> Sizes {
        let scratch = match self.schedule {
            KdSchedule::AcrossLevels => across::scratch(&self.options, &self.room),
            _ => self.shape.scratch(&self.options, &self.room),
        };
        Sizes { structure: self.header().offsets().bytes, scratch, alignment: 16 }
    }

    /// What the structure's header will say of its primitives, its geometries and its room, and nothing else.
    pub fn header(&self) -> KdHeader {
        KdHeader {
            primitive_count: self.count,
            node_room: self.room.nodes,
            reference_room: self.room.references,
            record_room: self.room.records,
            geometry_count: self.options.geometry_count,
            ..KdHeader::zeroed()
        }
    }

    /// Where in the scratch memory the [`KdReport`] is, in bytes.
    pub fn report_range(&self) -> Range<u64> {
        REPORT_AT..REPORT_AT + size_of::<KdReport>() as u64
    }

    fn kernel(&self, shader: &'static Shader, input: &Input) -> Kernel {
        self.shape.kernel(shader, &self.options, input)
    }

    /// Records the build of `input` into `structure`, with scratch memory, of the bytes and alignment of [`KdBuilder::sizes`].
    ///
    /// Before, the caller makes the input visible to compute shaders. After, it places a barrier from compute shader writes to
    /// whatever reads the structure or the report, or writes the scratch memory. Labels: `encode`; `subtrees`, `bin`,
    /// `classify`, `scan` and `distribute` of each level; `place`. Or `build` where the schedule is persistent; or `encode`, `pool`
    /// and `place` across levels, where `pool` is the thesis' T_TP.
    ///
    /// # Errors
    /// The memory is too small; the input has another number of triangles or geometries than the builder; a pipeline could not
    /// be made.
    pub fn record(&self, recorder: &mut Recorder<'_>, input: &Input, structure: Region, scratch: Region) -> Result<()> {
        let sizes = self.sizes();
        let structure = structure.checked("memory for a kd-tree", sizes.structure, sizes.alignment)?;
        let scratch_at = scratch.checked("scratch memory for a kd-tree", sizes.scratch, sizes.alignment)?;
        if self.schedule == KdSchedule::AcrossLevels {
            let bytes = if scratch.is_unbounded() { sizes.scratch } else { scratch.bytes };
            let room = across::grown(&self.options, &self.room, bytes);
            let arguments =
                arguments::KdBuild { reference_capacity: room, ..self.arguments(input, structure, scratch_at)? };
            return recorder.chains(&[across::steps(&self.shape, &self.options, input, &arguments)]);
        }
        recorder.chains(&[self.steps(input, structure, scratch_at)?])
    }

    fn arguments(&self, input: &Input, structure: u64, scratch: u64) -> Result<arguments::KdBuild> {
        let geometry_count = self.options.geometry_count;
        let planned = Planned { primitives: Primitives::Triangles, primitive_count: self.count, geometry_count };
        planned.check(input)?;
        Ok(arguments::KdBuild::new(&self.options, &self.room, input, structure, scratch))
    }

    fn steps(&self, input: &Input, structure: u64, scratch: u64) -> Result<Vec<Step>> {
        let arguments = self.arguments(input, structure, scratch)?;
        let groups = self.shape.groups;
        let step = |phase, shader: &'static Shader, level, groups| {
            let groups = self.shape.groups_of(shader, groups);
            Step::new(phase, self.kernel(shader, input), &arguments::KdBuild { level, ..arguments }, groups)
        };
        if self.schedule == KdSchedule::Persistent {
            return Ok(vec![
                step("build", &shaders::KDTREE_BUILDER_RESET, 0, 1),
                step("build", &shaders::KDTREE_BUILDER_PERSISTENT, 0, groups),
            ]);
        }
        let encode = [
            (&shaders::KDTREE_BUILDER_RESET, 1),
            (&shaders::KDTREE_BUILDER_COUNT, groups),
            (&shaders::KDTREE_BUILDER_PLAN, 1),
            (&shaders::KDTREE_BUILDER_RECORDS, groups),
            (&shaders::KDTREE_BUILDER_ROOT, 1),
        ];
        let place = [(&shaders::KDTREE_BUILDER_ORDER, groups), (&shaders::KDTREE_BUILDER_PLACE, groups)];
        let mut steps = Vec::new();
        steps.extend(encode.map(|(shader, groups)| step("encode", shader, 0, groups)));
        steps.extend(levels(arguments.depth_limit, groups, step));
        steps.extend(place.map(|(shader, groups)| step("place", shader, 0, groups)));
        Ok(steps)
    }
}
