//! BVHs by the builders on the CPU: valid over every scene that hurts, traced rightly, the same on any number of threads.

use crate::common::corpus::{self, Mesh};
use crate::common::shapes::{Corners, hard_rays, icosphere, rays_from_inside, soup};
use hedgerow::bvh::layout::{Bvh2, status};
use hedgerow::bvh::reinsertion::ReinsertionOptions;
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::quality;
use hedgerow::geometry::Aabb;
use hedgerow::trace::Query;
use hedgerow::trace::twin::tracer::{closest_hit_by_brute_force, trace};
use hedgerow_host::bvh::binned::{BinnedAxes, Bins};
use hedgerow_host::bvh::{
    AacOptions, BinnedOptions, BonsaiOptions, HostBvhOptions, HostMethod, HostOptimise, IncrementalOptions,
    IncrementalOrder, Inefficiency, InsertionOptions, Termination, build, build_aabbs,
};
use std::time::{Duration, Instant};

/// Every method, with options that make a difference in kind.
fn methods() -> Vec<HostMethod> {
    let binned = BinnedOptions::WALD;
    vec![
        HostMethod::Sweep,
        HostMethod::Binned(binned),
        HostMethod::Binned(BinnedOptions { bins: Bins::Adaptive, axes: BinnedAxes::All, ..binned }),
        HostMethod::Binned(BinnedOptions { bins: Bins::Fixed(2), leaf: 3, ..binned }),
        HostMethod::Binned(BinnedOptions { bins: Bins::Fixed(256), flat_leaves: true, ..binned }),
        HostMethod::Aac(AacOptions::FAST),
        HostMethod::Aac(AacOptions::HIGH_QUALITY),
        HostMethod::Aac(AacOptions { delta: 2, epsilon: 0 }),
        HostMethod::Ploc { radius: 1 },
        HostMethod::Ploc { radius: 25 },
        HostMethod::Incremental(IncrementalOptions { batch: 100, ..IncrementalOptions::PAPER }),
        HostMethod::Incremental(IncrementalOptions {
            order: IncrementalOrder::Shuffled,
            search: 64,
            ..IncrementalOptions::PAPER
        }),
        HostMethod::Bonsai(BonsaiOptions { mini: 1, prune: Some(0.5) }),
        HostMethod::Bonsai(BonsaiOptions { mini: 20, ..BonsaiOptions::PLAIN }),
        HostMethod::Bonsai(BonsaiOptions { mini: 20, ..BonsaiOptions::PRUNED }),
        HostMethod::Bonsai(BonsaiOptions::PRUNED_FINE),
    ]
}

/// Each of them with every way to end a build.
fn all() -> Vec<HostBvhOptions> {
    let of = |method| {
        let sah = HostBvhOptions::of(method);
        let reinsertion = HostOptimise::Reinsertion(ReinsertionOptions::FAST);
        [
            sah,
            HostBvhOptions { collapse: Collapse::OFF, ..sah },
            HostBvhOptions { termination: Termination::Single, ..sah },
            HostBvhOptions { optimise: reinsertion, ..sah },
            HostBvhOptions { optimise: HostOptimise::Insertion(InsertionOptions::PAPER), ..sah },
        ]
    };
    methods().into_iter().flat_map(of).collect()
}

fn tree_of((_, positions, triangles): &Mesh, options: &HostBvhOptions) -> Bvh2 {
    build(positions, triangles, options).expect("sound options").tree
}

fn mesh_of(corners: &Corners) -> Mesh {
    corpus::soup("", corners.clone())
}

fn sah(tree: &Bvh2) -> f64 {
    quality::of(tree, 3.0, 2.0).sah
}

fn in_pool<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads").install(work)
}

#[test]
fn every_scene_that_hurts_gives_a_valid_tree_whose_hits_are_those_of_brute_force() {
    for mesh in corpus::meshes() {
        let corners: Corners = {
            let vertex = |v: u32| mesh.1.get(v as usize).copied().unwrap_or_default();
            mesh.2.iter().map(|triangle| triangle.map(vertex)).collect()
        };
        let rays = hard_rays(&corners, 20, 1.0, [0.0; 3], 7);
        for options in all() {
            let tree = tree_of(&mesh, &options);
            tree.validate().unwrap_or_else(|error| panic!("{}, {options:?}: {error}", mesh.0));
            for ray in &rays {
                let expected = closest_hit_by_brute_force(&tree, ray);
                assert_eq!(trace(&tree, ray, Query::ClosestHit).0, expected, "{}, {options:?}, {ray:?}", mesh.0);
            }
        }
    }
}

