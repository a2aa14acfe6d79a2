//! What a plane costs, and whether a cell is split at all (Papay 2025, sections 2.2 and 9.2).

use crate::bvh::layout::Aabb;
use crate::bvh::sah::area_scale;
use crate::kdtree::layout::halves;
use crate::kdtree::termination::{Costs, depth_limit, leaf_size};

/// A plane and what it costs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Split {
    pub axis: usize,
    pub plane: f32,
    /// Scaled by the cell's area.
    pub cost: f32,
}

impl Split {
    /// The cheaper one; of equal ones the first.
    pub fn better(first: Option<Split>, second: Option<Split>) -> Option<Split> {
        match (first, second) {
            (Some(a), Some(b)) if b.cost < a.cost => Some(b),
            (None, b) => b,
            (a, _) => a,
        }
    }
}

/// The surface area heuristic over a scene.
#[derive(Debug, Clone, Copy)]
pub(super) struct Heuristic {
    costs: Costs,
    pub area_scale: f32,
    depth_limit: u32,
    leaf_size: u32,
}

impl Heuristic {
    /// For so many triangles in the root's `cell`.
    pub fn new(costs: Costs, cell: &Aabb, primitives: u32) -> Heuristic {
        Heuristic {
            costs,
            area_scale: if primitives == 0 { 1.0 } else { area_scale(cell) },
            depth_limit: depth_limit(primitives),
            leaf_size: leaf_size(primitives),
        }
    }

    /// Whether a cell is a leaf whatever a split would cost.
    pub fn is_leaf(&self, references: usize, depth: u32) -> bool {
        references < self.leaf_size as usize || depth >= self.depth_limit
    }

    /// The split of a cell at a plane with so many references on its sides; `None` at and beyond the faces, where it would leave no
    /// volume (section 9.2).
    pub fn split(&self, cell: &Aabb, (axis, plane): (usize, f32), [left, right]: [u32; 2]) -> Option<Split> {
        if plane <= cell.lo[axis] || plane >= cell.hi[axis] {
            return None;
        }
        let areas = halves(cell, axis, plane).map(|half| half.scaled_half_area(self.area_scale));
        let tests = areas[0] * left as f32 + areas[1] * right as f32;
        let steps = self.costs.c_t * cell.scaled_half_area(self.area_scale);
        Some(Split { axis, plane, cost: steps + self.costs.c_i * tests })
    }

    /// The split, if a leaf of so many references costs more.
    pub fn paying(&self, split: Option<Split>, cell: &Aabb, references: usize) -> Option<Split> {
        let leaf = self.costs.c_i * (cell.scaled_half_area(self.area_scale) * references as f32);
        split.filter(|split| split.cost < leaf)
    }
}
