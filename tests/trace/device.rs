//! The tracer on the device: its hits and its work are those of the host, bit for bit.

use crate::common::device;
use crate::common::shapes::{
    Corners, hard_rays, icosphere, no_rays, placed, ray, rays_from_the_middle, rays_with, soup, tree_of, tree_with,
};
use hedgerow::bvh::layout::{Bvh2, status};
use hedgerow::bvh::sah::Collapse;
use hedgerow::gpu::Region;
use hedgerow::trace::tracer::{self, Loads, TraceBuffers, TraceShape};
use hedgerow::trace::twin::tracer as host;
use hedgerow::trace::{Hit, Query, Ray, Work};

/// Every way to cut the work: the default, those for CPUs and that for GPUs, no shared memory at all, and a stack whose levels
/// lie half here and half there.
fn shapes() -> Vec<TraceShape> {
    let limits = &device().limits;
    let loads = Loads::Gathered;
    let mut shapes = vec![
        TraceShape::of(device()),
        TraceShape::subgroups(limits),
        TraceShape::groups(limits),
        TraceShape { workgroup: limits.subgroup_size, shared_levels: 0, rays_each: 1, loads },
        TraceShape { workgroup: 4 * limits.subgroup_size, shared_levels: 3, rays_each: 5, loads },
    ];
    if limits.int64 {
        shapes.push(TraceShape { loads: Loads::InLongs, ..TraceShape::subgroups(limits) });
    }
    if limits.subgroup_is_exact && limits.subgroup_size <= Loads::MAX_LANES {
        shapes.push(TraceShape::lanes(limits));
        shapes.push(TraceShape { shared_levels: 3, rays_each: 5, ..TraceShape::lanes(limits) });
    }
    shapes
}

fn traced(tree: &Bvh2, rays: &[Ray], shape: &TraceShape, query: Query, count_work: bool) -> (Vec<Hit>, Vec<Work>) {
    crate::common::traced(device(), &tree.to_bytes(), rays, count_work, |r, buffers| {
        tracer::record(r, shape, query, buffers)
    })
    .expect("the device traces")
}

#[track_caller]
fn assert_as_on_the_host(tree: &Bvh2, rays: &[Ray]) {
    for query in [Query::ClosestHit, Query::AnyHit] {
        let expected: Vec<(Hit, Work)> = rays.iter().map(|ray| host::trace(tree, ray, query)).collect();
        for shape in shapes() {
            let (hits, work) = traced(tree, rays, &shape, query, true);
            let (alone, _) = traced(tree, rays, &shape, query, false);
            for (i, ray) in rays.iter().enumerate() {
                assert_eq!((hits[i], work[i]), expected[i], "{shape:?} {query:?} {ray:?}");
                match query {
                    Query::ClosestHit => assert_eq!(alone[i], expected[i].0, "{shape:?} {ray:?}"),
                    // Which hit is met first is nobody's business.
                    Query::AnyHit => assert_eq!(alone[i].t, expected[i].0.t, "{shape:?} {ray:?}"),
                }
            }
        }
    }
}

#[test]
fn hits_and_work_are_those_of_the_host_at_any_scale() {
    for (size, scale, far) in
        [(0.3, 1.0, 0.0), (1.0, 1.0, 3.0), (1e-3, 1.0, 1e4), (0.2, 1e-10, 0.0), (0.2, 1e-25, 0.0), (0.2, 1e25, 1.0)]
    {
        let offset = [far * scale, -far * scale, 0.5 * far * scale];
        let corners = placed(&soup(300, size, 5), scale, offset);
        let rays = hard_rays(&corners, 1_000, scale, offset, 11);
        for collapse in [Collapse::SAH, Collapse::OFF] {
            assert_as_on_the_host(&tree_with(&corners, collapse), &rays);
        }
    }
}

#[test]
fn any_number_of_rays_is_traced_and_nothing_behind_them_written() {
    let corners = icosphere(2);
    let tree = tree_of(&corners);
    for count in [0, 1, 2, 7, 8, 9, 63, 64, 65, 1000] {
        assert_as_on_the_host(&tree, &hard_rays(&corners, count, 1.0, [0.0; 3], count as u64));
    }
}

/// A leaf that waits keeps its count beside its index, or in place of its distance.
#[test]
fn leaves_of_any_length_can_wait() {
    let mut corners = Vec::new();
    for (place, count) in [(0.0, 29), (1.0, 30), (2.0, 31), (3.0, 32), (4.0, 33), (5.0, 1000), (6.0, 1)] {
        let triangle = [[place, 0.0, 0.0], [place, 1.0, 0.0], [place, 0.0, 1.0]];
        corners.extend(std::iter::repeat_n(triangle, count));
    }
    let tree = tree_of(&corners);
    let longest =
        tree.nodes.iter().flat_map(|n| n.children).filter(|c| c.is_leaf() && c.count != u32::MAX).map(|c| c.count);
    assert_eq!(longest.max(), Some(1000), "piles of the same triangle are leaves");
    let rays: Vec<Ray> = (0..64)
        .flat_map(|i| {
            let from = 0.25 + 6.5 * i as f32 / 64.0;
            [1.0, -1.0].map(|to| ray([from, 0.25, 0.25], [to, 0.01, 0.01]))
        })
        .collect();
    assert_as_on_the_host(&tree, &rays);
}

