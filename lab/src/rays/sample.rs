//! Rays that teach a builder: a sample of what a frame traces, and what it sees. They are never those that are measured: their seed is
//! their own.

use super::kinds::{self, RayKind, RayOptions};
use crate::Result;
use crate::scene::Scene;
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::layout::Bvh2;
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::lbvh;
use hedgerow::trace::twin::tracer;
use hedgerow::trace::{Hit, Ray};
use hedgerow_host::bvh::heuristic::RaySegment;
use rayon::prelude::*;
use std::rc::Rc;

/// What a frame of a renderer traces.
pub const FRAME: [RayKind; 5] = [RayKind::Primary, RayKind::Shadow, RayKind::Ao, RayKind::Diffuse1, RayKind::Diffuse2];
/// Those of them that end at any hit.
pub const ANY_HIT: [RayKind; 2] = [RayKind::Shadow, RayKind::Ao];
/// Rays of a sample, at most, unless another number is given.
pub const MOST: usize = 1 << 18;
/// Of each kind that teaches an order of children or how to open wide nodes, at most.
pub const MOST_OF_KIND: usize = 1 << 16;
/// Pixels of the picture that a sample is of.
const SAMPLED: [u32; 2] = [320, 180];
/// Pixels of the picture that shows what is seen.
const SEEN: [u32; 2] = [640, 480];
/// No command draws its rays with this one.
const SEED: u64 = 0x7465_6163_6865_7273;

fn tree_of(scene: &Scene) -> Bvh2 {
    let mesh = &scene.mesh;
    lbvh::build(&mesh.positions, &mesh.triangles, Code::Mc63.full(), Collapse::SAH)
}

fn closest(tree: &Bvh2, rays: &[Ray]) -> Vec<Hit> {
    rays.par_iter().map(|ray| tracer::closest_hit(tree, ray)).collect()
}

/// The rays of these kinds with their hits, kind by kind.
fn traced(scene: &Scene, kinds: &[RayKind], size: [u32; 2]) -> Result<Vec<(Ray, Hit)>> {
    Ok(traced_by_kind(scene, kinds, size)?.into_iter().flatten().collect())
}

/// The same, each kind apart.
fn traced_by_kind(scene: &Scene, kinds: &[RayKind], size: [u32; 2]) -> Result<Vec<Vec<(Ray, Hit)>>> {
    let tree = tree_of(scene);
    let options = RayOptions { size, seed: SEED };
    let mut all = Vec::new();
    for &kind in kinds {
        let rays = kinds::generate(kind, scene, &options, &mut |rays| Ok(closest(&tree, rays)))?;
        let hits = closest(&tree, &rays);
        all.push(rays.into_iter().zip(hits).collect());
    }
    Ok(all)
}

/// At most `most` rays of a frame of these kinds, each from its origin to where it ends; every so many, so that each kind and each part
/// of the picture keeps its share.
///
/// # Errors
/// The scene has no triangles.
pub fn segments(scene: &Scene, kinds: &[RayKind], most: usize) -> Result<Vec<RaySegment>> {
    if most == 0 {
        return Ok(Vec::new());
    }
    let all = traced(scene, kinds, SAMPLED)?;
    let stride = all.len().div_ceil(most).max(1);
    let segment = |(ray, hit): &(Ray, Hit)| RaySegment {
        from: ray.origin,
        direction: ray.direction,
        t_end: if hit.is_some() { hit.t } else { ray.t_max },
        weight: stride as f32,
    };
    Ok(all.iter().step_by(stride).map(segment).collect())
}

/// Rays that teach, each kind apart.
#[derive(Debug, Clone, PartialEq)]
pub struct TeachingRays {
    /// Those of each kind.
    pub by_kind: Vec<(RayKind, Vec<Ray>)>,
}

impl TeachingRays {
    /// At most this many of each of these kinds, from all parts of the picture.
    ///
    /// # Errors
    /// The scene has no triangles.
    pub fn of(scene: &Scene, kinds: &[RayKind], most: usize) -> Result<TeachingRays> {
        let of_kind = |(kind, all): (&RayKind, Vec<(Ray, Hit)>)| {
            let stride = all.len().div_ceil(most.max(1)).max(1);
            (*kind, all.iter().step_by(stride).map(|(ray, _)| *ray).collect())
        };
        Ok(TeachingRays { by_kind: kinds.iter().zip(traced_by_kind(scene, kinds, SAMPLED)?).map(of_kind).collect() })
    }

    /// All of them, kind by kind.
    pub fn all(&self) -> Rc<[Ray]> {
        self.by_kind.iter().flat_map(|(_, rays)| rays).copied().collect()
    }
}

/// A sample of rays that end at any hit, with all that they meet.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ShadowSample {
    /// The rays, whole.
    pub segments: Vec<RaySegment>,
    /// Where the triangles that each ray meets end in `hits`.
    pub ends: Vec<u32>,
    /// The triangles that rays meet, ray by ray.
    pub hits: Vec<u32>,
}

