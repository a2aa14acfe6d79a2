//! Builds by heuristics: valid, the same on any number of threads, and by surface area where a heuristic knows of nothing.

use super::distribution::tests::sample;
use super::{
    Heuristic, InteriorForm, Occlusion, Pinhole, Preferred, PreferredRays, RayDistribution, RaySegment, ShadowRays,
};
use crate::bvh::binned::BinnedAxes;
use crate::bvh::bounds::tests as items;
use crate::bvh::{ALONE, BinnedOptions, HostBvhOptions, HostMethod, SbvhOptions, Termination, build_aabbs_by};
use hedgerow::bvh::layout::{BoxRecord, Bvh2};
use hedgerow::bvh::sah::Collapse;
use hedgerow::geometry::Aabb;

/// Boxes of the items that other tests take.
fn boxes(count: u32) -> Vec<Aabb> {
    items::boxes(count).iter().map(|item| item.bounds().aabb()).collect()
}

fn tree(heuristic: &Heuristic<'_>, boxes: &[Aabb], options: &HostBvhOptions) -> Bvh2<BoxRecord> {
    build_aabbs_by(heuristic, boxes, options).expect("options that can be used").tree
}

const METHODS: [HostMethod; 3] = [
    HostMethod::Sweep,
    HostMethod::Binned(BinnedOptions { axes: BinnedAxes::All, ..BinnedOptions::WALD }),
    HostMethod::Sbvh(SbvhOptions::PAPER),
];

/// Up to three boxes that each ray is said to meet, and where those of each end.
fn hits(rays: usize, boxes: usize) -> (Vec<u32>, Vec<u32>) {
    let hits: Vec<Vec<u32>> = (0..rays)
        .map(|ray| {
            let mut hits: Vec<u32> = (0..ray % 4).map(|i| ((7 * ray + 131 * i * i) % boxes) as u32).collect();
            hits.sort_unstable();
            hits.dedup();
            hits
        })
        .collect();
    let end = |end: &mut u32, hits: &Vec<u32>| {
        *end += hits.len() as u32;
        Some(*end)
    };
    (hits.iter().scan(0, end).collect(), hits.concat())
}

fn measures() -> Vec<Heuristic<'static>> {
    let camera = Pinhole { eye: [0.3, 0.4, -0.2], look: [0.6, 0.5, 1.0], up: [0.0, 1.0, 0.0], fov: 60.0, aspect: 1.5 };
    let preferred = [
        PreferredRays::Perspective(camera),
        PreferredRays::Parallel([1.0, -2.0, 0.5]),
        PreferredRays::Spherical([0.5; 3]),
    ];
    let forms = [InteriorForm::Exact, InteriorForm::HighQuality, InteriorForm::Fast];
    let preferred = preferred.map(|rays| Heuristic::Preferred(Preferred::of(rays)));
    forms.map(Heuristic::Interior).into_iter().chain(preferred).collect()
}

#[test]
fn every_heuristic_gives_a_valid_tree_of_its_own() {
    let boxes = boxes(600);
    for method in METHODS {
        for termination in [Termination::Sah, Termination::Heuristic] {
            let options = HostBvhOptions { termination, ..HostBvhOptions::of(method) };
            let by_area = tree(&Heuristic::Sah, &boxes, &options);
            for heuristic in measures() {
                let tree = tree(&heuristic, &boxes, &options);
                tree.validate().unwrap_or_else(|error| panic!("{heuristic:?}, {options:?}: {error}"));
                assert!(tree.to_bytes() != by_area.to_bytes(), "{heuristic:?}, {options:?}");
            }
        }
    }
}

/// Half of the boxes are seen: those whose number has an odd number of bits.
fn seen(count: usize) -> Vec<bool> {
    (0..count).map(|i| i.count_ones() % 2 == 1).collect()
}

#[test]
fn rays_and_seen_primitives_give_valid_trees_the_same_on_any_number_of_threads() {
    let boxes = boxes(2 * ALONE as u32);
    let (rays, seen) = (sample(9_000), seen(boxes.len()));
    let (ends, hits) = hits(rays.len(), boxes.len());
    let by_rays = Heuristic::Distribution(RayDistribution::of(&rays));
    let by_shadows = Heuristic::Shadow(ShadowRays { segments: &rays, ends: &ends, hits: &hits, weight: 0.9 });
    let complete = Heuristic::OcclusionComplete(Occlusion::of(&seen));
    for heuristic in [by_rays, by_shadows, Heuristic::Occlusion(Occlusion::of(&seen)), complete] {
        for method in METHODS {
            if heuristic.check(&HostBvhOptions::of(method), boxes.len()).is_err() {
                assert_eq!(heuristic, complete);
                continue;
            }
            for termination in [Termination::Sah, Termination::Heuristic] {
                let options = HostBvhOptions { termination, ..HostBvhOptions::of(method) };
                let tree_on = |threads| {
                    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
                    pool.install(|| tree(&heuristic, &boxes, &options))
                };
                let one = tree_on(1);
                one.validate().unwrap_or_else(|error| panic!("{method:?}, {termination:?}: {error}"));
                assert!(one.to_bytes() == tree_on(3).to_bytes(), "{method:?}, {termination:?}");
                let by_area = tree(&Heuristic::Sah, &boxes, &options);
                assert!(one.to_bytes() != by_area.to_bytes(), "{method:?}, {termination:?}");
            }
        }
    }
}

