//! On a device made by what the library requires: what a context takes, and refusals that name the field.

use hedgerow::ash::{self, ext, vk};
use hedgerow_capi::*;
use std::ffi::CStr;
use std::ptr::{null, null_mut};

/// A device that a C program would make, and a context's description of it.
struct Engine {
    info: HedgerowContextCreateInfo,
    device: ash::Device,
    queue_family: u32,
    instance: ash::Instance,
    _entry: ash::Entry,
}

impl Engine {
    fn new(instance_extensions: &[&CStr]) -> Engine {
        let names: Vec<_> = instance_extensions.iter().map(|name| name.as_ptr()).collect();
        let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_2);
        let info = vk::InstanceCreateInfo::default().application_info(&application).enabled_extension_names(&names);
        // SAFETY: each handle is used while what it came from lives; the requirements live until the device is made.
        unsafe {
            let entry = ash::Entry::load().expect("a Vulkan loader");
            let instance = entry.create_instance(&info, None).expect("an instance");
            let pfn_get_instance_proc_addr = Some(entry.static_fn().get_instance_proc_addr);
            let mut needs = null_mut();
            let usable = |&physical: &vk::PhysicalDevice| {
                hedgerow_create_requirements(pfn_get_instance_proc_addr, instance.handle(), physical, &mut needs)
                    == vk::Result::SUCCESS
            };
            let physical_devices = instance.enumerate_physical_devices().expect("physical devices");
            let physical_device =
                physical_devices.into_iter().find(usable).expect("a device that has what hedgerow needs");
            let queue = [vk::DeviceQueueCreateInfo::default()
                .queue_family_index((*needs).queue_family_index)
                .queue_priorities(&[1.0])];
            let mut device_info = vk::DeviceCreateInfo::default().queue_create_infos(&queue);
            device_info.p_next = (*needs).features;
            device_info.enabled_extension_count = (*needs).enabled_extension_count;
            device_info.pp_enabled_extension_names = (*needs).enabled_extension_names;
            let device = instance.create_device(physical_device, &device_info, None).expect("a device");
            let optional = (*needs).optional;
            let queue_family = (*needs).queue_family_index;
            hedgerow_destroy_requirements(needs);
            let info = HedgerowContextCreateInfo {
                pfn_get_instance_proc_addr,
                instance: instance.handle(),
                physical_device,
                device: device.handle(),
                pipeline_cache: vk::PipelineCache::null(),
                debug_labels: vk::FALSE,
                checked: vk::TRUE,
                optional,
                rebraid_budget: 0.0,
                wide: HEDGEROW_WIDE_BY_FLAGS,
                p_bottom_codes: null(),
                p_top_codes: null(),
            };
            Engine { info, device, queue_family, instance, _entry: entry }
        }
    }
}

impl Drop for Engine {
    fn drop(&mut self) {
        // SAFETY: its contexts are destroyed.
        unsafe {
            self.device.destroy_device(None);
            self.instance.destroy_instance(None);
        }
    }
}

fn last_error() -> String {
    // SAFETY: the text stays until the next error.
    unsafe { CStr::from_ptr(hedgerow_last_error_message()) }.to_str().expect("UTF-8").into()
}

#[test]
fn labels_want_their_extension() {
    for (extensions, expected) in
        [(&[][..], vk::Result::ERROR_VALIDATION_FAILED_EXT), (&[ext::debug_utils::NAME][..], vk::Result::SUCCESS)]
    {
        let mut engine = Engine::new(extensions);
        engine.info.debug_labels = vk::TRUE;
        let mut context = null_mut();
        // SAFETY: the device has what the library requires and lives.
        let result = unsafe { hedgerow_create_context(&engine.info, &mut context) };
        assert_eq!(result, expected, "with {extensions:?}: {}", last_error());
        // SAFETY: nothing was recorded.
        unsafe { hedgerow_destroy_context(context) };
    }
    assert_eq!(
        last_error(),
        "debugLabels is VK_TRUE and the instance has no VK_EXT_debug_utils; enable it, or set VK_FALSE"
    );
}

/// Bytes of a structure over `count` instances or triangles by a context with these options.
fn structure_bytes(info: &HedgerowContextCreateInfo, ty: vk::AccelerationStructureTypeKHR, count: u32) -> u64 {
    let geometry = match ty {
        vk::AccelerationStructureTypeKHR::TOP_LEVEL => vk::AccelerationStructureGeometryKHR::default()
            .geometry_type(vk::GeometryTypeKHR::INSTANCES)
            .geometry(vk::AccelerationStructureGeometryDataKHR { instances: Default::default() }),
        _ => {
            let triangles = vk::AccelerationStructureGeometryTrianglesDataKHR::default()
                .vertex_format(vk::Format::R32G32B32_SFLOAT)
                .vertex_stride(12)
                .max_vertex(3 * count)
                .index_type(vk::IndexType::NONE_KHR);
            vk::AccelerationStructureGeometryKHR::default()
                .geometry_type(vk::GeometryTypeKHR::TRIANGLES)
                .geometry(vk::AccelerationStructureGeometryDataKHR { triangles })
        }
    };
    let build = vk::AccelerationStructureBuildGeometryInfoKHR::default()
        .ty(ty)
        .flags(vk::BuildAccelerationStructureFlagsKHR::PREFER_FAST_TRACE)
        .geometries(std::slice::from_ref(&geometry));
    let mut context = null_mut();
    let mut sizes = vk::AccelerationStructureBuildSizesInfoKHR::default();
    let place = vk::AccelerationStructureBuildTypeKHR::DEVICE;
    // SAFETY: the device has what the library requires and lives; the pointers are those of live values.
    unsafe {
        assert_eq!(hedgerow_create_context(info, &mut context), vk::Result::SUCCESS, "{}", last_error());
        let result = hedgerow_get_acceleration_structure_build_sizes(context, place, &build, &count, &mut sizes);
        assert_eq!(result, vk::Result::SUCCESS, "{}", last_error());
        hedgerow_destroy_context(context);
    }
    sizes.acceleration_structure_size
}

