//! kd-trees traced on the device: hits and work are those of the host, bit for bit, whichever the traversal.

use crate::common::device;
use crate::common::probe::ask_kd_tree;
use crate::common::shapes::{
    Corners, hard_rays, icosphere, no_rays, placed, ray, rays_from_the_middle, rays_with, soup, tree_of,
};
use crate::common::{corpus, shapes};
use hedgerow::bvh::layout::status;
use hedgerow::kdtree::layout::{KdContent, KdTree, MAX_DEPTH};
use hedgerow::trace::kd::KdTracer;
use hedgerow::trace::kd::Traversal;
use hedgerow::trace::tracer::{Loads, TraceShape};
use hedgerow::trace::twin::kd as kd_host;
use hedgerow::trace::twin::tracer as host;
use hedgerow::trace::{Hit, Query, Ray, Work};
use hedgerow_host::kdtree::{HostKdOptions, build};
use hedgerow_lab::random::SplitMix64;

const TRAVERSALS: [Traversal; 8] = [
    Traversal::STACK,
    Traversal::RESTART,
    Traversal::PUSH_DOWN,
    Traversal::short_stack(1),
    // The most that lie in registers, and all but the most there are.
    Traversal::short_stack(8),
    Traversal::short_stack(MAX_DEPTH as usize - 1),
    Traversal::short_stack_with_push_down(2),
    Traversal::short_stack_with_push_down(9),
];

/// As is the default here, and cut otherwise: as on GPUs, one ray each, a few rays each.
fn tracers() -> Vec<KdTracer> {
    let limits = &device().limits;
    let loads = Loads::Gathered;
    let others = [
        TraceShape::groups(limits),
        TraceShape { workgroup: limits.subgroup_size, shared_levels: 0, rays_each: 1, loads },
        TraceShape { workgroup: 4 * limits.subgroup_size, shared_levels: 0, rays_each: 5, loads },
    ];
    let pairs = TRAVERSALS.iter().zip(others.iter().cycle());
    pairs.flat_map(|(&t, &shape)| [KdTracer::new(device(), t), KdTracer::with(t, shape)]).collect()
}

fn traversal_of(i: usize) -> Traversal {
    TRAVERSALS[i / 2]
}

fn traced(tree: &[u8], rays: &[Ray], tracer: &KdTracer, query: Query, count_work: bool) -> (Vec<Hit>, Vec<Work>) {
    crate::common::traced(device(), tree, rays, count_work, |r, buffers| tracer.record(r, query, buffers))
        .expect("the device traces")
}

#[track_caller]
fn assert_as_on_the_host(what: &str, tree: &KdTree, rays: &[Ray]) {
    let bytes = tree.to_bytes();
    for query in [Query::ClosestHit, Query::AnyHit] {
        for (n, tracer) in tracers().iter().enumerate() {
            let (hits, work) = traced(&bytes, rays, tracer, query, true);
            let (alone, _) = traced(&bytes, rays, tracer, query, false);
            for (i, ray) in rays.iter().enumerate() {
                let expected = kd_host::trace(tree, ray, query, traversal_of(n));
                assert_eq!((hits[i], work[i]), expected, "{what}: {tracer:?} {query:?} {ray:?}");
                assert_eq!(alone[i], hits[i], "{what}: {tracer:?} {query:?} {ray:?}");
            }
        }
    }
}

/// What must be so however a device rounds: the work may differ where it takes subnormal numbers for zero.
#[track_caller]
fn assert_hits_of_brute_force(what: &str, corners: &Corners, tree: &KdTree, rays: &[Ray]) {
    let (bvh, bytes) = (tree_of(corners), tree.to_bytes());
    let expected: Vec<Hit> = rays.iter().map(|ray| host::closest_hit_by_brute_force(&bvh, ray)).collect();
    for tracer in tracers() {
        let (hits, _) = traced(&bytes, rays, &tracer, Query::ClosestHit, false);
        let (any, _) = traced(&bytes, rays, &tracer, Query::AnyHit, false);
        for (i, ray) in rays.iter().enumerate() {
            assert_eq!(hits[i], expected[i], "{what}: {tracer:?} {ray:?}");
            let t = if expected[i].is_some() { 0.0 } else { f32::INFINITY };
            assert_eq!((any[i].is_some(), any[i].t), (expected[i].is_some(), t), "{what}: {tracer:?} {ray:?}");
        }
    }
}

