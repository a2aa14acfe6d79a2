//! The ray distribution heuristic (Bittner and Havran 2009, "RDH: Ray Distribution Heuristics for Construction of Spatial Data
//! Structures"; van Kralingen 2023, section 3.2.2).
//!
//! A sample of rays that were traced, the representative ray set, goes down with the nodes. Of the rays R that meet a node, a side
//! counts by the part that meets it: p(L) = w |R_L| / |R| + (1 − w) SA(L) / SA(N), with w = α (1 − 1 / (1 + β |R|)) (equations 13
//! to 15, in 15 the brackets as its text wants them). So a node with few rays is split by surface area, and one without any by
//! nothing else.
//!
//! Boxes along an axis are nested. A ray that meets one meets every larger one: bisection finds the first, and sums over these
//! count the rays of all. That holds in floats too, as each step of the test is monotone in the box.

use super::checked_weight;
use super::split_cost::{Area, First, Members, Side, SplitCost};
use crate::bvh::bounds::Bounds;
use glam::Vec3A;
use hedgerow::{Error, Result};
use rayon::prelude::*;

/// Fewer rays than this are not worth another thread.
pub(super) const PIECE: usize = 2048;
/// A component of a direction that is less than this part of the largest is moved away from 0, so that no product is NaN.
const FLATTEST: f64 = 1.0 / (1u64 << 26) as f64;
/// Rays end so much later, as a part of their length: one that ends on a surface shall meet the box around that, which may be flat.
const LATER: f64 = 1.0 + 1.0 / (1u64 << 18) as f64;

/// The stretch of a ray that was traced, from its origin to its hit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RaySegment {
    /// Where it begins.
    pub from: [f32; 3],
    /// Its direction, of any length but 0.
    pub direction: [f32; 3],
    /// Where it ends, in lengths of the direction; infinite for a ray that hit nothing.
    pub t_end: f32,
    /// For how many rays it counts.
    pub weight: f32,
}

impl RaySegment {
    fn is_sound(&self) -> bool {
        let RaySegment { from, direction, t_end, weight } = self;
        let is_finite = from.iter().chain(direction).chain([weight]).all(|x| x.is_finite());
        is_finite && direction.iter().any(|&x| x != 0.0) && *t_end >= 0.0 && *weight >= 0.0
    }

    /// Whether a tree can be built for these.
    pub(super) fn check_all(segments: &[RaySegment]) -> Result<()> {
        match segments.iter().position(|segment| !segment.is_sound()) {
            None => Ok(()),
            Some(i) => Err(Error::Argument(format!(
                "ray {i} of the sample cannot be used ({:?}); take finite rays with a direction that end at 0 or later",
                segments[i]
            ))),
        }
    }
}

/// A sample of rays that the tree is built for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RayDistribution<'a> {
    /// The rays. Without any that meets the scene, the tree is built by surface area.
    pub segments: &'a [RaySegment],
    /// α: the weight of the rays beside the surface area where there are many, from 0 to 1.
    pub weight: f32,
    /// β: how fast the weight grows with the number of rays, 0 or more; half of it is reached at 1 / β rays.
    pub growth: f32,
}

impl<'a> RayDistribution<'a> {
    /// With α = 0.9 and β = 0.1, as published.
    pub const fn of(segments: &'a [RaySegment]) -> RayDistribution<'a> {
        RayDistribution { segments, weight: 0.9, growth: 0.1 }
    }

    /// Whether a tree can be built for them.
    ///
    /// # Errors
    /// [`Error::Argument`] names the weight or the ray that cannot be used, and what can.
    pub fn check(&self) -> Result<()> {
        checked_weight(self.weight)?;
        if !(self.growth >= 0.0 && self.growth.is_finite()) {
            let error = format!("a weight cannot grow by {} with each ray; take 0 or more", self.growth);
            return Err(Error::Argument(error));
        }
        RaySegment::check_all(self.segments)
    }
}

/// A ray made ready for boxes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Segment {
    from: Vec3A,
    /// Reciprocal of the direction, whose largest component is 1.
    inverse: Vec3A,
    t_end: f32,
    pub weight: f64,
}

impl Segment {
    pub fn new(segment: &RaySegment, scale: f32) -> Segment {
        let RaySegment { from, direction, t_end, weight } = *segment;
        let largest = direction.iter().fold(0.0, |most: f64, &x| most.max(f64::from(x).abs()));
        let inverse = |x: f32| {
            let x = f64::from(x) / largest;
            (1.0 / if x.abs() < FLATTEST { FLATTEST.copysign(x) } else { x }) as f32
        };
        Segment {
            from: Vec3A::from_array(from) * scale,
            inverse: Vec3A::from_array(direction.map(inverse)),
            t_end: (f64::from(t_end) * largest * LATER * f64::from(scale)) as f32,
            weight: weight.into(),
        }
    }

    /// Whether it meets a box that is not empty.
    #[inline(always)]
    pub fn meets(&self, bounds: &Bounds) -> bool {
        let (a, b) = ((bounds.lo - self.from) * self.inverse, (bounds.hi - self.from) * self.inverse);
        a.min(b).max_element().max(0.0) <= a.max(b).min_element().min(self.t_end)
    }

