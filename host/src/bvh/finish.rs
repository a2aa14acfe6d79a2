//! From a [`Topology`] to a [`Bvh2`]: records in the order of the leaves, subtrees that are cheaper as leaves made leaves, and
//! nodes written depth first.
//!
//! Collapsing: Meister and Bittner 2018, section 4; Frantál 2019, section 3.4.4, where it is called compaction. By the rule of
//! `hedgerow::bvh::collapse`, on all threads: subtrees of [`ALONE`] primitives are walked by one, what is above them by as many as
//! there are.

use super::bounds::{Bounds, Item};
use super::input::Input;
use super::topology::{LEAF, Span, Topology};
use super::{ALONE, DIVIDED_ABOVE};
use bytemuck::zeroed_vec;
use glam::Vec3A;
use hedgerow::bvh::layout::{Bvh2, Child, Header, MAX_DEPTH, Node, Record, status};
use hedgerow::bvh::sah::Collapse;
use rayon::prelude::*;

/// The records of the leaves from left to right.
pub(super) fn records<R: Record>(order: &[u32], record: impl Fn(u32) -> R + Sync) -> Vec<R> {
    order.par_iter().with_min_len(ALONE).map(|&primitive| record(primitive)).collect()
}

/// What the parent of a subtree decides by.
struct Measured {
    bounds: Bounds,
    cost: f32,
    /// Inner nodes; none in a leaf.
    inner: u32,
    /// Whether it was cut off at [`MAX_DEPTH`].
    is_limited: bool,
}

/// A tree whose leaves are final.
pub(super) struct Collapsed {
    /// Of each slot, the inner nodes of the subtree.
    inner: Vec<u32>,
    root: Measured,
}

/// Makes leaves of the subtrees that are cheaper as such, if `collapse` is enabled, and of those at [`MAX_DEPTH`].
pub(super) fn collapse<B: Boxed>(tree: &mut Topology, records: &[B], collapse: &Collapse, scale: f32) -> Collapsed {
    let mut inner = vec![0; tree.splits.len()];
    let walk = Walk { collapse, scale };
    let root = walk.subtree(Part { splits: &mut tree.splits, inner: &mut inner, records }, 0);
    Collapsed { inner, root }
}

/// The tree itself.
pub(super) fn layout<R: Record>(input: &Input, tree: &Topology, collapsed: &Collapsed, records: Vec<R>) -> Bvh2<R> {
    let (header, nodes) = layout_over(input.header::<R>(), input, tree, collapsed, &records);
    Bvh2 { header, nodes, records, geometries: Vec::new(), far: Vec::new() }
}

/// The tree over parts of primitives: its leaves have the boxes of `parts`, which are as many as the records.
pub(super) fn layout_parts<R: Record>(
    input: &Input,
    tree: &Topology,
    collapsed: &Collapsed,
    parts: &[Item],
    records: Vec<R>,
) -> Bvh2<R> {
    let (header, nodes) = layout_over(input.header::<R>(), input, tree, collapsed, parts);
    Bvh2 { header, nodes, records, geometries: Vec::new(), far: Vec::new() }
}

fn layout_over<B: Boxed>(
    mut header: Header,
    input: &Input,
    tree: &Topology,
    collapsed: &Collapsed,
    records: &[B],
) -> (Header, Vec<Node>) {
    let Collapsed { inner, root } = collapsed;
    // Pages of zeros come with the threads that write them.
    let mut nodes: Vec<Node> = if root.inner == 0 { vec![Node::UNUSED] } else { zeroed_vec(root.inner as usize) };
    if header.active > 0 {
        let layout = Layout { splits: &tree.splits, inner, records };
        header.root = layout.child(Span::whole(records.len()), &mut nodes[..root.inner as usize], 0);
        (header.cost, header.built_cost) = (root.cost, root.cost);
        // Of the root's box, which is larger than the scene's where it is around parts.
        header.built_area = header.root.bounds().scaled_half_area(input.scale);
    }
    header.primitive_count = header.active;
    header.node_slots = nodes.len() as u32;
    header.inner_nodes = root.inner;
    if root.is_limited {
        header.status |= status::DEPTH_LIMITED;
    }
    (header, nodes)
}

