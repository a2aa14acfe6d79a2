//! The object that stands for the driver's: sizes, handles, addresses, builds.

use super::geometry;
use crate::bvh::geometry::{Geometry, Input, Source};
use crate::bvh::lbvh::{Job, Lbvh, Options, Sizes};
use crate::gpu::push_constants::push_constants;
use crate::gpu::{Context, Kernel, Recorder, shaders};
use crate::{Error, Result};
use ash::vk;
use ash::vk::Handle;

/// What scratch addresses must be multiples of: `minAccelerationStructureScratchOffsetAlignment`.
pub const SCRATCH_ALIGNMENT: u64 = 16;
/// What the offset of a structure in its buffer must be a multiple of, as Vulkan demands it.
pub const STRUCTURE_ALIGNMENT: u64 = 256;

/// Acceleration structures on the device of a [`Context`].
///
/// As with ash, the methods are unsafe where they take handles, pointers and addresses on trust; unlike with ash, they return
/// what is wrong instead of leaving it to the validation layers.
#[derive(Clone, Copy)]
pub struct Device<'a> {
    context: &'a Context,
}

push_constants! {
    /// Push constants of `glsl/accel/geometries.comp`.
    struct Records {
        records: u64,
        at: u32,
        count: u32,
        given: [Geometry; RECORDS_AT_ONCE],
    }
}

/// Records that fit into the push constants.
const RECORDS_AT_ONCE: usize = 2;

/// A build that is asked for: everything that is read of its structs.
struct Build {
    lbvh: Lbvh,
    geometries: Vec<Geometry>,
    primitive_count: u32,
}

impl Build {
    fn new(
        context: &Context,
        info: &vk::AccelerationStructureBuildGeometryInfoKHR<'_>,
        geometries: Vec<Geometry>,
        geometry_count: u32,
        primitive_count: u64,
    ) -> Result<Build> {
        if info.ty != vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL {
            return Err(Error::Argument(format!("type is {:?}; structures are BOTTOM_LEVEL", info.ty)));
        }
        let preferences = vk::BuildAccelerationStructureFlagsKHR::PREFER_FAST_TRACE
            | vk::BuildAccelerationStructureFlagsKHR::PREFER_FAST_BUILD;
        if !preferences.contains(info.flags) {
            return Err(Error::Argument(format!("flags are {:?}; take {preferences:?} or none", info.flags)));
        }
        let primitive_count = u32::try_from(primitive_count).unwrap_or(u32::MAX);
        let options = Options { geometry_count: geometry_count.max(1), ..Options::DEFAULT };
        let lbvh = Lbvh::new(context, &options, primitive_count)?;
        Ok(Build { lbvh, geometries, primitive_count })
    }

    fn has_records(geometry_count: usize) -> bool {
        geometry_count > 1
    }

    /// Bytes of the records, which lie before the builder's own scratch memory.
    fn record_bytes(geometry_count: usize) -> u64 {
        let records = if Build::has_records(geometry_count) { geometry_count } else { 0 };
        (records * size_of::<Geometry>()).next_multiple_of(SCRATCH_ALIGNMENT as usize) as u64
    }

    fn job(&self, structure: u64, scratch: u64) -> Job<'_> {
        let source = match self.geometries[..] {
            [] => Source::One(Geometry::mesh(0, 0, 0)),
            [geometry] => Source::One(geometry),
            _ => Source::Several { records: scratch, count: self.geometries.len() as u32 },
        };
        let input = Input { source, primitive_count: self.primitive_count };
        let scratch = scratch + Build::record_bytes(self.geometries.len());
        Job { lbvh: &self.lbvh, input, structure, scratch }
    }

    /// The dispatches that write the records: they need no barrier between them.
    fn write_records(&self, recorder: &mut Recorder<'_>, records: u64) -> Result<()> {
        if !Build::has_records(self.geometries.len()) {
            return Ok(());
        }
        let kernel = Kernel::new(&shaders::ACCEL_GEOMETRIES, RECORDS_AT_ONCE as u32, &[]);
        for (i, chunk) in self.geometries.chunks(RECORDS_AT_ONCE).enumerate() {
            let mut given = [Geometry::mesh(0, 0, 0); RECORDS_AT_ONCE];
            given[..chunk.len()].copy_from_slice(chunk);
            let (at, count) = ((RECORDS_AT_ONCE * i) as u32, chunk.len() as u32);
            recorder.dispatch(&kernel, &Records { records, at, count, given }, 1)?;
        }
        Ok(())
    }
}

