//! The shadow ray distribution heuristic (Feltman, Lee, Fatahalian 2012, "SRDH: Specializing BVH Construction and Traversal Order
//! Using Representative Shadow Ray Sets"; van Kralingen 2023, section 3.3.3).
//!
//! A ray that only asks whether anything is in its way is done at its first hit. So a split is worth what rays do not look into
//! because they are done: the sample knows of each ray *all* primitives that it meets. The child that is looked into first is chosen
//! with the split. With I(X): the ray meets the box of X, and H(X): it also meets a primitive in it, the left child first costs
//!
//! Σ I(L) |L| + (1 − H(L)) I(R) |R|
//!
//! over the node's rays, and the right one first likewise (equation 19, with the counts of both sides where they belong). A ray goes
//! down to the child that it looks into first if it meets it, and to the other one if it is not done then. Nodes without rays are
//! split by surface area, and others by both: with the weight of [`super::distribution`], which the paper does not have.
//!
//! The tree is for a walk that takes left children first ([`hedgerow::trace::twin::tracer::trace_left_first`]). The paper's kernels
//! "near" and "far", with which a ray's direction decides, would need a mark in the nodes.
//!
//! A ray meets left sides from one of them on, and right sides up to one of them, and so it is with its hits. So prefix sums over
//! these four numbers of each ray give what all splits of an axis cost.

use super::checked_weight;
use super::distribution::{PIECE, RaySegment, Segment};
use super::split_cost::{Area, AxisSplits, First, Members, Place, Side, SplitCost};
use crate::bvh::bounds::Bounds;
use hedgerow::bvh::sah::Collapse;
use hedgerow::{Error, Result};
use rayon::prelude::*;

/// A sample of shadow rays that the tree is built for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShadowRays<'a> {
    /// The rays, whole: not to their first hit.
    pub segments: &'a [RaySegment],
    /// Where the hits of each ray end in `hits`; those of the first begin at 0.
    pub ends: &'a [u32],
    /// All primitives that the rays meet, each once a ray.
    pub hits: &'a [u32],
    /// The weight of the rays beside the surface area where there are many, from 0 to 1.
    pub weight: f32,
}

impl ShadowRays<'_> {
    /// Whether a tree over `count` primitives can be built for them.
    ///
    /// # Errors
    /// [`Error::Argument`] names the weight, the ray or the hit that cannot be used, and what can.
    pub fn check(&self, count: usize) -> Result<()> {
        let ShadowRays { segments, ends, hits, weight } = *self;
        checked_weight(weight)?;
        RaySegment::check_all(segments)?;
        let wrong = |what: String| Err(Error::Argument(what));
        let last = ends.last().map_or(0, |&end| end as usize);
        if ends.len() != segments.len() || !ends.is_sorted() || last != hits.len() {
            let (rays, ends, hits) = (segments.len(), ends.len(), hits.len());
            return wrong(format!(
                "{hits} hits of {rays} rays are told by {ends} ends, of which the last is {last}; take an end for each ray, \
                 none before another, the last one the number of hits"
            ));
        }
        match hits.iter().find(|&&hit| hit as usize >= count) {
            None => Ok(()),
            Some(hit) => {
                wrong(format!("a ray meets primitive {hit}, and the scene has {count}; take those of the scene"))
            }
        }
    }
}

/// How fast the weight of the rays grows with their number, as that of the ray distribution heuristic does.
const GROWTH: f64 = 0.1;

/// The sample, made ready for a scene.
pub(crate) struct Shadows {
    segments: Vec<Segment>,
    /// Where the rays of each primitive begin in `rays`, and where the last ones end.
    begins: Vec<u32>,
    /// The rays that meet each primitive.
    rays: Vec<u32>,
    weight: f64,
}

/// The rays that look into a node.
pub(crate) struct ShadowsHere {
    /// In the order of the sample.
    rays: Vec<u32>,
    /// The node's half area.
    area: f64,
}

/// Where a ray's sides are among the splits of an axis.
#[derive(Clone, Copy)]
struct Reach {
    /// It meets left sides from this one on, and right ones before that one.
    boxes: [usize; 2],
    /// It has hits in left sides from this one on, and in right ones before that one.
    hits: [usize; 2],
}

