//! The top of a finished tree, rebuilt as the cheapest one over the largest subtrees.
//!
//! A greedy split is chosen as if both sides were leaves. That is farthest from the truth at the top, where little of the cost is
//! that of leaves. So the largest subtrees, by the areas of their boxes, keep what is in them, and the optimum by planes of section
//! 3.4 of van Kralingen 2023 (see `optimal`) is built above them. The old top need not be among the trees by planes over the boxes
//! of subtrees: it stays if it is no costlier.

use super::{Entry, MOST_BY_PLANES, entries_of, leaf_cost, planes, step_cost};
use crate::bvh::bounds::{Bounds, Item};
use crate::bvh::topology::{LEAF, Span, Topology};
use hedgerow::bvh::sah::Collapse;
use hedgerow::{Error, Result};
use std::collections::BinaryHeap;

/// How much of a tree's top is rebuilt.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TopOptions {
    /// The most subtrees that the top is built over: 2 to [`MOST_BY_PLANES`]. The time grows with a high power of them.
    pub subtrees: u32,
}

impl TopOptions {
    pub(in super::super) fn check(&self) -> Result<()> {
        let subtrees = self.subtrees;
        if (2..=MOST_BY_PLANES as u32).contains(&subtrees) {
            return Ok(());
        }
        Err(Error::Argument(format!(
            "a top over {subtrees} subtrees cannot be built; take 2 to {MOST_BY_PLANES} subtrees"
        )))
    }
}

/// A tree that costs no more than this one does once both are collapsed. `items` are its primitives from left to right.
pub(in super::super) fn optimise(tree: Topology, items: &[Item], costs: &Collapse, options: &TopOptions) -> Topology {
    if items.len() < 3 {
        return tree;
    }
    let measured = MeasuredTree::new(&tree, items, costs);
    let roots = measured.largest(options.subtrees as usize);
    let entries: Vec<Entry> = roots.iter().map(|&root| measured.entry(root)).collect();
    let found = planes::search(&entries, costs);
    if found.cost >= measured.entry(Span::whole(items.len())).cost {
        return tree;
    }
    // A leaf over several subtrees is left to the collapse, which finds it again: it is the cheapest there.
    let half = |set: u64| Some(entries_of(set).take(set.count_ones() as usize / 2).fold(0, |half, i| half | 1 << i));
    let counts: Vec<u32> = roots.iter().map(|root| root.count).collect();
    found.topology(entries.len(), half).expanded(&counts, |top, root| {
        let root = roots[root as usize];
        top.order.extend_from_slice(&tree.order[root.primitives()]);
        top.splits.extend_from_slice(&tree.splits[root.slots()]);
    })
}

/// A tree with what is in its slots.
struct MeasuredTree<'a> {
    tree: &'a Topology,
    items: &'a [Item],
    costs: &'a Collapse,
    /// Of each slot that is used, its subtree as an entry.
    nodes: Vec<Entry>,
}