fn kd_tree_of(corners: &Corners, options: &HostKdOptions) -> KdTree {
    let (_, positions, triangles) = corpus::soup("", corners.clone());
    build(&positions, &triangles, options).expect("a small tree")
}

#[test]
fn hits_and_work_are_those_of_the_host_at_any_scale() {
    for (size, scale, far) in
        [(0.3, 1.0, 0.0), (1.0, 1.0, 3.0), (1e-3, 1.0, 1e4), (0.2, 1e-10, 0.0), (0.2, 1e-20, 0.0), (0.2, 1e25, 1.0)]
    {
        let offset = [far * scale, -far * scale, 0.5 * far * scale];
        let corners = placed(&soup(300, size, 5), scale, offset);
        let rays = hard_rays(&corners, 500, scale, offset, 11);
        for options in [HostKdOptions::EXACT, HostKdOptions::BINNED] {
            assert_as_on_the_host(&format!("scale {scale:e}"), &kd_tree_of(&corners, &options), &rays);
        }
    }
}

#[test]
fn hits_are_those_of_brute_force_at_any_scale() {
    for (size, scale, far) in
        [(0.3, 1.0, 0.0), (0.2, 1e-30, 0.0), (0.2, 1e-25, 0.0), (0.2, 1e30, 1.0), (1e-6, 1.0, 1e6)]
    {
        let offset = [far * scale, -far * scale, 0.5 * far * scale];
        let corners = placed(&soup(200, size, 15), scale, offset);
        let mut rays = hard_rays(&corners, 2000, scale, offset, 16);
        // A device may take subnormal numbers for zero: no distances or directions that are.
        rays.retain(|ray| {
            scale > 1e-28 || (1e-6..2.0).contains(&ray.direction.map(f32::abs).into_iter().fold(0.0, f32::max))
        });
        assert_hits_of_brute_force(
            &format!("scale {scale:e}"),
            &corners,
            &kd_tree_of(&corners, &HostKdOptions::BINNED),
            &rays,
        );
    }
}

#[test]
fn any_number_of_rays_is_traced_and_nothing_behind_them_written() {
    let corners = icosphere(2);
    let tree = kd_tree_of(&corners, &HostKdOptions::EXACT);
    for count in [0, 1, 7, 8, 9, 65, 1000] {
        assert_as_on_the_host("some rays", &tree, &hard_rays(&corners, count, 1.0, [0.0; 3], count as u64));
    }
}

/// Many levels and long ways: what restarts, short stacks and the trail are for.
#[test]
fn deep_trees_are_walked_as_on_the_host() {
    let corners = soup(20_000, 0.02, 41);
    let tree = kd_tree_of(&corners, &HostKdOptions::BINNED);
    assert!(tree.header.depth > 12, "{}", tree.header.depth);
    assert_as_on_the_host("deep", &tree, &hard_rays(&corners, 400, 1.0, [0.0; 3], 42));
}

/// Rays that run in planes of the tree, start there or nearly so, along axes above all: both children at every plane.
#[test]
fn rays_in_planes_are_traced_as_on_the_host() {
    let mut corners = soup(400, 0.2, 51);
    for x in corners.iter_mut().flatten().flatten() {
        *x = (8.0 * *x).round() / 8.0;
    }
    for options in [HostKdOptions::EXACT, HostKdOptions::BINNED] {
        let tree = kd_tree_of(&corners, &options);
        let mut random = SplitMix64::new(52);
        let mut rays = Vec::new();
        for (i, node) in tree.nodes.iter().enumerate() {
            let KdContent::Inner(inner) = node.content() else { continue };
            let mut origin = random.around(1.2);
            origin[inner.axis] = [inner.plane, inner.plane.next_up(), inner.plane.next_down()][i % 3];
            let mut direction = random.around(1.0);
            direction[inner.axis] = [0.0, -0.0, 1e-9, -1e-9][i % 4];
            if i % 5 < 3 {
                direction[(inner.axis + 1) % 3] = [0.0, -0.0, 1e-9][i % 5];
            }
            rays.push(ray(origin, direction));
        }
        rays.truncate(300);
        assert_as_on_the_host("in planes", &tree, &rays);
        assert_hits_of_brute_force("in planes", &corners, &tree, &rays);
    }
}

