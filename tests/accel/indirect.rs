//! Builds whose counts and offsets lie in device memory: what is hit is what a build that is told them hits. Ours alone: the
//! tests' device is made without the driver's indirect builds.

use crate::common::backends::{Backend, Built, Ours, vk_geometry};
use crate::common::device;
use crate::common::geometries::{MOVED, Owned};
use crate::common::matrices::{moved, rotation};
use crate::common::probe::{CONFIRM, IGNORE, ProbeRay, ProbeReport};
use crate::common::shapes::{add, boxes, soup};
use crate::common::world::{Part, World, instances_at};
use hedgerow::accel::{Instance, REBRAID};
use hedgerow::ash::vk;
use hedgerow::bvh::geometry::{IndexFormat, VertexFormat};
use hedgerow::bvh::layout::{Bvh2, Triangle};
use hedgerow::gpu::ArgumentMemory;
use hedgerow_lab::random::SplitMix64;
use vk::GeometryFlagsKHR as GeometryFlags;

type BuildInfo<'a> = vk::AccelerationStructureBuildGeometryInfoKHR<'a>;
type Range = vk::AccelerationStructureBuildRangeInfoKHR;

/// A build, the most primitives that its geometries may have, and what its ranges are when it runs, so many bytes apart.
struct Indirect<'a> {
    info: BuildInfo<'a>,
    most: Vec<u32>,
    ranges: Vec<Range>,
    stride: u32,
}

impl Indirect<'_> {
    /// The ranges as they lie in device memory, with other bytes between them.
    fn words(&self) -> Vec<u32> {
        let mut words = vec![0xa5a5_a5a5; self.ranges.len().max(1) * self.stride as usize / 4];
        for (range, place) in self.ranges.iter().zip(words.chunks_exact_mut(self.stride as usize / 4)) {
            let fields = [range.primitive_count, range.primitive_offset, range.first_vertex, range.transform_offset];
            place[..4].copy_from_slice(&fields);
        }
        words
    }
}

