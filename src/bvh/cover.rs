//! Whether boxes cover triangles: what validation asks of the parts of split ones.

use super::layout::Record;
use crate::geometry::{Aabb, Polygon};
use crate::{Error, Result};

/// Parts of split triangles, as leaves hold them: the record of each, and its leaf's box.
#[derive(Debug, Default)]
pub(super) struct SplitParts(Vec<(u32, Aabb)>);

impl SplitParts {
    pub fn add(&mut self, record: usize, leaf: Aabb) {
        self.0.push((record as u32, leaf));
    }

    /// # Errors
    /// The boxes of leaves that hold a primitive do not cover it.
    pub fn check<R: Record>(mut self, records: &[R]) -> Result<()> {
        let primitive_of = |&(record, _): &(u32, Aabb)| records[record as usize].primitive();
        self.0.sort_unstable_by_key(primitive_of);
        for parts in self.0.chunk_by(|a, b| primitive_of(a) == primitive_of(b)) {
            let record = &records[parts[0].0 as usize];
            if let Some(other) = parts.iter().find(|&&(other, _)| records[other as usize] != *record) {
                return Err(Error::InvalidStructure(format!(
                    "records {} and {} are of primitive {} and differ",
                    parts[0].0,
                    other.0,
                    record.primitive()
                )));
            }
            let boxes = parts.iter().map(|&(_, leaf)| leaf);
            if record.corners().is_some_and(|corners| !covers(boxes, &corners)) {
                return Err(Error::InvalidStructure(format!(
                    "the leaves of primitive {} do not cover it",
                    record.primitive()
                )));
            }
        }
        Ok(())
    }
}

/// Whether every point of a triangle is in one of the boxes: what is left of it when they are cut out is nothing. In double
/// precision, with room for its rounding.
fn covers(boxes: impl Iterator<Item = Aabb>, corners: &[[f32; 3]; 3]) -> bool {
    let magnitude = corners.iter().flatten().fold(0.0, |m: f64, &x| m.max(f64::from(x.abs())));
    let slack = magnitude * 2f64.powi(-44);
    let mut left: Vec<Polygon> = vec![Polygon::of(corners)];
    for b in boxes {
        let before = std::mem::take(&mut left);
        for polygon in before {
            cut_out(polygon, &b, slack, &mut left);
        }
    }
    left.is_empty()
}

/// What of a polygon is farther than `slack` outside of a box, in convex pieces.
fn cut_out(mut polygon: Polygon, b: &Aabb, slack: f64, left: &mut Vec<Polygon>) {
    let planes = (0..3).flat_map(|axis| [(axis, 1.0, f64::from(b.hi[axis])), (axis, -1.0, f64::from(b.lo[axis]))]);
    let heights = |polygon: &Polygon, (axis, sign, plane): (usize, f64, f64)| {
        polygon.corners().iter().map(|p| sign * (p[axis] - plane)).collect::<Vec<f64>>()
    };
    // What misses the box altogether stays in one piece.
    if planes.clone().any(|plane| heights(&polygon, plane).iter().all(|&height| height > slack)) {
        left.push(polygon);
        return;
    }
    for (axis, sign, plane) in planes {
        if heights(&polygon, (axis, sign, plane)).iter().all(|&height| height <= slack) {
            continue;
        }
        left.push(polygon.beyond(axis, plane, sign));
        polygon = polygon.beyond(axis, plane, -sign);
        if polygon.corners().is_empty() {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [4.0, 0.0, 1.0], [0.0, 4.0, 2.0]];

    fn slab(from: f32, to: f32) -> Aabb {
        Aabb { lo: [from, 0.0, 0.0], hi: [to, 4.0, 2.0] }
    }

    #[test]
    fn a_gap_between_boxes_is_seen_and_a_common_side_is_none() {
        assert!(covers([slab(0.0, 4.0)].into_iter(), &CORNERS));
        assert!(covers([slab(0.0, 1.3), slab(1.3, 4.0)].into_iter(), &CORNERS));
        assert!(!covers([slab(0.0, 1.3), slab(1.300_001, 4.0)].into_iter(), &CORNERS));
        assert!(!covers([slab(0.0, 3.999)].into_iter(), &CORNERS));
        assert!(!covers(std::iter::empty(), &CORNERS));
    }

    #[test]
    fn corners_of_boxes_that_the_triangle_does_not_reach_need_no_cover() {
        let low = Aabb { lo: [0.0, 0.0, 0.0], hi: [4.0, 2.0, 1.5] };
        let high = Aabb { lo: [0.0, 2.0, 1.0], hi: [2.0, 4.0, 2.0] };
        assert!(covers([low, high].into_iter(), &CORNERS));
        assert!(!covers([low, Aabb { hi: [1.9, 4.0, 2.0], ..high }].into_iter(), &CORNERS));
    }

    #[test]
    fn triangles_without_area_are_covered_or_not() {
        let line = [[0.0; 3], [1.0; 3], [2.0; 3]];
        let half = |from: f32, to: f32| Aabb { lo: [from; 3], hi: [to; 3] };
        assert!(covers([half(0.0, 1.0), half(1.0, 2.0)].into_iter(), &line));
        assert!(!covers([half(0.0, 0.9), half(1.0, 2.0)].into_iter(), &line));
        assert!(covers([half(0.0, 1.0)].into_iter(), &[[0.5; 3]; 3]));
    }
}
