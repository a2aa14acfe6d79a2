//! What Vulkan forbids and nobody checks: bad vertices, indices, matrices and references, and structures that were
//! overwritten. Builds and queries of ours end, leave out what they can, and say so in the status. Ours alone: the driver may do
//! anything.

use crate::common::agree::assert_reports;
use crate::common::backends::{Backend, Built, Ours, vk_geometry};
use crate::common::device;
use crate::common::geometries::Owned;
use crate::common::matrices::{moved, rotation, scaled};
use crate::common::probe::{CONFIRM, IGNORE, Probe, ProbeRay, ProbeReport};
use crate::common::shapes::{Corners, boxes, soup};
use crate::common::world::{BuiltWorld, Part, World, bottom_level, instances_at, top_level};
use hedgerow::accel::{AccelOptions, Instance, REBRAID, Tree, Wide};
use hedgerow::ash::vk;
use hedgerow::bvh::geometry::{IndexFormat, VertexFormat};
use hedgerow::bvh::layout::{self, Bvh2, Child, Header, InstanceRecord as Placed, NODES_OFFSET, Triangle, status};
use hedgerow_lab::random::SplitMix64;
use vk::GeometryFlagsKHR as GeometryFlags;

type Range = vk::AccelerationStructureBuildRangeInfoKHR;

fn rays(count: usize) -> Vec<ProbeRay> {
    let mut random = SplitMix64::new(5);
    let ray = |i: usize| {
        let (origin, target) = (random.around(4.0), random.around(1.0));
        let ray = ProbeRay::new(origin, std::array::from_fn(|k| target[k] - origin[k]));
        ProbeRay { decision: [CONFIRM, IGNORE][i % 2], generated_t: 0.0, ..ray }
    };
    (0..count).map(ray).collect()
}

fn tree_of(built: &Built) -> Bvh2<Triangle> {
    Bvh2::from_bytes(&built.memory.read::<u8>(built.bytes as usize)).expect("a structure")
}

/// A world of the one part, built already, under a turned instance.
fn seen(ours: &Ours, part: Part, built: Built) -> (World, BuiltWorld) {
    let world = World::new(vec![part], vec![Instance::new(1, rotation(1))]);
    let top = world.build_over(ours, vec![built], Vec::new());
    (world, top)
}

#[test]
fn triangles_with_bad_vertices_or_indices_are_left_out_and_told_of() {
    let ours = Ours::on(device());
    let corners = soup(80, 0.5, 3);
    let rounded: Corners = corners.iter().map(|t| t.map(|v| v.map(|x| (8.0 * x).round() / 8.0))).collect();
    let rays = rays(400);
    for index_format in [IndexFormat::NONE, IndexFormat::U16, IndexFormat::U32] {
        for (name, bad, expected) in [
            ("not a number", Some(f32::NAN), status::NON_FINITE),
            ("infinite", Some(f32::NEG_INFINITY), status::NON_FINITE),
            ("out of range", None, status::INDEX_OUT_OF_RANGE),
        ] {
            let mut owned = Owned::of(&corners, VertexFormat::FLOAT3, index_format, 0);
            let mut kept = rounded.clone();
            for i in (0..80).step_by(3) {
                let vertex = 3 * i + i % 3;
                match (bad, index_format.bytes() as usize) {
                    (Some(bad), _) => {
                        owned.vertices[12 * vertex + 4 * (i % 3)..][..4].copy_from_slice(&bad.to_le_bytes());
                    }
                    // Without indices none can be out of range.
                    (None, 0) => continue,
                    (None, bytes) => {
                        let index = [owned.vertex_count, u32::MAX, owned.vertex_count + 1][i % 3];
                        owned.indices[bytes * vertex..][..bytes].copy_from_slice(&index.to_le_bytes()[..bytes]);
                    }
                }
                // What no ray meets.
                kept[i] = [[0.0; 3]; 3];
            }
            let (geometry, _memory) = owned.upload(0, 0);
            let range = Range::default().primitive_count(80);
            let built = bottom_level(&ours, &[vk_geometry(&geometry, &owned)], &[range]);
            let tree = tree_of(&built);
            tree.validate().expect("a valid tree");
            let left_out = if kept == rounded { 0 } else { 27 };
            assert_eq!(tree.header.active, 80 - left_out, "{name}, {index_format:?}");
            assert_eq!(tree.header.status, if left_out == 0 { 0 } else { expected }, "{name}, {index_format:?}");
            let (world, top) = seen(&ours, Part::Triangles(vec![(kept, GeometryFlags::OPAQUE)]), built);
            let reports = ours.probe(top.top.structure, &rays);
            let hits = assert_reports(&format!("{name}, {index_format:?}"), &world, &rays, &reports);
            assert!(hits > 60, "{name}, {index_format:?}: {hits} hits are no test");
        }
    }
}

