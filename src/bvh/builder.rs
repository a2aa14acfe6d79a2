//! Trees over triangles, boxes or instances, built on the device in the caller's command buffer and memory.
//!
//! [`Builder::sizes`] gives the memory that a build needs, [`Builder::record`] records the build. What all methods begin with
//! is in `encode.rs`; each [`Method`] has a file of its own, and a twin in [`super::twin`] with the same bytes.

use super::child_order::{ChildOrder, ChildOrderPass};
use super::codes::{Code, Codes};
use super::encode::{Encode, PAIR_BLOCK};
pub use super::geometry::{Geometry, Input, Primitives, Source};
pub use super::hlbvh::Treelets;
pub use super::hploc::Window;
use super::lbvh_workgroup::{self, SmallBuild};
use super::method::Hierarchy;
pub use super::method::Method;
pub use super::method::PersistentShaders;
use super::reinsertion::{self, Areas, Reinsertion};
use super::sah::Collapse;
use super::scratch::{CLUSTER_BYTES, Scratch};
use super::split::{self, Split};
use super::{collapse, hploc, layout};
use crate::gpu::arguments;
use crate::gpu::radix_sort::{self, SortShape};
use crate::gpu::{ArgumentTable, BuildTuning, Context, Recorder, Region, Sizes, Step};
use crate::{Error, Result};

/// What to build, beside the primitives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BuildOptions {
    /// The method that makes the tree.
    pub method: Method,
    /// The codes; `None` lets [`Codes::for_count`] choose them from the number of primitives.
    pub codes: Option<Codes>,
    /// Lets the device take as many bits of codes as the primitives' spread needs, from those of the codes on ([`Codes::by_spread`]), up to
    /// 32 or 64. A build is recorded, and has memory, for the most; passes of the sort that are not needed return at once. `None` takes
    /// the codes' bits. For robust codes alone.
    pub bits_up_to: Option<u32>,
    /// Splitting of large triangles into several references, before everything else; `None` splits none.
    pub split: Option<split::SplitOptions>,
    /// Whether two triangles that lie near each other in the input and share an edge may be one leaf from the start: fewer leaves to sort and
    /// to merge, for a tree that costs rays as much (docs/notes/rays.md). Of [`Method::Ploc`] and [`Method::Hploc`] over triangles:
    /// [`BuildOptions::can_pair`].
    pub pairs: bool,
    /// Rounds of reinsertion after the method: they take time and give a better tree.
    pub optimise: Option<reinsertion::ReinsertionOptions>,
    /// Whether a subtree becomes a leaf if that is cheaper.
    pub collapse: Collapse,
    /// The order of children for rays that end at their first hit; `None` leaves them as the method makes them.
    pub child_order: Option<ChildOrder>,
    /// How the phases are recorded; `None` takes the schedule that measured faster on such a device with this number of primitives.
    pub schedule: Option<Schedule>,
    /// What the tree is built over.
    pub primitives: Primitives,
    /// The number of geometries: the count of [`Source::Several`], or 1.
    pub geometry_count: u32,
    /// `vk::BuildAccelerationStructureFlagsKHR` for the header, at most 6 bits.
    pub build_flags: u32,
}

impl BuildOptions {
    /// An LBVH over one geometry of triangles. The rest follows from the scene and the device; SAH collapses leaves.
    pub const DEFAULT: BuildOptions = BuildOptions {
        method: Method::Lbvh,
        codes: None,
        bits_up_to: None,
        split: None,
        pairs: false,
        optimise: None,
        collapse: Collapse::SAH,
        child_order: None,
        schedule: None,
        primitives: Primitives::Triangles,
        geometry_count: 1,
        build_flags: 0,
    };
}

impl Default for BuildOptions {
    fn default() -> BuildOptions {
        BuildOptions::DEFAULT
    }
}

impl BuildOptions {
    /// Whether [`BuildOptions::pairs`] can be set beside the other options: triangles that are not split, a method that merges clusters, and
    /// codes that look at no sample of the triangles.
    pub fn can_pair(&self) -> bool {
        let merges = matches!(self.method, Method::Ploc { .. } | Method::Hploc(_));
        let samples = self.codes.is_some_and(|codes| codes.bounds.has_sections());
        merges && !samples && self.split.is_none() && self.primitives == Primitives::Triangles
    }

