//! kd-trees of objects merged into a static one: valid, with the hits of brute force over all triangles, and taken out without
//! a trace.

use crate::common::corpus;
use crate::common::shapes::{Corners, hard_rays, icosphere, placed, ray, soup, tree_of};
use hedgerow::bvh::layout::status;
use hedgerow::kdtree::layout::{KdHeader, KdNode, KdTree, MAX_DEPTH, SpareRoom};
use hedgerow::kdtree::termination::Costs;
use hedgerow::trace::Ray;
use hedgerow::trace::kd::Traversal;
use hedgerow::trace::twin::kd as kd_host;
use hedgerow::trace::twin::tracer as host;
use hedgerow_host::kdtree::merge::Merged;
use hedgerow_host::kdtree::{HostKdOptions, build};
use hedgerow_lab::random::SplitMix64;
use proptest::prelude::*;

const TRAVERSALS: [Traversal; 5] = [
    Traversal::STACK,
    Traversal::RESTART,
    Traversal::PUSH_DOWN,
    Traversal::short_stack(2),
    Traversal::short_stack_with_push_down(2),
];

const ROOM: SpareRoom = SpareRoom { nodes: 1 << 20, references: 1 << 20, records: 1 << 16 };

fn kd_tree_of(corners: &Corners, options: &HostKdOptions) -> KdTree {
    let (_, positions, triangles) = corpus::soup("", corners.clone());
    build(&positions, &triangles, options).expect("a small tree")
}

fn merged_with(still: &Corners, room: SpareRoom) -> Merged {
    Merged::new(kd_tree_of(still, &HostKdOptions::EXACT).with_room(room).expect("room"), Costs::DEFAULT)
}

/// Static triangles and objects, numbered one after the other.
struct World {
    still: Corners,
    objects: Vec<Corners>,
}

impl World {
    fn all(&self) -> Corners {
        self.still.iter().chain(self.objects.iter().flatten()).copied().collect()
    }

    fn first(&self, object: usize) -> u32 {
        (self.still.len() + self.objects[..object].iter().map(Vec::len).sum::<usize>()) as u32
    }

    fn insert(&self, merged: &mut Merged, object: usize) {
        let tree = kd_tree_of(&self.objects[object], &HostKdOptions::BINNED);
        merged.insert(&object.to_string(), self.first(object), tree).expect("it is not in the tree");
    }

    fn merged(&self) -> Merged {
        let mut merged = merged_with(&self.still, ROOM);
        (0..self.objects.len()).for_each(|object| self.insert(&mut merged, object));
        merged
    }
}

fn assert_hits_of_brute_force(what: &str, tree: &KdTree, all: &Corners, rays: &[Ray]) {
    let bvh = tree_of(all);
    for ray in rays {
        let expected = host::closest_hit_by_brute_force(&bvh, ray);
        for traversal in TRAVERSALS {
            assert_eq!(kd_host::closest_hit(tree, ray, traversal), expected, "{what}, {traversal:?}: {ray:?}");
            let any = kd_host::any_hit(tree, ray, traversal);
            assert_eq!(any.is_some(), expected.is_some(), "{what}, {traversal:?}: {ray:?}");
        }
    }
}

/// Merges, validates, traces and restores. How many rays hit an object is told.
fn assert_merges(what: &str, world: &World, seed: u64) -> usize {
    let (still, all) = (kd_tree_of(&world.still, &HostKdOptions::EXACT).with_room(ROOM).expect("room"), world.all());
    let mut merged = world.merged();
    let tree = merged.tree().unwrap_or_else(|error| panic!("{what}: {error}"));
    tree.validate().unwrap_or_else(|error| panic!("{what}: {error}"));
    assert_eq!(tree.header.primitive_count as usize, all.len(), "{what}");
    let bytes = tree.to_bytes();
    assert!(KdTree::from_bytes(&bytes).expect("its own bytes").to_bytes() == bytes, "{what}");
    let rays = hard_rays(&all, 96, 1.0, [0.0; 3], seed);
    assert_hits_of_brute_force(what, tree, &all, &rays);
    let hit = |ray: &&Ray| {
        let hit = kd_host::closest_hit(tree, ray, Traversal::STACK);
        hit.is_some() && hit.primitive as usize >= world.still.len()
    };
    let hits = rays.iter().filter(hit).count();
    assert!(merged.restore().to_bytes() == still.to_bytes(), "{what}: restored");
    hits
}