/// `GarbageGeometry` of Embree: vertices of random bits, enormous, tiny or no numbers. Not subnormal ones: a device may take
/// them for zero in a box and keep them in a record.
#[test]
fn random_bits_as_vertices_make_valid_trees() {
    let ours = Ours::on(device());
    let mut random = SplitMix64::new(6);
    let rays = rays(64);
    for round in 0..60 {
        let count = 20 + 10 * (round % 4);
        let mut bits = || Some(random.bits() as u32).filter(|bits| !f32::from_bits(*bits).is_subnormal()).unwrap_or(0);
        let triangles: Vec<[u32; 9]> = (0..count).map(|_| [(); 9].map(|()| bits())).collect();
        let finite = |t: &&[u32; 9]| t.iter().all(|&bits| f32::from_bits(bits).is_finite());
        let active = triangles.iter().filter(finite).count() as u32;
        let corners: Corners = triangles
            .iter()
            .map(|t| std::array::from_fn(|v| std::array::from_fn(|k| f32::from_bits(t[3 * v + k]))))
            .collect();
        let part = Part::Triangles(vec![(corners, GeometryFlags::OPAQUE)]);
        let (built, _memory) = part.build(&ours);
        let tree = tree_of(&built);
        tree.validate().unwrap_or_else(|error| panic!("round {round}: {error}"));
        assert_eq!(tree.header.active, active, "round {round}");
        let (_, top) = seen(&ours, part, built);
        assert_finite(&format!("round {round}"), &rays, &ours.probe(top.top.structure, &rays));
    }
}

/// Whatever was met, it was met between the limits.
#[track_caller]
fn assert_finite(what: &str, rays: &[ProbeRay], reports: &[ProbeReport]) {
    for (ray, report) in rays.iter().zip(reports) {
        let hit = &report.committed;
        let between = ray.t_min < hit.t && hit.t < ray.t_max || hit.kind == 2 && hit.t == ray.generated_t;
        assert!(hit.kind == 0 || between, "{what}: {ray:?}: {hit:?}");
    }
}

