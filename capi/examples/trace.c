/*
 * A small program in C that links hedgerow: it makes a device by what the library requires, builds a structure of three
 * triangles in its own memory and command buffer, traces rays through it, and compares the hits with known ones. What it
 * writes for hedgerow stands in engine.h.
 *
 *   make install-c PREFIX=DIR
 *   cc -std=c99 -IDIR/include capi/examples/trace.c -LDIR/lib -lhedgerow_capi -lvulkan -Wl,-rpath,DIR/lib -o trace
 *
 * It prints the hits, and returns 1 if one of them is another than it should be.
 */
#include "engine.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A square at z = 0, and above a part of it a triangle at z = 2. */
static const float positions[][3] = {
    {0, 0, 0}, {4, 0, 0}, {4, 4, 0}, {0, 4, 0}, {1, 0.5f, 2}, {3, 0.5f, 2}, {3, 2.5f, 2},
};
static const uint32_t triangles[][3] = {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}};
enum { POSITIONS = 7, TRIANGLES = 3, RAYS = 4 };

/* Straight down from z = 5, and what that meets. */
static const HedgerowRay rays[RAYS] = {
    {{2.5f, 1, 5}, 0, {0, 0, -1}, 100},
    {{3.5f, 1, 5}, 0, {0, 0, -1}, 100},
    {{1, 3, 5}, 0, {0, 0, -1}, 100},
    {{5, 1, 5}, 0, {0, 0, -1}, 100},
};
static const HedgerowHit expected[RAYS] = {
    {3, 2, 0.5f, 0.25f},
    {5, 0, 0.625f, 0.25f},
    {5, 1, 0.25f, 0.5f},
    {INFINITY, HEDGEROW_NO_HIT, 0, 0},
};

/* Ends the program where a call of Vulkan's or of the library's fails. */
#define CHECK(call) check((call), #call)

static void check(VkResult result, const char *call) {
    if (result != VK_SUCCESS) {
        const char *why = strncmp(call, "vk", 2) == 0 ? "" : hedgerow_last_error_message();
        fprintf(stderr, "%s returned %d %s\n", call, (int)result, why);
        exit(2);
    }
}

/* What every engine has anyway. */
typedef struct Engine {
    VkInstance instance;
    VkPhysicalDevice physical_device;
    VkDevice device;
    uint32_t queue_family;
    VkQueue queue;
    HedgerowContext *context;
} Engine;

/* Memory that the host maps and shaders reach by its address. */
typedef struct Buffer {
    VkBuffer buffer;
    VkDeviceMemory memory;
    VkDeviceAddress address;
    void *mapped;
} Buffer;

static Engine create_engine(void) {
    Engine engine, *e = &engine;
    VkApplicationInfo application = {.sType = VK_STRUCTURE_TYPE_APPLICATION_INFO, .apiVersion = VK_API_VERSION_1_2};
    VkInstanceCreateInfo instance_info = {
        .sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO,
        .pApplicationInfo = &application,
    };
    CHECK(vkCreateInstance(&instance_info, NULL, &engine.instance));

    /* The first device that the library can be used on. */
    VkPhysicalDevice devices[16];
    uint32_t count = 16;
    VkResult listed = vkEnumeratePhysicalDevices(engine.instance, &count, devices);
    if (listed != VK_INCOMPLETE) CHECK(listed);
    for (uint32_t i = 0; i < count; i++) {
        e->physical_device = devices[i];
        if (open_device(e->instance, devices[i], &e->device, &e->queue_family, &e->context) == VK_SUCCESS) {
            vkGetDeviceQueue(e->device, e->queue_family, 0, &e->queue);
            return engine;
        }
        fprintf(stderr, "%s\n", hedgerow_last_error_message());
    }
    fprintf(stderr, "no device can be used\n");
    exit(2);
}

static uint32_t host_memory_type(const Engine *engine, uint32_t allowed) {
    const VkMemoryPropertyFlags wanted = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
    VkPhysicalDeviceMemoryProperties memory;
    vkGetPhysicalDeviceMemoryProperties(engine->physical_device, &memory);
    for (uint32_t i = 0; i < memory.memoryTypeCount; i++)
        if ((allowed >> i & 1) && (memory.memoryTypes[i].propertyFlags & wanted) == wanted) return i;
    fprintf(stderr, "the device has no memory that the host can map\n");
    exit(2);
}

