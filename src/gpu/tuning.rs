//! What differs between devices and changes no byte of a result: how work is cut, and which schedule runs it.
//!
//! A pass reads a field of [`Tuning`]; no pass asks what the device is. What would change bytes (the window of H-PLOC, code
//! bits, the width of nodes) is an option of its builder, with one default everywhere.

use super::radix_sort::SortShape;
use super::{Grid, Limits};
use ash::vk;
use std::fmt;
use std::str::FromStr;

/// Which [`Tuning`] a context takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum TuningChoice {
    /// That of the device's kind.
    #[default]
    Auto,
    /// [`Tuning::cpu`], whatever the device is.
    Cpu,
    /// [`Tuning::gpu`], whatever the device is: so that its branches run in tests on a CPU.
    Gpu,
}

impl FromStr for TuningChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<TuningChoice, String> {
        match text {
            "auto" | "" => Ok(TuningChoice::Auto),
            "cpu" => Ok(TuningChoice::Cpu),
            "gpu" => Ok(TuningChoice::Gpu),
            _ => Err(format!("unknown tuning {text:?}; use one of auto, cpu, gpu")),
        }
    }
}

impl fmt::Display for TuningChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            TuningChoice::Auto => "auto",
            TuningChoice::Cpu => "cpu",
            TuningChoice::Gpu => "gpu",
        })
    }
}

/// How work is cut for a device. Made once, with the context.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tuning {
    /// Invocations of a workgroup that streams over many items.
    pub group: u32,
    /// Invocations of a workgroup whose invocations each keep much in registers.
    pub small_group: u32,
    /// Workgroups for work whose amount only the device knows.
    pub grid: Grid,
    /// Items that an invocation of `reduce` takes.
    pub reduce_rounds: u32,
    /// Items that an invocation of `scan` takes, at least.
    pub scan_rounds: u32,
    /// Of these how many lie side by side and are taken at once.
    pub scan_each: u32,
    /// Whether the device's reciprocals are taken as correctly rounded, as those of CPUs are, or made so.
    pub exact_division: bool,
    /// Whether shaders ask for floats as the host has them (`gpu::execution_modes`). CPUs compute so anyway, and rays take 1.15 of the time
    /// on lavapipe if they are asked.
    pub strict_floats: bool,
    /// Items that an invocation takes which measures a tree (`quality`, `epo`).
    pub measure_rounds: u32,
    /// Wide nodes up to which one workgroup collapses a tree in one dispatch: a chain of dispatches costs more.
    pub wide_alone: u32,
    /// The radix sort's cut.
    pub sort: SortShape,
    /// Builds.
    pub build: BuildTuning,
    /// Refits.
    pub refit: RefitTuning,
    /// Builds of kd-trees, and merging.
    pub kd: KdTuning,
    /// Tracers.
    pub trace: TraceTuning,
}

/// How builds of BVHs are cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BuildTuning {
    /// Items that an invocation takes one after the other.
    pub run: u32,
    /// The same of methods that climb the radix tree to the root, over many items.
    pub long_run: u32,
    /// Workgroups at least that a dispatch must keep for `long_run` to be taken.
    pub enough_groups: u32,
    /// Items that an invocation takes where one workgroup builds everything.
    pub alone_run: u32,
    /// Items that an invocation takes of the scene's bounds, whose workgroups all tell theirs at one place.
    pub bounds_run: u32,
    /// Whether invocations that climb the radix tree meet in their workgroup first, or all in the device.
    pub meets_in_group: bool,
    /// Workgroups of a persistent dispatch, and of others that share what only the device knows the number of.
    pub workers: u32,
    /// Primitives up to which one workgroup builds everything. Of more, the chain: on lavapipe it is 1.2 to 1.5 times as fast
    /// as the task pool (the loop around the phases costs the persistent kernel its unmasked loads, and waiting workgroups take
    /// a core from who works), and it asks nothing of the device's progress.
    pub small: u32,
    /// Primitives up to which one workgroup does all rounds of a build's reinsertion, and finishes the tree, in a dispatch each.
    pub small_optimised: u32,
    /// Primitives up to which one workgroup finds their order and makes an H-PLOC over it that is optimised then, in a dispatch each.
    pub small_hploc: u32,
    /// Bits of a digit of its sort: with 8, a pass spends more on its table than on a few hundred keys.
    pub small_digit_bits: u32,
    /// Whether an invocation of H-PLOC merges small windows by itself, in registers, or a team of invocations does.
    pub merges_by_one: bool,
    /// Whether nodes, records and clusters are loaded and stored in elements of 64 bits (`gpu::longs`). On an AMD EPYC without AVX-512 builds of BVHs
    /// take 0.7 to 0.92 of the time so (lavapipe of Mesa 26, docs/notes/rays.md). CPUs that gather words fast were not measured.
    pub in_longs: bool,
    /// Items that an invocation of reinsertion's passes takes.
    pub reinsertion_rounds: u32,
    /// Entries of a reinsertion's stack in shared memory; the others are private.
    pub reinsertion_shared: u32,
    /// Invocations of a workgroup that re-braids, or reinserts, by itself.
    pub alone_group: u32,
}