#[test]
fn instances_that_cannot_be_are_left_out_and_told_of() {
    let ours = Ours::on(device());
    let parts = vec![
        Part::Triangles(vec![(soup(60, 0.5, 1), GeometryFlags::OPAQUE)]),
        Part::Boxes(vec![(boxes(20, 0.3, 2), GeometryFlags::empty())]),
    ];
    let world = World::new(parts, vec![Instance::new(1, rotation(1)), Instance::new(2, rotation(2))]);
    let good = world.build(&ours);
    let placed = world.placed(&ours, &good.parts);
    let mut random = SplitMix64::new(3);
    let noise: Vec<u32> = (0..1024).map(|_| random.bits() as u32).collect();
    let buffers =
        [noise, vec![0; 1024], vec![u32::MAX; 1024]].map(|w| device().upload("no structure", &w).expect("memory"));
    let with = |k: usize, j: usize, x: f32| {
        let mut matrix = rotation(3);
        matrix[k][j] = x;
        Instance { transform: matrix, ..placed[0] }
    };
    let of = |transform| Instance { transform, ..placed[0] };
    let mut bad = vec![
        ("a top level", Instance { structure: ours.address(good.top.structure), ..placed[0] }),
        ("noise", Instance { structure: buffers[0].address(), ..placed[0] }),
        ("zeros", Instance { structure: buffers[1].address(), ..placed[0] }),
        ("ones", Instance { structure: buffers[2].address(), ..placed[0] }),
        ("a matrix of zeros", of([[0.0; 4]; 3])),
        ("a matrix of ones", of([[1.0; 4]; 3])),
        ("a plane", of(scaled(rotation(4), [1.0, 1.0, 0.0]))),
        ("a line", of(scaled(Instance::IDENTITY, [0.0, 0.0, 2.0]))),
        ("larger than floats", of(scaled(rotation(5), [3e38; 3]))),
        ("smaller than its inverse can be", of(scaled(Instance::IDENTITY, [1e-40; 3]))),
        ("too far away", of(moved(rotation(6), [3.4e38, 3.4e38, 3.4e38]))),
    ];
    for (name, x) in [("not a number", f32::NAN), ("infinite", f32::INFINITY), ("minus infinite", f32::NEG_INFINITY)] {
        bad.extend((0..12).map(|i| (name, with(i / 4, i % 4, x))));
    }
    let rays = rays(200);
    let expected = ours.probe(good.top.structure, &rays);
    let hits = assert_reports("the good ones alone", &world, &rays, &expected);
    assert!(hits > 60, "{hits} hits are no test");
    for (name, bad) in bad {
        for between in [[bad, placed[0], placed[1]], [placed[0], bad, placed[1]], [placed[0], placed[1], bad]] {
            let position =
                between.iter().position(|i| bytemuck::bytes_of(i) == bytemuck::bytes_of(&bad)).expect("it is there");
            let instances = device().upload("instances", &between).expect("memory");
            let range = Range::default().primitive_count(3);
            let top = top_level(&ours, &instances_at(instances.address(), false), range, world.flags);
            let tree = Tree::<Placed>::from_bytes(&top.memory.read::<u8>(top.bytes as usize)).expect("a structure");
            if let Tree::OfTwo(tree) = &tree {
                tree.validate().unwrap_or_else(|error| panic!("{name}: {error}"));
            }
            assert_eq!(
                (tree.header().active, tree.header().status),
                (2, status::BAD_INSTANCE),
                "{name}, {:?}",
                bad.transform
            );
            for (report, expected) in ours.probe(top.structure, &rays).iter().zip(&expected) {
                let mut got = report.committed;
                got.instance -= u32::from(got.kind != 0 && got.instance as usize > position);
                assert_eq!(got, expected.committed, "{name}, {:?}", bad.transform);
            }
        }
    }
}

