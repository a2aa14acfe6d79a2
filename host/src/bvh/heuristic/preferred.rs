//! Preferred ray sets: rays from one point, through a picture or in all directions, and rays in one direction (Havran and Bittner
//! 1999, "Rectilinear BSP Trees for Preferred Ray Sets"; van Kralingen 2023, section 3.2.1).
//!
//! A box counts by the part of the rays that meet it. Off the picture that is nothing, whatever the split, and no ray that is not
//! of the set knows of it. So it is mixed with the surface area: w p + (1 − w) SA(N) / SA(S), as the ray distribution heuristic has
//! it. The papers do not mix; van Kralingen 2023 suspects this of the large leaves that its trees had.

use super::picture::{Picture, Pinhole};
use super::{RayMeasure, angle, checked_weight};
use hedgerow::geometry::Aabb;
use hedgerow::{Error, Result};

/// Rays that the tree is built for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PreferredRays {
    /// Through the picture of a camera.
    Perspective(Pinhole),
    /// In this direction, of any length but 0, side by side.
    Parallel([f32; 3]),
    /// From this point, in all directions.
    Spherical([f32; 3]),
}

/// Rays that the tree is built for, and how much they count.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Preferred {
    /// The rays.
    pub rays: PreferredRays,
    /// Their weight beside the surface area, from 0 to 1.
    pub weight: f32,
}

impl Preferred {
    /// With the weight that the ray distribution heuristic has, 0.9.
    pub const fn of(rays: PreferredRays) -> Preferred {
        Preferred { rays, weight: 0.9 }
    }

    /// Whether a tree can be built for them.
    ///
    /// # Errors
    /// [`Error::Argument`] names what they cannot be, and what they can.
    pub fn check(&self) -> Result<()> {
        checked_weight(self.weight)?;
        match &self.rays {
            PreferredRays::Perspective(camera) => camera.check(),
            PreferredRays::Parallel(direction) => {
                let is_some = direction.iter().all(|x| x.is_finite()) && direction.iter().any(|&x| x != 0.0);
                let error =
                    || Error::Argument(format!("{direction:?} is no direction; take one that is finite and not 0"));
                is_some.then_some(()).ok_or_else(error)
            }
            PreferredRays::Spherical(from) => {
                let error = || Error::Argument(format!("rays cannot begin at {from:?}; take a point that is finite"));
                from.iter().all(|x| x.is_finite()).then_some(()).ok_or_else(error)
            }
        }
    }

    /// The same in a scene whose lengths are scaled by this.
    pub fn scaled(&self, scale: f32) -> Preferred {
        let rays = match self.rays {
            PreferredRays::Perspective(camera) => PreferredRays::Perspective(camera.scaled(scale)),
            PreferredRays::Parallel(direction) => PreferredRays::Parallel(direction),
            PreferredRays::Spherical(from) => PreferredRays::Spherical(from.map(|x| x * scale)),
        };
        Preferred { rays, ..*self }
    }
}

/// What part of the preferred rays meets a box, mixed with the part of the scene's surface that it has.
pub struct PreferredMeasure {
    set: Set,
    weight: f64,
    /// Half the surface area of the scene's box.
    scene_area: f64,
}

enum Set {
    Perspective(Picture),
    /// The areas of a box's faces count by this.
    Parallel([f64; 3]),
    Spherical([f64; 3]),
}

impl PreferredMeasure {
    /// In `scene`; `None` if that has no surface.
    pub fn new(preferred: &Preferred, scene: &Aabb) -> Option<PreferredMeasure> {
        let scene_area = half_area(scene);
        let set = match &preferred.rays {
            PreferredRays::Perspective(camera) => Set::Perspective(Picture::new(camera, f64::from(scene.diagonal()))),
            PreferredRays::Parallel(direction) => Set::Parallel(per_face(direction, scene)),
            PreferredRays::Spherical(from) => Set::Spherical(from.map(f64::from)),
        };
        let weight = f64::from(preferred.weight);
        (scene_area > 0.0).then_some(PreferredMeasure { set, weight, scene_area })
    }

    /// The part of the preferred rays alone, from 0 to 1.
    pub fn part(&self, bounds: &Aabb) -> f64 {
        match &self.set {
            Set::Perspective(picture) => picture.covered(bounds),
            Set::Parallel(per_face) => (0..3).map(|axis| per_face[axis] * face(bounds, axis)).sum(),
            Set::Spherical(from) => {
                let [lo, hi] = [bounds.lo, bounds.hi].map(|corner| corner.map(f64::from));
                let is_inside = (0..3).all(|k| lo[k] <= from[k] && from[k] <= hi[k]);
                if is_inside { 1.0 } else { angle::of_box(*from, lo, hi) }
            }
        }
    }
}

impl RayMeasure for PreferredMeasure {
    fn rays(&self, bounds: &Aabb) -> f32 {
        (self.weight * self.part(bounds) + (1.0 - self.weight) * half_area(bounds) / self.scene_area) as f32
    }
}

