//! What a split costs other than by surface area (van Kralingen 2023, "Evaluating Alternatives to the Surface Area Heuristic",
//! chapter 3).
//!
//! A heuristic that looks at a box alone is a *measure of rays* ([`RayMeasure`]): how many rays of a set meet the box.
//!
//! - [`interior`]: rays that begin anywhere in the scene;
//! - [`preferred`]: rays of a camera, from a point or in a direction.
//!
//! Others know more of a node than its box:
//!
//! - [`distribution`]: rays that were traced;
//! - [`occlusion`]: primitives that rays ended on, and `occlusion_complete`: the same with its authors' rules;
//! - [`shadow`]: rays that end at any hit, with all that they meet.
//!
//! What a finished tree costs by one is [`Heuristic::cost`].
//!
//! Builders see none of that: they are given a `SplitCost`. Trees by another heuristic than the surface area go down to single
//! primitives, and leaves are made by collapsing: a heuristic that calls both children certain, or neither likely, would stop at
//! once ([`Termination::Heuristic`] does).

mod angle;
#[cfg(test)]
mod builds;
mod cost;
pub mod distribution;
mod flux;
pub mod interior;
pub mod occlusion;
pub(super) mod occlusion_complete;
mod picture;
pub mod preferred;
pub mod shadow;
pub(super) mod split_cost;

#[cfg(doc)]
use super::Termination;
use super::bounds::{Bounds, Item};
use super::{HostBvhOptions, HostMethod};
use distribution::Distribution;
pub use distribution::{RayDistribution, RaySegment};
use hedgerow::geometry::Aabb;
use hedgerow::{Error, Result};
use interior::Interior;
pub use interior::InteriorForm;
pub use occlusion::Occlusion;
use occlusion::Seen;
pub use picture::Pinhole;
use preferred::PreferredMeasure;
pub use preferred::{Preferred, PreferredRays};
pub use shadow::ShadowRays;
use shadow::Shadows;

/// What splits cost.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Heuristic<'a> {
    /// By the surface area of boxes.
    #[default]
    Sah,
    /// By the rays that begin anywhere in the scene and meet a box. A scene without volume is built by surface area.
    Interior(InteriorForm),
    /// By the rays of a camera, of a point or in one direction that meet a box.
    Preferred(Preferred),
    /// By the rays of a sample that meet a node. Without any in the scene it is built by surface area.
    Distribution(RayDistribution<'a>),
    /// By the primitives of a node that rays ended on. If all or none are seen it is built by surface area.
    Occlusion(Occlusion<'a>),
    /// The same with all rules of its authors, by [`HostMethod::Sbvh`] alone. They take 128 bins.
    OcclusionComplete(Occlusion<'a>),
    /// By the shadow rays of a sample, for a walk that takes left children first. Without any in the scene it is built by surface
    /// area.
    Shadow(ShadowRays<'a>),
}

impl<'a> Heuristic<'a> {
    /// Whether a tree over `count` primitives can be built by it with these options.
    ///
    /// # Errors
    /// [`Error::Argument`] names the method or the option that cannot be used, and what can.
    pub fn check(&self, options: &HostBvhOptions, count: usize) -> Result<()> {
        let HostBvhOptions { method, look_ahead, .. } = options;
        let (takes, instead) = match (self, method) {
            (Heuristic::Sah, _) => (true, ""),
            (Heuristic::OcclusionComplete(_), _) => (
                matches!(method, HostMethod::Sbvh(_)),
                "a heuristic that divides primitives; take Sbvh, or Heuristic::Occlusion",
            ),
            (_, HostMethod::Sweep | HostMethod::Binned(_) | HostMethod::Sbvh(_)) => (true, ""),
            _ => (false, "a heuristic; take Sweep, Binned or Sbvh, or Heuristic::Sah"),
        };
        if !takes {
            return Err(Error::Argument(format!("{method:?} does not build by {instead}")));
        }
        if *self != Heuristic::Sah && *look_ahead > 1 {
            let error =
                format!("looking ahead at {look_ahead} splits is by surface area; take Heuristic::Sah, or 1 split");
            return Err(Error::Argument(error));
        }
        match self {
            Heuristic::Sah | Heuristic::Interior(_) => Ok(()),
            Heuristic::Preferred(preferred) => preferred.check(),
            Heuristic::Distribution(rays) => rays.check(),
            Heuristic::Occlusion(occlusion) | Heuristic::OcclusionComplete(occlusion) => occlusion.check(count),
            Heuristic::Shadow(rays) => rays.check(count),
        }
    }

    /// For a tree over `items` of `count` primitives, in lengths scaled by `scale`; they lie in the box `scene`.
    pub(super) fn prepared(&self, (items, count): (&[Item], usize), scene: &Bounds, scale: f32) -> Prepared<'a> {
        fn boxed<'a>(measure: impl RayMeasure + 'static) -> Prepared<'a> {
            Prepared::Rays(Box::new(measure))
        }
        let prepared = match self {
            Heuristic::Sah => None,
            Heuristic::Interior(form) => Interior::new(*form, &scene.aabb()).map(boxed),
            Heuristic::Preferred(rays) => PreferredMeasure::new(&rays.scaled(scale), &scene.aabb()).map(boxed),
            Heuristic::Distribution(rays) => Distribution::new(rays, scene, scale).map(Prepared::Distribution),
            Heuristic::Occlusion(occlusion) => Seen::new(occlusion, items).map(Prepared::Occlusion),
            Heuristic::OcclusionComplete(occlusion) => Seen::new(occlusion, items).map(Prepared::OcclusionComplete),
            Heuristic::Shadow(rays) => Shadows::new(rays, count, scene, scale).map(Prepared::Shadow),
        };
        prepared.unwrap_or(Prepared::Area)
    }
}