impl Shadows {
    /// Over `count` primitives in `scene`, whose lengths are scaled by `scale`; `None` if no ray meets it.
    pub fn new(of: &ShadowRays<'_>, count: usize, scene: &Bounds, scale: f32) -> Option<Shadows> {
        let segment = |segment| Segment::new(segment, scale);
        let segments: Vec<Segment> = of.segments.par_iter().with_min_len(PIECE).map(segment).collect();
        let meets = |segment: &Segment| segment.weight > 0.0 && segment.meets(scene);
        if !segments.iter().any(meets) {
            return None;
        }
        let mut begins = vec![0; count + 1];
        of.hits.iter().for_each(|&hit| begins[hit as usize + 1] += 1);
        (0..count).for_each(|i| begins[i + 1] += begins[i]);
        let (mut next, mut rays) = (begins.clone(), vec![0; of.hits.len()]);
        let mut first = 0;
        for (ray, &end) in (0..).zip(of.ends) {
            for &hit in &of.hits[first..end as usize] {
                let place = &mut next[hit as usize];
                rays[*place as usize] = ray;
                *place += 1;
            }
            first = end as usize;
        }
        Some(Shadows { segments, begins, rays, weight: of.weight.into() })
    }

    fn on(&self, side: &Side, rays: Vec<u32>) -> ShadowsHere {
        ShadowsHere { rays, area: side.bounds.half_area().into() }
    }

    /// Calls back with the places among the node's rays of those that meet a primitive.
    fn each_hit(&self, here: &ShadowsHere, primitive: u32, mut each: impl FnMut(usize)) {
        let [begin, end] = [0, 1].map(|next| self.begins[primitive as usize + next] as usize);
        let mut among = 0;
        for ray in &self.rays[begin..end] {
            // Both are in the order of the sample.
            let place = here.rays[among..].partition_point(|other| other < ray) + among;
            if here.rays.get(place) == Some(ray) {
                each(place);
            }
            among = place;
        }
    }

    /// How much the rays of a node count beside the area.
    fn weight(&self, here: &ShadowsHere) -> f64 {
        self.weight * (1.0 - 1.0 / (1.0 + GROWTH * here.rays.len() as f64))
    }

    fn reaches(&self, here: &ShadowsHere, splits: &AxisSplits<'_>, places: impl Iterator<Item = Place>) -> Vec<Reach> {
        let AxisSplits { lefts, rights } = splits;
        let of_boxes = |&ray: &u32| {
            let segment = &self.segments[ray as usize];
            let left = lefts.partition_point(|side| !segment.meets_some(&side.bounds));
            let right = rights.partition_point(|side| segment.meets_some(&side.bounds));
            Reach { boxes: [left, right], hits: [lefts.len(), 0] }
        };
        let mut reaches: Vec<Reach> = here.rays.par_iter().with_min_len(PIECE).map(of_boxes).collect();
        for Place { primitive, first, last } in places {
            self.each_hit(here, primitive, |ray| {
                let [left, right] = &mut reaches[ray].hits;
                (*left, *right) = ((*left).min(first), (*right).max(last));
            });
        }
        // A part of a divided primitive has not what is hit of the other: who does not meet the box has no hit in it.
        for Reach { boxes, hits } in &mut reaches {
            *hits = [hits[0].max(boxes[0]), hits[1].min(boxes[1])];
        }
        reaches
    }

    /// What both orders of children cost by rays for one split, a test being 1 and the rays being these.
    fn orders(&self, here: &ShadowsHere, sides: &[Side; 2], looks: &[Looks]) -> [f64; 2] {
        let counts = sides.each_ref().map(|side| f64::from(side.count));
        let cost = |first: usize| -> f64 {
            let of = |(look, &ray): (&Looks, &u32)| {
                let all: f64 = (0..2).filter(|&side| look.enters(side, first)).map(|side| counts[side]).sum();
                all * self.segments[ray as usize].weight
            };
            looks.iter().zip(&here.rays).map(of).sum()
        };
        [cost(0), cost(1)]
    }
}

/// Which sides of a split a ray meets, and in which it has hits.
#[derive(Clone, Copy, Default)]
struct Looks {
    meets: [bool; 2],
    hits: [bool; 2],
}

impl Looks {
    /// Whether the ray looks into a side, where that of number `first` comes first.
    fn enters(&self, side: usize, first: usize) -> bool {
        self.meets[side] && (side == first || !(self.meets[first] && self.hits[first]))
    }
}

impl SplitCost for Shadows {
    type Here = ShadowsHere;
    type Rival = Area;
    const BY_BOTH: bool = true;

