use super::*;
use crate::bvh::binned::{BinnedAxes, Bins};
use crate::bvh::heuristic::{Heuristic, Occlusion};
use crate::bvh::{
    BinnedOptions, HostBvhOptions, HostMethod, HostOptimise, InsertionOptions, Termination, TopOptions, build,
    build_aabbs, build_by,
};
use hedgerow::bvh::layout::{Bvh2, Child, Record, status};
use hedgerow::bvh::reinsertion::ReinsertionOptions;
use hedgerow::bvh::sah::Collapse;
use hedgerow::trace::twin::tracer::{closest_hit, closest_hit_by_brute_force};
use hedgerow::trace::{Hit, Ray};
use std::collections::BTreeSet;

type Corners = Vec<[[f32; 3]; 3]>;

/// Numbers from 0 to 1 that look random.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1 << 24) as f32
    }

    fn point(&mut self) -> [f32; 3] {
        [0; 3].map(|_| self.next())
    }

    fn near(&mut self, p: [f32; 3], size: f32) -> [f32; 3] {
        p.map(|x| x + size * (self.next() - 0.5))
    }
}

fn soup(count: usize, size: f32, seed: u64) -> Corners {
    let mut random = Random(seed);
    let mut triangle = |_| {
        let middle = random.point();
        [0; 3].map(|_| random.near(middle, size))
    };
    (0..count).map(&mut triangle).collect()
}

/// Long and thin, along diagonals.
fn needles(count: usize, seed: u64) -> Corners {
    let mut random = Random(seed);
    let mut needle = |i: usize| {
        let from = random.point();
        let sign = |bit: usize| if i >> bit & 1 == 1 { -0.7 } else { 0.7 };
        let to = [from[0] + sign(0), from[1] + sign(1), from[2] + sign(2)];
        [from, to, random.near(from, 0.01)]
    };
    (0..count).map(&mut needle).collect()
}

/// Many small triangles, and a needle across the scene for every hundred of them.
fn mixed(count: usize, seed: u64) -> Corners {
    let needles = needles(count / 100, seed).into_iter();
    needles.chain(soup(count, 0.01, seed + 1)).collect()
}

/// Two large triangles under many small ones.
fn floor(count: usize, seed: u64) -> Corners {
    let mut corners = soup(count, 0.02, seed);
    corners.push([[-1.0, 0.3, -1.0], [2.0, 0.3, -1.0], [2.0, 0.5, 2.0]]);
    corners.push([[-1.0, 0.3, -1.0], [2.0, 0.5, 2.0], [-1.0, 0.3, 2.0]]);
    corners
}

fn scaled(corners: Corners, scale: f32) -> Corners {
    corners.into_iter().map(|triangle| triangle.map(|corner| corner.map(|x| x * scale))).collect()
}

fn moved(corners: Corners, by: f32) -> Corners {
    corners.into_iter().map(|triangle| triangle.map(|corner| corner.map(|x| x + by))).collect()
}

