//! Rays that begin anywhere in the scene, in any direction (Fabianowski, Fowler, Dingliana 2009, "A Cost Metric for Scene-Interior
//! Ray Origins"; van Kralingen 2023, section 3.1.4).
//!
//! Origins are uniform in the scene's box S, directions are uniform, and rays do not end. A box N is met by the rays that begin in
//! it and by those that enter it: p(N) = \[V(N) + ∫ over S∖N of Ω_N(x)/4π dx\] / V(S) (equation 9 there), Ω_N(x) being the solid
//! angle under which x sees N.
//!
//! A ray that meets a convex box has two ends of its stretch in it: each is a crossing of a face or an end of the ray. So
//! p(N) = \[V(N) + Σ over the faces of N of ∫ M_k\] / 2V(S), where M_k is the flux (`flux.rs`) and no integral over the scene
//! is left. The approximations of the paper are here for comparison.

use super::flux::{FluxTable, Place};
use super::{RayMeasure, angle};
use hedgerow::geometry::Aabb;

/// How the part of the rays that meet a box is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InteriorForm {
    /// From the flux through its faces, by a table: exact but for what the table rounds.
    Exact,
    /// From one point in each of the 26 cells around the box (equation 10 of van Kralingen 2023). Not monotone: a box may count for
    /// less than one in it.
    HighQuality,
    /// From the six slabs beyond its faces, as if lines in them were uniform (equation 11 there).
    Fast,
}

/// The part of the rays from inside a scene that meet a box, from 0 to 1.
pub struct Interior {
    scene: Aabb,
    /// The scene's edges over the longest one.
    edges: [f64; 3],
    form: Form,
}

enum Form {
    Exact(FluxTable),
    HighQuality,
    Fast,
}

/// The extents of a box along each axis, in the unit of the scene's longest edge and from its least corner on.
type Extents = [[f64; 2]; 3];

impl Interior {
    /// In `scene`; `None` if that has no volume, as then no ray begins in it.
    pub fn new(form: InteriorForm, scene: &Aabb) -> Option<Interior> {
        let edges: [f64; 3] = std::array::from_fn(|k| f64::from(scene.hi[k]) - f64::from(scene.lo[k]));
        let longest = edges.iter().copied().fold(0.0, f64::max);
        let edges = edges.map(|edge| edge / longest);
        // Below this the edges' ratios are noise of the coordinates.
        if !edges.iter().all(|&edge| edge > 1e-12) {
            return None;
        }
        let form = match form {
            InteriorForm::Exact => Form::Exact(FluxTable::new(edges)),
            InteriorForm::HighQuality => Form::HighQuality,
            InteriorForm::Fast => Form::Fast,
        };
        Some(Interior { scene: *scene, edges, form })
    }

    /// Those of a box, cut to the scene.
    fn extents(&self, bounds: &Aabb) -> Extents {
        let along = |k: usize| {
            let (lo, hi) = (f64::from(self.scene.lo[k]), f64::from(self.scene.hi[k]));
            let part = |x: f32| ((f64::from(x) - lo) / (hi - lo)).clamp(0.0, 1.0);
            [bounds.lo[k], bounds.hi[k]].map(|x| part(x) * self.edges[k])
        };
        std::array::from_fn(along)
    }

    /// By the flux through the faces.
    fn by_flux(&self, flux: &FluxTable, extents: &Extents) -> f64 {
        let parts: Extents = std::array::from_fn(|k| extents[k].map(|x| x / self.edges[k]));
        let places = parts.map(|extent| extent.map(Place::new));
        let faces = |k: usize| {
            let [u, v] = [(k + 1) % 3, (k + 2) % 3].map(|k| places[k].each_ref());
            flux.through(k, &places[k][0], u, v) + flux.through(k, &places[k][1], u, v)
        };
        0.5 * (volume(&parts) + (0..3).map(faces).sum::<f64>())
    }

