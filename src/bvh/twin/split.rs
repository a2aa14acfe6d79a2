//! Splitting of large triangles, plainly: the references that [`crate::bvh::split`] finds on the device, in the same order.
//!
//! **No ray loses a hit.** A triangle is cut at a plane into two halves, both of which have the cut. Each part's box holds all of
//! the part: the corners on its side are taken as they are, the cut is a stretch between two crossings of edges, and the box
//! around a crossing is larger than what rounding can have moved it by. With ε = 2⁻²⁴ and an edge from a to b, d = b − a, the
//! part t of the edge is off by less than 4ε (three differences and a reciprocal, each correctly rounded, and their product), and
//! a + t·d in another axis by 6ε·|d| + ε·max(|a|, |b|): the margin is 32ε·|d| + 4ε·max(|a|, |b|). What the device may flush to
//! zero is left out of the computation, which the margin covers too: 2⁻¹⁰⁰ beside a |d| of at least 2⁻⁶⁰; an edge that is shorter
//! along an axis counts there with all of its extent. So every point of a triangle is in the box of one of its parts.
//!
//! [`crate::trace::slab`]'s proof takes the triangle's vertices for no farther from the ray's origin along any axis than the
//! box's corners. Those of a triangle that was split may be farther, by its longest side e: its parts' boxes are made larger by
//! what slack that is worth, 2⁻¹⁸e, and 2⁻²² of their coordinates for the rounding.

use super::geometry::Corners;
use crate::bvh::codes::Codes;
use crate::bvh::layout::{Bvh2, SLACK, Triangle};
use crate::bvh::split::{SplitOptions, SplitReference};
use crate::bvh::twin::lbvh::{self, Finish};
use crate::geometry::Aabb;

/// Halvings of the scene's extent.
const LEVELS: u32 = 20;
const CELLS: f32 = (1 << LEVELS) as f32;
/// Biased exponents of the longest extents of scenes that are split: 2⁻⁴⁰ to 2¹²⁰.
const EXPONENTS: std::ops::RangeInclusive<u32> = 127 - 40..=127 + 120;
/// Weights there are.
const WEIGHTS: u32 = 800;
/// Factors there are.
const FACTORS: u32 = 1056;
/// Fewer splits than 2 to that has any triangle.
const SPLITS_BITS: u32 = 10;
/// [`Reference::left_out`] where no status says why.
const INACTIVE: u32 = 1 << 31;

/// The LBVH of the references of triangles: what [`lbvh::build_corners`] is without splitting.
pub fn build_corners(
    corners: impl Iterator<Item = Corners>,
    options: &SplitOptions,
    codes: Codes,
    finish: impl Into<Finish>,
) -> Bvh2 {
    let corners: Vec<Corners> = corners.collect();
    if options.budget(corners.len() as u32) == 0 {
        return lbvh::build_corners(corners.into_iter(), codes, finish);
    }
    let references = references(&corners, options);
    let boxes: Vec<Result<Aabb, u32>> = references.iter().map(bounds_of).collect();
    let record = |i: u32| {
        let primitive = references[i as usize].primitive;
        let [v0, v1, v2] = corners.get(primitive as usize).copied().and_then(Result::ok).unwrap_or([[0.0; 3]; 3]);
        Triangle { v0, v1, v2, primitive }
    };
    let mut tree = lbvh::build_boxes(&boxes, record, codes, finish);
    tree.header.split_from = corners.len() as u32;
    tree
}

fn bounds_of(&SplitReference { lo, hi, left_out, .. }: &SplitReference) -> Result<Aabb, u32> {
    if left_out == 0 { Ok(Aabb { lo, hi }) } else { Err(left_out & !INACTIVE) }
}

