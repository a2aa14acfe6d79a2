//! kd-trees by the host's builders: valid over every scene that hurts, as good as they should be, the same on any number of threads.

use crate::common::corpus::{self, Mesh};
use crate::common::shapes::{Corners, icosphere, placed, soup};
use hedgerow::bvh::layout::status;
use hedgerow::bvh::quality::Quality;
use hedgerow::kdtree::layout::KdTree;
use hedgerow::kdtree::quality;
use hedgerow::kdtree::termination::{Costs, depth_limit};
use hedgerow_host::kdtree::{HostKdOptions, Planes, build};

const BOTH: [HostKdOptions; 2] = [HostKdOptions::EXACT, HostKdOptions::BINNED];

fn mesh_of(corners: &Corners) -> Mesh {
    corpus::soup("", corners.clone())
}

fn tree_of((name, positions, triangles): &Mesh, options: &HostKdOptions) -> KdTree {
    build(positions, triangles, options).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn quality_of(mesh: &Mesh, options: &HostKdOptions) -> Quality {
    quality::on_host(&tree_of(mesh, options), 3.0, 2.0)
}

#[test]
fn every_scene_that_hurts_gives_a_valid_tree_that_round_trips() {
    for mesh in corpus::meshes() {
        for options in
            BOTH.into_iter().chain([2, 3, 7, 256].map(|bins| HostKdOptions { planes: Planes::Binned(bins), ..BOTH[0] }))
        {
            let tree = tree_of(&mesh, &options);
            tree.validate().unwrap_or_else(|error| panic!("{}, {options:?}: {error}", mesh.0));
            let header = &tree.header;
            assert!(header.depth <= depth_limit(header.active), "{}: {header:?}", mesh.0);
            let quality = quality::on_host(&tree, 3.0, 2.0);
            assert_eq!(quality.leaves, quality.inner + 1, "{}", mesh.0);
            assert_eq!((quality.inner, quality.empty_leaves), (header.inner_nodes.into(), header.empty_leaves.into()));
            assert!(quality.sah.is_finite() && quality.refs >= header.active.into(), "{}: {quality:?}", mesh.0);
            let bytes = tree.to_bytes();
            assert_eq!(KdTree::from_bytes(&bytes).expect("its own bytes").to_bytes(), bytes, "{}", mesh.0);
        }
    }
}

#[test]
fn triangles_that_cannot_be_met_are_left_out_and_the_status_says_so() {
    let (_, positions, triangles) =
        corpus::meshes().into_iter().find(|(name, ..)| name == "not finite and out of range").expect("in the corpus");
    for options in BOTH {
        let tree = build(&positions, &triangles, &options).expect("a small tree");
        assert_eq!(tree.header.status, status::NON_FINITE | status::INDEX_OUT_OF_RANGE);
        assert_eq!(tree.header.primitive_count as usize, triangles.len());
        assert!(tree.header.active > 0 && tree.header.active < tree.header.primitive_count);
        let sound = |p: u32| {
            triangles[p as usize]
                .iter()
                .all(|&v| positions.get(v as usize).is_some_and(|v| v.iter().all(|x| x.is_finite())))
        };
        let left: Vec<u32> = (0..triangles.len() as u32).filter(|&p| sound(p)).collect();
        assert_eq!(tree.records.iter().map(|record| record.primitive).collect::<Vec<_>>(), left);
    }
}

#[test]
fn an_empty_tree_has_no_node_and_one_triangle_is_a_leaf() {
    for options in BOTH {
        let empty = tree_of(&mesh_of(&Corners::new()), &options);
        assert_eq!((empty.nodes.len(), empty.header.empty_leaves, empty.header.active), (0, 1, 0));
        let one = tree_of(&mesh_of(&soup(1, 0.1, 1)), &options);
        assert_eq!((one.nodes.len(), one.references.as_slice(), one.header.leaves), (1, [0].as_slice(), 1));
    }
}

#[test]
fn thousands_of_identical_triangles_are_one_leaf() {
    // What no plane tells apart costs nothing to leave together but steps.
    for options in BOTH {
        let tree = tree_of(&mesh_of(&vec![soup(1, 0.5, 3)[0]; 5000]), &options);
        let leaf_max = quality::on_host(&tree, 3.0, 2.0).leaf_max;
        assert!(leaf_max == 5000 && tree.nodes.len() < 100, "{leaf_max} {}", tree.nodes.len());
        tree.validate().expect("valid");
    }
}

#[test]
fn perfect_splits_cost_at_most_what_bins_do() {
    let scenes: [(&str, Mesh); 6] = [
        ("soup", mesh_of(&soup(2000, 0.05, 1))),
        ("coarse soup", mesh_of(&soup(300, 0.5, 2))),
        ("icosphere", mesh_of(&icosphere(4))),
        ("far icosphere", mesh_of(&placed(&icosphere(3), 1.0, [1e3, -1e4, 1e2]))),
        ("needles", corpus::meshes().into_iter().find(|mesh| mesh.0 == "needles").expect("in the corpus")),
        ("random", corpus::random("", 3000, [-0.5; 3], [1.0; 3])),
    ];
    for (name, mesh) in &scenes {
        let [exact, binned] = BOTH.map(|options| quality_of(mesh, &options));
        // A greedy choice of the best plane each time is not always the best of all.
        assert!(exact.sah <= 1.03 * binned.sah, "{name}: {} against {}", exact.sah, binned.sah);
        assert!(exact.sah >= 0.5 * binned.sah, "{name}: {} against {}", exact.sah, binned.sah);
        let leaf = 2.0 * mesh.2.len() as f64;
        assert!(exact.sah < leaf && binned.sah < leaf, "{name}: {} {} {leaf}", exact.sah, binned.sah);
    }
}

#[test]
fn a_dearer_step_makes_fewer_nodes() {
    let mesh = mesh_of(&soup(1000, 0.1, 5));
    for options in BOTH {
        let inner = |c_t: f32| quality_of(&mesh, &HostKdOptions { costs: Costs { c_t, c_i: 2.0 }, ..options }).inner;
        assert!(inner(1.0) > inner(3.0) && inner(3.0) > inner(30.0), "{options:?}");
    }
}

#[test]
fn empty_space_is_cut_off() {
    // Two clusters far apart: what lies between them is empty and costs no node.
    let near = placed(&soup(200, 0.2, 1), 1.0, [0.0; 3]);
    let far = placed(&soup(200, 0.2, 2), 1.0, [100.0, 0.0, 0.0]);
    let tree = tree_of(&mesh_of(&[near, far].concat()), &HostKdOptions::EXACT);
    assert!(tree.header.empty_leaves > 0);
    assert_eq!(tree.header.node_count, tree.header.inner_nodes + tree.header.leaves);
}

#[test]
fn the_bytes_do_not_depend_on_the_number_of_threads() {
    for mesh in [mesh_of(&soup(20_000, 0.02, 9)), mesh_of(&icosphere(5))] {
        for options in BOTH {
            let bytes_by = |threads: usize| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
                pool.install(|| tree_of(&mesh, &options).to_bytes())
            };
            let one = bytes_by(1);
            for threads in [2, 5] {
                assert!(bytes_by(threads) == one, "{threads} threads, {options:?}");
            }
        }
    }
}

#[test]
fn options_that_cannot_be_used_are_refused_by_name() {
    for bins in [0, 1, 1025] {
        let error =
            build(&[], &[], &HostKdOptions { planes: Planes::Binned(bins), ..HostKdOptions::EXACT }).expect_err("bins");
        assert!(error.to_string().contains("take 2 to 1024 bins"), "{error}");
    }
    for cost in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let error = build(&[], &[], &HostKdOptions { costs: Costs { c_t: 1.0, c_i: cost }, ..HostKdOptions::EXACT })
            .expect_err("cost");
        assert!(error.to_string().contains("take 0.001 to 1000"), "{error}");
    }
}
