//! Updates: structures whose primitives have moved, in place and from another, through ours and the driver's.

use crate::common::agree::assert_reports;
use crate::common::backends::{Backend, Built, Ours, backends};
use crate::common::device;
use crate::common::mixture::scaled;
use crate::common::probe::ProbeRay;
use crate::common::shapes::{boxes, soup};
use crate::common::world::{Part, World};
use hedgerow::accel::{Instance, Tree};
use hedgerow::ash::vk;
use hedgerow::bvh::layout::InstanceRecord;
use hedgerow_lab::random::SplitMix64;
use vk::BuildAccelerationStructureFlagsKHR as Flags;
use vk::BuildAccelerationStructureModeKHR as Mode;
use vk::GeometryFlagsKHR as GeometryFlags;

type BuildInfo<'a> = vk::AccelerationStructureBuildGeometryInfoKHR<'a>;
type Range = vk::AccelerationStructureBuildRangeInfoKHR;

fn info<'a>(
    ty: vk::AccelerationStructureTypeKHR,
    geometries: &'a [vk::AccelerationStructureGeometryKHR<'a>],
) -> BuildInfo<'a> {
    BuildInfo::default().ty(ty).flags(Flags::ALLOW_UPDATE | Flags::PREFER_FAST_TRACE).geometries(geometries)
}

/// Updates what was built of `info` from `source` into `target`, with scratch memory of the size that an update asks for.
fn update(backend: &dyn Backend, info: BuildInfo<'_>, ranges: &[Range], source: &Built, target: &Built) {
    let counts: Vec<u32> = ranges.iter().map(|r| r.primitive_count).collect();
    let bytes = backend.build_sizes(&info, &counts).update_scratch_size;
    let alignment = backend.scratch_alignment();
    let scratch = device().buffer("scratch", bytes + alignment).expect("memory");
    let scratch_address = scratch.address().next_multiple_of(alignment);
    let info = info
        .mode(Mode::UPDATE)
        .src_acceleration_structure(source.structure)
        .dst_acceleration_structure(target.structure)
        .scratch_data(vk::DeviceOrHostAddressKHR { device_address: scratch_address });
    device()
        .run(None, |recorder| {
            backend.build(recorder, &[info], &[ranges]);
            Ok(())
        })
        .expect("it updates");
}

fn rays(seed: u64) -> Vec<ProbeRay> {
    let mut random = SplitMix64::new(seed);
    let ray = |_| {
        let (origin, target) = (random.around(8.0), random.around(1.2));
        ProbeRay::new(origin, std::array::from_fn(|k| target[k] - origin[k]))
    };
    (0..250).map(ray).collect()
}

/// Before and after, with as many primitives in as many geometries.
fn parts() -> Vec<(&'static str, Part, Part)> {
    let opaque = GeometryFlags::OPAQUE;
    let none = GeometryFlags::empty();
    let triangles = |seed, counts: [usize; 2]| {
        Part::Triangles(vec![(soup(counts[0], 0.4, seed), opaque), (soup(counts[1], 0.3, seed + 1), none)])
    };
    // Some become points and come back as triangles.
    let mut with_points = soup(60, 0.5, 7);
    with_points.iter_mut().step_by(3).for_each(|triangle| *triangle = [triangle[0]; 3]);
    let points = |corners| Part::Triangles(vec![(corners, opaque)]);
    let all_boxes = |seed| Part::Boxes(vec![(boxes(40, 0.2, seed), none), (boxes(9, 0.3, seed + 1), opaque)]);
    vec![
        ("triangles", triangles(1, [50, 30]), triangles(11, [50, 30])),
        ("many triangles", triangles(3, [1500, 1]), triangles(13, [1500, 1])),
        ("into points", points(soup(60, 0.5, 7)), points(with_points.clone())),
        ("out of points", points(with_points), points(soup(60, 0.5, 8))),
        ("boxes", all_boxes(21), all_boxes(22)),
    ]
}

fn contents(part: &Part) -> Vec<Vec<u8>> {
    match part {
        Part::Triangles(all) => all.iter().map(|(corners, _)| bytemuck::cast_slice(corners).to_vec()).collect(),
        Part::Boxes(all) => all.iter().map(|(boxes, _)| bytemuck::cast_slice(boxes).to_vec()).collect(),
    }
}

