//! Null where something must be is an error that names the parameter; null that Vulkan allows is none.

use hedgerow::ash::vk::{self, Handle};
use hedgerow_capi::*;
use std::ffi::{CStr, c_char};
use std::ptr::{null, null_mut};

/// Finds no function.
unsafe extern "system" fn nothing(_: vk::Instance, _: *const c_char) -> vk::PFN_vkVoidFunction {
    None
}

#[track_caller]
fn assert_refused(result: vk::Result, message: &str) {
    // SAFETY: the text stays until the next error.
    let text = unsafe { CStr::from_ptr(hedgerow_last_error_message()) }.to_str().expect("UTF-8");
    assert_eq!((result, text), (vk::Result::ERROR_VALIDATION_FAILED_EXT, message));
}

#[test]
fn requirements_name_what_is_null() {
    let instance = vk::Instance::from_raw(1);
    let physical = vk::PhysicalDevice::null();
    let mut needs = null_mut();
    // SAFETY: null is refused before anything is called; `nothing` takes every instance.
    unsafe {
        assert_refused(hedgerow_create_requirements(None, instance, physical, null_mut()), "ppRequirements is null");
        assert_refused(
            hedgerow_create_requirements(None, instance, physical, &mut needs),
            "pfnGetInstanceProcAddr is null",
        );
        assert_refused(
            hedgerow_create_requirements(Some(nothing), vk::Instance::null(), physical, &mut needs),
            "instance is null",
        );
        assert_refused(
            hedgerow_create_requirements(Some(nothing), instance, physical, &mut needs),
            "the instance has no vkGetPhysicalDeviceProperties2; give VkApplicationInfo::apiVersion at least \
             VK_API_VERSION_1_2",
        );
        hedgerow_destroy_requirements(null_mut());
    }
    assert!(needs.is_null(), "an error writes nothing");
}

#[test]
fn contexts_name_what_is_null() {
    let mut context = null_mut();
    let info = HedgerowContextCreateInfo {
        pfn_get_instance_proc_addr: None,
        instance: vk::Instance::null(),
        physical_device: vk::PhysicalDevice::null(),
        device: vk::Device::null(),
        pipeline_cache: vk::PipelineCache::null(),
        debug_labels: vk::FALSE,
        checked: vk::TRUE,
        optional: 0,
        rebraid_budget: 0.0,
        wide: HEDGEROW_WIDE_BY_FLAGS,
        p_bottom_codes: null(),
        p_top_codes: null(),
    };
    // SAFETY: null is refused before anything is called.
    unsafe {
        assert_refused(hedgerow_create_context(null(), &mut context), "pCreateInfo is null");
        assert_refused(hedgerow_create_context(&info, null_mut()), "pContext is null");
        assert_refused(hedgerow_create_context(&info, &mut context), "pfnGetInstanceProcAddr is null");
        hedgerow_destroy_context(null_mut());
    }
    assert!(context.is_null(), "an error writes nothing");
}

#[test]
fn structures_name_what_is_null() {
    let (commands, device) = (vk::CommandBuffer::from_raw(1), vk::AccelerationStructureBuildTypeKHR::DEVICE);
    let info = vk::AccelerationStructureBuildGeometryInfoKHR { geometry_count: 2, ..Default::default() };
    let mut sizes = vk::AccelerationStructureBuildSizesInfoKHR::default();
    let mut made = vk::AccelerationStructureKHR::null();
    let (counts, ranges) = ([1, 1], [null()]);
    // SAFETY: null is refused before anything is called.
    unsafe {
        assert_refused(
            hedgerow_get_acceleration_structure_build_sizes(null(), device, null(), null(), &mut sizes),
            "pBuildInfo is null",
        );
        assert_refused(
            hedgerow_get_acceleration_structure_build_sizes(null(), device, &info, null(), &mut sizes),
            "pMaxPrimitiveCounts is null; 2 elements were announced",
        );
        assert_refused(
            hedgerow_get_acceleration_structure_build_sizes(null(), device, &info, counts.as_ptr(), null_mut()),
            "pSizeInfo is null",
        );
        assert_refused(
            hedgerow_get_acceleration_structure_build_sizes(null(), device, &info, counts.as_ptr(), &mut sizes),
            "context is null",
        );
        let create = vk::AccelerationStructureCreateInfoKHR::default();
        assert_refused(
            hedgerow_create_acceleration_structure(null(), &create, null(), &mut made),
            "pCreateInfo->buffer is null",
        );
        assert_eq!(hedgerow_get_acceleration_structure_device_address(null(), null()), 0);
        let build = hedgerow_cmd_build_acceleration_structures;
        assert_refused(build(null(), commands, 1, null(), null()), "pInfos is null; 1 elements were announced");
        assert_refused(
            build(null(), commands, 1, &info, ranges.as_ptr()),
            "ppBuildRangeInfos[0] is null; 2 elements were announced",
        );
        assert_refused(build(null(), vk::CommandBuffer::null(), 0, null(), null()), "commandBuffer is null");
        let by_table = hedgerow_cmd_build_acceleration_structures_by_table;
        assert_refused(by_table(null(), commands, 0, null(), null(), null()), "pArgumentMemory is null");
        let nowhere = HedgerowArgumentMemory { buffer: vk::Buffer::null(), offset: 0, size: 1 << 10 };
        assert_refused(by_table(null(), commands, 0, null(), null(), &nowhere), "pArgumentMemory->buffer is null");
        assert_refused(build(null(), commands, 0, null(), null()), "context is null");
    }
}

#[test]
fn tracing_names_what_is_null() {
    // SAFETY: null is refused before anything is called.
    unsafe {
        assert_refused(hedgerow_cmd_trace_rays(null(), vk::CommandBuffer::null(), null()), "context is null");
    }
}

#[test]
fn copies_and_properties_name_what_is_null() {
    let commands = vk::CommandBuffer::from_raw(1);
    let copy = vk::CopyAccelerationStructureInfoKHR::default();
    // SAFETY: null is refused before anything is called.
    unsafe {
        assert_refused(hedgerow_cmd_copy_acceleration_structure(null(), commands, null()), "pInfo is null");
        assert_refused(hedgerow_cmd_copy_acceleration_structure(null(), commands, &copy), "context is null");
        assert_refused(hedgerow_cmd_copy_acceleration_structure_to_memory(null(), commands, null()), "pInfo is null");
        assert_refused(hedgerow_cmd_copy_memory_to_acceleration_structure(null(), commands, null()), "pInfo is null");
        let compatibility = hedgerow_get_device_acceleration_structure_compatibility(null(), null());
        assert_eq!(compatibility, vk::AccelerationStructureCompatibilityKHR::INCOMPATIBLE);
        let properties = |count, all, property| {
            hedgerow_cmd_write_acceleration_structures_properties(null(), commands, count, all, property, 8)
        };
        assert_refused(
            properties(1, null(), HEDGEROW_PROPERTY_SIZE),
            "pAccelerationStructures is null; 1 elements were announced",
        );
        assert_refused(properties(0, null(), 99), "property is 99; take one of HEDGEROW_PROPERTY_…");
    }
}