    /// Whether there are kernels for the schedule.
    fn takes(&self, schedule: Schedule) -> bool {
        match schedule {
            Schedule::Chain => true,
            Schedule::Persistent(_) => self.optimise.is_none(),
            Schedule::Workgroup => {
                let is_hploc = matches!(self.method, Method::Hploc(_)) && self.optimise.is_some();
                self.split.is_none() && (self.method == Method::Lbvh || is_hploc)
            }
        }
    }
}

/// How the phases of a build are recorded. The result is the same bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Schedule {
    /// One dispatch per phase, with barriers between. Works on every device. Where it is not asked for but chosen, one workgroup optimises
    /// and finishes a small tree.
    Chain,
    /// One persistent dispatch that draws tasks from a pool: [`Schedule::PERSISTENT`]. The device must keep running workgroups
    /// that it has started.
    Persistent(&'static PersistentShaders),
    /// One workgroup builds everything in one dispatch: for few primitives, at most [`Builder::WORKGROUP_MAX`]. Only
    /// [`Method::Lbvh`] has it; what optimises its tree comes behind it. [`Method::Hploc`] has it where its tree is optimised, in a dispatch for
    /// the order of the primitives and one for the hierarchy.
    Workgroup,
}

impl Schedule {
    /// The persistent schedule of every method. The builder never chooses it, so its shaders, the largest of all, are linked
    /// only into programs that name this constant.
    pub const PERSISTENT: Schedule = Schedule::Persistent(&PersistentShaders::ALL);
}

impl std::fmt::Display for Schedule {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Schedule::Chain => "chain",
            Schedule::Persistent(_) => "persistent",
            Schedule::Workgroup => "workgroup",
        })
    }
}

/// Builds structures over a number of primitives, on one device, with given options.
#[derive(Debug, Clone)]
pub struct Builder {
    method: Method,
    schedule: Schedule,
    optimise: Option<Reinsertion>,
    workers: u32,
    /// What merges the windows of [`Method::Hploc`].
    merging: hploc::Merging,
    encode: Encode,
    /// What puts children in order when the tree is there; [`Method::Lbvh`] does it on the way, if nothing moves them later.
    child_order: Option<ChildOrderPass>,
}

/// A builder with its input and memory, ready to be recorded.
#[derive(Debug, Clone, Copy)]
pub struct BuildJob<'a> {
    /// The builder.
    pub builder: &'a Builder,
    /// Its input.
    pub input: Input,
    /// Memory for the structure, of [`Builder::sizes`].
    pub structure: Region,
    /// Scratch memory, of [`Builder::sizes`].
    pub scratch: Region,
}

impl BuildJob<'_> {
    /// The addresses of structure and scratch memory.
    fn addresses(&self) -> Result<[u64; 2]> {
        let sizes = self.builder.sizes();
        let structure = self.structure.checked("memory for a BVH", sizes.structure, sizes.alignment)?;
        let scratch = self.scratch.checked("scratch memory for a BVH", sizes.scratch, sizes.alignment)?;
        Ok([structure, scratch])
    }
}

impl Codes {
    /// The codes that a tree of `primitive_count` triangles needs: about a thousand times as many cells as triangles, in whole
    /// passes of the sort. On scenes of 66k to 1.4M triangles that is 32 bits, and the SAH cost is within 0.6% of that with all
    /// 64; 24 bits would cost 1.3% at 111k triangles and 7.8% at 871k. Methods that look at boxes themselves need no bits for
    /// the size; without them, over thirteen scenes, the trees of PLOC and H-PLOC cost the same within 0.1%, and those of HLBVH
    /// 1.3% less for 1.4 times the build.
    pub fn for_count(primitive_count: u32) -> Codes {
        // Bits of an index, whatever the count: what is too much is refused, not computed with.
        let bits = 32 - (primitive_count.max(2) - 1).leading_zeros() + 10;
        Code::Emc64Var.full().with_bits(bits.next_multiple_of(8))
    }
}

/// Bytes of shared memory that the kernels of builds take beside the sort's and a method's own, at most: ends of climbs, partial
/// sums, the pool.
const SHARED_BY_ALL: u32 = 4096;

impl Builder {
    /// The most primitives that [`Schedule::Workgroup`] takes.
    pub const WORKGROUP_MAX: u32 = 1 << 16;

