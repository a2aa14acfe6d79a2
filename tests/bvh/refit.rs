//! Refits on the device are those of the host, byte for byte, and what comes out is a tree of the moved primitives.

use crate::common::corpus::unit_floats;
use crate::common::geometries::{MOVED, Owned};
use crate::common::probe::{self, Probe, ProbeRay};
use crate::common::shapes::{Corners, hard_rays, soup};
use crate::common::{corpus, device};
use hedgerow::bvh::builder::{self, Builder};
use hedgerow::bvh::codes::Codes;
use hedgerow::bvh::geometry::{Geometry, IndexFormat, Input, Primitives, Source, VertexFormat};
use hedgerow::bvh::layout::{BoxRecord, Bvh2, Child, InstanceRecord, Record, Triangle, status};
use hedgerow::bvh::refit::{Refit, RefitJob, RefitOptions, RefitSchedule};
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin;
use hedgerow::bvh::twin::quality;
use hedgerow::geometry::Aabb;
use hedgerow::gpu::Region;
use hedgerow::trace::tracer::{self, TraceBuffers, TraceShape};
use hedgerow::trace::twin::tracer::closest_hit_by_brute_force;
use hedgerow::trace::{Hit, Query, Ray};
use hedgerow_lab::device::Buffer;
use hedgerow_lab::random::SplitMix64;

const SIZES: [usize; 10] = [0, 1, 2, 3, 8, 9, 64, 65, 1000, 20_000];
const SCHEDULES: [RefitSchedule; 2] = [RefitSchedule::Chain, RefitSchedule::Workgroup];
const GUARD: usize = 256;

/// A structure on the device with its scratch memory, and guards behind both.
struct Placed {
    refit: Refit,
    structure: Buffer<'static>,
    bytes: usize,
    scratch: Buffer<'static>,
}

impl Placed {
    fn new(structure: &[u8], options: &RefitOptions, primitive_count: u32) -> Placed {
        let refit = Refit::new(device(), options, primitive_count).expect("few enough primitives");
        let guarded = |bytes: &[u8]| device().upload("guarded", &[bytes, &[0xa5; GUARD]].concat()).expect("memory");
        let scratch = guarded(&vec![0xa5; refit.scratch_bytes() as usize]);
        Placed { structure: guarded(structure), bytes: structure.len(), scratch, refit }
    }

    fn job(&self, input: &Input) -> RefitJob<'_> {
        RefitJob {
            refit: &self.refit,
            input: *input,
            structure: self.structure.region(),
            scratch: self.scratch.region(),
        }
    }

    fn refit(&self, input: &Input) {
        let (structure, scratch) = (self.structure.region(), self.scratch.region());
        device().run(None, |recorder| self.refit.record(recorder, input, structure, scratch)).expect("it refits");
    }

    /// The structure, if nothing was written behind it and the scratch memory.
    fn read(&self) -> Vec<u8> {
        let mut bytes = self.structure.read::<u8>(self.bytes + GUARD);
        let scratch = self.scratch.read_at::<u8>(self.refit.scratch_bytes(), GUARD);
        assert!(bytes.split_off(self.bytes).iter().chain(&scratch).all(|&b| b == 0xa5), "wrote behind its memory");
        bytes
    }
}

/// A mesh and its buffers.
struct Mesh {
    positions: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    vertices: Buffer<'static>,
    indices: Buffer<'static>,
}

impl Mesh {
    fn new(positions: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>) -> Mesh {
        let vertices = device().upload("positions", &positions).expect("memory");
        let indices = device().upload("indices", &triangles).expect("memory");
        Mesh { positions, triangles, vertices, indices }
    }

    fn random(count: usize) -> Mesh {
        let (_, positions, triangles) = corpus::random("", count, [-0.5; 3], [1.0; 3]);
        Mesh::new(positions, triangles)
    }

    /// The same triangles with other vertices.
    fn moved(&self, to: impl FnMut([f32; 3]) -> [f32; 3]) -> Mesh {
        Mesh::new(self.positions.iter().copied().map(to).collect(), self.triangles.clone())
    }

    fn count(&self) -> u32 {
        self.triangles.len() as u32
    }

    fn input(&self) -> Input {
        let count = self.positions.len() as u32;
        Input::mesh(self.vertices.address(), count, self.indices.address(), self.count())
    }

    fn built(&self, collapse: Collapse) -> Bvh2 {
        twin::lbvh::build(&self.positions, &self.triangles, Codes::for_count(self.count()), collapse)
    }

    fn corners(&self) -> impl Iterator<Item = twin::geometry::Corners> {
        self.triangles.iter().map(|triangle| {
            let vertex = |v: u32| self.positions.get(v as usize).copied().ok_or(status::INDEX_OUT_OF_RANGE);
            let [a, b, c] = triangle.map(vertex);
            let corners = [a?, b?, c?];
            let finite = corners.iter().flatten().all(|x| x.is_finite());
            if finite { Ok(corners.map(|v| v.map(|x| x + 0.0))) } else { Err(status::NON_FINITE) }
        })
    }

