//! The flux of rays with uniform origins in a box and uniform directions, through surface elements across the axes.
//!
//! A ray from the scene's box S that goes on to its wall crosses an element across axis k at x with a density of
//! M_k(x) / V(S), where M_k(x) = 1/4π ∫ |ω_k| d(x, ω) dω over all directions, and d is the distance from x to the wall. Wall by
//! wall the integral is elementary. The wall across k at distance h gives h times its solid angle. One across another axis a, at
//! distance h, gives h (G(h) − G(√(h² + U²))) for each of both distances U to the walls across k, where
//! G(c) = asinh(v₁/c) − asinh(v₀/c), and v₀, v₁ are the extents along the third axis. All of it over 4π.
//!
//! No paper has this form: Fabianowski, Fowler and Dingliana 2009 approximate the integral over S of solid angles, of which
//! they know no closed form. The flux turns that into an integral over the six faces of a box. It is tabulated, and integrals
//! over rectangles are made of sums from a corner of the table, as are those of summed area tables (Crow 1984).

use super::angle::of_rectangle;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Steps of the table along each axis.
const STEPS: usize = 32;
/// Points of it along each axis.
const POINTS: usize = STEPS + 1;
/// Those of a half, with the middle: the other half is a mirror image.
const HALF: usize = STEPS / 2 + 1;

/// The place of a point, from 0 to 1. Steps grow with the distance from the walls, where the flux changes fastest.
fn place_of(point: usize) -> f64 {
    let from_wall = point.min(STEPS - point) as f64 / STEPS as f64;
    let place = from_wall * (0.5 + from_wall);
    if point < HALF { place } else { 1.0 - place }
}

/// How long a step is.
fn step(number: usize) -> f64 {
    place_of(number + 1) - place_of(number)
}

/// M_k at a point whose distances to the walls are `below` and `above`, along each axis. A length.
pub(super) fn flux(axis: usize, below: [f64; 3], above: [f64; 3]) -> f64 {
    let extent = |axis: usize| [-below[axis], above[axis]];
    let walls = |axis: usize| [below[axis], above[axis]].into_iter().filter(|&distance| distance > 0.0);
    let beside = [(axis + 1) % 3, (axis + 2) % 3];
    let across: f64 = walls(axis).map(|h| h * of_rectangle(extent(beside[0]), extent(beside[1]), h)).sum();
    let along = |[a, third]: [usize; 2]| -> f64 {
        let arcs = |c: f64| (above[third] / c).asinh() + (below[third] / c).asinh();
        walls(a).flat_map(|h| walls(axis).map(move |u| h * (arcs(h) - arcs(h.hypot(u))))).sum()
    };
    (across + along(beside) + along([beside[1], beside[0]])) / (4.0 * PI)
}

/// Of a point in a plane of the table: integrals from the plane's corner over both axes, over the first at this place of the
/// second, over the second at this place of the first, and the value.
type Sums = [f64; 4];

/// The flux in a box whose lengths are divided by its edges. Between its points it is linear along each axis.
pub(super) struct FluxTable {
    /// For each axis, the planes across it; in a plane, rows along the axis after the next.
    planes: Vec<Sums>,
}

impl FluxTable {
    /// Of a box with these edges. The flux through elements across an axis is divided by the edge along it: so it is that of the
    /// elements' parts of a wall.
    pub fn new(edges: [f64; 3]) -> FluxTable {
        let halves: Vec<Vec<Sums>> =
            (0..3 * HALF).into_par_iter().map(|i| sums(&plane(edges, i / HALF, i % HALF))).collect();
        let places = (0..3).flat_map(|axis| (0..POINTS).map(move |i| axis * HALF + i.min(STEPS - i)));
        let planes = places.flat_map(|place| &halves[place]).copied().collect();
        FluxTable { planes }.normalised()
    }

    /// As every ray leaves through a wall, the flux through all of them is the volume; what is linear between points is a little
    /// less.
    fn normalised(mut self) -> FluxTable {
        let walls = (0..3).flat_map(|axis| [(axis, 0.0), (axis, 1.0)]);
        let ends = [0.0, 1.0].map(Place::new);
        let through = |(axis, at)| self.through(axis, &Place::new(at), ends.each_ref(), ends.each_ref());
        let flux: f64 = walls.map(through).sum();
        self.planes.as_flattened_mut().iter_mut().for_each(|sum| *sum /= flux);
        self
    }

    /// The integral over a rectangle across `axis` at `at`, with these extents along the next axis and the one after it.
    pub fn through(&self, axis: usize, at: &Place, u: [&Place; 2], v: [&Place; 2]) -> f64 {
        if u[1].at <= u[0].at || v[1].at <= v[0].at {
            return 0.0;
        }
        let of_plane = |plane: usize| {
            let up_to = |u, v| self.up_to(axis * POINTS + plane, u, v);
            up_to(u[1], v[1]) - up_to(u[0], v[1]) - up_to(u[1], v[0]) + up_to(u[0], v[0])
        };
        let below = if at.part < 1.0 { (1.0 - at.part) * of_plane(at.step) } else { 0.0 };
        if at.part > 0.0 { below + at.part * of_plane(at.step + 1) } else { below }
    }

    /// The integral in a plane from its corner to (u, v).
    fn up_to(&self, plane: usize, u: &Place, v: &Place) -> f64 {
        let sums = |i: usize, j: usize| self.planes[(plane * POINTS + i) * POINTS + j];
        let (i, j) = (u.step, v.step);
        let ([u0, u1], [v0, v1]) = (u.weights, v.weights);
        let [[both, along_u, along_v, value], [_, next_along_u, _, next_v]] = [sums(i, j), sums(i, j + 1)];
        let [[_, _, next_along_v, next_u], [.., opposite]] = [sums(i + 1, j), sums(i + 1, j + 1)];
        both + v0 * along_u
            + v1 * next_along_u
            + u0 * (along_v + v0 * value + v1 * next_v)
            + u1 * (next_along_v + v0 * next_u + v1 * opposite)
    }
}