/// A heuristic made ready for a scene.
pub(super) enum Prepared<'a> {
    /// The surface area; and what any other is where it knows of nothing.
    Area,
    /// A measure of rays.
    Rays(Box<dyn RayMeasure>),
    /// A sample of rays.
    Distribution(Distribution),
    /// Primitives that are seen, and others.
    Occlusion(Seen<'a>),
    /// The same, with the rules of the heuristic's authors.
    OcclusionComplete(Seen<'a>),
    /// A sample of shadow rays.
    Shadow(Shadows),
}

/// How many rays of a set meet a box: the whole of a heuristic that looks at nothing but the box.
///
/// Only ratios matter. No box should be met by fewer rays than a box in it; those that are say so.
pub trait RayMeasure: Sync {
    /// The rays that meet `bounds`, a box that is not empty.
    fn rays(&self, bounds: &Aabb) -> f32;
}

fn checked_weight(weight: f32) -> Result<()> {
    let error = || Error::Argument(format!("rays cannot have a weight of {weight}; take 0 to 1"));
    (0.0..=1.0).contains(&weight).then_some(()).ok_or_else(error)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers from 0 to 1 (xorshift64*, Vigna 2016).
    pub struct Random(u64);

    impl Random {
        pub fn new(seed: u64) -> Random {
            Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
        }

        pub fn unit(&mut self) -> f64 {
            self.0 ^= self.0 >> 12;
            self.0 ^= self.0 << 25;
            self.0 ^= self.0 >> 27;
            (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1u64 << 53) as f64
        }

        /// Uniform on the sphere.
        pub fn direction(&mut self) -> [f64; 3] {
            let (z, turn) = (2.0 * self.unit() - 1.0, std::f64::consts::TAU * self.unit());
            let radius = (1.0 - z * z).sqrt();
            [radius * turn.cos(), radius * turn.sin(), z]
        }
    }

    /// A box in a box. One in eight is flat.
    pub fn part_of(bounds: &Aabb, random: &mut Random) -> Aabb {
        let Aabb { mut lo, mut hi } = *bounds;
        for k in 0..3 {
            let at = [random.unit(), random.unit()].map(|part| lo[k] + part as f32 * (hi[k] - lo[k]));
            (lo[k], hi[k]) = (at[0].min(at[1]), at[0].max(at[1]));
        }
        if random.unit() < 0.125 {
            let k = (3.0 * random.unit()) as usize;
            hi[k] = lo[k];
        }
        Aabb { lo, hi }
    }

    /// Whether a ray meets a box, by slabs in double precision.
    pub fn meets(bounds: &Aabb, from: [f64; 3], direction: [f64; 3]) -> bool {
        let (mut near, mut far) = (0.0, f64::INFINITY);
        for k in 0..3 {
            let at = [bounds.lo[k], bounds.hi[k]].map(|x| (f64::from(x) - from[k]) / direction[k]);
            near = f64::max(near, at[0].min(at[1]));
            far = f64::min(far, at[0].max(at[1]));
        }
        near <= far
    }

    #[test]
    fn a_weight_is_a_part() {
        assert!(checked_weight(0.0).is_ok() && checked_weight(1.0).is_ok());
        for weight in [-0.1, 1.1, f32::NAN] {
            let error = checked_weight(weight).expect_err("no part").to_string();
            assert!(error.contains(&weight.to_string()) && error.contains("0 to 1"), "{error}");
        }
    }
}