#[test]
fn the_bytes_do_not_depend_on_the_number_of_threads() {
    // Enough that nodes are divided by several threads together.
    for mesh in [mesh_of(&soup(70_000, 0.03, 9)), mesh_of(&icosphere(5))] {
        for method in methods() {
            let options = HostBvhOptions::of(method);
            let bytes = |threads| in_pool(threads, || tree_of(&mesh, &options).to_bytes());
            let one = bytes(1);
            for threads in [2, 3, 8] {
                assert!(bytes(threads) == one, "{threads} threads, {options:?}");
            }
        }
    }
}

#[test]
fn ten_thousand_identical_triangles_are_built_at_once() {
    let mesh = mesh_of(&vec![soup(1, 0.5, 3)[0]; 10_000]);
    for options in all() {
        let start = Instant::now();
        let tree = tree_of(&mesh, &options);
        assert!(start.elapsed() < Duration::from_secs(1), "{options:?}: {:?}", start.elapsed());
        tree.validate().expect("valid");
        assert_eq!(tree.header.status, 0, "{options:?}");
    }
}

#[test]
fn leaves_have_one_triangle_where_nothing_is_collapsed_and_collapsing_costs_nothing() {
    let mesh = mesh_of(&soup(3000, 0.2, 4));
    for method in methods() {
        let sah_of = |options: HostBvhOptions| sah(&tree_of(&mesh, &options));
        let options = HostBvhOptions::of(method);
        let off = HostBvhOptions { collapse: Collapse::OFF, ..options };
        assert_eq!(quality::of(&tree_of(&mesh, &off), 3.0, 2.0).leaf_max, 1, "{method:?}");
        let single = HostBvhOptions { termination: Termination::Single, ..options };
        assert!(sah_of(single) <= sah_of(off), "{method:?}");
    }
}

#[test]
fn triangles_that_cannot_be_met_are_left_out_and_the_status_says_so() {
    let mesh =
        corpus::meshes().into_iter().find(|mesh| mesh.0 == "not finite and out of range").expect("in the corpus");
    let is_sound = |triangle: &[u32; 3]| {
        triangle.iter().all(|&v| mesh.1.get(v as usize).is_some_and(|v| v.iter().all(|x| x.is_finite())))
    };
    let sound = mesh.2.iter().filter(|triangle| is_sound(triangle)).count();
    for options in all() {
        let header = tree_of(&mesh, &options).header;
        assert_eq!(header.status, status::NON_FINITE | status::INDEX_OUT_OF_RANGE);
        assert_eq!(header.active as usize, sound, "{options:?}");
    }
}

#[test]
fn nothing_and_next_to_nothing_give_trees() {
    for options in all() {
        for count in 0..=3 {
            let tree = tree_of(&mesh_of(&soup(count, 0.3, 5)), &options);
            tree.validate().unwrap_or_else(|error| panic!("{count}, {options:?}: {error}"));
            assert_eq!((tree.header.active as usize, tree.records.len()), (count, count));
        }
    }
}

#[test]
fn boxes_are_built_over_as_triangles_are() {
    let corners = soup(2000, 0.1, 6);
    let mut boxes: Vec<Aabb> = corners.iter().map(|corners| Aabb::around(corners)).collect();
    for options in methods().into_iter().map(HostBvhOptions::of) {
        let of_boxes = build_aabbs(&boxes, &options).expect("sound options").tree;
        of_boxes.validate().expect("valid");
        assert_eq!(of_boxes.nodes, tree_of(&mesh_of(&corners), &options).nodes, "{options:?}");
    }
    boxes[7].hi[1] = f32::NAN;
    boxes[9].lo[0] = boxes[9].hi[0] + 1.0;
    let tree = build_aabbs(&boxes, &HostBvhOptions::of(HostMethod::Sweep)).expect("sound options").tree;
    assert_eq!((tree.header.active, tree.header.status), (1998, status::NON_FINITE));
}

#[test]
fn one_mini_tree_is_the_sweep_and_pruning_by_no_area_prunes_nothing() {
    for mesh in corpus::meshes().into_iter().chain([mesh_of(&soup(5000, 0.1, 8))]) {
        let bytes = |method| tree_of(&mesh, &HostBvhOptions::of(method)).to_bytes();
        let one = HostMethod::Bonsai(BonsaiOptions { mini: 1 << 20, prune: None });
        assert!(bytes(one) == bytes(HostMethod::Sweep), "{}", mesh.0);
        let bonsai = |prune| HostMethod::Bonsai(BonsaiOptions { mini: 64, prune });
        assert!(bytes(bonsai(Some(0.0))) == bytes(bonsai(None)), "{}", mesh.0);
    }
}

