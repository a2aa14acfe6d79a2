//! From a [`Topology`] to a [`Bvh2`]: records in the order of the leaves, subtrees that are cheaper as leaves made leaves, and
//! nodes written depth first.
//!
//! Collapsing: Meister and Bittner 2018, section 4; Frantál 2019, section 3.4.4, where it is called compaction. By the rule of
//! `hedgerow::bvh::collapse`, on all threads: subtrees of [`ALONE`] primitives are walked by one, what is above them by as many as
//! there are.

use super::bounds::Bounds;
use super::input::Input;
use super::topology::{LEAF, Span, Topology};
use super::{ALONE, DIVIDED_ABOVE};
use glam::Vec3A;
use hedgerow::bvh::layout::{Bvh2, Child, MAX_DEPTH, Node, Record, status};
use hedgerow::bvh::sah::Collapse;
use hedgerow::geometry::Aabb;
use rayon::prelude::*;

/// The records of the leaves from left to right.
pub(super) fn records<R: Record>(order: &[u32], record: impl Fn(u32) -> R + Sync) -> Vec<R> {
    order.par_iter().with_min_len(ALONE).map(|&primitive| record(primitive)).collect()
}

/// What is known of a subtree, in its slot.
#[derive(Debug, Clone, Copy)]
pub(super) struct Subtree {
    bounds: Aabb,
    /// Inner nodes; none in a leaf.
    inner: u32,
}

/// The same, and what its parent decides by.
struct Measured {
    bounds: Bounds,
    cost: f32,
    inner: u32,
    /// Whether it was cut off at [`MAX_DEPTH`].
    is_limited: bool,
}

/// Subtrees of a tree whose leaves are final.
pub(super) struct Collapsed {
    subtrees: Vec<Subtree>,
    root: Measured,
}

/// Makes leaves of the subtrees that are cheaper as such, if `collapse` is enabled, and of those at [`MAX_DEPTH`].
pub(super) fn collapse<R: Record>(tree: &mut Topology, records: &[R], collapse: &Collapse, scale: f32) -> Collapsed {
    let none = Subtree { bounds: Aabb::EMPTY, inner: 0 };
    let mut subtrees = vec![none; tree.splits.len()];
    let walk = Walk { collapse, scale };
    let root = walk.subtree(Part { splits: &mut tree.splits, subtrees: &mut subtrees, records }, 0);
    Collapsed { subtrees, root }
}

/// The tree itself.
pub(super) fn layout<R: Record>(input: &Input, tree: &Topology, collapsed: &Collapsed, records: Vec<R>) -> Bvh2<R> {
    let Collapsed { subtrees, root } = collapsed;
    let mut header = input.header::<R>();
    let mut nodes = vec![Node::UNUSED; root.inner.max(1) as usize];
    let layout = Layout { splits: &tree.splits, subtrees, records: &records };
    if header.active > 0 {
        let whole = Span::whole(records.len());
        header.root = layout.child(whole, 0);
        if root.inner > 0 {
            layout.place(whole, &mut nodes, 0);
        }
        (header.cost, header.built_cost) = (root.cost, root.cost);
        header.built_area = input.bounds.scaled_half_area(input.scale);
    }
    header.primitive_count = header.active;
    header.node_slots = nodes.len() as u32;
    header.inner_nodes = root.inner;
    if root.is_limited {
        header.status |= status::DEPTH_LIMITED;
    }
    Bvh2 { header, nodes, records, geometries: Vec::new() }
}

/// A subtree of the topology, with room for what is found out.
struct Part<'a, R> {
    splits: &'a mut [u32],
    subtrees: &'a mut [Subtree],
    records: &'a [R],
}

struct Walk<'a> {
    collapse: &'a Collapse,
    scale: f32,
}