fn scenes() -> Vec<(&'static str, Corners)> {
    let one = soup(1, 0.4, 3)[0];
    vec![
        ("nothing", Vec::new()),
        ("one", soup(1, 0.4, 3)),
        ("two", soup(2, 0.9, 3)),
        ("three", soup(3, 0.9, 4)),
        ("small", soup(700, 0.05, 5)),
        ("large", soup(300, 0.8, 6)),
        ("needles", needles(400, 7)),
        ("floor", floor(500, 8)),
        ("mixed", mixed(1000, 8)),
        ("equal", vec![one; 100]),
        ("points", vec![[[0.3; 3]; 3]; 40]),
        ("points and needles", needles(50, 9).into_iter().chain((0..30).map(|i| [[0.03 * i as f32; 3]; 3])).collect()),
        ("flat", soup(200, 0.5, 10).into_iter().map(|t| t.map(|[x, y, _]| [x, y, 0.25])).collect()),
        (
            "in a line",
            (0..50).map(|i| [[i as f32, 0.0, 0.0], [i as f32 + 20.0, 0.0, 0.0], [i as f32, 0.0, 0.0]]).collect(),
        ),
        (
            "crossing in one place",
            (0..60)
                .map(|i| {
                    let (s, c) = (i as f32 * 0.3).sin_cos();
                    [[s, c, 0.2 * c], [-s, -c, -0.2 * c], [s, c, 0.2 * c + 0.01]]
                })
                .collect(),
        ),
        ("tiny", scaled(mixed(1000, 11), 1e-9)),
        ("too tiny to split", scaled(mixed(1000, 11), 1e-30)),
        ("huge", scaled(mixed(1000, 12), 1e12)),
        ("too huge to split", scaled(mixed(1000, 12), 1e37)),
        ("far away", moved(mixed(1000, 13), 1e4)),
        ("farther away", moved(needles(200, 13), 1e7)),
    ]
}

fn options() -> Vec<SbvhOptions> {
    let paper = SbvhOptions::PAPER;
    vec![
        paper,
        SbvhOptions { alpha: 0.0, budget: 8.0, ..paper },
        SbvhOptions { alpha: 1e-3, budget: 1.2, bins: 5 },
        SbvhOptions { alpha: 1.0, ..paper },
    ]
}

