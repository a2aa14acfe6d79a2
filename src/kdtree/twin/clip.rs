//! Split clipping: the box of what of a triangle lies in a cell (Papay 2025, section 9.6 and algorithm 8; Havran 2000).
//!
//! The thesis gathers where edges and faces of triangle and box cross. Here the triangle is cut at the six faces of the cell, one
//! after the other (Sutherland and Hodgman 1974): the same points, and no division by how steep the triangle stands to an edge.
//!
//! **Every point of a triangle is in a cell that references it.** A plane puts a triangle whose part ends at it on that side
//! alone; one that lies in it on either, as the builder likes; all others on both, each clipped again. The box of a part holds
//! the part: with ε = 2⁻²⁴, *s* the triangle's longest side and *c* its greatest coordinate along the axis, six cuts put what
//! is left of a triangle off by at most 64ε·s + 6ε·c. (Of a corner that a cut makes, a + t·(b − a), t is off by 8ε: two
//! differences, a reciprocal that a device has to 5ε, a product; t·(b − a) by two more; the sum is rounded once. Keeping it in
//! the box around the edge brings it no farther from where it should be.) So the faces that it is cut at are moved out by 64ε·s
//! + 8ε·c, `rounding`, and what was right before the cut and is off by less than that is kept; and the box around the part is
//! larger by as much, but not larger than the triangle's own: walls and tiles whose corners lie in common planes are parted by
//! them.
//!
//! A ray's hit may lie beside its triangle, by a part of how far and how long it is. The tracer looks beside the ray by as much
//! ([`crate::trace::twin::kd`]), as long as no triangle is longer than it knows from the header: [`reach_of`]. For those few
//! that are, a triangle is all that is near enough to it, `room`.

use crate::bvh::layout::{SLACK, Triangle};
use crate::geometry::Aabb;

/// 64ε: by what part of the longest side of its box a part may be off.
const OF_SIDE: f32 = f32::from_bits((127 - 18) << 23);
/// 8ε: by what part of its greatest coordinate along the axis.
const OF_COORDINATE: f32 = f32::from_bits((127 - 21) << 23);
/// By how much at least: more than what a device may flush to zero.
const LEAST: f32 = f32::from_bits((127 - 120) << 23);
/// A triangle is long if its longest side is this many octaves above the mean.
const LONG: u64 = 12;
/// Edges that are shorter along an axis are not cut there: both ends count. Their reciprocals are finite.
const SHORTEST: f32 = f32::from_bits((127 - 100) << 23);
/// Longer edges are not cut either: their reciprocals are subnormal, and a device may flush those to zero.
const LONGEST: f32 = f32::from_bits((127 + 125) << 23);
/// Corners of a triangle that six planes have cut.
const CORNERS: usize = 9;

/// A primitive in a cell: the box of its part there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KdReference {
    /// Within the cell; flat where the triangle is.
    pub bounds: Aabb,
    /// Index of the record.
    pub record: u32,
}

/// The longest side of the box around a triangle; finite.
fn longest_side(corners: &[[f32; 3]; 3]) -> f32 {
    Aabb::around(corners).extent().into_iter().fold(0.0, f32::max).min(f32::MAX)
}

/// How long a triangle may be to be referenced only where it is: as the longest, or 2¹² times the mean of their octaves. More would
/// have rays look far beside themselves, where most triangles are small, for the sake of a few.
pub fn reach_of(records: &[Triangle]) -> f32 {
    let sides = || records.iter().map(|t| longest_side(&[t.v0, t.v1, t.v2])).filter(|side| side.is_normal());
    let (sum, count) = sides().fold((0, 0), |(sum, count), side| (sum + u64::from(side.to_bits() >> 23), count + 1));
    let octave = (sum / count.max(1) + LONG).min(254);
    sides().fold(0.0, f32::max).min(f32::from_bits((octave as u32) << 23))
}

/// How near along each axis is near enough to be met for a triangle: nothing for those within `reach`.
fn room(corners: &[[f32; 3]; 3], reach: f32) -> [f32; 3] {
    let longest = longest_side(corners);
    let rounding = rounding(corners);
    rounding.map(|rounding| if longest > reach { 2.0 * SLACK * longest + rounding } else { 0.0 })
}

/// By how much along each axis the box of a part is off at most.
fn rounding(corners: &[[f32; 3]; 3]) -> [f32; 3] {
    let (b, longest) = (Aabb::around(corners), longest_side(corners));
    std::array::from_fn(|i| OF_SIDE * longest + OF_COORDINATE * b.lo[i].abs().max(b.hi[i].abs()) + LEAST)
}