    fn refitted(&self, tree: &Bvh2) -> Bvh2 {
        let mut tree = tree.clone();
        twin::refit::refit_corners(&mut tree, self.corners(), Collapse::SAH);
        tree
    }
}

/// Turns and bends, more and more with `t`.
fn bent(t: f32) -> impl FnMut([f32; 3]) -> [f32; 3] {
    move |[x, y, z]| {
        let (sin, cos) = (t * (1.0 + y)).sin_cos();
        [cos * x - sin * z, y + 0.3 * t * (5.0 * x).sin(), sin * x + cos * z]
    }
}

/// Anywhere.
fn scattered(seed: u64) -> impl FnMut([f32; 3]) -> [f32; 3] {
    let mut next = unit_floats(seed);
    move |_| [next(), 3.0 * next(), next() - 7.0]
}

/// Refits `tree` on the device to `mesh` by both schedules: as the host does, and a valid tree.
#[track_caller]
fn assert_as_on_the_host(what: &str, tree: &Bvh2, mesh: &Mesh) -> Bvh2 {
    let expected = mesh.refitted(tree);
    for schedule in SCHEDULES {
        let options = RefitOptions { schedule: Some(schedule), ..RefitOptions::DEFAULT };
        let placed = Placed::new(&tree.to_bytes(), &options, mesh.count());
        placed.refit(&mesh.input());
        let got = Bvh2::<Triangle>::from_bytes(&placed.read()).expect("a structure");
        assert_eq!(got.header, expected.header, "{what} {schedule:?}");
        assert!(got.to_bytes() == expected.to_bytes(), "{what} {schedule:?}: other bytes");
    }
    expected.validate().unwrap_or_else(|error| panic!("{what}: {error}"));
    expected
}

#[track_caller]
fn assert_hits(structure: &Bvh2, rays: &[Ray], expected: &[Hit]) {
    let structure = device().upload("structure", &structure.to_bytes()).expect("memory");
    let ray_buffer = device().upload("rays", rays).expect("memory");
    let hits = device().buffer("hits", size_of_val(expected) as u64).expect("memory");
    let count = rays.len() as u32;
    let buffers = TraceBuffers {
        structure: structure.address(),
        rays: ray_buffer.region(),
        hits: hits.region(),
        work: None,
        count,
    };
    let shape = TraceShape::of(device());
    device().run(None, |r| tracer::record(r, &shape, Query::ClosestHit, &buffers)).expect("it traces");
    assert!(hits.read::<Hit>(rays.len()) == expected);
}

#[test]
fn any_number_of_moved_triangles_is_refitted_as_on_the_host() {
    for count in SIZES {
        let mesh = Mesh::random(count);
        for collapse in [Collapse::SAH, Collapse::OFF] {
            let tree = mesh.built(collapse);
            for (what, moved) in [("bent", mesh.moved(bent(1.0))), ("scattered", mesh.moved(scattered(3)))] {
                let refitted = assert_as_on_the_host(&format!("{what} {count}"), &tree, &moved);
                let records = || tree.records.iter().map(Record::primitive);
                assert!(records().eq(refitted.records.iter().map(Record::primitive)), "the order stays");
                assert_eq!(refitted.header.status, 0);
            }
        }
    }
}

/// They have fewer slots of nodes than triangles need, and a pair stays one.
#[test]
fn trees_over_pairs_are_refitted_as_on_the_host() {
    for side in [1, 5, 60] {
        let (_, positions, triangles) = corpus::sheet(side);
        let (method, codes) =
            (builder::Method::Hploc(builder::Window::DEFAULT), Codes::for_count(triangles.len() as u32));
        let options =
            builder::BuildOptions { method, codes: Some(codes), pairs: true, ..builder::BuildOptions::DEFAULT };
        let mesh = Mesh::new(positions, triangles);
        let tree = twin::build(&options, codes, |finish| twin::pairs::build_corners(mesh.corners(), codes, finish));
        assert!(side == 1 || tree.header.node_slots + 1 < mesh.count(), "nothing is paired");
        for (what, moved) in [("bent", mesh.moved(bent(1.0))), ("scattered", mesh.moved(scattered(3)))] {
            assert_as_on_the_host(&format!("{what} sheet {side}"), &tree, &moved);
        }
    }
}

#[test]
fn unchanged_triangles_leave_every_byte_as_it_was() {
    for (name, positions, triangles) in corpus::meshes() {
        let mesh = Mesh::new(positions, triangles);
        for collapse in [Collapse::SAH, Collapse::OFF] {
            let tree = mesh.built(collapse);
            let again = assert_as_on_the_host(&name, &tree, &mesh);
            assert!(again.to_bytes() == tree.to_bytes(), "{name} {collapse:?}");
        }
    }
}