/// A room of large triangles, a cluster of small ones in a corner, and nothing elsewhere.
fn room() -> Corners {
    let quad = |a: [f32; 3], b: [f32; 3], c: [f32; 3], d: [f32; 3]| [[a, b, c], [a, c, d]];
    let mut corners = Vec::new();
    for s in [-1.0f32, 1.0] {
        corners.extend(quad([-1.0, -1.0, s], [1.0, -1.0, s], [1.0, 1.0, s], [-1.0, 1.0, s]));
        corners.extend(quad([-1.0, s, -1.0], [1.0, s, -1.0], [1.0, s, 1.0], [-1.0, s, 1.0]));
        corners.extend(quad([s, -1.0, -1.0], [s, 1.0, -1.0], [s, 1.0, 1.0], [s, -1.0, 1.0]));
    }
    corners.extend(placed(&soup(300, 0.1, 1), 0.2, [0.7, 0.7, 0.7]));
    corners
}

/// A box with its faces in planes across the axes, as tiles.
fn tiled_box(lo: [f32; 3], edge: f32) -> Corners {
    let mut corners = Corners::new();
    for axis in 0..3 {
        for side in [0.0, edge] {
            for i in 0..4 {
                for j in 0..4 {
                    let at = |i: usize, j: usize| {
                        let mut p = lo;
                        p[axis] += side;
                        p[(axis + 1) % 3] += edge * i as f32 / 4.0;
                        p[(axis + 2) % 3] += edge * j as f32 / 4.0;
                        p
                    };
                    corners.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
                    corners.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
                }
            }
        }
    }
    corners
}

fn worlds() -> Vec<(&'static str, World)> {
    let ball = |scale: f32, offset: [f32; 3]| placed(&icosphere(2), scale, offset);
    let with = |objects: Vec<Corners>| World { still: room(), objects };
    let mut flat = soup(200, 0.3, 8);
    flat.iter_mut().flatten().for_each(|p| p[1] = -1.0);
    let mut degenerate = ball(0.3, [0.1; 3]);
    for (i, triangle) in degenerate.iter_mut().enumerate().filter(|(i, _)| i % 3 == 0) {
        let [a, b, _] = *triangle;
        *triangle = [[a; 3], [a, b, a], [a, b, std::array::from_fn(|k| 0.5 * a[k] + 0.5 * b[k])]][i % 9 / 3];
    }
    vec![
        ("no object", with(vec![])),
        ("one", with(vec![ball(0.3, [0.1, -0.2, 0.0])])),
        ("apart", with(vec![ball(0.2, [-0.6; 3]), ball(0.2, [0.5, -0.5, 0.0]), ball(0.1, [0.0, 0.6, -0.6])])),
        ("overlapping", with(vec![ball(0.3, [0.0; 3]), ball(0.3, [0.1; 3]), soup(100, 0.2, 3), ball(0.3, [0.0; 3])])),
        ("in the cluster", with(vec![ball(0.2, [0.7; 3]), ball(0.1, [0.75, 0.7, 0.65])])),
        ("outside", with(vec![ball(0.5, [3.0, 0.0, 0.0]), ball(0.5, [0.0, -9.0, 2.0])])),
        ("half outside", with(vec![ball(0.5, [1.0, 0.2, -1.0])])),
        (
            "beside all faces",
            with(
                (0..6)
                    .map(|i| {
                        let mut offset = [0.0; 3];
                        offset[i / 2] = if i % 2 == 0 { -1.1 } else { 1.1 };
                        ball(0.3, offset)
                    })
                    .collect(),
            ),
        ),
        ("touching from outside", with(vec![tiled_box([1.0, 0.0, 0.0], 0.5), tiled_box([-1.5, -1.5, -1.5], 0.5)])),
        ("over everything", with(vec![ball(1.9, [0.0; 3]), soup(60, 2.0, 5)])),
        ("boxes that stand in planes", with(vec![tiled_box([-0.5, -1.0, 0.0], 0.5), tiled_box([0.0, -1.0, 0.0], 0.5)])),
        ("flat on the floor", with(vec![flat])),
        ("degenerate", with(vec![degenerate, vec![[[0.25; 3]; 3]; 40]])),
        ("the static triangles again", with(vec![room(), room()])),
        ("an empty object", with(vec![Corners::new(), ball(0.2, [0.0; 3]), Corners::new()])),
        ("in nothing", World { still: Corners::new(), objects: vec![ball(0.4, [0.3; 3]), ball(0.4, [-0.3; 3])] }),
        ("nothing in nothing", World { still: Corners::new(), objects: vec![Corners::new()] }),
        ("in one triangle", World { still: soup(1, 1.0, 4), objects: vec![ball(0.4, [0.0; 3]), soup(1, 0.5, 6)] }),
        (
            "long among small ones",
            World { still: soup(400, 1e-4, 7), objects: vec![soup(3, 1.0, 2), soup(50, 1e-5, 9)] },
        ),
        ("small among long ones", World { still: soup(30, 1.0, 7), objects: vec![soup(400, 1e-5, 9)] }),
    ]
}