/// A structure's bytes after somebody else used its memory.
fn overwritten(bytes: &[u8], how: usize, random: &mut SplitMix64) -> Vec<u8> {
    let header: Header = bytemuck::pod_read_unaligned(&bytes[..size_of::<Header>()]);
    let mut noise = |from: usize, to: usize, bytes: &mut [u8]| bytes[from..to].fill_with(|| random.bits() as u8);
    let mut out = bytes.to_vec();
    let node_bytes = if layout::is_quantised(header.kind) { 80 } else { 64 };
    let (nodes, records) = (NODES_OFFSET as usize, NODES_OFFSET as usize + node_bytes * header.node_slots as usize);
    match how {
        // Nothing is left of it.
        0 => out.fill(0),
        1 => out.fill(0xff),
        2 => noise(0, bytes.len(), &mut out),
        // Only what is no magic or kind.
        3 => noise(0, 8, &mut out),
        // It cannot be used, by its status.
        4 => out[8..12].copy_from_slice(&status::TOO_DEEP.to_le_bytes()),
        // Right magic, kind and counts before noise.
        5 => noise(nodes, bytes.len(), &mut out),
        6 => noise(nodes, records, &mut out),
        7 => noise(16, 48, &mut out),
        // Nodes of another structure: boxes that hold everything, children in circles.
        _ if layout::is_quantised(header.kind) => {
            for (slot, node) in out[nodes..records].chunks_exact_mut(80).enumerate() {
                let others = [slot as u32, 0, (slot as u32 + 7) % header.node_slots, header.node_slots];
                let [first_child, first_record] = [0, 1].map(|side| others[(how + side) % 4]);
                let (which, count) = ([0xFF, 0, 0x5A, 1][how / 4 % 4], 0x0101_0101 * [0, 1, 40, 255][(how + slot) % 4]);
                // Cells of an eighth: 255 of them hold −9 to 9.
                let exponents = 0x7C_7C7C | which << 24;
                let origin = (-9f32).to_bits();
                let head = [origin, origin, origin, exponents, first_child, first_record, count, count];
                let words = head.into_iter().chain([0; 6]).chain([u32::MAX; 6]);
                let bytes: Vec<u8> = words.flat_map(u32::to_le_bytes).collect();
                node.copy_from_slice(&bytes);
            }
        }
        _ => {
            for (slot, node) in out[nodes..records].chunks_exact_mut(64).enumerate() {
                for (side, child) in node.chunks_exact_mut(32).enumerate() {
                    let others = [slot as u32, 0, (slot as u32 + 7) % header.node_slots, header.node_slots];
                    let index = others[(how + side) % 4];
                    let count: u32 = [0, 0, u32::MAX - 1, 40][(how / 4 + slot * side) % 4];
                    let everything = Child { lo: [-9.0; 3], index, hi: [9.0; 3], count };
                    child.copy_from_slice(bytemuck::bytes_of(&everything));
                }
            }
        }
    }
    out
}

const OVERWRITTEN: std::ops::Range<usize> = 0..20;
/// The first of them leave no node: a top level built before knows where the structure begins, and there is nothing.
const NOTHING_LEFT: usize = 2;
/// The first of them leave no header: the structure itself cannot be traced, nor by a top level built over it.
const NO_HEADER: usize = 5;

fn hits_of(reports: &[ProbeReport]) -> usize {
    reports.iter().filter(|report| report.committed.kind != 0).count()
}

/// What makes structures of either form of node.
fn either_form() -> [Ours; 2] {
    [Wide::Never, Wide::Always].map(|wide| Ours::with_options(device(), AccelOptions { wide, ..AccelOptions::DEFAULT }))
}

/// Below a good top level: its instance is empty, or finite somehow; and the other instance is hit as before.
#[test]
fn queries_of_overwritten_bottom_levels_end() {
    either_form().iter().for_each(queries_of_bottom_levels_end);
}

fn queries_of_bottom_levels_end(ours: &Ours) {
    let mut random = SplitMix64::new(11);
    let rays = rays(128);
    for part in [
        Part::Triangles(vec![(soup(200, 0.4, 1), GeometryFlags::OPAQUE), (soup(100, 0.4, 4), GeometryFlags::empty())]),
        Part::Boxes(vec![(boxes(100, 0.3, 2), GeometryFlags::empty())]),
    ] {
        let other = Part::Triangles(vec![(soup(50, 0.4, 3), GeometryFlags::OPAQUE)]);
        let instances = vec![Instance::new(1, rotation(1)), Instance::new(2, rotation(2))];
        let world = World::new(vec![part, other], instances);
        let built = world.build(ours);
        let stale = &built.parts[0];
        let original = stale.memory.read::<u8>(stale.bytes as usize);
        let mut without = world.clone();
        without.instances[0].structure = 0;
        for how in OVERWRITTEN {
            stale.memory.write(&overwritten(&original, how, &mut random));
            let reports = ours.probe(built.top.structure, &rays);
            assert_finite(&format!("overwritten {how}"), &rays, &reports);
            if how < NOTHING_LEFT {
                assert_reports(&format!("overwritten {how}"), &without, &rays, &reports);
            }
            let reports = ours.probe(stale.structure, &rays);
            assert_finite(&format!("itself, overwritten {how}"), &rays, &reports);
            assert!(how >= NO_HEADER || hits_of(&reports) == 0, "itself, overwritten {how}");
            // A top level that is built over it ends, too, and may leave it out or open it.
            for flags in [world.flags, REBRAID] {
                let again = top_level(ours, &built.geometry, Range::default().primitive_count(2), flags);
                let header = again.memory.read::<Header>(1)[0];
                let leaves_it_out = header.status == status::BAD_INSTANCE && (flags == REBRAID || header.active == 1);
                assert!(how >= 4 || leaves_it_out, "overwritten {how}, {flags:?}: {header:?}");
                assert_finite(&format!("built over {how}, {flags:?}"), &rays, &ours.probe(again.structure, &rays));
            }
            stale.memory.write(&original);
        }
        assert_reports("as it was", &world, &rays, &ours.probe(built.top.structure, &rays));
    }
}