/// The area of a face across an axis.
fn face(bounds: &Aabb, axis: usize) -> f64 {
    let edge = |k: usize| f64::from(bounds.hi[k % 3]) - f64::from(bounds.lo[k % 3]);
    edge(axis + 1) * edge(axis + 2)
}

fn half_area(bounds: &Aabb) -> f64 {
    (0..3).map(|axis| face(bounds, axis)).sum()
}

/// The cosines of a direction to the axes, over the scene's area across it. A scene that is seen from its edge has none: all 0.
fn per_face(direction: &[f32; 3], scene: &Aabb) -> [f64; 3] {
    // The largest is 1: no length of a direction is too large or too small.
    let largest = direction.iter().fold(0.0, |most: f64, &x| most.max(f64::from(x).abs()));
    let cosines = direction.map(|x| f64::from(x).abs() / largest);
    let across: f64 = (0..3).map(|axis| cosines[axis] * face(scene, axis)).sum();
    cosines.map(|cosine| if across > 0.0 { cosine / across } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::super::tests::{Random, meets, part_of};
    use super::*;

    const SCENE: Aabb = Aabb { lo: [-2.0, 0.0, -1.0], hi: [2.0, 1.5, 3.0] };

    fn measure(rays: PreferredRays) -> PreferredMeasure {
        PreferredMeasure::new(&Preferred::of(rays), &SCENE).expect("a scene with a surface")
    }

    #[test]
    fn a_box_is_met_by_the_part_of_all_directions_that_the_solid_angle_says() {
        const RAYS: usize = 40_000;
        let mut random = Random::new(8);
        let directions: Vec<_> = (0..RAYS).map(|_| random.direction()).collect();
        for from in [[0.0, 0.5, 0.0], [-2.0, 0.2, 0.1], [9.0, 3.0, -4.0]] {
            let spherical = measure(PreferredRays::Spherical(from));
            for _ in 0..10 {
                let bounds = part_of(&SCENE, &mut random);
                let met = directions.iter().filter(|&&to| meets(&bounds, from.map(f64::from), to)).count() as f64;
                let (part, counted) = (spherical.part(&bounds), met / RAYS as f64);
                let error = (part * (1.0 - part) / RAYS as f64).sqrt() + 1.0 / RAYS as f64;
                assert!((part - counted).abs() < 3.5 * error, "{from:?}, {bounds:?}: {part}, {counted} ± {error}");
            }
        }
    }

    #[test]
    fn parallel_rays_see_a_box_by_its_shadow() {
        let along_z = measure(PreferredRays::Parallel([0.0, 0.0, -1e-30]));
        let bounds = Aabb { lo: [0.0, 0.0, 0.0], hi: [2.0, 0.75, 0.1] };
        assert!((along_z.part(&bounds) - 0.25).abs() < 1e-12);
        let across = measure(PreferredRays::Parallel([1e30, 1e30, -1e30]));
        assert!((across.part(&SCENE) - 1.0).abs() < 1e-12);
        let flat = Aabb { lo: [0.0; 3], hi: [1.0, 1.0, 0.0] };
        let from_the_edge = Preferred::of(PreferredRays::Parallel([1.0, 0.0, 0.0]));
        let measure = PreferredMeasure::new(&from_the_edge, &flat).expect("a surface");
        assert_eq!((measure.part(&flat), measure.rays(&flat)), (0.0, 1.0 - 0.9));
    }

    #[test]
    fn a_box_counts_at_least_as_much_as_one_in_it() {
        let camera =
            Pinhole { eye: [0.1, 0.5, 0.2], look: [1.0, 0.4, 2.0], up: [0.0, 1.0, 0.0], fov: 70.0, aspect: 1.5 };
        let mut random = Random::new(4);
        for rays in [
            PreferredRays::Perspective(camera),
            PreferredRays::Parallel([0.3, -1.0, 0.2]),
            PreferredRays::Spherical([0.1, 0.5, 0.2]),
        ] {
            let measure = measure(rays);
            for _ in 0..2_000 {
                let outer = part_of(&SCENE, &mut random);
                let inner = part_of(&outer, &mut random);
                let [of_outer, of_inner] = [outer, inner].map(|bounds| measure.rays(&bounds));
                assert!(of_inner <= of_outer + 1e-6, "{rays:?}: {inner:?} {of_inner} in {outer:?} {of_outer}");
            }
        }
    }

    #[test]
    fn what_cannot_be_preferred_is_named() {
        let said = |rays| Preferred::of(rays).check().expect_err("cannot be preferred").to_string();
        assert!(said(PreferredRays::Parallel([0.0; 3])).contains("[0.0, 0.0, 0.0] is no direction"));
        assert!(said(PreferredRays::Spherical([f32::NAN, 0.0, 0.0])).contains("NaN"));
        let rays = PreferredRays::Spherical([0.0; 3]);
        assert!(Preferred { rays, weight: 1.5 }.check().expect_err("too heavy").to_string().contains("1.5"));
        assert!(Preferred { rays, weight: 1.0 }.check().is_ok());
    }
}
