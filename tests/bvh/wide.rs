//! Wide trees collapsed on the device equal the host's, byte for byte, over inputs that hurt, and are valid.

use crate::common::shapes::{hard_rays, soup, tree_of};
use crate::common::{corpus, device};
use hedgerow::bvh::child_order::ChildOrder;
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::counts::LinkCount;
use hedgerow::bvh::geometry::Primitives;
use hedgerow::bvh::layout::{Bvh2, Child, Header, Node, Record, Triangle, status};
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::lbvh;
use hedgerow::bvh::twin::wide::LinkCounts;
use hedgerow::bvh::wide::device::{WideCounts, WideOptions, WidePass};
use hedgerow::bvh::wide::layout::{Wide, WideNode};
use hedgerow::bvh::wide::quantised::QuantisedNode;
use hedgerow::geometry::Aabb;
use hedgerow::trace::counts::CountedWalk;
use hedgerow::trace::twin::counts as host_counts;
use hedgerow::trace::twin::wide::{self as wide_host, TracedNode};
use hedgerow::trace::wide::Order;
use hedgerow::trace::{Query, Ray};
use std::collections::HashMap;

const GUARD: [u8; 256] = [0xA5; 256];

/// The bytes in use of the wide tree that the device makes of `tree`; nothing else is written.
fn collapsed<N: WideNode>(tree: &Bvh2) -> Vec<u8> {
    collapsed_as::<N>(tree, tree.header.primitive_count)
}

/// The same by counts of links.
fn collapsed_by<N: WideNode>(tree: &Bvh2, counts: &WideCounts) -> Vec<u8> {
    collapsed_with::<N>(tree, tree.header.primitive_count, counts)
}

/// The same, planned for trees of up to `count` primitives.
fn collapsed_as<N: WideNode>(tree: &Bvh2, count: u32) -> Vec<u8> {
    collapsed_with::<N>(tree, count, &WideCounts::default())
}

fn collapsed_with<N: WideNode>(tree: &Bvh2, count: u32, counts: &WideCounts) -> Vec<u8> {
    let device = device();
    let geometry_count = tree.header.geometry_count;
    let options = WideOptions { form: N::FORM, primitives: Primitives::Triangles, geometry_count };
    let wide = WidePass::new(device, &options, count);
    let sizes = wide.sizes();
    let source = device.upload("source", &tree.to_bytes()).unwrap();
    // Whatever was there before is of no interest.
    let guarded = |bytes: u64| [vec![0xEEu8; bytes as usize], GUARD.to_vec()].concat();
    let target = device.upload("target", &guarded(sizes.structure)).unwrap();
    let scratch = device.upload("scratch", &guarded(sizes.scratch)).unwrap();
    let (target_at, scratch_at) = (target.region(), scratch.region());
    device.run(None, |r| wide.record_by_counts(r, source.address(), counts, target_at, scratch_at)).unwrap();
    for (what, buffer, bytes) in [("target", &target, sizes.structure), ("scratch", &scratch, sizes.scratch)] {
        assert_eq!(buffer.read_at::<u8>(bytes, GUARD.len()), GUARD, "wrote behind the {what}");
    }
    let header: Header = target.read(1)[0];
    let used = N::FORM.bytes_in_use(&header, size_of::<Triangle>() as u64);
    assert!(used <= sizes.structure, "{used} bytes in use of {}", sizes.structure);
    target.read(used as usize)
}

fn assert_as_on_the_host<N: WideNode>(name: &str, tree: &Bvh2) {
    let expected = Wide::<N>::of(tree);
    expected.validate().unwrap_or_else(|error| panic!("{name} {}: {error}", N::FORM));
    let bytes = collapsed::<N>(tree);
    let got = Wide::<N>::from_bytes(&bytes).unwrap_or_else(|error| panic!("{name} {}: {error}", N::FORM));
    assert_eq!(got.header, expected.header, "{name} {}", N::FORM);
    for (i, (got, expected)) in got.nodes.iter().zip(&expected.nodes).enumerate() {
        assert_eq!(got, expected, "{name} {}: node {i}", N::FORM);
    }
    assert!(bytes == expected.to_bytes(), "{name} {}: other bytes", N::FORM);
}

/// Also of the tree with its children in order.
pub fn assert_all_forms(name: &str, tree: &Bvh2) {
    assert_as_on_the_host::<[Child; 4]>(name, tree);
    assert_as_on_the_host::<[Child; 8]>(name, tree);
    assert_as_on_the_host::<QuantisedNode>(name, tree);
    let ordered = tree.clone().in_child_order(ChildOrder::MoreHitsForItsCost, &Collapse::SAH);
    let name = format!("{name} in order");
    assert_as_on_the_host::<[Child; 4]>(&name, &ordered);
    assert_as_on_the_host::<[Child; 8]>(&name, &ordered);
    assert_as_on_the_host::<QuantisedNode>(&name, &ordered);
}

