//! The host tracer: its hits are those of brute force, bit for bit, and closed surfaces have no holes.

use crate::common::shapes::{Corners, hard_rays, icosphere, placed, ray, rays_from_inside, soup, tree_of, tree_with};
use hedgerow::bvh::codes::Codes;
use hedgerow::bvh::layout::Bvh2;
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::lbvh;
use hedgerow::trace::twin::tracer as host;
use hedgerow::trace::{Hit, Query, Ray};
use hedgerow_lab::random::SplitMix64;
use proptest::prelude::*;

fn assert_hits_of_brute_force(corners: &Corners, rays: &[Ray]) {
    let trees = [tree_of(corners), tree_with(corners, Collapse::OFF)];
    for ray in rays {
        let expected = host::closest_hit_by_brute_force(&trees[0], ray);
        for tree in &trees {
            assert_eq!(host::closest_hit(tree, ray), expected, "{ray:?}");
            let any = host::any_hit(tree, ray);
            assert_eq!(
                (any.is_some(), any.t),
                (expected.is_some(), if expected.is_some() { 0.0 } else { f32::INFINITY })
            );
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn hits_are_those_of_brute_force(
        count in 1usize..60,
        size in prop_oneof![Just(1.0f32), Just(0.2), Just(1e-3), Just(1e-6)],
        scale in prop_oneof![Just(1.0f32), Just(1e-30), Just(1e-10), Just(1e10), Just(1e30)],
        far in prop_oneof![Just(0.0f32), Just(3.0), Just(1e4), Just(1e6)],
        seed in any::<u64>(),
    ) {
        let offset = [far * scale, -far * scale, 0.5 * far * scale];
        let corners = placed(&soup(count, size, seed), scale, offset);
        assert_hits_of_brute_force(&corners, &hard_rays(&corners, 64, scale, offset, seed));
    }

    #[test]
    fn degenerate_triangles_change_nothing(count in 1usize..40, seed in any::<u64>()) {
        let mut corners = soup(count, 0.3, seed);
        let mut random = SplitMix64::new(seed);
        for triangle in &mut corners {
            let [a, b, _] = *triangle;
            match random.bits() % 6 {
                0 => *triangle = [a; 3],
                1 => *triangle = [a, b, a],
                2 => triangle[2] = std::array::from_fn(|i| 0.5 * a[i] + 0.5 * b[i]),
                // Needles, so thin that their edge functions are nothing but rounding.
                3 => triangle[2] = std::array::from_fn(|i| b[i] + 1e-6 * triangle[2][i]),
                4 => triangle.iter_mut().for_each(|p| p[0] = 0.25),
                _ => {}
            }
        }
        let copies = corners.clone();
        corners.extend(copies);
        assert_hits_of_brute_force(&corners, &hard_rays(&corners, 64, 1.0, [0.0; 3], seed));
    }
}

#[test]
fn of_coincident_triangles_the_lower_index_is_hit() {
    let corners = vec![[[-1.0, -1.0, 3.0], [3.0, -1.0, 3.0], [-1.0, 3.0, 3.0]]; 100];
    for collapse in [Collapse::SAH, Collapse::OFF] {
        let hit = host::closest_hit(&tree_with(&corners, collapse), &ray([0.0; 3], [0.1, 0.1, 1.0]));
        assert_eq!((hit.t, hit.primitive), (3.0, 0));
    }
}

/// From inside, every ray hits exactly the surface; through corners and edges above all.
#[test]
fn closed_surfaces_do_not_leak() {
    let sphere = icosphere(4);
    for (scale, offset) in [
        (1.0, [0.0; 3]),
        (1e-30, [0.0; 3]),
        (1e-20, [0.0; 3]),
        (1e20, [0.0; 3]),
        (1e30, [0.0; 3]),
        (1.0, [1e3, -1e4, 1e2]),
        (1.0, [1e6, 1e6, 1e6]),
        (1e-3, [1.0, 1.0, -1.0]),
    ] {
        let corners = placed(&sphere, scale, offset);
        let tree = tree_of(&corners);
        for ray in rays_from_inside(&corners, 30_000, scale, offset) {
            assert!(host::closest_hit(&tree, &ray).is_some(), "leaks at scale {scale:e}, offset {offset:?}: {ray:?}");
        }
    }
}

#[test]
fn a_hit_counts_strictly_between_t_min_and_t_max() {
    let tree = tree_of(&vec![[[-1.0, -1.0, 2.0], [3.0, -1.0, 2.0], [-1.0, 3.0, 2.0]]]);
    let (below, above) = (2f32.next_down(), 2f32.next_up());
    for (t_min, t_max, hits) in [
        (0.0, f32::INFINITY, true),
        (below, above, true),
        (f32::NEG_INFINITY, above, true),
        (2.0, 3.0, false),
        (0.0, 2.0, false),
        (2.0, 2.0, false),
        (above, below, false),
        (f32::NAN, 3.0, false),
        (0.0, f32::NAN, false),
    ] {
        let ray = Ray { t_min, t_max, ..ray([0.0; 3], [0.0, 0.0, 1.0]) };
        assert_eq!(host::closest_hit(&tree, &ray).is_some(), hits, "{t_min} < 2 < {t_max}");
        assert_eq!(host::any_hit(&tree, &ray).is_some(), hits, "{t_min} < 2 < {t_max}");
    }
}

#[test]
fn t_is_in_units_of_the_direction() {
    let tree = tree_of(&vec![[[-1.0, -1.0, 6.0], [3.0, -1.0, 6.0], [-1.0, 3.0, 6.0]]]);
    for length in [1e-20f32, 0.5, 3.0, 1e20] {
        let hit = host::closest_hit(&tree, &ray([0.0, 0.0, 0.0], [0.0, 0.0, length]));
        assert!((hit.t * length - 6.0).abs() < 1e-5, "{hit:?}");
        // Weights of the corners at (3, −1) and (−1, 3): the origin is a quarter of the way to each.
        assert_eq!((hit.u, hit.v), (0.25, 0.25));
    }
}

#[test]
fn rays_that_are_no_rays_hit_nothing() {
    let tree = tree_of(&icosphere(2));
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for axis in 0..3 {
            let mut broken = ray([0.0; 3], [1.0, 0.5, 0.25]);
            broken.origin[axis] = bad;
            assert_eq!(host::closest_hit(&tree, &broken), Hit::NONE);
            let mut broken = ray([0.0; 3], [1.0, 0.5, 0.25]);
            broken.direction[axis] = bad;
            assert_eq!(host::closest_hit(&tree, &broken), Hit::NONE);
        }
    }
    for length in [0.0, -0.0, 1e-40, 1e38] {
        assert_eq!(host::closest_hit(&tree, &ray([0.0; 3], [length; 3])), Hit::NONE);
    }
}

#[test]
fn an_empty_tree_has_no_hits_and_takes_no_work() {
    let tree: Bvh2 = tree_of(&Corners::new());
    let (hit, work) = host::trace(&tree, &ray([0.0; 3], [1.0; 3]), Query::ClosestHit);
    assert_eq!((hit, work.steps, work.tests), (Hit::NONE, 0, 0));
}

#[test]
fn a_leaf_is_visited_once_and_its_triangles_tested() {
    let corners = soup(300, 0.3, 6);
    let (flat, collapsed) = (tree_with(&corners, Collapse::OFF), tree_of(&corners));
    let mut more_than_one = false;
    for ray in hard_rays(&corners, 200, 1.0, [0.0; 3], 8) {
        // One triangle a leaf.
        let work = host::trace(&flat, &ray, Query::ClosestHit).1;
        assert_eq!(work.leaves, work.tests, "{ray:?}");
        let work = host::trace(&collapsed, &ray, Query::ClosestHit).1;
        assert!(work.leaves <= work.tests, "{ray:?}");
        more_than_one |= work.leaves < work.tests;
    }
    assert!(more_than_one, "a collapsed tree has leaves of several triangles");
}

/// Boxes are widened by a part of their own distance, not of the scene's extent.
#[test]
fn a_far_triangle_does_not_slow_rays() {
    let robust: Codes = "emc64var+robust".parse().expect("codes");
    let built = |corners: &Corners| lbvh::build_corners(corners.iter().copied().map(Ok), robust, Collapse::OFF);
    let near = icosphere(4);
    let rays = hard_rays(&near, 400, 1.0, [0.0; 3], 5);
    // Rays that end before what they would hit meet the same boxes in any order: a box that reaches far seems to be the nearest.
    let alone = built(&near);
    let short = rays.iter().map(|ray| Ray { t_max: ray.t_max.min(0.999 * host::closest_hit(&alone, ray).t), ..*ray });
    let short: Vec<Ray> = short.collect();
    let steps = |tree: &Bvh2| -> f64 {
        short.iter().map(|ray| f64::from(host::trace(tree, ray, Query::ClosestHit).1.steps)).sum::<f64>()
    };
    let without = steps(&alone);
    for e in [10, 20, 40, 60, 100] {
        let far = placed(&vec![near[0]], 1.0, [2f32.powi(e), 0.0, 0.0]);
        let corners: Corners = near.iter().chain(&far).copied().collect();
        let tree = built(&corners);
        let with = steps(&tree);
        // Every ray visits the nodes that it is below.
        let above = tree.nodes.iter().filter(|n| n.is_used() && n.children.iter().any(|c| c.hi[0] > 100.0)).count();
        assert!(above < 8, "2^{e} away: {above} nodes above it");
        let most = 1.01 * without + (above * rays.len()) as f64;
        assert!(with < most, "2^{e} away: {with} steps, {without} without, {above} nodes above it");
        for ray in rays.iter().step_by(10) {
            assert_eq!(host::closest_hit(&tree, ray), host::closest_hit_by_brute_force(&tree, ray), "2^{e}: {ray:?}");
        }
    }
}
