//! Trees by heuristics other than the surface area, and with split triangles: valid over every scene that hurts, and traced rightly.

use crate::common::corpus::{self, Mesh};
use crate::common::shapes::{Corners, hard_rays, soup};
use hedgerow::bvh::layout::Bvh2;
use hedgerow::trace::twin::tracer::{all_hits, closest_hit, closest_hit_by_brute_force, trace, trace_left_first};
use hedgerow::trace::{Hit, Query, Ray, Work};
use hedgerow_host::bvh::heuristic::{
    InteriorForm, Occlusion, Pinhole, Preferred, PreferredRays, RayDistribution, RaySegment, ShadowRays,
};
use hedgerow_host::bvh::{
    BinnedOptions, Heuristic, HostBvhOptions, HostMethod, HostOptimise, SbvhOptions, Termination, TopOptions, build,
    build_by,
};

fn corners_of(mesh: &Mesh) -> Corners {
    let vertex = |v: u32| mesh.1.get(v as usize).copied().unwrap_or_default();
    mesh.2.iter().map(|triangle| triangle.map(vertex)).collect()
}

/// What builders learn of rays, and all that these meet.
struct Sample {
    segments: Vec<RaySegment>,
    ends: Vec<u32>,
    hits: Vec<u32>,
}

impl Sample {
    fn of(rays: Vec<Ray>, tree: &Bvh2) -> Sample {
        let is_sound = |ray: &Ray| {
            let is_finite = ray.origin.iter().chain(&ray.direction).all(|x| x.is_finite());
            is_finite && ray.t_max >= 0.0 && ray.direction.iter().any(|&x| x != 0.0)
        };
        let rays: Vec<Ray> = rays.into_iter().filter(is_sound).collect();
        let segment =
            |ray: &Ray| RaySegment { from: ray.origin, direction: ray.direction, t_end: ray.t_max, weight: 1.0 };
        let (mut ends, mut hits) = (Vec::new(), Vec::new());
        for ray in &rays {
            hits.extend(all_hits(tree, ray));
            ends.push(hits.len() as u32);
        }
        Sample { segments: rays.iter().map(segment).collect(), ends, hits }
    }

    fn shadow(&self) -> Heuristic<'_> {
        Heuristic::Shadow(ShadowRays { segments: &self.segments, ends: &self.ends, hits: &self.hits, weight: 0.9 })
    }
}

/// Every heuristic: cameras in the scene, on a corner of its box and far away, and rays that the others are measured by.
fn heuristics<'a>(mesh: &Mesh, sample: &'a Sample, seen: &'a [bool]) -> Vec<Heuristic<'a>> {
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
        Heuristic::Distribution(RayDistribution::of(&sample.segments)),
        Heuristic::Occlusion(Occlusion::of(seen)),
        Heuristic::OcclusionComplete(Occlusion::of(seen)),
        sample.shadow(),
    ]
}

/// A tree by area.
fn plain(mesh: &Mesh) -> Bvh2 {
    build(&mesh.1, &mesh.2, &HostBvhOptions::of(HostMethod::Sweep)).expect("sound options").tree
}

/// Rays that are hard for a mesh, and what each of them hits of all that is in its plain tree.
fn hard_rays_and_hits(mesh: &Mesh, plain: &Bvh2) -> Vec<(Ray, Hit)> {
    let rays = hard_rays(&corners_of(mesh), 20, 1.0, [0.0; 3], 7);
    rays.into_iter().map(|ray| (ray, closest_hit_by_brute_force(plain, &ray))).collect()
}

#[track_caller]
fn assert_traced_rightly(tree: &Bvh2, rays: &[(Ray, Hit)], what: &str) {
    tree.validate().unwrap_or_else(|error| panic!("{what}: {error}"));
    for (ray, expected) in rays {
        assert_eq!(trace(tree, ray, Query::ClosestHit).0, *expected, "{what}, {ray:?}");
        assert_eq!(trace_left_first(tree, ray).0.is_some(), expected.is_some(), "{what}, {ray:?}");
    }
}