#[test]
fn bottom_levels_follow_their_primitives() {
    let ty = vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL;
    for backend in backends() {
        for (name, before, after) in parts() {
            for in_place in [true, false] {
                let (geometries, ranges, memory) = before.geometries(device());
                let asked = info(ty, &geometries);
                let counts: Vec<u32> = ranges.iter().map(|r| r.primitive_count).collect();
                let first = Built::new(&*backend, &asked, &ranges, 0);
                let other = Built::place(&*backend, &asked, &counts, 0);
                memory.iter().zip(contents(&after)).for_each(|(buffer, bytes)| buffer.write(&bytes));
                let (target, unused) = if in_place { (&first, &other) } else { (&other, &first) };
                update(&*backend, asked, &ranges, &first, target);
                let unused = unused.structure;
                let target = if in_place { first } else { other };
                let world = World::new(vec![after.clone()], vec![Instance::new(1, Instance::IDENTITY)]);
                let rays = rays(5);
                let built = world.build_over(&*backend, vec![target], memory);
                let reports = backend.probe(built.top.structure, &rays);
                let what = format!("{}, {name}, in place: {in_place}", backend.name());
                let hits = assert_reports(&what, &world, &rays, &reports);
                assert!(hits > 10, "{what}: {hits} hits are no test");
                for structure in [built.top.structure, built.parts[0].structure, unused] {
                    backend.destroy(structure);
                }
            }
        }
    }
}

/// Indices that name other vertices, and another transform.
#[test]
fn indices_and_transforms_may_be_others() {
    const COUNT: u32 = 60;
    let corners = soup(COUNT as usize, 0.4, 31);
    let identity = Instance::IDENTITY;
    let turned: [[f32; 4]; 3] = [[0.0, -1.0, 0.0, 0.5], [1.0, 0.0, 0.0, -0.25], [0.0, 0.0, 1.0, 0.125]];
    let in_order: Vec<u32> = (0..3 * COUNT).collect();
    // Triangle i has the corners of the i-th from the end.
    let reversed: Vec<u32> = (0..COUNT).flat_map(|i| [0, 1, 2].map(|k| 3 * (COUNT - 1 - i) + k)).collect();
    for backend in backends() {
        let upload = |name, bytes: &[u8]| device().upload(name, bytes).expect("memory");
        let vertices = upload("vertices", bytemuck::cast_slice(&corners));
        let indices = upload("indices", bytemuck::cast_slice(&in_order));
        let transform = upload("transform", bytemuck::bytes_of(&identity));
        let at = |buffer: &hedgerow_lab::device::Buffer<'_>| vk::DeviceOrHostAddressConstKHR {
            device_address: buffer.address(),
        };
        let triangles = vk::AccelerationStructureGeometryTrianglesDataKHR::default()
            .vertex_format(vk::Format::R32G32B32_SFLOAT)
            .vertex_data(at(&vertices))
            .vertex_stride(12)
            .max_vertex(3 * COUNT - 1)
            .index_type(vk::IndexType::UINT32)
            .index_data(at(&indices))
            .transform_data(at(&transform));
        let geometries = [vk::AccelerationStructureGeometryKHR::default()
            .geometry_type(vk::GeometryTypeKHR::TRIANGLES)
            .geometry(vk::AccelerationStructureGeometryDataKHR { triangles })
            .flags(GeometryFlags::OPAQUE)];
        let asked = info(vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL, &geometries);
        let ranges = [Range::default().primitive_count(COUNT)];
        let built = Built::new(&*backend, &asked, &ranges, 0);
        indices.write(&reversed);
        transform.write(&turned);
        update(&*backend, asked, &ranges, &built, &built);
        let moved = |v: [f32; 3]| turned.map(|[a, b, c, d]| a * v[0] + b * v[1] + c * v[2] + d);
        let expected = corners.iter().rev().map(|triangle| triangle.map(moved)).collect();
        let part = Part::Triangles(vec![(expected, GeometryFlags::OPAQUE)]);
        let world = World::new(vec![part], vec![Instance::new(1, identity)]);
        let rays = rays(15);
        let built = world.build_over(&*backend, vec![built], vec![vertices, indices, transform]);
        let reports = backend.probe(built.top.structure, &rays);
        let hits = assert_reports(backend.name(), &world, &rays, &reports);
        assert!(hits > 10, "{}: {hits} hits are no test", backend.name());
        backend.destroy(built.top.structure);
        backend.destroy(built.parts[0].structure);
    }
}

