//! Split clipping: the box of what of a triangle lies in a cell (Papay 2025, section 9.6 and algorithm 8; Havran 2000).
//!
//! The thesis gathers where edges and faces of triangle and box cross. Here the triangle is cut at the six faces of the cell, one
//! after the other (Sutherland and Hodgman 1974): the same points, and no division by how steep the triangle stands to an edge.
//!
//! **No cell that a triangle touches is without it.** A ray's hit may lie beside its triangle by a part of how far and how long the
//! triangle is; [`crate::trace::kd_host`] takes care of how far, the builder of how long: a triangle touches all that is nearer to
//! it than [`padding`] along each axis. What is within p of the triangle and in a cell is within p of the triangle's part in the
//! cell that is larger by p on all sides: so the triangle is clipped to that, and the box around the part is larger by p again.
//!
//! Of p, with ε = 2⁻²⁴, *s* the triangle's longest side and *c* its greatest coordinate along the axis,
//!
//! - 128ε·s + 4ε·c = 2⁻¹⁷s + 2⁻²²c is for the tracer;
//! - six cuts put what is left of the triangle off by at most 64ε·s + 6ε·c. Of a corner that a cut makes, a + t·(b − a), t is off by
//!   8ε (two differences, a reciprocal that a device has to 5ε, a product; a and b are what they are), t·(b − a) by two more; the
//!   sum is rounded once. As the planes are moved out by p, what was right before the cut and is off by less than that is kept;
//! - the rest, 64ε·s + 6ε·c, is for the rounding of the box, and more than that: a box that only touches a plane with its face is of
//!   a triangle that does not touch it. So each plane puts such a triangle on one side alone, and leaves hold none for nothing.
//!
//! No box is flat: what is parallel to an axis is as thick as that, as the thesis (section 9.2) expands its boxes, and so no
//! primitive lies in a plane.

use crate::bvh::layout::{Aabb, Triangle};

/// 256ε = 2⁻¹⁶: by what part of the longest side of its box a triangle is larger.
const OF_SIDE: f32 = f32::from_bits((127 - 16) << 23);
/// 16ε = 2⁻²⁰: by what part of its greatest coordinate along the axis.
const OF_COORDINATE: f32 = f32::from_bits((127 - 20) << 23);
/// By how much at least: more than what a device may flush to zero.
const LEAST: f32 = f32::from_bits((127 - 120) << 23);
/// Edges that are shorter along an axis are not cut there: both ends count. Their reciprocals are finite.
const SHORTEST: f32 = f32::from_bits((127 - 100) << 23);
/// Corners of a triangle that six planes have cut.
const CORNERS: usize = 9;

/// A primitive in a cell: the box of its part there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Reference {
    /// Within the cell, and not flat.
    pub bounds: Aabb,
    /// Index of the record.
    pub record: u32,
}

/// How near along each axis is near enough to touch.
pub fn padding(corners: &[[f32; 3]; 3]) -> [f32; 3] {
    let b = Aabb::around(corners);
    let longest = b.extent().into_iter().fold(0.0, f32::max).min(f32::MAX);
    std::array::from_fn(|i| OF_SIDE * longest + OF_COORDINATE * b.lo[i].abs().max(b.hi[i].abs()) + LEAST)
}

/// The box of a triangle, as large as what it touches; finite.
pub(super) fn padded(corners: &[[f32; 3]; 3]) -> Aabb {
    widened(&Aabb::around(corners), padding(corners)).intersection(&Aabb { lo: [-f32::MAX; 3], hi: [f32::MAX; 3] })
}

/// The box of what of a triangle touches a cell; `None` where nothing does.
pub(super) fn clipped(corners: &[[f32; 3]; 3], cell: &Aabb) -> Option<Aabb> {
    let padding = padding(corners);
    let larger = widened(cell, padding);
    let mut polygon = Polygon::of(corners);
    let is_cut = (0..3).all(|axis| polygon.cut(axis, larger.hi[axis], 1.0) && polygon.cut(axis, larger.lo[axis], -1.0));
    let bounds = if is_cut { polygon.bounds() } else { Aabb::around(corners) };
    let part = widened(&bounds, padding).intersection(cell);
    // A polygon of no corners has a box from +∞ to −∞.
    (0..3).all(|i| part.lo[i] < part.hi[i]).then_some(part)
}