#[test]
fn every_scene_that_hurts_has_the_hits_of_brute_force() {
    for mesh in corpus::meshes() {
        let (name, corners) = (&mesh.0, crate::common::corners_of(&mesh));
        let b = corners.iter().flatten().flatten().fold(0f32, |m, x| m.max(x.abs()));
        let rays = hard_rays(&corners, 64, if b > 0.0 { b.min(1e37) } else { 1.0 }, [0.0; 3], 5);
        assert_hits_of_brute_force(name, &corners, &kd_tree_of(&corners, &HostKdOptions::BINNED), &rays);
    }
}

#[test]
fn closed_surfaces_do_not_leak() {
    for (n, (scale, offset)) in
        [(1.0, [0.0; 3]), (1e-20, [0.0; 3]), (1e20, [0.0; 3]), (1.0, [1e3, -1e4, 1e2]), (1.0, [1e6; 3])]
            .into_iter()
            .enumerate()
    {
        let corners = placed(&icosphere(4), scale, offset);
        let rays = rays_from_the_middle(&corners, 10_000, scale, offset);
        let tree = kd_tree_of(&corners, &[HostKdOptions::EXACT, HostKdOptions::BINNED][n % 2]);
        let bytes = tree.to_bytes();
        let mut first = None;
        for traversal in TRAVERSALS {
            let tracer = KdTracer::new(device(), traversal);
            let (hits, _) = traced(&bytes, &rays, &tracer, Query::ClosestHit, false);
            for (ray, hit) in rays.iter().zip(&hits) {
                assert!(hit.is_some(), "{traversal:?} leaks at scale {scale:e}, offset {offset:?}: {ray:?}");
            }
            assert_eq!(first.get_or_insert_with(|| hits.clone()), &hits, "{traversal:?} at scale {scale:e}");
        }
    }
}

#[test]
fn what_is_no_ray_hits_nothing_and_ends() {
    let tree = kd_tree_of(&icosphere(3), &HostKdOptions::EXACT);
    assert_as_on_the_host("no rays", &tree, &no_rays());
    assert_hits_of_brute_force("subnormal", &icosphere(3), &tree, &rays_with(1e-40));
}

#[test]
fn hits_at_negative_distances_are_found() {
    let corners = soup(300, 0.3, 11);
    let rays: Vec<Ray> = hard_rays(&corners, 300, 1.0, [0.0; 3], 12)
        .into_iter()
        .map(|ray| Ray { t_min: f32::NEG_INFINITY, ..ray })
        .collect();
    let tree = kd_tree_of(&corners, &HostKdOptions::EXACT);
    assert_as_on_the_host("negative", &tree, &rays);
    assert_hits_of_brute_force("negative", &corners, &tree, &rays);
}

#[test]
fn limits_are_exclusive() {
    let corners = vec![[[-1.0, -1.0, 2.0], [3.0, -1.0, 2.0], [-1.0, 3.0, 2.0]]];
    let tree = kd_tree_of(&corners, &HostKdOptions::EXACT);
    let ends = [f32::NEG_INFINITY, 0.0, 2f32.next_down(), 2.0, 2f32.next_up(), 3.0, f32::INFINITY, f32::NAN];
    let rays: Vec<Ray> = ends
        .iter()
        .flat_map(|&t_min| ends.map(|t_max| Ray { t_min, t_max, ..ray([0.0; 3], [0.0, 0.0, 1.0]) }))
        .collect();
    assert_as_on_the_host("limits", &tree, &rays);
    let (hits, _) = traced(&tree.to_bytes(), &rays, &tracers()[0], Query::ClosestHit, false);
    for (ray, hit) in rays.iter().zip(&hits) {
        assert_eq!(hit.is_some(), ray.t_min < 2.0 && 2.0 < ray.t_max, "{ray:?}");
    }
}