    /// By a point in the middle of each of the cells around the box.
    fn by_cells(&self, extents: &Extents) -> f64 {
        let thirds = |k: usize| [[0.0, extents[k][0]], extents[k], [extents[k][1], self.edges[k]]];
        let [lo, hi] = [0, 1].map(|end| extents.map(|extent| extent[end]));
        let seen = |cell: usize| {
            let cell: Extents = [thirds(0)[cell % 3], thirds(1)[cell / 3 % 3], thirds(2)[cell / 9]];
            let volume = volume(&cell);
            // A cell without volume would be looked at from the face itself.
            if volume == 0.0 { 0.0 } else { volume * angle::of_box(cell.map(|[a, b]| 0.5 * (a + b)), lo, hi) }
        };
        const OWN: usize = 13;
        let around: f64 = (0..27).filter(|&cell| cell != OWN).map(seen).sum();
        (volume(extents) + around) / self.edges.iter().product::<f64>()
    }

    /// By the slabs beyond the faces.
    fn by_slabs(&self, extents: &Extents) -> f64 {
        let beyond = |k: usize| {
            let [a, b] = [(k + 1) % 3, (k + 2) % 3];
            let face = (extents[a][1] - extents[a][0]) * (extents[b][1] - extents[b][0]);
            let through = |thickness: f64| {
                let [wall, around] = [self.edges[a] * self.edges[b], self.edges[a] + self.edges[b]];
                wall * thickness * face / (2.0 * (wall + thickness * around))
            };
            through(extents[k][0]) + through(self.edges[k] - extents[k][1])
        };
        (volume(extents) + (0..3).map(beyond).sum::<f64>()) / self.edges.iter().product::<f64>()
    }
}

impl RayMeasure for Interior {
    fn rays(&self, bounds: &Aabb) -> f32 {
        let extents = self.extents(bounds);
        let part = match &self.form {
            Form::Exact(flux) => self.by_flux(flux, &extents),
            Form::HighQuality => self.by_cells(&extents),
            Form::Fast => self.by_slabs(&extents),
        };
        part as f32
    }
}

fn volume(extents: &Extents) -> f64 {
    extents.iter().map(|[lo, hi]| hi - lo).product()
}

#[cfg(test)]
mod tests {
    use super::super::tests::{Random, meets, part_of};
    use super::*;

    const FORMS: [InteriorForm; 3] = [InteriorForm::Exact, InteriorForm::HighQuality, InteriorForm::Fast];
    const CUBE: Aabb = Aabb { lo: [0.0; 3], hi: [1.0; 3] };
    const ROOM: Aabb = Aabb { lo: [0.0; 3], hi: [4.0, 1.0, 4.0] };

    fn of(scene: &Aabb, lo: [f32; 3], hi: [f32; 3]) -> [f64; 3] {
        FORMS.map(|form| {
            let interior = Interior::new(form, scene).expect("a scene with volume");
            f64::from(interior.rays(&Aabb { lo, hi }))
        })
    }