    fn root(&self, whole: impl FnOnce() -> Side) -> ShadowsHere {
        let whole = whole();
        let meets = |ray: &u32| {
            let segment = &self.segments[*ray as usize];
            segment.weight > 0.0 && segment.meets(&whole.bounds)
        };
        self.on(&whole, (0..self.segments.len() as u32).into_par_iter().with_min_len(PIECE).filter(meets).collect())
    }

    fn of_node(&self, here: &ShadowsHere, bounds: &Bounds) -> f32 {
        if here.rays.is_empty() { bounds.half_area() } else { 1.0 }
    }

    /// By area alone: rays say nothing of a side without the other.
    fn of_sides(&self, here: &ShadowsHere, sides: impl Iterator<Item = Side>) -> impl Iterator<Item = (f32, Side)> {
        let area = if here.rays.is_empty() { 1.0 } else { here.area };
        let weight = move |side: &Side| {
            if area > 0.0 { (f64::from(side.bounds.half_area()) / area) as f32 } else { 0.0 }
        };
        sides.map(move |side| (weight(&side), side))
    }

    fn of_splits(
        &self,
        here: &ShadowsHere,
        splits: &AxisSplits<'_>,
        places: impl Iterator<Item = Place>,
        costs: &Collapse,
    ) -> Vec<f32> {
        let by_area = Area.of_splits(&(), splits, std::iter::empty(), costs);
        if here.rays.is_empty() {
            return by_area;
        }
        let count = splits.lefts.len();
        // Of each split: rays that look into the left side first, into the right one then, and the other way round. In the first
        // and the last of them what is added or taken away from a split on.
        let mut changes = vec![[0.0; 4]; count + 1];
        let mut rays = 0.0;
        for (&ray, Reach { boxes, hits }) in here.rays.iter().zip(self.reaches(here, splits, places)) {
            let weight = self.segments[ray as usize].weight;
            rays += weight;
            changes[boxes[0]][0] += weight;
            changes[0][1] += weight;
            changes[boxes[1].min(hits[0])][1] -= weight;
            changes[0][2] += weight;
            changes[boxes[1]][2] -= weight;
            changes[boxes[0].max(hits[1])][3] += weight;
        }
        let weight = self.weight(here);
        let mut looks = [0.0; 4];
        let of = |i: usize| {
            (0..4).for_each(|k| looks[k] += changes[i][k]);
            let [left, right] = [&splits.lefts[i], &splits.rights[i]].map(|side| f64::from(side.count));
            let by_rays = (looks[0] * left + looks[1] * right).min(looks[2] * right + looks[3] * left) / rays;
            let by_area = if here.area > 0.0 { f64::from(by_area[i]) / here.area } else { 0.0 };
            (weight * f64::from(costs.c_i) * by_rays + (1.0 - weight) * by_area) as f32
        };
        (0..count).map(of).collect()
    }

    fn divide(
        &self,
        here: ShadowsHere,
        sides: impl FnOnce() -> [Side; 2],
        members: &Members<'_>,
    ) -> (First, [ShadowsHere; 2]) {
        let sides = sides();
        let meets = |&ray: &u32| {
            let meets = sides.each_ref().map(|side| self.segments[ray as usize].meets(&side.bounds));
            Looks { meets, hits: [false; 2] }
        };
        let mut looks: Vec<Looks> = here.rays.par_iter().with_min_len(PIECE).map(meets).collect();
        if !looks.is_empty() {
            members(&mut |side, primitive| self.each_hit(&here, primitive, |ray| looks[ray].hits[side] = true));
        }
        let [left_first, right_first] = self.orders(&here, &sides, &looks);
        let (first, order) = if right_first < left_first { (1, First::Right) } else { (0, First::Left) };
        let of = |side: usize| {
            let entering = here.rays.iter().zip(&looks).filter(|(_, look)| look.enters(side, first));
            self.on(&sides[side], entering.map(|(&ray, _)| ray).collect())
        };
        (order, [of(0), of(1)])
    }
}

#[cfg(test)]
mod tests {
    use super::super::distribution::tests::sample;
    use super::super::split_cost::growing;
    use super::super::tests::Random;
    use super::*;
    use crate::bvh::bounds::Item;
    use crate::bvh::bounds::tests::boxes;
    use glam::Vec3A;

    const EVERYTHING: Bounds = Bounds { lo: Vec3A::splat(-1e9), hi: Vec3A::splat(1e9) };