    /// Whether it meets a box; one that is empty it does not.
    #[inline(always)]
    pub fn meets_some(&self, bounds: &Bounds) -> bool {
        bounds.lo.cmple(bounds.hi).all() && self.meets(bounds)
    }
}

/// The sample, made ready for a scene.
pub(crate) struct Distribution {
    pub(super) segments: Vec<Segment>,
    weight: f64,
    growth: f64,
}

/// The rays that meet a node.
pub(crate) struct Rays {
    /// In the order of the sample.
    segments: Vec<u32>,
    /// For how many they count.
    weight: f64,
    /// The node's half area.
    area: f64,
}

impl Distribution {
    /// In `scene`, whose lengths are scaled by `scale`; `None` if no ray meets it.
    pub fn new(rays: &RayDistribution<'_>, scene: &Bounds, scale: f32) -> Option<Distribution> {
        let segments = rays.segments.par_iter().with_min_len(PIECE).map(|segment| Segment::new(segment, scale));
        let segments: Vec<Segment> = segments.filter(|segment| segment.weight > 0.0 && segment.meets(scene)).collect();
        let (weight, growth) = (rays.weight.into(), rays.growth.into());
        (!segments.is_empty()).then_some(Distribution { segments, weight, growth })
    }

    /// Those of `among` that meet a side.
    fn on(&self, side: &Side, among: &[u32]) -> Rays {
        let meets = |&&ray: &&u32| self.segments[ray as usize].meets(&side.bounds);
        let segments: Vec<u32> = among.par_iter().with_min_len(PIECE).filter(meets).copied().collect();
        let weight = segments.iter().map(|&ray| self.segments[ray as usize].weight).sum();
        Rays { segments, weight, area: side.bounds.half_area().into() }
    }

    /// For how many rays those count that meet each of these sides, of which each is in the next.
    fn met(&self, rays: &[u32], sides: &[Side]) -> Vec<f64> {
        let first = |&ray: &u32| {
            let segment = &self.segments[ray as usize];
            sides.partition_point(|side| !segment.meets(&side.bounds))
        };
        let firsts: Vec<usize> = rays.par_iter().with_min_len(PIECE).map(first).collect();
        let mut met = vec![0.0; sides.len() + 1];
        for (&ray, first) in rays.iter().zip(firsts) {
            met[first] += self.segments[ray as usize].weight;
        }
        met.truncate(sides.len());
        let mut sum = 0.0;
        met.iter_mut().for_each(|here| {
            sum += *here;
            *here = sum;
        });
        met
    }

    fn weights(&self, here: &Rays, sides: &[Side]) -> Vec<f32> {
        let area = |side: &Side| side.bounds.half_area();
        if here.segments.is_empty() {
            return sides.iter().map(area).collect();
        }
        let weight = self.weight * (1.0 - 1.0 / (1.0 + self.growth * here.segments.len() as f64));
        let by_area = |side: &Side| if here.area > 0.0 { f64::from(area(side)) / here.area } else { 0.0 };
        let mixed = |(met, side): (f64, &Side)| weight * met / here.weight + (1.0 - weight) * by_area(side);
        self.met(&here.segments, sides).into_iter().zip(sides).map(|pair| mixed(pair) as f32).collect()
    }
}

impl SplitCost for Distribution {
    type Here = Rays;
    type Rival = Area;

    fn root(&self, whole: impl FnOnce() -> Side) -> Rays {
        self.on(&whole(), &(0..self.segments.len() as u32).collect::<Vec<_>>())
    }

    fn of_node(&self, here: &Rays, bounds: &Bounds) -> f32 {
        if here.segments.is_empty() { bounds.half_area() } else { 1.0 }
    }

    fn of_sides(&self, here: &Rays, sides: impl Iterator<Item = Side>) -> impl Iterator<Item = (f32, Side)> {
        let sides: Vec<Side> = sides.collect();
        self.weights(here, &sides).into_iter().zip(sides)
    }