/// The primitives below a child of a binary tree, left children first.
fn met_in(tree: &Bvh2, child: &Child, met: &mut Vec<u32>) {
    if child.is_leaf() {
        met.extend(tree.records[child.index as usize..][..child.count as usize].iter().map(|record| record.primitive));
    } else {
        tree.nodes[child.index as usize].children.iter().for_each(|child| met_in(tree, child, met));
    }
}

/// The same below a wide node, by slots.
fn met_in_wide<N: WideNode>(tree: &Wide<N>, node: u32, met: &mut Vec<u32>) {
    let leaf = |first: u32, count: u32, met: &mut Vec<u32>| {
        met.extend(tree.leaf(first, count).iter().map(|record| record.primitive));
    };
    let node = &tree.nodes[node as usize];
    if let Some((first, count)) = node.long_leaf() {
        leaf(first, count, met);
    }
    for child in node.children().iter().flatten() {
        if child.is_leaf() {
            leaf(child.index, child.count, met);
        } else {
            met_in_wide(tree, child.index, met);
        }
    }
}

#[track_caller]
fn assert_met_in_order<N: WideNode>(tree: &Bvh2) {
    let wide = Wide::<N>::of(tree);
    assert_eq!(wide.header.child_order, tree.header.child_order, "{}", N::FORM);
    let (mut expected, mut met) = (Vec::new(), Vec::new());
    met_in(tree, &tree.header.root, &mut expected);
    met_in_wide(&wide, 0, &mut met);
    assert_eq!(met, expected, "{}", N::FORM);
}

#[test]
fn children_in_order_lie_as_the_binary_walk_meets_them() {
    let (_, positions, triangles) = corpus::random("3,000 random", 3_000, [0.0; 3], [1.0; 3]);
    let random = lbvh::build(&positions, &triangles, Code::Emc64Var.full(), Collapse::SAH);
    let lengths: Vec<usize> = (0..70).map(|i| [1, 2, 300, 5][i % 4]).collect();
    for tree in [random, piles(&lengths), deep(2), piles(&[300])] {
        for order in ChildOrder::ALL {
            let ordered = tree.clone().in_child_order(order, &Collapse::SAH);
            assert_met_in_order::<[Child; 4]>(&ordered);
            assert_met_in_order::<[Child; 8]>(&ordered);
            assert_met_in_order::<QuantisedNode>(&ordered);
        }
    }
}

/// Boxes tell which link a child is; `None` where two have the same.
fn counts_by_box(tree: &Bvh2, counts: &[LinkCount]) -> HashMap<([u32; 6], bool), Option<LinkCount>> {
    let mut by_box = HashMap::new();
    for (slot, node) in tree.nodes.iter().enumerate().filter(|(_, node)| node.is_used()) {
        for (side, child) in node.children.iter().enumerate() {
            let count = counts[2 * slot + side];
            by_box.entry(key(child)).and_modify(|same| *same = None).or_insert(Some(count));
        }
    }
    by_box
}

fn key(child: &Child) -> ([u32; 6], bool) {
    let [a, b] = [child.lo, child.hi].map(|corner| corner.map(f32::to_bits));
    ([a[0], a[1], a[2], b[0], b[1], b[2]], child.is_leaf())
}

#[test]
fn children_that_end_more_rays_for_their_work_come_first() {
    let corners = soup(3_000, 0.1, 7);
    let rays = hard_rays(&corners, 4_000, 1.0, [0.0; 3], 11);
    let tree = tree_of(&corners);
    let mut counts = vec![LinkCount::default(); 2 * tree.nodes.len()];
    host_counts::count(&tree, &rays, CountedWalk::Exhaustive, &Collapse::SAH, &mut counts);
    let ordered = tree.in_order_of_counts(&mut counts, &Collapse::SAH);
    assert_by_hits::<[Child; 4]>(&ordered, &counts, &rays);
    assert_by_hits::<[Child; 8]>(&ordered, &counts, &rays);
    assert_by_hits::<QuantisedNode>(&ordered, &counts, &rays);

    fn assert_by_hits<N: TracedNode>(tree: &Bvh2, counts: &[LinkCount], rays: &[Ray]) {
        let wide = Wide::<N>::of_counts(tree, &LinkCounts { ordered_by: counts, ..LinkCounts::default() });
        wide.validate().expect("valid");
        let buffer = device().upload("counts", counts).expect("memory");
        let on_device = WideCounts { ordered_by: Some(buffer.region()), ..WideCounts::default() };
        assert!(collapsed_by::<N>(tree, &on_device) == wide.to_bytes(), "{}: other bytes", N::FORM);
        let by_walk = Wide::<N>::of(tree);
        assert!(wide.to_bytes() != by_walk.to_bytes(), "{}: nothing was put in order", N::FORM);
        for ray in rays {
            let [by_hits, by_walk] =
                [&wide, &by_walk].map(|wide| wide_host::trace(wide, ray, Query::AnyHit, Order::LeftFirst).0);
            assert_eq!(by_hits.t, by_walk.t, "{} {ray:?}", N::FORM);
        }
        if N::FORM.is_quantised() {
            return;
        }
        let by_box = counts_by_box(tree, counts);
        let (mut pairs, worth) = (0, |a: &LinkCount, b: &LinkCount| f64::from(a.hits) * (f64::from(b.work) + 24.0));
        for node in &wide.nodes {
            let known: Vec<LinkCount> =
                node.children().iter().flatten().filter_map(|child| by_box[&key(child)]).collect();
            for pair in known.windows(2) {
                pairs += 1;
                let [first, second] = [worth(&pair[0], &pair[1]), worth(&pair[1], &pair[0])];
                assert!(first >= second * (1.0 - 1e-6), "{}: {pair:?}", N::FORM);
            }
        }
        assert!(pairs > 500, "{}: {pairs}", N::FORM);
    }
}

