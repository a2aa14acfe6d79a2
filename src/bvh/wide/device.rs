//! Collapsing a `Bvh2` into a wide tree on the device (glsl/bvh/wide/collapse.glsl); [`crate::bvh::twin::wide`] is the twin.

use super::{Form, pairs};
use crate::bvh::counts::LinkCount;
use crate::bvh::far;
use crate::bvh::geometry::Primitives;
use crate::bvh::layout::{NODES_OFFSET, node_slots};
use crate::gpu::arguments;
use crate::gpu::plan::Plan;
use crate::gpu::{Context, Grid, Kernel, Recorder, Region, Sizes, Step, fill, scan, shaders};
use crate::{Error, Result};
use std::ops::Range;

/// What is collapsed into what.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WideOptions {
    /// The nodes of the wide tree.
    pub form: Form,
    /// What the leaves hold.
    pub primitives: Primitives,
    /// How many geometries.
    pub geometry_count: u32,
}

/// Counts of a source's links that wide nodes learn from ([`LinkCount`] × 2 for each node slot that a source of so many primitives has,
/// aligned to 4 bytes); none of them unless told.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct WideCounts {
    /// Nodes are made to cost least by the rays that went into them, rather than by surface area.
    pub opened_by: Option<Region>,
    /// Of a source whose children have an order, those of a wide node come first that end more rays for their work: by rays that were
    /// counted exhaustively ([`crate::trace::counts::CountedWalk::Exhaustive`]). Without it they come as the walk of the source meets
    /// them, where a child that ends few rays may come early as it lies beside one that ends many.
    pub ordered_by: Option<Region>,
}

/// Collapses a `Bvh2` of any builder, with at most a given number of primitives, into a wide tree.
#[derive(Debug, Clone, Copy)]
pub struct WidePass {
    options: WideOptions,
    count: u32,
    /// Of steps that take slots or records, and of those that take wide nodes.
    grid: Grid,
    node_grid: Grid,
    few: u32,
    alone: u32,
    scan: scan::Scan,
}

/// Levels from the root on that one workgroup opens: not more than a few hundred nodes.
const FIRST_LEVELS: u32 = 3;
/// Levels, at most, that are above those that one workgroup opens at the end.
const LEVELS: u32 = 16;

const PHASE: &str = "wide";

/// Wide nodes of an invocation in a piece, whatever the device: they are few, and each is much work. On two cores opening and writing them
/// took twice as long in pieces of 64.
const NODE_ROUNDS: u32 = 4;

/// Slots of the source in a block, of which there are sums (wide/collapse.glsl). One node in some ten begins a wide one: a scan of all slots
/// took 3 to 4% of a build.
const SLOTS_OF_BLOCK: u32 = 16;

/// Words of `Levels` in wide/collapse.glsl.
const LEVEL_WORDS: u64 = 64 + 65 + 1;

/// Memory of a collapsing, by address: of the bytes of [`WidePass::sizes`], or in pieces.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WideMemory {
    /// For the wide tree.
    pub target: u64,
    /// [`WidePass::passing_bytes`], until the nodes are there.
    pub passing: u64,
    /// [`WidePass::lasting_bytes`].
    pub lasting: u64,
    /// Where the records of the source are while nodes are made, and while records are: of one that has the numbers of its primitives in
    /// their place, otherwise 0.
    pub records: [u64; 2],
}

/// What collapsing does, as far as memory is used in one and free in the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum WidePhase {
    /// What subtrees cost is found, from the leaves up.
    Costs,
    /// Nodes are opened, level by level.
    Open,
    /// Triangles find those that they share a record with.
    Pair,
    /// What they have becomes where it goes.
    Scan,
    Nodes,
    Records,
}

/// The plan of the scratch memory, and where its parts begin, in bytes.
struct Scratch {
    /// What is in use until the nodes are there, and what is until the records are.
    passing: Plan<WidePhase>,
    lasting: Plan<WidePhase>,
    /// Of each of the source's slots: what was chosen; a node that a climb begins at; what names the node, and its costs.
    choices: u64,
    starts: u64,
    costs: u64,
    levels: u64,
    opened: u64,
    slots: u64,
    /// Of blocks of slots; what is summed up begins behind the first word of each.
    blocks: u64,
    /// Of quantised nodes.
    units: u64,
    places: u64,
    /// Of quantised trees of triangles.
    partners: u64,
    sums: u64,
}