    /// A builder of `primitive_count` primitives on the device of `context`.
    ///
    /// # Errors
    /// More primitives than a build can take; a schedule that the method does not have; splitting of primitives that are not
    /// triangles.
    pub fn new(context: &Context, options: &BuildOptions, primitive_count: u32) -> Result<Builder> {
        if primitive_count > radix_sort::MAX_COUNT {
            return Err(Error::Argument(format!(
                "{primitive_count} primitives: a structure holds at most {}; split the mesh",
                radix_sort::MAX_COUNT
            )));
        }
        if let Some(split) = options.split {
            split.check()?;
            if options.primitives != Primitives::Triangles {
                return Err(Error::Argument(format!(
                    "{:?} cannot be split, only triangles; build without split",
                    options.primitives
                )));
            }
        }
        if options.pairs && !options.can_pair() {
            let codes = options.codes.map_or(String::new(), |codes| format!(" by codes {codes}"));
            let split = if options.split.is_some() { ", split" } else { "" };
            return Err(Error::Argument(format!(
                "pairs of {:?}{split}, by {:?}{codes}: only triangles that are not split are paired, by PLOC or H-PLOC and codes without \
                 robust bounds or such with what is far apart; build without pairs",
                options.primitives, options.method
            )));
        }
        let budget = options.split.map_or(0, |split| split.budget(primitive_count));
        let budget = budget.min(radix_sort::MAX_COUNT - primitive_count);
        let split = options.split.filter(|_| budget > 0);
        let split = split.map(|split| Split::new(context, &split, primitive_count));
        // From here on, what the tree is over.
        let count = primitive_count + budget;
        options.method.check()?;
        let tuning = &context.tuning.build;
        let small = match options.method {
            _ if options.optimise.is_none() => tuning.small,
            Method::Hploc(_) => tuning.small_hploc,
            _ => tuning.small_optimised,
        };
        let by_one = primitive_count <= small && options.takes(Schedule::Workgroup);
        let of_count = if by_one { Schedule::Workgroup } else { Schedule::Chain };
        let schedule = options.schedule.unwrap_or(of_count);
        if !options.takes(schedule) {
            let optimised = if options.optimise.is_some() { " and optimised" } else { "" };
            let split = if options.split.is_some() { " of split triangles" } else { "" };
            return Err(Error::Argument(format!(
                "{:?} is not built{split}{optimised} by the schedule {schedule}; choose chain, or none",
                options.method
            )));
        }
        let alone = schedule == Schedule::Workgroup;
        if alone && primitive_count > Builder::WORKGROUP_MAX {
            return Err(Error::Argument(format!(
                "{primitive_count} primitives by one workgroup: it takes at most {}; choose another schedule",
                Builder::WORKGROUP_MAX
            )));
        }
        // One primitive has one tree, which the LBVH's kernels make; those of PLOC crash Mesa 26's lavapipe where there are none.
        let method = if count < 2 { Method::Lbvh } else { options.method };
        let window = if let Method::Hploc(window) = method { window } else { Window::DEFAULT };
        let merging = hploc::Merging::of(context, window);
        let shape = if schedule == Schedule::Chain {
            SortShape::of(context)
        } else {
            SortShape::of(context).with_short_tiles()
        };
        // A caller who asks for the chain gets it to the end.
        let finishes_alone = options.schedule != Some(Schedule::Chain) && count <= tuning.small_optimised;
        let optimise = options.optimise.map(|options| Reinsertion::new(context, &options, count));
        let optimise = optimise.map(|pass| if finishes_alone { pass.alone(context) } else { pass });
        let orders_on_the_way = method == Method::Lbvh && optimise.is_none();
        let behind = options.child_order.filter(|_| !orders_on_the_way);
        let child_order = behind.map(|order| ChildOrderPass::new(context, order, options.collapse, count));
        let items = if alone { tuning.alone_run } else { run_of(tuning, method, count, shape.workgroup) };
        // One primitive is no pair.
        let pairs = options.pairs && count >= 2;
        let whole_blocks = |items: u32| {
            let has_parts = pairs && !(items * shape.workgroup).is_multiple_of(PAIR_BLOCK);
            if has_parts { items.next_multiple_of(PAIR_BLOCK) } else { items }
        };
        let items = whole_blocks(items);
        let codes = options.codes.unwrap_or_else(|| Codes::for_count(count));
        if let Some(most) = options.bits_up_to
            && (![32, 64].contains(&most)
                || !(codes.bits..=codes.code.bits()).contains(&most)
                || !codes.bounds.has_sections())
        {
            return Err(Error::Argument(format!(
                "bits_up_to is {most} with codes {codes}; take 32 or 64, no fewer than the codes have and no more than there are, and \
                 codes by robust bounds, or such with what is far apart, or None"
            )));
        }
        let encode = Encode {
            codes,
            bits_up_to: options.bits_up_to,
            collapse: options.collapse,
            child_order: options.child_order.filter(|_| orders_on_the_way),
            shape: if alone { shape.with_digit_bits(tuning.small_digit_bits) } else { shape },
            items,
            bounds_items: whole_blocks(tuning.bounds_run.max(items)),
            // Persistent kernels are large as they are: lavapipe's compiler takes a third longer for it.
            meets_in_group: tuning.meets_in_group && !matches!(schedule, Schedule::Persistent(_)),
            sharers: tuning.workers,
            shared_left: context.limits.shared_memory.saturating_sub(shape.shared_bytes() + SHARED_BY_ALL),
            count,
            split,
            primitives: options.primitives,
            geometry_count: options.geometry_count,
            build_flags: options.build_flags,
            alone,
            pairs,
            numbered: false,
            // H-PLOC writes records when it has no clusters any more.
            clusters_in_records: matches!(method, Method::Hploc(_))
                && options.primitives.record_bytes() >= CLUSTER_BYTES,
        };
        Ok(Builder { method, schedule, optimise, workers: tuning.workers, merging, encode, child_order })
    }