/* A buffer with the usages that the library asks for, holding `bytes` of `content` if there is any. */
static Buffer create_buffer(const Engine *engine, VkDeviceSize bytes, const void *content) {
    Buffer made;
    VkBufferCreateInfo buffer_info = {
        .sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO,
        .size = bytes,
        .usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT,
    };
    CHECK(vkCreateBuffer(engine->device, &buffer_info, NULL, &made.buffer));
    VkMemoryRequirements needs;
    vkGetBufferMemoryRequirements(engine->device, made.buffer, &needs);
    VkMemoryAllocateFlagsInfo flags = {
        .sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO,
        .flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT,
    };
    VkMemoryAllocateInfo memory_info = {
        .sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO,
        .pNext = &flags,
        .allocationSize = needs.size,
        .memoryTypeIndex = host_memory_type(engine, needs.memoryTypeBits),
    };
    CHECK(vkAllocateMemory(engine->device, &memory_info, NULL, &made.memory));
    CHECK(vkBindBufferMemory(engine->device, made.buffer, made.memory, 0));
    CHECK(vkMapMemory(engine->device, made.memory, 0, VK_WHOLE_SIZE, 0, &made.mapped));
    VkBufferDeviceAddressInfo address_info = {
        .sType = VK_STRUCTURE_TYPE_BUFFER_DEVICE_ADDRESS_INFO,
        .buffer = made.buffer,
    };
    made.address = vkGetBufferDeviceAddress(engine->device, &address_info);
    if (content) memcpy(made.mapped, content, bytes);
    return made;
}

static void destroy_buffer(const Engine *engine, Buffer buffer) {
    vkDestroyBuffer(engine->device, buffer.buffer, NULL);
    vkFreeMemory(engine->device, buffer.memory, NULL);
}

/* Makes what shaders wrote visible to the host. */
static void barrier_to_host(VkCommandBuffer commands) {
    VkMemoryBarrier memory = {
        .sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER,
        .srcAccessMask = VK_ACCESS_SHADER_WRITE_BIT,
        .dstAccessMask = VK_ACCESS_HOST_READ_BIT,
    };
    const VkPipelineStageFlags shader = VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, host = VK_PIPELINE_STAGE_HOST_BIT;
    vkCmdPipelineBarrier(commands, shader, host, 0, 1, &memory, 0, NULL, 0, NULL);
}