#[test]
fn hits_after_a_refit_are_those_of_the_moved_triangles() {
    for (count, t) in [(65, 2.0), (1000, 0.2), (1000, 5.0)] {
        let mesh = Mesh::random(count);
        let moved = mesh.moved(bent(t));
        let refitted = assert_as_on_the_host("bent", &mesh.built(Collapse::SAH), &moved);
        // Brute force over a tree that was built of the moved triangles: hits are of rays and triangles alone.
        let fresh = moved.built(Collapse::SAH);
        let corners: Corners = fresh.records.iter().map(|r| [r.v0, r.v1, r.v2]).collect();
        let rays = hard_rays(&corners, 2000, 1.0, [0.0; 3], 5);
        let expected: Vec<Hit> = rays.iter().map(|ray| closest_hit_by_brute_force(&fresh, ray)).collect();
        assert!(expected.iter().filter(|hit| hit.is_some()).count() > 500, "rays hit");
        assert_hits(&refitted, &rays, &expected);
    }
}

#[test]
fn triangles_may_collapse_grow_and_go_far_away() {
    for count in [1, 9, 1000] {
        let mesh = Mesh::random(count);
        for collapse in [Collapse::SAH, Collapse::OFF] {
            let tree = mesh.built(collapse);
            let to_the_origin = assert_as_on_the_host("a point", &tree, &mesh.moved(|_| [0.0; 3]));
            assert_eq!((to_the_origin.header.sah(), to_the_origin.header.sah_growth()), (0.0, 0.0));
            assert_as_on_the_host("negative zeros", &tree, &mesh.moved(|_| [-0.0; 3]));
            assert_as_on_the_host("a plane", &tree, &mesh.moved(|[x, _, z]| [x, 2.0, z]));
            assert_as_on_the_host("tiny", &tree, &mesh.moved(|v| v.map(|x| 1e-30 * x)));
            assert_as_on_the_host("far", &tree, &mesh.moved(|v| v.map(|x| 1e6 + x)));
            assert_as_on_the_host("large", &tree, &mesh.moved(|v| v.map(|x| 1e15 * x)));
        }
    }
}

/// A root that is a leaf, of one triangle or of many.
#[test]
fn identical_triangles_become_different_ones_and_identical_again() {
    for count in [1, 2, 500, 3000] {
        let one = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let indices = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let mesh = Mesh::new(vec![one; count as usize].concat(), indices);
        let tree = mesh.built(Collapse::SAH);
        assert_eq!(tree.header.root.count, count, "the root is a leaf");
        let refitted = assert_as_on_the_host("apart", &tree, &mesh.moved(scattered(7)));
        assert_ne!(refitted.header.root.bounds(), tree.header.root.bounds());
        assert!(assert_as_on_the_host("back", &refitted, &mesh).to_bytes() == tree.to_bytes());
    }
}

#[test]
fn what_cannot_be_met_any_more_is_left_out_until_it_can() {
    for (count, broken) in [(1, 1..2), (9, 3..4), (1000, 2..7), (1000, 0..1), (3000, 1..2)] {
        let mesh = Mesh::random(count);
        // The triangles in `broken` of every ten are not finite, or name a vertex that is not there.
        let is_broken = |primitive: usize| broken.contains(&(primitive % 10)) || count == 1;
        let mut bad = mesh.moved(bent(0.5));
        for primitive in (0..count).filter(|&primitive| is_broken(primitive)) {
            match primitive % 3 {
                0 => bad.positions[3 * primitive][1] = f32::NAN,
                1 => bad.positions[3 * primitive + 2][0] = f32::NEG_INFINITY,
                _ => bad.triangles[primitive][1] = 3 * count as u32,
            }
        }
        let bad = Mesh::new(bad.positions, bad.triangles);
        for collapse in [Collapse::SAH, Collapse::OFF] {
            let tree = mesh.built(collapse);
            let refitted = assert_as_on_the_host("broken", &tree, &bad);
            let wanted = bad.corners().filter_map(Result::err).fold(0, |all, why| all | why);
            assert!(wanted != 0 && refitted.header.status == wanted, "{count} {broken:?}: the status tells");
            assert_eq!(refitted.header.active, tree.header.active);
            for record in &refitted.records {
                let there = bad.corners().nth(record.primitive as usize).expect("a primitive of the input").is_ok();
                assert_eq!(record.is_left_out(), !there, "{record:?}");
            }
            // Rays see the others alone.
            let fresh = bad.built(Collapse::SAH);
            let corners: Corners = bad.corners().flatten().collect();
            let rays = hard_rays(&corners, 300, 1.0, [0.0; 3], 6);
            let expected: Vec<Hit> = rays.iter().map(|ray| closest_hit_by_brute_force(&fresh, ray)).collect();
            assert_hits(&refitted, &rays, &expected);

            let mut back = assert_as_on_the_host("back", &refitted, &mesh);
            assert_eq!(back.header.status, wanted, "what was left out once is told of");
            back.header.status = tree.header.status;
            assert!(back.to_bytes() == tree.to_bytes());
        }
    }
}

