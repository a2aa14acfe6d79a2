//! Children in an order for rays that end at their first hit: what is built so, what keeps it, and what queries find and cost there.

use crate::common::agree::assert_reports;
use crate::common::backends::{Backend, BuildInfo, Copies, Ours};
use crate::common::device;
use crate::common::matrices::rotation;
use crate::common::mixture::ReadBack;
use crate::common::probe::{CONFIRM, CONFIRM_ODD, IGNORE, ProbeRay, ProbeReport, flags};
use crate::common::shapes::{Corners, boxes, hard_rays, soup};
use crate::common::world::{Part, World};
use hedgerow::accel::{ANY_HIT_ORDER, AccelOptions, Instance, REBRAID, Wide, twin as levels};
use hedgerow::ash::vk;
use hedgerow::bvh::builder::{BuildOptions, Method, Window};
use hedgerow::bvh::child_order::ChildOrder;
use hedgerow::bvh::codes::Codes;
use hedgerow::bvh::layout::{Bvh2, Header, Triangle};
use hedgerow::bvh::reinsertion::ReinsertionOptions;
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::{
    self,
    lbvh::{self, Finish},
};
use hedgerow::gpu::Recorder;
use hedgerow::trace::twin::tracer as host;
use hedgerow::trace::{Query, Ray};
use hedgerow_lab::experiments::check::backend::scratch_of;
use hedgerow_lab::random::SplitMix64;
use hedgerow_lab::scene::{Camera, Instances, Mesh, SceneInstance};
use hedgerow_lab::subjects::device_rays::RayBuffers;
use hedgerow_lab::subjects::levels::Levels;
use hedgerow_lab::subjects::structures::Structures;
use vk::BuildAccelerationStructureFlagsKHR as BuildFlags;
use vk::{GeometryFlagsKHR as GeometryFlags, GeometryInstanceFlagsKHR as Flags};

const IN_ORDER: Finish = Finish { collapse: Collapse::SAH, child_order: Some(ChildOrder::MoreHitsForItsCost) };

/// Triangles of two geometries, one of them opaque, and boxes, each by many matrices, flags and masks; more at the top than one
/// workgroup of a small build has lanes.
fn world(seed: u64) -> World {
    let mut random = SplitMix64::new(seed);
    let none = GeometryFlags::empty();
    let parts = vec![
        Part::Triangles(vec![(soup(60, 0.5, seed), GeometryFlags::OPAQUE), (soup(45, 0.5, seed + 1), none)]),
        Part::Triangles(vec![(soup(90, 0.3, seed + 2), GeometryFlags::OPAQUE)]),
        Part::Boxes(vec![(boxes(25, 0.2, seed + 3), none), (boxes(15, 0.2, seed + 4), GeometryFlags::OPAQUE)]),
    ];
    let all = [Flags::empty(), Flags::TRIANGLE_FLIP_FACING, Flags::FORCE_OPAQUE, Flags::FORCE_NO_OPAQUE];
    let instance = |i: usize| {
        let mut transform = rotation(random.bits() % 4);
        transform.iter_mut().for_each(|row| row[3] = 3.0 * random.signed());
        Instance::new(1 + i as u64 % 3, transform)
            .with_index_and_mask(i as u32, 1 << (random.bits() % 8))
            .with_offset_and_flags(0, all[random.bits() as usize % 4])
    };
    World::new(parts, (0..40).map(instance).collect())
}

fn rays(count: usize, seed: u64) -> Vec<ProbeRay> {
    let mut random = SplitMix64::new(seed);
    let ray = |i: usize| {
        let (origin, target) = (random.around(7.0), random.around(3.0));
        let first = [flags::FIRST_HIT, flags::FIRST_HIT, flags::NONE][i % 3];
        let more =
            [flags::NONE, flags::OPAQUE, flags::NO_OPAQUE, flags::CULL_BACK, flags::SKIP_BOXES, flags::CULL_OPAQUE];
        let mask = [0xff, 0x0f, 0x5a][random.bits() as usize % 3];
        let decision = [CONFIRM, CONFIRM_ODD, IGNORE][random.bits() as usize % 3];
        ProbeRay { flags: first | more[i / 3 % 6], mask, decision, ..ProbeRay::to(origin, target) }
    };
    (0..count).map(ray).collect()
}

#[test]
fn queries_hit_where_they_did_before() {
    let backend = Ours::on(device());
    for seed in [1, 2] {
        let (plain_world, rays) = (world(10 * seed), rays(1500, seed));
        let [plain, ordered] = [BuildFlags::empty(), ANY_HIT_ORDER].map(|flags| {
            let world = World { flags, ..plain_world.clone() };
            let built = world.build(&backend);
            for built in built.parts.iter().chain([&built.top]) {
                let header = built.memory.read::<Header>(1)[0];
                assert_eq!(header.child_order, u32::from(flags == ANY_HIT_ORDER), "{flags:?}");
            }
            let reports = backend.probe(built.top.structure, &rays);
            let hits = assert_reports(&format!("{flags:?}"), &world, &rays, &reports);
            assert!(hits > 150, "{hits} hits are no test");
            reports
        });
        for ((ray, plain), ordered) in rays.iter().zip(&plain).zip(&ordered) {
            let found = |report: &ProbeReport| report.committed.kind != 0;
            assert_eq!(found(ordered), found(plain), "{ray:?}");
            if ray.flags & flags::FIRST_HIT == 0 && plain.committed.kind == 1 {
                assert_eq!(ordered.committed, plain.committed, "{ray:?}");
            }
        }
    }
}

