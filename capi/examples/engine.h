/* What an engine in C writes for hedgerow. docs/engines.md shows it, and trace.c runs it. */

#include "hedgerow.h"

/* Once: a device with what hedgerow needs, and its queue family. Destroy the context before the device. */
static VkResult open_device(VkInstance instance, VkPhysicalDevice physical, VkDevice *device, uint32_t *family,
                            HedgerowContext **context) {
    HedgerowRequirements *needs;
    VkResult result = hedgerow_create_requirements(vkGetInstanceProcAddr, instance, physical, &needs);
    if (result != VK_SUCCESS) return result; /* hedgerow_last_error_message() names all that the device lacks. */
    const float priority = 1;
    VkDeviceQueueCreateInfo queue = {.sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO, .queueCount = 1};
    queue.queueFamilyIndex = *family = needs->queueFamilyIndex;
    queue.pQueuePriorities = &priority;
    VkDeviceCreateInfo info = {.sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO, .pNext = needs->features};
    info.queueCreateInfoCount = 1;
    info.pQueueCreateInfos = &queue;
    info.enabledExtensionCount = needs->enabledExtensionCount;
    info.ppEnabledExtensionNames = needs->enabledExtensionNames;
    result = vkCreateDevice(physical, &info, NULL, device);
    HedgerowContextCreateInfo wrap = {.pfnGetInstanceProcAddr = vkGetInstanceProcAddr, .instance = instance};
    wrap.physicalDevice = physical;
    wrap.device = result == VK_SUCCESS ? *device : VK_NULL_HANDLE;
    wrap.optional = needs->optional;
    hedgerow_destroy_requirements(needs);
    return result == VK_SUCCESS ? hedgerow_create_context(&wrap, context) : result;
}

/* Each frame: a build behind the engine's uploads, and rays. What reads the hits places the barrier behind them. */
static VkResult record_frame(HedgerowContext *context, VkCommandBuffer commands, uint32_t triangles,
                             const VkAccelerationStructureBuildGeometryInfoKHR *mesh, const HedgerowTraceInfo *rays) {
    const VkAccelerationStructureBuildRangeInfoKHR range = {.primitiveCount = triangles}, *ranges = &range;
    const VkPipelineStageFlags copy = VK_PIPELINE_STAGE_TRANSFER_BIT, compute = VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT;
    VkMemoryBarrier written = {.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER, .dstAccessMask = VK_ACCESS_SHADER_READ_BIT};
    written.srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
    vkCmdPipelineBarrier(commands, copy, compute, 0, 1, &written, 0, NULL, 0, NULL);
    VkResult result = hedgerow_cmd_build_acceleration_structures(context, commands, 1, mesh, &ranges);
    written.srcAccessMask = VK_ACCESS_SHADER_WRITE_BIT;
    vkCmdPipelineBarrier(commands, compute, compute, 0, 1, &written, 0, NULL, 0, NULL);
    return result == VK_SUCCESS ? hedgerow_cmd_trace_rays(context, commands, rays) : result;
}