#[test]
fn insertion_by_any_measure_never_makes_a_tree_cost_more() {
    let measures = [Inefficiency::Sum, Inefficiency::Min, Inefficiency::Area, Inefficiency::Combined];
    for mesh in corpus::meshes().into_iter().chain([mesh_of(&soup(3000, 0.1, 8)), mesh_of(&icosphere(4))]) {
        for method in [HostMethod::Sweep, HostMethod::Binned(BinnedOptions::WALD), HostMethod::Aac(AacOptions::FAST)] {
            let cost = |optimise, termination| {
                let tree = tree_of(&mesh, &HostBvhOptions { optimise, termination, ..HostBvhOptions::of(method) });
                tree.validate().unwrap_or_else(|error| panic!("{}, {method:?}, {optimise:?}: {error}", mesh.0));
                sah(&tree)
            };
            let before = cost(HostOptimise::Off, Termination::Single);
            for measure in measures {
                let after = cost(HostOptimise::Insertion(InsertionOptions::by(measure)), Termination::Single);
                // A tree of nothing costs nothing, or is not a number where it has no area.
                assert!(
                    after <= before * 1.000_001 || before.is_nan(),
                    "{}, {method:?}, {measure:?}: {before} to {after}",
                    mesh.0
                );
            }
        }
    }
}

#[test]
fn a_second_run_of_insertion_gains_less_than_a_percent() {
    let mesh = mesh_of(&soup(4000, 0.3, 12));
    let cost = |options| {
        let optimise = HostOptimise::Insertion(options);
        sah(&tree_of(&mesh, &HostBvhOptions { optimise, ..HostBvhOptions::of(HostMethod::Sweep) }))
    };
    // Going on for as long as there is any gain is more than a second run.
    let (once, for_ever) =
        (cost(InsertionOptions::PAPER), cost(InsertionOptions { least_gain: 0.0, ..InsertionOptions::PAPER }));
    assert!((0.99..=1.0).contains(&(for_ever / once)), "{once}, then {for_ever}");
}

#[test]
fn insertion_does_not_depend_on_the_number_of_threads() {
    let mesh = mesh_of(&soup(10_000, 0.1, 14));
    for search in [1, 64] {
        let method = HostMethod::Incremental(IncrementalOptions { search, ..IncrementalOptions::PAPER });
        let optimise = HostOptimise::Insertion(InsertionOptions::PAPER);
        let options = HostBvhOptions { optimise, ..HostBvhOptions::of(method) };
        let bytes = |threads| in_pool(threads, || tree_of(&mesh, &options).to_bytes());
        let one = bytes(1);
        assert!([2, 3, 8].into_iter().all(|threads| bytes(threads) == one), "{search}");
    }
}

#[test]
fn identical_triangles_are_put_into_a_balanced_tree() {
    let mesh = mesh_of(&vec![soup(1, 0.5, 3)[0]; 10_000]);
    for search in [1, 64] {
        let method = HostMethod::Incremental(IncrementalOptions { search, ..IncrementalOptions::PAPER });
        for optimise in [HostOptimise::Off, HostOptimise::Insertion(InsertionOptions::PAPER)] {
            let options = HostBvhOptions { collapse: Collapse::OFF, optimise, ..HostBvhOptions::of(method) };
            let depth = quality::of(&tree_of(&mesh, &options), 3.0, 2.0).depth_max;
            assert!(depth <= 28, "{search}, {optimise:?}: {depth}");
        }
    }
}

#[test]
fn presets_are_what_their_names_say() {
    let mesh = mesh_of(&soup(5000, 0.05, 10));
    let [fast, best] = [HostBvhOptions::FAST, HostBvhOptions::BEST].map(|options| sah(&tree_of(&mesh, &options)));
    assert!(best <= sah(&tree_of(&mesh, &HostBvhOptions::of(HostMethod::Sweep))) && best < fast);
}

#[test]
fn a_neighbourhood_of_all_is_greedy_agglomeration() {
    // Least box around both first; of equal ones the fewest primitives, then the least places in the order of codes.
    let corners = soup(60, 0.3, 12);
    let mesh = mesh_of(&corners);
    let method = HostMethod::Aac(AacOptions { delta: 1000, epsilon: 1 });
    let tree = tree_of(&mesh, &HostBvhOptions { collapse: Collapse::OFF, ..HostBvhOptions::of(method) });
    let mut clusters: Vec<Aabb> = corners.iter().map(|corners| Aabb::around(corners)).collect();
    let half_area = |b: &Aabb| {
        let [x, y, z]: [f32; 3] = std::array::from_fn(|i| b.hi[i] - b.lo[i]);
        x * y + y * z + z * x
    };
    let mut expected = Vec::new();
    while clusters.len() > 1 {
        let pairs = (0..clusters.len()).flat_map(|i| (0..i).map(move |j| (j, i)));
        let area = |&(j, i): &(usize, usize)| half_area(&clusters[j].union(&clusters[i]));
        let (j, i) = pairs.min_by(|a, b| area(a).total_cmp(&area(b))).expect("two clusters");
        let both = clusters[j].union(&clusters[i]);
        expected.push(both);
        clusters.swap_remove(i);
        clusters[j] = both;
    }
    let mut found: Vec<Aabb> = vec![tree.header.root.bounds()];
    for node in &tree.nodes {
        found.extend(node.children.iter().filter(|child| !child.is_leaf()).map(|child| child.bounds()));
    }
    let sorted = |mut boxes: Vec<Aabb>| {
        boxes.sort_by(|a, b| half_area(a).total_cmp(&half_area(b)).then(a.lo[0].total_cmp(&b.lo[0])));
        boxes
    };
    assert_eq!(sorted(found), sorted(expected));
}

