//! A build that is asked for by Vulkan's structs: what it reads, the memory it needs, and what is recorded before the builder.

use super::geometry::{self, BuildGeometries};
use super::instances::{ENTRY_BYTES, entries_step};
use super::rebraid::Rebraid;
use super::{AccelOptions, quality};
use crate::bvh::builder::{BuildJob, BuildOptions, Builder};
use crate::bvh::codes::Codes;
use crate::bvh::far;
use crate::bvh::geometry::{Geometry, GeometryFlags, Input, Primitives, Source};
use crate::bvh::layout::NODES_OFFSET;
use crate::bvh::refit::{self, Refit};
use crate::bvh::wide::Form;
use crate::bvh::wide::device::{WideMemory, WideOptions, WidePass};
use crate::gpu::arguments;
use crate::gpu::{ArgumentTable, Context, Kernel, Region, Sizes, Step, shaders};
use crate::{Error, Result};
use ash::vk;

type Flags = vk::BuildAccelerationStructureFlagsKHR;

/// What scratch addresses must be multiples of: `minAccelerationStructureScratchOffsetAlignment`.
pub const SCRATCH_ALIGNMENT: u64 = 16;

/// From how many triangles on a structure of wide nodes is made in its own memory: 162 bytes a triangle in all, where 270 and the tables
/// of a sort are for a few, which one workgroup builds.
const NUMBERED_FROM: u32 = 1025;

/// Where the numbers of primitives come from.
#[derive(Debug, Clone, Copy)]
pub(super) enum Counts {
    /// In the recording; the geometries are of their ranges.
    OnHost,
    /// In device memory, `VkAccelerationStructureBuildRangeInfoKHR` with this stride in bytes; the geometries begin where the
    /// caller's do, and their `first` is the most primitives that each may have.
    OnDevice { address: u64, stride: u32 },
}

/// A build, or an update, that is asked for.
pub(super) struct Build {
    builder: Builder,
    refit: Refit,
    given: BuildGeometries,
    counts: Counts,
    /// Most primitives of all geometries.
    primitive_count: u32,
    rebraid: Option<Rebraid>,
    /// What makes nodes of eight of the builder's tree, which lies in scratch memory then.
    wide: Option<WidePass>,
    /// Whether that tree has the primitives' numbers in place of their records, and the structure's memory serves while it is made.
    numbered: bool,
    options: BuildOptions,
    /// Where the geometries' records lie, if not in scratch memory.
    records: Option<u64>,
    /// What a build of fewer primitives may need.
    of_fewer: Vec<Sizes>,
}

/// Where the parts of the scratch memory begin.
struct Scratch {
    entries: u64,
    rebraid: u64,
    /// The tree that nodes of eight are made of.
    binary: u64,
    builder: u64,
}

impl Build {
    /// A build with these flags over the primitives `given`, at most `primitive_count` in all.
    pub fn new(
        context: &Context,
        options: &AccelOptions,
        flags: Flags,
        given: BuildGeometries,
        counts: Counts,
        primitive_count: u64,
    ) -> Result<Build> {
        quality::check(flags, options)?;
        let primitive_count = u32::try_from(primitive_count).unwrap_or(u32::MAX);
        let primitives = given.primitives();
        let capacity = match primitives {
            Primitives::Instances => quality::opened_to(flags, options, primitive_count),
            _ => None,
        };
        let entries = capacity.unwrap_or(primitive_count);
        let builder_options = BuildOptions {
            geometry_count: given.count(),
            ..quality::build_options(flags, options, primitives, entries)
        };
        let builder = Builder::new(context, &builder_options, entries)?;
        let refit = Refit::new(context, &refit::RefitOptions::from(&builder_options), entries)?;
        let rebraid = capacity.map(|capacity| Rebraid { capacity });
        let wide = quality::is_wide(flags, options, primitives, entries).then(|| {
            let of =
                WideOptions { form: Form::EightQuantised, primitives, geometry_count: builder_options.geometry_count };
            WidePass::new(context, &of, entries)
        });
        let in_pieces = wide.filter(|_| primitives == Primitives::Triangles && entries >= NUMBERED_FROM);
        let numbered = in_pieces.and_then(|_| builder.numbered());
        let (builder, numbered) = numbered.map_or((builder, false), |builder| (builder, true));
        let of_another_form = quality::fewer_of_another_form(flags, options, primitives, primitive_count);
        // One workgroup sorts by a smaller table than a chain of dispatches. A fast trace of three or more primitives, up to a number, is
        // its work; one of two is a chain's, as nothing is optimised.
        let other_tables = flags.contains(Flags::PREFER_FAST_TRACE) && primitives != Primitives::Instances;
        let in_other_memory = [(2, other_tables), (NUMBERED_FROM - 1, other_tables || numbered)];
        let in_other_memory = in_other_memory.into_iter().filter(|&(fewer, is_so)| is_so && fewer < entries);
        let in_other_memory = in_other_memory.map(|(fewer, _)| fewer);
        let of_fewer = |count: u32| {
            let given = given.clone();
            Build::new(context, options, flags, given, counts, count.into()).map(|build| build.sizes_at_most())
        };
        let of_fewer = of_another_form.chain(in_other_memory).map(of_fewer).collect::<Result<_>>()?;
        let options = builder_options;
        Ok(Build {
            builder,
            refit,
            given,
            counts,
            primitive_count,
            rebraid,
            wide,
            numbered,
            options,
            records: None,
            of_fewer,
        })
    }