#[test]
fn options_are_those_of_the_library() {
    let engine = Engine::new(&[]);
    let (top, bottom) = (vk::AccelerationStructureTypeKHR::TOP_LEVEL, vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL);
    let with = |rebraid_budget, wide| HedgerowContextCreateInfo { rebraid_budget, wide, ..engine.info };
    // Nodes of two take 64 bytes, records of instances 128, the boxes of what is far to six sides 24 each.
    for (budget, entries) in [(0.0, 4000), (1.0, 1000), (2.5, 2500)] {
        let bytes = structure_bytes(&with(budget, HEDGEROW_WIDE_NEVER), top, 1000);
        assert_eq!(bytes, 128 + 64 * (entries - 1) + 128 * entries + 6 * 24, "budget {budget}");
    }
    // Nodes of eight 80, two for each three leaves at most; records of triangles 40.
    let (of_two, of_eight) = (128 + 64 * 7001 + 40 * 7002, 128 + 80 * 4668 + 40 * 7002);
    assert_eq!(structure_bytes(&with(0.0, HEDGEROW_WIDE_NEVER), bottom, 7002), of_two);
    for wide in [HEDGEROW_WIDE_BY_FLAGS, HEDGEROW_WIDE_ALWAYS] {
        assert_eq!(structure_bytes(&with(0.0, wide), bottom, 7002), of_eight, "{wide}");
    }

    let mut context = null_mut();
    let names = [c"bin4a4~64+concise", c"robust"].map(CStr::as_ptr);
    let mut info = HedgerowContextCreateInfo { p_bottom_codes: names[0], ..engine.info };
    // SAFETY: as above; names live.
    unsafe {
        assert_eq!(hedgerow_create_context(&info, &mut context), vk::Result::SUCCESS, "{}", last_error());
        hedgerow_destroy_context(context);
        info.p_top_codes = names[1];
        assert_eq!(hedgerow_create_context(&info, &mut context), vk::Result::ERROR_VALIDATION_FAILED_EXT);
    }
    assert!(last_error().starts_with("pTopCodes: "), "{}", last_error());
}

#[test]
fn refusals_name_the_field() {
    let engine = Engine::new(&[]);
    let mut context = null_mut();
    // SAFETY: the device has what the library requires and lives; what is refused is not looked at.
    unsafe {
        assert_eq!(hedgerow_create_context(&engine.info, &mut context), vk::Result::SUCCESS, "{}", last_error());
        let place = vk::AccelerationStructureBuildTypeKHR::DEVICE;
        let build = vk::AccelerationStructureBuildGeometryInfoKHR::default();
        let mut sizes = vk::AccelerationStructureBuildSizesInfoKHR::default();
        let result = hedgerow_get_acceleration_structure_build_sizes(context, place, &build, null(), &mut sizes);
        assert_eq!(result, vk::Result::ERROR_VALIDATION_FAILED_EXT);
        assert!(last_error().starts_with("geometryCount is 0; "), "{}", last_error());

        let commands = vk::Handle::from_raw(1);
        let mut trace = HedgerowTraceInfo { structure: 16, rays: 32, hits: 40, work: 0, ray_count: 1, query: 2 };
        let result = hedgerow_cmd_trace_rays(context, commands, &trace);
        assert_eq!(result, vk::Result::ERROR_VALIDATION_FAILED_EXT);
        assert_eq!(last_error(), "query is 2; it must be one of HEDGEROW_QUERY_*");
        trace.query = HEDGEROW_QUERY_ANY_HIT;
        assert_eq!(hedgerow_cmd_trace_rays(context, commands, &trace), vk::Result::ERROR_VALIDATION_FAILED_EXT);
        assert_eq!(last_error(), "hits is 0x28; it must be a multiple of 16 and not zero");
        hedgerow_destroy_context(context);

        let more = HedgerowContextCreateInfo { optional: 0x80, ..engine.info };
        assert_eq!(hedgerow_create_context(&more, &mut context), vk::Result::ERROR_VALIDATION_FAILED_EXT);
        assert_eq!(last_error(), "optional is 0x80; it must be of the bits HEDGEROW_OPTIONAL_*");

        let wider = HedgerowContextCreateInfo { wide: 3, ..engine.info };
        assert_eq!(hedgerow_create_context(&wider, &mut context), vk::Result::ERROR_VALIDATION_FAILED_EXT);
        assert_eq!(last_error(), "wide is 3; it must be one of HEDGEROW_WIDE_*");
    }
}