#[test]
fn a_heuristic_that_knows_of_nothing_gives_the_bytes_of_the_surface_area() {
    let boxes = boxes(700);
    let elsewhere = [RaySegment { from: [9.0; 3], direction: [1.0, 0.0, 0.0], t_end: f32::INFINITY, weight: 1.0 }; 3];
    let (all, none) = ([true; 700], [false; 700]);
    let heuristics = [
        Heuristic::Distribution(RayDistribution::of(&[])),
        Heuristic::Distribution(RayDistribution::of(&elsewhere)),
        Heuristic::Occlusion(Occlusion::of(&all)),
        Heuristic::Occlusion(Occlusion::of(&none)),
        Heuristic::Shadow(ShadowRays { segments: &[], ends: &[], hits: &[], weight: 0.9 }),
        Heuristic::Shadow(ShadowRays { segments: &elsewhere, ends: &[0; 3], hits: &[], weight: 0.9 }),
        Heuristic::OcclusionComplete(Occlusion::of(&all)),
        Heuristic::OcclusionComplete(Occlusion::of(&none)),
    ];
    for method in METHODS {
        for termination in [Termination::Sah, Termination::Single, Termination::Heuristic] {
            let options = HostBvhOptions { termination, ..HostBvhOptions::of(method) };
            let by_area = tree(&Heuristic::Sah, &boxes, &options).to_bytes();
            for heuristic in
                heuristics.iter().filter(|heuristic| heuristic.check(&HostBvhOptions::of(method), 700).is_ok())
            {
                assert!(tree(heuristic, &boxes, &options).to_bytes() == by_area, "{method:?}, {termination:?}");
            }
        }
    }
}

/// How many nodes and leaves these rays meet, whatever they hit.
fn visits(tree: &Bvh2<BoxRecord>, rays: &[RaySegment]) -> usize {
    let meets = |bounds: &Aabb, ray: &RaySegment| {
        let (mut near, mut far) = (0.0, f64::from(ray.t_end));
        for k in 0..3 {
            let at = [bounds.lo[k], bounds.hi[k]].map(|x| f64::from(x - ray.from[k]) / f64::from(ray.direction[k]));
            (near, far) = (f64::max(near, at[0].min(at[1])), f64::min(far, at[0].max(at[1])));
        }
        near <= far
    };
    let visits_of = |ray: &RaySegment| {
        let (mut visits, mut next) = (0, vec![tree.header.root]);
        while let Some(child) = next.pop() {
            visits += 1;
            if !child.is_leaf() {
                let children = tree.nodes[child.index as usize].children;
                next.extend(children.into_iter().filter(|child| meets(&child.bounds(), ray)));
            }
        }
        visits
    };
    rays.iter().map(visits_of).sum()
}

#[test]
fn rays_like_those_of_the_sample_meet_fewer_nodes() {
    let boxes = boxes(3_000);
    let rays = sample(4_000);
    let (known, others) = rays.split_at(3_000);
    for method in METHODS {
        let options = HostBvhOptions { collapse: Collapse::OFF, ..HostBvhOptions::of(method) };
        let visits_of = |heuristic: Heuristic<'_>| visits(&tree(&heuristic, &boxes, &options), others);
        let [by_rays, by_area] = [Heuristic::Distribution(RayDistribution::of(known)), Heuristic::Sah].map(visits_of);
        assert!(by_rays < by_area, "{method:?}: {by_rays}, by area {by_area}");
    }
}

#[test]
fn what_hides_much_is_split_off_first() {
    // Twelve boxes along x. The four on the left are seen; by area they would be split in the middle.
    let at = |i: u32| Aabb { lo: [i as f32, 0.0, 0.0], hi: [i as f32 + 0.9, 1.0, 1.0] };
    let boxes: Vec<Aabb> = (0..12).map(at).collect();
    let seen: Vec<bool> = (0..12).map(|i| i < 4).collect();
    let options = HostBvhOptions { collapse: Collapse::OFF, ..HostBvhOptions::of(HostMethod::Sweep) };
    let left_edge_of_right = |heuristic: Heuristic<'_>| {
        let tree = tree(&heuristic, &boxes, &options);
        tree.nodes[tree.header.root.index as usize].children[1].lo[0]
    };
    assert_eq!(left_edge_of_right(Heuristic::Sah), 6.0);
    assert_eq!(left_edge_of_right(Heuristic::Occlusion(Occlusion::of(&seen))), 4.0);
}