#[test]
fn as_many_bins_as_places_are_a_sweep() {
    // Points at the middles of 64 bins along x, several at most of them: every plane of the sweep is one between bins.
    let mut next = corpus::unit_floats(5);
    let mut places: Vec<f32> = (0..500).map(|_| (64.0 * next()).floor()).collect();
    places.extend([0.0, 63.0]);
    let boxes: Vec<Aabb> =
        places.iter().map(|&x| Aabb { lo: [x - 0.25, -0.5, -0.5], hi: [x + 0.25, 0.5, 0.5] }).collect();
    let cost = |method| {
        let options = HostBvhOptions { collapse: Collapse::OFF, ..HostBvhOptions::of(method) };
        let tree = build_aabbs(&boxes, &options).expect("sound options").tree;
        quality::of(&tree, 3.0, 2.0).sah
    };
    let binned = cost(HostMethod::Binned(BinnedOptions { bins: Bins::Fixed(256), ..BinnedOptions::WALD }));
    let sweep = cost(HostMethod::Sweep);
    assert!((binned / sweep - 1.0).abs() < 0.02, "{binned} against {sweep}");
}

#[test]
fn a_floor_is_one_leaf_only_where_flat_leaves_are_asked_for() {
    let mut next = corpus::unit_floats(11);
    let floor: Corners = (0..2000)
        .map(|_| {
            let [x, z] = [next(), next()];
            [[x, 0.0, z], [x + 0.01, 0.0, z], [x, 0.0, z + 0.01]]
        })
        .collect();
    let leaf_max = |flat_leaves| {
        let method = HostMethod::Binned(BinnedOptions { flat_leaves, ..BinnedOptions::WALD });
        quality::of(&tree_of(&mesh_of(&floor), &HostBvhOptions::of(method)), 3.0, 2.0).leaf_max
    };
    assert_eq!(leaf_max(true), 2000);
    assert!(leaf_max(false) < 20, "{}", leaf_max(false));
}

#[test]
fn better_builders_cost_less_than_a_morton_order() {
    let mesh = mesh_of(&soup(5000, 0.05, 10));
    let rays = rays_from_inside(&soup(50, 0.05, 10), 50, 1.0, [0.0; 3]);
    let order = sah(&hedgerow::bvh::twin::lbvh::build(
        &mesh.1,
        &mesh.2,
        hedgerow::bvh::codes::Code::Mc63.full(),
        Collapse::SAH,
    ));
    for method in
        [HostMethod::Sweep, HostMethod::Binned(BinnedOptions::WALD), HostMethod::Bonsai(BonsaiOptions::PRUNED)]
    {
        let tree = tree_of(&mesh, &HostBvhOptions::of(method));
        assert!(sah(&tree) < order, "{method:?}: {} against {order}", sah(&tree));
        for ray in &rays {
            assert_eq!(trace(&tree, ray, Query::ClosestHit).0, closest_hit_by_brute_force(&tree, ray));
        }
    }
}

#[test]
fn options_that_cannot_be_used_are_refused_by_name() {
    let binned = BinnedOptions::WALD;
    let wrong = [
        (HostMethod::Binned(BinnedOptions { bins: Bins::Fixed(1), ..binned }), "take 2 to 256 bins"),
        (HostMethod::Binned(BinnedOptions { leaf: 0, ..binned }), "take 1 to 255 primitives"),
        (HostMethod::Aac(AacOptions { delta: 1, epsilon: 0 }), "take 2 to 1000 primitives"),
        (HostMethod::Aac(AacOptions { delta: 4, epsilon: 6 }), "take 0 to 5"),
        (HostMethod::Ploc { radius: 0 }, "take 1 or more clusters"),
        (HostMethod::Incremental(IncrementalOptions { search: 0, ..IncrementalOptions::PAPER }), "take 1 to"),
        (HostMethod::Bonsai(BonsaiOptions { mini: 0, prune: None }), "take 1 or more primitives"),
        (HostMethod::Bonsai(BonsaiOptions { mini: 1, prune: Some(f32::NAN) }), "take 0 or more"),
    ];
    for (method, says) in wrong {
        let error = build(&[], &[], &HostBvhOptions::of(method)).expect_err("wrong").to_string();
        assert!(error.contains(says), "{error}");
    }
}