/// Builds all in one call.
fn built(ours: &Ours, builds: &[Indirect<'_>]) -> Vec<Built> {
    let placed: Vec<Built> = builds.iter().map(|build| Built::place(ours, &build.info, &build.most, 0)).collect();
    let scratch: Vec<_> =
        placed.iter().zip(builds).map(|(place, build)| place.scratch(ours, &build.info, &build.most)).collect();
    let ranges: Vec<_> =
        builds.iter().map(|build| device().upload("ranges", &build.words()).expect("memory")).collect();
    let infos: Vec<BuildInfo<'_>> = (builds.iter().zip(&placed).zip(&scratch))
        .map(|((build, place), scratch)| {
            let scratch = vk::DeviceOrHostAddressKHR { device_address: scratch.1 };
            build.info.dst_acceleration_structure(place.structure).scratch_data(scratch)
        })
        .collect();
    let addresses: Vec<u64> = ranges.iter().map(|buffer| buffer.address()).collect();
    let strides: Vec<u32> = builds.iter().map(|build| build.stride).collect();
    let most: Vec<&[u32]> = builds.iter().map(|build| &build.most[..]).collect();
    device()
        .run(None, |recorder| unsafe {
            let commands = recorder.commands();
            ours.0.cmd_build_acceleration_structures_indirect(commands, &infos, &addresses, &strides, &most)
        })
        .expect("they build");
    placed
}

fn bottom_level<'a>(geometries: &'a [vk::AccelerationStructureGeometryKHR<'a>]) -> BuildInfo<'a> {
    BuildInfo::default().ty(vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL).geometries(geometries)
}

fn rays(scale: f32) -> Vec<ProbeRay> {
    let mut random = SplitMix64::new(9);
    let ray = |i: usize| {
        let (origin, target) = (random.around(3.0 * scale), random.around(0.8 * scale));
        let ray = ProbeRay::new(origin, std::array::from_fn(|k| target[k] - origin[k]));
        ProbeRay { decision: [CONFIRM, IGNORE][i % 2], generated_t: 0.0, ..ray }
    };
    (0..300).map(ray).collect()
}

/// What does not depend on the order of the tree.
fn told(report: &ProbeReport) -> (crate::common::probe::Meeting, u32, Vec<[u32; 4]>) {
    let candidates = if report.candidate_count > 8 { Vec::new() } else { report.sorted_candidates() };
    (report.committed, report.candidate_count, candidates)
}

/// Checks the builds, all in one call, against those that are told their ranges. Returns how many rays hit.
#[track_caller]
fn assert_as_told(what: &str, ours: &Ours, builds: &[Indirect<'_>], rays: &[ProbeRay]) -> usize {
    let mut hits = 0;
    for (i, (got, build)) in built(ours, builds).iter().zip(builds).enumerate() {
        // A count over its maximum is its maximum.
        let least =
            |(range, &most): (&Range, &u32)| Range { primitive_count: range.primitive_count.min(most), ..*range };
        let ranges: Vec<Range> = build.ranges.iter().zip(&build.most).map(least).collect();
        let direct = Built::new(ours, &build.info, &ranges, 0);
        let reports = ours.probe(direct.structure, rays);
        hits += reports.iter().filter(|report| report.committed.kind != 0).count();
        for (ray, pair) in rays.iter().zip(ours.probe(got.structure, rays).iter().zip(&reports)) {
            // Boxes are generated at the same t: any of them may be the hit.
            if pair.1.committed.kind == 2 {
                assert_eq!(pair.0.committed.kind, 2, "{what}, build {i}: {ray:?}");
                continue;
            }
            assert_eq!(told(pair.0), told(pair.1), "{what}, build {i}: {ray:?}");
        }
    }
    hits
}

#[test]
fn counts_and_offsets_of_triangles_are_read_when_the_build_runs() {
    let ours = Ours::on(device());
    let corners = soup(400, 0.3, 3);
    let transforms = device().upload("transforms", &[[[0f32; 4]; 3], Instance::IDENTITY, MOVED]).expect("memory");
    for index_format in [IndexFormat::NONE, IndexFormat::U16, IndexFormat::U32] {
        let owned = Owned::of(&corners, VertexFormat::FLOAT3, index_format, 4);
        let (geometry, _memory) = owned.upload(0, 0);
        let mut given = vk_geometry(&geometry, &owned);
        given.geometry.triangles.transform_data.device_address = transforms.address();
        let geometries = [given];
        // A triangle's bytes in the indices or, without them, in the vertices.
        let triangle = if index_format == IndexFormat::NONE { owned.vertex_stride } else { index_format.bytes() };
        for (count, skipped, first_vertex, matrix) in [
            (0, 0, 0, 1),
            (1, 0, 0, 1),
            (2, 7, 0, 2),
            (64, 0, 3, 1),
            (65, 1, 6, 1),
            (299, 50, 0, 2),
            (300, 0, 0, 1),
            (301, 9, 3, 1),
        ] {
            let range = Range {
                primitive_count: count,
                primitive_offset: 3 * skipped * triangle,
                first_vertex,
                transform_offset: 48 * matrix,
            };
            let info = bottom_level(&geometries);
            let build = Indirect { info, most: vec![300], ranges: vec![range], stride: 16 };
            let what = format!("{index_format:?}, {range:?}");
            // The second matrix leads far away.
            let rays: Vec<ProbeRay> = match matrix {
                1 => rays(1.0),
                _ => {
                    rays(3.0).iter().map(|ray| ProbeRay { origin: add(ray.origin, [10.0, 0.0, 0.0]), ..*ray }).collect()
                }
            };
            let hits = assert_as_told(&what, &ours, &[build], &rays);
            assert!(count < 60 || hits > 40, "{what}: {hits} hits are no test");
        }
    }
}

#[test]
fn several_geometries_keep_their_indices_when_some_have_fewer_primitives_than_planned() {
    let ours = Ours::on(device());
    let list = [(100, 1), (1, 2), (50, 3), (200, 4)];
    let parts = list.map(|(count, seed)| Owned::of(&soup(count, 0.3, seed), VertexFormat::FLOAT3, IndexFormat::U32, 0));
    let uploaded = parts.each_ref().map(|part| part.upload(0, 0));
    let geometries: Vec<_> = uploaded.iter().zip(&parts).map(|((g, _), part)| vk_geometry(g, part)).collect();
    let most: Vec<u32> = list.iter().map(|&(count, _)| count as u32).collect();
    for counts in [[100, 1, 50, 200], [0, 0, 0, 0], [0, 1, 0, 1], [99, 0, 50, 0], [7, 1, 0, 200], [200, 9, 50, 1 << 31]]
    {
        for stride in [16, 20, 256] {
            let ranges = counts.map(|count| Range::default().primitive_count(count)).to_vec();
            let build = Indirect { info: bottom_level(&geometries), most: most.clone(), ranges, stride };
            let tree = &built(&ours, std::slice::from_ref(&build))[0];
            let tree = Bvh2::<Triangle>::from_bytes(&tree.memory.read::<u8>(tree.bytes as usize)).expect("a structure");
            tree.validate().unwrap_or_else(|error| panic!("{counts:?}: {error}"));
            let active: u32 = counts.iter().zip(&most).map(|(&count, &most)| count.min(most)).sum();
            assert_eq!(tree.header.active, active, "{counts:?}");
            let hits = assert_as_told(&format!("{counts:?}, {stride} bytes apart"), &ours, &[build], &rays(1.0));
            assert!(active < 50 || hits > 40, "{counts:?}: {hits} hits are no test");
        }
    }
}

#[test]
fn instances_boxes_and_triangles_are_built_by_one_call() {
    let ours = Ours::on(device());
    // The geometries' records in memory for arguments.
    let mut in_memory = Ours::on(device());
    let arguments = device().buffer("arguments", 1 << 12).expect("memory");
    let memory = ArgumentMemory { buffer: arguments.raw(), offset: 0, bytes: arguments.bytes() };
    // SAFETY: buffers of the tests' device have the usage.
    in_memory.0 = unsafe { ours.0.with_arguments_in(memory) };
    let parts = vec![
        Part::Triangles(vec![(soup(90, 0.3, 5), GeometryFlags::OPAQUE), (soup(60, 0.3, 6), GeometryFlags::empty())]),
        Part::Boxes(vec![(boxes(40, 0.2, 7), GeometryFlags::empty()), (boxes(9, 0.3, 8), GeometryFlags::OPAQUE)]),
    ];
    let mut random = SplitMix64::new(1);
    let instances = (0..50).map(|i| Instance::new(1 + i % 2, moved(rotation(i), random.around(1.0)))).collect();
    let world = World::new(parts, instances);
    let below = world.build(&ours);
    let placed = world.placed(&ours, &below.parts);
    let instances = device().upload("instances", &placed).expect("memory");
    let pointers: Vec<u64> = (0..50).map(|i| instances.address() + 64 * i).collect();
    let pointers = device().upload("pointers", &pointers).expect("memory");
    let given: Vec<_> = world.parts.iter().map(|part| part.geometries(device())).collect();
    let tops = [[instances_at(instances.address(), false)], [instances_at(pointers.address(), true)]];
    for (count, skipped) in [(0, 0), (1, 0), (1, 49), (17, 20), (50, 0), (60, 0), (40, 10)] {
        let mut builds: Vec<Indirect<'_>> = given
            .iter()
            .map(|(geometries, ranges, _)| {
                let fewer = |range: &Range| range.primitive_count(range.primitive_count * count / 60);
                let most = ranges.iter().map(|range| range.primitive_count).collect();
                let ranges = ranges.iter().map(fewer).collect();
                Indirect { info: bottom_level(geometries), most, ranges, stride: 24 }
            })
            .collect();
        for (top, bytes) in tops.iter().zip([64, 8]) {
            let info = BuildInfo::default().ty(vk::AccelerationStructureTypeKHR::TOP_LEVEL).geometries(top);
            let range = Range::default().primitive_count(count).primitive_offset(bytes * skipped);
            for flags in [vk::BuildAccelerationStructureFlagsKHR::empty(), REBRAID] {
                builds.push(Indirect {
                    info: info.flags(flags),
                    most: vec![50 - skipped],
                    ranges: vec![range],
                    stride: 16,
                });
            }
        }
        for ours in [&ours, &in_memory] {
            let hits = assert_as_told(&format!("{count} from {skipped} on"), ours, &builds, &rays(1.0));
            assert!(count < 17 || hits > 200, "{count} from {skipped} on: {hits} hits are no test");
        }
    }
}