#[test]
fn what_the_build_left_out_stays_out() {
    let good = Mesh::random(300);
    let mut positions = good.positions.clone();
    for primitive in [0, 7, 8, 150, 299] {
        positions[3 * primitive + 1][2] = f32::NAN;
    }
    let tree = Mesh::new(positions, good.triangles.clone()).built(Collapse::SAH);
    let refitted = assert_as_on_the_host("good again", &tree, &good);
    assert_eq!((refitted.header.active, refitted.header.status), (295, status::NON_FINITE));
    assert!(refitted.records[295..] == tree.records[295..]);
    let nothing = Mesh::random(40).moved(|_| [f32::NAN; 3]).built(Collapse::SAH);
    assert!(assert_as_on_the_host("nothing", &nothing, &Mesh::random(40)).to_bytes() == nothing.to_bytes());
}

#[test]
fn indices_may_name_other_vertices() {
    let mesh = Mesh::random(1000);
    let mut random = SplitMix64::new(9);
    let triangles = mesh.triangles.iter().map(|t| t.map(|_| (random.bits() % 3000) as u32)).collect();
    let other = Mesh::new(mesh.positions.clone(), triangles);
    let refitted = assert_as_on_the_host("other indices", &mesh.built(Collapse::SAH), &other);
    for record in &refitted.records {
        let expected = other.triangles[record.primitive as usize].map(|v| other.positions[v as usize]);
        assert_eq!([record.v0, record.v1, record.v2], expected);
    }
}

#[test]
fn the_growth_is_that_of_the_sah_cost() {
    for count in [2, 65, 1000, 20_000] {
        let mesh = Mesh::random(count);
        for collapse in [Collapse::SAH, Collapse::OFF] {
            let tree = mesh.built(collapse);
            assert_eq!(tree.header.sah_growth(), 1.0);
            let before = quality::of(&tree, 3.0, 2.0).sah;
            for (is_worse, moved) in [(false, mesh.moved(bent(3.0))), (count > 2, mesh.moved(scattered(1)))] {
                let refitted = assert_as_on_the_host("moved", &tree, &moved);
                let after = quality::of(&refitted, 3.0, 2.0).sah;
                // Sums of thousands of areas in 32 bits against 64.
                let close = |got: f32, expected: f64| (f64::from(got) - expected).abs() <= 1e-4 * expected;
                assert!(close(refitted.header.sah(), after), "{} {after}", refitted.header.sah());
                let growth = refitted.header.sah_growth();
                assert!(close(growth, after / before), "{growth} {after} {before}");
                assert!(!is_worse || growth > 1.2, "{count}: scattering makes it worse, {growth}");
            }
        }
    }
}

#[test]
fn twenty_refits_back_to_the_start_give_the_first_bytes() {
    for count in [65, 20_000] {
        let mesh = Mesh::random(count);
        let tree = mesh.built(Collapse::SAH);
        for schedule in SCHEDULES {
            let options = RefitOptions { schedule: Some(schedule), ..RefitOptions::DEFAULT };
            let placed = Placed::new(&tree.to_bytes(), &options, mesh.count());
            let mut at_the_far_end: Option<Vec<u8>> = None;
            for round in 0..20 {
                // To and fro, the far end every tenth time.
                let t = (5.0 - (round % 10) as f32).abs() / 5.0;
                let moved = mesh.moved(bent(1.0 - t));
                placed.refit(&moved.input());
                if round % 10 == 5 {
                    let bytes = placed.read();
                    assert!(bytes != tree.to_bytes() && *at_the_far_end.get_or_insert_with(|| bytes.clone()) == bytes);
                }
            }
            placed.refit(&mesh.input());
            assert!(placed.read() == tree.to_bytes(), "{count} {schedule:?}");
        }
    }
}

/// The tree with its slots in the opposite order, as far as they may have nodes.
fn turned_round<R: Record>(tree: &Bvh2<R>) -> Bvh2<R> {
    let slots = tree.header.active.max(1) - 1;
    let renamed = |child: &mut Child| {
        if !child.is_leaf() {
            child.index = slots - 1 - child.index;
        }
    };
    let mut tree = tree.clone();
    tree.nodes[..slots as usize].reverse();
    tree.nodes.iter_mut().flat_map(|node| &mut node.children).for_each(renamed);
    if tree.header.active > 0 {
        renamed(&mut tree.header.root);
    }
    tree
}

#[test]
fn compacted_structures_and_those_in_any_order_are_refitted() {
    for count in SIZES {
        let mut mesh = Mesh::random(count);
        for primitive in (0..count).step_by(7) {
            mesh.triangles[primitive][0] = u32::MAX;
        }
        let mesh = Mesh::new(mesh.positions, mesh.triangles);
        let moved = mesh.moved(bent(0.7));
        for collapse in [Collapse::SAH, Collapse::OFF] {
            let tree = mesh.built(collapse);
            let small = tree.compacted();
            assert!(count < 2 || small.to_bytes().len() < tree.to_bytes().len());
            let refitted = assert_as_on_the_host(&format!("compacted {count}"), &small, &moved);
            assert!(refitted.to_bytes() == moved.refitted(&tree).compacted().to_bytes(), "{count}");
            let refitted = assert_as_on_the_host(&format!("turned round {count}"), &turned_round(&tree), &moved);
            assert!(turned_round(&refitted).to_bytes() == moved.refitted(&tree).to_bytes(), "{count}");
        }
    }
}

