//! The driver's own acceleration structure (`VK_KHR_acceleration_structure`): what an engine uses where the device has it,
//! and so what ours is measured against.

use super::{Buffer, Device, DriverTracing};
use crate::{Error, Result};
use ash::vk;
use hedgerow::gpu::Recorder;

/// What the driver is asked to be good at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum DriverPreference {
    /// `VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_BUILD_BIT_KHR`.
    FastBuild,
    /// `VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR`.
    FastTrace,
}

impl DriverPreference {
    fn flags(self) -> vk::BuildAccelerationStructureFlagsKHR {
        match self {
            DriverPreference::FastBuild => vk::BuildAccelerationStructureFlagsKHR::PREFER_FAST_BUILD,
            DriverPreference::FastTrace => vk::BuildAccelerationStructureFlagsKHR::PREFER_FAST_TRACE,
        }
    }
}

/// Bytes of a structure, by the driver's own size query.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DriverSizes {
    /// Bottom level (the triangles).
    pub bottom: u64,
    /// Top level (one instance).
    pub top: u64,
    /// Scratch of the bottom level's build.
    pub scratch: u64,
}

/// Triangles in a bottom-level structure and one instance of it in a top-level structure, with all their memory.
pub struct DriverStructure<'a> {
    // Dropped before the buffers that it lies in.
    bottom: Handle,
    top: Handle,
    geometry: [vk::AccelerationStructureGeometryKHR<'static>; 2],
    preference: DriverPreference,
    tracing: DriverTracing,
    triangles: u32,
    scratch_address: u64,
    sizes: DriverSizes,
    _memory: [Buffer<'a>; 6],
}

/// One `VkAccelerationStructureKHR`.
struct Handle {
    functions: ash::khr::acceleration_structure::Device,
    raw: vk::AccelerationStructureKHR,
}

impl Drop for Handle {
    fn drop(&mut self) {
        // SAFETY: ours, and every submit that used it has been waited for.
        unsafe { self.functions.destroy_acceleration_structure(self.raw, None) };
    }
}

impl Handle {
    fn new(
        functions: &ash::khr::acceleration_structure::Device,
        kind: vk::AccelerationStructureTypeKHR,
        storage: &Buffer<'_>,
        bytes: u64,
    ) -> Result<Handle> {
        let info = vk::AccelerationStructureCreateInfoKHR::default().buffer(storage.raw()).size(bytes).ty(kind);
        // SAFETY: the buffer is live, large enough and has the usage that `Device::buffer` gives with them.
        let raw = unsafe { functions.create_acceleration_structure(&info, None) }
            .map_err(Error::vulkan("vkCreateAccelerationStructureKHR"))?;
        Ok(Handle { functions: functions.clone(), raw })
    }

    fn address(&self) -> u64 {
        let info = vk::AccelerationStructureDeviceAddressInfoKHR::default().acceleration_structure(self.raw);
        // SAFETY: the handle is live.
        unsafe { self.functions.get_acceleration_structure_device_address(&info) }
    }
}

impl<'a> DriverStructure<'a> {
    /// Memory and handles for `triangles` over `positions`, uploaded; nothing is built yet.
    ///
    /// # Errors
    /// The device was opened without the driver's structures or has none; too many triangles for it; too little memory.
    pub fn new(
        device: &'a Device,
        positions: &[[f32; 3]],
        triangles: &[[u32; 3]],
        preference: DriverPreference,
    ) -> Result<DriverStructure<'a>> {
        let Some(tracing) = device.driver_tracing() else {
            return Err(not_there(device).into());
        };
        let mut limits = vk::PhysicalDeviceAccelerationStructurePropertiesKHR::default();
        let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut limits);
        // SAFETY: the handles are live; the structures outlive the call.
        unsafe {
            device.ash_instance().get_physical_device_properties2(device.physical_device(), &mut properties);
        }
        let most = limits.max_primitive_count.min(u64::from(u32::MAX));
        if triangles.len() as u64 > most {
            let message = format!("{} triangles, {} builds of at most {most}", triangles.len(), device.found().name);
            return Err(Error::Argument(format!("{message}; take a smaller scene or another builder")));
        }
        let count = triangles.len() as u32;
        let functions = ash::khr::acceleration_structure::Device::new(device.ash_instance(), device.ash_device());

        let position_buffer = device.upload("driver: positions", positions)?;
        let index_buffer = device.upload("driver: indices", triangles)?;
        let triangle_data = vk::AccelerationStructureGeometryTrianglesDataKHR::default()
            .vertex_format(vk::Format::R32G32B32_SFLOAT)
            .vertex_data(vk::DeviceOrHostAddressConstKHR { device_address: position_buffer.address() })
            .vertex_stride(size_of::<[f32; 3]>() as u64)
            .max_vertex(positions.len().saturating_sub(1) as u32)
            .index_type(vk::IndexType::UINT32)
            .index_data(vk::DeviceOrHostAddressConstKHR { device_address: index_buffer.address() });
        let bottom_geometry = vk::AccelerationStructureGeometryKHR::default()
            .geometry_type(vk::GeometryTypeKHR::TRIANGLES)
            .geometry(vk::AccelerationStructureGeometryDataKHR { triangles: triangle_data })
            .flags(vk::GeometryFlagsKHR::OPAQUE);
        let bottom_kind = vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL;
        let bottom_sizes = build_sizes(&functions, bottom_kind, preference, &bottom_geometry, count);
        let bottom_buffer = device.buffer("driver: bottom level", bottom_sizes.acceleration_structure_size)?;
        let bottom = Handle::new(&functions, bottom_kind, &bottom_buffer, bottom_sizes.acceleration_structure_size)?;

        let instance = vk::AccelerationStructureInstanceKHR {
            transform: vk::TransformMatrixKHR { matrix: [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0.] },
            instance_custom_index_and_mask: vk::Packed24_8::new(0, 0xFF),
            instance_shader_binding_table_record_offset_and_flags: vk::Packed24_8::new(
                0,
                vk::GeometryInstanceFlagsKHR::TRIANGLE_FACING_CULL_DISABLE.as_raw() as u8,
            ),
            acceleration_structure_reference: vk::AccelerationStructureReferenceKHR { device_handle: bottom.address() },
        };
        let instance_buffer = device.upload("driver: instance", &instance_words(&instance))?;
        let instance_data = vk::AccelerationStructureGeometryInstancesDataKHR::default()
            .data(vk::DeviceOrHostAddressConstKHR { device_address: instance_buffer.address() });
        let top_geometry = vk::AccelerationStructureGeometryKHR::default()
            .geometry_type(vk::GeometryTypeKHR::INSTANCES)
            .geometry(vk::AccelerationStructureGeometryDataKHR { instances: instance_data })
            .flags(vk::GeometryFlagsKHR::OPAQUE);
        let top_kind = vk::AccelerationStructureTypeKHR::TOP_LEVEL;
        let top_sizes = build_sizes(&functions, top_kind, preference, &top_geometry, 1);
        let top_buffer = device.buffer("driver: top level", top_sizes.acceleration_structure_size)?;
        let top = Handle::new(&functions, top_kind, &top_buffer, top_sizes.acceleration_structure_size)?;

        // One after the other in the same scratch memory, which must begin at the device's own alignment.
        let alignment = u64::from(limits.min_acceleration_structure_scratch_offset_alignment).max(1);
        let scratch = bottom_sizes.build_scratch_size.max(top_sizes.build_scratch_size);
        let scratch_buffer = device.buffer("driver: scratch", scratch + alignment)?;
        Ok(DriverStructure {
            bottom,
            top,
            geometry: [bottom_geometry, top_geometry],
            preference,
            tracing,
            triangles: count,
            scratch_address: scratch_buffer.address().next_multiple_of(alignment),
            sizes: DriverSizes {
                bottom: bottom_sizes.acceleration_structure_size,
                top: top_sizes.acceleration_structure_size,
                scratch: bottom_sizes.build_scratch_size,
            },
            _memory: [position_buffer, index_buffer, bottom_buffer, instance_buffer, top_buffer, scratch_buffer],
        })
    }

    /// Records the build: the phase `build` is the bottom level, the phase `tlas` the one instance above it.
    ///
    /// What is recorded behind it may trace rays through the structure.
    pub fn record(&self, recorder: &mut Recorder<'_>) {
        recorder.phase("build");
        self.record_level(recorder, vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL);
        recorder.phase("tlas");
        self.record_level(recorder, vk::AccelerationStructureTypeKHR::TOP_LEVEL);
    }

    fn record_level(&self, recorder: &mut Recorder<'_>, kind: vk::AccelerationStructureTypeKHR) {
        let (handle, geometry, count) = match kind {
            vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL => (&self.bottom, &self.geometry[0], self.triangles),
            _ => (&self.top, &self.geometry[1], 1),
        };
        let info = build_info(kind, self.preference, geometry)
            .dst_acceleration_structure(handle.raw)
            .scratch_data(vk::DeviceOrHostAddressKHR { device_address: self.scratch_address });
        let range = vk::AccelerationStructureBuildRangeInfoKHR::default().primitive_count(count);
        let commands = recorder.commands();
        // The next level reads this one and reuses its scratch; rays read both.
        let build =
            vk::AccessFlags::ACCELERATION_STRUCTURE_READ_KHR | vk::AccessFlags::ACCELERATION_STRUCTURE_WRITE_KHR;
        let barrier = vk::MemoryBarrier::default().src_access_mask(build).dst_access_mask(build);
        // SAFETY: the recorder's commands are being recorded; structure, inputs and scratch are alive as long as `self`,
        // are of the sizes that the driver asked for, and every submit of `Device` waits.
        unsafe {
            handle.functions.cmd_build_acceleration_structures(commands, &[info], &[&[range]]);
            recorder.context().ash_device().cmd_pipeline_barrier(
                commands,
                vk::PipelineStageFlags::ACCELERATION_STRUCTURE_BUILD_KHR,
                vk::PipelineStageFlags::ACCELERATION_STRUCTURE_BUILD_KHR | self.tracing.stage(),
                vk::DependencyFlags::empty(),
                &[barrier],
                &[],
                &[],
            );
        }
    }

    /// The top level's address, for [`super::DriverRays`] and for `accelerationStructureEXT(uvec2)` in a shader.
    pub fn address(&self) -> u64 {
        self.top.address()
    }

    /// Bytes of the structure and of its scratch.
    pub fn sizes(&self) -> DriverSizes {
        self.sizes
    }
}