    fn divide(&self, here: Rays, sides: impl FnOnce() -> [Side; 2], _members: &Members<'_>) -> (First, [Rays; 2]) {
        (First::Left, sides().map(|side| self.on(&side, &here.segments)))
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::super::split_cost::growing;
    use super::super::tests::Random;
    use super::*;
    use crate::bvh::bounds::tests::boxes;

    /// Rays from one side of the unit cube, some of which end in it.
    pub fn sample(count: usize) -> Vec<RaySegment> {
        let mut random = Random::new(21);
        let ray = |_| {
            let direction = random.direction().map(|x| x as f32);
            let from = [0.1, 0.5, 0.5].map(|x: f32| x + 0.1 * random.unit() as f32);
            let t_end = if random.unit() < 0.3 { f32::INFINITY } else { random.unit() as f32 };
            RaySegment { from, direction, t_end, weight: (1 + (random.unit() * 3.0) as u32) as f32 }
        };
        (0..count).map(ray).collect()
    }

    fn distribution(segments: &[RaySegment]) -> Distribution {
        let everything = Bounds { lo: Vec3A::splat(-1e9), hi: Vec3A::splat(1e9) };
        Distribution::new(&RayDistribution::of(segments), &everything, 1.0).expect("rays")
    }

    #[test]
    fn bisection_counts_the_rays_that_a_loop_over_all_boxes_counts() {
        let mut segments = sample(3_000);
        // Along the axes, where slabs are not entered, and from a face.
        for (direction, x) in [([1.0, 0.0, 0.0], 0.0), ([0.0, -1.0, 0.0], 0.25), ([0.0, 0.0, 1e-30], 0.5)] {
            segments.push(RaySegment { from: [x, 0.5, 0.5], direction, t_end: f32::INFINITY, weight: 1.0 });
        }
        let distribution = distribution(&segments);
        let rays: Vec<u32> = (0..segments.len() as u32).collect();
        let mut seen = std::collections::BTreeSet::new();
        for node in 0..300 {
            let mut items = boxes(3 + 37 * (node % 11)).split_off((node % 3) as usize);
            let axis = (node % 3) as usize;
            items.sort_by(|a, b| a.centroid_on(axis).total_cmp(&b.centroid_on(axis)));
            let sides: Vec<Side> = growing(items.iter().map(|item| Side::of(item, false))).collect();
            let among: Vec<u32> =
                rays.iter().copied().skip(node as usize % 7).step_by(1 + node as usize % 13).collect();
            let met = distribution.met(&among, &sides);
            for (side, met) in sides.iter().zip(met) {
                let meets = |&&ray: &&u32| distribution.segments[ray as usize].meets(&side.bounds);
                let plain: f64 =
                    among.iter().filter(meets).map(|&ray| distribution.segments[ray as usize].weight).sum();
                assert_eq!(met, plain, "node {node}");
                seen.insert(met as u64);
            }
        }
        assert!(seen.len() > 100, "{} different counts", seen.len());
    }

    #[test]
    fn the_weight_of_rays_grows_with_their_number() {
        let along = |y: f32| RaySegment { from: [-1.0, y, 0.5], direction: [0.0, 0.0, 1.0], t_end: 0.0, weight: 1.0 };
        for (count, weight) in [(1, 0.9 * (1.0 - 1.0 / 1.1)), (10, 0.45), (90, 0.81)] {
            let distribution = distribution(&vec![along(0.0); count]);
            let node = Side { bounds: Bounds { lo: Vec3A::splat(-1.0), hi: Vec3A::splat(1.0) }, ..Side::EMPTY };
            let here = distribution.root(|| node);
            // All rays begin and end on its face; half of the area is that of four half walls and two whole ones.
            let half = Side { bounds: Bounds { lo: Vec3A::splat(-1.0), hi: Vec3A::new(0.0, 1.0, 1.0) }, ..Side::EMPTY };
            let found = distribution.weights(&here, &[half])[0];
            let expected = weight + (1.0 - weight) * 2.0 / 3.0;
            assert!((f64::from(found) - expected).abs() < 1e-6, "{count}: {found}, {expected}");
        }
    }

    #[test]
    fn a_ray_that_ends_on_a_flat_box_meets_it() {
        for (origin, direction) in [([0.3, 0.7, 9.1], [0.1, -0.05, -0.37]), ([-7.0, 3.0, 1e3], [0.013, 0.001, -1.7])] {
            let floor = Bounds { lo: Vec3A::new(-90.0, -90.0, 0.1), hi: Vec3A::new(90.0, 90.0, 0.1) };
            let t_end = (0.1 - origin[2]) / direction[2];
            let segment = Segment::new(&RaySegment { from: origin, direction, t_end, weight: 1.0 }, 1.0);
            assert!(segment.meets(&floor), "{origin:?}");
            let early = Segment::new(&RaySegment { from: origin, direction, t_end: 0.999 * t_end, weight: 1.0 }, 1.0);
            assert!(!early.meets(&floor), "{origin:?}");
        }
    }

    #[test]
    fn a_ray_that_cannot_be_used_is_named() {
        let sound = sample(1)[0];
        let said = |segments: &[RaySegment]| RayDistribution::of(segments).check().map_err(|error| error.to_string());
        assert!(said(&[]).is_ok() && said(&[sound, sound]).is_ok());
        for bad in [
            RaySegment { direction: [0.0; 3], ..sound },
            RaySegment { from: [f32::NAN; 3], ..sound },
            RaySegment { t_end: -1.0, ..sound },
            RaySegment { t_end: f32::NAN, ..sound },
            RaySegment { weight: -1.0, ..sound },
        ] {
            assert!(said(&[sound, bad]).expect_err("a bad ray").contains("ray 1 of the sample"));
        }
        let growth = RayDistribution { growth: -0.5, ..RayDistribution::of(&[]) };
        assert!(growth.check().expect_err("shrinks").to_string().contains("-0.5"));
    }
}
