//! Linear BVH on the device: bounds, codes, sort, and hierarchy with boxes bottom-up in one pass (Apetrei 2014).
//!
//! [`Lbvh::sizes`] tells the memory, [`Lbvh::record`] records the build into the caller's command buffer. The phases run as
//! a chain of dispatches or all in one persistent dispatch, from the same functions (`glsl/bvh/lbvh.glsl`). The twin is
//! [`super::host::lbvh`]: the same bytes.

use super::codes::{Code, Codes};
pub(crate) use super::geometry::INSTANCE_POINTERS;
use super::geometry::Planned;
pub use super::geometry::{Geometry, Input, Primitives, Source};
use super::layout;
use super::lbvh_workgroup;
use super::sah::Collapse;
use crate::gpu::push_constants::push_constants;
use crate::gpu::radix_sort::{self, Shape};
use crate::gpu::{Context, Kernel, Recorder, Step, shaders};
use crate::{Error, Result};

/// What to build, beside the triangles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// The codes; `None` lets [`Codes::for_count`] choose them from the number of triangles.
    pub codes: Option<Codes>,
    /// Whether subtrees become leaves where that is cheaper.
    pub collapse: Collapse,
    /// How the phases are recorded; `None` takes what measured faster on this kind of device and size.
    pub schedule: Option<Schedule>,
    /// What it is built over.
    pub primitives: Primitives,
    /// How many geometries: what [`Source::Several`] has, otherwise 1.
    pub geometry_count: u32,
    /// `vk::BuildAccelerationStructureFlagsKHR` for the header, at most 6 bits.
    pub build_flags: u32,
}

impl Options {
    /// One geometry of triangles, everything chosen from the scene and the device; leaves collapsed by SAH.
    pub const DEFAULT: Options = Options {
        codes: None,
        collapse: Collapse::SAH,
        schedule: None,
        primitives: Primitives::Triangles,
        geometry_count: 1,
        build_flags: 0,
    };
}

impl Default for Options {
    fn default() -> Options {
        Options::DEFAULT
    }
}

/// How the phases of a build are recorded. The result is the same bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Schedule {
    /// A dispatch a phase, with barriers between: needs nothing of the device.
    Chain,
    /// One persistent dispatch that draws tasks from a pool; needs a device whose started workgroups go on.
    Persistent,
    /// One workgroup does everything, in one dispatch: for few triangles, at most [`Lbvh::WORKGROUP_MAX`].
    Workgroup,
}

impl std::fmt::Display for Schedule {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Schedule::Chain => "chain",
            Schedule::Persistent => "persistent",
            Schedule::Workgroup => "workgroup",
        })
    }
}

/// Bytes that a build needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sizes {
    /// The structure: see [`layout`].
    pub structure: u64,
    /// Scratch, free again when the build has run.
    pub scratch: u64,
    /// Alignment of both addresses.
    pub alignment: u64,
}

/// The builder, specialised for one device, its options and a number of triangles.
#[derive(Debug, Clone)]
pub struct Lbvh {
    codes: Codes,
    pub(super) collapse: Collapse,
    schedule: Schedule,
    shape: Shape,
    items: u32,
    workers: u32,
    pub(super) count: u32,
    primitives: Primitives,
    geometry_count: u32,
    build_flags: u32,
}

/// Where the parts of the scratch memory begin, in bytes.
struct Scratch {
    keys: [u64; 2],
    values: [u64; 2],
    ends: u64,
    table: u64,
    bytes: u64,
}

/// Bytes of `LbvhState` in lbvh.glsl, with room to spare.
pub(super) const STATE_BYTES: u64 = 768;

push_constants! {
    struct Arguments {
        vertices: u64,
        indices: u64,
        transform: u64,
        structure: u64,
        state: u64,
        keys: [u64; 2],
        values: [u64; 2],
        ends: u64,
        table: u64,
        vertex_stride: u32,
        vertex_count: u32,
        formats: u32,
        primitive_count: u32,
        code_kind: u32,
        c_t: f32,
        c_i: f32,
        columns: u32,
        column_keys: u32,
        passes: u32,
    }
}

/// A build with all that it is recorded with.
#[derive(Debug, Clone, Copy)]
pub struct Job<'a> {
    /// The builder.
    pub lbvh: &'a Lbvh,
    /// Its input.
    pub input: Input,
    /// Address of the structure.
    pub structure: u64,
    /// Address of the scratch memory.
    pub scratch: u64,
}

