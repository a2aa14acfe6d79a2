//! What a finished tree costs the rays that a heuristic knows.
//!
//! The SAH cost is c_t Σ SA(inner) + c_i Σ SA(leaf) · its primitives, over the root's area: the work of rays that are uniform lines.
//! With the rays of another measure in place of the areas it is their work, if none ended early: C_F = (c_t Σ F(inner) + c_i Σ
//! F(leaf) · its primitives) / F(root). A top-down builder makes it small split by split, and never sees the sum.

use super::distribution::{Distribution, RayDistribution, Segment};
use super::interior::Interior;
use super::preferred::{Preferred, PreferredMeasure};
use super::{Heuristic, Occlusion, RayMeasure, ShadowRays};
use crate::bvh::bounds::Bounds;
use hedgerow::bvh::layout::{Bvh2, Child, Record};
use hedgerow::geometry::Aabb;
use hedgerow::{Error, Result};
use rayon::prelude::*;

impl Heuristic<'_> {
    /// C_F of `tree` with these costs of a step and of a test, in the unit of the SAH cost. What a heuristic counts beside its own
    /// rays, the surface area, is left out: of preferred rays, of a sample and of seen primitives it is the work of those alone.
    /// Rays of a sample end where they ended; what is met on the way is met in no order. Shadow rays go left first, each to its first
    /// hit. `None` where the heuristic knows of
    /// nothing: an empty tree, a scene without volume, no ray that meets it, no primitive that is seen.
    ///
    /// # Errors
    /// [`Error::Argument`] names what of the heuristic cannot be used, and what can.
    pub fn cost<R: Record>(&self, tree: &Bvh2<R>, c_t: f64, c_i: f64) -> Result<Option<f64>> {
        if tree.header.active == 0 {
            return Ok(None);
        }
        let (walk, scene, costs) = (Walk::of(tree), tree.header.root.bounds(), [c_t, c_i]);
        Ok(match self {
            Heuristic::Sah => walk.cost(costs, half_area),
            Heuristic::Interior(form) => {
                Interior::new(*form, &scene).and_then(|measure| walk.cost(costs, |bounds| measure.rays(bounds).into()))
            }
            Heuristic::Preferred(preferred) => {
                preferred.check()?;
                of_preferred(&walk, preferred, &scene, costs)
            }
            Heuristic::Distribution(rays) => {
                rays.check()?;
                of_sample(tree, rays, costs)
            }
            Heuristic::Occlusion(occlusion) | Heuristic::OcclusionComplete(occlusion) => {
                of_seen(&walk, tree, occlusion, costs)?
            }
            Heuristic::Shadow(rays) => {
                rays.check(usize::MAX)?;
                of_shadows(tree, rays, costs)
            }
        })
    }
}

/// The nodes and leaves of a tree, each behind its parent.
struct Walk {
    children: Vec<Child>,
    /// Where in `children` the parent is; the root's is the root.
    parents: Vec<usize>,
}

impl Walk {
    fn of<R: Record>(tree: &Bvh2<R>) -> Walk {
        let mut walk = Walk { children: vec![tree.header.root], parents: vec![0] };
        let mut next = 0;
        while let Some(child) = walk.children.get(next).copied() {
            if !child.is_leaf() {
                walk.children.extend(tree.nodes[child.index as usize].children);
                walk.parents.extend([next; 2]);
            }
            next += 1;
        }
        walk
    }

    /// The cost with the rays that meet each box; the sum has one order, whoever many threads measure.
    fn cost(&self, costs: [f64; 2], rays: impl Fn(&Aabb) -> f64 + Sync) -> Option<f64> {
        let met: Vec<f64> = self.children.par_iter().map(|child| rays(&child.bounds())).collect();
        self.cost_of(costs, &met)
    }

    fn cost_of(&self, costs: [f64; 2], met: &[f64]) -> Option<f64> {
        let sum: f64 = self.children.iter().zip(met).map(|(child, met)| met * work(child, costs)).sum();
        Some(sum / met[0]).filter(|cost| cost.is_finite())
    }
}

/// What a ray that comes to a child does there.
fn work(child: &Child, [c_t, c_i]: [f64; 2]) -> f64 {
    if child.is_leaf() { c_i * f64::from(child.count) } else { c_t }
}