/// What a plane across `axis` makes of a reference: its parts in the two halves of its cell.
pub(super) fn divided(
    reference: &Reference,
    records: &[Triangle],
    (axis, plane): (usize, f32),
    halves: &[Aabb; 2],
) -> [Option<Reference>; 2] {
    let (is_left, is_right) = (reference.bounds.lo[axis] < plane, reference.bounds.hi[axis] > plane);
    if is_left != is_right {
        return [is_left.then_some(*reference), is_right.then_some(*reference)];
    }
    let Triangle { v0, v1, v2, .. } = records[reference.record as usize];
    let part = |cell| clipped(&[v0, v1, v2], cell).map(|bounds| Reference { bounds, ..*reference });
    halves.each_ref().map(part)
}

fn widened(b: &Aabb, by: [f32; 3]) -> Aabb {
    Aabb { lo: std::array::from_fn(|i| b.lo[i] - by[i]), hi: std::array::from_fn(|i| b.hi[i] + by[i]) }
}

/// A convex polygon of no more than [`CORNERS`] corners.
struct Polygon {
    corners: [[f32; 3]; CORNERS],
    count: usize,
}

impl Polygon {
    fn of(triangle: &[[f32; 3]; 3]) -> Polygon {
        let mut corners = [[0.0; 3]; CORNERS];
        corners[..3].copy_from_slice(triangle);
        Polygon { corners, count: 3 }
    }

    fn bounds(&self) -> Aabb {
        Aabb::around(&self.corners[..self.count])
    }

    /// Cuts away what is beyond a plane in the direction of `sign`. False where rounding has bent the polygon so much that it crosses
    /// the plane over and over, and has more corners than there is room for: then it is good for nothing.
    fn cut(&mut self, axis: usize, plane: f32, sign: f32) -> bool {
        let is_kept = |p: &[f32; 3]| sign * p[axis] <= sign * plane;
        let corners = self.corners;
        let corners = &corners[..self.count];
        if corners.iter().all(is_kept) {
            return true;
        }
        self.count = 0;
        for (i, p) in corners.iter().enumerate() {
            let q = &corners[if i + 1 < corners.len() { i + 1 } else { 0 }];
            if is_kept(p) && !self.push(*p) {
                return false;
            }
            if is_kept(p) != is_kept(q) {
                // The same bits from whichever side the edge comes.
                let (a, b) = if p[axis] < q[axis] { (p, q) } else { (q, p) };
                let outer = if is_kept(p) { q } else { p };
                if !self.push(crossing(a, b, axis, plane).unwrap_or(*outer)) {
                    return false;
                }
            }
        }
        true
    }

    fn push(&mut self, corner: [f32; 3]) -> bool {
        let has_room = self.count < CORNERS;
        if has_room {
            self.corners[self.count] = corner;
            self.count += 1;
        }
        has_room
    }
}

