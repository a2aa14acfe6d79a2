//! Trees by heuristics other than the surface area, and with split triangles: valid over every scene that hurts, and traced rightly.

use crate::common::corpus::{self, Mesh};
use crate::common::shapes::{Corners, hard_rays, soup};
use hedgerow::bvh::layout::Bvh2;
use hedgerow::trace::twin::tracer::{closest_hit_by_brute_force, trace};
use hedgerow::trace::{Query, Ray};
use hedgerow_host::bvh::heuristic::{
    InteriorForm, Occlusion, Pinhole, Preferred, PreferredRays, RayDistribution, RaySegment,
};
use hedgerow_host::bvh::{
    BinnedOptions, Heuristic, HostBvhOptions, HostMethod, HostOptimise, SbvhOptions, Termination, TopOptions, build,
    build_by,
};

fn corners_of(mesh: &Mesh) -> Corners {
    let vertex = |v: u32| mesh.1.get(v as usize).copied().unwrap_or_default();
    mesh.2.iter().map(|triangle| triangle.map(vertex)).collect()
}

/// Every heuristic: cameras in the scene, on a corner of its box and far away, and rays that the others are measured by.
fn heuristics<'a>(mesh: &Mesh, segments: &'a [RaySegment], seen: &'a [bool]) -> Vec<Heuristic<'a>> {
    let corner = mesh.1.iter().flatten().copied().find(|x| x.is_finite()).unwrap_or(0.0);
    let pinhole = |eye, look| {
        let camera = Pinhole { eye, look, up: [0.0, 1.0, 0.0], fov: 60.0, aspect: 1.5 };
        Heuristic::Preferred(Preferred::of(PreferredRays::Perspective(camera)))
    };
    vec![
        Heuristic::Interior(InteriorForm::Exact),
        Heuristic::Interior(InteriorForm::HighQuality),
        Heuristic::Interior(InteriorForm::Fast),
        pinhole([0.0; 3], [1.0, 0.2, 0.1]),
        pinhole([corner; 3], [corner + 1.0, 0.0, 0.5]),
        pinhole([1e6, 0.0, 3.0], [0.0; 3]),
        Heuristic::Preferred(Preferred::of(PreferredRays::Parallel([0.0, 0.0, 1.0]))),
        Heuristic::Preferred(Preferred::of(PreferredRays::Spherical([0.1, 0.0, 0.0]))),
        Heuristic::Distribution(RayDistribution::of(segments)),
        Heuristic::Occlusion(Occlusion::of(seen)),
    ]
}

fn segments_of(rays: &[Ray]) -> Vec<RaySegment> {
    let is_sound = |ray: &&Ray| {
        let is_finite = ray.origin.iter().chain(&ray.direction).all(|x| x.is_finite());
        is_finite && ray.t_max >= 0.0 && ray.direction.iter().any(|&x| x != 0.0)
    };
    let segment = |ray: &Ray| RaySegment { from: ray.origin, direction: ray.direction, t_end: ray.t_max, weight: 1.0 };
    rays.iter().filter(is_sound).map(segment).collect()
}

#[track_caller]
fn assert_traced_rightly(tree: &Bvh2, rays: &[Ray], what: &str) {
    tree.validate().unwrap_or_else(|error| panic!("{what}: {error}"));
    for ray in rays {
        let expected = closest_hit_by_brute_force(tree, ray);
        assert_eq!(trace(tree, ray, Query::ClosestHit).0, expected, "{what}, {ray:?}");
    }
}

#[test]
fn trees_by_any_heuristic_are_valid_over_every_scene_that_hurts_and_have_the_hits_of_brute_force() {
    for mesh in corpus::meshes() {
        let rays = hard_rays(&corners_of(&mesh), 20, 1.0, [0.0; 3], 7);
        let segments = segments_of(&rays);
        let seen: Vec<bool> = (0..mesh.2.len()).map(|i| i % 3 == 0).collect();
        for heuristic in heuristics(&mesh, &segments, &seen) {
            // A camera that cannot see is refused, which has tests of its own.
            if heuristic.check(&HostBvhOptions::of(HostMethod::Sweep), mesh.2.len()).is_err() {
                continue;
            }
            for method in [HostMethod::Sweep, HostMethod::Binned(BinnedOptions::WALD)] {
                for termination in [Termination::Sah, Termination::Heuristic] {
                    let options = HostBvhOptions { termination, ..HostBvhOptions::of(method) };
                    let tree = build_by(&heuristic, &mesh.1, &mesh.2, &options).expect("it was checked").tree;
                    assert_traced_rightly(&tree, &rays, &format!("{}, {heuristic:?}, {options:?}", mesh.0));
                }
            }
        }
    }
}

#[test]
fn split_and_rebuilt_trees_are_valid_over_every_scene_that_hurts_and_have_the_hits_of_brute_force() {
    let tops = [2, 16].map(|subtrees| HostOptimise::Top(TopOptions { subtrees }));
    for mesh in corpus::meshes() {
        let rays = hard_rays(&corners_of(&mesh), 20, 1.0, [0.0; 3], 7);
        for method in [HostMethod::Sbvh(SbvhOptions { alpha: 0.0, ..SbvhOptions::PAPER }), HostMethod::Sweep] {
            for optimise in [HostOptimise::Off, tops[0], tops[1]] {
                let options = HostBvhOptions { optimise, ..HostBvhOptions::of(method) };
                let tree = build(&mesh.1, &mesh.2, &options).expect("sound options").tree;
                assert_traced_rightly(&tree, &rays, &format!("{}, {options:?}", mesh.0));
            }
        }
    }
}

#[test]
fn a_heuristic_is_refused_by_methods_that_have_none() {
    let mesh = corpus::soup("", soup(10, 0.3, 5));
    let by = Heuristic::Interior(InteriorForm::Exact);
    let options = HostBvhOptions::of(HostMethod::Sbvh(SbvhOptions::PAPER));
    let error = build_by(&by, &mesh.1, &mesh.2, &options).expect_err("it has none").to_string();
    assert!(error.contains("take Sweep or Binned"), "{error}");
}
