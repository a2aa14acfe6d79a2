//! docs/engines.md: its code is that of files that are compiled and run, and each is as short as the page says. The engine on ash
//! runs here, that in C in capi/tests, that on wgpu by `make test-wgpu`.

#[path = "../examples/ash/engine.rs"]
mod on_ash;

use ash::vk;
use hedgerow::accel::{self, Placement, Request};
use hedgerow::ash;
use hedgerow::bvh::geometry::Geometry;
use hedgerow::gpu::{Recorder, Region};
use hedgerow::trace::{Hit, Query, Ray, tracer};
use std::fs;
use std::path::Path;

/// What the page says of each engine.
const MOST_LINES: usize = 40;
const ENGINES: [(&str, &str); 3] = [
    ("examples/wgpu/src/engine.rs", "rust,ignore"),
    ("examples/ash/engine.rs", "rust,ignore"),
    ("capi/examples/engine.h", "c"),
];

fn text(path: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

#[test]
fn the_page_shows_the_engines_that_run() {
    let page = text("docs/engines.md");
    for (path, language) in ENGINES {
        // The first lines say what the file is.
        let file = text(path);
        let (_, code) = file.split_once("\n\n").expect("an empty line behind the head");
        let count = code.lines().count();
        assert!(count <= MOST_LINES, "{path} has {count} lines; the page says at most {MOST_LINES}");
        let block = format!("```{language}\n{code}```\n");
        assert!(page.contains(&block), "docs/engines.md shows another {path}; copy what stands there:\n{block}");
        assert!(page.contains(path), "docs/engines.md does not name {path}");
    }
}

/// A square at z = 0, and above a part of it a triangle at z = 2.
const POSITIONS: [[f32; 3]; 7] = [
    [0.0, 0.0, 0.0],
    [4.0, 0.0, 0.0],
    [4.0, 4.0, 0.0],
    [0.0, 4.0, 0.0],
    [1.0, 0.5, 2.0],
    [3.0, 0.5, 2.0],
    [3.0, 2.5, 2.0],
];
const TRIANGLES: [[u32; 3]; 3] = [[0, 1, 2], [0, 2, 3], [4, 5, 6]];
/// Where rays begin that go straight down from z = 5.
const FROM: [[f32; 2]; 4] = [[2.5, 1.0], [3.5, 1.0], [1.0, 3.0], [5.0, 1.0]];
/// The triangle that each meets, and how far away it is.
const MET: [Option<(u32, f32)>; 4] = [Some((2, 3.0)), Some((0, 5.0)), Some((1, 5.0)), None];

/// Where in the engine's memory its things lie.
const PLACES: [u64; 6] = [0, 0x400, 0x800, 0xc00, 0x1000, 0x8000];
const MEMORY: u64 = 0x10_0000;

/// Memory of the host that shaders reach by its address.
///
/// # Safety
/// The handles live.
unsafe fn memory(
    instance: &ash::Instance,
    physical: vk::PhysicalDevice,
    device: &ash::Device,
) -> (vk::Buffer, vk::DeviceMemory, u64, *mut u8) {
    // SAFETY: the caller's promise; the buffer is bound before its address is asked for.
    unsafe {
        let usage = vk::BufferUsageFlags::STORAGE_BUFFER | vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS;
        let info = vk::BufferCreateInfo::default().size(MEMORY).usage(usage);
        let buffer = device.create_buffer(&info, None).expect("a buffer");
        let needs = device.get_buffer_memory_requirements(buffer);
        let wanted = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
        let types = instance.get_physical_device_memory_properties(physical);
        let fits = |i: u32| {
            needs.memory_type_bits >> i & 1 != 0 && types.memory_types[i as usize].property_flags.contains(wanted)
        };
        let index = (0..types.memory_type_count).find(|&i| fits(i)).expect("Vulkan guarantees such memory");
        let mut by_address = vk::MemoryAllocateFlagsInfo::default().flags(vk::MemoryAllocateFlags::DEVICE_ADDRESS);
        let info = vk::MemoryAllocateInfo::default().allocation_size(needs.size).memory_type_index(index);
        let memory = device.allocate_memory(&info.push_next(&mut by_address), None).expect("memory");
        device.bind_buffer_memory(buffer, memory, 0).expect("they fit");
        let address = device.get_buffer_device_address(&vk::BufferDeviceAddressInfo::default().buffer(buffer));
        let flags = vk::MemoryMapFlags::empty();
        let mapped = device.map_memory(memory, 0, vk::WHOLE_SIZE, flags).expect("memory of the host");
        (buffer, memory, address, mapped.cast())
    }
}

#[test]
fn the_engine_on_ash_traces_what_it_has_built() {
    // SAFETY: each handle is used while what it came from lives; the queue has finished before memory is read or freed.
    unsafe {
        let entry = ash::Entry::load().expect("a Vulkan loader");
        let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_2);
        let info = vk::InstanceCreateInfo::default().application_info(&application);
        let instance = entry.create_instance(&info, None).expect("an instance");
        let all = instance.enumerate_physical_devices().expect("devices");
        let opened = all.into_iter().find_map(|it| on_ash::open(&instance, it).ok().map(|opened| (it, opened)));
        let (physical, (device, family, context)) = opened.expect("a device that hedgerow can use");

        let (buffer, memory, address, mapped) = memory(&instance, physical, &device);
        let [positions, triangles, rays, hits, structure, scratch] = PLACES.map(|place| address + place);
        let put = |bytes: &[u8], place: u64| mapped.add(place as usize).copy_from(bytes.as_ptr(), bytes.len());
        let down =
            FROM.map(|[x, y]| Ray { origin: [x, y, 5.0], t_min: 0.0, direction: [0.0, 0.0, -1.0], t_max: 100.0 });
        put(bytemuck::cast_slice(&POSITIONS), PLACES[0]);
        put(bytemuck::cast_slice(&TRIANGLES), PLACES[1]);
        put(bytemuck::cast_slice(&down), PLACES[2]);

        let geometry = Geometry::mesh(positions, POSITIONS.len() as u32, triangles);
        let request = Request::triangles(&[(geometry, TRIANGLES.len() as u32)]);
        let sizes = request.sizes(&accel::Device::new(&context)).expect("sizes");
        assert!(structure + sizes.structure <= scratch && PLACES[5] + sizes.scratch <= MEMORY, "{sizes:?}");
        let region = |address, bytes| Region { address, bytes };
        let (at_structure, at_scratch) = (region(structure, sizes.structure), region(scratch, sizes.scratch));
        let mesh = Placement { request: &request, structure: at_structure, scratch: at_scratch };
        let buffers = tracer::TraceBuffers {
            structure,
            rays: Region::unbounded(rays),
            hits: Region::unbounded(hits),
            work: None,
            count: FROM.len() as u32,
        };

        let pool_info = vk::CommandPoolCreateInfo::default().queue_family_index(family);
        let pool = device.create_command_pool(&pool_info, None).expect("a command pool");
        let info = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
        let commands = device.allocate_command_buffers(&info).expect("a command buffer");
        device.begin_command_buffer(commands[0], &vk::CommandBufferBeginInfo::default()).expect("it begins");
        let traced = on_ash::frame(&context, commands[0], mesh, |commands| {
            let shape = tracer::TraceShape::of(&context);
            Ok(tracer::record(&mut Recorder::new(&context, commands), &shape, Query::ClosestHit, &buffers)?)
        });
        traced.expect("a frame");
        let to_host = [vk::MemoryBarrier::default()
            .src_access_mask(vk::AccessFlags::SHADER_WRITE)
            .dst_access_mask(vk::AccessFlags::HOST_READ)];
        let (from, to) = (vk::PipelineStageFlags::COMPUTE_SHADER, vk::PipelineStageFlags::HOST);
        device.cmd_pipeline_barrier(commands[0], from, to, vk::DependencyFlags::empty(), &to_host, &[], &[]);
        device.end_command_buffer(commands[0]).expect("it ends");
        let queue = device.get_device_queue(family, 0);
        let submit = vk::SubmitInfo::default().command_buffers(&commands);
        device.queue_submit(queue, &[submit], vk::Fence::null()).expect("a submit");
        device.queue_wait_idle(queue).expect("the queue finishes");

        let found = std::slice::from_raw_parts(mapped.add(PLACES[3] as usize).cast::<Hit>(), FROM.len());
        let met: Vec<_> = found.iter().map(|hit| hit.is_some().then_some((hit.primitive, hit.t))).collect();

        drop(context);
        device.destroy_command_pool(pool, None);
        device.destroy_buffer(buffer, None);
        device.free_memory(memory, None);
        device.destroy_device(None);
        instance.destroy_instance(None);
        assert_eq!(met, MET);
    }
}