    /// Bytes of structure and scratch memory that it needs.
    pub fn sizes(&self) -> Sizes {
        self.sizes_with(self.builder.sizes())
    }

    /// Bytes of structure and scratch memory that suffice for it and for the same with fewer primitives.
    pub fn sizes_at_most(&self) -> Sizes {
        let sizes = self.sizes_with(self.builder.sizes_at_most());
        self.of_fewer.iter().fold(sizes, |sizes, fewer| Sizes {
            structure: sizes.structure.max(fewer.structure),
            scratch: sizes.scratch.max(fewer.scratch),
            ..sizes
        })
    }

    fn sizes_with(&self, builder: Sizes) -> Sizes {
        let before = self.scratch(0).builder;
        match self.wide.map(|wide| wide.sizes()) {
            Some(of_wide) if self.numbered => {
                let wide = self.wide.expect("there is one");
                // The structure's memory has room for what the builder needs, and behind the nodes for what the wide pass does.
                let structure = of_wide.structure.max(builder.scratch);
                let structure = structure.max(wide.behind_all_nodes() + wide.passing_bytes());
                Sizes { structure, scratch: before + wide.lasting_bytes(), ..builder }
            }
            Some(wide) => {
                Sizes { structure: wide.structure, scratch: before + builder.scratch.max(wide.scratch), ..builder }
            }
            None => {
                let far = if self.is_top() { far::BYTES } else { 0 };
                Sizes { structure: builder.structure + far, scratch: before + builder.scratch, ..builder }
            }
        }
    }

    /// What the host's builder takes, and the codes.
    pub fn host_options(&self) -> (BuildOptions, Codes) {
        (BuildOptions { method: self.builder.method(), ..self.options }, self.builder.codes())
    }

    /// Puts the geometries' records into the table, where they would be written by dispatches.
    pub fn put_records(&mut self, table: &mut ArgumentTable) -> Result<()> {
        if let Some(records) = self.written_records() {
            self.records = Some(table.put(&records)?);
        }
        Ok(())
    }

    /// The records that must lie in memory.
    fn written_records(&self) -> Option<Vec<Geometry>> {
        let (BuildGeometries::Triangles(geometries) | BuildGeometries::Boxes(geometries)) = &self.given else {
            return None;
        };
        let end = Geometry { flags: GeometryFlags::END, ..Geometry::mesh(0, 0, 0) };
        match self.counts {
            Counts::OnHost if geometries.len() < 2 => None,
            Counts::OnHost => Some(geometries.clone()),
            Counts::OnDevice { .. } if geometries.is_empty() => None,
            Counts::OnDevice { .. } => Some(geometries.iter().copied().chain([end]).collect()),
        }
    }

    /// Whether the structure has nodes of eight.
    pub fn is_wide(&self) -> bool {
        self.wide.is_some()
    }

    /// What it is over.
    pub fn given(&self) -> &BuildGeometries {
        &self.given
    }

    /// Bytes of scratch memory that an update of what it built needs.
    pub fn update_scratch(&self) -> u64 {
        self.scratch(0).builder + self.refit.scratch_bytes()
    }

