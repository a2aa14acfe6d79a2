//! Rays on a grid: how many cross each cell's faces, and how many begin or end in each cell. By half the crossings of a box's faces
//! and the ends in it, a box has the number of rays that meet it.

use super::frames::Segment;
use hedgerow::geometry::Aabb;

/// Sums from a corner of the scene's box.
pub struct Flux {
    cells: usize,
    lo: [f32; 3],
    inverse: [f32; 3],
    /// Of each axis, in each plane across it, crossings up to a corner.
    crossings: [Vec<f64>; 3],
    /// Ends up to a corner.
    ends: Vec<f64>,
}

impl Flux {
    pub fn new(segments: &[Segment], bounds: &Aabb, cells: usize) -> Flux {
        let extent: [f32; 3] = std::array::from_fn(|i| (bounds.hi[i] - bounds.lo[i]).max(1e-12));
        let inverse = extent.map(|e| cells as f32 / e);
        let points = cells + 1;
        let mut crossings: [Vec<f64>; 3] = [(); 3].map(|()| vec![0.0; points * points * points]);
        let mut ends = vec![0.0f64; points * points * points];
        let place = |p: [f32; 3]| -> [f32; 3] { std::array::from_fn(|i| (p[i] - bounds.lo[i]) * inverse[i]) };
        let most = cells as f32;
        for segment in segments {
            let Some([from, to]) = segment.within(bounds) else { continue };
            let (a, b) = (place(segment.at(from)), place(segment.at(to)));
            let cell = |x: f32| (x.max(0.0) as usize).min(cells - 1);
            for (t, p) in [(0.0, a), (segment.t_end, b)] {
                if (from..=to).contains(&t) {
                    let [i, j, k] = p.map(cell);
                    ends[((i + 1) * points + j + 1) * points + k + 1] += 1.0;
                }
            }
            for axis in 0..3 {
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                let (low, high) = (a[axis].min(b[axis]), a[axis].max(b[axis]));
                // Where a segment leaves the box, it crosses the wall.
                let first = low.ceil().max(0.0) as usize;
                let mut plane = first;
                while plane as f32 <= high.min(most) && plane <= cells {
                    let share = if high > low { (plane as f32 - a[axis]) / (b[axis] - a[axis]) } else { 0.0 };
                    let (pu, pv) = (a[u] + share * (b[u] - a[u]), a[v] + share * (b[v] - a[v]));
                    crossings[axis][(plane * points + cell(pu) + 1) * points + cell(pv) + 1] += 1.0;
                    plane += 1;
                }
            }
        }
        for planes in &mut crossings {
            for plane in planes.chunks_mut(points * points) {
                for i in 1..points {
                    for j in 1..points {
                        plane[i * points + j] +=
                            plane[(i - 1) * points + j] + plane[i * points + j - 1] - plane[(i - 1) * points + j - 1];
                    }
                }
            }
        }
        for i in 1..points {
            for j in 1..points {
                for k in 1..points {
                    let at = |i: usize, j: usize, k: usize| (i * points + j) * points + k;
                    ends[at(i, j, k)] += ends[at(i - 1, j, k)] + ends[at(i, j - 1, k)] + ends[at(i, j, k - 1)]
                        - ends[at(i - 1, j - 1, k)]
                        - ends[at(i - 1, j, k - 1)]
                        - ends[at(i, j - 1, k - 1)]
                        + ends[at(i - 1, j - 1, k - 1)];
                }
            }
        }
        Flux { cells, lo: bounds.lo, inverse, crossings, ends }
    }

    fn step(&self, x: f64) -> (usize, f64) {
        let x = x.clamp(0.0, self.cells as f64);
        let i = (x as usize).min(self.cells - 1);
        (i, x - i as f64)
    }

    fn rectangle(&self, axis: usize, plane: usize, u: [(usize, f64); 2], v: [(usize, f64); 2]) -> f64 {
        let points = self.cells + 1;
        let sums = &self.crossings[axis][plane * points * points..];
        let up_to = |(i, a): (usize, f64), (j, b): (usize, f64)| {
            let at = |i: usize, j: usize| sums[i * points + j];
            let low = at(i, j) + b * (at(i, j + 1) - at(i, j));
            let high = at(i + 1, j) + b * (at(i + 1, j + 1) - at(i + 1, j));
            low + a * (high - low)
        };
        up_to(u[1], v[1]) - up_to(u[0], v[1]) - up_to(u[1], v[0]) + up_to(u[0], v[0])
    }

    /// How many rays meet a box.
    pub fn rays(&self, bounds: &Aabb) -> f32 {
        let place = |p: [f32; 3]| -> [(usize, f64); 3] {
            std::array::from_fn(|i| self.step(f64::from((p[i] - self.lo[i]) * self.inverse[i])))
        };
        let corners = [place(bounds.lo), place(bounds.hi)];
        let mut sum = 0.0;
        for axis in 0..3 {
            let along = |axis: usize| [corners[0][axis], corners[1][axis]];
            let (u, v) = (along((axis + 1) % 3), along((axis + 2) % 3));
            for (plane, part) in along(axis) {
                sum += (1.0 - part) * self.rectangle(axis, plane, u, v);
                sum += part * self.rectangle(axis, plane + 1, u, v);
            }
        }
        let points = self.cells + 1;
        let up_to = |[x, y, z]: [(usize, f64); 3]| {
            let mut sum = 0.0;
            for corner in 0..8 {
                let pick = |(i, part): (usize, f64), bit: usize| {
                    if corner >> bit & 1 == 1 { (i + 1, part) } else { (i, 1.0 - part) }
                };
                let ((i, a), (j, b), (k, c)) = (pick(x, 0), pick(y, 1), pick(z, 2));
                sum += a * b * c * self.ends[(i * points + j) * points + k];
            }
            sum
        };
        for corner in 0..8 {
            let pick = |axis: usize| corners[corner >> axis & 1][axis];
            let low = 3 - (corner as u32).count_ones();
            let sign = if low.is_multiple_of(2) { 1.0 } else { -1.0 };
            sum += sign * up_to([pick(0), pick(1), pick(2)]);
        }
        (0.5 * sum.max(0.0)) as f32
    }
}