impl Codes {
    /// The codes that `primitive_count` triangles need: about a thousand times as many cells as triangles, in whole passes of
    /// the sort. On scenes of 66k to 1.4M triangles that is 32 bits, and the SAH cost is within 0.6% of that with
    /// all 64; 24 bits would cost 1.3% at 111k triangles and 7.8% at 871k.
    pub fn for_count(primitive_count: u32) -> Codes {
        // Bits of an index, whatever the count: what is too much is refused, not computed with.
        let bits = 32 - (primitive_count.max(2) - 1).leading_zeros() + 10;
        Code::Emc64Var.full().with_bits(bits.next_multiple_of(8))
    }
}

impl Lbvh {
    /// Triangles that [`Schedule::Workgroup`] takes at most.
    pub const WORKGROUP_MAX: u32 = 1 << 16;

    /// A builder of `primitive_count` triangles on the device of `context`.
    ///
    /// # Errors
    /// More triangles than a build can take.
    pub fn new(context: &Context, options: &Options, primitive_count: u32) -> Result<Lbvh> {
        if primitive_count > radix_sort::MAX_COUNT {
            return Err(Error::Argument(format!(
                "{primitive_count} primitives: a structure holds at most {}; split the mesh",
                radix_sort::MAX_COUNT
            )));
        }
        let limits = &context.limits;
        let schedule = options.schedule.unwrap_or_else(|| Schedule::for_count(primitive_count));
        if schedule == Schedule::Workgroup && primitive_count > Lbvh::WORKGROUP_MAX {
            return Err(Error::Argument(format!(
                "{primitive_count} primitives by one workgroup: it takes at most {}; choose another schedule",
                Lbvh::WORKGROUP_MAX
            )));
        }
        let shape = match schedule {
            Schedule::Workgroup => Shape::of(limits).with_digit_bits(SMALL_DIGIT_BITS),
            _ => Shape::of(limits),
        };
        Ok(Lbvh {
            codes: options.codes.unwrap_or_else(|| Codes::for_count(primitive_count)),
            collapse: options.collapse,
            schedule,
            shape,
            items: if limits.is_cpu() { 32 } else { 1 },
            workers: if limits.is_cpu() { 64 } else { 1024 },
            count: primitive_count,
            primitives: options.primitives,
            geometry_count: options.geometry_count,
            build_flags: options.build_flags,
        })
    }

    /// The codes that are used: the choice where none was given.
    pub fn codes(&self) -> Codes {
        self.codes
    }

    /// Primitives that it is for.
    pub fn count(&self) -> u32 {
        self.count
    }

    /// The schedule that is used: the choice where none was given.
    pub fn schedule(&self) -> Schedule {
        self.schedule
    }

    /// Bytes of the structure and of the scratch memory: exactly what [`Lbvh::record`] uses.
    pub fn sizes(&self) -> Sizes {
        Sizes { structure: self.layout().bytes, scratch: self.scratch().bytes, alignment: 16 }
    }

    /// Where the parts of the structure lie.
    pub fn layout(&self) -> layout::Sizes {
        layout::sizes(self.primitives.record_bytes(), self.count, self.geometry_count)
    }

    /// Bytes that suffice for builds of this many triangles and of any fewer by builders of the same options.
    pub fn sizes_at_most(&self) -> Sizes {
        let more = self.shape.most_table_words(self.count).saturating_sub(self.table_words());
        let sizes = self.sizes();
        Sizes { scratch: sizes.scratch + (4 * more).next_multiple_of(16), ..sizes }
    }

