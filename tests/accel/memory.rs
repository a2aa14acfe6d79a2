//! Memory between builds: scratch that is used again and begins anywhere, both levels in one command buffer, and large inputs.

use crate::common::agree::{assert_agrees, assert_reports};
use crate::common::backends::{Backend, Built, Ours, backends, vk_geometry};
use crate::common::device;
use crate::common::geometries::Owned;
use crate::common::matrices::{moved, rotation};
use crate::common::probe::ProbeRay;
use crate::common::shapes::{Corners, boxes, soup};
use crate::common::world::{Part, World, instances_at};
use hedgerow::accel::{Instance, SCRATCH_ALIGNMENT};
use hedgerow::ash::vk;
use hedgerow::bvh::geometry::{IndexFormat, VertexFormat};
use hedgerow_lab::random::SplitMix64;
use vk::GeometryFlagsKHR as GeometryFlags;

type BuildInfo<'a> = vk::AccelerationStructureBuildGeometryInfoKHR<'a>;
type Range = vk::AccelerationStructureBuildRangeInfoKHR;

fn bottom_level<'a>(geometries: &'a [vk::AccelerationStructureGeometryKHR<'a>]) -> BuildInfo<'a> {
    BuildInfo::default().ty(vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL).geometries(geometries)
}

fn at(device_address: u64) -> vk::DeviceOrHostAddressKHR {
    vk::DeviceOrHostAddressKHR { device_address }
}

fn rays(count: usize, seed: u64) -> Vec<ProbeRay> {
    let mut random = SplitMix64::new(seed);
    let ray = |_| {
        let (origin, target) = (random.around(3.0), random.around(0.8));
        ProbeRay { generated_t: 0.0, ..ProbeRay::new(origin, std::array::from_fn(|k| target[k] - origin[k])) }
    };
    (0..count).map(ray).collect()
}

/// Bottom levels one after another with the same scratch memory, behind them the top level with it, too, and nothing but
/// barriers between.
#[test]
fn one_scratch_memory_serves_all_builds_of_a_command_buffer() {
    let parts: Vec<Part> = vec![
        Part::Triangles(vec![(soup(700, 0.1, 1), GeometryFlags::OPAQUE)]),
        Part::Triangles(vec![(soup(9, 0.6, 2), GeometryFlags::OPAQUE), (soup(40, 0.3, 3), GeometryFlags::OPAQUE)]),
        Part::Boxes(vec![(boxes(50, 0.1, 4), GeometryFlags::empty())]),
        Part::Triangles(vec![(soup(3000, 0.03, 5), GeometryFlags::OPAQUE)]),
        Part::Triangles(Vec::new()),
        Part::Triangles(vec![(soup(1, 0.9, 6), GeometryFlags::OPAQUE)]),
    ];
    let mut random = SplitMix64::new(7);
    let instances = (0..40).map(|i| Instance::new(1 + i % 6, moved(rotation(i), random.around(1.0)))).collect();
    let world = World::new(parts, instances);
    let rays = rays(300, 8);
    for backend in backends() {
        let given: Vec<_> = world.parts.iter().map(|part| part.geometries(device())).collect();
        let counts: Vec<Vec<u32>> = given.iter().map(|g| g.1.iter().map(|r| r.primitive_count).collect()).collect();
        let placed: Vec<Built> =
            given.iter().zip(&counts).map(|(g, n)| Built::place(&*backend, &bottom_level(&g.0), n, 0)).collect();
        let instances = device().upload("instances", &world.placed(&*backend, &placed)).expect("memory");
        let geometry = [instances_at(instances.address(), false)];
        let top_info = BuildInfo::default().ty(vk::AccelerationStructureTypeKHR::TOP_LEVEL).geometries(&geometry);
        let top_range = [Range::default().primitive_count(world.instances.len() as u32)];
        let top = Built::place(&*backend, &top_info, &[top_range[0].primitive_count], 0);

        let mut builds: Vec<(BuildInfo<'_>, &[Range])> = (given.iter().zip(&placed))
            .map(|(g, place)| (bottom_level(&g.0).dst_acceleration_structure(place.structure), &g.1[..]))
            .collect();
        builds.push((top_info.dst_acceleration_structure(top.structure), &top_range));
        let bytes = |(info, ranges): &(BuildInfo<'_>, &[Range])| {
            let counts: Vec<u32> = ranges.iter().map(|range| range.primitive_count).collect();
            backend.build_sizes(info, &counts).build_scratch_size
        };
        let alignment = backend.scratch_alignment();
        let scratch = device().buffer("scratch", builds.iter().map(bytes).max().expect("builds") + alignment);
        let scratch = scratch.expect("memory");
        let address = scratch.address().next_multiple_of(alignment);
        device()
            .run(None, |recorder| {
                for (info, ranges) in &builds {
                    backend.build(recorder, &[info.scratch_data(at(address))], &[ranges]);
                    recorder.barrier();
                }
                Ok(())
            })
            .expect("they build");
        let reports = backend.probe(top.structure, &rays);
        let hits = assert_reports(backend.name(), &world, &rays, &reports);
        assert!(hits > 150, "{}: {hits} hits are no test", backend.name());
    }
}

/// The same bytes wherever the scratch memory begins, and whatever lies in it.
#[test]
fn scratch_memory_may_begin_at_every_multiple_of_its_alignment() {
    let ours = Ours::on(device());
    for count in [5, 900, 70_000] {
        let owned = Owned::of(&soup(count, 0.1, 9), VertexFormat::FLOAT3, IndexFormat::U32, 0);
        let (geometry, _memory) = owned.upload(0, 0);
        let geometries = [vk_geometry(&geometry, &owned)];
        let (info, range) = (bottom_level(&geometries), Range::default().primitive_count(count as u32));
        let expected = Built::new(&ours, &info, &[range], 0);
        let expected = expected.bytes_in_use();
        let bytes = ours.build_sizes(&info, &[count as u32]).build_scratch_size;
        let place = Built::place(&ours, &info, &[count as u32], 0);
        for (shift, filling) in [(1, 0u8), (3, 0xff), (5, 0x5a), (15, 0x80)] {
            let shift = shift * SCRATCH_ALIGNMENT;
            let scratch = device().buffer("scratch", shift + bytes).expect("memory");
            scratch.write(&vec![filling; (shift + bytes) as usize]);
            let info = info.dst_acceleration_structure(place.structure).scratch_data(at(scratch.address() + shift));
            device()
                .run(None, |recorder| {
                    ours.build(recorder, &[info], &[&[range]]);
                    Ok(())
                })
                .expect("it builds");
            assert!(place.memory.read::<u8>(expected.len()) == expected, "{count} triangles, scratch at {shift}");
        }
    }
}

/// Hills of 199,712 triangles.
fn hills() -> Corners {
    const CELLS: usize = 316;
    let vertex = |i: usize, j: usize| {
        let [x, y] = [i, j].map(|k| 2.0 * k as f32 / CELLS as f32 - 1.0);
        [x, y, 0.1 * (9.0 * x).sin() * (7.0 * y).cos() + 0.02 * (60.0 * x * y).sin()]
    };
    let cell = |at: usize| {
        let (i, j) = (at % CELLS, at / CELLS);
        let [a, b, c, d] = [vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)];
        [[a, b, c], [a, c, d]]
    };
    (0..CELLS * CELLS).flat_map(cell).collect()
}

#[test]
fn two_hundred_thousand_triangles_are_hit_where_they_are() {
    let hills = hills();
    let world = World::new(
        vec![Part::Triangles(vec![(hills.clone(), GeometryFlags::OPAQUE)])],
        vec![Instance::new(1, Instance::IDENTITY)],
    );
    // From above to the middles of triangles: along the hills, and at random, most rays would be close calls.
    let mut random = SplitMix64::new(10);
    let rays: Vec<ProbeRay> = (0..48)
        .map(|_| {
            let [a, b, c] = hills[random.bits() as usize % hills.len()];
            let [x, y, _] = random.around(1.0);
            ProbeRay::new([x, y, 2.0], std::array::from_fn(|k| (a[k] + b[k] + c[k]) / 3.0 - [x, y, 2.0][k]))
        })
        .collect();
    for backend in backends() {
        let hits = assert_agrees(&*backend, "hills", &world, &rays);
        assert!(hits > 30, "{}: {hits} hits are no test", backend.name());
    }
}

/// `PlocFallback` of HIPRT and `OverlappingGeometry` of Embree: no code tells one from another.
#[test]
fn a_hundred_thousand_triangles_at_the_same_place_are_one() {
    let triangle = [[0.0, 0.0, 4.0], [4.0, 0.0, 4.0], [0.0, 4.0, 4.0]];
    let world = World::new(
        vec![Part::Triangles(vec![(vec![triangle; 100_000], GeometryFlags::OPAQUE)])],
        vec![Instance::new(1, Instance::IDENTITY)],
    );
    let hit = ProbeRay::new([1.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    let beside = ProbeRay::new([3.0, 3.0, 0.0], [0.0, 0.0, 1.0]);
    for backend in backends() {
        let built = world.build(&*backend);
        let reports = backend.probe(built.top.structure, &[hit, beside]);
        let told = (reports[0].committed.kind, reports[0].committed.t, reports[1].committed.kind);
        assert_eq!(told, (1, 4.0, 0), "{}", backend.name());
        // Of equal ones ours takes the first.
        assert!(backend.name() != "hedgerow" || reports[0].committed.primitive == 0, "{:?}", reports[0].committed);
    }
}
