//! Linear BVH, plainly: sort by code, split where the highest bit changes, collapse where a leaf is cheaper.
//!
//! Lauterbach et al. 2009. Gives the same bytes as the device's (`bvh::lbvh`), which goes bottom-up (Apetrei 2014): the node
//! that splits between positions i and i + 1 has slot i in both.

use super::child_order::{Ordering, Weight};
use super::geometry::{self, Corners};
use crate::bvh::child_order::ChildOrder;
use crate::bvh::codes::{CodePlan, Codes};
use crate::bvh::layout::status;
use crate::bvh::layout::{BoxRecord, Bvh2, Child, Header, MAGIC, Node, Record, Triangle, UNUSED, node_slots};
use crate::bvh::sah::Collapse;
use crate::geometry::Aabb;

/// How a hierarchy is finished.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Finish {
    /// Which subtrees become leaves.
    pub collapse: Collapse,
    /// The order of children, if they get one.
    pub child_order: Option<ChildOrder>,
}

impl From<Collapse> for Finish {
    fn from(collapse: Collapse) -> Finish {
        Finish { collapse, child_order: None }
    }
}

/// Builds the LBVH of `triangles` over `positions`. Triangles that are not finite or name vertices that are not there are
/// left out, and the status says so.
pub fn build(positions: &[[f32; 3]], triangles: &[[u32; 3]], codes: Codes, finish: impl Into<Finish>) -> Bvh2 {
    build_corners(corners(positions, triangles), codes, finish)
}

