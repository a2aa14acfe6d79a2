//! The box in the world of a part of a structure, and of what it is opened to. The twin of `glsl/accel/world_box.glsl`.

use super::parts::{Below, Nodes, cut_slots, slots_in_use};
use crate::bvh::layout::Child;
use crate::bvh::wide::layout::WideNode;
use crate::bvh::wide::quantised::QuantisedNode;
use crate::geometry::Aabb;

/// The two boxes in the world around what a part is opened to, and the area that rays need not enter any more then, for each entry more.
pub(super) struct Halves {
    of: [Aabb; 2],
    pub saved: f32,
}

impl Halves {
    pub fn union(&self) -> Aabb {
        self.of[0].union(&self.of[1])
    }
}

impl Below<'_> {
    /// What opening a part comes to; of what cannot be opened both boxes together are its own.
    pub(super) fn halves(&self, m: &[[f32; 4]; 3], part: &Child) -> Halves {
        match self.nodes {
            Nodes::OfTwo(_) => self.halves_of_two(m, part),
            Nodes::Quantised(nodes) => {
                let node = nodes.get(part.index as usize).filter(|node| node.long_leaf().is_none());
                match node.map(|node| (node, slots_in_use(node, part))) {
                    Some((node, slots)) if !slots.is_empty() => halves_by_slots(m, node, &slots),
                    _ => Halves { of: [transformed_box(m, part); 2], saved: 0.0 },
                }
            }
        }
    }

    /// Of nodes of two, around the eight boxes that are three levels below. Nobody chose where these are cut, so that it may save more to
    /// open the halves, too: what saves most for each entry counts.
    fn halves_of_two(&self, m: &[[f32; 4]; 3], part: &Child) -> Halves {
        let children = |child: &Child| self.opened(child).unwrap_or([*child; 2]);
        let around = |boxes: [Aabb; 2]| boxes[0].union(&boxes[1]);
        let area = |boxes: [Aabb; 2]| boxes[0].half_area() + boxes[1].half_area();
        let below = children(part);
        let quarters = below.map(|half| {
            children(&half).map(|quarter| around(children(&quarter).map(|eighth| transformed_box(m, &eighth))))
        });
        let of = quarters.map(around);
        let whole = around(of).half_area();
        let (mut area_of_quarters, mut added) = (0.0, 1);
        for side in 0..2 {
            let opens = self.opened(&below[side]).is_some();
            area_of_quarters += if opens { area(quarters[side]) } else { of[side].half_area() };
            added += usize::from(opens);
        }
        let once = whole - area(of);
        let twice = (whole - area_of_quarters) * [1.0, 0.5, 1.0 / 3.0][added - 1];
        Halves { of, saved: once.max(twice) }
    }

    /// The box in the world of a part: where its own would be loose, around those of what it is made of.
    pub(super) fn world_box(&self, m: &[[f32; 4]; 3], part: &Child) -> Aabb {
        if keeps_boxes(m) {
            return transformed_box(m, part);
        }
        self.halves(m, part).union()
    }
}

/// [`Below::halves`] of slots of a quantised node: around each of the two parts that they are cut in.
fn halves_by_slots(m: &[[f32; 4]; 3], node: &QuantisedNode, slots: &[usize]) -> Halves {
    let cut_off = cut_slots(node, slots).map_or(0, |[_, (_, others)]| others);
    let grid = WorldGrid::new(m, node);
    let of = [0, 1].map(|half| {
        let of_half = slots.iter().filter(|&slot| cut_off >> slot & 1 == half);
        of_half.fold(Aabb::EMPTY, |b, &slot| b.union(&grid.box_around(node.bytes(slot))))
    });
    let whole = of[0].union(&of[1]).half_area();
    Halves { of, saved: whole - (of[0].half_area() + of[1].half_area()) }
}

/// Whether every axis of the object stays parallel to one of the world's: then a box's image is a box.
fn keeps_boxes(m: &[[f32; 4]; 3]) -> bool {
    m.iter().all(|row| row[..3].iter().filter(|&&x| x != 0.0).count() <= 1)
}