    /// The method that is used: with fewer than two primitives always [`Method::Lbvh`].
    pub fn method(&self) -> Method {
        self.method
    }

    /// The codes that are used: those of the options, or the builder's choice.
    pub fn codes(&self) -> Codes {
        self.encode.codes
    }

    /// The number of primitives that it builds over.
    pub fn count(&self) -> u32 {
        self.encode.split.map_or(self.encode.count, |split| split.primitives)
    }

    /// Records that the structure has room for: one per primitive, or per reference that splitting may make.
    pub fn record_count(&self) -> u32 {
        self.encode.count
    }

    /// The schedule that is used: that of the options, or the builder's choice.
    pub fn schedule(&self) -> Schedule {
        self.schedule
    }

    /// Bytes of the structure and of the scratch memory: exactly what [`Builder::record`] uses.
    pub fn sizes(&self) -> Sizes {
        self.sizes_with_table(self.encode.table_words())
    }

    /// The same, with a sort's table of this many words.
    fn sizes_with_table(&self, table_words: u64) -> Sizes {
        // A build is done with its scratch memory when its children get an order.
        let scratch = self.scratch(table_words).bytes().max(self.child_order.map_or(0, |pass| pass.scratch_bytes()));
        Sizes { structure: self.layout().bytes, scratch, alignment: 16 }
    }

    fn scratch(&self, table_words: u64) -> Scratch {
        let reinsertion = self.optimise.map(|reinsertion| reinsertion.scratch_bytes());
        Scratch::of(&self.encode, &*self.hierarchy(), reinsertion, table_words)
    }

    /// Where the parts of the structure lie.
    pub fn layout(&self) -> layout::BvhOffsets {
        let Encode { primitives, count, geometry_count, numbered, .. } = self.encode;
        layout::offsets(if numbered { 4 } else { primitives.record_bytes() }, count, geometry_count)
    }

    /// The builder of structures that have the primitives' numbers in place of their records, 4 bytes each, for whoever makes another
    /// structure of it: [`Builder::numbered_step`] writes the records when they are needed. `None` where the tree's making reads them.
    pub(crate) fn numbered(&self) -> Option<Builder> {
        let is_chain = self.schedule == Schedule::Chain && self.encode.split.is_none();
        let encode = Encode { numbered: true, clusters_in_records: false, ..self.encode.clone() };
        (is_chain && self.places() && self.child_order.is_none()).then(|| Builder { encode, ..self.clone() })
    }

    /// Writes the records of such a structure, in the primitive order, to the address `records`.
    pub(crate) fn numbered_step(&self, input: &Input, structure: u64, records: u64) -> Result<Step> {
        let parts = self.scratch(self.encode.table_words()).parts;
        let arguments = self.encode.arguments(input, structure, 0, parts)?;
        Ok(collapse::numbered_step(&self.encode, input, &arguments, records))
    }

    /// Bytes that suffice for builds of this many primitives and of any fewer by builders of the same options.
    pub fn sizes_at_most(&self) -> Sizes {
        let Encode { shape, count, .. } = self.encode;
        self.sizes_with_table(shape.most_table_words(count).max(self.encode.table_words()))
    }