    fn shadows(segments: &[RaySegment], hits: &[Vec<u32>], count: usize) -> Shadows {
        let end = |end: &mut u32, hits: &Vec<u32>| {
            *end += hits.len() as u32;
            Some(*end)
        };
        let ends: Vec<u32> = hits.iter().scan(0, end).collect();
        let rays = ShadowRays { segments, ends: &ends, hits: &hits.concat(), weight: 1.0 };
        rays.check(count).expect("sound rays");
        Shadows::new(&rays, count, &EVERYTHING, 1.0).expect("rays")
    }

    /// Along x, one of length 1 at each whole number.
    fn row(count: u32) -> Vec<Item> {
        let at = |i: u32| {
            let lo = Vec3A::new(2.0 * i as f32, 0.0, 0.0);
            Item::new(Bounds { lo, hi: lo + Vec3A::ONE }, i, 1)
        };
        (0..count).map(at).collect()
    }

    fn along_x(reaches: f32) -> RaySegment {
        RaySegment { from: [-1.0, 0.5, 0.5], direction: [1.0, 0.0, 0.0], t_end: 1.0 + reaches, weight: 1.0 }
    }

    fn sides_of(items: &[Item], left_count: usize) -> [Side; 2] {
        let side = |items: &[Item]| items.iter().map(|item| Side::of(item, false)).fold(Side::EMPTY, Side::union);
        [side(&items[..left_count]), side(&items[left_count..])]
    }

    fn members_of(items: &[Item], left_count: usize) -> impl Fn(&mut dyn FnMut(usize, u32)) {
        move |each| {
            items.iter().enumerate().for_each(|(at, item)| each(usize::from(at >= left_count), item.primitive()))
        }
    }

    #[test]
    fn the_child_in_which_rays_end_comes_first_and_the_other_one_has_none_of_them() {
        let items = row(4);
        // Four rays through all boxes, of which the last hits something; one that ends in the first box; one that hits both sides.
        let rays = [along_x(9.0), along_x(9.0), along_x(9.0), along_x(0.5), along_x(9.0)];
        let hits = [vec![3], vec![3], vec![2, 3], vec![], vec![0, 2]];
        let shadows = shadows(&rays, &hits, 4);
        let here = shadows.root(|| sides_of(&items, 4)[0]);
        assert_eq!(here.rays, [0, 1, 2, 3, 4]);
        let (first, [left, right]) = shadows.divide(here, || sides_of(&items, 2), &members_of(&items, 2));
        // Right first: 4 rays look into the right one, and the one that ends before it into the left one. Left first: 5, and 3.
        assert_eq!((first, left.rays, right.rays), (First::Right, vec![3], vec![0, 1, 2, 4]));
        // Three boxes on the left, one on the right: 3 rays end there, 2 do not.
        let here = shadows.root(|| sides_of(&items, 4)[0]);
        let (first, [left, right]) = shadows.divide(here, || sides_of(&items, 3), &members_of(&items, 3));
        assert_eq!((first, left.rays, right.rays), (First::Right, vec![3, 4], vec![0, 1, 2, 4]));
    }

    #[test]
    fn a_split_costs_what_the_rays_look_into() {
        let items = row(4);
        let rays = [along_x(9.0), along_x(9.0), along_x(0.5)];
        let shadows = shadows(&rays, &[vec![3], vec![0], vec![]], 4);
        let here = shadows.root(|| sides_of(&items, 4)[0]);
        let weight = 1.0 - 1.0 / 1.3;
        for (left_count, by_rays) in [(1, 3.0 + 3.0), (2, 6.0 + 2.0), (3, 6.0 + 2.0)] {
            let sides = sides_of(&items, left_count);
            let place = |(at, item): (usize, &Item)| {
                let side = usize::from(at >= left_count);
                Place { primitive: item.primitive(), first: side, last: side }
            };
            let splits = AxisSplits { lefts: &sides[..1], rights: &sides[1..] };
            let found = shadows.of_splits(&here, &splits, items.iter().enumerate().map(place), &Collapse::SAH)[0];
            let areas = sides.map(|side| f64::from(side.bounds.half_area()) * f64::from(side.count));
            let by_area = (areas[0] + areas[1]) / f64::from(sides_of(&items, 4)[0].bounds.half_area());
            let expected = 2.0 * (weight * by_rays / 3.0 + (1.0 - weight) * by_area);
            assert!((f64::from(found) - expected).abs() < 1e-5, "{left_count}: {found}, {expected}");
        }
    }