/// The box around a transformed box, not smaller by any rounding (`world_box.glsl`).
fn transformed_box(m: &[[f32; 4]; 3], child: &Child) -> Aabb {
    let slack_of_size = 2f32.powi(-21);
    let mut b = Aabb::EMPTY;
    for (row, &[x, y, z, w]) in m.iter().enumerate() {
        let axes = [x, y, z];
        let p: [f32; 3] = std::array::from_fn(|k| axes[k] * child.lo[k]);
        let q: [f32; 3] = std::array::from_fn(|k| axes[k] * child.hi[k]);
        let sum = |f: fn(f32, f32) -> f32| (f(p[0], q[0]) + f(p[1], q[1])) + f(p[2], q[2]);
        let slack = slack_of_size * (sum(|a, b| a.abs().max(b.abs())) + w.abs());
        b.lo[row] = (sum(f32::min) + w) - slack;
        b.hi[row] = (sum(f32::max) + w) + slack;
    }
    b
}

/// The grid of a quantised node in the world (`world_box.glsl`), axis by axis of the world.
struct WorldGrid {
    below: [f32; 3],
    above: [f32; 3],
    step: [[f32; 3]; 3],
}

impl WorldGrid {
    fn new(m: &[[f32; 4]; 3], node: &QuantisedNode) -> WorldGrid {
        let slack_of_size = 2f32.powi(-21);
        let (origin, cell) = node.grid();
        let sum = |[x, y, z]: [f32; 3]| (x + y) + z;
        let mut grid = WorldGrid { below: [0.0; 3], above: [0.0; 3], step: [[0.0; 3]; 3] };
        for (row, &[x, y, z, w]) in m.iter().enumerate() {
            let axes = [x, y, z];
            let from: [f32; 3] = std::array::from_fn(|k| axes[k] * origin[k]);
            let step: [f32; 3] = std::array::from_fn(|k| axes[k] * cell[k]);
            let at = sum(from) + w;
            let size = sum(from.map(f32::abs)) + w.abs();
            let slack = slack_of_size * (size + 128.0 * sum(step.map(f32::abs)));
            grid.below[row] = at - slack;
            grid.above[row] = at + slack;
            grid.step[row] = step;
        }
        grid
    }

    /// The box in the world around one between bytes of the grid, not smaller by any rounding.
    fn box_around(&self, [lo, hi]: [[f32; 3]; 2]) -> Aabb {
        let mut b = Aabb::EMPTY;
        for (row, step) in self.step.iter().enumerate() {
            let p: [f32; 3] = std::array::from_fn(|k| step[k] * lo[k]);
            let q: [f32; 3] = std::array::from_fn(|k| step[k] * hi[k]);
            let sum = |f: fn(f32, f32) -> f32| (f(p[0], q[0]) + f(p[1], q[1])) + f(p[2], q[2]);
            b.lo[row] = sum(f32::min) + self.below[row];
            b.hi[row] = sum(f32::max) + self.above[row];
        }
        b
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Corners in doubles, whose products are exact.
        #[test]
        fn a_box_in_the_world_holds_the_transformed_corners(
            m in prop::array::uniform3(prop::array::uniform4(-1e3f32..1e3)),
            origin in prop::array::uniform3(-1e6f32..1e6),
            extent in prop::array::uniform3(1e-3f32..1e3),
        ) {
            let hi: [f32; 3] = std::array::from_fn(|k| origin[k] + extent[k]);
            let middle: [f32; 3] = std::array::from_fn(|k| origin[k] + 0.3 * extent[k]);
            let slot = |[lo, hi]: [[f32; 3]; 2]| Some(Child { lo, index: 0, hi, count: 1 });
            let boxes = [[origin, middle], [middle, hi]];
            let node = QuantisedNode::of(&std::array::from_fn(|i| boxes.get(i).copied().and_then(slot)));
            let grid = WorldGrid::new(&m, &node);
            for (i, [lo, hi]) in boxes.into_iter().enumerate() {
                let b = grid.box_around(node.bytes(i));
                for corner in 0..8 {
                    let p: [f32; 3] = std::array::from_fn(|k| if corner >> k & 1 == 0 { lo[k] } else { hi[k] });
                    for (row, &[x, y, z, w]) in m.iter().enumerate() {
                        let terms = [[x, p[0]], [y, p[1]], [z, p[2]], [w, 1.0]].map(|[a, b]| f64::from(a) * f64::from(b));
                        let exact: f64 = terms.iter().sum();
                        prop_assert!(f64::from(b.lo[row]) <= exact && exact <= f64::from(b.hi[row]), "slot {i}, row {row}");
                    }
                }
            }
        }
    }
}