    /// Bytes that a phase must move if it reads each of its inputs once and writes each of its outputs once: what its time is
    /// held against. `None` for a phase that there is not, and for all of a build of split triangles or
    /// pairs.
    #[doc(hidden)]
    pub fn traffic(&self, phase: &str, input: &Input) -> Option<u64> {
        let Source::One(geometry) = input.source else { return None };
        if self.encode.split.is_some() || self.encode.pairs {
            return None;
        }
        let count = u64::from(self.count());
        let vertex = geometry.vertex_format.component_bytes() * geometry.vertex_format.components();
        let triangles =
            u64::from(3 * geometry.index_format.bytes()) * count + u64::from(vertex) * u64::from(geometry.vertex_count);
        let key = 4 * u64::from(self.encode.key_words()) * count;
        let value = 4 * count;
        // Each pass reads the keys for counting, then keys and values, and writes both; the first knows the values.
        let passes = self.encode.passes();
        let sort = u64::from(passes) * (3 * key + 2 * value) - if passes > 0 { value } else { 0 };
        let bounds = triangles;
        let encode = triangles + key + 4 * count;
        let hierarchy = triangles + key + value + self.layout().bytes;
        match phase {
            "bounds" => Some(bounds),
            "encode" => Some(encode),
            "sort" => Some(sort),
            "hierarchy" => Some(hierarchy),
            "build" => Some(bounds + encode + sort + hierarchy),
            _ => None,
        }
    }

    /// Whether the weights of the tree must be found when it is there.
    fn weighs(&self) -> bool {
        self.optimise.is_some()
    }

    /// Whether leaves and records are made when the tree is there.
    fn places(&self) -> bool {
        self.weighs() || self.hierarchy().writes_weights()
    }

    /// Records the build of `input` into `structure`, with scratch memory, of the bytes and alignment of [`Builder::sizes`].
    ///
    /// Before, the caller makes the input visible to compute shaders. After, it places a barrier from compute shader writes to
    /// whatever reads the structure or writes the scratch memory. Labels: `split`, `bounds`, `encode`, `sort`, `hierarchy`,
    /// `optimise`, `collapse` and `order`, as far as the build has such phases; or `build` if the schedule is persistent.
    ///
    /// # Errors
    /// The memory is too small; the input has another number of primitives than the builder; the triangles would be split, but each
    /// must be met once ([`GeometryFlags::NO_DUPLICATES`](super::geometry::GeometryFlags)); a pipeline could not be made.
    pub fn record(&self, recorder: &mut Recorder<'_>, input: &Input, structure: Region, scratch: Region) -> Result<()> {
        recorder.chains(&[self.steps(input, structure, scratch)?])
    }

    /// The steps of [`Builder::record`]. [`Recorder::chains`] records them side by side with other builds.
    ///
    /// # Errors
    /// As [`Builder::record`], pipelines aside.
    pub fn steps(&self, input: &Input, structure: Region, scratch: Region) -> Result<Vec<Step>> {
        let job = BuildJob { builder: self, input: *input, structure, scratch };
        let tree = match self.small_build(&job)? {
            Some(small) => lbvh_workgroup::steps(&[small], None)?,
            None => self.tree_of(&job)?,
        };
        Ok([tree, self.behind_tree(&job)?].concat())
    }