fn half_area(bounds: &Aabb) -> f64 {
    let [x, y, z]: [f64; 3] = std::array::from_fn(|k| f64::from(bounds.hi[k]) - f64::from(bounds.lo[k]));
    x * y + y * z + z * x
}

fn of_preferred(walk: &Walk, preferred: &Preferred, scene: &Aabb, costs: [f64; 2]) -> Option<f64> {
    PreferredMeasure::new(preferred, scene).and_then(|measure| walk.cost(costs, |bounds| measure.part(bounds)))
}

/// The mean work of the rays of a sample that meet the scene.
fn of_sample<R: Record>(tree: &Bvh2<R>, rays: &RayDistribution<'_>, costs: [f64; 2]) -> Option<f64> {
    let sample = Distribution::new(rays, &Bounds::of(&tree.header.root.bounds()), 1.0)?;
    let work_of = |segment: &Segment| {
        let (mut sum, mut next) = (0.0, vec![tree.header.root]);
        while let Some(child) = next.pop() {
            if segment.meets(&Bounds::of(&child.bounds())) {
                sum += work(&child, costs);
                if !child.is_leaf() {
                    next.extend(tree.nodes[child.index as usize].children);
                }
            }
        }
        sum
    };
    let works: Vec<f64> = sample.segments.par_iter().map(|segment| segment.weight * work_of(segment)).collect();
    let weight: f64 = sample.segments.iter().map(|segment| segment.weight).sum();
    Some(works.iter().sum::<f64>() / weight)
}

/// The mean work of the shadow rays that meet the scene, left children first, each to its first hit.
fn of_shadows<R: Record>(tree: &Bvh2<R>, rays: &ShadowRays<'_>, costs: [f64; 2]) -> Option<f64> {
    let root = tree.header.root;
    let work_of = |i: usize| {
        let segment = Segment::new(&rays.segments[i], 1.0);
        let begin = if i == 0 { 0 } else { rays.ends[i - 1] };
        let hits = &rays.hits[begin as usize..rays.ends[i] as usize];
        let weight = if segment.meets(&Bounds::of(&root.bounds())) { segment.weight } else { 0.0 };
        let (mut sum, mut next) = (0.0, vec![root]);
        while let Some(child) = next.pop() {
            if !segment.meets(&Bounds::of(&child.bounds())) {
                continue;
            }
            if !child.is_leaf() {
                sum += costs[0];
                next.extend(tree.nodes[child.index as usize].children.iter().rev());
                continue;
            }
            for record in &tree.records[child.index as usize..(child.index + child.count) as usize] {
                sum += costs[1];
                if hits.contains(&record.primitive()) {
                    return [weight * sum, weight];
                }
            }
        }
        [weight * sum, weight]
    };
    let of_rays: Vec<[f64; 2]> = (0..rays.segments.len()).into_par_iter().map(work_of).collect();
    let [work, weight] = of_rays.iter().fold([0.0; 2], |[work, weight], ray| [work + ray[0], weight + ray[1]]);
    Some(work / weight).filter(|cost| cost.is_finite())
}

/// The mean work of going down to a primitive that is seen.
fn of_seen<R: Record>(walk: &Walk, tree: &Bvh2<R>, occlusion: &Occlusion<'_>, costs: [f64; 2]) -> Result<Option<f64>> {
    let is_seen = |record: &R| occlusion.seen.get(record.primitive() as usize).copied();
    let mut met = vec![0.0; walk.children.len()];
    for (i, child) in walk.children.iter().enumerate().rev() {
        if child.is_leaf() {
            for record in &tree.records[child.index as usize..(child.index + child.count) as usize] {
                let known = occlusion.seen.len();
                let primitive = record.primitive();
                let error = || {
                    let text =
                        format!("of {known} primitives it is known whether they are seen, the tree has {primitive}");
                    Error::Argument(format!("{text}; take one value for each primitive"))
                };
                met[i] += f64::from(u8::from(is_seen(record).ok_or_else(error)?));
            }
        }
        if i > 0 {
            met[walk.parents[i]] += met[i];
        }
    }
    Ok(walk.cost_of(costs, &met))
}