/// The references of triangles: the first part of each at its own place, the others behind those of all, in the order of the
/// triangles; as many as there may be, so that the last ones may be none.
pub fn references(corners: &[Corners], options: &SplitOptions) -> Vec<SplitReference> {
    let count = corners.len() as u32;
    let budget = options.budget(count);
    let bounds = corners.iter().flatten().fold(Aabb::EMPTY, |b, c| b.union(&Aabb::around(c)));
    let grid = Grid::over(&bounds);
    let weights: Vec<Option<u32>> = corners.iter().map(|c| grid.weight_of(c.as_ref().ok()?)).collect();
    let splits_of_weight = splits_within(budget, options.most, &weights);
    let none = SplitReference { lo: [0.0; 3], primitive: u32::MAX, hi: [0.0; 3], left_out: INACTIVE };
    let mut others = Vec::new();
    let mut references: Vec<SplitReference> = Vec::with_capacity((count + budget) as usize);
    for (primitive, (corners, weight)) in (0..).zip(corners.iter().zip(weights)) {
        let splits = weight.map_or(0, |weight| splits_of_weight[weight as usize]);
        let (corners, left_out) = corners.map_or_else(|status| ([[0.0; 3]; 3], status), |corners| (corners, 0));
        let part = |number| {
            let found = grid.part(&corners, splits, number);
            found.map_or(none, |Aabb { lo, hi }| SplitReference { lo, primitive, hi, left_out })
        };
        references.push(part(0));
        others.extend((1..=splits).map(part));
    }
    references.extend(others);
    references.resize((count + budget) as usize, none);
    references
}

/// How many splits each weight has, by the greatest factor with which the sum of all is within the budget.
fn splits_within(budget: u32, most: u32, weights: &[Option<u32>]) -> Vec<u32> {
    let mut histogram = [0u64; WEIGHTS as usize];
    for weight in weights.iter().flatten() {
        histogram[*weight as usize] += 1;
    }
    let splits_of = |weight, factor| splits_of(weight, factor).min(most);
    let sum = |factor| -> u64 {
        let there = histogram.iter().zip(0..).filter(|&(&count, _)| count > 0);
        there.map(|(count, weight)| count * u64::from(splits_of(weight, factor))).sum()
    };
    let factor = (0..FACTORS).rev().find(|&factor| sum(factor) <= budget.into()).unwrap_or(0);
    (0..WEIGHTS).map(|weight| splits_of(weight, factor)).collect()
}

/// The cube root of weight times factor, rounded down.
fn splits_of(weight: u32, factor: u32) -> u32 {
    const MOST: u64 = (1 << (3 * SPLITS_BITS)) - 1;
    // Mantissas in eighths, and exponents.
    let product = u64::from((8 + (weight & 7)) * (8 + (factor & 7)));
    let exponent = (weight >> 3) as i32 + (factor >> 3) as i32 - 100;
    let cube = match exponent - 6 {
        shift @ ..0 => product.checked_shr(shift.unsigned_abs()).unwrap_or(0),
        shift => (product << shift.min(30)).min(MOST),
    };
    // A root in double precision is off by less than one.
    let near = (cube as f64).cbrt() as u64;
    (0..=near + 1).rev().find(|root| root * root * root <= cube).unwrap_or(0) as u32
}

fn power_of_two(exponent: i32) -> f32 {
    f32::from_bits(((127 + exponent) as u32) << 23)
}

fn biased_exponent(x: f32) -> u32 {
    x.to_bits() >> 23 & 0xFF
}

/// What is nearer to zero is zero, so that no result is too small for a device to keep.
fn without_tiny(x: f32) -> f32 {
    if x.abs() < power_of_two(-100) { 0.0 } else { x }
}

/// Along each axis a power of two of cells over the scene.
struct Grid {
    lo: [f32; 3],
    /// The extent of a cell; 0 along an axis that is not split.
    cell: [f32; 3],
    cells_per_length: [f32; 3],
    /// Of the plane in the middle: how many halvings shorter the axis is than the longest.
    level: [u32; 3],
    /// The power of two that brings the longest extent into [1/2, 1); 0: nothing is split.
    scale: f32,
}

#[derive(Clone, Copy)]
struct SplitPlane {
    axis: usize,
    at: f32,
    level: u32,
}