/// The box of a triangle with its room; finite.
pub fn bounds_of(corners: &[[f32; 3]; 3], reach: f32) -> Aabb {
    widened(&Aabb::around(corners), room(corners, reach)).intersection(&FINITE)
}

/// What a triangle adds to the root's cell: its box, not flat; finite.
pub fn cell_around(corners: &[[f32; 3]; 3], reach: f32) -> Aabb {
    widened(&bounds_of(corners, reach), rounding(corners)).intersection(&FINITE)
}

const FINITE: Aabb = Aabb { lo: [-f32::MAX; 3], hi: [f32::MAX; 3] };

/// The box of a triangle's part in a cell; `None` if no part is in it.
pub fn clipped(corners: &[[f32; 3]; 3], reach: f32, cell: &Aabb) -> Option<Aabb> {
    let (room, rounding) = (room(corners, reach), rounding(corners));
    let margin = std::array::from_fn(|i| room[i] + rounding[i]);
    let larger = widened(cell, margin);
    let whole = Aabb::around(corners);
    let mut polygon = ClippedTriangle::of(corners);
    for axis in 0..3 {
        if whole.hi[axis] > larger.hi[axis] {
            polygon.cut(axis, larger.hi[axis], 1.0);
        }
        if whole.lo[axis] < larger.lo[axis] {
            polygon.cut(axis, larger.lo[axis], -1.0);
        }
    }
    let part = widened(&polygon.bounds(), margin).intersection(&bounds_of(corners, reach)).intersection(cell);
    // A polygon of no corners has a box from +∞ to −∞.
    (0..3).all(|i| part.lo[i] <= part.hi[i]).then_some(part)
}

/// A plane across an axis, and on which side of it is what lies in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KdPlane {
    /// The axis across which it lies.
    pub axis: usize,
    /// Its position there.
    pub at: f32,
    /// Whether what lies in it goes to the left, rather than to the right.
    pub planar_left: bool,
}

impl KdPlane {
    /// Whether a box is on the left and on the right.
    pub fn sides_of(&self, b: &Aabb) -> [bool; 2] {
        let (lo, hi) = (b.lo[self.axis], b.hi[self.axis]);
        let is_planar = lo == self.at && hi == self.at;
        [lo < self.at || is_planar && self.planar_left, hi > self.at || is_planar && !self.planar_left]
    }
}

/// What a plane makes of a reference: its parts in the two halves of its cell.
pub fn divided(
    reference: &KdReference,
    (records, reach): (&[Triangle], f32),
    plane: &KdPlane,
    halves: &[Aabb; 2],
) -> [Option<KdReference>; 2] {
    let sides = plane.sides_of(&reference.bounds);
    if sides != [true; 2] {
        return sides.map(|is_there| is_there.then_some(*reference));
    }
    let Triangle { v0, v1, v2, .. } = records[reference.record as usize];
    let part = |cell| clipped(&[v0, v1, v2], reach, cell).map(|bounds| KdReference { bounds, ..*reference });
    let parts = halves.each_ref().map(part);
    if parts != [None; 2] {
        return parts;
    }
    // Rounding has it that the triangle is in neither: it was in the cell, and no node may lose its last reference.
    halves.each_ref().map(|half| Some(KdReference { bounds: reference.bounds.intersection(half), ..*reference }))
}

fn widened(b: &Aabb, by: [f32; 3]) -> Aabb {
    Aabb { lo: std::array::from_fn(|i| b.lo[i] - by[i]), hi: std::array::from_fn(|i| b.hi[i] + by[i]) }
}

/// A polygon of no more than [`CORNERS`] corners.
///
/// However it is rounded, once around it every coordinate goes up once and down once at most: those of a triangle do, and what
/// a cut puts between two corners has coordinates between theirs ([`crossing`]). So a plane is crossed twice at most, and takes
/// at least one corner away for the two that it adds.
struct ClippedTriangle {
    corners: [[f32; 3]; CORNERS],
    count: usize,
}

impl ClippedTriangle {
    fn of(triangle: &[[f32; 3]; 3]) -> ClippedTriangle {
        let mut corners = [[0.0; 3]; CORNERS];
        corners[..3].copy_from_slice(triangle);
        ClippedTriangle { corners, count: 3 }
    }

    fn bounds(&self) -> Aabb {
        Aabb::around(&self.corners[..self.count])
    }