#[cfg(test)]
mod tests {
    use super::super::distribution::tests::sample;
    use super::super::tests::meets;
    use super::super::{InteriorForm, Pinhole, PreferredRays, RaySegment};
    use super::*;
    use crate::bvh::bounds::tests as items;
    use crate::bvh::{HostBvhOptions, HostMethod, build_aabbs_by};
    use hedgerow::bvh::layout::BoxRecord;
    use hedgerow::bvh::sah::Collapse;
    use hedgerow::bvh::twin::quality;

    const COSTS: [f64; 2] = [3.0, 2.0];

    fn tree(boxes: &[Aabb]) -> Bvh2<BoxRecord> {
        let options = HostBvhOptions { collapse: Collapse::OFF, ..HostBvhOptions::of(HostMethod::Sweep) };
        build_aabbs_by(&Heuristic::Sah, boxes, &options).expect("boxes").tree
    }

    fn boxes(count: u32) -> Vec<Aabb> {
        items::boxes(count).iter().map(|item| item.bounds().aabb()).collect()
    }

    fn cost(heuristic: Heuristic<'_>, tree: &Bvh2<BoxRecord>) -> Option<f64> {
        heuristic.cost(tree, COSTS[0], COSTS[1]).expect("it can be used")
    }

    #[test]
    fn by_area_it_is_the_sah_cost() {
        let tree = tree(&boxes(700));
        let (found, sah) =
            (cost(Heuristic::Sah, &tree).expect("a surface"), quality::of(&tree, COSTS[0], COSTS[1]).sah);
        assert!((found / sah - 1.0).abs() < 1e-12, "{found} {sah}");
    }

    /// Two halves of a cube: the root, and two leaves.
    fn halves() -> Bvh2<BoxRecord> {
        tree(&[Aabb { lo: [0.0; 3], hi: [0.5, 1.0, 1.0] }, Aabb { lo: [0.5, 0.0, 0.0], hi: [1.0; 3] }])
    }

    #[test]
    fn two_halves_of_a_cube_cost_what_a_hand_finds() {
        let tree = halves();
        // A half is met by 0.62405 of the rays that begin anywhere in the cube, by 0.625 of them as slabs have it.
        let of_form = |form| cost(Heuristic::Interior(form), &tree).expect("a volume");
        assert!((of_form(InteriorForm::Exact) - (3.0 + 4.0 * 0.62405)).abs() < 0.01);
        assert!((of_form(InteriorForm::Fast) - (3.0 + 4.0 * 0.625)).abs() < 1e-6);
        // Along x all rays meet both, along y each meets one half.
        let along = |direction| cost(Heuristic::Preferred(Preferred::of(PreferredRays::Parallel(direction))), &tree);
        assert!((along([1.0, 0.0, 0.0]).expect("rays") - 7.0).abs() < 1e-9);
        assert!((along([0.0, 1.0, 0.0]).expect("rays") - 5.0).abs() < 1e-9);
        // One of two is seen: who looks for it goes through the root, and tests one.
        let seen = [true, false];
        assert_eq!(cost(Heuristic::Occlusion(Occlusion::of(&seen)), &tree), Some(5.0));
    }

    #[test]
    fn shadow_rays_go_left_first_to_their_first_hit() {
        let tree = halves();
        let ray = RaySegment { from: [-1.0, 0.5, 0.5], direction: [1.0, 0.0, 0.0], t_end: 9.0, weight: 1.0 };
        let of = |hits: &[u32]| {
            let (segments, ends) = ([ray], [hits.len() as u32]);
            cost(Heuristic::Shadow(ShadowRays { segments: &segments, ends: &ends, hits, weight: 1.0 }), &tree)
        };
        // Blocked by the half on the left; by the other one; by nothing.
        assert_eq!([of(&[0]), of(&[1]), of(&[])], [Some(5.0), Some(7.0), Some(7.0)]);
        let none = ShadowRays { segments: &[], ends: &[], hits: &[], weight: 1.0 };
        assert_eq!(cost(Heuristic::Shadow(none), &tree), None);
    }