/// The corners of triangles, or why they are left out.
#[doc(hidden)]
pub fn corners(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> impl Iterator<Item = Corners> {
    triangles.iter().map(|triangle| {
        let vertex = |v: u32| positions.get(v as usize).copied().ok_or(status::INDEX_OUT_OF_RANGE);
        geometry::finite([vertex(triangle[0])?, vertex(triangle[1])?, vertex(triangle[2])?])
    })
}

/// Builds the LBVH of triangles that [`HostGeometry::corners`](geometry::HostGeometry::corners) read.
pub fn build_corners(corners: impl Iterator<Item = Corners>, codes: Codes, finish: impl Into<Finish>) -> Bvh2 {
    let corners: Vec<Corners> = corners.collect();
    let boxes: Vec<_> = corners.iter().map(|c| c.map(|c| Aabb::around(&c))).collect();
    let record = |primitive: u32| {
        let [v0, v1, v2] = corners[primitive as usize].unwrap_or([[0.0; 3]; 3]);
        Triangle { v0, v1, v2, primitive }
    };
    build_boxes(&boxes, record, codes, finish)
}

/// Builds the LBVH of boxes; one that is not finite or is inside out is left out.
pub fn build_aabbs(boxes: &[Aabb], codes: Codes, finish: impl Into<Finish>) -> Bvh2<BoxRecord> {
    let boxes: Vec<_> = boxes.iter().map(geometry::finite_box).collect();
    let record = |primitive: u32| {
        let Aabb { lo, hi } = boxes[primitive as usize].unwrap_or(Aabb { lo: [0.0; 3], hi: [0.0; 3] });
        BoxRecord { lo, hi, primitive }
    };
    build_boxes(&boxes, record, codes, finish)
}

/// Builds the LBVH of primitives with these boxes, or the bits of [`status`] that say why they are left out (0: none says), and
/// these records, of one geometry without flags.
pub fn build_boxes<R: Record>(
    boxes: &[Result<Aabb, u32>],
    record: impl Fn(u32) -> R,
    codes: Codes,
    finish: impl Into<Finish>,
) -> Bvh2<R> {
    let count = boxes.len() as u32;
    let mut header = Header {
        magic: MAGIC,
        kind: R::KIND,
        status: boxes.iter().filter_map(|b| b.err()).fold(0, |a, b| a | b),
        primitive_count: count,
        node_slots: node_slots(count),
        code_bits: codes.bits,
        geometry_count: 1,
        ..bytemuck::Zeroable::zeroed()
    };
    let active = || boxes.iter().flatten();
    let bounds = active().fold(Aabb::EMPTY, |bounds, b| bounds.union(b));
    header.active = active().count() as u32;

    let plan = CodePlan::new(codes, boxes);
    let mut order: Vec<(u64, u32)> =
        (0..count).map(|i| (boxes[i as usize].map_or(plan.inactive(), |b| plan.encode(&b)), i)).collect();
    order.sort_unstable();

    let Finish { collapse, child_order } = finish.into();
    let area_scale = crate::bvh::sah::area_scale_for(&bounds, plan.core().unwrap_or(&bounds));
    let ordering = child_order.map(|order| Ordering { order, costs: collapse, scale: area_scale });
    let records: Vec<R> = order.iter().map(|&(_, primitive)| record(primitive)).collect();
    let mut tree = Tree {
        codes: order.iter().map(|&(code, _)| code).collect(),
        boxes: order.iter().map(|&(_, i)| boxes[i as usize].unwrap_or(Aabb::EMPTY)).collect(),
        nodes: vec![Node::UNUSED; header.node_slots as usize],
        records,
        collapse,
        area_scale,
        ordering,
    };
    header.root = match header.active {
        0 => Child { lo: Aabb::EMPTY.lo, index: 0, hi: Aabb::EMPTY.hi, count: 0 },
        active => {
            let Subtree { child: root, cost, .. } = tree.subtree(0, active as usize - 1);
            header.child_order = u32::from(tree.ordering.is_some() && !root.is_leaf());
            header.area_scale = tree.area_scale;
            (header.cost, header.built_cost) = (cost, cost);
            header.built_area = bounds.scaled_half_area(tree.area_scale);
            root
        }
    };
    header.inner_nodes = tree.nodes.iter().filter(|node| node.is_used()).count() as u32;
    Bvh2 { header, nodes: tree.nodes, records: tree.records, geometries: Vec::new(), far: Vec::new() }
}

impl<R: Record> Bvh2<R> {
    /// The same with the geometries that its primitives are of: how many primitives each has, and its flags.
    pub fn with_geometries(mut self, geometries: &[(u32, u32)], build_flags: u32) -> Bvh2<R> {
        self.header.geometry_count = geometries.len().max(1) as u32;
        self.header.build_flags = build_flags;
        (self.header.geometry_flags, self.geometries) = geometry::table_of(geometries);
        self
    }
}

struct Tree<R> {
    codes: Vec<u64>,
    boxes: Vec<Aabb>,
    nodes: Vec<Node>,
    records: Vec<R>,
    collapse: Collapse,
    area_scale: f32,
    ordering: Option<Ordering>,
}

/// A subtree, its cost, and what it is ordered by: its weight and the area of its primitives.
struct Subtree {
    child: Child,
    cost: f32,
    weight: Weight,
    area: f32,
}

impl<R: Record> Tree<R> {
    /// The subtree over positions `first..=last`.
    fn subtree(&mut self, first: usize, last: usize) -> Subtree {
        if first == last {
            let bounds = self.boxes[first];
            let child = Child { lo: bounds.lo, index: first as u32, hi: bounds.hi, count: 1 };
            let box_area = bounds.scaled_half_area(self.area_scale);
            let area = self.ordering.map_or(0.0, |ordering| ordering.area_of(&self.records[first], box_area));
            let cost = self.collapse.leaf_cost(box_area, 1);
            return Subtree { child, cost, weight: self.leaf_weight(area, box_area, 1), area };
        }
        let split = self.split(first, last);
        let [left, right] = [self.subtree(first, split), self.subtree(split + 1, last)];
        self.nodes[split] = Node { children: [left.child, right.child] };
        let bounds = left.child.bounds().union(&right.child.bounds());
        let count = (last - first + 1) as u32;
        let box_area = bounds.scaled_half_area(self.area_scale);
        let inner_cost = self.collapse.inner_cost(box_area, left.cost, right.cost);
        let leaf_cost = self.collapse.leaf_cost(box_area, count);
        let area = left.area + right.area;
        if self.collapse.enabled && leaf_cost < inner_cost {
            for node in &mut self.nodes[first..last] {
                node.children[0].count = UNUSED;
            }
            let child = Child { lo: bounds.lo, index: first as u32, hi: bounds.hi, count };
            Subtree { child, cost: leaf_cost, weight: self.leaf_weight(area, box_area, count), area }
        } else {
            let child = Child { lo: bounds.lo, index: split as u32, hi: bounds.hi, count: 0 };
            let weights = [left.weight, right.weight];
            let in_order = |ordering: Ordering| ordering.node(&mut self.nodes[split].children, weights, weights).1;
            let weight = self.ordering.map(in_order).unwrap_or_default();
            Subtree { child, cost: inner_cost, weight, area }
        }
    }

    fn leaf_weight(&self, area: f32, box_area: f32, count: u32) -> Weight {
        self.ordering.map(|ordering| ordering.leaf(area, box_area, count)).unwrap_or_default()
    }

    /// The last position of the left child: where the highest differing bit of the codes changes; equal codes are told
    /// apart by their positions.
    fn split(&self, first: usize, last: usize) -> usize {
        let (a, b) = (self.codes[first], self.codes[last]);
        if a == b {
            let bit = usize::BITS - 1 - (first ^ last).leading_zeros();
            return (last >> bit << bit) - 1;
        }
        let bit = u64::BITS - 1 - (a ^ b).leading_zeros();
        first + self.codes[first..=last].partition_point(|code| code >> bit & 1 == 0) - 1
    }
}