/// The records, which hold addresses, stay: nothing can be said of a structure that sends a query to any place.
#[test]
fn queries_of_overwritten_top_levels_end() {
    either_form().iter().for_each(queries_of_top_levels_end);
}

fn queries_of_top_levels_end(ours: &Ours) {
    let mut random = SplitMix64::new(12);
    let part = Part::Triangles(vec![(soup(50, 0.4, 3), GeometryFlags::OPAQUE)]);
    let instances = (0..60).map(|i| Instance::new(1, moved(rotation(i), random.around(1.0)))).collect();
    let world = World::new(vec![part], instances);
    let built = world.build(ours);
    let original = built.top.memory.read::<u8>(built.top.bytes as usize);
    let records = original.len() - 60 * size_of::<Placed>();
    let rays = rays(128);
    for how in OVERWRITTEN {
        let mut bytes = overwritten(&original, how, &mut random);
        bytes[records..].copy_from_slice(&original[records..]);
        built.top.memory.write(&bytes);
        let reports = ours.probe(built.top.structure, &rays);
        assert_finite(&format!("overwritten {how}"), &rays, &reports);
        assert!(how >= NO_HEADER || hits_of(&reports) == 0, "overwritten {how}: {} hits", hits_of(&reports));
    }
}

/// One of them goes on whenever the other has a candidate, into a good structure or one that was overwritten: the other reports what it
/// reports alone.
#[test]
fn two_queries_of_an_invocation_leave_each_other_alone() {
    either_form().iter().for_each(leave_each_other_alone);
}

fn leave_each_other_alone(ours: &Ours) {
    let mut random = SplitMix64::new(13);
    let rays = rays(128);
    let part = Part::Triangles(vec![(soup(300, 0.6, 1), GeometryFlags::empty())]);
    let world = World::new(vec![part.clone(), part], vec![Instance::new(1, rotation(1))]);
    let built = world.build(ours);
    let (top, other) = (ours.address(built.top.structure), &built.parts[1]);
    let alone = ours.probe(built.top.structure, &rays);
    let waited = alone.iter().filter(|report| report.candidate_count > 1).count();
    assert!(waited > 40, "{waited} rays had candidates to decide on");
    let probe = Probe::beside_another(device());
    let original = other.memory.read::<u8>(other.bytes as usize);
    let mut met = 0;
    for how in std::iter::once(None).chain(OVERWRITTEN.map(Some)) {
        let bytes = how.map_or_else(|| original.clone(), |how| overwritten(&original, how, &mut random));
        other.memory.write(&bytes);
        let reports = probe.ask_told(top, ours.address(other.structure), &rays);
        for (i, (report, expected)) in reports.iter().zip(&alone).enumerate() {
            met += report.opaque_boxes;
            let report = ProbeReport { opaque_boxes: expected.opaque_boxes, ..*report };
            assert_eq!(report, *expected, "the other structure overwritten {how:?}, ray {i}");
        }
        assert!(how.is_some() || met > 0, "the other query meets nothing");
    }
}