impl<'a> Device<'a> {
    /// Structures on the device of `context`.
    pub fn new(context: &'a Context) -> Device<'a> {
        Device { context }
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
        if build_type != vk::AccelerationStructureBuildTypeKHR::DEVICE {
            return Err(Error::Argument(format!("buildType is {build_type:?}; structures are built on the DEVICE")));
        }
        // SAFETY: the caller's promise.
        let given = unsafe { geometry::given(info) }?;
        if given.len() != max_primitive_counts.len() {
            return Err(Error::Argument(format!(
                "geometryCount is {}, and there are {} maximal primitive counts; give one for each geometry",
                given.len(),
                max_primitive_counts.len()
            )));
        }
        for geometry in &given {
            geometry::triangles(geometry, &vk::AccelerationStructureBuildRangeInfoKHR::default(), 0)?;
        }
        let count = max_primitive_counts.iter().copied().map(u64::from).sum();
        let Sizes { structure, scratch, .. } =
            Build::new(self.context, info, Vec::new(), given.len() as u32, count)?.lbvh.sizes_at_most();
        size_info.acceleration_structure_size = structure;
        size_info.build_scratch_size = scratch + Build::record_bytes(given.len());
        size_info.update_scratch_size = 0;
        Ok(())
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
        let address = unsafe { self.context.ash_device().get_buffer_device_address(&buffer) };
        Ok(vk::AccelerationStructureKHR::from_raw(address + info.offset))
    }

    /// `vkDestroyAccelerationStructureKHR`. A handle owns nothing: the memory is the caller's before and after.
    pub fn destroy_acceleration_structure(
        &self,
        _structure: vk::AccelerationStructureKHR,
        _allocation_callbacks: Option<&vk::AllocationCallbacks<'_>>,
    ) {
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
            // SAFETY: the caller's promise.
            let build = unsafe { self.build_of(info, ranges) }.map_err(|error| within(i, error))?;
            // SAFETY: device builds give device addresses.
            let scratch = unsafe { info.scratch_data.device_address };
            builds.push((build, info.dst_acceleration_structure.as_raw(), scratch));
        }
        let jobs: Vec<Job<'_>> =
            builds.iter().map(|(build, structure, scratch)| build.job(*structure, *scratch)).collect();
        let chains = Lbvh::chains(&jobs)?;
        // SAFETY: the caller's promise.
        let mut recorder = unsafe { Recorder::new(self.context, commands) };
        for (build, _, scratch) in &builds {
            build.write_records(&mut recorder, *scratch)?;
        }
        if builds.iter().any(|(build, ..)| Build::has_records(build.geometries.len())) {
            recorder.barrier();
        }
        recorder.chains(&chains)
    }

    unsafe fn build_of(
        &self,
        info: &vk::AccelerationStructureBuildGeometryInfoKHR<'_>,
        ranges: &[vk::AccelerationStructureBuildRangeInfoKHR],
    ) -> Result<Build> {
        // SAFETY: the caller's promise; device builds give device addresses.
        let (given, scratch) = unsafe { (geometry::given(info)?, info.scratch_data.device_address) };
        let refuse = |what: String| Err(Error::Argument(what));
        if info.mode != vk::BuildAccelerationStructureModeKHR::BUILD {
            return refuse(format!("mode is {:?}; it must be BUILD", info.mode));
        }
        if given.len() != ranges.len() {
            return refuse(format!("geometryCount is {}, and there are {} ranges", given.len(), ranges.len()));
        }
        if info.dst_acceleration_structure.is_null() {
            return refuse("dstAccelerationStructure is null; create it first".into());
        }
        if scratch == 0 || !scratch.is_multiple_of(SCRATCH_ALIGNMENT) {
            return refuse(format!(
                "scratchData.deviceAddress is {scratch:#x}; it must be a multiple of {SCRATCH_ALIGNMENT} and not zero"
            ));
        }
        let mut count = 0u64;
        let mut geometries = Vec::with_capacity(given.len());
        for (geometry, range) in given.into_iter().zip(ranges) {
            // Too many are refused below.
            geometries.push(geometry::triangles(geometry, range, count as u32)?);
            count += u64::from(range.primitive_count);
        }
        Build::new(self.context, info, geometries, info.geometry_count, count)
    }
}

fn within(build: usize, error: Error) -> Error {
    match error {
        Error::Argument(what) => Error::Argument(format!("pInfos[{build}]: {what}")),
        other => other,
    }
}