impl Grid {
    fn over(scene: &Aabb) -> Grid {
        let mut grid = Grid { lo: scene.lo, cell: [0.0; 3], cells_per_length: [0.0; 3], level: [0; 3], scale: 0.0 };
        let extent = scene.extent();
        let longest = biased_exponent(extent.into_iter().fold(f32::NEG_INFINITY, f32::max));
        if scene.lo[0] > scene.hi[0] || !EXPONENTS.contains(&longest) {
            return grid;
        }
        grid.scale = f32::from_bits((253 - longest) << 23);
        for (axis, extent) in extent.into_iter().enumerate() {
            let own = biased_exponent(extent);
            if own + LEVELS >= longest {
                grid.level[axis] = longest - own;
                grid.cell[axis] = extent * power_of_two(-(LEVELS as i32));
                grid.cells_per_length[axis] = (1.0 / extent) * CELLS;
            }
        }
        grid
    }

    /// The most important plane that lies strictly inside of a box: that of the greatest spacing; of such ones, across the longer
    /// side of the box.
    fn plane_in(&self, b: &Aabb) -> Option<SplitPlane> {
        let mut best: Option<(SplitPlane, f32)> = None;
        for axis in (0..3).filter(|&axis| self.cell[axis] != 0.0) {
            let cell = |x: f32| ((x - self.lo[axis]) * self.cells_per_length[axis]).clamp(0.0, CELLS - 1.0) as u32;
            let (mut from, mut to) = (cell(b.lo[axis]), cell(b.hi[axis]));
            let side = b.hi[axis] - b.lo[axis];
            // Rounding may put a side of the box a cell too far, no more.
            for _ in 0..4 {
                if from >= to {
                    break;
                }
                let bit = (from ^ to).ilog2();
                let index = to >> bit << bit;
                let at = without_tiny(self.lo[axis] + index as f32 * self.cell[axis]);
                if at <= b.lo[axis] {
                    from = index;
                } else if at >= b.hi[axis] {
                    to = index - 1;
                } else {
                    let level = LEVELS - 1 - bit + self.level[axis];
                    let is_better =
                        best.is_none_or(|(p, longest)| level < p.level || level == p.level && side > longest);
                    if is_better {
                        best = Some((SplitPlane { axis, at, level }, side));
                    }
                    break;
                }
            }
        }
        best.map(|(plane, _)| plane)
    }

    /// The weight of a triangle, as a number that counts eighths of octaves; none where it is not split.
    fn weight_of(&self, corners: &[[f32; 3]; 3]) -> Option<u32> {
        let b = Aabb::around(corners);
        let plane = self.plane_in(&b)?;
        let [v0, v1, v2] = *corners;
        let kept = |x: f32| if x.abs() < power_of_two(-40) { 0.0 } else { x };
        let scaled =
            |a: [f32; 3], b: [f32; 3]| -> [f32; 3] { std::array::from_fn(|i| kept((b[i] - a[i]) * self.scale)) };
        let (e, p, q) = (scaled(b.lo, b.hi), scaled(v0, v1), scaled(v0, v2));
        let normal: [f32; 3] = std::array::from_fn(|i| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            p[j] * q[k] - p[k] * q[j]
        });
        let of_box = e[0] * e[1] + e[1] * e[2] + e[2] * e[0];
        let ideal = 0.5 * (normal[0].abs() + normal[1].abs() + normal[2].abs());
        let saved = of_box - ideal;
        if saved <= 0.0 {
            return None;
        }
        // The exponent of the area, −96 being the least, less the plane's level; and three bits of the mantissa.
        let weight = (saved.to_bits() >> 20).checked_sub(8 * (127 - 96 + plane.level))?;
        Some(weight.min(WEIGHTS - 1))
    }

    /// The box of a triangle's part by number, if there is such a part: a triangle has one part more than splits.
    fn part(&self, corners: &[[f32; 3]; 3], mut splits: u32, mut number: u32) -> Option<Aabb> {
        let whole = Aabb::around(corners);
        let mut b = whole;
        // No box has more planes inside: each level has one along each axis.
        for _ in 0..3 * LEVELS {
            if splits == 0 {
                break;
            }
            let Some(plane) = self.plane_in(&b) else { break };
            let [below, above] = split_at(corners, &b, &plane);
            splits -= 1;
            if is_empty(&below) || is_empty(&above) {
                b = if is_empty(&below) { above } else { below };
                continue;
            }
            let first = splits_of_first(splits, &below, &above);
            if number <= first {
                (b, splits) = (below, first);
            } else {
                (b, number, splits) = (above, number - first - 1, splits - first);
            }
        }
        (number == 0).then(|| if b == whole { whole } else { padded(&b, &whole) })
    }
}