fn mesh(corners: &Corners) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    (corners.concat(), (0..corners.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
}

fn built(corners: &Corners, options: &HostBvhOptions) -> Bvh2 {
    let (positions, triangles) = mesh(corners);
    build(&positions, &triangles, options).expect("sound options").tree
}

fn by(options: SbvhOptions) -> HostBvhOptions {
    HostBvhOptions::of(HostMethod::Sbvh(options))
}

fn ray_from(origin: [f32; 3], direction: [f32; 3]) -> Ray {
    Ray { origin, t_min: 0.0, direction, t_max: f32::INFINITY }
}

/// Rays to corners, edges and insides of triangles from around the scene, and from inside of it.
fn rays(corners: &Corners, count: usize, seed: u64) -> Vec<Ray> {
    let mut random = Random(seed);
    let scene = corners.iter().fold(Aabb::EMPTY, |b, c| b.union(&Aabb::around(c)));
    if corners.is_empty() {
        return vec![ray_from([0.0; 3], [1.0, 0.0, 0.0])];
    }
    let extent = scene.extent().into_iter().fold(0.0, f32::max);
    let mut ray = |i: usize| {
        let triangle = corners[(random.next() * corners.len() as f32) as usize % corners.len()];
        let weights = match i % 4 {
            0 => [1.0, 0.0, 0.0],
            1 => [0.5, 0.5, 0.0],
            _ => {
                let [a, b, c] = random.point();
                [a, b, c].map(|x| x / (a + b + c).max(1e-3))
            }
        };
        let target: [f32; 3] = std::array::from_fn(|k| (0..3).map(|v| weights[v] * triangle[v][k]).sum());
        let size = if i.is_multiple_of(2) { 4.0 * extent } else { 0.5 * extent };
        let origin = random.near(target, size.max(f32::MIN_POSITIVE));
        ray_from(origin, std::array::from_fn(|k| target[k] - origin[k]))
    };
    (0..count).map(&mut ray).collect()
}

#[test]
fn trees_are_valid_and_hits_are_those_of_brute_force() {
    let mut split = 0;
    for (name, corners) in scenes() {
        let rays = rays(&corners, 400, 17);
        for sbvh in options() {
            let sah = by(sbvh);
            for options in [sah, HostBvhOptions { collapse: Collapse::OFF, ..sah }] {
                let tree = built(&corners, &options);
                tree.validate().unwrap_or_else(|error| panic!("{name}, {options:?}: {error}"));
                assert!(
                    tree.header.cost == 0.0 || tree.header.sah() == 0.0 || tree.header.sah_growth() == 1.0,
                    "{name}"
                );
                split += u32::from(tree.header.split_from != 0);
                let most = (f64::from(sbvh.budget) * corners.len() as f64) as u32;
                assert!(tree.header.active <= most, "{name}, {options:?}: {} references", tree.header.active);
                for ray in &rays {
                    let hit = closest_hit(&tree, ray);
                    assert_eq!(hit, closest_hit_by_brute_force(&tree, ray), "{name}, {options:?}, {ray:?}");
                }
            }
        }
    }
    assert!(split > 40, "only {split} trees have parts");
}

/// The same against a tree that has each triangle once.
#[test]
fn no_triangle_is_lost_on_the_way() {
    for (name, corners) in scenes() {
        let whole = built(&corners, &HostBvhOptions::of(HostMethod::Sweep));
        let tree = built(&corners, &by(SbvhOptions { alpha: 0.0, ..SbvhOptions::PAPER }));
        for ray in rays(&corners, 400, 18) {
            let expected: Hit = closest_hit_by_brute_force(&whole, &ray);
            assert_eq!(closest_hit(&tree, &ray), expected, "{name}, {ray:?}");
        }
    }
}

#[test]
fn scenes_out_of_reach_are_not_split_and_those_in_reach_are() {
    for (name, corners) in scenes() {
        let tree = built(&corners, &by(SbvhOptions::PAPER));
        match name {
            "too tiny to split" | "too huge to split" | "points" | "one" => {
                assert_eq!(tree.header.split_from, 0, "{name}")
            }
            "tiny" | "huge" | "mixed" | "far away" => {
                assert_eq!(tree.header.split_from as usize, corners.len(), "{name}");
            }
            _ => {}
        }
    }
}

#[test]
fn with_an_alpha_of_one_it_is_binned() {
    let all_axes = BinnedOptions { bins: Bins::Fixed(32), axes: BinnedAxes::All, ..BinnedOptions::WALD };
    for (name, corners) in scenes() {
        let single = |method| HostBvhOptions { collapse: Collapse::OFF, ..HostBvhOptions::of(method) };
        let ours = built(&corners, &single(HostMethod::Sbvh(SbvhOptions { alpha: 1.0, ..SbvhOptions::PAPER })));
        let binned = built(&corners, &single(HostMethod::Binned(all_axes)));
        assert_eq!(ours.header.split_from, 0, "{name}");
        assert_eq!(ours.records.len(), corners.len(), "{name}");
        assert!(ours.to_bytes() == binned.to_bytes(), "{name}");
    }
}

#[test]
fn scenes_with_long_diagonal_needles_cost_much_less_than_by_bins() {
    let all_axes = BinnedOptions { bins: Bins::Fixed(32), axes: BinnedAxes::All, ..BinnedOptions::WALD };
    for (name, corners, most) in [("mixed", mixed(10_000, 21), 0.75), ("floor", floor(3000, 22), 0.9)] {
        let binned = built(&corners, &HostBvhOptions::of(HostMethod::Binned(all_axes))).header.sah();
        let ours = built(&corners, &by(SbvhOptions::PAPER)).header.sah();
        assert!(ours < most * binned, "{name}: {ours} of {binned}");
    }
}

#[test]
fn the_bytes_do_not_depend_on_the_number_of_threads() {
    for corners in [needles(6000, 31), soup(20_000, 0.1, 32)] {
        let bytes = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            pool.install(|| built(&corners, &by(SbvhOptions::PAPER)).to_bytes())
        };
        let one = bytes(1);
        assert!(bytes(2) == one && bytes(3) == one);
    }
}

