//! Many threads that record builds into command buffers of their own through one device.

use crate::common::backends::{Built, Ours, vk_geometry};
use crate::common::device;
use crate::common::geometries::Owned;
use crate::common::shapes::soup;
use hedgerow::accel;
use hedgerow::ash::vk;
use hedgerow::bvh::geometry::{IndexFormat, VertexFormat};
use hedgerow::gpu::{Context, ContextDesc, Optional, requirements};
use vk::BuildAccelerationStructureFlagsKHR as BuildFlags;

type BuildInfo<'a> = vk::AccelerationStructureBuildGeometryInfoKHR<'a>;
type Range = vk::AccelerationStructureBuildRangeInfoKHR;

const THREADS: usize = 8;
const BUILDS_EACH: usize = 6;

/// Every pipeline of the context is made while they record: they meet in its lock. Their command buffers are secondary, so that
/// one submit runs them all.
#[test]
fn builds_that_many_threads_record_are_those_of_one() {
    let (instance, physical, raw) = (device().ash_instance(), device().physical_device(), device().ash_device());
    let desc = ContextDesc {
        instance,
        physical_device: physical,
        device: raw,
        pipeline_cache: vk::PipelineCache::null(),
        debug_utils: None,
        optional: Optional::NONE,
        tuning: crate::common::tuning(),
    };
    let context = unsafe { Context::new(&desc) }.expect("a context");
    let builder = accel::Device::with_options(
        &context,
        accel::AccelOptions { wide: accel::Wide::Always, ..accel::AccelOptions::DEFAULT },
    );
    let ours = Ours::on(device());
    let flags =
        [BuildFlags::empty(), BuildFlags::PREFER_FAST_BUILD, BuildFlags::PREFER_FAST_TRACE, BuildFlags::LOW_MEMORY];
    let meshes: Vec<Owned> = (0..THREADS * BUILDS_EACH)
        .map(|i| {
            let format = [IndexFormat::NONE, IndexFormat::U32, IndexFormat::U16][i % 3];
            Owned::of(&soup(i * i * 2 % 4001, 0.2, i as u64), VertexFormat::FLOAT3, format, 0)
        })
        .collect();
    let uploaded: Vec<_> = meshes.iter().map(|mesh| mesh.upload(0, 0)).collect();
    let geometries: Vec<_> = uploaded.iter().zip(&meshes).map(|((g, _), mesh)| [vk_geometry(g, mesh)]).collect();
    let infos: Vec<BuildInfo<'_>> = (geometries.iter().enumerate())
        .map(|(i, geometry)| {
            let ty = vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL;
            BuildInfo::default().ty(ty).flags(flags[i % flags.len()]).geometries(geometry)
        })
        .collect();
    let ranges: Vec<[Range; 1]> =
        meshes.iter().map(|mesh| [Range::default().primitive_count(mesh.primitive_count)]).collect();
    let expected: Vec<Built> =
        infos.iter().zip(&ranges).map(|(info, range)| Built::new(&ours, info, range, 0)).collect();

    let placed: Vec<Built> = infos
        .iter()
        .zip(&ranges)
        .map(|(info, range)| Built::place(&ours, info, &[range[0].primitive_count], 0))
        .collect();
    let scratch: Vec<_> = (placed.iter().zip(&infos).zip(&ranges))
        .map(|((place, info), range)| place.scratch(&ours, info, &[range[0].primitive_count]))
        .collect();
    let infos: Vec<BuildInfo<'_>> = (infos.iter().zip(&placed).zip(&scratch))
        .map(|((info, place), scratch)| BuildInfo {
            dst_acceleration_structure: place.structure,
            scratch_data: vk::DeviceOrHostAddressKHR { device_address: scratch.1 },
            ..*info
        })
        .collect();
    let queue_family = requirements(instance, physical).expect("it was made").queue_family;
    let record = &|thread: usize| unsafe {
        let pool = vk::CommandPoolCreateInfo::default().queue_family_index(queue_family);
        let pool = raw.create_command_pool(&pool, None).expect("a pool");
        let info = vk::CommandBufferAllocateInfo::default()
            .command_pool(pool)
            .level(vk::CommandBufferLevel::SECONDARY)
            .command_buffer_count(1);
        let commands = raw.allocate_command_buffers(&info).expect("a command buffer")[0];
        let inheritance = vk::CommandBufferInheritanceInfo::default();
        let begin = vk::CommandBufferBeginInfo::default().inheritance_info(&inheritance);
        raw.begin_command_buffer(commands, &begin).expect("it begins");
        // One alone, then the others at once.
        let own = thread * BUILDS_EACH..(thread + 1) * BUILDS_EACH;
        for part in [own.start..own.start + 1, own.start + 1..own.end] {
            let ranges: Vec<&[Range]> = ranges[part.clone()].iter().map(|range| &range[..]).collect();
            builder.cmd_build_acceleration_structures(commands, &infos[part], &ranges).expect("it can be built");
        }
        raw.end_command_buffer(commands).expect("it ends");
        (pool, commands)
    };
    let recorded: Vec<(vk::CommandPool, vk::CommandBuffer)> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..THREADS).map(|thread| scope.spawn(move || record(thread))).collect();
        threads.into_iter().map(|thread| thread.join().expect("no panic")).collect()
    });
    let commands: Vec<vk::CommandBuffer> = recorded.iter().map(|recorded| recorded.1).collect();
    device()
        .run(None, |recorder| {
            unsafe { raw.cmd_execute_commands(recorder.commands(), &commands) };
            Ok(())
        })
        .expect("they build");
    for (i, (got, expected)) in placed.iter().zip(&expected).enumerate() {
        let [got, expected] = [got, expected].map(Built::bytes_in_use);
        assert!(got == expected, "build {i} of {} triangles", meshes[i].primitive_count);
    }
    for (pool, _) in recorded {
        unsafe { raw.destroy_command_pool(pool, None) };
    }
}
