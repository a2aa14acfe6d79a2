//! kd-trees traced on the host: by every traversal the hits of brute force, bit for bit.

use crate::common::corpus;
use crate::common::shapes::{Corners, hard_rays, icosphere, placed, ray, rays_from_inside, soup, tree_of};
use hedgerow::bvh::layout::Bvh2;
use hedgerow::kdtree::layout::{KdContent, KdTree};
use hedgerow::trace::kd::Traversal;
use hedgerow::trace::twin::kd as kd_host;
use hedgerow::trace::twin::tracer as host;
use hedgerow::trace::{Hit, Query, Ray};
use hedgerow_host::kdtree::{HostKdOptions, build};
use hedgerow_lab::random::SplitMix64;
use proptest::prelude::*;

const TRAVERSALS: [Traversal; 9] = [
    Traversal::STACK,
    Traversal::RESTART,
    Traversal::PUSH_DOWN,
    Traversal::short_stack(1),
    Traversal::short_stack(2),
    Traversal::short_stack(4),
    Traversal::short_stack_with_push_down(1),
    Traversal::short_stack_with_push_down(2),
    Traversal::short_stack_with_push_down(4),
];

fn kd_tree_of(corners: &Corners, options: &HostKdOptions) -> KdTree {
    let (_, positions, triangles) = corpus::soup("", corners.clone());
    build(&positions, &triangles, options).expect("a small tree")
}

fn assert_hits_of_brute_force(what: &str, bvh: &Bvh2, trees: &[KdTree], rays: &[Ray]) {
    for ray in rays {
        let expected = host::closest_hit_by_brute_force(bvh, ray);
        for (i, tree) in trees.iter().enumerate() {
            for traversal in TRAVERSALS {
                let hit = kd_host::closest_hit(tree, ray, traversal);
                assert_eq!(hit, expected, "{what}, tree {i}, {traversal:?}: {ray:?}");
                let any = kd_host::any_hit(tree, ray, traversal);
                let t = if expected.is_some() { 0.0 } else { f32::INFINITY };
                assert_eq!((any.is_some(), any.t), (expected.is_some(), t), "{what}, tree {i}, {traversal:?}: {ray:?}");
            }
        }
    }
}

fn both(corners: &Corners) -> [KdTree; 2] {
    [HostKdOptions::EXACT, HostKdOptions::BINNED].map(|options| kd_tree_of(corners, &options))
}

/// Rays that start on a plane of the tree, run in it, or nearly so.
fn rays_in_planes(tree: &KdTree, seed: u64) -> Vec<Ray> {
    let mut random = SplitMix64::new(seed);
    let cell = tree.header.cell();
    let mut rays = Vec::new();
    for node in &tree.nodes {
        let KdContent::Inner(inner) = node.content() else { continue };
        let mut origin: [f32; 3] = std::array::from_fn(|i| {
            let part = 0.5 + 0.6 * random.signed();
            (1.0 - part) * cell.lo[i] + part * cell.hi[i]
        });
        origin[inner.axis] = [inner.plane, inner.plane.next_up(), inner.plane.next_down()][rays.len() % 3];
        let mut direction = random.around(1.0);
        if rays.len() % 5 < 3 {
            direction[inner.axis] = [0.0, -0.0, 1e-9][rays.len() % 5];
        }
        if rays.len() % 4 == 0 {
            direction[(inner.axis + 1) % 3] = 0.0;
        }
        rays.push(ray(origin, direction));
        if rays.len() == 200 {
            break;
        }
    }
    rays
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn hits_are_those_of_brute_force(
        count in 1usize..80,
        size in prop_oneof![Just(1.0f32), Just(0.2), Just(1e-3), Just(1e-6)],
        scale in prop_oneof![Just(1.0f32), Just(1e-30), Just(1e-10), Just(1e10), Just(1e30)],
        far in prop_oneof![Just(0.0f32), Just(3.0), Just(1e4), Just(1e6)],
        seed in any::<u64>(),
    ) {
        let offset = [far * scale, -far * scale, 0.5 * far * scale];
        let corners = placed(&soup(count, size, seed), scale, offset);
        let mut rays = hard_rays(&corners, 64, scale, offset, seed);
        let trees = both(&corners);
        rays.extend(rays_in_planes(&trees[0], seed));
        assert_hits_of_brute_force("soup", &tree_of(&corners), &trees, &rays);
    }

    #[test]
    fn degenerate_triangles_change_nothing(count in 1usize..60, seed in any::<u64>()) {
        let mut corners = soup(count, 0.3, seed);
        let mut random = SplitMix64::new(seed);
        for triangle in &mut corners {
            let [a, b, _] = *triangle;
            match random.bits() % 7 {
                0 => *triangle = [a; 3],
                1 => *triangle = [a, b, a],
                2 => triangle[2] = std::array::from_fn(|i| 0.5 * a[i] + 0.5 * b[i]),
                3 => triangle[2] = std::array::from_fn(|i| b[i] + 1e-6 * triangle[2][i]),
                4 => triangle.iter_mut().for_each(|p| p[0] = 0.25),
                5 => triangle.iter_mut().flatten().for_each(|x| *x = (4.0 * *x).round() / 4.0),
                _ => {}
            }
        }
        let copies = corners.clone();
        corners.extend(copies);
        let trees = both(&corners);
        let mut rays = hard_rays(&corners, 64, 1.0, [0.0; 3], seed);
        rays.extend(rays_in_planes(&trees[1], seed));
        assert_hits_of_brute_force("degenerate", &tree_of(&corners), &trees, &rays);
    }
}