    /// Bytes that a phase must move if it reads each of its inputs once and writes each of its outputs once: what its time is
    /// held against. `None` for a phase that there is not.
    pub fn traffic(&self, phase: &str, input: &Input) -> Option<u64> {
        let Source::One(geometry) = input.source else { return None };
        let count = u64::from(self.count);
        let vertex = geometry.vertex_format.component_bytes() * geometry.vertex_format.components();
        let triangles =
            u64::from(3 * geometry.index_format.bytes()) * count + u64::from(vertex) * u64::from(geometry.vertex_count);
        let key = 4 * u64::from(self.key_words()) * count;
        let value = 4 * count;
        // Each pass reads the keys for counting, then keys and values, and writes both; the first knows the values.
        let sort = u64::from(self.passes()) * (3 * key + 2 * value) - if self.passes() > 0 { value } else { 0 };
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

    fn key_words(&self) -> u32 {
        if self.codes.bits > 32 { 2 } else { 1 }
    }

    fn scratch(&self) -> Scratch {
        let mut at = STATE_BYTES;
        let mut take = |bytes: u64| {
            let begin = at;
            at += bytes.next_multiple_of(16);
            begin
        };
        let count = u64::from(self.count);
        let key_bytes = 4 * u64::from(self.key_words()) * count;
        Scratch {
            keys: [take(key_bytes), take(key_bytes)],
            values: [take(4 * count), take(4 * count)],
            ends: take(4 * count),
            table: take(4 * self.table_words()),
            bytes: at,
        }
    }

    /// Words of the sort's table. One workgroup on a CPU gives each of its lanes a strip.
    fn table_words(&self) -> u64 {
        if self.schedule == Schedule::Workgroup && self.shape.private_counters {
            (1 << self.shape.digit_bits) * u64::from(self.shape.workgroup + 1)
        } else {
            self.shape.table_words(self.count)
        }
    }

    fn passes(&self) -> u32 {
        if self.count < 2 { 0 } else { self.shape.passes(self.codes.bits) }
    }

    /// Workgroups of the phases that go over all triangles.
    fn tiles(&self) -> u32 {
        self.count.div_ceil(self.shape.workgroup * self.items)
    }

    fn kernel(&self, shader: &'static shaders::Shader) -> Kernel {
        Kernel::new(shader, self.shape.workgroup, &self.shape.constants(self.items, self.key_words()))
    }

    /// A kernel that reads primitives.
    pub(super) fn reading_kernel(&self, shader: &'static shaders::Shader, input: &Input) -> Kernel {
        let constants = self.shape.constants(self.items, self.key_words());
        Kernel::new(shader, self.shape.workgroup, &[&constants[..], &[input.source_constant(self.primitives)]].concat())
    }

    /// The kernels that [`Lbvh::record`] dispatches for `input`, to make their pipelines ahead with [`Context::warm`].
    pub fn kernels(&self, input: &Input) -> Vec<Kernel> {
        let mut kernels = vec![self.kernel(&shaders::BVH_LBVH_RESET)];
        match self.schedule {
            Schedule::Workgroup => return vec![self.reading_kernel(&shaders::BVH_LBVH_WORKGROUP, input)],
            Schedule::Persistent => kernels.push(self.reading_kernel(&shaders::BVH_LBVH_PERSISTENT, input)),
            Schedule::Chain => {
                let reading = [
                    &shaders::BVH_LBVH_BOUNDS,
                    &shaders::BVH_LBVH_PLAN,
                    &shaders::BVH_LBVH_ENCODE,
                    &shaders::BVH_LBVH_HIERARCHY,
                ];
                let others =
                    [&shaders::GPU_RADIX_SORT_COUNT, &shaders::GPU_RADIX_SORT_SCAN, &shaders::GPU_RADIX_SORT_SCATTER];
                kernels.extend(reading.map(|shader| self.reading_kernel(shader, input)));
                kernels.extend(others.map(|shader| self.kernel(shader)));
            }
        }
        kernels
    }

    /// Records the build of `input` into the structure at address `structure`, with scratch memory at address `scratch`,
    /// of the bytes and alignment that [`Lbvh::sizes`] tells.
    ///
    /// The caller makes the input visible to compute shaders before, and places a barrier (compute shader write to whatever
    /// reads the structure, or writes the scratch memory) behind. Labels: `bounds`, `encode`, `sort`, `hierarchy`, or `build`
    /// where the schedule is persistent.
    ///
    /// # Errors
    /// The input has another number of triangles than the builder; a pipeline could not be made.
    pub fn record(&self, recorder: &mut Recorder<'_>, input: &Input, structure: u64, scratch: u64) -> Result<()> {
        recorder.chains(&[self.steps(input, structure, scratch)?])
    }

    /// What [`Lbvh::record`] records, to be recorded beside other builds by [`Recorder::chains`].
    ///
    /// # Errors
    /// The input has another number of triangles than the builder.
    pub fn steps(&self, input: &Input, structure: u64, scratch: u64) -> Result<Vec<Step>> {
        let mut chains = Lbvh::chains(&[Job { lbvh: self, input: *input, structure, scratch }])?;
        Ok(chains.pop().unwrap_or_default())
    }

    /// The chains of many builds, for [`Recorder::chains`]: one each, but for builds by one workgroup, of which two share a
    /// dispatch.
    ///
    /// # Errors
    /// An input has another number of triangles than its builder.
    pub fn chains(jobs: &[Job<'_>]) -> Result<Vec<Vec<Step>>> {
        let (small, large): (Vec<&Job<'_>>, Vec<&Job<'_>>) =
            jobs.iter().partition(|job| job.lbvh.schedule == Schedule::Workgroup);
        let chains = large.iter().map(|job| job.lbvh.chain_of(&job.input, job.structure, job.scratch));
        let mut chains: Vec<Vec<Step>> = chains.collect::<Result<_>>()?;
        chains.extend(lbvh_workgroup::steps(&small)?.into_iter().map(|step| vec![step]));
        Ok(chains)
    }

    /// The input's geometry as the kernels are given it, and its formats.
    pub(super) fn checked(&self, input: &Input) -> Result<(Geometry, u32)> {
        let planned =
            Planned { primitives: self.primitives, primitive_count: self.count, geometry_count: self.geometry_count };
        planned.check(input)?;
        Ok(input.for_kernels())
    }

    /// `code_kind` in lbvh.glsl.
    pub(super) fn code_kind(&self) -> u32 {
        let code = self.codes.code;
        code.order_number()
            | self.codes.bits << 8
            | code.size_group() << 16
            | u32::from(self.codes.concise) << 24
            | u32::from(self.collapse.enabled) << 25
            | self.build_flags << 26
    }

    fn chain_of(&self, input: &Input, structure: u64, scratch: u64) -> Result<Vec<Step>> {
        let (geometry, formats) = self.checked(input)?;
        let parts = self.scratch();
        let arguments = Arguments {
            vertices: geometry.vertices,
            indices: geometry.indices,
            transform: geometry.transform,
            structure,
            state: scratch,
            keys: parts.keys.map(|at| scratch + at),
            values: parts.values.map(|at| scratch + at),
            ends: scratch + parts.ends,
            table: scratch + parts.table,
            vertex_stride: geometry.vertex_stride,
            vertex_count: geometry.vertex_count,
            formats,
            primitive_count: self.count,
            code_kind: self.code_kind(),
            c_t: self.collapse.c_t,
            c_i: self.collapse.c_i,
            columns: self.shape.columns(self.count),
            column_keys: self.shape.column_keys(self.count),
            passes: self.passes(),
        };
        Ok(match self.schedule {
            Schedule::Persistent => self.persistent(input, &arguments),
            Schedule::Chain | Schedule::Workgroup => self.chain(input, &arguments),
        })
    }

    fn chain(&self, input: &Input, arguments: &Arguments) -> Vec<Step> {
        let plain = |phase, shader, groups| Step::new(phase, self.kernel(shader), arguments, groups);
        let reading = |phase, shader, groups| Step::new(phase, self.reading_kernel(shader, input), arguments, groups);
        let sort = radix_sort::Sort { count: self.count, bits: self.codes.bits, identity: true };
        let buffers = radix_sort::Buffers { keys: arguments.keys, values: arguments.values, table: arguments.table };
        let mut steps = vec![
            plain("bounds", &shaders::BVH_LBVH_RESET, 1),
            reading("bounds", &shaders::BVH_LBVH_BOUNDS, self.tiles()),
            reading("encode", &shaders::BVH_LBVH_PLAN, 1),
            reading("encode", &shaders::BVH_LBVH_ENCODE, self.tiles()),
        ];
        steps.extend(radix_sort::steps(&self.shape, &buffers, &sort));
        steps.push(reading("hierarchy", &shaders::BVH_LBVH_HIERARCHY, self.tiles()));
        steps
    }

    fn persistent(&self, input: &Input, arguments: &Arguments) -> Vec<Step> {
        let persistent = self.reading_kernel(&shaders::BVH_LBVH_PERSISTENT, input);
        vec![
            Step::new("build", self.kernel(&shaders::BVH_LBVH_RESET), arguments, 1),
            Step::new("build", persistent, arguments, self.workers),
        ]
    }
}

/// Triangles up to which one workgroup is faster than a chain of dispatches.
const SMALL: u32 = 2048;
/// Bits of a digit for them: with 8, a pass spends more on its table than on a few hundred keys.
const SMALL_DIGIT_BITS: u32 = 4;

impl Schedule {
    /// What measured faster. Of few triangles, one workgroup. Of many, on lavapipe the chain, by a factor of 1.2 to 1.5 (the
    /// loop around the phases costs the persistent kernel its unmasked loads, and whoever waits takes a core from who works).
    /// No GPU has been measured: the chain also asks nothing of its progress.
    pub fn for_count(primitive_count: u32) -> Schedule {
        if primitive_count <= SMALL { Schedule::Workgroup } else { Schedule::Chain }
    }
}