/// How refits are cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RefitTuning {
    /// Slots that an invocation takes one after the other.
    pub run: u32,
    /// The same where one run of every invocation of a workgroup would hold all.
    pub short_run: u32,
    /// Primitives up to which one workgroup refits everything.
    pub small: u32,
}

/// How builds of kd-trees are cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct KdTuning {
    /// Invocations of a workgroup, but for those that have a subtree of few references: of these, and of the task pool's, a
    /// subgroup.
    pub group: u32,
    /// Workgroups of a dispatch, at most.
    pub groups: u32,
    /// Workgroups that build subtrees, at most. Each has some 80 kB of scratch memory for what waits.
    pub subtree_groups: u32,
    /// References of a chunk, which is what a workgroup takes at a time.
    pub chunk: u32,
    /// Whether the task pool is the default, or a chain of dispatches.
    pub persistent: bool,
}

/// How tracers are cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TraceTuning {
    /// Invocations of a workgroup.
    pub group: u32,
    /// Entries of a ray's stack in shared memory, as far as there is room; the others are private.
    pub shared_levels: u32,
    /// Rays that an invocation traces one after the other, at most.
    pub rays_each: u32,
    /// Whether lanes load nodes and triangles one after the other.
    pub lane_by_lane: bool,
    /// Whether each lane loads them in vectors, or member by member.
    pub in_vectors: bool,
    /// Whether each lane loads them in elements of 64 bits, where it loads for itself and not in vectors.
    pub in_longs: bool,
    /// Whether queries load quantised nodes so, too (`HEDGEROW_LONG_NODES`): on a CPU that gathers words fast they have 0.92 of the speed then
    /// (an Intel Xeon with AVX-512), and on others 1.15 times (an AMD EPYC without it; lavapipe of Mesa 26, docs/notes/rays.md).
    pub nodes_in_longs: bool,
    /// Whether rays meet the children of quantised nodes by octants, or by distance.
    pub by_octant: bool,
}

/// Every level of a stack.
const ALL_LEVELS: u32 = u32::MAX;

impl Tuning {
    /// What `choice` says for a device.
    pub fn of(choice: TuningChoice, limits: &Limits) -> Tuning {
        match choice {
            TuningChoice::Cpu => Tuning::cpu(limits),
            TuningChoice::Gpu => Tuning::gpu(limits),
            TuningChoice::Auto if limits.kind == vk::PhysicalDeviceType::CPU => Tuning::cpu(limits),
            TuningChoice::Auto => Tuning::gpu(limits),
        }
    }

