use super::*;
use crate::bvh::binned::BinnedAxes;
use crate::bvh::{
    AacOptions, BinnedOptions, BonsaiOptions, HostBvhOptions, HostMethod, HostOptimise, IncrementalOptions,
    InsertionOptions, Termination, build_aabbs,
};
use std::time::Instant;

/// Numbers from 0 to 1 that look random.
pub(super) struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Random {
        Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x5555_5555_5555_5555)
    }

    pub fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1 << 24) as f32
    }
}

/// The boxes of triangles whose corners are anywhere in a cube, as in section 4.4 of the thesis.
pub(in crate::bvh) fn random_triangles(count: usize, seed: u64) -> Vec<Aabb> {
    let mut random = Random::new(seed);
    let mut corner = || [0; 3].map(|_| random.next());
    (0..count).map(|_| Aabb::around(&[corner(), corner(), corner()])).collect()
}

fn cost_by(method: HostMethod, boxes: &[Aabb], costs: &Collapse) -> f32 {
    let of_method = HostBvhOptions { collapse: *costs, ..HostBvhOptions::of(method) };
    let single = HostBvhOptions { termination: Termination::Single, ..of_method };
    let optimised = HostBvhOptions { optimise: HostOptimise::Insertion(InsertionOptions::PAPER), ..of_method };
    let of = |options| build_aabbs(boxes, &options).expect("sound options").tree.header.cost;
    [of_method, single, optimised].map(of).into_iter().fold(f32::INFINITY, f32::min)
}

fn sweep_cost(boxes: &[Aabb], costs: &Collapse) -> f32 {
    let options = HostBvhOptions { collapse: *costs, ..HostBvhOptions::of(HostMethod::Sweep) };
    build_aabbs(boxes, &options).expect("sound options").tree.header.cost
}

fn costs() -> [Collapse; 3] {
    [Collapse::SAH, Collapse::OFF, Collapse { c_t: 1.0, c_i: 1.0, ..Collapse::SAH }]
}

/// The costs of all trees by sorted planes, one after the other.
fn all_costs(boxes: &[(usize, Aabb)], costs: &Collapse, scale: f32) -> Vec<f64> {
    let around = boxes.iter().fold(Aabb::EMPTY, |all, b| all.union(&b.1));
    let area = f64::from(around.scaled_half_area(scale));
    let mut all = Vec::new();
    if boxes.len() == 1 || costs.enabled {
        all.push(f64::from(costs.c_i) * area * boxes.len() as f64);
    }
    for axis in 0..3 {
        let mut sorted = boxes.to_vec();
        sorted.sort_by(|(i, a), (j, b)| (a.lo[axis] + a.hi[axis]).total_cmp(&(b.lo[axis] + b.hi[axis])).then(i.cmp(j)));
        for at in 1..boxes.len() {
            let (left, right) = (all_costs(&sorted[..at], costs, scale), all_costs(&sorted[at..], costs, scale));
            let both = |l: &f64| right.iter().map(|r| f64::from(costs.c_t) * area + l + r).collect::<Vec<_>>();
            all.extend(left.iter().flat_map(both));
        }
    }
    all
}

#[test]
fn the_optimum_by_planes_is_the_least_of_all_trees_by_planes() {
    for count in 1..=6 {
        for seed in 0..if count == 6 { 5 } else { 20 } {
            let mut boxes = random_triangles(count, seed);
            if seed % 4 == 3 {
                // Equal boxes, and equal centroids.
                boxes[0] = boxes[count - 1];
                boxes[count / 2] = Aabb { lo: [0.4; 3], hi: [0.6; 3] };
            }
            for costs in costs() {
                let Optimum { tree, .. } = of_planes(&boxes, &costs).expect("few boxes");
                tree.validate().expect("valid");
                let numbered: Vec<_> = boxes.iter().copied().enumerate().collect();
                let all = all_costs(&numbered, &costs, tree.header.area_scale);
                let least = all.into_iter().fold(f64::INFINITY, f64::min);
                let cost = f64::from(tree.header.cost);
                assert!((cost - least).abs() <= 1e-6 * least, "{count} boxes, seed {seed}: {cost}, not {least}");
            }
        }
    }
}