#[test]
fn merged_trees_are_valid_and_have_the_hits_of_brute_force_and_restore_byte_for_byte() {
    let mut hits = 0;
    for (i, (name, world)) in worlds().iter().enumerate() {
        hits += assert_merges(name, world, i as u64);
    }
    assert!(hits > 300, "{hits} rays hit an object");
}

#[test]
fn every_scene_that_hurts_merges_into_another() {
    let few = |mesh: &corpus::Mesh| crate::common::corners_of(mesh).into_iter().take(300).collect();
    let meshes: Vec<Corners> = corpus::meshes().iter().map(few).collect();
    for (i, object) in meshes.iter().enumerate() {
        for (still, name) in [(&room(), "room"), (&meshes[(i + 7) % meshes.len()], "another")] {
            let world = World { still: still.clone(), objects: vec![object.clone()] };
            assert_merges(&format!("mesh {i} in {name}"), &world, i as u64);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn whatever_is_merged_is_valid_and_has_the_hits_of_brute_force(
        still in 0usize..120,
        sizes in proptest::collection::vec((0usize..60, 0usize..4), 1..5),
        size in prop_oneof![Just(1.0f32), Just(0.2), Just(1e-3)],
        rounded in any::<bool>(),
        seed in any::<u64>(),
    ) {
        let mut random = SplitMix64::new(seed);
        // Corners on a grid: planes that are common to all trees.
        let grid = |corners: Corners| -> Corners {
            let round = |x: f32| if rounded { (8.0 * x).round() / 8.0 } else { x };
            corners.into_iter().map(|t| t.map(|p| p.map(round))).collect()
        };
        let objects = sizes
            .iter()
            .map(|&(count, spread)| {
                let scale = [0.05, 0.3, 1.0, 3.0][spread];
                grid(placed(&soup(count, size, random.bits()), scale, random.around(1.0)))
            })
            .collect();
        let world = World { still: grid(soup(still, size, random.bits())), objects };
        assert_merges("random", &world, seed);
    }
}

#[test]
fn the_order_of_insertion_changes_nothing_and_neither_does_what_was_taken_out() {
    let (_, world) = worlds().swap_remove(3);
    let bytes = world.merged().tree().expect("room").to_bytes();
    let mut merged = merged_with(&world.still, ROOM);
    for object in [2, 0, 3, 1] {
        world.insert(&mut merged, object);
        merged.tree().expect("room");
    }
    assert!(merged.tree().expect("room").to_bytes() == bytes);
    let far = kd_tree_of(&placed(&icosphere(1), 5.0, [50.0; 3]), &HostKdOptions::BINNED);
    merged.insert("far", 100_000, far).expect("apart");
    assert!(merged.tree().expect("room").to_bytes() != bytes);
    for name in ["1", "far", "2"] {
        merged.take_out(name).expect("it is there");
    }
    world.insert(&mut merged, 1);
    world.insert(&mut merged, 2);
    assert!(merged.tree().expect("room").to_bytes() == bytes);
}

#[test]
fn ten_thousand_insertions_and_removals_leave_no_trace() {
    let world = World {
        still: room(),
        objects: (0..8)
            .map(|i| placed(&soup(6 + 2 * i, 0.3, i as u64), 0.5, SplitMix64::new(i as u64).around(1.2)))
            .collect(),
    };
    let room = SpareRoom { nodes: 1 << 16, references: 1 << 16, records: 1 << 10 };
    let still = kd_tree_of(&world.still, &HostKdOptions::EXACT).with_room(room).expect("room");
    let trees: Vec<KdTree> = world.objects.iter().map(|object| kd_tree_of(object, &HostKdOptions::BINNED)).collect();
    let mut merged = merged_with(&world.still, room);
    let mut random = SplitMix64::new(1);
    let mut is_in = [false; 8];
    for step in 0..10_000 {
        let object = random.bits() as usize % 8;
        let name = object.to_string();
        match is_in[object] {
            true => merged.take_out(&name).expect("it is there"),
            false => merged.insert(&name, world.first(object), trees[object].clone()).expect("it is not there"),
        }
        is_in[object] ^= true;
        if step % 8 == 0 {
            let tree = merged.tree().expect("room");
            let count =
                world.objects.iter().zip(is_in).filter(|(_, is_in)| *is_in).map(|(o, _)| o.len()).sum::<usize>();
            assert_eq!(tree.header.active as usize, world.still.len() + count);
            if step % 400 == 0 {
                tree.validate().unwrap_or_else(|error| panic!("step {step}: {error}"));
            }
        }
    }
    for object in (0..8).filter(|&object| is_in[object]) {
        merged.take_out(&object.to_string()).expect("it is there");
    }
    assert!(merged.tree().expect("room").to_bytes() == still.to_bytes());
}

#[test]
fn what_cannot_be_inserted_or_taken_out_is_named() {
    let mut merged = merged_with(&soup(10, 0.2, 1), ROOM);
    let ball = || kd_tree_of(&icosphere(1), &HostKdOptions::BINNED);
    let error_of = |result: hedgerow::Result<()>| result.expect_err("wrong").to_string();
    assert!(
        error_of(merged.take_out("ball"))
            .contains("\"ball\" cannot be taken out, it is not in the tree; what is: nothing")
    );
    merged.insert("ball", 10, ball()).expect("apart");
    assert!(error_of(merged.insert("ball", 1000, ball())).contains("\"ball\" is in the tree already"));
    assert!(error_of(merged.take_out("bal")).contains("what is: ball"));
    assert!(error_of(merged.insert("b", 9, ball())).contains("primitives 9..89 overlap"));
    assert!(error_of(merged.insert("b", 89, ball())).contains("overlap 10..90 of ball"));
    assert!(error_of(merged.insert("b", 5, ball())).contains("overlap"));
    assert!(error_of(merged.insert("b", u32::MAX - 3, ball())).contains("more than 32 bits"));
    merged.insert("b", 90, ball()).expect("apart");
    merged.tree().expect("room").validate().expect("valid");
    merged.take_out("ball").expect("it is there");
    assert!(error_of(merged.take_out("ball")).contains("what is: b"));
}

#[test]
fn without_room_nothing_is_merged_and_what_is_needed_is_said() {
    let corners = soup(10, 0.2, 1);
    for (room, what) in [
        (SpareRoom { nodes: 3, ..ROOM }, "nodes, there is room for"),
        (SpareRoom { references: 3, ..ROOM }, "references, there is room for"),
        (SpareRoom { records: 79, ..ROOM }, "the merged tree has 91 records, there is room for 89"),
    ] {
        let still = kd_tree_of(&corners, &HostKdOptions::EXACT).with_room(room).expect("room").to_bytes();
        let mut merged = merged_with(&corners, room);
        merged.insert("small", 10, kd_tree_of(&soup(1, 0.1, 5), &HostKdOptions::BINNED)).expect("apart");
        merged.insert("ball", 100, kd_tree_of(&icosphere(1), &HostKdOptions::BINNED)).expect("apart");
        let error = merged.tree().expect_err("no room").to_string();
        assert!(error.contains(what), "{error}");
        merged.take_out("ball").expect("it is there");
        merged.take_out("small").expect("it is there");
        assert!(merged.tree().expect("nothing to merge").to_bytes() == still);
    }
}

#[test]
fn triangles_that_cannot_be_met_are_left_out_and_the_status_says_so() {
    let mut corners = icosphere(1);
    corners[3][1][2] = f32::NAN;
    let mut merged = merged_with(&soup(10, 0.2, 1), ROOM);
    merged.insert("broken", 10, kd_tree_of(&corners, &HostKdOptions::BINNED)).expect("apart");
    let tree = merged.tree().expect("room");
    tree.validate().expect("valid");
    let header = tree.header;
    assert_eq!((header.status, header.active, header.primitive_count), (status::NON_FINITE, 89, 90));
    assert_eq!(merged.restore().header.status, 0);
}

/// At each level of the chain, the plane halves what is left, with a triangle on the right.
fn chain(depth: u32) -> KdTree {
    let at = |level: u32| 2f32.powi(-(level as i32));
    let corners: Corners = (0..depth)
        .map(|level| {
            let x = 0.75 * at(level);
            [[x, 0.0, 0.0], [x, 0.5, 0.0], [x, 0.0, 0.5]]
        })
        .collect();
    let mut tree = kd_tree_of(&corners, &HostKdOptions::EXACT);
    // The root at 0, then pairs; the last left child is a leaf as well, of the last triangle but one's neighbour.
    tree.nodes = vec![KdNode::leaf(0, 1)];
    for level in 0..depth - 1 {
        let (parent, pair) = (tree.nodes.len() - if level == 0 { 1 } else { 2 }, tree.nodes.len() as u32);
        tree.nodes[parent] = KdNode::inner(0, at(level + 1), pair, [false; 2]);
        tree.nodes.extend([KdNode::leaf(depth - 1, 1), KdNode::leaf(level, 1)]);
    }
    tree.references = (0..depth).collect();
    let count = tree.nodes.len() as u32;
    tree.header = KdHeader {
        node_count: count,
        node_room: count,
        reference_count: depth,
        reference_room: depth,
        inner_nodes: depth - 1,
        leaves: depth,
        empty_leaves: 0,
        depth: depth - 1,
        ..tree.header
    };
    tree
}

#[test]
fn a_static_tree_that_is_too_deep_for_planes_around_it_takes_no_object_outside() {
    let still = chain(MAX_DEPTH + 1).with_room(ROOM).expect("room");
    let bytes = still.to_bytes();
    let mut merged = Merged::new(still, Costs::DEFAULT);
    let far = kd_tree_of(&placed(&icosphere(1), 1.0, [9.0, 9.0, 0.0]), &HostKdOptions::BINNED);
    merged.insert("far", 100, far).expect("apart");
    let error = merged.tree().expect_err("too deep").to_string();
    assert!(error.contains("the static tree would be 42 deep, the most is 41"), "{error}");
    merged.take_out("far").expect("it is there");
    assert!(merged.tree().expect("nothing to merge").to_bytes() == bytes);
}

#[test]
fn where_a_tree_would_be_too_deep_it_has_leaves_and_says_so() {
    let still = chain(MAX_DEPTH - 1).with_room(ROOM).expect("room");
    still.validate().expect("valid");
    let small = 2f32.powi(1 - MAX_DEPTH as i32);
    let ball = placed(&icosphere(2), 0.3 * small, [0.5 * small, 0.1 * small, 0.1 * small]);
    let all: Corners = still.records.iter().map(|t| [t.v0, t.v1, t.v2]).chain(ball.iter().copied()).collect();
    let bytes = still.to_bytes();
    let mut merged = Merged::new(still, Costs::DEFAULT);
    merged.insert("ball", MAX_DEPTH - 1, kd_tree_of(&ball, &HostKdOptions::BINNED)).expect("apart");
    let tree = merged.tree().expect("room");
    tree.validate().expect("valid");
    assert_eq!((tree.header.depth, tree.header.status), (MAX_DEPTH, status::DEPTH_LIMITED));
    let rays: Vec<Ray> = ball
        .iter()
        .map(|[a, b, c]| {
            ray([0.5, 0.3, -1.0], std::array::from_fn(|k| 0.3 * (a[k] + b[k] + c[k]) - [0.5, 0.3, -1.0][k]))
        })
        .collect();
    assert_hits_of_brute_force("deep", tree, &all, &rays);
    assert!(merged.restore().to_bytes() == bytes);
}
