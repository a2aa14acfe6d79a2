//! On a device made by what the library requires: what a context takes, and refusals that name the field.

use hedgerow::ash::{self, ext, vk};
use hedgerow_capi::*;
use std::ffi::CStr;
use std::ptr::{null, null_mut};

/// A device that a C program would make, and a context's description of it.
struct Engine {
    info: HedgerowContextCreateInfo,
    device: ash::Device,
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
                wide: vk::FALSE,
                p_bottom_codes: null(),
                p_top_codes: null(),
            };
            Engine { info, device, instance, _entry: entry }
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
    // Nodes of two take 64 bytes, records of instances 128.
    for (budget, entries) in [(0.0, 4000), (1.0, 1000), (2.5, 2500)] {
        let bytes = structure_bytes(&with(budget, vk::FALSE), top, 1000);
        assert_eq!(bytes, 128 + 64 * (entries - 1) + 128 * entries, "budget {budget}");
    }
    // Nodes of eight 80, four for each seven leaves at most; records of triangles 40.
    assert_eq!(structure_bytes(&with(0.0, vk::FALSE), bottom, 7002), 128 + 64 * 7001 + 40 * 7002);
    assert_eq!(structure_bytes(&with(0.0, vk::TRUE), bottom, 7002), 128 + 80 * 4001 + 40 * 7002);

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
    }
}
