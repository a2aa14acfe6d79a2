//! Wide nodes cost least, and are no more than memory is asked for.

use crate::bvh::wide::{assert_all_forms, piles};
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::layout::{Bvh2, Child, Node, Record};
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::lbvh;
use hedgerow::bvh::wide::layout::{Wide, WideNode};
use hedgerow::bvh::wide::quantised::QuantisedNode;
use hedgerow::geometry::Aabb;
use hedgerow_lab::random::SplitMix64;

/// The half area of a box in double precision.
fn half_area(b: &Aabb) -> f64 {
    let [x, y, z]: [f64; 3] = std::array::from_fn(|i| f64::from(b.hi[i]) - f64::from(b.lo[i]));
    x * y + y * z + z * x
}

/// All sets of up to `most` nodes and leaves that a subtree may be replaced by, itself among them.
fn replacements(tree: &Bvh2, child: &Child, most: usize) -> Vec<Vec<Child>> {
    let mut all = vec![vec![*child]];
    if child.is_leaf() || most < 2 {
        return all;
    }
    let [left, right] = tree.nodes[child.index as usize].children;
    for of_left in replacements(tree, &left, most - 1) {
        for of_right in replacements(tree, &right, most - of_left.len()) {
            all.push([&of_left[..], &of_right].concat());
        }
    }
    all
}

/// The least sum of areas of wide nodes, all ways tried.
fn least_cost(tree: &Bvh2, child: &Child, width: usize, known: &mut Vec<Option<f64>>) -> f64 {
    if child.is_leaf() {
        return 0.0;
    }
    if let Some(cost) = known[child.index as usize] {
        return cost;
    }
    let ways = replacements(tree, child, width);
    let below = ways.iter().skip(1).map(|way| way.iter().map(|c| least_cost(tree, c, width, known)).sum::<f64>());
    let least = below.collect::<Vec<_>>().into_iter().fold(f64::INFINITY, f64::min);
    let cost = half_area(&child.bounds()) + least;
    known[child.index as usize] = Some(cost);
    cost
}

fn assert_costs_least<N: WideNode>(tree: &Bvh2) {
    let wide = Wide::<N>::of(tree);
    let area = |node: &N| {
        let children = node.children();
        half_area(&children.iter().flatten().fold(Aabb::EMPTY, |b, child| b.union(&child.bounds())))
    };
    let cost: f64 = wide.nodes.iter().map(area).sum();
    let least = least_cost(tree, &tree.header.root, N::FORM.width() as usize, &mut vec![None; tree.nodes.len()]);
    assert!((cost - least).abs() <= 1e-5 * least, "{}: {cost}, and there is {least}", N::FORM);
}

#[test]
fn no_other_wide_nodes_of_a_small_tree_cost_less() {
    for seed in 0..40 {
        let tree = random_tree(2 + seed as usize % 23, seed, 3);
        assert_costs_least::<[Child; 4]>(&tree);
        assert_costs_least::<[Child; 8]>(&tree);
    }
}

/// A tree of random shape over as many triangles, whose sizes are powers of two from 2^-`spread` to 2^`spread`; all at one place where
/// it is 0.
fn random_tree(count: usize, seed: u64, spread: u32) -> Bvh2 {
    let mut random = SplitMix64::new(seed);
    let mut positions = Vec::new();
    for _ in 0..count {
        let size = (f64::from(spread) * f64::from(random.signed())).exp2() as f32;
        let at: [f32; 3] = std::array::from_fn(|_| if spread == 0 { 1.0 } else { size * random.signed() });
        let size = if spread == 0 { 0.5 } else { size };
        positions.extend([at, [at[0] + size, at[1], at[2] + size], [at[0], at[1] + size, at[2]]]);
    }
    let triangles: Vec<[u32; 3]> = (0..count as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let mut tree = lbvh::build(&positions, &triangles, Code::Emc64Var.full(), Collapse::OFF);
    assert_eq!(tree.header.active, count as u32);
    let leaf = |i: usize| {
        let Aabb { lo, hi } = tree.records[i].bounds().expect("a triangle");
        Child { lo, index: i as u32, hi, count: 1 }
    };
    let mut left: Vec<Child> = (0..count).map(leaf).collect();
    let mut nodes = Vec::new();
    while left.len() > 1 {
        let at = random.bits() as usize % (left.len() - 1);
        let (a, b) = (left[at], left.remove(at + 1));
        let Aabb { lo, hi } = a.bounds().union(&b.bounds());
        left[at] = Child { lo, index: nodes.len() as u32, hi, count: 0 };
        nodes.push(Node { children: [a, b] });
    }
    tree.header.root = left[0];
    tree.nodes = nodes;
    tree.header.node_slots = tree.nodes.len() as u32;
    tree.header.inner_nodes = tree.header.node_slots;
    tree.validate().expect("a binary tree");
    tree
}

fn assert_few_nodes<N: WideNode>(tree: &Bvh2) {
    let wide = Wide::<N>::of(tree);
    let most = N::FORM.nodes_at_most(tree.header.active);
    assert!(wide.nodes.len() as u32 <= most, "{}: {} nodes, {most} at most", N::FORM, wide.nodes.len());
}

/// Areas that differ by more than floats hold, and some that do not differ: the sums of costs tell nothing then.
#[test]
fn nodes_are_as_many_as_are_asked_for_at_most() {
    for seed in 0..60 {
        for spread in [0, 4, 30] {
            let tree = random_tree(2 + (seed as usize * 7) % 400, seed, spread);
            assert_few_nodes::<[Child; 4]>(&tree);
            assert_few_nodes::<[Child; 8]>(&tree);
            assert_few_nodes::<QuantisedNode>(&tree);
        }
    }
}

#[test]
fn trees_of_any_shape_have_the_bytes_of_the_host() {
    for (seed, spread) in [(1, 0), (2, 3), (3, 30)] {
        assert_all_forms(&format!("random shape, sizes to 2^{spread}"), &random_tree(300, seed, spread));
    }
    assert_all_forms("piles", &piles(&[1; 200]));
}