    /// Cuts away what is beyond a plane in the direction of `sign`.
    fn cut(&mut self, axis: usize, plane: f32, sign: f32) {
        let is_kept = |p: &[f32; 3]| sign * p[axis] <= sign * plane;
        let corners = self.corners;
        let corners = &corners[..self.count];
        if corners.iter().all(is_kept) {
            return;
        }
        self.count = 0;
        for (i, p) in corners.iter().enumerate() {
            let q = &corners[if i + 1 < corners.len() { i + 1 } else { 0 }];
            if is_kept(p) {
                self.push(*p);
            }
            if is_kept(p) != is_kept(q) {
                // The same bits from whichever side the edge comes.
                let (a, b) = if p[axis] < q[axis] { (p, q) } else { (q, p) };
                let outer = if is_kept(p) { q } else { p };
                self.push(crossing(a, b, axis, plane).unwrap_or(*outer));
            }
        }
    }

    fn push(&mut self, corner: [f32; 3]) {
        self.corners[self.count] = corner;
        self.count += 1;
    }
}

/// Where the edge from a to b, which goes up along the axis, crosses the plane, within the box around the edge; `None` where it
/// is too short or too long to tell.
fn crossing(a: &[f32; 3], b: &[f32; 3], axis: usize, plane: f32) -> Option<[f32; 3]> {
    let d: [f32; 3] = std::array::from_fn(|k| b[k] - a[k]);
    if !(SHORTEST..=LONGEST).contains(&d[axis]) || !d.iter().all(|d| d.is_finite()) {
        return None;
    }
    let t = (plane - a[axis]) * (1.0 / d[axis]);
    let t = if t.is_normal() { t } else { 0.0 };
    let mut point: [f32; 3] = std::array::from_fn(|k| (a[k] + t * d[k]).max(a[k].min(b[k])).min(a[k].max(b[k])));
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

    /// Random numbers of 24 bits.
    fn numbers() -> impl FnMut() -> u32 {
        let mut state = 1u64;
        move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as u32
        }
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
        assert_near(clipped(&CORNERS, 9.0, &whole), [0.0; 3], [4.0, 4.0, 2.0]);
        // x ≥ 2 leaves y ≤ 2 of the hypotenuse, and z of the plane z = x/4 + y/2.
        assert_near(clipped(&CORNERS, 9.0, &cell([2.0, -9.0, -9.0], [9.0; 3])), [2.0, 0.0, 0.5], [4.0, 2.0, 1.5]);
        assert_near(
            clipped(&CORNERS, 9.0, &cell([1.0, 1.0, -9.0], [2.0, 1.5, 9.0])),
            [1.0, 1.0, 0.75],
            [2.0, 1.5, 1.25],
        );
    }

    #[test]
    fn a_cell_that_the_box_reaches_and_the_triangle_does_not_is_not_touched() {
        assert_eq!(clipped(&CORNERS, 9.0, &cell([3.0, 3.0, 0.0], [4.0, 4.0, 2.0])), None);
        assert_eq!(clipped(&CORNERS, 9.0, &cell([0.0, 0.0, 1.0], [1.0, 1.0, 2.0])), None);
        assert_eq!(clipped(&CORNERS, 9.0, &cell([5.0, 0.0, 0.0], [6.0, 1.0, 1.0])), None);
        assert!(clipped(&CORNERS, 9.0, &cell([4.0, 0.0, 0.0], [6.0, 1.0, 2.0])).is_some(), "it touches with a corner");
    }

    #[test]
    fn the_cell_around_what_is_flat_or_a_point_is_not() {
        for corners in [[[0.0f32; 3]; 3], [[1.0, 2.0, -3.0]; 3], [[1e30; 3]; 3], [[-1e-30; 3]; 3], [[f32::MAX; 3]; 3]] {
            let b = cell_around(&corners, 1.0);
            assert!(
                (0..3).all(|i| b.lo[i] < b.hi[i] && b.lo[i].is_finite() && b.hi[i].is_finite()),
                "{corners:?} {b:?}"
            );
            assert_eq!(clipped(&corners, 1.0, &b), Some(Aabb::around(&corners)), "{corners:?}");
        }
    }

    #[test]
    fn planes_part_what_ends_at_them_and_clip_what_crosses_them() {
        let left = Triangle { v0: [0.0; 3], v1: [1.0, 0.0, 0.0], v2: [1.0, 1.0, 0.0], primitive: 0 };
        let planar = Triangle { v0: [1.0, 0.0, 0.0], v1: [1.0, 1.0, 0.0], v2: [1.0, 0.0, 1.0], primitive: 1 };
        let both = Triangle { v0: [0.0; 3], v1: [3.0, 0.0, 0.0], v2: [0.0, 3.0, 0.0], primitive: 2 };
        let records = [left, planar, both];
        let cell = cell([-1.0; 3], [4.0; 3]);
        for planar_left in [false, true] {
            let plane = KdPlane { axis: 0, at: 1.0, planar_left };
            let halves = crate::kdtree::layout::halves(&cell, 0, 1.0);
            let sides = [0, 1, 2].map(|record: u32| {
                let t = records[record as usize];
                let bounds = bounds_of(&[t.v0, t.v1, t.v2], 9.0);
                divided(&KdReference { bounds, record }, (&records, 9.0), &plane, &halves).map(|part| part.is_some())
            });
            assert_eq!(sides, [[true, false], [planar_left, !planar_left], [true; 2]]);
        }
    }

    #[test]
    fn few_long_triangles_have_room_and_others_none() {
        let small = |i: usize| Triangle { v0: [i as f32; 3], v1: [i as f32 + 1.5; 3], v2: [i as f32; 3], primitive: 0 };
        let mut records: Vec<Triangle> = (0..100).map(small).collect();
        assert_eq!(reach_of(&records), 1.5);
        records.push(Triangle { v0: [0.0; 3], v1: [1e6; 3], v2: [0.0; 3], primitive: 0 });
        let reach = reach_of(&records);
        assert_eq!(reach, 4096.0);
        let room_of = |t: &Triangle| room(&[t.v0, t.v1, t.v2], reach)[0];
        assert_eq!(room_of(&records[5]), 0.0);
        assert!(room_of(&records[100]) >= 2.0 * SLACK * 1e6);
        assert_eq!(reach_of(&[]), 0.0);
        assert_eq!(reach_of(&[Triangle { v0: [1.0; 3], v1: [1.0; 3], v2: [1.0; 3], primitive: 0 }]), 0.0);
    }

    /// So a plane crosses it twice at most. Coordinates of all magnitudes, and planes next to corners, where an edge's parameter is
    /// rounded to more than 1 and what is cut off would end beyond the edge.
    #[test]
    fn coordinates_of_a_cut_triangle_go_up_once_and_down_once() {
        let mut random = numbers();
        for _ in 0..50_000 {
            let coordinate =
                |bits: u32| (bits >> 5) as f32 * 2f32.powi(-(bits as i32 % 32)) * [1.0, -1.0][bits as usize % 2];
            let mut polygon = ClippedTriangle::of(&[(); 3].map(|()| [(); 3].map(|()| coordinate(random()))));
            for axis in 0..3 {
                for sign in [1.0, -1.0] {
                    let at = polygon.corners[random() as usize % polygon.count.max(1)][axis];
                    polygon.cut(axis, f32::from_bits((at.to_bits() + random() % 5).saturating_sub(2)), sign);
                    let corners = &polygon.corners[..polygon.count];
                    for k in 0..3 {
                        let steps = (0..corners.len()).map(|i| corners[(i + 1) % corners.len()][k] - corners[i][k]);
                        let ups: Vec<bool> = steps.filter(|step| *step != 0.0).map(|step| step > 0.0).collect();
                        let turns = (0..ups.len()).filter(|&i| ups[i] != ups[(i + 1) % ups.len()]).count();
                        assert!(turns <= 2, "axis {k}: {corners:?}");
                    }
                }
            }
        }
    }

    /// In double precision, at every point of a grid over the triangle.
    #[test]
    fn every_point_is_in_the_part_of_every_cell_that_it_is_in() {
        let mut random = numbers();
        let mut random = || random() as f32 * 2f32.powi(-23) - 1.0;
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
            let part = clipped(&corners, f32::MAX, &cell);
            for i in 0..=40 {
                for j in 0..=40 - i {
                    let (u, v) = (f64::from(i) / 40.0, f64::from(j) / 40.0);
                    let point: [f64; 3] = std::array::from_fn(|k| {
                        let [a, b, c] = corners.map(|corner| f64::from(corner[k]));
                        (1.0 - u - v) * a + u * b + v * c
                    });
                    // The point itself is rounded.
                    let is_in = |b: &Aabb, off: f64| {
                        (0..3).all(|k| {
                            let off = off * point[k].abs();
                            f64::from(b.lo[k]) <= point[k] + off && point[k] - off <= f64::from(b.hi[k])
                        })
                    };
                    if is_in(&cell, 0.0) {
                        let is_there = part.is_some_and(|part| is_in(&part, 1e-14));
                        assert!(is_there, "{corners:?} {cell:?} {point:?}: {part:?}");
                    }
                }
            }
        }
    }
}