#[test]
fn trees_by_any_heuristic_are_valid_over_every_scene_that_hurts_and_have_the_hits_of_brute_force() {
    for (at, mesh) in corpus::meshes().into_iter().enumerate() {
        let plain = plain(&mesh);
        let rays = hard_rays_and_hits(&mesh, &plain);
        let sample = Sample::of(rays.iter().map(|&(ray, _)| ray).collect(), &plain);
        let seen: Vec<bool> = (0..mesh.2.len()).map(|i| i % 3 == 0).collect();
        for (of, heuristic) in heuristics(&mesh, &sample, &seen).into_iter().enumerate() {
            let methods = [
                HostMethod::Sweep,
                HostMethod::Binned(BinnedOptions::WALD),
                HostMethod::Sbvh(SbvhOptions { alpha: 0.0, ..SbvhOptions::PAPER }),
                HostMethod::Sbvh(SbvhOptions { alpha: 1.0, ..SbvhOptions::PAPER }),
            ];
            for (by, method) in methods.into_iter().enumerate() {
                // Each heuristic and method over half of the scenes; over half of those with either termination.
                let turn = at + of + by;
                if turn % 2 == 1 {
                    continue;
                }
                // A camera that cannot see is refused, and so are rules that divide primitives: both have tests of their own.
                if heuristic.check(&HostBvhOptions::of(method), mesh.2.len()).is_err() {
                    continue;
                }
                let termination = [Termination::Sah, Termination::Heuristic][turn / 2 % 2];
                let options = HostBvhOptions { termination, ..HostBvhOptions::of(method) };
                let tree = build_by(&heuristic, &mesh.1, &mesh.2, &options).expect("it was checked").tree;
                assert_traced_rightly(&tree, &rays, &format!("{}, {options:?}", mesh.0));
            }
        }
    }
}

/// All that a ray meets, by a tree of one triangle after the other.
#[test]
fn all_hits_are_those_of_every_triangle_alone() {
    let mesh = corpus::soup("", soup(60, 0.6, 5));
    let tree = build(&mesh.1, &mesh.2, &HostBvhOptions::of(HostMethod::Sweep)).expect("sound options").tree;
    let of_one = |triangle: &[u32; 3]| {
        build(&mesh.1, &[*triangle], &HostBvhOptions::of(HostMethod::Sweep)).expect("sound options").tree
    };
    let alone: Vec<Bvh2> = mesh.2.iter().map(of_one).collect();
    let mut most = 0;
    for ray in hard_rays(&corners_of(&mesh), 300, 1.0, [0.0; 3], 9) {
        let expected: Vec<u32> =
            (0..60).filter(|&i| closest_hit_by_brute_force(&alone[i as usize], &ray).is_some()).collect();
        assert_eq!(all_hits(&tree, &ray), expected, "{ray:?}");
        most = most.max(expected.len());
    }
    assert!(most > 3, "no ray meets more than {most} triangles");
}

/// Rays to a light behind a wall of many small triangles, with another such wall that few of them meet in front.
#[test]
fn a_tree_for_shadow_rays_is_less_work_for_others_like_them() {
    let mut corners = soup(3_000, 0.15, 3);
    for corner in corners.iter_mut().take(1_500).flatten() {
        corner[2] = 0.05 * corner[2] + 2.0;
    }
    let mesh = corpus::soup("", corners);
    let rays = |seed: u64| -> Vec<Ray> {
        let from = |[x, y, z]: [f32; 3]| Ray {
            origin: [x, y, z],
            t_min: 0.0,
            direction: [0.3 - x, 0.4 - y, 5.0 - z],
            t_max: 1.0,
        };
        soup(500, 0.3, seed).concat().into_iter().map(from).collect()
    };
    let options = HostBvhOptions::of(HostMethod::Sweep);
    let by_area = build(&mesh.1, &mesh.2, &options).expect("sound options").tree;
    let sample = Sample::of(rays(11), &by_area);
    let for_shadows = build_by(&sample.shadow(), &mesh.1, &mesh.2, &options).expect("sound options").tree;
    let others = rays(12);
    let work =
        |of: &dyn Fn(&Ray) -> Work| -> u32 { others.iter().map(of).map(|work| 3 * work.steps + 2 * work.tests).sum() };
    let near_first = work(&|ray| trace(&by_area, ray, Query::AnyHit).1);
    let left_first = work(&|ray| trace_left_first(&for_shadows, ray).1);
    let hit = others.iter().filter(|ray| closest_hit(&by_area, ray).is_some()).count();
    assert!(2 * hit > others.len(), "{hit} of {} rays hit", others.len());
    assert!(10 * left_first < 9 * near_first, "{left_first}, near first by area {near_first}");
    // The walk alone does not do it.
    let left_first_by_area = work(&|ray| trace_left_first(&by_area, ray).1);
    assert!(left_first < left_first_by_area, "{left_first}, by area {left_first_by_area}");
}

#[test]
fn split_and_rebuilt_trees_are_valid_over_every_scene_that_hurts_and_have_the_hits_of_brute_force() {
    let tops = [2, 16].map(|subtrees| HostOptimise::Top(TopOptions { subtrees }));
    for mesh in corpus::meshes() {
        let rays = hard_rays_and_hits(&mesh, &plain(&mesh));
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
    let options = HostBvhOptions::of(HostMethod::Ploc { radius: 10 });
    let error = build_by(&by, &mesh.1, &mesh.2, &options).expect_err("it has none").to_string();
    assert!(error.contains("take Sweep, Binned or Sbvh"), "{error}");
}