#[test]
fn no_tree_of_any_builder_costs_less_than_the_optimum_over_all_bipartitions() {
    let methods = [
        HostMethod::Sweep,
        HostMethod::Binned(BinnedOptions::WALD),
        HostMethod::Binned(BinnedOptions { axes: BinnedAxes::All, ..BinnedOptions::WALD }),
        HostMethod::Aac(AacOptions::HIGH_QUALITY),
        HostMethod::Ploc { radius: 8 },
        HostMethod::Bonsai(BonsaiOptions { mini: 4, prune: Some(0.1) }),
        HostMethod::Incremental(IncrementalOptions::PAPER),
    ];
    for seed in 0..100 {
        let boxes = random_triangles(1 + seed as usize % 12, seed);
        let costs = costs()[seed as usize % 3];
        let least = of_bipartitions(&boxes, &costs).expect("few boxes").tree;
        least.validate().expect("valid");
        let least = least.header.cost;
        let by_planes = of_planes(&boxes, &costs).expect("few boxes").tree.header.cost;
        assert!(least <= by_planes * (1.0 + 1e-5), "seed {seed}: {by_planes} by planes, {least} by any");
        for method in methods {
            let cost = cost_by(method, &boxes, &costs);
            assert!(least <= cost * (1.0 + 1e-5), "seed {seed}, {method:?}: {cost}, the optimum is {least}");
        }
    }
}

#[test]
fn a_greedy_sweep_is_never_cheaper_than_the_optimum_by_planes() {
    let mut ratios = Vec::new();
    for seed in 0..40 {
        let boxes = random_triangles(3 + seed as usize % 14, seed);
        for costs in costs() {
            let least = of_planes(&boxes, &costs).expect("few boxes").tree.header.cost;
            ratios.push(sweep_cost(&boxes, &costs) / least);
        }
    }
    assert!(ratios.iter().all(|&ratio| ratio >= 1.0 - 1e-5), "{ratios:?}");
    assert!(ratios.iter().any(|&ratio| ratio > 1.01), "greedy is as good as that everywhere?");
}

#[test]
fn a_search_over_fifteen_boxes_is_quick() {
    let start = Instant::now();
    for seed in 0..10 {
        of_planes(&random_triangles(15, seed), &Collapse::SAH).expect("few boxes");
    }
    assert!(start.elapsed().as_secs_f64() < 10.0, "ten searches took {:?}", start.elapsed());
}

#[test]
#[ignore = "takes a minute or so; prints how long searches take"]
fn times_of_searches() {
    for count in [5, 8, 11, 15, 20, 25, 30, 40, 50, 64] {
        for costs in costs() {
            let (mut longest, mut sets, mut ratio) = (0.0f64, 0, 0.0f32);
            for seed in 0..3 {
                let boxes = random_triangles(count, seed);
                let start = Instant::now();
                let optimum = of_planes(&boxes, &costs).expect("few boxes");
                longest = longest.max(start.elapsed().as_secs_f64());
                sets = sets.max(optimum.sets);
                ratio += sweep_cost(&boxes, &costs) / optimum.tree.header.cost / 3.0;
            }
            println!("{count} boxes, {costs:?}: {longest:.3} s, {sets} sets, greedy {ratio:.4}");
        }
    }
}

#[test]
fn few_boxes_and_too_many_boxes() {
    for count in 0..3 {
        for search in [of_planes, of_bipartitions] {
            let tree = search(&random_triangles(count, 1), &Collapse::SAH).expect("few boxes").tree;
            tree.validate().expect("valid");
            assert_eq!(tree.records.len(), count);
        }
    }
    let nan = Aabb { lo: [f32::NAN; 3], hi: [1.0; 3] };
    assert_eq!(of_planes(&[nan], &Collapse::SAH).expect("one box").tree.header.active, 0);
    let says = |result: Result<Optimum>| result.expect_err("too many boxes").to_string();
    assert!(says(of_planes(&random_triangles(65, 1), &Collapse::SAH)).contains("take 64 at most"));
    assert!(says(of_bipartitions(&random_triangles(17, 1), &Collapse::SAH)).contains("take 16 at most"));
}

#[test]
fn equal_boxes_far_away_and_tiny_are_searched_as_others_are() {
    for boxes in [
        vec![Aabb { lo: [1.0; 3], hi: [2.0; 3] }; 64],
        vec![Aabb { lo: [3.0; 3], hi: [3.0; 3] }; 20],
        random_triangles(12, 5)
            .iter()
            .map(|b| Aabb { lo: b.lo.map(|x| x * 1e-30), hi: b.hi.map(|x| x * 1e-30) })
            .collect(),
        random_triangles(12, 5)
            .iter()
            .map(|b| Aabb { lo: b.lo.map(|x| x * 1e30), hi: b.hi.map(|x| x * 1e30) })
            .collect(),
    ] {
        let tree = of_planes(&boxes, &Collapse::SAH).expect("few boxes").tree;
        tree.validate().expect("valid");
        assert!(tree.header.cost <= sweep_cost(&boxes, &Collapse::SAH) * (1.0 + 1e-5));
    }
}