/// The driver has no structures, or the device was opened without.
pub(super) fn not_there(device: &Device) -> hedgerow::Error {
    let missing =
        "VK_KHR_acceleration_structure with VK_KHR_ray_query or VK_KHR_ray_tracing_pipeline (or was opened without)";
    hedgerow::Error::Unsupported { device: device.found().name.clone(), missing: vec![missing.into()] }
}

fn build_info<'g>(
    kind: vk::AccelerationStructureTypeKHR,
    preference: DriverPreference,
    geometry: &'g vk::AccelerationStructureGeometryKHR<'static>,
) -> vk::AccelerationStructureBuildGeometryInfoKHR<'g> {
    vk::AccelerationStructureBuildGeometryInfoKHR::default()
        .ty(kind)
        .flags(preference.flags())
        .mode(vk::BuildAccelerationStructureModeKHR::BUILD)
        .geometries(std::slice::from_ref(geometry))
}

fn build_sizes(
    functions: &ash::khr::acceleration_structure::Device,
    kind: vk::AccelerationStructureTypeKHR,
    preference: DriverPreference,
    geometry: &vk::AccelerationStructureGeometryKHR<'static>,
    count: u32,
) -> vk::AccelerationStructureBuildSizesInfoKHR<'static> {
    let mut sizes = vk::AccelerationStructureBuildSizesInfoKHR::default();
    let info = build_info(kind, preference, geometry);
    let place = vk::AccelerationStructureBuildTypeKHR::DEVICE;
    // SAFETY: one geometry, one count.
    unsafe { functions.get_acceleration_structure_build_sizes(place, &info, &[count], &mut sizes) };
    sizes
}

/// The 64 bytes of an instance, which `ash` declares without `bytemuck`.
fn instance_words(instance: &vk::AccelerationStructureInstanceKHR) -> [u32; 16] {
    const { assert!(size_of::<vk::AccelerationStructureInstanceKHR>() == 64) };
    // SAFETY: `repr(C)`, 64 bytes without padding, every member initialised.
    unsafe { std::mem::transmute_copy(instance) }
}