#[test]
fn closed_surfaces_do_not_leak() {
    for (scale, offset) in
        [(1.0, [0.0; 3]), (1e-20, [0.0; 3]), (1e20, [0.0; 3]), (1.0, [1e3, -1e4, 1e2]), (1.0, [1e6; 3])]
    {
        let corners = placed(&icosphere(4), scale, offset);
        let rays = rays_from_the_middle(&corners, 20_000, scale, offset);
        let tree = tree_of(&corners);
        let (hits, _) = traced(&tree, &rays, &shapes()[0], Query::ClosestHit, false);
        for (ray, hit) in rays.iter().zip(&hits) {
            assert!(hit.is_some(), "leaks at scale {scale:e}, offset {offset:?}: {ray:?}");
            assert_eq!(*hit, host::closest_hit(&tree, ray), "{ray:?}");
        }
    }
}

#[test]
fn what_is_no_ray_hits_nothing_and_ends() {
    let tree = tree_of(&icosphere(3));
    assert_as_on_the_host(&tree, &no_rays());
    // A device may take a subnormal number for zero, and find out sooner that there is nothing to hit.
    let subnormal = rays_with(1e-40);
    for shape in shapes() {
        let (hits, _) = traced(&tree, &subnormal, &shape, Query::ClosestHit, false);
        for (ray, hit) in subnormal.iter().zip(hits) {
            assert_eq!(hit, host::closest_hit(&tree, ray), "{shape:?} {ray:?}");
        }
    }
}

#[test]
fn limits_are_exclusive() {
    let tree = tree_of(&vec![[[-1.0, -1.0, 2.0], [3.0, -1.0, 2.0], [-1.0, 3.0, 2.0]]]);
    let (below, above) = (2f32.next_down(), 2f32.next_up());
    let ends = [f32::NEG_INFINITY, 0.0, below, 2.0, above, 3.0, f32::INFINITY, f32::NAN];
    let rays: Vec<Ray> = ends
        .iter()
        .flat_map(|&t_min| ends.map(|t_max| Ray { t_min, t_max, ..ray([0.0; 3], [0.0, 0.0, 1.0]) }))
        .collect();
    assert_as_on_the_host(&tree, &rays);
    let (hits, _) = traced(&tree, &rays, &shapes()[0], Query::ClosestHit, false);
    for (ray, hit) in rays.iter().zip(&hits) {
        assert_eq!(hit.is_some(), ray.t_min < 2.0 && 2.0 < ray.t_max, "{ray:?}");
    }
}

#[test]
fn trees_that_are_empty_or_cannot_be_used_have_no_hits() {
    let rays = hard_rays(&icosphere(0), 40, 1.0, [0.0; 3], 1);
    assert_as_on_the_host(&tree_of(&Corners::new()), &rays);
    for bit in [status::TOO_DEEP, status::SPIN_RAN_OUT] {
        let mut tree = tree_of(&icosphere(1));
        tree.header.status |= bit;
        assert_as_on_the_host(&tree, &rays);
        assert!(rays.iter().all(|ray| !host::closest_hit(&tree, ray).is_some()));
    }
}

#[test]
fn of_a_thousand_coincident_triangles_the_first_is_hit() {
    let corners = vec![[[-1.0, -1.0, 3.0], [3.0, -1.0, 3.0], [-1.0, 3.0, 3.0]]; 1000];
    let rays = hard_rays(&corners, 100, 1.0, [0.0; 3], 4);
    for collapse in [Collapse::SAH, Collapse::OFF] {
        let tree = tree_with(&corners, collapse);
        assert_as_on_the_host(&tree, &rays);
        let (hits, _) = traced(&tree, &rays, &shapes()[0], Query::ClosestHit, false);
        assert!(hits.iter().filter(|hit| hit.is_some()).all(|hit| hit.primitive == 0));
    }
}

/// Of calls that are refused before they reach it.
const MEMORY: Region = Region::unbounded(16);

#[test]
fn loads_lane_by_lane_need_a_workgroup_of_one_subgroup() {
    let limits = &device().limits;
    let buffers = TraceBuffers { structure: 16, rays: MEMORY, hits: MEMORY, work: None, count: 0 };
    let shape = TraceShape { workgroup: 2 * limits.subgroup_size, ..TraceShape::lanes(limits) };
    let refused = device().run(None, |recorder| tracer::record(recorder, &shape, Query::ClosestHit, &buffers));
    assert!(refused.expect_err("two subgroups").to_string().contains("lane by lane"));
}

#[test]
fn too_many_rays_are_refused() {
    let buffers = TraceBuffers { structure: 16, rays: MEMORY, hits: MEMORY, work: None, count: (1 << 27) + 1 };
    let refused = device().run(None, |recorder| tracer::record(recorder, &shapes()[0], Query::ClosestHit, &buffers));
    assert!(refused.expect_err("more than 2^27").to_string().contains("134217728"));
}

#[test]
fn too_little_memory_is_refused_by_name() {
    let of = |bytes| Region { address: 16, bytes };
    let (rays, hits, work) = (of(320), of(160), of(120));
    let small = [
        (of(319), hits, work, "memory of rays of 319"),
        (rays, of(159), work, "memory for hits of 159"),
        (rays, hits, of(119), "memory for work of 119"),
    ];
    for (rays, hits, work, expected) in small {
        let buffers = TraceBuffers { structure: 16, rays, hits, work: Some(work), count: 10 };
        let traced = device().run(None, |recorder| tracer::record(recorder, &shapes()[0], Query::ClosestHit, &buffers));
        let refused = traced.expect_err("too little").to_string();
        assert!(refused.contains(expected), "{refused}");
    }
}