/// A place along an axis, from 0 to 1.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    at: f64,
    /// The step that it is in.
    step: usize,
    /// How far in it, from 0 to 1.
    part: f64,
    /// What the points on either side of it add to the integral of what is linear between them, from the step's beginning on.
    weights: [f64; 2],
}

impl Place {
    pub fn new(at: f64) -> Place {
        let at = at.clamp(0.0, 1.0);
        let from_wall = ((at.min(1.0 - at) + 0.0625).sqrt() - 0.25) * STEPS as f64;
        let steps = if at < 0.5 { from_wall } else { STEPS as f64 - from_wall };
        let number = (steps as usize).min(STEPS - 1);
        let length = step(number);
        let part = ((at - place_of(number)) / length).clamp(0.0, 1.0);
        let weights = [part - 0.5 * part * part, 0.5 * part * part].map(|weight| weight * length);
        Place { at, step: number, part, weights }
    }
}

/// The flux at the points of a plane across an axis, row by row.
fn plane(edges: [f64; 3], axis: usize, at: usize) -> Vec<f64> {
    let beside = [(axis + 1) % 3, (axis + 2) % 3];
    let value = |i: usize, j: usize| {
        let mut place = [place_of(at); 3];
        (place[beside[0]], place[beside[1]]) = (place_of(i), place_of(j));
        let distances = |from_wall: fn(f64) -> f64| std::array::from_fn(|k| from_wall(place[k]) * edges[k]);
        flux(axis, distances(|x| x), distances(|x| 1.0 - x)) / edges[axis]
    };
    let quarter: Vec<f64> = (0..HALF * HALF).map(|k| value(k / HALF, k % HALF)).collect();
    let mirrored = |i: usize| i.min(STEPS - i);
    (0..POINTS * POINTS).map(|k| quarter[mirrored(k / POINTS) * HALF + mirrored(k % POINTS)]).collect()
}

/// Adds up from the corner of a plane.
fn sums(values: &[f64]) -> Vec<Sums> {
    let mut sums: Vec<Sums> = values.iter().map(|&value| [0.0, 0.0, 0.0, value]).collect();
    let mean = |number: usize, a: f64, b: f64| 0.5 * step(number) * (a + b);
    for k in 0..POINTS * POINTS {
        let (i, j) = (k / POINTS, k % POINTS);
        if i > 0 {
            sums[k][1] = sums[k - POINTS][1] + mean(i - 1, sums[k - POINTS][3], sums[k][3]);
        }
        if j > 0 {
            sums[k][2] = sums[k - 1][2] + mean(j - 1, sums[k - 1][3], sums[k][3]);
            sums[k][0] = sums[k - 1][0] + mean(j - 1, sums[k - 1][1], sums[k][1]);
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_flux_in_a_cube_is_that_of_its_integral() {
        // Computed by another program, from the integral over directions.
        let known = [
            ([0.5, 0.5, 0.5], 0.308_566),
            ([0.0, 0.5, 0.5], 0.206_654),
            ([0.5, 0.0, 0.5], 0.171_497),
            ([0.0, 0.0, 0.5], 0.123_480),
            ([0.0, 0.0, 0.0], 0.077_141),
        ];
        for (place, expected) in known {
            let found = flux(0, place, place.map(|x: f64| 1.0 - x));
            assert!((found - expected).abs() < 1e-6, "{place:?}: {found}, {expected}");
        }
    }

    #[test]
    fn the_flux_through_the_walls_is_the_volume() {
        const N: usize = 300;
        let middle = |i: usize| (i as f64 + 0.5) / N as f64;
        for edges in [[1.0, 1.0, 1.0], [4.0, 1.0, 4.0], [1.0, 0.1, 1.0]] {
            // Walls on both sides are equal: so is the flux through them.
            let through = |axis: usize| {
                let at = |k: usize| {
                    let mut place = [0.0; 3];
                    (place[(axis + 1) % 3], place[(axis + 2) % 3]) = (middle(k / N), middle(k % N));
                    let [below, above]: [[f64; 3]; 2] =
                        [place, place.map(|x| 1.0 - x)].map(|part| std::array::from_fn(|k| part[k] * edges[k]));
                    2.0 * flux(axis, below, above) / edges[axis]
                };
                (0..N * N).map(at).sum::<f64>() / (N * N) as f64
            };
            let sum: f64 = (0..3).map(through).sum();
            assert!((sum - 1.0).abs() < 1e-3, "{edges:?}: {sum}");
        }
    }

    #[test]
    fn rectangles_side_by_side_add_up_and_a_small_one_has_the_flux_of_its_place() {
        let table = FluxTable::new([1.0; 3]);
        let of = |u: [f64; 2], v: [f64; 2]| {
            let [[u0, u1], [v0, v1]] = [u, v].map(|extent| extent.map(Place::new));
            table.through(1, &Place::new(0.37), [&u0, &u1], [&v0, &v1])
        };
        let parts = of([0.1, 0.43], [0.2, 0.77]) + of([0.43, 0.9], [0.2, 0.77]);
        assert!((parts - of([0.1, 0.9], [0.2, 0.77])).abs() < 1e-14);
        let place = [0.31 + 5e-6, 0.37, 0.71 + 5e-6];
        let here = 1e-10 * flux(1, place, place.map(|x| 1.0 - x));
        let found = of([0.71, 0.71 + 1e-5], [0.31, 0.31 + 1e-5]);
        assert!((found / here - 1.0).abs() < 2e-3, "{found}, {here}");
    }
}
