//! Rays on a grid, plainly: the same numbers as [`crate::trace::flux`] has on the device.

use crate::bvh::flux::{CELLS, FluxGrid, MAX_FLUX_RAYS, PARTS, PLACES, POINTS, cell, point, quotient};
use crate::bvh::layout::{Bvh2, Record};
use crate::trace::ray::PreparedRay;
use crate::trace::{Hit, Ray};

/// Parts of the longest component of a direction that count as none.
const FLATTEST: f32 = 1.0 / (1u64 << 40) as f32;
/// What is farther, the scene's longest edge being 1 to 4, has no place.
const FARTHEST: f32 = (1u64 << 40) as f32;
const SHORTEST_WAY: f32 = 1.0 / (1u64 << 60) as f32;
const LONGEST_WAY: f32 = (1u64 << 60) as f32;

/// The grid of these rays, each with its closest hit, over the box of `tree`.
///
/// # Panics
/// There are more than [`MAX_FLUX_RAYS`] rays.
pub fn fill<'r, R: Record>(tree: &Bvh2<R>, rays: impl IntoIterator<Item = (&'r Ray, &'r Hit)>) -> FluxGrid {
    let mut grid = FluxGrid::over(tree);
    for (i, (ray, hit)) in rays.into_iter().enumerate() {
        assert!(i < MAX_FLUX_RAYS as usize, "at most {MAX_FLUX_RAYS} rays are on a grid");
        grid.add(ray, if hit.is_some() && hit.t < ray.t_max { hit.t } else { ray.t_max });
    }
    (0..3).for_each(|axis| grid.sum_along(axis));
    grid
}

fn or_nothing(x: f32) -> f32 {
    if x.abs() < SHORTEST_WAY { 0.0 } else { x }
}

/// Where a segment begins or ends: its place, and along which axis it goes through the grid's wall there.
#[derive(Clone, Copy)]
struct End {
    place: [u32; 3],
    wall: Option<usize>,
}

impl FluxGrid {
    /// Adds a ray that ended at `t_end`.
    fn add(&mut self, ray: &Ray, t_end: f32) {
        if let Some(ends) = self.ends_of(ray, t_end) {
            for end in ends {
                let at = end.place.map(|place| cell(place) + 1);
                match end.wall {
                    None => self.points[point(at)][3] += 1,
                    Some(axis) => self.add_face(axis, if end.place[axis] == 0 { 0 } else { CELLS }, end.place),
                }
            }
            let [a, b] = ends.map(|end| end.place);
            (0..3).for_each(|axis| self.add_crossings(axis, a, b));
        }
    }

    /// Counts the face of a cell across an axis.
    fn add_face(&mut self, axis: usize, plane: u32, place: [u32; 3]) {
        let mut at = place.map(|place| cell(place) + 1);
        at[axis] = plane;
        self.points[point(at)][axis] += 1;
    }

    /// Counts all planes between cells along an axis.
    fn add_crossings(&mut self, axis: usize, a: [u32; 3], b: [u32; 3]) {
        let (low, high) = if a[axis] <= b[axis] { (a, b) } else { (b, a) };
        for plane in cell(low[axis]) + 1..=cell(high[axis]) {
            // Below 2³⁰: whole numbers, so that every device finds the same cell.
            let moved = |i: usize| (PARTS * plane - low[axis]) * high[i].abs_diff(low[i]) / (high[axis] - low[axis]);
            let place = |i: usize| if high[i] >= low[i] { low[i] + moved(i) } else { low[i] - moved(i) };
            self.add_face(axis, plane, std::array::from_fn(place));
        }
    }

    /// Where the part of a ray in the grid's box begins and ends, if there is one.
    fn ends_of(&self, ray: &Ray, t_end: f32) -> Option<[End; 2]> {
        PreparedRay::new(ray)?;
        let scaled = ray.origin.map(|x| x * self.scale);
        let begins = ray.t_min < t_end;
        if !begins || !scaled.iter().all(|x| x.abs() <= FARTHEST) {
            return None;
        }
        // Lengths along the ray in the scene's own, and the direction with a longest component of 1 to 2.
        let exponent = ray.direction.iter().fold(0.0, |m: f32, d| m.max(d.abs())).to_bits() >> 23;
        let (up, down) = (f32::from_bits(exponent << 23), f32::from_bits((254 - exponent) << 23));
        let length = |t: f32| or_nothing(or_nothing(t * up) * self.scale).min(LONGEST_WAY);
        let (near, far) = (length(ray.t_min.max(0.0)), length(t_end));
        let direction = ray.direction.map(|d| d * down).map(|d| if d.abs() < FLATTEST { 0.0 } else { d });
        let from: [f32; 3] = std::array::from_fn(|i| (scaled[i] - self.lo[i]) * self.factor[i]);
        let way: [f32; 3] = std::array::from_fn(|i| direction[i] * self.factor[i]);
        let (mut enter, mut leave) = ((near, None), (far, None));
        for i in 0..3 {
            if way[i] == 0.0 {
                if from[i] < 0.0 || from[i] > PLACES {
                    return None;
                }
                continue;
            }
            // What is left to the wall in front and to the one behind.
            let [left_in, left_out] = match way[i] > 0.0 {
                true => [-from[i], PLACES - from[i]],
                false => [from[i] - PLACES, from[i]],
            }
            .map(or_nothing);
            let speed = way[i].abs();
            if left_out < 0.0 {
                return None;
            }
            if left_in > 0.0 && speed * near < left_in {
                let t = quotient(left_in, speed);
                if t > enter.0 {
                    enter = (t, Some(i));
                }
            } else if speed * near > left_out {
                return None;
            }
            if speed * far > left_out {
                let t = if left_out == 0.0 { 0.0 } else { quotient(left_out, speed) };
                if t < leave.0 {
                    leave = (t, Some(i));
                }
            }
        }
        if enter.0 > leave.0 {
            return None;
        }
        let end = |(t, wall): (f32, Option<usize>), far_wall: bool| {
            let mut place: [u32; 3] = std::array::from_fn(|i| (from[i] + way[i] * t).clamp(0.0, PLACES) as u32);
            if let Some(axis) = wall {
                place[axis] = if (way[axis] > 0.0) == far_wall { PLACES as u32 } else { 0 };
            }
            End { place, wall }
        };
        Some([end(enter, false), end(leave, true)])
    }

    fn sum_along(&mut self, axis: usize) {
        let mut at = [0; 3];
        for line in 0..POINTS * POINTS {
            (at[(axis + 1) % 3], at[(axis + 2) % 3]) = (line / POINTS, line % POINTS);
            let mut sum = [0u32; 4];
            for i in 0..POINTS {
                at[axis] = i;
                let here = &mut self.points[point(at)];
                // What crosses planes along the axis is not summed along it.
                for c in (0..4).filter(|&c| c != axis) {
                    sum[c] += here[c];
                    here[c] = sum[c];
                }
            }
        }
    }
}