#[test]
fn both_levels_are_those_of_the_host() {
    for flags in [ANY_HIT_ORDER, ANY_HIT_ORDER | REBRAID] {
        let read = ReadBack::new(&Ours::on(device()), &World { flags, ..world(5) });
        let expected = levels::top_level(&read.instances, |a| read.below(a), flags, &Ours::OPTIONS);
        assert_eq!(expected.header().child_order, 1);
        assert!(read.top.to_bytes() == expected.to_bytes(), "{flags:?}: the top level");
        assert!(read.triangles.values().all(|tree| tree.header().child_order == 1), "{flags:?}: below");
    }
    let corners = soup(700, 0.2, 12);
    let part = Part::Triangles(vec![(corners.clone(), GeometryFlags::OPAQUE)]);
    let (built, _memory) = part.build_with(&Ours::on(device()), ANY_HIT_ORDER);
    let codes = Codes::for_count(corners.len() as u32);
    let expected = lbvh::build_corners(corners.iter().copied().map(Ok), codes, IN_ORDER);
    let expected = expected.with_geometries(&[(corners.len() as u32, 1)], 0).to_bytes();
    assert!(built.memory.read::<u8>(built.bytes as usize) == expected);
}

#[test]
fn copies_and_updates_keep_the_order() {
    let backend = Ours::on(device());
    let part = Part::Triangles(vec![(soup(300, 0.3, 4), GeometryFlags::OPAQUE)]);
    let flags = ANY_HIT_ORDER | BuildFlags::ALLOW_UPDATE;
    let (built, _memory) = part.build_with(&backend, flags);
    let read = || Bvh2::<Triangle>::from_bytes(&built.memory.read::<u8>(built.bytes as usize)).expect("a structure");
    let tree = read();
    assert_eq!(tree.header.child_order, 1);
    let bytes = backend.property(built.structure, vk::QueryType::ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR);
    let bottom = vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL;
    let memory = device().buffer("copy", bytes).expect("memory");
    let create = vk::AccelerationStructureCreateInfoKHR::default().buffer(memory.raw()).size(bytes).ty(bottom);
    let copy = backend.create(&create);
    let info = vk::CopyAccelerationStructureInfoKHR::default()
        .src(built.structure)
        .dst(copy)
        .mode(vk::CopyAccelerationStructureModeKHR::COMPACT);
    backend.copy(&info);
    let compacted = tree.compacted();
    assert_eq!(compacted.header.child_order, 1);
    assert!(memory.read::<u8>(bytes as usize) == compacted.to_bytes());

    let moved = Part::Triangles(vec![(soup(300, 0.3, 5), GeometryFlags::OPAQUE)]);
    let (geometries, ranges, _memory) = moved.geometries(device());
    let info = BuildInfo::default().ty(bottom).flags(flags).geometries(&geometries);
    let (_scratch, address) = scratch_of(&backend, backend.build_sizes(&info, &[300]).update_scratch_size);
    let info = info
        .mode(vk::BuildAccelerationStructureModeKHR::UPDATE)
        .src_acceleration_structure(built.structure)
        .dst_acceleration_structure(built.structure)
        .scratch_data(vk::DeviceOrHostAddressKHR { device_address: address });
    let update = |recorder: &mut Recorder<'_>| {
        backend.build(recorder, &[info], &[&ranges]);
        Ok(())
    };
    device().run(None, update).expect("it updates");
    let updated = read();
    assert_eq!(updated.header.child_order, 1);
    assert_ne!(updated.header.root, tree.header.root);
}

/// The work of a query is that of the walk on the host which takes the left child first.
#[test]
fn queries_take_the_left_child_first() {
    let corners: Corners = soup(600, 0.25, 9);
    let positions: Vec<[f32; 3]> = corners.iter().flatten().copied().collect();
    let triangles: Vec<[u32; 3]> = (0..corners.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let rays: Vec<Ray> = hard_rays(&corners, 2000, 1.0, [0.0; 3], 6);
    let scene = Instances {
        name: "soup".into(),
        parts: vec![Mesh { positions, triangles }],
        instances: vec![SceneInstance { part: 0, transform: SceneInstance::IDENTITY }],
        camera: Camera { eye: [0.0; 3], look: [1.0; 3], up: [0.0, 1.0, 0.0], fov: 60.0 },
        lights: Vec::new(),
    };
    let [plain, ordered] = [BuildFlags::empty(), ANY_HIT_ORDER].map(|flags| {
        let structures = Structures::ours(device(), AccelOptions { wide: Wide::Never, ..AccelOptions::DEFAULT });
        let mut levels = Levels::new(structures, &scene, flags).expect("built");
        levels.build().expect("built");
        let buffers = RayBuffers::new(device(), &rays).expect("memory");
        let work = levels.work(&buffers, Query::AnyHit).expect("work");
        work.iter().map(|work| [work[2], work[3]]).collect::<Vec<_>>()
    });
    assert_ne!(plain, ordered);
    // As `Levels` builds parts in nodes of two: PREFER_FAST_TRACE.
    let options = BuildOptions {
        method: Method::Hploc(Window::DEFAULT),
        optimise: Some(ReinsertionOptions::MEDIUM),
        child_order: IN_ORDER.child_order,
        ..BuildOptions::DEFAULT
    };
    let codes = Codes::for_count(corners.len() as u32);
    let lbvh = |finish| lbvh::build_corners(corners.iter().copied().map(Ok), codes, finish);
    let tree = twin::build(&options, codes, lbvh);
    for (ray, got) in rays.iter().zip(&ordered) {
        let expected = host::trace_left_first(&tree, ray).1;
        assert_eq!(*got, [expected.steps, expected.tests], "{ray:?}");
    }
}
