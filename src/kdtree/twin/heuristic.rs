//! What a plane costs, and whether a cell is split at all (Papay 2025, sections 2.2 and 9.2).

use super::clip::KdPlane;
use crate::bvh::sah::area_scale;
use crate::geometry::Aabb;
use crate::kdtree::layout::{MAX_DEPTH, halves};
use crate::kdtree::termination::{Costs, depth_limit, leaf_size};

/// A plane and what it costs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KdSplit {
    /// The plane.
    pub plane: KdPlane,
    /// Scaled by the cell's area.
    pub cost: f32,
}

impl KdSplit {
    /// With what lies in the plane on its left.
    pub fn with_planar_left(self) -> KdSplit {
        KdSplit { plane: KdPlane { planar_left: true, ..self.plane }, ..self }
    }

    /// The cheaper one; of equal ones the first.
    pub fn better(first: Option<KdSplit>, second: Option<KdSplit>) -> Option<KdSplit> {
        match (first, second) {
            (Some(a), Some(b)) if b.cost < a.cost => Some(b),
            (None, b) => b,
            (a, _) => a,
        }
    }
}

/// The surface area heuristic over a scene.
#[derive(Debug, Clone, Copy)]
pub struct Heuristic {
    costs: Costs,
    /// A power of two that scales the root's area.
    pub area_scale: f32,
    depth_limit: u32,
    leaf_size: u32,
}

impl Heuristic {
    /// For this many primitives in the root's `cell`. The count includes those that are left out; the cell is empty if all are.
    pub fn new(costs: Costs, cell: &Aabb, primitives: u32) -> Heuristic {
        Heuristic {
            costs,
            area_scale: if cell.lo[0] > cell.hi[0] { 1.0 } else { area_scale(cell) },
            depth_limit: depth_limit(primitives),
            leaf_size: leaf_size(primitives),
        }
    }

    /// For merging into a leaf, with cell `cell`, of a tree of this many triangles: as deep as a tracer can walk.
    pub fn of_leaf(costs: Costs, cell: &Aabb, primitives: u32) -> Heuristic {
        Heuristic { costs, area_scale: area_scale(cell), depth_limit: MAX_DEPTH, leaf_size: leaf_size(primitives) }
    }

    /// For a builder that begins at a depth and counts from there.
    pub fn below(&self, depth: u32) -> Heuristic {
        Heuristic { depth_limit: self.depth_limit.saturating_sub(depth), ..*self }
    }

    /// Whether a cell is a leaf whatever a split would cost.
    pub fn is_leaf(&self, references: usize, depth: u32) -> bool {
        references < self.leaf_size as usize || depth >= self.depth_limit
    }

    /// The split of a cell at a plane, with these numbers of references on the left, in it, and on the right; what lies in it
    /// goes where it costs less. `None` at and beyond the faces, where it would leave no volume (section 9.2).
    pub fn split(&self, cell: &Aabb, (axis, at): (usize, f32), [left, planar, right]: [u32; 3]) -> Option<KdSplit> {
        if at <= cell.lo[axis] || at >= cell.hi[axis] {
            return None;
        }
        let areas = halves(cell, axis, at).map(|half| half.scaled_half_area(self.area_scale));
        let planar_left = areas[0] <= areas[1];
        let counts = if planar_left { [left + planar, right] } else { [left, planar + right] };
        let cost = self.cost(cell, areas, counts.map(|count| count as f32));
        // Of the two zeros the positive one, whichever the box had.
        Some(KdSplit { plane: KdPlane { axis, at: at + 0.0, planar_left }, cost })
    }

    /// A step in the cell, and these numbers of tests in its parts.
    fn cost(&self, cell: &Aabb, areas: [f32; 2], [left, right]: [f32; 2]) -> f32 {
        let steps = self.costs.c_t * cell.scaled_half_area(self.area_scale);
        steps + self.costs.c_i * (areas[0] * left + areas[1] * right)
    }

    /// The cost of a plane between trees that are worth this many tests, and whether it is less than without the plane.
    pub fn between(&self, cell: &Aabb, (axis, at): (usize, f32), tests: [f32; 2]) -> (f32, bool) {
        let areas = halves(cell, axis, at).map(|half| half.scaled_half_area(self.area_scale));
        let cost = self.cost(cell, areas, tests);
        (cost, cost < self.costs.c_i * (cell.scaled_half_area(self.area_scale) * (tests[0] + tests[1])))
    }

    /// How many tests a step is worth.
    pub fn step(costs: Costs) -> f32 {
        costs.c_t / costs.c_i
    }

    /// The split, if a leaf of this many references costs more.
    pub fn paying(&self, split: Option<KdSplit>, cell: &Aabb, references: usize) -> Option<KdSplit> {
        let leaf = self.costs.c_i * (cell.scaled_half_area(self.area_scale) * references as f32);
        split.filter(|split| split.cost < leaf)
    }
}