#[test]
fn every_scene_that_hurts_has_the_hits_of_brute_force() {
    for mesh in corpus::meshes() {
        let (name, corners) = (&mesh.0, crate::common::corners_of(&mesh));
        let b = corners.iter().flatten().flatten().fold(0f32, |m, x| m.max(x.abs()));
        let rays = hard_rays(&corners, 48, if b > 0.0 { b.min(1e37) } else { 1.0 }, [0.0; 3], 5);
        let trees = both(&corners);
        let in_planes = rays_in_planes(&trees[0], 6).into_iter().take(48);
        let rays: Vec<Ray> = rays.into_iter().chain(in_planes).collect();
        assert_hits_of_brute_force(name, &tree_of(&corners), &trees, &rays);
    }
}

/// From inside, every ray hits exactly the surface; through corners and edges above all.
#[test]
fn closed_surfaces_do_not_leak() {
    let sphere = icosphere(4);
    for (scale, offset) in [
        (1.0, [0.0; 3]),
        (1e-20, [0.0; 3]),
        (1e30, [0.0; 3]),
        (1.0, [1e3, -1e4, 1e2]),
        (1.0, [1e6, 1e6, 1e6]),
        (1e-3, [1.0, 1.0, -1.0]),
    ] {
        let corners = placed(&sphere, scale, offset);
        let trees = both(&corners);
        for (i, ray) in rays_from_inside(&corners, 10_000, scale, offset).into_iter().enumerate() {
            let hits = trees.each_ref().map(|tree| kd_host::closest_hit(tree, &ray, TRAVERSALS[i % TRAVERSALS.len()]));
            assert!(hits[0].is_some() && hits[0] == hits[1], "leaks at scale {scale:e}, offset {offset:?}: {ray:?}");
        }
    }
}

#[test]
fn of_coincident_triangles_the_lower_index_is_hit() {
    let corners = vec![[[-1.0, -1.0, 3.0], [3.0, -1.0, 3.0], [-1.0, 3.0, 3.0]]; 100];
    for tree in both(&corners) {
        let hit = kd_host::closest_hit(&tree, &ray([0.0; 3], [0.1, 0.1, 1.0]), Traversal::STACK);
        assert_eq!((hit.t, hit.primitive), (3.0, 0));
    }
}

#[test]
fn a_hit_counts_strictly_between_t_min_and_t_max() {
    let mut corners = soup(40, 0.1, 3);
    corners.push([[-1.0, -1.0, 2.0], [3.0, -1.0, 2.0], [-1.0, 3.0, 2.0]]);
    let (below, above) = (2f32.next_down(), 2f32.next_up());
    for tree in both(&corners) {
        for (t_min, t_max, hits) in [
            (1.5, f32::INFINITY, true),
            (below, above, true),
            (2.0, 3.0, false),
            (1.5, 2.0, false),
            (2.0, 2.0, false),
            (above, below, false),
            (f32::NAN, 3.0, false),
            (1.5, f32::NAN, false),
        ] {
            for traversal in TRAVERSALS {
                let ray = Ray { t_min, t_max, ..ray([0.0; 3], [0.0, 0.0, 1.0]) };
                let hit = kd_host::closest_hit(&tree, &ray, traversal);
                assert_eq!(hit.is_some(), hits, "{t_min} < 2 < {t_max}");
            }
        }
    }
}