#[test]
fn no_leaf_has_a_triangle_twice() {
    let mut merged = false;
    for (name, corners) in scenes().into_iter().chain([("many needles", needles(4000, 7))]) {
        for termination in [Termination::Sah, Termination::Single] {
            let options = HostBvhOptions { termination, ..by(SbvhOptions { alpha: 0.0, budget: 4.0, bins: 16 }) };
            let tree = built(&corners, &options);
            let off = built(&corners, &HostBvhOptions { collapse: Collapse::OFF, ..options });
            merged |= tree.header.active < off.header.active;
            let children = tree.nodes.iter().filter(|node| node.is_used()).flat_map(|node| node.children);
            for leaf in children.chain([tree.header.root]).filter(|child| child.is_leaf()) {
                let records = &tree.records[leaf.index as usize..(leaf.index + leaf.count) as usize];
                let mut primitives: Vec<u32> = records.iter().map(Record::primitive).collect();
                primitives.sort_unstable();
                assert!(primitives.windows(2).all(|pair| pair[0] != pair[1]), "{name}: {primitives:?}");
            }
        }
    }
    assert!(merged, "nothing was merged");
}

#[test]
fn optimised_trees_of_references_are_valid_and_traced_rightly() {
    let corners = mixed(1000, 41);
    let rays = rays(&corners, 500, 42);
    for optimise in [
        HostOptimise::Reinsertion(ReinsertionOptions::FAST),
        HostOptimise::Insertion(InsertionOptions { most: 20, ..InsertionOptions::PAPER }),
        HostOptimise::Top(TopOptions { subtrees: 20 }),
    ] {
        let plain = by(SbvhOptions::PAPER);
        let tree = built(&corners, &HostBvhOptions { optimise, ..plain });
        tree.validate().unwrap_or_else(|error| panic!("{optimise:?}: {error}"));
        assert_ne!(tree.header.split_from, 0);
        let single = built(&corners, &HostBvhOptions { termination: Termination::Single, ..plain });
        assert!(tree.header.cost <= 1.001 * single.header.cost, "{optimise:?}");
        for ray in &rays {
            assert_eq!(closest_hit(&tree, ray), closest_hit_by_brute_force(&tree, ray), "{optimise:?}, {ray:?}");
        }
    }
}

#[test]
fn triangles_that_cannot_be_met_are_left_out() {
    let mut corners = mixed(1000, 51);
    corners[7][1][2] = f32::NAN;
    corners[20][0][0] = f32::INFINITY;
    let (positions, mut triangles) = mesh(&corners);
    triangles[33] = [0, 1, 100_000];
    let tree = build(&positions, &triangles, &by(SbvhOptions::PAPER)).expect("sound options").tree;
    tree.validate().expect("valid");
    assert_eq!(tree.header.status, status::NON_FINITE | status::INDEX_OUT_OF_RANGE);
    assert_eq!(tree.header.split_from, 1010);
    assert!([7, 20, 33].iter().all(|&lost| tree.records.iter().all(|record| record.primitive != lost)));
    let found: std::collections::HashSet<u32> = tree.records.iter().map(|record| record.primitive).collect();
    assert_eq!(found.len(), 1007);
    let none = vec![[[f32::NAN; 3]; 3]; 5];
    built(&none, &by(SbvhOptions::PAPER)).validate().expect("valid");
}

/// Each triangle is as large as all before it, so that a tree that is split well has one on a level.
fn growing(count: i32) -> Corners {
    let triangle = |i: i32| {
        let x = 2f32.powi(i);
        [[x, 0.0, 0.0], [-x, x, 0.5 * x], [-x, -x, 0.25 * x]]
    };
    (0..count).map(triangle).collect()
}

#[test]
fn trees_that_would_be_deep_end_in_time() {
    let corners = growing(110);
    for sbvh in options() {
        for optimise in [HostOptimise::Off, HostOptimise::Top(TopOptions { subtrees: 20 })] {
            let tree = built(&corners, &HostBvhOptions { optimise, collapse: Collapse::OFF, ..by(sbvh) });
            tree.validate().unwrap_or_else(|error| panic!("{sbvh:?}: {error}"));
            for ray in rays(&corners, 100, 71) {
                assert_eq!(closest_hit(&tree, &ray), closest_hit_by_brute_force(&tree, &ray), "{sbvh:?}, {ray:?}");
            }
        }
    }
}

