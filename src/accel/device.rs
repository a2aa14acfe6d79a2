//! The object that stands for the driver's: sizes, handles, addresses, builds.

use super::build::{self, Build, Counts, SCRATCH_ALIGNMENT};
use super::checked::{CheckedBuild, Checks};
use super::copy::clone_step;
use super::given::not_null;
use super::{AccelOptions, Placement, Request, geometry};
use crate::bvh::builder::{BuildJob, Builder};
use crate::bvh::geometry::Geometry;
use crate::bvh::refit::Refit;
use crate::gpu::arguments;
use crate::gpu::{ArgumentMemory, ArgumentTable, Context, Recorder, Region, Sizes, Step};
use crate::{Error, Result};
use ash::vk;
use ash::vk::Handle;
use std::sync::Arc;

/// The offset of a structure in its buffer must be a multiple of this, as Vulkan requires.
pub const STRUCTURE_ALIGNMENT: u64 = 256;

type Flags = vk::BuildAccelerationStructureFlagsKHR;

/// Acceleration structures on the device of a [`Context`].
///
/// As with ash, the methods are unsafe where they take handles, pointers and addresses on trust; unlike with ash, they return
/// what is wrong instead of leaving it to the validation layers.
#[derive(Clone)]
pub struct Device<'a> {
    pub(super) context: &'a Context,
    options: AccelOptions,
    /// Where arguments lie that are too many for push constants.
    arguments: Option<ArgumentMemory>,
    /// Where [`Options::checked`] asks for it; shared with clones.
    pub(super) checks: Option<Arc<Checks>>,
}

