//! Boxes: where they are candidates, what is told of them, and how they may lie in memory.

use crate::common::agree::{assert_agrees, assert_reports, probed};
use crate::common::backends::{Backend, Built, Ours, backends};
use crate::common::device;
use crate::common::matrices::{rotation, scaled};
use crate::common::probe::{CONFIRM, IGNORE, ProbeRay, flags};
use crate::common::shapes::{boxes, soup};
use crate::common::world::{Part, World, bottom_level, top_level};
use hedgerow::accel::Instance;
use hedgerow::ash::vk;
use hedgerow::bvh::layout::{BoxRecord, Bvh2, status};
use hedgerow_lab::device::Buffer;
use hedgerow_lab::random::SplitMix64;
use vk::{GeometryFlagsKHR as GeometryFlags, GeometryInstanceFlagsKHR as Flags};

type Range = vk::AccelerationStructureBuildRangeInfoKHR;
type GivenBox = [[f32; 3]; 2];

const ROOM: GivenBox = [[-1.0, -1.0, 4.0], [1.0, 1.0, 8.0]];

fn one(given: GivenBox, transform: [[f32; 4]; 3]) -> World {
    World::new(vec![Part::Boxes(vec![(vec![given], GeometryFlags::empty())])], vec![Instance::new(1, transform)])
}