    /// The builder's part, with scratch memory at `scratch`.
    pub fn job(&self, structure: Region, scratch: Region) -> BuildJob<'_> {
        let parts = self.scratch(0);
        let (binary, room) = (scratch.behind(parts.binary), scratch.behind(parts.builder));
        let (structure, room) = match self.wide {
            Some(_) if self.numbered => (binary, structure),
            Some(_) => (binary, room),
            None => (structure, room),
        };
        BuildJob { builder: &self.builder, input: self.input(scratch.address), structure, scratch: room }
    }

    /// What must run behind the builder's part, with a barrier before.
    pub fn epilogue(&self, structure: Region, scratch: Region) -> Result<Vec<Step>> {
        let Some(wide) = &self.wide else {
            return Ok(self.is_top().then(|| far::step(structure.address, false)).into_iter().collect());
        };
        let parts = self.scratch(0);
        let source = scratch.behind(parts.binary).address;
        if !self.numbered {
            return wide.steps(source, [0, 0], structure, scratch.behind(parts.builder));
        }
        // Nodes are made with the records where they will be themselves, and records with those where the binary nodes were.
        let records = [structure.address, source + NODES_OFFSET];
        let memory = WideMemory {
            target: structure.address,
            passing: structure.address + wide.behind_all_nodes(),
            lasting: scratch.behind(parts.builder).address,
            records,
        };
        let input = self.input(scratch.address);
        let written = |at: u64| self.builder.numbered_step(&input, source, at).map(|step| vec![step]);
        let [nodes, moved] = wide.steps_in(source, [0, 0], &memory)?;
        Ok([written(records[0])?, nodes, written(records[1])?, moved].concat())
    }

    /// The part of an update in place, with scratch memory at `scratch`.
    pub fn update(&self, structure: Region, scratch: Region) -> refit::RefitJob<'_> {
        refit::RefitJob {
            refit: &self.refit,
            input: self.input(scratch.address),
            structure,
            scratch: scratch.behind(self.scratch(0).builder),
        }
    }

    fn is_top(&self) -> bool {
        self.given.primitives() == Primitives::Instances
    }

    fn input(&self, scratch: u64) -> Input {
        let parts = self.scratch(scratch);
        let records = self.records.unwrap_or(scratch);
        let source = match &self.given {
            BuildGeometries::Instances { .. } => Source::Entries(parts.entries),
            BuildGeometries::Triangles(geometries) | BuildGeometries::Boxes(geometries) => {
                match (&geometries[..], self.counts) {
                    ([], _) => Source::One(Geometry::mesh(0, 0, 0)),
                    (&[geometry], Counts::OnHost) => Source::One(geometry),
                    (_, Counts::OnHost) => Source::Several { records, count: geometries.len() as u32 },
                    (_, Counts::OnDevice { .. }) => Source::Several { records, count: geometries.len() as u32 + 1 },
                }
            }
        };
        Input { source, primitive_count: self.builder.count() }
    }

    /// What must have run, with a barrier behind, before the builder's part: chains of steps for [`Recorder::chains`].
    ///
    /// [`Recorder::chains`]: crate::gpu::Recorder::chains
    pub fn prologue(&self, context: &Context, scratch: u64) -> Vec<Vec<Step>> {
        match &self.given {
            BuildGeometries::Instances { data, pointers } => {
                let parts = self.scratch(scratch);
                let ranges = match self.counts {
                    Counts::OnHost => 0,
                    Counts::OnDevice { address, .. } => address,
                };
                let (count, capacity) = (self.primitive_count, self.builder.count());
                let mut steps = vec![entries_step(context, *data, *pointers, parts.entries, ranges, count, capacity)];
                if let Some(rebraid) = &self.rebraid {
                    steps.extend(rebraid.steps(context, count, parts.entries, parts.rebraid));
                }
                vec![steps]
            }
            BuildGeometries::Triangles(_) | BuildGeometries::Boxes(_) => {
                let Some(all) = self.written_records() else { return Vec::new() };
                let mut steps = if self.records.is_some() { Vec::new() } else { record_steps(&all, scratch) };
                let Counts::OnDevice { address, stride } = self.counts else {
                    return steps.into_iter().map(|step| vec![step]).collect();
                };
                let arguments = arguments::Ranges {
                    records: self.records.unwrap_or(scratch),
                    ranges: address,
                    stride,
                    count: all.len() as u32 - 1,
                    boxes: u32::from(self.given.primitives() == Primitives::Boxes),
                };
                // The records of one chain touch no memory of each other's: the barriers between them are not needed, and
                // geometries whose ranges lie in device memory are few.
                let kernel = Kernel::new(&shaders::ACCEL_BUILD_RANGES, context.tuning.small_group, &[]);
                steps.push(Step::new("geometries", kernel, &arguments, 1));
                vec![steps]
            }
        }
    }

    /// The parts of scratch memory: records of the geometries with one more that may end them, or entries; then the builder's.
    fn scratch(&self, begin: u64) -> Scratch {
        let records = match &self.given {
            BuildGeometries::Instances { .. } => u64::from(self.builder.count()) * ENTRY_BYTES,
            BuildGeometries::Triangles(geometries) | BuildGeometries::Boxes(geometries) => {
                (geometries.len() as u64 + 1) * size_of::<Geometry>() as u64
            }
        };
        let rebraid = begin + records.next_multiple_of(SCRATCH_ALIGNMENT);
        let binary = rebraid + self.rebraid.map_or(0, |r| r.scratch_bytes());
        let binary_bytes = if self.wide.is_some() { self.builder.sizes().structure } else { 0 };
        Scratch { entries: begin, rebraid, binary, builder: binary + binary_bytes.next_multiple_of(SCRATCH_ALIGNMENT) }
    }
}