impl Walk<'_> {
    fn area(&self, bounds: &Bounds) -> f32 {
        Bounds { lo: bounds.lo * self.scale, hi: bounds.hi * self.scale }.half_area()
    }

    fn leaf<R: Record>(&self, records: &[R]) -> Measured {
        let bounds = records.iter().fold(Bounds::EMPTY, |bounds, record| bounds.union(bounds_of(record)));
        let cost =
            if records.is_empty() { 0.0 } else { self.collapse.leaf_cost(self.area(&bounds), records.len() as u32) };
        Measured { bounds, cost, inner: 0, is_limited: false }
    }

    /// A node over both, or a leaf where that is cheaper.
    #[inline]
    fn node(&self, left: &Measured, right: &Measured, count: u32) -> Measured {
        let bounds = left.bounds.union(right.bounds);
        let area = self.area(&bounds);
        let as_inner = self.collapse.inner_cost(area, left.cost, right.cost);
        let as_leaf = self.collapse.leaf_cost(area, count);
        if self.collapse.enabled && as_leaf < as_inner {
            return Measured { bounds, cost: as_leaf, inner: 0, is_limited: false };
        }
        let is_limited = left.is_limited || right.is_limited;
        Measured { bounds, cost: as_inner, inner: 1 + left.inner + right.inner, is_limited }
    }

    /// A subtree whose root is at `depth`. No deeper than [`MAX_DEPTH`], however deep the tree is.
    fn subtree<R: Record>(&self, part: Part<'_, R>, depth: u32) -> Measured {
        let Part { splits, subtrees, records } = part;
        let (Some((split, splits)), Some((subtree, subtrees))) = (splits.split_first_mut(), subtrees.split_first_mut())
        else {
            return self.leaf(records);
        };
        let measured = if *split == LEAF || depth == MAX_DEPTH {
            Measured { is_limited: *split != LEAF, ..self.leaf(records) }
        } else {
            let left_count = *split as usize;
            let (left_records, right_records) = records.split_at(left_count);
            let (left_splits, right_splits) = splits.split_at_mut(left_count - 1);
            let (left_subtrees, right_subtrees) = subtrees.split_at_mut(left_count - 1);
            let left = Part { splits: left_splits, subtrees: left_subtrees, records: left_records };
            let right = Part { splits: right_splits, subtrees: right_subtrees, records: right_records };
            let (left, right) = if records.len() < ALONE || depth >= DIVIDED_ABOVE {
                (self.subtree(left, depth + 1), self.subtree(right, depth + 1))
            } else {
                rayon::join(|| self.subtree(left, depth + 1), || self.subtree(right, depth + 1))
            };
            self.node(&left, &right, records.len() as u32)
        };
        if measured.inner == 0 {
            *split = LEAF;
        }
        *subtree = measured.subtree();
        measured
    }
}

impl Measured {
    fn subtree(&self) -> Subtree {
        let bounds = Aabb { lo: self.bounds.lo.to_array(), hi: self.bounds.hi.to_array() };
        Subtree { bounds, inner: self.inner }
    }
}

fn bounds_of<R: Record>(record: &R) -> Bounds {
    match record.corners() {
        Some(corners) => Bounds::of_triangle(corners.map(Vec3A::from_array)),
        None => Bounds::of(&record.bounds().expect("a record of this crate has a box")),
    }
}

struct Layout<'a, R> {
    splits: &'a [u32],
    subtrees: &'a [Subtree],
    records: &'a [R],
}

impl<R: Record> Layout<'_, R> {
    /// What names a subtree whose nodes begin at `node`.
    fn child(&self, span: Span, node: u32) -> Child {
        if span.count == 1 {
            let Aabb { lo, hi } = self.records[span.first as usize].bounds().expect("a record of this crate has a box");
            return Child { lo, index: span.first, hi, count: 1 };
        }
        let Subtree { bounds: Aabb { lo, hi }, inner } = self.subtrees[span.slot as usize];
        match inner {
            0 => Child { lo, index: span.first, hi, count: span.count },
            _ => Child { lo, index: node, hi, count: 0 },
        }
    }

    fn inner(&self, span: Span) -> u32 {
        if span.count == 1 { 0 } else { self.subtrees[span.slot as usize].inner }
    }

    /// Writes the nodes of a subtree that is not a leaf; the first is number `at`.
    fn place(&self, span: Span, nodes: &mut [Node], at: u32) {
        let (node, nodes) = nodes.split_first_mut().expect("an inner node has a place");
        let [left, right] = span.children(self.splits[span.slot as usize]);
        let left_inner = self.inner(left);
        let (left_at, right_at) = (at + 1, at + 1 + left_inner);
        *node = Node { children: [self.child(left, left_at), self.child(right, right_at)] };
        let (left_nodes, right_nodes) = nodes.split_at_mut(left_inner as usize);
        let place = |span: Span, nodes: &mut [Node], at| {
            if !nodes.is_empty() {
                self.place(span, nodes, at);
            }
        };
        if (span.count as usize) < ALONE {
            place(left, left_nodes, left_at);
            place(right, right_nodes, right_at);
        } else {
            rayon::join(|| place(left, left_nodes, left_at), || place(right, right_nodes, right_at));
        }
    }
}