#[test]
fn ten_thousand_equal_triangles_are_built_at_once() {
    let corners = vec![soup(1, 0.5, 3)[0]; 10_000];
    let start = std::time::Instant::now();
    for sbvh in options() {
        built(&corners, &by(sbvh)).validate().expect("valid");
    }
    assert!(start.elapsed().as_secs_f64() < 20.0, "{:?}", start.elapsed());
}

#[test]
fn boxes_are_not_split() {
    let boxes: Vec<Aabb> = needles(300, 61).iter().map(|corners| Aabb::around(corners)).collect();
    let tree = build_aabbs(&boxes, &by(SbvhOptions::PAPER)).expect("sound options").tree;
    tree.validate().expect("valid");
    assert_eq!((tree.header.split_from, tree.records.len()), (0, 300));
}

fn by_seen(corners: &Corners, seen: &[bool]) -> Bvh2 {
    let (positions, triangles) = mesh(corners);
    let complete = Heuristic::OcclusionComplete(Occlusion::of(seen));
    let options = HostBvhOptions { collapse: Collapse::OFF, ..by(SbvhOptions::PAPER) };
    build_by(&complete, &positions, &triangles, &options).expect("sound options").tree
}

/// The seen triangles below a child; in no node there are more of them on the right than on the left.
fn seen_below(tree: &Bvh2, child: &Child, seen: &[bool]) -> BTreeSet<u32> {
    if child.is_leaf() {
        let records = &tree.records[child.index as usize..(child.index + child.count) as usize];
        return records.iter().map(Record::primitive).filter(|&primitive| seen[primitive as usize]).collect();
    }
    let [left, right] = tree.nodes[child.index as usize].children.each_ref().map(|child| seen_below(tree, child, seen));
    assert!(left.len() >= right.len(), "{}, {}", left.len(), right.len());
    &left | &right
}

#[test]
fn with_all_rules_of_occlusion_more_is_seen_on_the_left_in_every_node() {
    let corners = mixed(1000, 14);
    let seen: Vec<bool> = (0..corners.len()).map(|i| i % 7 < 2).collect();
    let tree = by_seen(&corners, &seen);
    tree.validate().expect("valid");
    assert_ne!(tree.header.split_from, 0);
    assert_eq!(seen_below(&tree, &tree.header.root, &seen).len(), seen.iter().filter(|&&seen| seen).count());
}

#[test]
fn what_nobody_sees_is_not_split() {
    let small = moved(soup(300, 0.05, 15), -3.0);
    let corners: Corners = small.into_iter().chain(needles(200, 16)).collect();
    let seen: Vec<bool> = (0..corners.len()).map(|i| i < 300).collect();
    let tree = by_seen(&corners, &seen);
    tree.validate().expect("valid");
    assert_eq!(tree.header.split_from, 0);
    let unseen: Vec<bool> = seen.iter().map(|seen| !seen).collect();
    assert_ne!(by_seen(&corners, &unseen).header.split_from, 0);
}

#[test]
fn options_out_of_range_are_named() {
    let paper = SbvhOptions::PAPER;
    for (options, says) in [
        (SbvhOptions { alpha: -1.0, ..paper }, "take 0 to 1"),
        (SbvhOptions { alpha: f32::NAN, ..paper }, "take 0 to 1"),
        (SbvhOptions { budget: 0.5, ..paper }, "take 1 to 16"),
        (SbvhOptions { budget: f32::INFINITY, ..paper }, "take 1 to 16"),
        (SbvhOptions { bins: 1, ..paper }, "take 2 to 128 bins"),
    ] {
        let error = by(options).check().expect_err("out of range").to_string();
        assert!(error.contains(says), "{error}");
    }
}