/// What leaves are made of, as far as their boxes go.
pub(super) trait Boxed: Sync {
    /// The box around it.
    fn around(&self) -> Bounds;
}

impl<R: Record> Boxed for R {
    fn around(&self) -> Bounds {
        match self.corners() {
            Some(corners) => Bounds::of_triangle(corners.map(Vec3A::from_array)),
            None => Bounds::of(&self.bounds().expect("a record of this crate has a box")),
        }
    }
}

impl Boxed for Item {
    fn around(&self) -> Bounds {
        self.bounds()
    }
}

/// A subtree of the topology, with room for what is found out.
struct Part<'a, B> {
    splits: &'a mut [u32],
    /// For the inner nodes of each slot.
    inner: &'a mut [u32],
    records: &'a [B],
}

struct Walk<'a> {
    collapse: &'a Collapse,
    scale: f32,
}

impl Walk<'_> {
    fn area(&self, bounds: &Bounds) -> f32 {
        bounds.scaled(self.scale).half_area()
    }

    fn leaf<B: Boxed>(&self, records: &[B]) -> Measured {
        let bounds = around(records);
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
    fn subtree<B: Boxed>(&self, part: Part<'_, B>, depth: u32) -> Measured {
        let Part { splits, inner, records } = part;
        let (Some((split, splits)), Some((own_inner, inner))) = (splits.split_first_mut(), inner.split_first_mut())
        else {
            return self.leaf(records);
        };
        let measured = if *split == LEAF || depth == MAX_DEPTH {
            Measured { is_limited: *split != LEAF, ..self.leaf(records) }
        } else {
            let left_count = *split as usize;
            let (left_records, right_records) = records.split_at(left_count);
            let (left_splits, right_splits) = splits.split_at_mut(left_count - 1);
            let (left_inner, right_inner) = inner.split_at_mut(left_count - 1);
            let left = Part { splits: left_splits, inner: left_inner, records: left_records };
            let right = Part { splits: right_splits, inner: right_inner, records: right_records };
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
        *own_inner = measured.inner;
        measured
    }
}

/// The box around records.
fn around<B: Boxed>(records: &[B]) -> Bounds {
    records.iter().fold(Bounds::EMPTY, |bounds, record| bounds.union(record.around()))
}

struct Layout<'a, B> {
    splits: &'a [u32],
    inner: &'a [u32],
    records: &'a [B],
}

impl<B: Boxed> Layout<'_, B> {
    fn inner(&self, span: Span) -> u32 {
        if span.count == 1 { 0 } else { self.inner[span.slot as usize] }
    }

    /// Writes the nodes of a subtree, of which the first is number `at`, and gives what names it.
    fn child(&self, span: Span, nodes: &mut [Node], at: u32) -> Child {
        let (bounds, index, count) = match nodes.split_first_mut() {
            None => (around(&self.records[span.primitives()]), span.first, span.count),
            Some((node, below)) => (self.place(span, node, below, at), at, 0),
        };
        Child { lo: bounds.lo.to_array(), index, hi: bounds.hi.to_array(), count }
    }

    /// Writes a node and those below it; the box around them.
    fn place(&self, span: Span, node: &mut Node, below: &mut [Node], at: u32) -> Bounds {
        let [left, right] = span.children(self.splits[span.slot as usize]);
        let left_inner = self.inner(left);
        let (left_nodes, right_nodes) = below.split_at_mut(left_inner as usize);
        let mut on_left = || self.child(left, left_nodes, at + 1);
        let mut on_right = || self.child(right, right_nodes, at + 1 + left_inner);
        let (left, right) =
            if (span.count as usize) < ALONE { (on_left(), on_right()) } else { rayon::join(on_left, on_right) };
        node.children = [left, right];
        Bounds::of(&left.bounds()).union(Bounds::of(&right.bounds()))
    }
}