/// A buffer with an address, that commands may write.
fn buffer(engine: &Engine, bytes: u64) -> (vk::Buffer, vk::DeviceMemory) {
    let Engine { info, device, instance, .. } = engine;
    let usage = vk::BufferUsageFlags::TRANSFER_DST
        | vk::BufferUsageFlags::STORAGE_BUFFER
        | vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS;
    // SAFETY: the device lives; the buffer is bound before it is used.
    unsafe {
        let buffer =
            device.create_buffer(&vk::BufferCreateInfo::default().size(bytes).usage(usage), None).expect("a buffer");
        let needs = device.get_buffer_memory_requirements(buffer);
        let has_address = vk::MemoryAllocateFlags::DEVICE_ADDRESS;
        let mut flags = vk::MemoryAllocateFlagsInfo::default().flags(has_address);
        let all = instance.get_physical_device_memory_properties(info.physical_device).memory_type_count;
        let ty = (0..all).find(|ty| needs.memory_type_bits & 1 << ty != 0).expect("a type of memory");
        let allocate =
            vk::MemoryAllocateInfo::default().allocation_size(needs.size).memory_type_index(ty).push_next(&mut flags);
        let memory = device.allocate_memory(&allocate, None).expect("memory");
        device.bind_buffer_memory(buffer, memory, 0).expect("bound");
        (buffer, memory)
    }
}

#[test]
fn arguments_lie_in_the_part_of_the_buffer_that_is_named() {
    let engine = Engine::new(&[]);
    let device = &engine.device;
    let mut context = null_mut();
    // SAFETY: the device has what the library requires and lives; nothing recorded is submitted, so its addresses need no memory.
    unsafe {
        // Not checked: the structure and the scratch memory are addresses alone.
        let unchecked = HedgerowContextCreateInfo { checked: vk::FALSE, ..engine.info };
        assert_eq!(hedgerow_create_context(&unchecked, &mut context), vk::Result::SUCCESS, "{}", last_error());
        let (table, memory) = buffer(&engine, 4096);
        let pool_info = vk::CommandPoolCreateInfo::default().queue_family_index(engine.queue_family);
        let pool = device.create_command_pool(&pool_info, None).expect("a command pool");
        let commands = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
        let commands = device.allocate_command_buffers(&commands).expect("a command buffer")[0];
        device.begin_command_buffer(commands, &vk::CommandBufferBeginInfo::default()).expect("begun");

        let address = |device_address| vk::DeviceOrHostAddressConstKHR { device_address };
        let triangles = vk::AccelerationStructureGeometryTrianglesDataKHR::default()
            .vertex_format(vk::Format::R32G32B32_SFLOAT)
            .vertex_data(address(0x10000))
            .vertex_stride(12)
            .max_vertex(2)
            .index_type(vk::IndexType::NONE_KHR);
        let geometry = [vk::AccelerationStructureGeometryKHR::default()
            .geometry_type(vk::GeometryTypeKHR::TRIANGLES)
            .geometry(vk::AccelerationStructureGeometryDataKHR { triangles })];
        // Four of a kind are one dispatch, whose arguments are in memory; of two they would be push constants.
        let builds = [0x20000, 0x40000, 0x60000, 0x80000].map(|at| {
            vk::AccelerationStructureBuildGeometryInfoKHR::default()
                .ty(vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL)
                .mode(vk::BuildAccelerationStructureModeKHR::BUILD)
                .dst_acceleration_structure(vk::Handle::from_raw(at))
                .scratch_data(vk::DeviceOrHostAddressKHR { device_address: at + 0x10000 })
                .geometries(&geometry)
        });
        let range = vk::AccelerationStructureBuildRangeInfoKHR::default().primitive_count(1);
        let ranges = [&raw const range; 4];
        let record = |offset, size| {
            let memory = HedgerowArgumentMemory { buffer: table, offset, size };
            let (builds, ranges) = (builds.as_ptr(), ranges.as_ptr());
            hedgerow_cmd_build_acceleration_structures_by_table(context, commands, 4, builds, ranges, &memory)
        };
        let needs = hedgerow_get_argument_size(4, 4);
        assert_eq!(record(16, needs), vk::Result::SUCCESS, "{}", last_error());
        assert_eq!(record(4, needs), vk::Result::ERROR_VALIDATION_FAILED_EXT);
        assert!(last_error().ends_with("its address is a multiple of 16"), "{}", last_error());
        assert_eq!(record(16, 8), vk::Result::ERROR_VALIDATION_FAILED_EXT);
        assert!(last_error().starts_with("memory for arguments of 8 bytes, at least"), "{}", last_error());

        device.destroy_command_pool(pool, None);
        device.destroy_buffer(table, None);
        device.free_memory(memory, None);
        hedgerow_destroy_context(context);
    }
}
