//! Acceleration structures by the calls of `VK_KHR_acceleration_structure`, and queries in shaders of others.

use crate::common::agree::{assert_agrees, assert_reports};
use crate::common::backends::{Backend, Built, Copies, Ours};
use crate::common::device;
use crate::common::probe::{ProbeRay, ask_kd_tree};
use crate::common::shapes::{boxes, hard_rays, soup, tree_of};
use crate::common::world::{Part, World};
use hedgerow::accel::{self, Instance, REBRAID};
use hedgerow::ash::vk;
use hedgerow::bvh::layout::Bvh2;
use hedgerow::trace::kd::Traversal;
use hedgerow::trace::twin::kd as kd_host;
use hedgerow_host::kdtree as host;
use hedgerow_lab::random::SplitMix64;
use vk::BuildAccelerationStructureFlagsKHR as Flags;
use vk::CopyAccelerationStructureModeKHR as CopyMode;
use vk::GeometryFlagsKHR as GeometryFlags;

pub fn all() {
    worlds_are_met_as_by_brute_force();
    bottom_levels_follow_their_primitives();
    copies_have_the_bytes_of_the_host();
    shaders_of_others_trace_kd_trees();
}

fn triangles(count: usize, seed: u64) -> Part {
    let opaque = (soup(count, 0.3, seed), GeometryFlags::OPAQUE);
    Part::Triangles(vec![opaque, (soup(count / 2, 0.3, seed + 1), GeometryFlags::empty())])
}

fn world(flags: Flags, count: usize) -> World {
    let parts = vec![triangles(60, 1), triangles(9, 3), Part::Boxes(vec![(boxes(40, 0.2, 5), GeometryFlags::empty())])];
    let mut random = SplitMix64::new(7);
    let instance = |i: usize| {
        let [x, y, z] = random.around(3.0);
        let transform = [[1.0, 0.25, 0.0, x], [0.0, 0.5, 0.25, y], [0.25, 0.0, 1.5, z]];
        Instance::new(1 + i as u64 % 3, transform).with_index_and_mask(i as u32, 0xff)
    };
    let instances = (0..count).map(instance).collect();
    World { flags, ..World::new(parts, instances) }
}

fn rays(count: usize) -> Vec<ProbeRay> {
    let mut random = SplitMix64::new(9);
    let ray = |_| {
        let (origin, target) = (random.around(8.0), random.around(2.0));
        ProbeRay::new(origin, std::array::from_fn(|k| target[k] - origin[k]))
    };
    (0..count).map(ray).collect()
}

fn worlds_are_met_as_by_brute_force() {
    let opened =
        Ours::with_options(device(), accel::AccelOptions { rebraid_budget: 3.0, ..accel::AccelOptions::DEFAULT });
    for (backend, flags, count) in [
        (Ours::on(device()), Flags::empty(), 30),
        (Ours::on(device()), Flags::PREFER_FAST_TRACE, 30),
        (opened, REBRAID, 30),
        (Ours::on(device()), REBRAID, 1100),
    ] {
        let hits = assert_agrees(&backend, &format!("{flags:?} {count}"), &world(flags, count), &rays(100));
        assert!(hits > 10, "{hits} hits are no test");
    }
}