/// What an order is not: other children. Nodes open the same ones, whatever slots those go to.
#[test]
fn an_order_leaves_nodes_their_children() {
    fn children_of<N: WideNode>(tree: &Bvh2) -> Vec<Vec<[u32; 6]>> {
        let bits = |child: &Child| [child.lo, child.hi].concat().iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        let of_node = |node: &N| {
            let mut all: Vec<[u32; 6]> =
                node.children().iter().flatten().map(|child| bits(child).try_into().expect("six")).collect();
            all.sort_unstable();
            all
        };
        let mut all: Vec<_> = Wide::<N>::of(tree).nodes.iter().map(of_node).collect();
        all.sort_unstable();
        all
    }
    let (_, positions, triangles) = corpus::random("3,000 random", 3_000, [0.0; 3], [1.0; 3]);
    let tree = lbvh::build(&positions, &triangles, Code::Emc64Var.full(), Collapse::SAH);
    let ordered = tree.clone().in_child_order(ChildOrder::MoreHitsForItsCost, &Collapse::SAH);
    assert!(Wide::<[Child; 8]>::of(&tree).nodes != Wide::<[Child; 8]>::of(&ordered).nodes, "nothing was ordered");
    assert_eq!(children_of::<[Child; 4]>(&ordered), children_of::<[Child; 4]>(&tree));
    assert_eq!(children_of::<[Child; 8]>(&ordered), children_of::<[Child; 8]>(&tree));
    assert_eq!(children_of::<QuantisedNode>(&ordered), children_of::<QuantisedNode>(&tree));
}

#[test]
fn wide_trees_of_bad_scenes_have_the_bytes_of_the_host() {
    for (name, positions, triangles) in corpus::meshes() {
        for collapse in [Collapse::OFF, Collapse::SAH] {
            for codes in [Code::Emc64Var.full(), Code::Mc30.full()] {
                assert_all_forms(&name, &lbvh::build(&positions, &triangles, codes, collapse));
            }
        }
    }
}