impl<'a> MeasuredTree<'a> {
    fn new(tree: &'a Topology, items: &'a [Item], costs: &'a Collapse) -> MeasuredTree<'a> {
        let none = Entry { bounds: Bounds::EMPTY, weight: 0, cost: 0.0 };
        let mut measured = MeasuredTree { tree, items, costs, nodes: vec![none; tree.splits.len()] };
        // Parents come before their children, however deep the tree is.
        let mut spans = vec![Span { slot: 0, first: 0, count: 0 }; tree.splits.len()];
        spans[0] = Span::whole(items.len());
        for slot in 0..spans.len() {
            let inner = measured.children(spans[slot]).into_iter().flatten().filter(|child| child.count > 1);
            inner.for_each(|child| spans[child.slot as usize] = child);
        }
        for (slot, &span) in spans.iter().enumerate().rev().filter(|(_, span)| span.count > 0) {
            measured.nodes[slot] = measured.measure(span);
        }
        measured
    }

    fn children(&self, span: Span) -> Option<[Span; 2]> {
        let split = (span.count > 1).then(|| self.tree.splits[span.slot as usize])?;
        (split != LEAF).then(|| span.children(split))
    }

    fn entry(&self, span: Span) -> Entry {
        match span.count {
            1 => Entry::of_box(&self.items[span.first as usize], self.costs),
            _ => self.nodes[span.slot as usize],
        }
    }

    /// A subtree whose children are known, at the cost that it has once it is collapsed.
    fn measure(&self, span: Span) -> Entry {
        let Some([left, right]) = self.children(span).map(|children| children.map(|child| self.entry(child))) else {
            let bounds = crate::bvh::bounds::around(&self.items[span.primitives()]);
            return Entry { bounds, weight: span.count, cost: leaf_cost(self.costs, &bounds, span.count.into()) };
        };
        let bounds = left.bounds.union(right.bounds);
        let as_inner = step_cost(self.costs, &bounds) + (left.cost + right.cost);
        let as_leaf = leaf_cost(self.costs, &bounds, span.count.into());
        let cost = if self.costs.enabled { as_inner.min(as_leaf) } else { as_inner };
        Entry { bounds, weight: span.count, cost }
    }

    /// At most `most` subtrees that hold all of the tree, from left to right: the largest box is opened first.
    fn largest(&self, most: usize) -> Vec<Span> {
        let open = |span: Span| Open { area: self.entry(span).bounds.half_area(), span };
        let mut waiting = BinaryHeap::from([open(Span::whole(self.items.len()))]);
        let mut roots = Vec::new();
        while waiting.len() + roots.len() < most
            && let Some(Open { span, .. }) = waiting.pop()
        {
            match self.children(span) {
                Some(children) => waiting.extend(children.map(open)),
                None => roots.push(span),
            }
        }
        roots.extend(waiting.into_iter().map(|open| open.span));
        roots.sort_by_key(|root| root.first);
        roots
    }
}

/// A subtree that may be opened: the largest first, of equal ones the first from the left.
#[derive(Clone, Copy)]
struct Open {
    area: f32,
    span: Span,
}

impl Ord for Open {
    fn cmp(&self, other: &Open) -> std::cmp::Ordering {
        self.area.total_cmp(&other.area).then(other.span.first.cmp(&self.span.first))
    }
}

impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Open) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Open {
    fn eq(&self, other: &Open) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Open {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::optimal::tests::{Random, random_triangles};
    use crate::bvh::{AacOptions, BinnedOptions, HostBvhOptions, HostMethod, HostOptimise, build_aabbs};
    use hedgerow::bvh::layout::{BoxRecord, Bvh2};
    use hedgerow::geometry::Aabb;

    fn soup(count: usize, size: f32, seed: u64) -> Vec<Aabb> {
        let mut random = Random::new(seed);
        let mut of = |_| {
            let lo = [0; 3].map(|_| random.next());
            Aabb { lo, hi: lo.map(|x| x + size * random.next()) }
        };
        (0..count).map(&mut of).collect()
    }

    fn built(boxes: &[Aabb], method: HostMethod, collapse: Collapse, optimise: HostOptimise) -> Bvh2<BoxRecord> {
        let options = HostBvhOptions { collapse, optimise, ..HostBvhOptions::of(method) };
        build_aabbs(boxes, &options).expect("sound options").tree
    }

    #[test]
    fn a_rebuilt_top_never_costs_more() {
        let methods = [HostMethod::Sweep, HostMethod::Binned(BinnedOptions::WALD), HostMethod::Aac(AacOptions::FAST)];
        let mut gains = 0;
        for seed in 0..12 {
            let soups =
                [soup(40, 0.9, seed), soup(1000, 0.05, seed), soup(3000, 0.5, seed), random_triangles(20, seed)];
            for (boxes, method) in soups.iter().flat_map(|boxes| methods.map(|method| (boxes, method))) {
                for collapse in [Collapse::SAH, Collapse::OFF] {
                    for subtrees in [2, 5, 12] {
                        // Leaves come from collapsing in both, as the top wants single primitives.
                        let off = HostBvhOptions { collapse, ..HostBvhOptions::of(method) };
                        let off = HostBvhOptions { termination: crate::bvh::Termination::Single, ..off };
                        let before = build_aabbs(boxes, &off).expect("sound options").tree.header.cost;
                        let after = built(boxes, method, collapse, HostOptimise::Top(TopOptions { subtrees }));
                        after.validate().expect("valid");
                        let after = after.header.cost;
                        assert!(
                            after <= before * (1.0 + 1e-6),
                            "{method:?}, {subtrees}, seed {seed}: {after} > {before}"
                        );
                        gains += u32::from(after < before * 0.999);
                    }
                }
            }
        }
        assert!(gains > 100, "only {gains} of 864 trees became cheaper");
    }

    #[test]
    fn over_as_many_subtrees_as_boxes_it_is_the_optimum_by_planes() {
        for seed in 0..20 {
            let boxes = random_triangles(12, seed);
            for costs in [Collapse::SAH, Collapse::OFF] {
                let top = built(&boxes, HostMethod::Sweep, costs, HostOptimise::Top(TopOptions { subtrees: 64 }));
                let least = crate::bvh::optimal::of_planes(&boxes, &costs).expect("few boxes").tree;
                let ratio = top.header.cost / least.header.cost;
                assert!((ratio - 1.0).abs() < 1e-5, "seed {seed}: {ratio} of the optimum");
            }
        }
    }

    #[test]
    fn few_and_equal_boxes_keep_their_trees_valid() {
        let top = HostOptimise::Top(TopOptions { subtrees: 16 });
        for count in [0, 1, 2, 3, 50] {
            for boxes in [soup(count, 0.1, 3), vec![Aabb { lo: [1.0; 3], hi: [1.0; 3] }; count]] {
                built(&boxes, HostMethod::Sweep, Collapse::SAH, top).validate().expect("valid");
            }
        }
        let wrong = |subtrees| HostOptimise::Top(TopOptions { subtrees });
        for subtrees in [0, 1, 65] {
            let options = HostBvhOptions { optimise: wrong(subtrees), ..HostBvhOptions::of(HostMethod::Sweep) };
            let error = options.check().expect_err("out of range").to_string();
            assert!(error.contains("take 2 to 64 subtrees"), "{error}");
        }
    }
}