/// At most `most` rays of a frame of these kinds with all that they meet; every so many, as in [`segments`].
///
/// # Errors
/// The scene has no triangles.
pub fn shadows(scene: &Scene, kinds: &[RayKind], most: usize) -> Result<ShadowSample> {
    if most == 0 {
        return Ok(ShadowSample::default());
    }
    let tree = tree_of(scene);
    let options = RayOptions { size: SAMPLED, seed: SEED };
    let mut rays = Vec::new();
    for &kind in kinds {
        rays.extend(kinds::generate(kind, scene, &options, &mut |rays| Ok(closest(&tree, rays)))?);
    }
    let stride = rays.len().div_ceil(most).max(1);
    let few: Vec<&Ray> = rays.iter().step_by(stride).collect();
    let met: Vec<Vec<u32>> = few.par_iter().map(|ray| tracer::all_hits(&tree, ray)).collect();
    let mut sample = ShadowSample::default();
    for (ray, met) in few.into_iter().zip(met) {
        let Ray { origin: from, direction, t_max: t_end, .. } = *ray;
        sample.segments.push(RaySegment { from, direction, t_end, weight: stride as f32 });
        sample.hits.extend(met);
        sample.ends.push(sample.hits.len() as u32);
    }
    Ok(sample)
}

/// Of each triangle, whether a ray of a frame of these kinds ends on it.
///
/// # Errors
/// The scene has no triangles.
pub fn seen(scene: &Scene, kinds: &[RayKind]) -> Result<Vec<bool>> {
    let mut seen = vec![false; scene.mesh.triangles.len()];
    for (_, hit) in traced(scene, kinds, SEEN)?.iter().filter(|(_, hit)| hit.is_some()) {
        seen[hit.primitive as usize] = true;
    }
    Ok(seen)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{LoadOptions, load};

    fn scene(name: &str) -> Scene {
        load(name, &LoadOptions::default()).expect("a generator")
    }

    #[test]
    fn a_sample_is_as_large_as_asked_for_and_stands_for_all_rays() {
        let scene = scene("gen:stadium:3");
        let all = segments(&scene, &FRAME, usize::MAX).expect("rays");
        assert!(all.len() > 2000 && all.iter().all(|segment| segment.weight == 1.0));
        let few = segments(&scene, &FRAME, 1000).expect("rays");
        assert!((500..=1000).contains(&few.len()), "{} rays", few.len());
        let weight: f32 = few.iter().map(|segment| segment.weight).sum();
        assert!((weight / all.len() as f32 - 1.0).abs() < 0.01, "{weight} of {}", all.len());
        assert!(segments(&scene, &FRAME, 0).expect("none").is_empty());
    }

    #[test]
    fn a_ray_that_ends_at_any_hit_knows_all_that_it_meets() {
        // A ray that leaves a sphere on the dark side meets it twice.
        let scene = scene("gen:icosphere:3");
        let sample = shadows(&scene, &ANY_HIT, 500).expect("rays");
        assert!((250..=500).contains(&sample.segments.len()), "{} rays", sample.segments.len());
        let tree = tree_of(&scene);
        let (mut first, mut met) = (0, 0);
        for (segment, &end) in sample.segments.iter().zip(&sample.ends) {
            let hits = &sample.hits[first as usize..end as usize];
            let RaySegment { from, direction, t_end, .. } = *segment;
            let ray = Ray { origin: from, t_min: 0.0, direction, t_max: t_end };
            let hit = tracer::closest_hit_by_brute_force(&tree, &ray);
            assert_eq!(hit.is_some(), !hits.is_empty(), "{segment:?}");
            assert!(hits.is_empty() || hits.contains(&hit.primitive), "{segment:?}");
            met += usize::from(hits.len() > 1);
            first = end;
        }
        assert!(met > 20, "{met} rays meet more than one triangle");
        assert_eq!(first as usize, sample.hits.len());
        assert_eq!(shadows(&scene, &ANY_HIT, 0).expect("none"), ShadowSample::default());
    }

    #[test]
    fn segments_end_where_rays_hit_and_what_they_end_on_is_seen() {
        let scene = scene("gen:icosphere:3");
        let primary = segments(&scene, &[RayKind::Primary], usize::MAX).expect("rays");
        assert_eq!(primary.len(), 320 * 180);
        let ended = primary.iter().filter(|segment| segment.t_end.is_finite()).count();
        assert!((1000..56_000).contains(&ended), "{ended} rays end on the sphere");
        // Of a closed sphere the camera sees less than half.
        let seen = seen(&scene, &[RayKind::Primary]).expect("rays").into_iter().filter(|&seen| seen).count();
        let triangles = scene.mesh.triangles.len();
        assert!((triangles / 8..triangles / 2).contains(&seen), "{seen} of {triangles} triangles");
    }
}
