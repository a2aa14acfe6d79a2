//! Linear BVH, plainly: sort by code, split where the highest bit changes, collapse where a leaf is cheaper.
//!
//! Lauterbach et al. 2009. Gives the same bytes as the device's (`bvh::lbvh`), which goes bottom-up (Apetrei 2014): the node
//! that splits between positions i and i + 1 has slot i in both.

use super::geometry::{self, Corners};
use crate::bvh::codes::{Codes, Plan, code_bounds};
use crate::bvh::layout::{Aabb, Bvh2, Child, Header, KIND_BVH2, MAGIC, Node, Triangle, node_slots, status};
use crate::bvh::sah::Collapse;

/// Builds the LBVH of `triangles` over `positions`. Triangles that are not finite or name vertices that are not there are
/// left out, and the status says so.
pub fn build(positions: &[[f32; 3]], triangles: &[[u32; 3]], codes: Codes, collapse: Collapse) -> Bvh2 {
    let corners = triangles.iter().map(|triangle| {
        let vertex = |v: u32| positions.get(v as usize).copied().ok_or(status::INDEX_OUT_OF_RANGE);
        geometry::finite([vertex(triangle[0])?, vertex(triangle[1])?, vertex(triangle[2])?])
    });
    build_corners(corners, codes, collapse)
}

/// Builds the LBVH of triangles that [`HostGeometry::corners`](geometry::HostGeometry::corners) read.
pub fn build_corners(corners: impl Iterator<Item = Corners>, codes: Codes, collapse: Collapse) -> Bvh2 {
    let mut status = 0;
    let corners: Vec<Option<[[f32; 3]; 3]>> = corners
        .map(|corners| {
            status |= corners.err().unwrap_or(0);
            corners.ok()
        })
        .collect();
    let count = corners.len() as u32;
    let mut header = Header {
        magic: MAGIC,
        kind: KIND_BVH2,
        status,
        primitive_count: count,
        node_slots: node_slots(count),
        code_bits: codes.bits,
        ..bytemuck::Zeroable::zeroed()
    };
    let boxes: Vec<Option<Aabb>> = corners.iter().map(|c| c.map(|c| Aabb::around(&c))).collect();
    let (bounds, centroids) = boxes.iter().flatten().fold((Aabb::EMPTY, Aabb::EMPTY), |(bounds, centroids), b| {
        (bounds.union(b), centroids.union(&Aabb { lo: b.centroid(), hi: b.centroid() }))
    });
    header.active = boxes.iter().flatten().count() as u32;

    let plan = Plan::new(codes, &code_bounds(&bounds, &centroids, codes.concise));
    let mut order: Vec<(u64, u32)> =
        boxes.iter().enumerate().map(|(i, b)| (b.map_or(plan.inactive(), |b| plan.encode(&b)), i as u32)).collect();
    order.sort_unstable();

    let records: Vec<Triangle> = order
        .iter()
        .map(|&(_, primitive)| {
            let [v0, v1, v2] = corners[primitive as usize].unwrap_or([[0.0; 3]; 3]);
            Triangle { v0, v1, v2, primitive }
        })
        .collect();
    let mut tree = Tree {
        codes: order.iter().map(|&(code, _)| code).collect(),
        triangles: &records,
        nodes: vec![Node::UNUSED; header.node_slots as usize],
        collapse,
        area_scale: crate::bvh::sah::area_scale(&bounds),
    };
    header.root = match header.active {
        0 => Child { lo: Aabb::EMPTY.lo, index: 0, hi: Aabb::EMPTY.hi, count: 0 },
        active => tree.subtree(0, active as usize - 1).0,
    };
    Bvh2 { header, nodes: tree.nodes, triangles: records }
}

struct Tree<'a> {
    codes: Vec<u64>,
    triangles: &'a [Triangle],
    nodes: Vec<Node>,
    collapse: Collapse,
    area_scale: f32,
}

impl Tree<'_> {
    /// The subtree over positions `first..=last`, and its cost.
    fn subtree(&mut self, first: usize, last: usize) -> (Child, f32) {
        if first == last {
            let t = &self.triangles[first];
            let bounds = Aabb::around(&[t.v0, t.v1, t.v2]);
            let child = Child { lo: bounds.lo, index: first as u32, hi: bounds.hi, count: 1 };
            return (child, self.collapse.leaf_cost(bounds.scaled_half_area(self.area_scale), 1));
        }
        let split = self.split(first, last);
        let (left, left_cost) = self.subtree(first, split);
        let (right, right_cost) = self.subtree(split + 1, last);
        self.nodes[split] = Node { children: [left, right] };
        let bounds = left.bounds().union(&right.bounds());
        let count = (last - first + 1) as u32;
        let area = bounds.scaled_half_area(self.area_scale);
        let inner_cost = self.collapse.inner_cost(area, left_cost, right_cost);
        let leaf_cost = self.collapse.leaf_cost(area, count);
        if self.collapse.enabled && leaf_cost < inner_cost {
            (Child { lo: bounds.lo, index: first as u32, hi: bounds.hi, count }, leaf_cost)
        } else {
            (Child { lo: bounds.lo, index: split as u32, hi: bounds.hi, count: 0 }, inner_cost)
        }
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