#[test]
fn of_coincident_triangles_the_first_is_hit() {
    let corners = vec![[[-1.0, -1.0, 3.0], [3.0, -1.0, 3.0], [-1.0, 3.0, 3.0]]; 1000];
    let rays = hard_rays(&corners, 100, 1.0, [0.0; 3], 4);
    for options in [HostKdOptions::EXACT, HostKdOptions::BINNED] {
        let tree = kd_tree_of(&corners, &options);
        assert_as_on_the_host("coincident", &tree, &rays);
        let (hits, _) = traced(&tree.to_bytes(), &rays, &tracers()[0], Query::ClosestHit, false);
        assert!(hits.iter().filter(|hit| hit.is_some()).all(|hit| hit.primitive == 0));
    }
}

#[test]
fn trees_that_are_empty_or_cannot_be_used_have_no_hits() {
    let rays = hard_rays(&icosphere(0), 40, 1.0, [0.0; 3], 1);
    assert_as_on_the_host("empty", &kd_tree_of(&Corners::new(), &HostKdOptions::BINNED), &rays);
    for bit in [status::TOO_DEEP, status::SPIN_RAN_OUT, status::WRONG_VERSION] {
        let mut tree = kd_tree_of(&icosphere(1), &HostKdOptions::BINNED);
        tree.header.status |= bit;
        assert_as_on_the_host("unusable", &tree, &rays);
    }
    // Another kind of structure is none of these.
    let bvh = shapes::tree_of(&icosphere(1));
    let (hits, _) = traced(&bvh.to_bytes(), &rays, &tracers()[0], Query::ClosestHit, false);
    assert!(hits.iter().all(|hit| !hit.is_some()));
}

/// Whatever a structure says, a walk reads nothing outside of it and ends.
#[test]
fn walks_of_overwritten_trees_end() {
    let corners = soup(60, 0.2, 61);
    let tree = kd_tree_of(&corners, &HostKdOptions::BINNED);
    let rays = hard_rays(&corners, 64, 1.0, [0.0; 3], 62);
    let mut random = SplitMix64::new(63);
    for _ in 0..20 {
        let mut broken = tree.clone();
        for node in &mut broken.nodes {
            match random.bits() % 4 {
                0 => node.second = random.bits() as u32,
                // Back to the root.
                1 => node.second &= 0xf,
                2 => node.first = random.bits() as u32,
                _ => {}
            }
        }
        for reference in &mut broken.references {
            *reference = random.bits() as u32;
        }
        for traversal in TRAVERSALS {
            traced(&broken.to_bytes(), &rays, &KdTracer::new(device(), traversal), Query::ClosestHit, true);
        }
    }
}

/// A tree in which there is room for more, as a merge leaves it.
#[test]
fn parts_are_found_where_there_is_room_for_more() {
    let corners = soup(200, 0.2, 71);
    let mut tree = kd_tree_of(&corners, &HostKdOptions::EXACT);
    tree.header.node_room += 13;
    tree.header.reference_room += 5;
    tree.header.record_room += 7;
    assert_as_on_the_host("roomy", &tree, &hard_rays(&corners, 200, 1.0, [0.0; 3], 72));
}

/// An engine's shader, with names of its own and ray queries beside.
#[test]
fn shaders_of_others_trace_kd_trees_by_the_header() {
    let corners = soup(500, 0.2, 81);
    let (kd_tree, bvh) = (kd_tree_of(&corners, &HostKdOptions::BINNED), tree_of(&corners));
    let kd_tree = kd_tree.with_geometries(&[(120, 1), (0, 2), (380, 0)]);
    let rays = hard_rays(&corners, 500, 1.0, [0.0; 3], 82);
    let upload = |bytes: &[u8]| device().upload("structure", bytes).expect("memory");
    let (kd_buffer, bvh_buffer) = (upload(&kd_tree.to_bytes()), upload(&bvh.to_bytes()));
    let reports = ask_kd_tree(kd_buffer.address(), bvh_buffer.address(), &rays);
    for (ray, report) in rays.iter().zip(reports) {
        let hit = kd_host::closest_hit(&kd_tree, ray, Traversal::STACK);
        assert_eq!((report.of_kd_tree, report.of_query), (hit, hit), "{ray:?}");
        assert_eq!(report.is_hit == 1, hit.is_some(), "{ray:?}");
        let geometry = [[0, 0, 1], [2, 120, 0]][usize::from(hit.primitive >= 120)];
        assert!(!hit.is_some() || report.geometry == geometry, "{ray:?}: {:?}", report.geometry);
    }
}