impl<'a> Device<'a> {
    /// Structures on the device of `context`.
    pub fn new(context: &'a Context) -> Device<'a> {
        Device::with_options(context, AccelOptions::DEFAULT)
    }

    /// The same with options.
    pub fn with_options(context: &'a Context, options: AccelOptions) -> Device<'a> {
        Device { context, options, arguments: None, checks: options.checked.then(Default::default) }
    }

    /// The same structures, whose builds read their arguments from `memory`: a call for thousands of small builds records one dispatch
    /// for all steps of a kind in place of one each or one for two, and the records of geometries are written at once in place of two at a
    /// time. Each call needs [`Device::argument_bytes`] there, and has the memory for itself while it runs, like scratch memory.
    ///
    /// # Safety
    /// As [`ArgumentMemory`] says, whenever this device or a clone records builds.
    pub unsafe fn with_arguments_in(&self, memory: ArgumentMemory) -> Device<'a> {
        Device { arguments: Some(memory), ..self.clone() }
    }

    /// Bytes that suffice for the arguments of one call of so many builds with so many geometries in all.
    pub const fn argument_bytes(builds: u64, geometries: u64) -> u64 {
        /// What one workgroup does of a build, in a dispatch each: the order of its primitives, its hierarchy, its optimising, its finishing and
        /// its wide nodes.
        const SHARED: u64 = 5;
        // Of each build the records of its geometries, one more, what fills up to the alignment, and its arguments.
        (size_of::<Geometry>() as u64) * (geometries + builds)
            + (size_of::<arguments::Small>() as u64 + 2 * ArgumentTable::ALIGNMENT) * builds
            + SHARED * ArgumentTable::ROW_BYTES * builds
    }

    /// `vkGetAccelerationStructureBuildSizesKHR`: bytes that a build of at most `max_primitive_counts` primitives a geometry
    /// needs. Addresses in the geometries are not looked at.
    ///
    /// # Errors
    /// A field asks for what there is not; too many primitives.
    ///
    /// # Safety
    /// The pointers of `info` are valid.
    pub unsafe fn get_acceleration_structure_build_sizes(
        &self,
        build_type: vk::AccelerationStructureBuildTypeKHR,
        info: &vk::AccelerationStructureBuildGeometryInfoKHR<'_>,
        max_primitive_counts: &[u32],
        size_info: &mut vk::AccelerationStructureBuildSizesInfoKHR<'_>,
    ) -> Result<()> {
        // SAFETY: the caller's promise.
        let (given, count) = unsafe { build::at_most(info, max_primitive_counts) }?;
        let build = Build::new(self.context, &self.options, info.flags, given, Counts::OnHost, count)?;
        let Sizes { structure, scratch, .. } = build.sizes_at_most();
        size_info.acceleration_structure_size = structure;
        let on_host = build_type == vk::AccelerationStructureBuildTypeKHR::HOST;
        size_info.build_scratch_size = if on_host { 0 } else { scratch };
        size_info.update_scratch_size = if on_host { 0 } else { build.update_scratch() };
        Ok(())
    }

    /// Whether a build over so many primitives a geometry makes nodes of eight children ([`AccelOptions::wide`]). What shaders meet none of
    /// they may leave out (`HEDGEROW_FORMS` in `glsl/trace/query_walk.glsl`).
    ///
    /// # Errors
    /// As of [`Device::get_acceleration_structure_build_sizes`].
    ///
    /// # Safety
    /// The pointers of `info` are valid.
    pub unsafe fn makes_nodes_of_eight(
        &self,
        info: &vk::AccelerationStructureBuildGeometryInfoKHR<'_>,
        primitive_counts: &[u32],
    ) -> Result<bool> {
        // SAFETY: the caller's promise.
        let (given, count) = unsafe { build::at_most(info, primitive_counts) }?;
        Ok(Build::new(self.context, &self.options, info.flags, given, Counts::OnHost, count)?.is_wide())
    }

    /// `vkCreateAccelerationStructureKHR`: a handle for the place that `info` names. Nothing is allocated.
    ///
    /// # Errors
    /// The offset is not a multiple of [`STRUCTURE_ALIGNMENT`].
    ///
    /// # Safety
    /// The buffer is live, has the usage that [the module](super) names, and as many bytes behind the offset.
    pub unsafe fn create_acceleration_structure(
        &self,
        info: &vk::AccelerationStructureCreateInfoKHR<'_>,
        _allocation_callbacks: Option<&vk::AllocationCallbacks<'_>>,
    ) -> Result<vk::AccelerationStructureKHR> {
        if !info.offset.is_multiple_of(STRUCTURE_ALIGNMENT) {
            return Err(Error::Argument(format!(
                "offset is {}; it must be a multiple of {STRUCTURE_ALIGNMENT}",
                info.offset
            )));
        }
        let buffer = vk::BufferDeviceAddressInfo::default().buffer(info.buffer);
        // SAFETY: the caller's promise.
        let address = unsafe { self.context.ash_device().get_buffer_device_address(&buffer) } + info.offset;
        if let Some(checks) = &self.checks {
            // SAFETY: the caller's promise.
            let there = unsafe { self.context.ash_device().get_buffer_memory_requirements(info.buffer) }.size;
            if info.offset.saturating_add(info.size) > there {
                return Err(Error::Argument(format!(
                    "offset {} and size {} reach behind the buffer's {there} bytes; create a larger buffer",
                    info.offset, info.size
                )));
            }
            checks.created(address, info.size, info.ty);
        }
        Ok(vk::AccelerationStructureKHR::from_raw(address))
    }

    /// `vkDestroyAccelerationStructureKHR`. A handle owns nothing: the memory is the caller's before and after.
    pub fn destroy_acceleration_structure(
        &self,
        structure: vk::AccelerationStructureKHR,
        _allocation_callbacks: Option<&vk::AllocationCallbacks<'_>>,
    ) {
        if let Some(checks) = &self.checks {
            checks.destroyed(structure.as_raw());
        }
    }

    /// `vkGetAccelerationStructureDeviceAddressKHR`: what shaders trace through, and the tracer takes.
    pub fn get_acceleration_structure_device_address(
        &self,
        info: &vk::AccelerationStructureDeviceAddressInfoKHR<'_>,
    ) -> vk::DeviceAddress {
        info.acceleration_structure.as_raw()
    }

    /// `vkCmdBuildAccelerationStructuresKHR`: records all builds side by side. Their phases share barriers, and none waits for
    /// another.
    ///
    /// # Errors
    /// A field asks for what there is not, or breaks a rule of Vulkan's that can be seen without the device. Nothing is
    /// recorded then.
    ///
    /// # Safety
    /// `commands` is being recorded, outside a render pass, on a queue with compute. Pointers are valid; addresses, handles
    /// and the memory behind them stay so until it has run; no build's memory is another's.
    pub unsafe fn cmd_build_acceleration_structures(
        &self,
        commands: vk::CommandBuffer,
        infos: &[vk::AccelerationStructureBuildGeometryInfoKHR<'_>],
        build_range_infos: &[&[vk::AccelerationStructureBuildRangeInfoKHR]],
    ) -> Result<()> {
        if infos.len() != build_range_infos.len() {
            return Err(Error::Argument(format!(
                "{} builds and {} arrays of ranges; give one for each",
                infos.len(),
                build_range_infos.len()
            )));
        }
        let mut builds = Vec::with_capacity(infos.len());
        for (i, (info, ranges)) in infos.iter().zip(build_range_infos).enumerate() {
            let build = || {
                // SAFETY: the caller's promise.
                let (given, count) = unsafe { build::told(info, ranges) }?;
                self.placed(info, given, Counts::OnHost, count)
            };
            builds.push(build().map_err(|error| within(i, error))?);
        }
        let ranges = build_range_infos.iter().map(|ranges| ranges.to_vec());
        // SAFETY: the caller's promise.
        unsafe {
            self.check(infos, ranges, &builds)?;
            self.record_placed(&mut Recorder::new(self.context, commands), &mut builds)
        }
    }

    /// `vkCmdBuildAccelerationStructuresIndirectKHR`: like [`Device::cmd_build_acceleration_structures`], with the ranges of
    /// build i in device memory from `indirect_device_addresses[i]` on, `indirect_strides[i]` bytes apart.
    ///
    /// # Errors
    /// As there; a stride is not a multiple of 4.
    ///
    /// # Safety
    /// As there; the ranges are there when it runs. A count over its maximum is taken as the maximum.
    pub unsafe fn cmd_build_acceleration_structures_indirect(
        &self,
        commands: vk::CommandBuffer,
        infos: &[vk::AccelerationStructureBuildGeometryInfoKHR<'_>],
        indirect_device_addresses: &[vk::DeviceAddress],
        indirect_strides: &[u32],
        max_primitive_counts: &[&[u32]],
    ) -> Result<()> {
        let lengths = [indirect_device_addresses.len(), indirect_strides.len(), max_primitive_counts.len()];
        if lengths != [infos.len(); 3] {
            return Err(Error::Argument(format!(
                "{} builds and {lengths:?} addresses, strides and arrays of counts; give one for each",
                infos.len()
            )));
        }
        let mut builds = Vec::with_capacity(infos.len());
        for (i, info) in infos.iter().enumerate() {
            let (address, stride) = (indirect_device_addresses[i], indirect_strides[i]);
            let build = || {
                if !address.is_multiple_of(4) || !stride.is_multiple_of(4) {
                    return Err(Error::Argument(format!(
                        "the ranges lie at {address:#x}, {stride} bytes apart; both must be multiples of 4"
                    )));
                }
                // SAFETY: the caller's promise.
                let (given, count) = unsafe { build::at_most(info, max_primitive_counts[i]) }?;
                self.placed(info, given, Counts::OnDevice { address, stride }, count)
            };
            builds.push(build().map_err(|error| within(i, error))?);
        }
        let range = |&count: &u32| vk::AccelerationStructureBuildRangeInfoKHR::default().primitive_count(count);
        let ranges = max_primitive_counts.iter().map(|counts| counts.iter().map(range).collect());
        // SAFETY: the caller's promise.
        unsafe {
            self.check(infos, ranges, &builds)?;
            self.record_placed(&mut Recorder::new(self.context, commands), &mut builds)
        }
    }

    /// Where checks are asked for: the rules that take memory of what was created and built.
    unsafe fn check(
        &self,
        infos: &[vk::AccelerationStructureBuildGeometryInfoKHR<'_>],
        ranges: impl Iterator<Item = Vec<vk::AccelerationStructureBuildRangeInfoKHR>>,
        builds: &[PlacedBuild],
    ) -> Result<()> {
        let Some(checks) = &self.checks else { return Ok(()) };
        let asked = infos.iter().zip(ranges).zip(builds).map(|((info, ranges), placed)| {
            // SAFETY: the caller's promise.
            let geometries = unsafe { geometry::given(info) }?;
            let Sizes { structure, scratch, .. } = placed.build.sizes();
            let scratch_bytes = if placed.source.is_some() { placed.build.update_scratch() } else { scratch };
            Ok(CheckedBuild { info, geometries, ranges, structure_bytes: structure, scratch_bytes })
        });
        checks.builds(&asked.collect::<Result<Vec<_>>>()?)
    }

    /// What `info` asks for, with its memory.
    fn placed(
        &self,
        info: &vk::AccelerationStructureBuildGeometryInfoKHR<'_>,
        given: geometry::BuildGeometries,
        counts: Counts,
        primitive_count: u64,
    ) -> Result<PlacedBuild> {
        // SAFETY: device builds give device addresses.
        let scratch = unsafe { info.scratch_data.device_address };
        let refuse = |what: String| Err(Error::Argument(what));
        let source = match info.mode {
            vk::BuildAccelerationStructureModeKHR::BUILD => None,
            vk::BuildAccelerationStructureModeKHR::UPDATE => {
                if !info.flags.contains(Flags::ALLOW_UPDATE) {
                    return refuse("mode is UPDATE and flags lack ALLOW_UPDATE; build it with that flag".into());
                }
                Some(not_null("srcAccelerationStructure", info.src_acceleration_structure)?)
            }
            other => return refuse(format!("mode is {other:?}; it must be BUILD or UPDATE")),
        };
        if info.dst_acceleration_structure.is_null() {
            return refuse("dstAccelerationStructure is null; create it first".into());
        }
        if scratch == 0 || !scratch.is_multiple_of(SCRATCH_ALIGNMENT) {
            return refuse(format!(
                "scratchData.deviceAddress is {scratch:#x}; it must be a multiple of {SCRATCH_ALIGNMENT} and not zero"
            ));
        }
        let build = Build::new(self.context, &self.options, info.flags, given, counts, primitive_count)?;
        let structure = Region::unbounded(info.dst_acceleration_structure.as_raw());
        Ok(PlacedBuild { build, source, structure, scratch: Region::unbounded(scratch) })
    }

    /// Records builds that are asked for without Vulkan's structs, side by side as
    /// [`Device::cmd_build_acceleration_structures`] does. Nothing is checked against what was created.
    ///
    /// # Errors
    /// A request that cannot be built; memory that is too small; nothing is recorded then.
    ///
    /// # Safety
    /// As there.
    pub unsafe fn record(&self, commands: vk::CommandBuffer, placements: &[Placement<'_>]) -> Result<()> {
        let placed = placements.iter().map(|&Placement { request, structure, scratch }| {
            let build = request.build(self)?;
            let sizes = build.sizes();
            structure.checked("memory for an acceleration structure", sizes.structure, sizes.alignment)?;
            scratch.checked("scratch memory for an acceleration structure", sizes.scratch, SCRATCH_ALIGNMENT)?;
            Ok(PlacedBuild { build, source: None, structure, scratch })
        });
        let mut builds = placed.collect::<Result<Vec<_>>>()?;
        // SAFETY: the caller's promise.
        let mut recorder = unsafe { Recorder::new(self.context, commands) };
        self.record_placed(&mut recorder, &mut builds)
    }

    /// Makes the pipelines of these builds now, and of their updates if the flags allow updates. Recording the same later, for
    /// the same number of primitives, makes no pipeline any more. Addresses are not read.
    ///
    /// # Errors
    /// A request that cannot be built; a pipeline could not be made.
    pub fn warm(&self, requests: &[Request]) -> Result<()> {
        let placed = |request: &Request, source| {
            Ok(PlacedBuild { build: request.build(self)?, source, structure: NOWHERE, scratch: NOWHERE })
        };
        const NOWHERE: Region = Region::unbounded(0);
        let anew = requests.iter().map(|request| placed(request, None));
        // From another structure: a copy is part of it.
        const ANOTHER: u64 = 16;
        let can_be_updated = |request: &&Request| request.flags.contains(Flags::ALLOW_UPDATE);
        let updates = requests.iter().filter(can_be_updated).map(|request| placed(request, Some(ANOTHER)));
        let mut builds = anew.chain(updates).collect::<Result<Vec<_>>>()?;
        self.record_placed(&mut Recorder::warming(self.context), &mut builds)
    }

    /// The options that it was made with.
    pub fn options(&self) -> &AccelOptions {
        &self.options
    }

    fn record_placed(&self, recorder: &mut Recorder<'_>, builds: &mut [PlacedBuild]) -> Result<()> {
        let memory = self.arguments.filter(|_| recorder.commands() != vk::CommandBuffer::null());
        // SAFETY: the promise of `with_arguments_in`.
        let table = memory.map(|memory| unsafe { ArgumentTable::new(self.context, memory) });
        let mut table = table.transpose()?;
        if let Some(table) = &mut table {
            builds.iter_mut().try_for_each(|placed| placed.build.put_records(table))?;
        }
        let (updates, builds_anew): (Vec<&PlacedBuild>, Vec<&PlacedBuild>) =
            builds.iter().partition(|p| p.source.is_some());
        let jobs: Vec<BuildJob<'_>> = builds_anew.iter().map(|p| p.build.job(p.structure, p.scratch)).collect();
        let updates_in_place: Vec<_> = updates.iter().map(|p| p.build.update(p.structure, p.scratch)).collect();
        let mut chains = Builder::chains(&jobs, table.as_mut())?;
        chains.extend(Refit::chains(&updates_in_place)?);
        let epilogues = builds_anew.iter().map(|p| p.build.epilogue(p.structure, p.scratch));
        let mut epilogues: Vec<Vec<Step>> = epilogues.collect::<Result<_>>()?;
        if let Some(table) = &mut table {
            table.share_dispatches(&mut epilogues)?;
        } else if self.arguments.is_some() {
            recorder.warm_by_table(chains.iter().chain(&epilogues).flatten())?;
        }
        let mut prologues: Vec<Vec<Step>> =
            builds.iter().flat_map(|p| p.build.prologue(self.context, p.scratch.address)).collect();
        // An update from another structure is one in place, of its copy.
        let from_another = |p: &&PlacedBuild| {
            p.source.map(|source| (source, p.structure.address)).filter(|(source, target)| source != target)
        };
        let copies = updates.iter().filter_map(from_another);
        if let Some(table) = &table {
            recorder.write_table(table);
        }
        prologues.extend(copies.map(|(source, target)| vec![clone_step(self.context, source, target)]));
        if !prologues.is_empty() {
            recorder.chains(&prologues)?;
            recorder.barrier();
        }
        recorder.chains(&chains)?;
        if epilogues.iter().any(|steps| !steps.is_empty()) {
            recorder.barrier();
            recorder.chains(&epilogues)?;
        }
        Ok(())
    }
}

/// A build with its memory.
struct PlacedBuild {
    build: Build,
    /// The structure that is updated, where it is an update.
    source: Option<u64>,
    structure: Region,
    scratch: Region,
}

pub(super) fn within(build: usize, error: Error) -> Error {
    match error {
        Error::Argument(what) => Error::Argument(format!("pInfos[{build}]: {what}")),
        other => other,
    }
}