impl WidePass {
    /// For a source built of `primitive_count` primitives, or of fewer.
    pub fn new(context: &Context, options: &WideOptions, primitive_count: u32) -> WidePass {
        let tuning = &context.tuning;
        let scan = scan::Scan::new(context, sums_of(options.form) * (blocks_of(node_slots(primitive_count)) + 1));
        WidePass {
            options: *options,
            count: primitive_count,
            grid: Grid::of(context),
            node_grid: Grid { rounds: NODE_ROUNDS, ..Grid::of(context) },
            few: tuning.group,
            alone: tuning.wide_alone,
            scan,
        }
    }

    /// Bytes of the wide structure, at most (its header says how many are in use: [`Form::bytes_in_use`]), and of the scratch
    /// memory.
    pub fn sizes(&self) -> Sizes {
        let WideOptions { form, primitives, geometry_count } = self.options;
        let nodes = form.nodes_at_most(self.count);
        let far = if form.is_quantised() && primitives == Primitives::Instances { far::BYTES } else { 0 };
        let structure = form.bytes(primitives.record_bytes(), nodes, self.count, geometry_count) + far;
        Sizes { structure, scratch: self.passing_bytes() + self.lasting_bytes(), alignment: 16 }
    }

    fn scratch(&self) -> Scratch {
        let (mut passing, mut lasting) = (Plan::new(), Plan::new());
        let take_of = |plan: &mut Plan<WidePhase>, name, words: u64, life| {
            Plan::<WidePhase>::UNIT * u64::from(plan.take(name, 4 * words, life))
        };
        let mut take = |name, words: u64, life| take_of(&mut passing, name, words, life);
        let form = self.options.form;
        let (nodes, width) = (u64::from(form.nodes_at_most(self.count)), u64::from(form.width()));
        let of_slots = u64::from(node_slots(self.count));
        let choices = take("choices, and how many nodes each names", of_slots, WidePhase::Costs..=WidePhase::Nodes);
        let mut of_costs = |name, words| take(name, words * of_slots, WidePhase::Costs..=WidePhase::Costs);
        let starts = of_costs("starts of climbs", 1);
        let costs = of_costs("what names nodes, and costs in so many places", width);
        let levels = take("levels", LEVEL_WORDS, WidePhase::Open..=WidePhase::Nodes);
        let opened = take("opened nodes", 2 * nodes, WidePhase::Open..=WidePhase::Nodes);
        let children = take("what names their children", width * nodes, WidePhase::Open..=WidePhase::Nodes);
        let is_quantised = form.is_quantised();
        let blocks = take("blocks of slots", self.block_words(), WidePhase::Open..=WidePhase::Nodes);
        let units = if is_quantised { take("units", of_slots, WidePhase::Open..=WidePhase::Nodes) } else { 0 };
        let sums = take("sums of tiles", self.scan.sums_words().into(), WidePhase::Scan..=WidePhase::Scan);
        let records = u64::from(self.count);
        let mut take = |name, words: u64, life| take_of(&mut lasting, name, words, life);
        let places =
            if is_quantised { take("places of records", records, WidePhase::Nodes..=WidePhase::Records) } else { 0 };
        let partners =
            if self.is_paired() { take("partners", records, WidePhase::Pair..=WidePhase::Records) } else { 0 };
        let slots = children;
        Scratch {
            passing,
            lasting,
            choices,
            starts,
            costs,
            levels,
            opened,
            slots,
            blocks,
            units,
            places,
            partners,
            sums,
        }
    }

    /// Of each block which slots are opened, then what is summed up, of every block and one more.
    fn block_words(&self) -> u64 {
        let block_count = u64::from(blocks_of(node_slots(self.count)));
        block_count + u64::from(sums_of(self.options.form)) * (block_count + 1)
    }

    /// Bytes of scratch memory that are in use until the nodes are there.
    pub(crate) fn passing_bytes(&self) -> u64 {
        self.scratch().passing.bytes()
    }

    /// Bytes of scratch memory that are in use to the end.
    pub(crate) fn lasting_bytes(&self) -> u64 {
        self.scratch().lasting.bytes()
    }