/* Builds a structure and traces the rays through it, all in one command buffer. */
static void trace(const Engine *engine, HedgerowHit *hits) {
    HedgerowContext *context = engine->context;
    Buffer position_buffer = create_buffer(engine, sizeof positions, positions);
    Buffer triangle_buffer = create_buffer(engine, sizeof triangles, triangles);
    Buffer ray_buffer = create_buffer(engine, sizeof rays, rays);
    Buffer hit_buffer = create_buffer(engine, RAYS * sizeof *hits, NULL);

    /* 1. How much memory does the build need? The engine brings it. The structs are Vulkan's own. */
    VkAccelerationStructureGeometryKHR geometry = {
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR,
        .geometryType = VK_GEOMETRY_TYPE_TRIANGLES_KHR,
        .geometry.triangles = {
            .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_TRIANGLES_DATA_KHR,
            .vertexFormat = VK_FORMAT_R32G32B32_SFLOAT,
            .vertexData.deviceAddress = position_buffer.address,
            .vertexStride = sizeof *positions,
            .maxVertex = POSITIONS - 1,
            .indexType = VK_INDEX_TYPE_UINT32,
            .indexData.deviceAddress = triangle_buffer.address,
        },
        .flags = VK_GEOMETRY_OPAQUE_BIT_KHR,
    };
    VkAccelerationStructureBuildGeometryInfoKHR build = {
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_GEOMETRY_INFO_KHR,
        .type = VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR,
        .flags = VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR,
        .mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR,
        .geometryCount = 1,
        .pGeometries = &geometry,
    };
    const uint32_t count = TRIANGLES;
    VkAccelerationStructureBuildSizesInfoKHR sizes = {
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_SIZES_INFO_KHR,
    };
    CHECK(hedgerow_get_acceleration_structure_build_sizes(context, VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR,
                                                          &build, &count, &sizes));
    Buffer structure_buffer = create_buffer(engine, sizes.accelerationStructureSize, NULL);
    Buffer scratch_buffer = create_buffer(engine, sizes.buildScratchSize, NULL);
    VkAccelerationStructureCreateInfoKHR create_info = {
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_KHR,
        .buffer = structure_buffer.buffer,
        .size = sizes.accelerationStructureSize,
        .type = build.type,
    };
    CHECK(hedgerow_create_acceleration_structure(context, &create_info, NULL, &build.dstAccelerationStructure));
    build.scratchData.deviceAddress = scratch_buffer.address;
    VkAccelerationStructureDeviceAddressInfoKHR address_info = {
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_DEVICE_ADDRESS_INFO_KHR,
        .accelerationStructure = build.dstAccelerationStructure,
    };
    HedgerowTraceInfo trace_info = {
        .structure = hedgerow_get_acceleration_structure_device_address(context, &address_info),
        .rays = ray_buffer.address,
        .hits = hit_buffer.address,
        .rayCount = RAYS,
        .query = HEDGEROW_QUERY_CLOSEST_HIT,
    };

    VkCommandPoolCreateInfo pool_info = {
        .sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO,
        .queueFamilyIndex = engine->queue_family,
    };
    VkCommandPool pool;
    CHECK(vkCreateCommandPool(engine->device, &pool_info, NULL, &pool));
    VkCommandBufferAllocateInfo allocate_info = {
        .sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO,
        .commandPool = pool,
        .level = VK_COMMAND_BUFFER_LEVEL_PRIMARY,
        .commandBufferCount = 1,
    };
    VkCommandBuffer commands;
    CHECK(vkAllocateCommandBuffers(engine->device, &allocate_info, &commands));

    /* 2. The library records into the engine's command buffer; the engine synchronises, submits and waits. */
    VkCommandBufferBeginInfo begin_info = {.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
    CHECK(vkBeginCommandBuffer(commands, &begin_info));
    CHECK(record_frame(context, commands, TRIANGLES, &build, &trace_info));
    barrier_to_host(commands);
    CHECK(vkEndCommandBuffer(commands));
    VkSubmitInfo submit_info = {
        .sType = VK_STRUCTURE_TYPE_SUBMIT_INFO,
        .commandBufferCount = 1,
        .pCommandBuffers = &commands,
    };
    CHECK(vkQueueSubmit(engine->queue, 1, &submit_info, VK_NULL_HANDLE));
    CHECK(vkQueueWaitIdle(engine->queue));
    memcpy(hits, hit_buffer.mapped, RAYS * sizeof *hits);

    hedgerow_destroy_acceleration_structure(context, build.dstAccelerationStructure, NULL);
    vkDestroyCommandPool(engine->device, pool, NULL);
    Buffer buffers[] = {position_buffer, triangle_buffer, ray_buffer, hit_buffer, structure_buffer, scratch_buffer};
    for (size_t i = 0; i < sizeof buffers / sizeof *buffers; i++) destroy_buffer(engine, buffers[i]);
}

static bool same(HedgerowHit a, HedgerowHit b) {
    return a.primitive == b.primitive && (a.t == b.t || fabsf(a.t - b.t) < 1e-5f) && fabsf(a.u - b.u) < 1e-5f &&
           fabsf(a.v - b.v) < 1e-5f;
}

int main(void) {
    Engine engine = create_engine();
    HedgerowHit hits[RAYS];
    trace(&engine, hits);
    int different = 0;
    for (int i = 0; i < RAYS; i++) {
        const HedgerowHit hit = hits[i];
        if (hit.primitive == HEDGEROW_NO_HIT)
            printf("ray %d: nothing", i);
        else
            printf("ray %d: triangle %u at %.3f, u %.3f, v %.3f", i, (unsigned)hit.primitive, hit.t, hit.u, hit.v);
        bool right = same(hit, expected[i]);
        printf("%s\n", right ? "" : ", which is wrong");
        different += !right;
    }

    hedgerow_destroy_context(engine.context);
    vkDestroyDevice(engine.device, NULL);
    vkDestroyInstance(engine.instance, NULL);
    return different != 0;
}