/// Records that fit into the push constants.
const RECORDS_AT_ONCE: usize = 2;

/// The dispatches that write the records: they need no barrier between them.
fn record_steps(geometries: &[Geometry], records: u64) -> Vec<Step> {
    let kernel = Kernel::new(&shaders::ACCEL_BUILD_GEOMETRIES, RECORDS_AT_ONCE as u32, &[]);
    let step = |(i, chunk): (usize, &[Geometry])| {
        let mut given = [Geometry::mesh(0, 0, 0); RECORDS_AT_ONCE];
        given[..chunk.len()].copy_from_slice(chunk);
        let (at, count) = ((RECORDS_AT_ONCE * i) as u32, chunk.len() as u32);
        let given = bytemuck::cast(given);
        Step::new("geometries", kernel.clone(), &arguments::Geometries { records, at, count, given }, 1)
    };
    geometries.chunks(RECORDS_AT_ONCE).enumerate().map(step).collect()
}

/// The geometries that `info` gives with the counts of their ranges.
///
/// # Safety
/// The pointers of `info` are valid.
pub(super) unsafe fn told(
    info: &vk::AccelerationStructureBuildGeometryInfoKHR<'_>,
    ranges: &[vk::AccelerationStructureBuildRangeInfoKHR],
) -> Result<(BuildGeometries, u64)> {
    // SAFETY: the caller's promise.
    let geometries = unsafe { geometry::given(info) }?;
    if geometries.len() != ranges.len() {
        return Err(Error::Argument(format!(
            "geometryCount is {}, and there are {} ranges; give one for each geometry",
            geometries.len(),
            ranges.len()
        )));
    }
    let mut count = 0u64;
    let firsts: Vec<u32> = ranges
        .iter()
        .map(|range| {
            count += u64::from(range.primitive_count);
            // Too many are refused by the builder.
            (count - u64::from(range.primitive_count)) as u32
        })
        .collect();
    Ok((BuildGeometries::new(info.ty, &geometries, ranges, &firsts)?, count))
}

/// The geometries of `info` with at most this many primitives each. Their ranges are not known.
///
/// # Safety
/// The pointers of `info` are valid.
pub(super) unsafe fn at_most(
    info: &vk::AccelerationStructureBuildGeometryInfoKHR<'_>,
    counts: &[u32],
) -> Result<(BuildGeometries, u64)> {
    // SAFETY: the caller's promise.
    let geometries = unsafe { geometry::given(info) }?;
    if geometries.len() != counts.len() {
        return Err(Error::Argument(format!(
            "geometryCount is {}, and there are {} maximal primitive counts; give one for each geometry",
            geometries.len(),
            counts.len()
        )));
    }
    let ranges = vec![vk::AccelerationStructureBuildRangeInfoKHR::default(); counts.len()];
    Ok((BuildGeometries::new(info.ty, &geometries, &ranges, counts)?, counts.iter().copied().map(u64::from).sum()))
}