    #[test]
    fn rays_of_a_sample_end_where_they_ended() {
        let tree = halves();
        let ray = |t_end, weight| RaySegment { from: [-1.0, 0.5, 0.5], direction: [1.0, 0.0, 0.0], t_end, weight };
        let of = |rays: &[RaySegment]| cost(Heuristic::Distribution(RayDistribution::of(rays)), &tree);
        // Through both halves; into the first; not as far as the cube.
        assert_eq!(of(&[ray(f32::INFINITY, 1.0)]), Some(7.0));
        assert_eq!(of(&[ray(1.2, 1.0)]), Some(5.0));
        assert_eq!(of(&[ray(0.5, 1.0)]), None);
        // Three of the first for one of the second, and the third counts for none.
        assert_eq!(of(&[ray(f32::INFINITY, 3.0), ray(1.2, 1.0), ray(0.5, 9.0)]), Some(0.25 * (3.0 * 7.0 + 5.0)));
    }

    #[test]
    fn the_work_of_a_sample_is_that_of_each_of_its_rays() {
        let (tree, rays) = (tree(&boxes(400)), sample(500));
        let mut work = [0.0; 2];
        for ray in &rays {
            // Its length is in the box: what is behind its end is not met.
            let box_of_ray = |bounds: &Aabb| {
                let end = f64::from(ray.t_end);
                let shortened = |k: usize| f64::from(ray.direction[k]);
                let direction: [f64; 3] = std::array::from_fn(shortened);
                let from = ray.from.map(f64::from);
                let mut near = 0.0f64;
                for k in 0..3 {
                    let at = [bounds.lo[k], bounds.hi[k]].map(|x| (f64::from(x) - from[k]) / direction[k]);
                    near = near.max(at[0].min(at[1]));
                }
                meets(bounds, from, direction) && near <= end
            };
            let mut next = vec![tree.header.root];
            if !box_of_ray(&tree.header.root.bounds()) {
                continue;
            }
            work[1] += f64::from(ray.weight);
            while let Some(child) = next.pop() {
                if box_of_ray(&child.bounds()) {
                    work[0] += f64::from(ray.weight) * super::work(&child, COSTS);
                    if !child.is_leaf() {
                        next.extend(tree.nodes[child.index as usize].children);
                    }
                }
            }
        }
        let found = cost(Heuristic::Distribution(RayDistribution::of(&rays)), &tree).expect("rays");
        let expected = work[0] / work[1];
        assert!((found / expected - 1.0).abs() < 1e-3, "{found} {expected}");
    }

    #[test]
    fn what_a_heuristic_knows_nothing_of_has_no_cost() {
        let flat: Vec<Aabb> =
            boxes(50).into_iter().map(|b| Aabb { lo: [b.lo[0], b.lo[1], 0.5], hi: [b.hi[0], b.hi[1], 0.5] }).collect();
        assert_eq!(cost(Heuristic::Interior(InteriorForm::Exact), &tree(&flat)), None);
        let camera = Pinhole { eye: [9.0; 3], look: [10.0; 3], up: [0.0, 1.0, 0.0], fov: 40.0, aspect: 1.0 };
        let away = Heuristic::Preferred(Preferred::of(PreferredRays::Perspective(camera)));
        let cube = tree(&boxes(50));
        assert_eq!(cost(away, &cube), None, "the scene is behind the camera");
        assert_eq!(cost(Heuristic::Occlusion(Occlusion::of(&[false; 50])), &cube), None);
        assert_eq!(cost(Heuristic::Sah, &tree(&[])), None);
        let error = Heuristic::Occlusion(Occlusion::of(&[true; 49])).cost(&cube, 3.0, 2.0).expect_err("one is missing");
        assert!(error.to_string().contains("of 49 primitives"), "{error}");
    }

    #[test]
    fn it_is_the_same_on_any_number_of_threads() {
        let (tree, rays) = (tree(&boxes(3_000)), sample(3_000));
        for heuristic in [Heuristic::Interior(InteriorForm::Exact), Heuristic::Distribution(RayDistribution::of(&rays))]
        {
            let on = |threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
                pool.install(|| cost(heuristic, &tree))
            };
            assert_eq!(on(1), on(3), "{heuristic:?}");
        }
    }
}