    /// Few long invocations: a workgroup is one subgroup, so that none waits for another at a barrier, and each of its lanes takes
    /// many items, for a workgroup costs its start. Figures are of lavapipe.
    pub fn cpu(limits: &Limits) -> Tuning {
        let group = limits.subgroup_size;
        let is_cpu = limits.kind == vk::PhysicalDeviceType::CPU;
        // Mesa 26 makes one plain load of what is at the same address for all lanes.
        let lane_by_lane = limits.loads_uniform_values_once() && group <= MOST_LANES && limits.subgroup_is_exact;
        Tuning {
            group,
            small_group: group,
            grid: Grid { workgroup: group, groups: limits.workgroup_count.min(64), rounds: 64, spread: true },
            reduce_rounds: 64,
            scan_rounds: 32,
            scan_each: 16,
            exact_division: is_cpu,
            strict_floats: !is_cpu,
            measure_rounds: 64,
            // Nodes of 4,096 primitives; of 8,192 it takes as long as the chain.
            wide_alone: 2731,
            sort: SortShape::strips(limits),
            build: BuildTuning {
                run: 32,
                // The bunny's hierarchy takes 0.85 times as long with 128 as with 32 by LBVH and by H-PLOC, and no less with 256.
                // PLOC's rounds take 1.2 times as long by them, and HLBVH, which climbs to its treelets, as long.
                long_run: 128,
                enough_groups: 64,
                alone_run: 32,
                bounds_run: 32,
                // A workgroup is one subgroup, whose lanes have long runs: what is left is little.
                meets_in_group: false,
                workers: limits.workgroup_count.min(64),
                small: 2048,
                // Fast traces of 300 to 2,000 triangles take 0.25 to 0.7 of the time so, of 2,500 to 8,000 0.5 to 0.75 on two cores; top levels of
                // 50 to 400 instances 0.25 to 0.85, of 2,400 to 8,000 entries 0.4 to 0.7, of 16,000 still 0.8, where more cores may do without.
                small_optimised: 8192,
                // Of 600 to 1,000 triangles a fast trace takes 0.77 to 1.06 of the time so, of 1,500 and 2,000 on two cores 1.24.
                small_hploc: 1024,
                small_digit_bits: 4,
                merges_by_one: true,
                in_longs: is_cpu && limits.int64 && !limits.gathers_words_fast,
                reinsertion_rounds: 64,
                reinsertion_shared: 0,
                alone_group: group,
            },
            // As many slots as there are bits in a word, so that siblings meet in one; half of that for structures that are over
            // before every lane has a run.
            refit: RefitTuning { run: 32, short_run: 16, small: 4096 },
            kd: KdTuning {
                group,
                groups: limits.workgroup_count.min(64),
                subtree_groups: limits.workgroup_count.min(64),
                chunk: 256,
                persistent: true,
            },
            trace: TraceTuning {
                group,
                shared_levels: ALL_LEVELS,
                rays_each: 128,
                lane_by_lane,
                in_vectors: false,
                // Lanes gather: half of the gathers.
                in_longs: limits.int64,
                nodes_in_longs: limits.int64 && !limits.gathers_words_fast,
                by_octant: lane_by_lane,
            },
        }
    }

    /// Many short invocations in workgroups of several subgroups. Values are from the literature: one GPU has run
    /// them, and none has been tuned for (docs/notes/gpu.md).
    pub fn gpu(limits: &Limits) -> Tuning {
        let at_most = |invocations: u32| limits.workgroup_invocations.min(invocations);
        let group = at_most(256);
        let small_group = at_most(64);
        Tuning {
            group,
            small_group,
            // Half a million invocations: a large GPU holds a quarter of a million at a time.
            grid: Grid { workgroup: group, groups: limits.workgroup_count.min(2048), rounds: 4, spread: false },
            reduce_rounds: 8,
            scan_rounds: 8,
            scan_each: 1,
            exact_division: false,
            strict_floats: true,
            measure_rounds: 4,
            wide_alone: 1024,
            // Tiles count on the subgroups that they were cut for.
            sort: if limits.subgroup_is_exact { SortShape::tiles(limits) } else { SortShape::many_strips(limits) },
            build: BuildTuning {
                run: 1,
                long_run: 1,
                enough_groups: 64,
                alone_run: 1,
                // 10 million primitives are 5,000 workgroups of 256, each of which adds 14 words.
                bounds_run: 8,
                meets_in_group: true,
                workers: limits.workgroup_count.min(1024),
                small: 2048,
                // Rounds of as many try 128 links each, whatever their number: no work for a second workgroup.
                small_optimised: 2048,
                small_hploc: 1024,
                small_digit_bits: 4,
                // As in the paper: of the invocations that climb, ever fewer have a window, and merging one alone takes 28
                // distances a round and some hundred registers.
                merges_by_one: false,
                in_longs: false,
                // A search is long: it is an invocation's only one, as far as there are invocations.
                reinsertion_rounds: 1,
                // 8 KiB a workgroup: few searches put off more.
                reinsertion_shared: 16,
                alone_group: at_most(128),
            },
            refit: RefitTuning { run: 4, short_run: 4, small: 4096 },
            // 2^18 invocations that stream, 2^12 subgroups that build subtrees: all that the largest GPUs hold at a time, or most.
            // A chunk has 768 global counters.
            kd: KdTuning {
                group,
                groups: limits.workgroup_count.min(1024),
                subtree_groups: limits.workgroup_count.min(4096),
                chunk: 4096,
                persistent: false,
            },
            trace: TraceTuning {
                group: at_most(limits.subgroup_size.max(64)),
                shared_levels: 8,
                rays_each: 1,
                lane_by_lane: false,
                in_vectors: true,
                in_longs: false,
                nodes_in_longs: false,
                by_octant: true,
            },
        }
    }
}

/// Lanes that can load one after the other: `LANES` in `glsl/trace/lanes.glsl`.
pub(crate) const MOST_LANES: u32 = 16;