    /// For each split of an axis, the sums of the two orders by what each ray meets and hits.
    #[test]
    fn sums_along_an_axis_are_those_of_every_split_alone() {
        let mut random = Random::new(3);
        let rays = sample(400);
        for count in [2, 3, 17, 90] {
            // Large ones, so that many rays meet more than one.
            let grown = |item: &Item| {
                let Bounds { lo, hi } = item.bounds();
                Item::new(Bounds { lo: lo - 0.1, hi: hi + 0.1 }, item.primitive(), 1)
            };
            let mut items: Vec<Item> = boxes(count).iter().map(grown).collect();
            let axis = count as usize % 3;
            items.sort_by(|a, b| a.centroid_on(axis).total_cmp(&b.centroid_on(axis)));
            // A ray hits some of the boxes that it meets.
            let ready: Vec<Segment> = rays.iter().map(|ray| Segment::new(ray, 1.0)).collect();
            let mut hit = |ray: &Segment| -> Vec<u32> {
                let met = items.iter().filter(|item| ray.meets(&item.bounds()) && random.unit() < 0.4);
                let mut hits: Vec<u32> = met.map(Item::primitive).collect();
                hits.sort_unstable();
                hits
            };
            let hits: Vec<Vec<u32>> = ready.iter().map(&mut hit).collect();
            assert!(count < 10 || hits.iter().any(|hits| hits.len() > 1), "{count}");
            let shadows = shadows(&rays, &hits, count as usize);
            let here = shadows.root(|| sides_of(&items, items.len())[0]);
            let lefts: Vec<Side> = growing(items.iter().map(|item| Side::of(item, false))).collect();
            let mut rights: Vec<Side> = growing(items[1..].iter().rev().map(|item| Side::of(item, false))).collect();
            rights.reverse();
            let places = items.iter().enumerate().map(|(at, item)| {
                let primitive = item.primitive();
                Place { primitive, first: at, last: at }
            });
            let splits = AxisSplits { lefts: &lefts[..items.len() - 1], rights: &rights };
            let costs = shadows.of_splits(&here, &splits, places, &Collapse::SAH);
            let weights: f64 = here.rays.iter().map(|&ray| shadows.segments[ray as usize].weight).sum();
            for (i, cost) in costs.into_iter().enumerate() {
                let sides = sides_of(&items, i + 1);
                let is_in = |side: usize, primitive: u32| {
                    let at = items.iter().position(|item| item.primitive() == primitive).expect("an item");
                    usize::from(at > i) == side
                };
                let look = |&ray: &u32| {
                    let meets = [0, 1].map(|side| ready[ray as usize].meets(&sides[side].bounds));
                    let hits = [0, 1].map(|side| hits[ray as usize].iter().any(|&hit| is_in(side, hit)));
                    Looks { meets, hits }
                };
                let looks: Vec<Looks> = here.rays.iter().map(look).collect();
                let [left_first, right_first] = shadows.orders(&here, &sides, &looks);
                let by_area: f64 =
                    sides.map(|side| f64::from(side.bounds.half_area()) * f64::from(side.count)).iter().sum();
                let weight = shadows.weight(&here);
                let expected = weight * left_first.min(right_first) / weights + (1.0 - weight) * by_area / here.area;
                assert!((f64::from(cost) / (2.0 * expected) - 1.0).abs() < 1e-5, "{count}, {i}: {cost}, {expected}");
            }
        }
    }

    #[test]
    fn a_sample_that_cannot_be_used_is_named() {
        let segments = sample(2);
        let said = |ends: &[u32], hits: &[u32]| {
            let rays = ShadowRays { segments: &segments, ends, hits, weight: 0.9 };
            rays.check(5).map_err(|error| error.to_string())
        };
        assert_eq!(said(&[1, 3], &[4, 0, 2]), Ok(()));
        for ends in [&[3][..], &[2, 1], &[1, 2], &[1, 4], &[1, 2, 3]] {
            assert!(said(ends, &[4, 0, 2]).expect_err("bad ends").contains("take an end for each ray"), "{ends:?}");
        }
        let error = said(&[1, 3], &[4, 5, 2]).expect_err("no such primitive");
        assert!(error.contains("primitive 5") && error.contains("the scene has 5"), "{error}");
        let heavy = ShadowRays { segments: &segments, ends: &[0, 0], hits: &[], weight: 1.5 };
        assert!(heavy.check(5).expect_err("too heavy").to_string().contains("1.5"));
        let broken = [RaySegment { t_end: f32::NAN, ..segments[0] }];
        let broken = ShadowRays { segments: &broken, ends: &[0], hits: &[], weight: 0.9 };
        assert!(broken.check(5).expect_err("no end").to_string().contains("ray 0 of the sample"));
    }
}