/// Where the edge from a to b, which goes up along the axis, crosses the plane; `None` where it is too short or too long to tell.
fn crossing(a: &[f32; 3], b: &[f32; 3], axis: usize, plane: f32) -> Option<[f32; 3]> {
    let d: [f32; 3] = std::array::from_fn(|k| b[k] - a[k]);
    if d[axis] < SHORTEST || !d.iter().all(|d| d.is_finite()) {
        return None;
    }
    let t = (plane - a[axis]) * (1.0 / d[axis]);
    let mut point: [f32; 3] = std::array::from_fn(|k| a[k] + t * d[k]);
    point[axis] = plane;
    Some(point)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [4.0, 0.0, 1.0], [0.0, 4.0, 2.0]];

    fn cell(lo: [f32; 3], hi: [f32; 3]) -> Aabb {
        Aabb { lo, hi }
    }

    #[track_caller]
    fn assert_near(part: Option<Aabb>, lo: [f32; 3], hi: [f32; 3]) {
        let part = part.expect("it touches the cell");
        let near = (0..3).all(|i| (part.lo[i] - lo[i]).abs() < 2e-4 && (part.hi[i] - hi[i]).abs() < 2e-4);
        assert!(near, "{part:?}, expected about {lo:?} to {hi:?}");
    }

    #[test]
    fn a_part_is_as_small_as_the_cell_makes_it() {
        let whole = cell([-9.0; 3], [9.0; 3]);
        assert_near(clipped(&CORNERS, &whole), [0.0; 3], [4.0, 4.0, 2.0]);
        // x ≥ 2 leaves y ≤ 2 of the hypotenuse, and z of the plane z = x/4 + y/2.
        assert_near(clipped(&CORNERS, &cell([2.0, -9.0, -9.0], [9.0; 3])), [2.0, 0.0, 0.5], [4.0, 2.0, 1.5]);
        assert_near(clipped(&CORNERS, &cell([1.0, 1.0, -9.0], [2.0, 1.5, 9.0])), [1.0, 1.0, 0.75], [2.0, 1.5, 1.25]);
    }

    #[test]
    fn a_cell_that_the_box_reaches_and_the_triangle_does_not_is_not_touched() {
        assert_eq!(clipped(&CORNERS, &cell([3.0, 3.0, 0.0], [4.0, 4.0, 2.0])), None);
        assert_eq!(clipped(&CORNERS, &cell([0.0, 0.0, 1.0], [1.0, 1.0, 2.0])), None);
        assert_eq!(clipped(&CORNERS, &cell([5.0, 0.0, 0.0], [6.0, 1.0, 1.0])), None);
        assert!(clipped(&CORNERS, &cell([4.0, 0.0, 0.0], [6.0, 1.0, 2.0])).is_some(), "it touches with a corner");
    }

    #[test]
    fn what_is_flat_or_a_point_is_no_box_without_room() {
        for corners in [[[0.0f32; 3]; 3], [[1.0, 2.0, -3.0]; 3], [[1e30; 3]; 3], [[-1e-30; 3]; 3], [[f32::MAX; 3]; 3]] {
            let b = padded(&corners);
            assert!(
                (0..3).all(|i| b.lo[i] < b.hi[i] && b.lo[i].is_finite() && b.hi[i].is_finite()),
                "{corners:?} {b:?}"
            );
            assert_eq!(clipped(&corners, &b), Some(b), "{corners:?}");
        }
        let wall = [[0.0, 5.0, 0.0], [1.0, 5.0, 0.0], [0.0, 5.0, 1.0]];
        let b = padded(&wall);
        assert!(b.lo[1] < 5.0 && 5.0 < b.hi[1] && b.hi[1] - b.lo[1] < 1e-4, "{b:?}");
    }

    /// In double precision, at every point of a grid over the triangle.
    #[test]
    fn every_point_is_in_the_part_of_every_cell_that_it_is_in() {
        let mut state = 1u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 * 2f32.powi(-23) - 1.0
        };
        for round in 0..2000 {
            let scale = [1.0, 1e-6, 1e-25, 1e25][round % 4];
            let offset = [0.0, 1.0, 1000.0][round % 3] * scale;
            let thin = [1.0, 1e-3, 1e-7, 0.0][round / 4 % 4];
            let [a, b] = [(); 2].map(|()| [(); 3].map(|()| random() * scale + offset));
            let c: [f32; 3] = std::array::from_fn(|i| b[i] + thin * random() * scale);
            let corners = [a, b, c];
            let centre: [f32; 3] = std::array::from_fn(|i| 0.4 * a[i] + 0.3 * b[i] + 0.3 * c[i]);
            let cell = cell(
                std::array::from_fn(|i| centre[i] - random().abs() * 0.5 * scale),
                std::array::from_fn(|i| centre[i] + random().abs() * 0.5 * scale),
            );
            let part = clipped(&corners, &cell);
            for i in 0..=40 {
                for j in 0..=40 - i {
                    let (u, v) = (f64::from(i) / 40.0, f64::from(j) / 40.0);
                    let point: [f64; 3] = std::array::from_fn(|k| {
                        let [a, b, c] = corners.map(|corner| f64::from(corner[k]));
                        (1.0 - u - v) * a + u * b + v * c
                    });
                    let is_in =
                        |b: &Aabb| (0..3).all(|k| f64::from(b.lo[k]) <= point[k] && point[k] <= f64::from(b.hi[k]));
                    if is_in(&cell) {
                        assert!(part.is_some_and(|part| is_in(&part)), "{corners:?} {cell:?} {point:?}: {part:?}");
                    }
                }
            }
        }
    }
}