    /// The chains of many builds, for [`Recorder::chains`]: one per build, except that what one workgroup does shares dispatches: the trees of
    /// small builds two by two, or by a table of their arguments all steps of a kind. The table is then written with
    /// [`Recorder::write_table`].
    ///
    /// # Errors
    /// As [`Builder::record`], pipelines aside; the table is too small.
    pub fn chains(jobs: &[BuildJob<'_>], mut table: Option<&mut ArgumentTable>) -> Result<Vec<Vec<Step>>> {
        let (mut chains, mut small) = (Vec::new(), Vec::new());
        for job in jobs {
            let behind = job.builder.behind_tree(job)?;
            match job.builder.small_build(job)? {
                Some(build) => {
                    small.push(build);
                    // Its tree is in a dispatch with others, and what comes behind waits for that.
                    if let Some(first) = behind.first() {
                        chains.push([vec![first.clone().idle(lbvh_workgroup::PHASE)], behind].concat());
                    }
                }
                None => chains.push([job.builder.tree_of(job)?, behind].concat()),
            }
        }
        chains.extend(lbvh_workgroup::steps(&small, table.as_deref_mut())?.into_iter().map(|step| vec![step]));
        if let Some(table) = table {
            table.share_dispatches(&mut chains)?;
        }
        Ok(chains)
    }

    /// Of a build whose tree one workgroup makes in one dispatch.
    fn small_build<'a>(&'a self, job: &'a BuildJob<'_>) -> Result<Option<SmallBuild<'a>>> {
        if self.schedule != Schedule::Workgroup || self.method != Method::Lbvh {
            return Ok(None);
        }
        let memory = job.addresses()?;
        let single = self.optimise.is_some();
        Ok(Some(SmallBuild { encode: &self.encode, single, input: &job.input, memory }))
    }

    /// What the method adds to a build.
    fn hierarchy(&self) -> Box<dyn Hierarchy + '_> {
        self.method.hierarchy(&self.merging)
    }

    /// The steps of a tree that is not made by one workgroup in one dispatch.
    fn tree_of(&self, job: &BuildJob<'_>) -> Result<Vec<Step>> {
        let Builder { encode, .. } = self;
        let input = &job.input;
        let scratch = &self.scratch(encode.table_words());
        let [structure, room] = job.addresses()?;
        let arguments = &encode.arguments(input, structure, room, scratch.parts)?;
        let split = encode.split.map_or(Vec::new(), |split| split.steps(encode, input, arguments, scratch));
        let tree = match self.schedule {
            Schedule::Persistent(shaders) => {
                let shader = shaders.of(self.method);
                self.hierarchy().persistent_steps(encode, input, arguments, shader, self.workers)
            }
            Schedule::Workgroup => vec![
                encode.alone_step(input, arguments),
                self.merging.alone_step(encode, input, &self.single(arguments)),
            ],
            Schedule::Chain => {
                let hierarchy = self.hierarchy().steps(encode, input, &self.single(arguments));
                [encode.steps(input, arguments), hierarchy].concat()
            }
        };
        Ok([split, tree].concat())
    }

    /// The steps behind those of the tree.
    fn behind_tree(&self, job: &BuildJob<'_>) -> Result<Vec<Step>> {
        let finishes = match self.schedule {
            Schedule::Persistent(_) => false,
            Schedule::Chain => true,
            // What is not optimised is finished in the same dispatch.
            Schedule::Workgroup => self.optimise.is_some(),
        };
        let mut steps = Vec::new();
        if finishes {
            let scratch = &self.scratch(self.encode.table_words());
            let [structure, room] = job.addresses()?;
            let arguments = &self.encode.arguments(&job.input, structure, room, scratch.parts)?;
            steps.extend(self.finish(&job.input, arguments, scratch));
        }
        if let Some(pass) = self.child_order {
            steps.extend(pass.steps(job.structure, job.scratch)?);
        }
        Ok(steps)
    }

    /// What is weighed later has leaves of one primitive until then.
    fn single(&self, arguments: &arguments::Build) -> arguments::Build {
        if self.weighs() { arguments.without_collapse() } else { *arguments }
    }

    /// What comes behind the tree.
    fn finish(&self, input: &Input, arguments: &arguments::Build, scratch: &Scratch) -> Vec<Step> {
        let Builder { encode, optimise, .. } = self;
        let mut steps = Vec::new();
        if let Some(reinsertion) = optimise {
            let areas = match encode.primitives {
                Primitives::Instances => Areas::of_instances(encode.codes.bounds),
                _ => Areas::Whole,
            };
            let part = if areas == Areas::Whole { 0 } else { arguments.where_most_is() };
            steps.extend(reinsertion.steps(arguments.structure, arguments.part(scratch.reinsertion), (areas, part)));
            if reinsertion.is_alone() {
                steps.push(collapse::alone_step(encode, input, arguments));
                return steps;
            }
        }
        if self.weighs() {
            steps.extend(collapse::weigh_steps(encode, arguments));
        }
        if self.places() {
            steps.extend(collapse::place_steps(encode, input, arguments));
        }
        steps
    }
}

/// How many primitives an invocation takes. Of two numbers, as each has its own kernels: what climbs the radix tree to the root
/// gains by long runs.
fn run_of(tuning: &BuildTuning, method: Method, count: u32, workgroup: u32) -> u32 {
    let climbs = method.climbs();
    let is_long = climbs && count >= tuning.long_run.saturating_mul(workgroup * tuning.enough_groups);
    if is_long { tuning.long_run } else { tuning.run }
}