/// The box that holds those of all parts of a triangle whose own is `whole`.
pub fn around_parts(whole: &Aabb) -> Aabb {
    if is_empty(whole) { *whole } else { padded(whole, whole) }
}

/// The box of a part, larger by the slack that the vertices of its triangle, whose box is `whole`, need.
pub fn padded(b: &Aabb, whole: &Aabb) -> Aabb {
    let slack = SLACK * whole.extent().into_iter().fold(0.0, f32::max);
    let lo = std::array::from_fn(|i| b.lo[i] - (slack + power_of_two(-22) * b.lo[i].abs()));
    let hi = std::array::from_fn(|i| b.hi[i] + (slack + power_of_two(-22) * b.hi[i].abs()));
    Aabb { lo, hi }
}

fn is_empty(b: &Aabb) -> bool {
    (0..3).any(|i| b.lo[i] > b.hi[i])
}

/// Boxes around what of a triangle's part in a box lies below and above a plane across an axis. Together they hold all of it.
pub fn halves(corners: &[[f32; 3]; 3], b: &Aabb, axis: usize, at: f32) -> [Aabb; 2] {
    split_at(corners, b, &SplitPlane { axis, at, level: 0 })
}

/// Boxes around what of a triangle's part in a box lies on the two sides of a plane.
fn split_at(corners: &[[f32; 3]; 3], b: &Aabb, plane: &SplitPlane) -> [Aabb; 2] {
    let SplitPlane { axis, at, .. } = *plane;
    let [mut below, mut above] = [Aabb::EMPTY; 2];
    for k in 0..3 {
        let (p, q) = (corners[k], corners[(k + 1) % 3]);
        let corner = Aabb { lo: p, hi: p };
        if p[axis] <= at {
            below = below.union(&corner);
        }
        if p[axis] >= at {
            above = above.union(&corner);
        }
        if p[axis].min(q[axis]) < at && at < p[axis].max(q[axis]) {
            let crossing = if p[axis] < q[axis] { crossing_of(p, q, plane) } else { crossing_of(q, p, plane) };
            (below, above) = (below.union(&crossing), above.union(&crossing));
        }
    }
    [below, above].map(|part| part.intersection(b))
}

/// A box around where an edge from below a plane to above it crosses.
fn crossing_of(a: [f32; 3], b: [f32; 3], plane: &SplitPlane) -> Aabb {
    let shortest = power_of_two(-60);
    let d: [f32; 3] = std::array::from_fn(|i| b[i] - a[i]);
    let mut crossing = Aabb::around(&[a, b]);
    let along = d[plane.axis];
    if along >= shortest {
        let part = (plane.at - without_tiny(a[plane.axis])) * (1.0 / along);
        let t = if part < shortest { 0.0 } else { part };
        for k in (0..3).filter(|&k| d[k].abs() >= shortest) {
            let point = without_tiny(a[k]) + t * d[k];
            let margin = power_of_two(-19) * d[k].abs() + power_of_two(-22) * a[k].abs().max(b[k].abs());
            crossing.lo[k] = crossing.lo[k].max(point - margin);
            crossing.hi[k] = crossing.hi[k].min(point + margin);
        }
    }
    (crossing.lo[plane.axis], crossing.hi[plane.axis]) = (plane.at, plane.at);
    crossing
}

/// How many of the splits go to the part in the first box: in proportion to the longest sides, rounded.
fn splits_of_first(splits: u32, first: &Aabb, second: &Aabb) -> u32 {
    let side = [first, second].map(|b| b.extent().into_iter().fold(0.0, f32::max));
    let longest = side[0].max(side[1]);
    if longest < power_of_two(-100) {
        return splits / 2;
    }
    // Fifteen bits of the longer one.
    let scale = f32::from_bits((268 - biased_exponent(longest)) << 23);
    let [first, second] = side.map(|side| (side * scale) as u32);
    (2 * splits * first + first + second) / (2 * (first + second))
}