/// Leaves that one invocation refits, and those that a subgroup shares.
#[test]
fn leaves_of_any_length_are_refitted() {
    let counts = [1, 31, 32, 33, 2, 64, 1000, 7, 100];
    let mut corners = Corners::new();
    for (place, count) in counts.into_iter().enumerate() {
        let x = 10.0 * place as f32;
        corners.extend(vec![[[x, 0.0, 0.0], [x, 1.0, 0.0], [x + 1.0, 0.0, 1.0]]; count]);
    }
    let indices = (0..corners.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let mesh = Mesh::new(corners.iter().flatten().copied().collect(), indices);
    let tree = mesh.built(Collapse::SAH);
    let mut lengths: Vec<u32> =
        tree.nodes.iter().filter(|n| n.is_used()).flat_map(|n| n.children).map(|child| child.count).collect();
    lengths.retain(|&count| count > 0);
    lengths.sort_unstable();
    assert_eq!(lengths, [1, 2, 7, 31, 32, 33, 64, 100, 1000], "piles of the same triangle are leaves");
    assert_as_on_the_host("moved", &tree, &mesh.moved(scattered(2)));
    // One of each pile is left, or none.
    for left in [1, 0] {
        let mut bad = mesh.positions.clone();
        let mut first = 0;
        for count in counts {
            bad[3 * (first + left.min(count))..3 * (first + count)].fill([f32::NAN; 3]);
            first += count;
        }
        let refitted = assert_as_on_the_host("broken", &tree, &Mesh::new(bad, mesh.triangles.clone()));
        assert_eq!(refitted.header.root.bounds(), tree.header.root.bounds(), "{left}");
        let left_out = refitted.records.iter().filter(|record| record.is_left_out()).count();
        assert_eq!(left_out, corners.len() - left * counts.len());
    }
}

#[test]
fn every_format_and_several_geometries_are_refitted_as_on_the_host() {
    let geometry = |i: usize, count: u32, seed: u64| {
        let (vertex_format, index_format) = (VertexFormat::ALL[i % 6], IndexFormat::ALL[i / 6 % 4]);
        let transform = (i % 5 == 1).then_some(MOVED);
        Owned { transform, ..Owned::random(vertex_format, index_format, 4, count, seed) }
    };
    let mut cases: Vec<Vec<[Owned; 2]>> =
        (0..24).map(|i| vec![[geometry(i, 150, i as u64), geometry(i, 150, 100 + i as u64)]]).collect();
    // Several, with empty ones among them; and many.
    let counts = [0, 70, 0, 0, 9, 200, 0];
    let several =
        |i: usize| counts.iter().zip(i..).map(move |(&n, k)| [geometry(k, n, 3), geometry(k, n, 4)]).collect();
    cases.extend([several(0), several(5), several(13)]);
    cases.push((0..100).map(|i| [geometry(i, (i as u32 * 7) % 13, 5), geometry(i, (i as u32 * 7) % 13, 6)]).collect());
    for case in cases {
        let counts: Vec<(u32, u32)> = case.iter().map(|[g, _]| (g.primitive_count, 0)).collect();
        let corners = |which: usize| case.iter().flat_map(move |g| g[which].view().corners().collect::<Vec<_>>());
        let count: u32 = counts.iter().map(|&(count, _)| count).sum();
        let tree = twin::lbvh::build_corners(corners(0), Codes::for_count(count), Collapse::SAH);
        let tree = tree.with_geometries(&counts, 0);
        let mut expected = tree.clone();
        twin::refit::refit_corners(&mut expected, corners(1), Collapse::SAH);
        expected.validate().expect("a valid tree");
        assert!(expected.header.active > 0 && expected.to_bytes() != tree.to_bytes(), "there is something to compare");

        let mut first = 0;
        let (mut records, mut memory) = (Vec::new(), Vec::new());
        for [_, geometry] in &case {
            let (record, buffers) = geometry.upload(first, 1);
            first += geometry.primitive_count;
            records.push(record);
            memory.push(buffers);
        }
        let buffer = device().upload("records", &records).expect("memory");
        let mut sources = vec![Source::Several { records: buffer.address(), count: records.len() as u32 }];
        sources.extend((records.len() == 1).then(|| Source::One(records[0])));
        for source in sources {
            for schedule in SCHEDULES {
                let geometry_count = records.len() as u32;
                let options = RefitOptions { schedule: Some(schedule), geometry_count, ..RefitOptions::DEFAULT };
                let placed = Placed::new(&tree.to_bytes(), &options, count);
                placed.refit(&Input { source, primitive_count: count });
                assert!(placed.read() == expected.to_bytes(), "{source:?} {schedule:?}");
            }
        }
    }
}

fn random_boxes(count: usize, seed: u64) -> Vec<Aabb> {
    let mut random = SplitMix64::new(seed);
    (0..count)
        .map(|i| {
            let (a, b) = (random.around(1.0), random.around(0.1));
            let lo = std::array::from_fn(|k| a[k] - b[k].abs());
            let hi = std::array::from_fn(|k| a[k] + b[k].abs());
            match (seed % 2, i % 50) {
                // Inside out, not a number; both can be in a build and in an update.
                (_, 7) => Aabb { lo: hi, hi: lo },
                (0, 13) => Aabb { lo, hi: [f32::NAN; 3] },
                (1, 20) => Aabb { lo: [f32::NEG_INFINITY; 3], hi },
                _ => Aabb { lo, hi },
            }
        })
        .collect()
}

#[test]
fn boxes_are_refitted_as_on_the_host() {
    for count in SIZES {
        let (given, moved) = (random_boxes(count, 2), random_boxes(count, 3));
        for collapse in [Collapse::SAH, Collapse::OFF] {
            let tree = twin::lbvh::build_aabbs(&given, Codes::for_count(count as u32), collapse);
            let mut expected = tree.clone();
            twin::refit::refit_aabbs(&mut expected, &moved, collapse);
            expected.validate().expect("a valid tree");
            let left_out = expected.records[..tree.header.active as usize].iter().filter(|r| r.is_left_out()).count();
            assert_eq!(left_out > 0, count > 20, "some are left out that were not");
            assert!(expected.records.iter().all(|r| r.primitive < count as u32), "each keeps its primitive");

            // 32 bytes from one to the next; and the same boxes as three geometries.
            let padded: Vec<[f32; 8]> =
                moved.iter().map(|&Aabb { lo: [a, b, c], hi: [d, e, f] }| [a, b, c, d, e, f, f32::NAN, 1.0]).collect();
            let boxes = device().upload("boxes", &padded).expect("memory");
            let firsts = [0, count as u32 / 3, count as u32 / 2];
            let records =
                firsts.map(|first| Geometry { first, ..Geometry::boxes(boxes.address() + 32 * u64::from(first), 32) });
            let several = device().upload("records", &records).expect("memory");
            let flags = [(firsts[1], 0), (firsts[2] - firsts[1], 0), (count as u32 - firsts[2], 0)];
            for (source, counts) in [
                (Source::One(Geometry::boxes(boxes.address(), 32)), &flags[..0]),
                (Source::Several { records: several.address(), count: 3 }, &flags[..]),
            ] {
                for schedule in SCHEDULES {
                    let geometry_count = counts.len().max(1) as u32;
                    let options = RefitOptions {
                        schedule: Some(schedule),
                        primitives: Primitives::Boxes,
                        is_split: false,
                        geometry_count,
                        costs: collapse,
                    };
                    let tree = tree.clone().with_geometries(counts, 0);
                    let placed = Placed::new(&tree.to_bytes(), &options, count as u32);
                    placed.refit(&Input { source, primitive_count: count as u32 });
                    let expected = expected.clone().with_geometries(counts, 0).to_bytes();
                    assert!(placed.read() == expected, "{count} {collapse:?} {source:?} {schedule:?}");
                }
            }
        }
    }
}

/// A leaf with nothing left keeps its box, so rays come to its records.
#[test]
fn rays_do_not_meet_boxes_that_are_left_out() {
    let given: Vec<Aabb> =
        (0..5).map(|i| [4.0 * i as f32, 0.0, 0.0]).map(|lo| Aabb { lo, hi: lo.map(|x| x + 1.0) }).collect();
    let mut broken = given.clone();
    broken[1].lo[2] = f32::NAN;
    (broken[3].lo, broken[3].hi) = (given[3].hi, given[3].lo);
    let ray = ProbeRay { decision: probe::IGNORE, ..ProbeRay::new([-1.0, 0.5, 0.5], [1.0, 0.0, 0.0]) };
    for collapse in [Collapse::SAH, Collapse::OFF] {
        let tree = twin::lbvh::build_aabbs(&given, Codes::for_count(5), collapse);
        let options = RefitOptions { primitives: Primitives::Boxes, costs: collapse, ..RefitOptions::DEFAULT };
        let placed = Placed::new(&tree.to_bytes(), &options, 5);
        let met = || {
            let report = Probe::ours(device()).ask(placed.structure.address(), &[ray])[0];
            report.sorted_candidates().iter().map(|&[_, _, _, primitive]| primitive).collect::<Vec<u32>>()
        };
        for (boxes, expected) in [(&given, &[0, 1, 2, 3, 4][..]), (&broken, &[0, 2, 4]), (&given, &[0, 1, 2, 3, 4])] {
            let memory = device().upload("boxes", boxes).expect("memory");
            placed.refit(&Input { source: Source::One(Geometry::boxes(memory.address(), 24)), primitive_count: 5 });
            assert_eq!(met(), expected, "{collapse:?}");
        }
    }
}

/// An entry of a top level: `Entry` in instances.glsl.
#[derive(Clone, Copy, bytemuck::NoUninit)]
#[repr(C)]
struct Entry {
    lo: [f32; 3],
    instance: u32,
    hi: [f32; 3],
    start: u32,
    slots: u32,
    records: u32,
    given: u64,
    left_out: u32,
    reserved: u32,
}

/// An instance as the caller gives it: `GivenInstance` there.
#[derive(Clone, Copy, bytemuck::NoUninit)]
#[repr(C)]
struct Given {
    to_world: [[f32; 4]; 3],
    index_and_mask: u32,
    offset_and_flags: u32,
    structure: u64,
}

fn world(count: usize, seed: u64, left_out: impl Fn(usize) -> u32) -> (Vec<Entry>, Vec<Given>) {
    let mut random = SplitMix64::new(seed);
    let instance = |i: usize| {
        let (centre, half) = (random.around(9.0), random.around(1.0).map(|x| 0.1 + x.abs()));
        let lo = std::array::from_fn(|k| centre[k] - half[k]);
        let hi = std::array::from_fn(|k| centre[k] + half[k]);
        let [x, y, z] = centre;
        let to_world = [[half[0], 0.3, 0.0, x], [0.0, half[1], 0.1, y], [-0.2, 0.0, half[2], z]];
        let number = (random.bits() % 1000) as u32;
        let entry = Entry {
            lo,
            instance: i as u32,
            hi,
            start: number,
            slots: number % 3,
            records: number % 7,
            given: 0,
            left_out: left_out(i),
            reserved: 0,
        };
        (
            entry,
            Given { to_world, index_and_mask: number, offset_and_flags: !number, structure: 256 * u64::from(number) },
        )
    };
    (0..count).map(instance).unzip()
}

#[test]
fn top_levels_are_refitted_to_their_entries() {
    const INACTIVE: u32 = 1 << 31;
    for count in SIZES {
        let (entries, given) = world(count, 1, |i| if i % 11 == 5 { INACTIVE } else { 0 });
        let (moved, moved_given) = world(count, 2, |i| match i % 11 {
            5 => INACTIVE,
            6 => status::BAD_INSTANCE,
            _ => 0,
        });
        let on_device = |entries: &[Entry], given: &[Given]| {
            let instances = device().upload("instances", given).expect("memory");
            let given = |i: u64| instances.address() + i * size_of::<Given>() as u64;
            let entries: Vec<Entry> = entries.iter().zip(0..).map(|(e, i)| Entry { given: given(i), ..*e }).collect();
            let entries = device().upload("entries", &entries).expect("memory");
            let source = Source::Entries(entries.address());
            (Input { source, primitive_count: count as u32 }, (entries, instances))
        };
        let built = |input: &Input| {
            let options = builder::BuildOptions { primitives: Primitives::Instances, ..builder::BuildOptions::DEFAULT };
            let builder = Builder::new(device(), &options, count as u32).expect("few enough");
            let sizes = builder.sizes();
            let structure = device().buffer("structure", sizes.structure).expect("memory");
            let scratch = device().buffer("scratch", sizes.scratch).expect("memory");
            structure.write(&vec![0u8; sizes.structure as usize]);
            let (at, scratch) = (structure.region(), scratch.region());
            device().run(None, |r| builder.record(r, input, at, scratch)).expect("it builds");
            Bvh2::<InstanceRecord>::from_bytes(&structure.read::<u8>(sizes.structure as usize)).expect("a structure")
        };
        let (input, _memory) = on_device(&entries, &given);
        let (moved_input, _moved_memory) = on_device(&moved, &moved_given);
        let tree = built(&input);
        tree.validate().expect("a valid tree");
        // What a build makes of the moved instances.
        let mut fresh = vec![InstanceRecord::left_out(0); count];
        built(&moved_input).records.iter().for_each(|record| fresh[record.instance as usize] = *record);
        let boxes: Vec<Result<Aabb, u32>> = moved
            .iter()
            .map(|e| if e.left_out == 0 { Ok(Aabb { lo: e.lo, hi: e.hi }) } else { Err(e.left_out & !INACTIVE) })
            .collect();
        let mut expected = tree.clone();
        twin::refit::refit_boxes(&mut expected, &boxes, |instance| fresh[instance as usize], Collapse::SAH);
        assert_eq!(expected.header.status, if count > 6 { status::BAD_INSTANCE } else { 0 });
        for schedule in SCHEDULES {
            let options =
                RefitOptions { schedule: Some(schedule), primitives: Primitives::Instances, ..RefitOptions::DEFAULT };
            let placed = Placed::new(&tree.to_bytes(), &options, count as u32);
            placed.refit(&moved_input);
            assert!(placed.read() == expected.to_bytes(), "{count} {schedule:?}");
            placed.refit(&input);
            let mut back = Bvh2::<InstanceRecord>::from_bytes(&placed.read()).expect("a structure");
            back.header.status = tree.header.status;
            assert!(back.to_bytes() == tree.to_bytes(), "{count} {schedule:?}: back");
        }
    }
}

#[test]
fn refits_of_a_batch_are_those_of_the_host() {
    let meshes: Vec<Mesh> =
        (0..60).map(|i| Mesh::random(if i % 9 == 0 { 5000 + i } else { i * i * 7919 % 300 })).collect();
    let trees: Vec<Bvh2> = meshes.iter().map(|mesh| mesh.built(Collapse::SAH)).collect();
    let moved: Vec<Mesh> = meshes.iter().map(|mesh| mesh.moved(bent(0.4))).collect();
    let placed: Vec<Placed> = trees
        .iter()
        .zip(&meshes)
        .map(|(tree, mesh)| Placed::new(&tree.to_bytes(), &RefitOptions::DEFAULT, mesh.count()))
        .collect();
    let jobs: Vec<RefitJob<'_>> = placed.iter().zip(&moved).map(|(placed, mesh)| placed.job(&mesh.input())).collect();
    let chains = Refit::chains(&jobs).expect("every input is as planned");
    let small = meshes.iter().filter(|mesh| (1..=4096).contains(&mesh.count())).count();
    let large = meshes.iter().filter(|mesh| mesh.count() > 4096).count();
    assert_eq!(chains.len(), large + small.div_ceil(2), "two small ones share a dispatch");
    device().run(None, |recorder| recorder.chains(&chains)).expect("they refit");
    for (i, ((placed, tree), mesh)) in placed.iter().zip(&trees).zip(&moved).enumerate() {
        assert!(placed.read() == mesh.refitted(tree).to_bytes(), "refit {i}");
    }
}

#[test]
fn what_was_not_planned_for_is_left_as_it_is() {
    let mesh = Mesh::random(100);
    let bytes = mesh.built(Collapse::OFF).to_bytes();
    let boxes = twin::lbvh::build_aabbs(&random_boxes(100, 2), Codes::for_count(100), Collapse::OFF).to_bytes();
    let mut no_structure = bytes.clone();
    no_structure[0] ^= 1;
    // Scratch memory for fewer primitives than the structure has; a structure of boxes; none at all.
    let few = mesh.count() - 1;
    for schedule in SCHEDULES {
        let options = RefitOptions { schedule: Some(schedule), ..RefitOptions::DEFAULT };
        for (bytes, count) in [(&bytes, few), (&boxes, 100), (&no_structure, 100)] {
            let placed = Placed::new(bytes, &options, count);
            placed.refit(&Input { primitive_count: count, ..mesh.moved(bent(1.0)).input() });
            assert!(placed.read() == **bytes, "{count} {schedule:?}");
        }
    }
    let refit = Refit::new(device(), &RefitOptions::DEFAULT, 100).expect("few enough");
    const MEMORY: Region = Region::unbounded(256);
    let refused = |input: &Input| refit.steps(input, MEMORY, MEMORY).expect_err("another input").to_string();
    assert!(refused(&Input { primitive_count: 99, ..mesh.input() }).contains("planned for 100 primitives"));
    let several = Source::Several { records: 256, count: 5 };
    assert!(refused(&Input { source: several, ..mesh.input() }).contains("planned for 1 geometries"));
    let entries = Source::Entries(256);
    assert!(refused(&Input { source: entries, ..mesh.input() }).contains("planned for Triangles"));
    let error = Refit::new(device(), &RefitOptions::DEFAULT, (1 << 27) + 1).expect_err("too many").to_string();
    assert!(error.contains("at most 134217728"), "{error}");
}

/// Every record of the tree is that of its primitive, whatever was built.
#[test]
fn records_are_those_of_their_primitives() {
    let corners = soup(500, 0.2, 8);
    let mesh = Mesh::new(
        corners.iter().flatten().copied().collect(),
        (0..500).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
    );
    let moved = mesh.moved(bent(2.0));
    let refitted = assert_as_on_the_host("soup", &mesh.built(Collapse::SAH), &moved);
    for Triangle { v0, v1, v2, primitive } in refitted.records {
        let at = 3 * primitive as usize;
        assert_eq!([v0, v1, v2], moved.positions[at..at + 3]);
    }
}

/// Boxes that are left out are told by their records.
#[test]
fn records_of_what_is_left_out_are_no_others() {
    let zero = Triangle { v0: [0.0; 3], v1: [0.0; 3], v2: [0.0; 3], primitive: 3 };
    assert!(!zero.is_left_out() && Triangle::left_out(3).is_left_out());
    let point = BoxRecord { lo: [1.0; 3], hi: [1.0; 3], primitive: 3 };
    assert!(!point.is_left_out() && BoxRecord::left_out(3).is_left_out());
    assert!(InstanceRecord::left_out(3).is_left_out());
}