#[test]
fn how_large_a_scene_is_changes_no_split() {
    let (boxes, rays) = (boxes(500), sample(2_000));
    // Scenes of these sizes are scaled before they are built.
    for scale in [1.0 / (1u64 << 60) as f32, (1u64 << 60) as f32] {
        let scaled = |v: [f32; 3]| v.map(|x| x * scale);
        let large: Vec<Aabb> = boxes.iter().map(|b| Aabb { lo: scaled(b.lo), hi: scaled(b.hi) }).collect();
        let large_rays: Vec<RaySegment> =
            rays.iter().map(|ray| RaySegment { from: scaled(ray.from), t_end: ray.t_end * scale, ..*ray }).collect();
        let of_rays = |rays| Heuristic::Distribution(RayDistribution::of(rays));
        let large_of = |heuristic: Heuristic<'static>| match heuristic {
            Heuristic::Preferred(rays) => Heuristic::Preferred(rays.scaled(scale)),
            other => other,
        };
        let pairs = measures().into_iter().map(|heuristic| (heuristic, large_of(heuristic)));
        for (heuristic, of_large) in pairs.chain([(of_rays(&rays), of_rays(&large_rays))]) {
            for method in METHODS {
                let shape = |heuristic, boxes: &[Aabb]| {
                    let tree = tree(heuristic, boxes, &HostBvhOptions::of(method));
                    let children = tree.nodes.iter().flat_map(|node| node.children.map(|c| (c.index, c.count)));
                    (children.collect::<Vec<_>>(), tree.records.iter().map(|r| r.primitive).collect::<Vec<_>>())
                };
                assert!(shape(&heuristic, &boxes) == shape(&of_large, &large), "{scale}: {of_large:?}, {method:?}");
            }
        }
    }
}

#[test]
fn a_planar_scene_is_built_by_area_where_rays_begin_inside_it() {
    let flat: Vec<Aabb> = boxes(300)
        .into_iter()
        .map(|Aabb { lo: [x0, y0, _], hi: [x1, y1, _] }| Aabb { lo: [x0, y0, 0.5], hi: [x1, y1, 0.5] })
        .collect();
    for method in METHODS {
        let options = HostBvhOptions::of(method);
        for heuristic in measures() {
            let tree_of = |heuristic| tree(heuristic, &flat, &options).to_bytes();
            let is_by_area = tree_of(&heuristic) == tree_of(&Heuristic::Sah);
            assert_eq!(is_by_area, matches!(heuristic, Heuristic::Interior(_)), "{heuristic:?}");
        }
    }
}

#[test]
fn scenes_of_no_extent_or_none_at_all_have_a_tree() {
    let point = Aabb { lo: [1.0; 3], hi: [1.0; 3] };
    for boxes in [vec![], vec![point], vec![point; 50]] {
        for method in METHODS {
            for heuristic in measures() {
                let tree = tree(&heuristic, &boxes, &HostBvhOptions::of(method));
                tree.validate().unwrap_or_else(|error| panic!("{heuristic:?}: {error}"));
            }
        }
    }
}

#[test]
fn a_method_that_does_not_go_top_down_names_those_that_do() {
    let options = HostBvhOptions::of(HostMethod::Ploc { radius: 10 });
    let heuristic = Heuristic::Interior(InteriorForm::Exact);
    let error = build_aabbs_by(&heuristic, &boxes(3), &options).expect_err("has no splits").to_string();
    assert!(error.contains("Ploc") && error.contains("take Sweep, Binned or Sbvh"), "{error}");
    assert!(build_aabbs_by(&Heuristic::Sah, &boxes(3), &options).is_ok());
    let complete = Heuristic::OcclusionComplete(Occlusion::of(&[true, false, true]));
    let error = build_aabbs_by(&complete, &boxes(3), &HostBvhOptions::of(HostMethod::Sweep)).expect_err("divides");
    assert!(error.to_string().contains("take Sbvh"), "{error}");
}

#[test]
fn the_tree_by_a_heuristic_is_the_same_on_any_number_of_threads() {
    let boxes = boxes(3 * ALONE as u32);
    for method in METHODS {
        for heuristic in [measures()[0], measures()[3]] {
            let bytes = |threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
                pool.install(|| tree(&heuristic, &boxes, &HostBvhOptions::of(method)).to_bytes())
            };
            assert!(bytes(1) == bytes(3), "{heuristic:?}, {method:?}");
        }
    }
}