    /// Where records lie in a wide structure of as many nodes as there can be: behind it a tree has nothing but records.
    pub(crate) fn behind_all_nodes(&self) -> u64 {
        let form = self.options.form;
        (NODES_OFFSET + u64::from(form.nodes_at_most(self.count)) * form.node_bytes()).next_multiple_of(16)
    }

    /// Whether two records may be one.
    fn is_paired(&self) -> bool {
        self.options.form.is_quantised() && self.options.primitives == Primitives::Triangles
    }

    fn kernel(&self, shader: &'static shaders::Shader, [by_visits, by_hits]: [bool; 2]) -> Kernel {
        let grid = if takes_nodes(shader) { self.node_grid } else { self.grid };
        let workgroup = if one_workgroup(shader) { self.few } else { grid.workgroup };
        let WideOptions { form, .. } = self.options;
        let quantised = u32::from(form.is_quantised());
        // What `SOURCE_WORD` of glsl/bvh/geometry.glsl is without a value.
        let source_word = 0;
        let [by_hits, by_visits] = [by_hits, by_visits].map(u32::from);
        let constants = [grid.word(), form.width(), quantised, by_hits, source_word, by_visits];
        Kernel::new(shader, workgroup, &constants)
    }

    /// Whether one workgroup does everything.
    fn is_alone(&self) -> bool {
        self.options.form.nodes_at_most(self.count) <= self.alone
    }

    /// The levels that are opened by many workgroups, a dispatch each. Those before and behind are done by one workgroup, which
    /// ends where the tree does; trees of scenes have ended by then. No dispatches for a tree that is small at all.
    fn levels_by_many(&self) -> Range<u32> {
        let nodes = self.options.form.nodes_at_most(self.count);
        if self.is_alone() {
            return 0..0;
        }
        // A full tree has as many levels as the logarithm; trees of scenes have less than twice that.
        let full = nodes.ilog2() / self.options.form.width().ilog2() + 1;
        FIRST_LEVELS..(2 * full).clamp(FIRST_LEVELS, LEVELS)
    }

    /// Records the collapsing of the `Bvh2` at address `source` into the wide tree `target`, with scratch memory, of the bytes
    /// and alignment of [`WidePass::sizes`]. The phase is `wide`.
    ///
    /// The source is left as it is; the target stands alone. The caller places a barrier (shader write to shader read and
    /// write) before and behind.
    ///
    /// # Errors
    /// The memory is too small; more triangles than quantised nodes can hold; a pipeline could not be made.
    pub fn record(&self, recorder: &mut Recorder<'_>, source: u64, target: Region, scratch: Region) -> Result<()> {
        self.record_by_counts(recorder, source, &WideCounts::default(), target, scratch)
    }

    /// Records the same by counts of the source's links.
    ///
    /// # Errors
    /// As [`WidePass::record`].
    pub fn record_by_counts(
        &self,
        recorder: &mut Recorder<'_>,
        source: u64,
        counts: &WideCounts,
        target: Region,
        scratch: Region,
    ) -> Result<()> {
        let counts_bytes = 2 * size_of::<LinkCount>() as u64 * u64::from(node_slots(self.count));
        let checked = |counts: Option<Region>, what| counts.map_or(Ok(0), |c| c.checked(what, counts_bytes, 4));
        let visits = checked(counts.opened_by, "counts of rays by which wide nodes are opened")?;
        let hits = checked(counts.ordered_by, "counts of rays by which children of wide nodes are put in order")?;
        recorder.chains(&[self.steps(source, [visits, hits], target, scratch)?])
    }

    /// What is recorded, a step behind the other. Addresses of counts are 0 where there are none.
    pub(crate) fn steps(
        &self,
        source: u64,
        [visits, hits]: [u64; 2],
        target: Region,
        scratch: Region,
    ) -> Result<Vec<Step>> {
        let sizes = self.sizes();
        let target = target.checked("memory for a wide tree", sizes.structure, sizes.alignment)?;
        let scratch = scratch.checked("scratch memory for a wide tree", sizes.scratch, sizes.alignment)?;
        let memory = WideMemory { target, passing: scratch + self.lasting_bytes(), lasting: scratch, records: [0; 2] };
        Ok(self.steps_in(source, [visits, hits], &memory)?.concat())
    }