/// Triangles far apart in piles of so many equal ones: leaves of these lengths.
pub fn piles(lengths: &[usize]) -> Bvh2 {
    let mut positions = Vec::new();
    for (i, &length) in lengths.iter().enumerate() {
        let at = [i as f32 * 3.0, (i * i % 7) as f32 * 5.0, (i % 3) as f32];
        let corners = [at, [at[0] + 1.0, at[1], at[2]], [at[0], at[1] + 1.0, at[2]]];
        (0..length).for_each(|_| positions.extend(corners));
    }
    let triangles: Vec<[u32; 3]> = (0..positions.len() as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    lbvh::build(&positions, &triangles, Code::Emc64Var.full(), Collapse::SAH)
}

#[test]
fn leaves_of_any_length_stay_leaves() {
    for lengths in [
        &[254, 255, 256, 257, 1, 2, 1000, 3][..],
        &[300; 20],
        &[1; 9],
        &[255],
        &[256],
        &[5000],
        &[256, 1, 256, 1, 256, 1, 256, 1, 256],
    ] {
        let tree = piles(lengths);
        assert_all_forms(&format!("piles of {lengths:?}"), &tree);
        let mut found: Vec<u32> = leaves(&Wide::<QuantisedNode>::of(&tree));
        let mut expected: Vec<u32> = leaves(&Wide::<[Child; 8]>::of(&tree));
        found.sort_unstable();
        expected.sort_unstable();
        assert_eq!(found, expected, "{lengths:?}");
        assert_eq!(found.iter().max().map(|&most| most as usize), lengths.iter().max().copied(), "{lengths:?}");
    }

    fn leaves<N: WideNode>(tree: &Wide<N>) -> Vec<u32> {
        let records = |first, count| tree.leaf(first, count).len() as u32;
        let long = |node: &N| node.long_leaf().map(|(first, count)| records(first, count));
        let short = |node: &N| {
            node.children().into_iter().flatten().filter(Child::is_leaf).map(|c| records(c.index, c.count)).collect()
        };
        tree.nodes.iter().flat_map(|node| long(node).map_or_else(|| short(node), |count| vec![count])).collect()
    }
}

/// A tree of 96 levels whose nodes all have a leaf beside a node, or beside a small tree: as deep as trees may be.
fn deep(beside: usize) -> Bvh2 {
    let mut tree = piles(&vec![1; 1 + 96 * beside]);
    let mut nodes: Vec<Node> = Vec::new();
    let leaf = |i: usize| {
        let Aabb { lo, hi } = tree.records[i].bounds().expect("a triangle");
        Child { lo, index: i as u32, hi, count: 1 }
    };
    let join = |nodes: &mut Vec<Node>, a: Child, b: Child| {
        nodes.push(Node { children: [a, b] });
        let Aabb { lo, hi } = a.bounds().union(&b.bounds());
        Child { lo, index: nodes.len() as u32 - 1, hi, count: 0 }
    };
    let mut root = leaf(0);
    let levels = if beside == 1 { 96 } else { 95 };
    let mut next = 1;
    for _ in 0..levels {
        let mut side = leaf(next);
        for _ in 1..beside {
            next += 1;
            side = join(&mut nodes, side, leaf(next));
        }
        next += 1;
        root = join(&mut nodes, root, side);
    }
    tree.records.truncate(next);
    tree.header.primitive_count = next as u32;
    tree.header.active = next as u32;
    tree.header.node_slots = next as u32 - 1;
    tree.header.inner_nodes = nodes.len() as u32;
    tree.header.root = root;
    nodes.resize(next - 1, Node::UNUSED);
    tree.nodes = nodes;
    // The order of records is the walk's; primitive indices are whatever they are, each there once.
    for (i, record) in tree.records.iter_mut().enumerate() {
        record.primitive = i as u32;
    }
    tree.validate().expect("a deep tree");
    tree
}

#[test]
fn trees_as_deep_as_they_may_be_have_as_many_levels_as_tracers_can_walk() {
    for beside in [1, 2] {
        assert_all_forms(&format!("deep, {beside} beside"), &deep(beside));
    }
}

/// Levels are opened by one workgroup, or the first ones and the last ones by one and those between by many: what was planned for
/// says which.
#[test]
fn small_and_deep_trees_planned_as_large_ones_have_the_same_bytes() {
    for tree in [piles(&[1]), piles(&[1; 9]), deep(1), deep(2)] {
        for planned in [2_000, 20_000, 100_000] {
            let planned = planned + tree.header.primitive_count;
            assert!(collapsed_as::<[Child; 4]>(&tree, planned) == collapsed::<[Child; 4]>(&tree), "{planned}");
            assert!(collapsed_as::<QuantisedNode>(&tree, planned) == collapsed::<QuantisedNode>(&tree), "{planned}");
        }
    }
}

#[test]
fn what_cannot_be_traced_becomes_an_empty_tree_with_its_status() {
    let tree = piles(&[1; 40]);
    for bit in [status::TOO_DEEP, status::SPIN_RAN_OUT, status::WRONG_VERSION] {
        let mut tree = tree.clone();
        tree.header.status |= bit;
        assert_all_forms("unusable", &tree);
        assert_eq!(Wide::<QuantisedNode>::of(&tree).header.status & bit, bit);
    }
    // What is no structure at all.
    let mut garbage = tree.clone();
    garbage.header.magic ^= 1;
    let bytes = collapsed::<QuantisedNode>(&garbage);
    let wide = Wide::<QuantisedNode>::from_bytes(&bytes).expect("a wide tree");
    wide.validate().expect("of nothing");
    assert_eq!((wide.header.active, wide.header.status), (0, status::WRONG_VERSION));
}

#[test]
fn twenty_collapses_give_the_same_bytes() {
    let (_, positions, triangles) = corpus::random("20,000 random", 20_000, [0.0; 3], [1.0; 3]);
    let tree = lbvh::build(&positions, &triangles, Code::Emc64Var.full(), Collapse::SAH);
    let first = collapsed::<QuantisedNode>(&tree);
    for run in 1..20 {
        assert!(collapsed::<QuantisedNode>(&tree) == first, "run {run} gave other bytes");
    }
    assert_all_forms("20,000 random", &tree);
}