fn bottom_levels_follow_their_primitives() {
    let backend = Ours::on(device());
    for count in [60, 5000] {
        let (before, after) = (triangles(count, 11), triangles(count, 13));
        let (geometries, ranges, memory) = before.geometries(device());
        let counts: Vec<u32> = ranges.iter().map(|r| r.primitive_count).collect();
        let info = vk::AccelerationStructureBuildGeometryInfoKHR::default()
            .ty(vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL)
            .flags(Flags::ALLOW_UPDATE)
            .geometries(&geometries);
        let built = Built::new(&backend, &info, &ranges, 0);
        let Part::Triangles(moved) = &after else { unreachable!("triangles") };
        memory.iter().zip(moved).for_each(|(buffer, (corners, _))| buffer.write(corners));
        let (_scratch, scratch) = built.scratch(&backend, &info, &counts);
        let info = info
            .mode(vk::BuildAccelerationStructureModeKHR::UPDATE)
            .src_acceleration_structure(built.structure)
            .dst_acceleration_structure(built.structure)
            .scratch_data(vk::DeviceOrHostAddressKHR { device_address: scratch });
        let update = |recorder: &mut hedgerow::gpu::Recorder<'_>| {
            backend.build(recorder, &[info], &[&ranges]);
            Ok(())
        };
        device().run(None, update).expect("it updates");
        let world = World::new(vec![after], vec![Instance::new(1, Instance::IDENTITY)]);
        let top = world.build_over(&backend, vec![built], memory);
        let rays = rays(60);
        assert_reports(&format!("updated, {count}"), &world, &rays, &backend.probe(top.top.structure, &rays));
    }
}

fn copies_have_the_bytes_of_the_host() {
    let backend = Ours::on(device());
    let (built, _memory) = triangles(300, 21).build(&backend);
    let tree: Bvh2 = Bvh2::from_bytes(&built.memory.read::<u8>(built.bytes as usize)).expect("a structure");
    let expected = tree.compacted().to_bytes();
    let property = |query| backend.property(built.structure, query);
    assert_eq!(property(vk::QueryType::ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR), expected.len() as u64);
    let compact = place(&backend, expected.len() as u64);
    let info = vk::CopyAccelerationStructureInfoKHR::default().src(built.structure).dst(compact.structure);
    backend.copy(&info.mode(CopyMode::COMPACT));
    assert!(compact.memory.read::<u8>(expected.len()) == expected, "compacted");

    let bytes = property(vk::QueryType::ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR);
    let serialized = device().buffer("serialized", bytes).expect("memory");
    let dst = vk::DeviceOrHostAddressKHR { device_address: serialized.address() };
    let info = vk::CopyAccelerationStructureToMemoryInfoKHR::default().src(built.structure).dst(dst);
    backend.serialize(&info.mode(CopyMode::SERIALIZE));
    let copy = place(&backend, built.bytes);
    let src = vk::DeviceOrHostAddressConstKHR { device_address: serialized.address() };
    let info = vk::CopyMemoryToAccelerationStructureInfoKHR::default().src(src).dst(copy.structure);
    backend.deserialize(&info.mode(CopyMode::DESERIALIZE));
    let tree_bytes = tree.to_bytes();
    assert!(copy.memory.read::<u8>(tree_bytes.len()) == tree_bytes, "serialised and back");
}

/// A structure of so many bytes that nothing has been built in.
fn place(backend: &Ours, bytes: u64) -> Built {
    let memory = device().buffer("structure", bytes).expect("memory");
    let ty = vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL;
    let info = vk::AccelerationStructureCreateInfoKHR::default().buffer(memory.raw()).size(bytes).ty(ty);
    Built { structure: backend.create(&info), memory, bytes }
}

fn shaders_of_others_trace_kd_trees() {
    let corners = soup(300, 0.2, 81);
    let (_, positions, triangles) = super::corpus::soup("", corners.clone());
    let tree = host::build(&positions, &triangles, &host::HostKdOptions::BINNED).expect("a small tree");
    let rays = hard_rays(&corners, 200, 1.0, [0.0; 3], 82);
    let upload = |bytes: &[u8]| device().upload("structure", bytes).expect("memory");
    let (kd_tree, bvh) = (upload(&tree.to_bytes()), upload(&tree_of(&corners).to_bytes()));
    let reports = ask_kd_tree(kd_tree.address(), bvh.address(), &rays);
    for (ray, report) in rays.iter().zip(reports) {
        let hit = kd_host::closest_hit(&tree, ray, Traversal::STACK);
        assert_eq!((report.of_kd_tree, report.of_query), (hit, hit), "{ray:?}");
    }
}