    /// The same in memory that may be in pieces: the steps up to the nodes, and those that write the records.
    pub(crate) fn steps_in(
        &self,
        source: u64,
        [visits, hits]: [u64; 2],
        memory: &WideMemory,
    ) -> Result<[Vec<Step>; 2]> {
        if self.is_paired() && self.count > pairs::TRIANGLES_AT_MOST {
            return Err(Error::Argument(format!(
                "{} triangles in quantised nodes: they hold at most {}; split the mesh or take another form",
                self.count,
                pairs::TRIANGLES_AT_MOST
            )));
        }
        let form = self.options.form;
        let parts = self.scratch();
        let WideMemory { target, passing, lasting, records } = *memory;
        let arguments = arguments::WideCollapse {
            source,
            target,
            levels: passing + parts.levels,
            opened: passing + parts.opened,
            starts: passing + parts.starts,
            costs: passing + parts.costs,
            choices: passing + parts.choices,
            visits,
            hits,
            slots: passing + parts.slots,
            blocks: passing + parts.blocks,
            units: passing + parts.units,
            places: lasting + parts.places,
            partners: lasting + parts.partners,
            given_records: records[0],
            source_slots: node_slots(self.count),
            capacity: form.nodes_at_most(self.count),
            level: 0,
            level_end: 0,
        };
        let step = |shader, arguments: &arguments::WideCollapse, groups| {
            Step::new(PHASE, self.kernel(shader, [visits != 0, hits != 0]), arguments, groups)
        };
        if self.is_alone() && records == [0; 2] {
            return Ok([vec![step(&shaders::BVH_WIDE_ALONE, &arguments, 1)], Vec::new()]);
        }
        let of_slots = self.grid.groups_for(arguments.source_slots);
        let mut steps = vec![
            step(&shaders::BVH_WIDE_LINKS, &arguments, of_slots),
            step(&shaders::BVH_WIDE_COSTS, &arguments, of_slots),
            fill::step(PHASE, arguments.blocks, self.block_words() as u32, 0),
        ];
        let few = |level, level_end| {
            (&shaders::BVH_WIDE_OPEN_FEW, arguments::WideCollapse { level, level_end, ..arguments }, 1)
        };
        let groups = self.node_grid.groups_for(arguments.capacity);
        let many = |level| (&shaders::BVH_WIDE_OPEN, arguments::WideCollapse { level, ..arguments }, groups);
        let by_many = self.levels_by_many();
        let first = Some(few(0, by_many.start)).filter(|_| by_many.start > 0);
        let last = few(by_many.end, form.levels());
        let levels = first.into_iter().chain(by_many.map(many)).chain([last]);
        steps.extend(levels.map(|(shader, arguments, groups)| step(shader, &arguments, groups)));
        if self.is_paired() {
            steps.push(step(&shaders::BVH_WIDE_PAIR, &arguments, groups));
        }
        let sums = passing + parts.sums;
        // Behind which slots are opened.
        let [values, results] = [arguments.blocks + 4 * u64::from(blocks_of(arguments.source_slots)); 2];
        steps.extend(self.scan.steps(PHASE, &scan::ScanBuffers { values, results, sums }));
        steps.push(step(&shaders::BVH_WIDE_NODES, &arguments, groups));
        let arguments = arguments::WideCollapse { given_records: records[1], ..arguments };
        let write = step(&shaders::BVH_WIDE_RECORDS, &arguments, self.grid.groups_for(self.count));
        Ok([steps, vec![write]])
    }
}

/// Whether a step is dispatched as one workgroup.
fn one_workgroup(shader: &'static shaders::Shader) -> bool {
    [&shaders::BVH_WIDE_OPEN_FEW, &shaders::BVH_WIDE_ALONE].contains(&shader)
}

/// Blocks of so many slots.
const fn blocks_of(slots: u32) -> u32 {
    slots.div_ceil(SLOTS_OF_BLOCK)
}

/// How many words of each block are summed up: the nodes that are named in it, and of quantised nodes the units of their records.
const fn sums_of(form: Form) -> u32 {
    1 + form.is_quantised() as u32
}

/// Whether a step takes wide nodes.
fn takes_nodes(shader: &'static shaders::Shader) -> bool {
    [&shaders::BVH_WIDE_OPEN, &shaders::BVH_WIDE_PAIR, &shaders::BVH_WIDE_NODES].contains(&shader)
}
