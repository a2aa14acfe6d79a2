//! Refitting, plainly: records from their primitives, boxes and costs from the leaves up. The same bytes as the device's
//! (`bvh::refit`).

use super::geometry::{self, Corners};
use crate::bvh::layout::{BoxRecord, Bvh2, Child, Record, Triangle, status};
use crate::bvh::sah::Collapse;
use crate::geometry::Aabb;

/// Refits a tree of triangles to those that [`HostGeometry::corners`](geometry::HostGeometry::corners) read, with the costs that
/// it was built with.
pub fn refit_corners(tree: &mut Bvh2, corners: impl Iterator<Item = Corners>, costs: Collapse) {
    let corners: Vec<Corners> = corners.collect();
    let boxes: Vec<_> = corners.iter().map(|c| c.map(|c| Aabb::around(&c))).collect();
    let record = |primitive: u32| match corners.get(primitive as usize) {
        Some(Ok([v0, v1, v2])) => Triangle { v0: *v0, v1: *v1, v2: *v2, primitive },
        _ => Triangle::left_out(primitive),
    };
    refit_boxes(tree, &boxes, record, costs);
}

/// Refits a tree of boxes.
pub fn refit_aabbs(tree: &mut Bvh2<BoxRecord>, boxes: &[Aabb], costs: Collapse) {
    let boxes: Vec<_> = boxes.iter().map(geometry::finite_box).collect();
    let record = |primitive: u32| match boxes.get(primitive as usize) {
        Some(&Ok(Aabb { lo, hi })) => BoxRecord { lo, hi, primitive },
        _ => BoxRecord::left_out(primitive),
    };
    refit_boxes(tree, &boxes, record, costs);
}

/// Refits a tree to primitives with these boxes, or the bits of [`status`] that say why they are left out (0: none says), and
/// these records: for those that are left out, [`Record::left_out`].
pub fn refit_boxes<R: Record>(
    tree: &mut Bvh2<R>,
    boxes: &[Result<Aabb, u32>],
    record: impl Fn(u32) -> R,
    costs: Collapse,
) {
    let box_of = |record: &R| *boxes.get(record.primitive() as usize).unwrap_or(&Err(status::INDEX_OUT_OF_RANGE));
    if tree.header.active == 0 || tree.header.split_from != 0 {
        return;
    }
    for old in &mut tree.records[..tree.header.active as usize] {
        tree.header.status |= box_of(old).err().unwrap_or(0);
        *old = record(old.primitive());
    }
    let leaf_boxes: Vec<Option<Aabb>> = tree.records.iter().map(|record| box_of(record).ok()).collect();
    let mut root = tree.header.root;
    tree.header.cost = subtree(tree, &leaf_boxes, costs, &mut root);
    tree.header.root = root;
    if tree.header.near_node != 0 {
        *tree = tree.clone().with_far_told();
    }
}

/// Gives `child` and all below it their boxes. Returns the cost.
fn subtree<R: Record>(tree: &mut Bvh2<R>, boxes: &[Option<Aabb>], costs: Collapse, child: &mut Child) -> f32 {
    let scale = tree.header.area_scale;
    if child.is_leaf() {
        let there = boxes[child.index as usize..][..child.count as usize].iter().flatten();
        // One with nothing left keeps its box.
        if let Some(around) = there.copied().reduce(|a, b| a.union(&b)) {
            (child.lo, child.hi) = (around.lo, around.hi);
        }
        return costs.leaf_cost(child.bounds().scaled_half_area(scale), child.count);
    }
    let slot = child.index as usize;
    let [mut left, mut right] = tree.nodes[slot].children;
    let left_cost = subtree(tree, boxes, costs, &mut left);
    let right_cost = subtree(tree, boxes, costs, &mut right);
    tree.nodes[slot].children = [left, right];
    let bounds = left.bounds().union(&right.bounds());
    (child.lo, child.hi) = (bounds.lo, bounds.hi);
    costs.inner_cost(bounds.scaled_half_area(scale), left_cost, right_cost)
}