/// From so far away that what a hit is off by is more than the triangles are large: what the cells' own room is no help against.
#[test]
fn rays_from_far_away_have_the_hits_of_brute_force() {
    for corners in [icosphere(4), soup(2000, 0.01, 31)] {
        let (bvh, tree) = (tree_of(&corners), kd_tree_of(&corners, &HostKdOptions::EXACT));
        let mut random = SplitMix64::new(32);
        let mut hits = 0;
        for i in 0..3000 {
            let distance = 10f32.powi(1 + i % 6);
            let origin = random.around(distance);
            let [a, b, c] = corners[random.bits() as usize % corners.len()];
            let part = random.signed().abs();
            let target: [f32; 3] = match i % 3 {
                0 => a,
                1 => std::array::from_fn(|k| part * a[k] + (1.0 - part) * b[k]),
                _ => std::array::from_fn(|k| 0.4 * a[k] + 0.3 * b[k] + 0.3 * c[k]),
            };
            let ray = ray(origin, std::array::from_fn(|k| target[k] - origin[k]));
            let expected = host::closest_hit_by_brute_force(&bvh, &ray);
            hits += usize::from(expected.is_some());
            let hit = kd_host::closest_hit(&tree, &ray, TRAVERSALS[i as usize % TRAVERSALS.len()]);
            assert_eq!(hit, expected, "{ray:?}");
        }
        assert!(hits > 1000, "{hits}");
    }
}

/// The part of the ray behind its origin.
#[test]
fn hits_at_negative_distances_are_found() {
    let corners = soup(300, 0.3, 11);
    let (bvh, trees) = (tree_of(&corners), both(&corners));
    let rays: Vec<Ray> = hard_rays(&corners, 300, 1.0, [0.0; 3], 12)
        .into_iter()
        .map(|ray| Ray { t_min: f32::NEG_INFINITY, ..ray })
        .collect();
    assert_hits_of_brute_force("negative", &bvh, &trees, &rays);
}

#[test]
fn traversals_have_the_names_that_options_take() {
    for (name, traversal) in [
        ("stack", Traversal::STACK),
        ("restart", Traversal::RESTART),
        ("push-down", Traversal::PUSH_DOWN),
        ("short-4", Traversal::short_stack(4)),
        ("short-1-push-down", Traversal::short_stack_with_push_down(1)),
    ] {
        assert_eq!(name.parse(), Ok(traversal));
    }
    for wrong in ["", "Stack", "short", "short-", "short-0", "short-x", "short-2-", "short-99999999999999999999"] {
        assert_eq!(wrong.parse::<Traversal>(), Err(()), "{wrong}");
    }
}

#[test]
fn an_empty_tree_has_no_hits_and_takes_no_work() {
    for tree in both(&Corners::new()) {
        let (hit, work) = kd_host::trace(&tree, &ray([0.0; 3], [1.0; 3]), Query::ClosestHit, Traversal::STACK);
        assert_eq!((hit, work.steps, work.tests, work.leaves), (Hit::NONE, 0, 0, 0));
    }
}

#[test]
fn traversals_visit_the_same_leaves_and_differ_in_steps_as_they_should() {
    let corners = soup(3000, 0.05, 21);
    let tree = kd_tree_of(&corners, &HostKdOptions::EXACT);
    let rays: Vec<Ray> = hard_rays(&corners, 800, 1.0, [0.0; 3], 22);
    let total = |traversal| {
        let works = rays.iter().map(|ray| kd_host::trace(&tree, ray, Query::ClosestHit, traversal).1);
        works.fold([0u64; 3], |sum, w| {
            [sum[0] + u64::from(w.steps), sum[1] + u64::from(w.tests), sum[2] + u64::from(w.leaves)]
        })
    };
    let stack = total(Traversal::STACK);
    for traversal in TRAVERSALS {
        let other = total(traversal);
        assert_eq!(other[1..], stack[1..], "{traversal:?}: tests and leaves");
        assert!(other[0] >= stack[0], "{traversal:?}: {other:?}, with a stack {stack:?}");
    }
    let steps = |traversal| total(traversal)[0];
    let (restart, push_down) = (steps(Traversal::RESTART), steps(Traversal::PUSH_DOWN));
    let short = [1, 2, 4, 8].map(|capacity| steps(Traversal::short_stack(capacity)));
    assert!(push_down < restart && stack[0] < push_down, "{restart} {push_down}");
    assert!(short[0] < restart && short.windows(2).all(|pair| pair[1] <= pair[0]), "{short:?}");
    assert!(steps(Traversal::short_stack_with_push_down(2)) <= short[1]);
    // A tree that halves the scene well looks at a small part of it.
    assert!(stack[1] < 100 * rays.len() as u64, "{stack:?}");
}