/// `inside_aabbs` of VK-GL-CTS and the limits around it: they are inclusive, and a ray that begins inside meets the box.
#[test]
fn a_box_is_a_candidate_where_a_ray_is_in_it_between_its_limits() {
    let cases = [
        // From inside: the ray may end at once.
        (6.0, 0.0, 0.0, true),
        (6.0, 0.0, 1.0, true),
        (6.0, 0.0, 2.0, true),
        (6.0, 0.0, 9.0, true),
        (6.0, 1.0, 1.0, true),
        (6.0, 2.25, 9.0, false),
        // From its faces, in and out.
        (4.0, 0.0, 0.0, true),
        (8.0, 0.0, 9.0, true),
        // From outside.
        (0.0, 0.0, 3.75, false),
        (0.0, 0.0, 4.0, true),
        (0.0, 0.0, 9.0, true),
        (0.0, 5.0, 5.0, true),
        (0.0, 8.0, 9.0, true),
        (0.0, 8.25, 9.0, false),
        (9.0, 0.0, 9.0, false),
    ];
    for backend in backends() {
        for (turn, length) in [(0, 1.0), (1, 2f32.powi(-20)), (2, 2f32.powi(20))] {
            // Turned about z, where the ray goes: by nothing, by an exact angle, by any.
            let transform = [
                Instance::IDENTITY,
                [[0.0, -1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
                [[0.8, -0.6, 0.0, 0.0], [0.6, 0.8, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
            ][turn];
            let ray = |&(z, t_min, t_max, _): &(f32, f32, f32, bool)| {
                let ray = ProbeRay::new([0.25, 0.125, z], [0.0, 0.0, length]);
                ProbeRay { t_min: t_min / length, t_max: t_max / length, decision: IGNORE, ..ray }
            };
            let rays: Vec<ProbeRay> = cases.iter().map(ray).collect();
            let reports = probed(&*backend, &one(ROOM, transform), &rays);
            for (case, report) in cases.iter().zip(&reports) {
                // Implementations may enlarge boxes; ours never by so much.
                let of_driver = backend.name() == "driver";
                let ends_at_a_face = [4.0, 8.0].contains(&(case.0 + case.2));
                if of_driver && (!case.3 || ends_at_a_face && device().workarounds.driver_misreads_geometry) {
                    continue;
                }
                let what = format!("{}: {case:?}, length {length}", backend.name());
                assert_eq!(report.candidate_count, u32::from(case.3), "{what}");
            }
        }
    }
}

#[test]
fn boxes_without_a_thickness_are_candidates() {
    let cases: [(&str, GivenBox); 4] = [
        ("a rectangle", [[-1.0, -1.0, 4.0], [1.0, 1.0, 4.0]]),
        ("a rectangle along the ray", [[0.25, -1.0, 4.0], [0.25, 1.0, 6.0]]),
        ("a line across", [[-1.0, 0.125, 4.0], [1.0, 0.125, 4.0]]),
        ("a point", [[0.25, 0.125, 4.0]; 2]),
    ];
    for backend in backends() {
        if backend.name() == "driver" && device().workarounds.driver_misreads_geometry {
            continue;
        }
        for (name, given) in cases {
            let hit = ProbeRay { decision: IGNORE, ..ProbeRay::new([0.25, 0.125, 0.0], [0.0, 0.0, 1.0]) };
            let slanted = ProbeRay { origin: [4.25, 0.125, 0.0], direction: [-1.0, 0.0, 1.0], ..hit };
            let beside = ProbeRay { origin: [3.0, 3.0, 0.0], ..hit };
            let reports = probed(&*backend, &one(given, Instance::IDENTITY), &[hit, slanted, beside]);
            let counts: Vec<u32> = reports.iter().map(|report| report.candidate_count).collect();
            assert_eq!(counts, [1, 1, 0], "{}: {name}", backend.name());
        }
    }
}

/// Bytes of boxes `stride` apart, with what is no box between them.
fn bytes_of(boxes: &[GivenBox], stride: usize) -> Vec<u8> {
    let mut bytes = vec![0xa5; boxes.len() * stride];
    for (place, given) in bytes.chunks_exact_mut(stride).zip(boxes) {
        place[..24].copy_from_slice(bytemuck::cast_slice(given));
    }
    bytes
}

fn built(backend: &dyn Backend, given: &[(Vec<u8>, u64, Range, GeometryFlags)]) -> (Built, Vec<Buffer<'static>>) {
    let memory: Vec<_> = given.iter().map(|g| device().upload("boxes", &g.0).expect("memory")).collect();
    let geometry = |(buffer, (_, stride, _, flags)): (&Buffer<'static>, &(Vec<u8>, u64, Range, GeometryFlags))| {
        let address = vk::DeviceOrHostAddressConstKHR { device_address: buffer.address() };
        let aabbs = vk::AccelerationStructureGeometryAabbsDataKHR::default().data(address).stride(*stride);
        vk::AccelerationStructureGeometryKHR::default()
            .geometry_type(vk::GeometryTypeKHR::AABBS)
            .geometry(vk::AccelerationStructureGeometryDataKHR { aabbs })
            .flags(*flags)
    };
    let geometries: Vec<_> = memory.iter().zip(given).map(geometry).collect();
    let ranges: Vec<Range> = given.iter().map(|g| g.2).collect();
    (bottom_level(backend, &geometries, &ranges), memory)
}

fn rays(count: usize) -> Vec<ProbeRay> {
    let mut random = SplitMix64::new(77);
    let ray = |i: usize| {
        let (origin, target) = (random.around([3.0, 0.8][i % 2]), random.around(0.9));
        let ray = ProbeRay::new(origin, std::array::from_fn(|k| target[k] - origin[k]));
        let decision = [IGNORE, CONFIRM][i / 2 % 2];
        let flags = [flags::NONE, flags::OPAQUE, flags::NO_OPAQUE, flags::CULL_OPAQUE, flags::CULL_NO_OPAQUE][i % 5];
        ProbeRay { decision, flags, generated_t: [0.0, 0.5, 1.5][i % 3], ..ray }
    };
    (0..count).map(ray).collect()
}

#[test]
fn strides_offsets_and_several_geometries_of_boxes_are_where_they_are_said_to_be() {
    let lists = [boxes(30, 0.3, 1), boxes(1, 0.9, 2), Vec::new(), boxes(40, 0.1, 3)];
    let opaque = [GeometryFlags::OPAQUE, GeometryFlags::empty(), GeometryFlags::empty(), GeometryFlags::OPAQUE];
    for (name, take, strides) in [
        ("one", 1, [24; 4]),
        ("one with a stride", 1, [40; 4]),
        ("several", 4, [24; 4]),
        ("several with strides", 4, [32, 24, 48, 256]),
    ] {
        let parts: Vec<_> = lists.iter().cloned().zip(opaque).take(take).collect();
        let instances =
            vec![Instance::new(1, Instance::IDENTITY), Instance::new(1, scaled(rotation(9), [1.0, 2.0, 0.5]))];
        let world = World::new(vec![Part::Boxes(parts.clone())], instances);
        for backend in backends() {
            for skipped in [0, 2] {
                let given: Vec<_> = (parts.iter().zip(strides))
                    .map(|((list, flags), stride)| {
                        let all: Vec<GivenBox> = boxes(skipped, 0.9, 50).into_iter().chain(list.clone()).collect();
                        let range = Range::default()
                            .primitive_count(list.len() as u32)
                            .primitive_offset((skipped * stride) as u32);
                        (bytes_of(&all, stride), stride as u64, range, *flags)
                    })
                    .collect();
                let (part, memory) = built(&*backend, &given);
                let top = world.build_over(&*backend, vec![part], memory);
                let rays = rays(400);
                let reports = backend.probe(top.top.structure, &rays);
                let what = format!("{}, {name}, {skipped} skipped", backend.name());
                let hits = assert_reports(&what, &world, &rays, &reports);
                assert!(hits > 30, "{what}: {hits} hits are no test");
            }
        }
    }
}

#[test]
fn a_box_that_is_a_candidate_tells_whether_it_is_opaque() {
    let cases = [
        (GeometryFlags::empty(), Flags::empty(), flags::NONE, 0),
        (GeometryFlags::OPAQUE, Flags::empty(), flags::NONE, 1),
        (GeometryFlags::empty(), Flags::FORCE_OPAQUE, flags::NONE, 1),
        (GeometryFlags::OPAQUE, Flags::FORCE_NO_OPAQUE, flags::NONE, 0),
        (GeometryFlags::empty(), Flags::FORCE_NO_OPAQUE, flags::OPAQUE, 1),
        (GeometryFlags::OPAQUE, Flags::FORCE_OPAQUE, flags::NO_OPAQUE, 0),
    ];
    for backend in backends() {
        for case in cases {
            let (geometry, instance, flags, opaque) = case;
            let instance = Instance::new(1, rotation(4)).with_offset_and_flags(7, instance);
            let world = World::new(vec![Part::Boxes(vec![(vec![[[-1.0; 3], [1.0; 3]]], geometry)])], vec![instance]);
            let ray = ProbeRay { flags, decision: IGNORE, ..ProbeRay::new([0.0, 0.1, -5.0], [0.0, 0.0, 1.0]) };
            let report = probed(&*backend, &world, &[ray])[0];
            let told = (report.candidate_count, report.opaque_boxes, report.committed.kind);
            assert_eq!(told, (1, opaque, 0), "{}: {case:?}", backend.name());
        }
    }
}

/// What is generated shortens the ray for the triangles behind, and is given up for those before.
#[test]
fn a_generated_hit_lies_where_the_shader_says_among_triangles() {
    let parts = vec![
        Part::Triangles(vec![(soup(25, 0.7, 31), GeometryFlags::OPAQUE)]),
        Part::Boxes(vec![(boxes(10, 0.8, 32), GeometryFlags::empty())]),
    ];
    let instances = vec![Instance::new(1, rotation(7)), Instance::new(2, rotation(8)), Instance::new(2, rotation(9))];
    let world = World::new(parts, instances);
    let mut random = SplitMix64::new(12);
    let rays: Vec<ProbeRay> = (0..900)
        .map(|i| {
            let (origin, target) = (random.around(3.0), random.around(0.7));
            let ray = ProbeRay::new(origin, std::array::from_fn(|k| target[k] - origin[k]));
            ProbeRay { generated_t: [0.0, 0.4, 0.6, 0.8, 1.0, 4.0][i % 6], ..ray }
        })
        .collect();
    for backend in backends() {
        let hits = assert_agrees(&*backend, "mixed", &world, &rays);
        assert!(hits > 300, "{}: {hits} hits are no test", backend.name());
    }
}

#[test]
fn boxes_whose_least_x_is_not_a_number_are_inactive() {
    let mut given = boxes(30, 0.4, 6);
    given.iter_mut().step_by(3).for_each(|b| b[0][0] = f32::NAN);
    let world = World::new(
        vec![Part::Boxes(vec![(given, GeometryFlags::empty())])],
        vec![Instance::new(1, Instance::IDENTITY), Instance::new(1, rotation(3))],
    );
    for backend in backends() {
        if backend.name() == "driver" && device().workarounds.driver_loses_boxes {
            continue;
        }
        let hits = assert_agrees(&*backend, "a third inactive", &world, &rays(400));
        assert!(hits > 60, "{}: {hits} hits are no test", backend.name());
    }
}

/// Ours alone: Vulkan forbids them.
#[test]
fn boxes_that_are_inside_out_or_endless_are_left_out_and_told_of() {
    let ours = Ours::on(device());
    for bad in [
        [[-1.0, -1.0, 8.0], [1.0, 1.0, 4.0]],
        [[-1.0, f32::NAN, 4.0], [1.0, 1.0, 8.0]],
        [[-1.0, -1.0, 4.0], [1.0, f32::INFINITY, 8.0]],
        [[f32::NEG_INFINITY; 3], [f32::INFINITY; 3]],
        [[-1.0, -1.0, 4.0], [1.0, 1.0, f32::NAN]],
    ] {
        let given = bytes_of(&[bad, ROOM, bad], 24);
        let (part, _memory) = built(&ours, &[(given, 24, Range::default().primitive_count(3), GeometryFlags::empty())]);
        let tree = Bvh2::<BoxRecord>::from_bytes(&part.memory.read::<u8>(part.bytes as usize)).expect("a structure");
        tree.validate().expect("a valid tree");
        assert_eq!((tree.header.status, tree.header.active), (status::NON_FINITE, 1), "{bad:?}");
        let instances =
            device().upload("instances", &[Instance::new(ours.address(part.structure), Instance::IDENTITY)]);
        let instances = instances.expect("memory");
        let geometry = crate::common::world::instances_at(instances.address(), false);
        let none = vk::BuildAccelerationStructureFlagsKHR::empty();
        let top = top_level(&ours, &geometry, Range::default().primitive_count(1), none);
        let ray = ProbeRay { decision: IGNORE, ..ProbeRay::new([0.0; 3], [0.0, 0.0, 1.0]) };
        let report = ours.probe(top.structure, &[ray])[0];
        assert_eq!((report.candidate_count, report.candidates[0]), (1, [1, 0, 0, 1]), "{bad:?}");
    }
}