#[test]
fn top_levels_follow_their_instances() {
    let mut random = SplitMix64::new(3);
    let mut placed = |count: usize| -> Vec<Instance> {
        let one = |i: usize| {
            let [x, y, z] = random.around(4.0);
            let s = 0.5 + random.signed().abs();
            let transform = [[0.0, -s, 0.0, x], [s, 0.0, 0.1, y], [0.0, 0.0, s, z]];
            let index = random.bits() as u32 & 0xff_ffff;
            Instance::new(1 + i as u64 % 2, transform).with_index_and_mask(index, 0xff)
        };
        (0..count).map(one).collect()
    };
    for backend in backends() {
        for count in [1, 2, 30, 400] {
            let parts = vec![
                Part::Triangles(vec![(soup(12, 0.3, 1), GeometryFlags::OPAQUE)]),
                Part::Triangles(vec![(soup(5, 0.3, 2), GeometryFlags::OPAQUE)]),
            ];
            let flags = Flags::ALLOW_UPDATE | Flags::PREFER_FAST_TRACE;
            let before = World { flags, ..World::new(parts.clone(), placed(count)) };
            let after = World { flags, ..World::new(parts, placed(count)) };
            let built = before.build(&*backend);
            built.instances.write(&after.placed(&*backend, &built.parts));
            let geometries = [built.geometry];
            let asked = info(vk::AccelerationStructureTypeKHR::TOP_LEVEL, &geometries);
            let range = Range::default().primitive_count(count as u32);
            update(&*backend, asked, &[range], &built.top, &built.top);
            let rays = rays(9);
            let reports = backend.probe(built.top.structure, &rays);
            let what = format!("{}, {count} instances", backend.name());
            let hits = assert_reports(&what, &after, &rays, &reports);
            assert!(hits > 0 || count == 1, "{what}: nothing is hit");
            backend.destroy(built.top.structure);
            built.parts.iter().for_each(|part| backend.destroy(part.structure));
        }
    }
}

/// Rays begin at what is near where the header tells what is far: after an update, too, whether something came from there or went.
#[test]
fn instances_that_come_from_far_and_go_there_are_met_where_they_are() {
    let ours = Ours::on(device());
    let world = |last: f32| {
        let near = (0..27).map(|i| scaled(0.8, [i % 3, i / 3 % 3, i / 9].map(|k| k as f32 - 1.0)));
        let instances = near.chain([scaled(30.0, [last, 0.0, 0.0])]).map(|to_world| Instance::new(1, to_world));
        let flags = Flags::ALLOW_UPDATE | Flags::PREFER_FAST_TRACE;
        World {
            flags,
            ..World::new(vec![Part::Triangles(vec![(soup(12, 0.3, 1), GeometryFlags::OPAQUE)])], instances.collect())
        }
    };
    let told = |built: &Built| {
        let read = Tree::<InstanceRecord>::from_bytes(&built.memory.read::<u8>(built.bytes as usize)).expect("built");
        read.validate().expect("valid");
        (read.header().near_node != 0, read.header().far_sides)
    };
    let far = [(true, 0b01), (true, 0b10)];
    let none = (false, 0);
    // Where nothing was far there may be no room to tell of it.
    for (from, to, before, after) in [
        (4000.0, 3.0, far[1], none),
        (4000.0, 9000.0, far[1], far[1]),
        (-4000.0, 700.0, far[0], far[1]),
        (3.0, 4000.0, none, none),
    ] {
        let what = format!("from {from} to {to}");
        let moved = world(to);
        let built = world(from).build(&ours);
        assert_eq!(told(&built.top), before, "{what}");
        built.instances.write(&moved.placed(&ours, &built.parts));
        let geometries = [built.geometry];
        let asked = info(vk::AccelerationStructureTypeKHR::TOP_LEVEL, &geometries);
        update(&ours, asked, &[Range::default().primitive_count(28)], &built.top, &built.top);
        assert_eq!(told(&built.top), after, "{what}");
        let mut random = SplitMix64::new(7);
        let ray = |i: usize| {
            let origin = random.around(2.0);
            let (around, along) = [(1.2, 0.0), (9.0, to)][i % 2];
            let [x, y, z] = random.around(around);
            let target = [x + along, y, z];
            ProbeRay::new(origin, std::array::from_fn(|k| target[k] - origin[k]))
        };
        let rays: Vec<ProbeRay> = (0..300).map(ray).collect();
        let reports = ours.probe(built.top.structure, &rays);
        let hits = assert_reports(&what, &moved, &rays, &reports);
        assert!(hits > 60, "{what}: {hits} hits are no test");
        ours.destroy(built.top.structure);
        built.parts.iter().for_each(|part| ours.destroy(part.structure));
    }
}