    #[test]
    fn boxes_are_met_as_often_as_numerical_integration_says() {
        // Exact: 6 x 6 cells of 3 x 3 Gauss points on each face. The others: another program, by their formulas.
        let known = [
            (CUBE, [0.0; 3], [1.0; 3], [1.0, 1.0, 1.0]),
            (CUBE, [0.4; 3], [0.6; 3], [0.04037, 0.03508, 0.03467]),
            (CUBE, [0.0; 3], [0.2; 3], [0.02231, 0.01727, 0.02646]),
            (CUBE, [0.0; 3], [0.5, 1.0, 1.0], [0.62405, 0.64758, 0.62500]),
            (CUBE, [0.5, 0.0, 0.0], [0.5, 1.0, 1.0], [0.24803, 0.29517, 0.25000]),
            (CUBE, [0.0; 3], [0.0, 1.0, 1.0], [0.16667, 0.16667, 0.16667]),
            (CUBE, [0.0, 0.49, 0.49], [1.0, 0.51, 0.51], [0.01133, 0.01064, 0.01030]),
            (CUBE, [0.4, 0.0, 0.0], [0.6, 1.0, 1.0], [0.41934, 0.46467, 0.42222]),
            (CUBE, [0.1, 0.2, 0.5], [0.3, 0.9, 0.6], [0.06663, 0.06056, 0.06244]),
            (ROOM, [1.8, 0.0, 1.8], [2.2, 0.3, 2.2], [0.01480, 0.01052, 0.01390]),
            (ROOM, [2.0, 0.0, 0.0], [2.0, 1.0, 2.0], [0.07349, 0.06047, 0.07143]),
            (ROOM, [0.0; 3], [4.0, 0.0, 4.0], [0.32545, 0.39028, 0.33333]),
        ];
        for (scene, lo, hi, [exact, high_quality, fast]) in known {
            let found = of(&scene, lo, hi);
            assert!((found[0] / exact - 1.0).abs() < 5e-3, "{lo:?} {hi:?}: {found:?}, {exact}");
            for (found, expected) in found[1..].iter().zip([high_quality, fast]) {
                assert!((found - expected).abs() < 6e-6, "{lo:?} {hi:?}: {found}, {expected}");
            }
        }
    }

    #[test]
    fn a_box_is_met_at_least_as_often_as_one_in_it() {
        let mut random = Random::new(3);
        for form in [InteriorForm::Exact, InteriorForm::Fast] {
            for scene in [CUBE, ROOM] {
                let interior = Interior::new(form, &scene).expect("a scene with volume");
                for _ in 0..2_500 {
                    let outer = part_of(&scene, &mut random);
                    let inner = part_of(&outer, &mut random);
                    let [of_outer, of_inner] = [outer, inner].map(|bounds| interior.rays(&bounds));
                    assert!(of_inner <= of_outer, "{form:?}: {inner:?} {of_inner} in {outer:?} {of_outer}");
                }
            }
        }
    }

    #[test]
    fn random_rays_meet_boxes_as_often_as_the_exact_form_says() {
        const RAYS: usize = 100_000;
        let mut random = Random::new(5);
        let place = |random: &mut Random| std::array::from_fn(|k| random.unit() * f64::from(ROOM.hi[k]));
        let rays: Vec<_> = (0..RAYS).map(|_| (place(&mut random), random.direction())).collect();
        let interior = Interior::new(InteriorForm::Exact, &ROOM).expect("a room has volume");
        for _ in 0..20 {
            let bounds = part_of(&ROOM, &mut random);
            let met = rays.iter().filter(|(from, direction)| meets(&bounds, *from, *direction)).count() as f64;
            let (part, counted) = (f64::from(interior.rays(&bounds)), met / RAYS as f64);
            let error = (part * (1.0 - part) / RAYS as f64).sqrt();
            assert!((part - counted).abs() < 3.0 * error + 1e-3 * part, "{bounds:?}: {part}, {counted} ± {error}");
        }
    }

    #[test]
    fn no_ray_begins_in_a_scene_without_volume() {
        for hi in [[1.0, 1.0, 0.0], [0.0; 3], [1.0, 0.0, 0.0]] {
            assert!(Interior::new(InteriorForm::Exact, &Aabb { lo: [0.0; 3], hi }).is_none());
        }
        assert!(Interior::new(InteriorForm::Exact, &Aabb::EMPTY).is_none());
    }

    #[test]
    fn where_the_scene_is_and_how_large_changes_nothing() {
        for scale in [1e-30, 1.0, 1e30] {
            let scaled = |corner: [f32; 3]| corner.map(|x| x * scale);
            let scene = Aabb { lo: scaled([-1.0; 3]), hi: scaled([1.0; 3]) };
            let found = of(&scene, scaled([-0.2; 3]), scaled([0.2; 3]));
            assert!((found[0] - 0.04037).abs() < 1e-4, "{scale}: {found:?}");
        }
    }
}
