//! `stability degenerate`: every builder over every scene of [`crate::scene::degenerate`]: whether it builds a valid tree of the
//! same bytes each time, whether rays hit what they must, and what it costs.

use super::points::{Degenerate, Experiment};
use crate::device::Device;
use crate::measure::agreement::wrong_where_different;
use crate::measure::{Sink, Spread};
use crate::random::SplitMix64;
use crate::scene::{self, Mesh};
use crate::subjects::Subject;
use crate::subjects::builders::{Needs, Spec};
use crate::{Error, Result};
use glam::Vec3;
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::layout::{Bvh2, status};
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::lbvh;
use hedgerow::trace::twin::tracer::closest_hit_by_brute_force;
use hedgerow::trace::{Hit, Query, Ray};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Rays of the sample.
const RAYS: usize = 256;
/// Builds of a structure whose bytes are not ours to read, beside the first: for its time alone.
const PEER_BUILDS: u32 = 3;
/// Costs of a traversal step and of a triangle test.
const COSTS: (f64, f64) = (3.0, 2.0);

/// What is measured.
pub struct DegenerateSetup<'a> {
    /// Where builders that need a device run.
    pub device: Option<&'a Device>,
    /// The builders.
    pub builders: &'a [Spec],
    /// Builds of each, whose bytes are compared.
    pub builds: u32,
    /// Seed of the rays.
    pub seed: u64,
    /// Is called with what is being done, for a progress bar.
    pub say: &'a dyn Fn(&str),
}

/// A scene with its rays and their true hits.
struct Truth {
    tree: Bvh2,
    rays: Vec<Ray>,
    expected: Vec<Hit>,
}

/// Measures every builder on one scene.
///
/// # Errors
/// Those of `point`.
pub fn measure(stage: &DegenerateSetup<'_>, scene: &scene::Degenerate, point: &mut Sink<'_, Degenerate>) -> Result<()> {
    let tree = lbvh::build(&scene.mesh.positions, &scene.mesh.triangles, Code::Mc63.full(), Collapse::OFF);
    let rays = rays(&tree, stage.seed);
    let expected = rays.iter().map(|ray| closest_hit_by_brute_force(&tree, ray)).collect();
    let truth = Truth { tree, rays, expected };
    for spec in stage.builders {
        (stage.say)(&format!("{}: {spec}", scene.name));
        point(of_builder(stage, scene, spec, &truth))?;
    }
    Ok(())
}

/// Whether a builder is somebody else's.
pub fn is_peer(spec: &Spec) -> bool {
    let builder = spec.builder();
    builder.needs == Needs::RayQuery || ["obvhs-", "embree-"].iter().any(|peer| builder.name.starts_with(peer))
}

fn of_builder(stage: &DegenerateSetup<'_>, scene: &scene::Degenerate, spec: &Spec, truth: &Truth) -> Degenerate {
    let mut mesh = scene.mesh.clone();
    let is_ours = !is_peer(spec);
    if !is_ours {
        // Others leave to chance what a vertex that is not there does.
        let vertices = mesh.positions.len();
        mesh.triangles.retain(|triangle| triangle.iter().all(|&v| (v as usize) < vertices));
    }
    let mut point = Degenerate {
        experiment: Experiment::Degenerate,
        scene: scene.name.to_owned(),
        triangles: scene.mesh.triangles.len() as u64,
        builder: spec.to_string(),
        is_ours,
        active: None,
        depth_max: None,
        sah: None,
        status: None,
        build_ms: None,
        same_bytes: None,
        valid: None,
        rays: truth.rays.len() as u64,
        hits: truth.expected.iter().filter(|hit| hit.is_some()).count() as u64,
        wrong: None,
        faults: Vec::new(),
    };
    // A builder that panics is a finding, too; nothing of it is used afterwards.
    let outcome = catch_unwind(AssertUnwindSafe(|| fill(&mut point, stage, spec, &mesh, truth)));
    match outcome {
        Ok(Ok(())) => {}
        Ok(Err(error)) => point.faults.push(error.to_string()),
        Err(_) => point.faults.push("it panicked".into()),
    }
    point
}

fn fill(point: &mut Degenerate, stage: &DegenerateSetup<'_>, spec: &Spec, mesh: &Mesh, truth: &Truth) -> Result<()> {
    let mut subject = spec.make(stage.device, mesh)?;
    let mut times = Vec::new();
    let mut first: Option<Vec<u8>> = None;
    for build in 0..stage.builds {
        times.push(subject.build()?.milliseconds);
        let Some(bytes) = subject.bytes()? else { if build < PEER_BUILDS { continue } else { break } };
        let is_same = *first.get_or_insert_with(|| bytes.clone()) == bytes;
        if point.same_bytes != Some(false) {
            point.same_bytes = Some(is_same);
            if !is_same {
                point.faults.push(format!("build {build} gave other bytes than the first"));
            }
        }
    }
    // The first build compiles the shaders; it counts where it is the only one.
    point.build_ms = Spread::of(times.get(1..).filter(|times| !times.is_empty()).unwrap_or(&times));
    // Any structure with our layout can be validated, BVH or not.
    if first.is_some() {
        let error = subject.validate().err();
        point.valid = Some(error.is_none());
        point.faults.extend(error.map(|error| error.to_string()));
    }
    if let Some(outcome) = subject.outcome()? {
        point.active = Some(outcome.active.into());
        point.status = Some(status::names(outcome.status));
        let sound = truth.tree.header.active;
        if outcome.active != sound {
            point.faults.push(format!("{} active triangles, {sound} are finite and in range", outcome.active));
        }
        if outcome.status & status::UNUSABLE != 0 {
            point.faults.push("the status says that the tree cannot be used".into());
        }
    }
    let quality = subject.quality(COSTS.0, COSTS.1)?;
    (point.depth_max, point.sah) = (quality.depth_max, quality.sah);
    let wrong = wrong(subject.as_mut(), truth)?;
    point.wrong = Some(wrong);
    if wrong > 0 {
        point.faults.push(format!("{wrong} of {} rays hit something else than by brute force", truth.rays.len()));
    }
    Ok(())
}

/// How many rays find something else than brute force does, as closest-hit and as any-hit rays together.
fn wrong(subject: &mut dyn Subject, truth: &Truth) -> Result<u64> {
    subject.set_rays(&truth.rays)?;
    let Truth { tree, rays, expected } = truth;
    let mut wrong = 0;
    for query in [Query::ClosestHit, Query::AnyHit] {
        subject.trace(query)?;
        let hits = subject.hits()?;
        if hits.len() != expected.len() {
            return Err(Error::Argument(format!("{} rays, but {} hits", expected.len(), hits.len())));
        }
        wrong += wrong_where_different(tree, rays, query, (&hits, expected), rays.len()) as u64;
    }
    Ok(wrong)
}

/// Rays at triangles of the tree: every other one from around the scene, the others from near the triangle, so that small ones
/// are met among large ones. Along the axes where there is no triangle.
fn rays(tree: &Bvh2, seed: u64) -> Vec<Ray> {
    let active = tree.header.active as usize;
    let mut random = SplitMix64::new(seed);
    let bounds = tree.header.root.bounds();
    let middle = Vec3::from(bounds.centroid()).as_dvec3();
    let half = Vec3::from(bounds.hi).as_dvec3() - middle;
    let radius = half.length().max(1e-6 * middle.length()).max(f64::from(f32::MIN_POSITIVE));
    let ray = |i: usize| {
        if active == 0 {
            let mut direction = [0.0; 3];
            direction[i % 3] = 1.0;
            return Ray { origin: random.point(-1.0, 1.0), t_min: 0.0, direction, t_max: f32::INFINITY };
        }
        let record = tree.records[random.bits() as usize % active];
        let [a, b, c] = [record.v0, record.v1, record.v2].map(|v| Vec3::from(v).as_dvec3());
        let (u, v) = (f64::from(random.within(0.1, 0.45)), f64::from(random.within(0.1, 0.45)));
        let target = a + u * (b - a) + v * (c - a);
        let outwards = Vec3::from(random.point(-1.0, 1.0)).as_dvec3();
        let size = (b - a).length().max((c - a).length());
        let (from, distance) = if i.is_multiple_of(2) { (middle, 3.0 * radius) } else { (target, 10.0 * size) };
        // Where the floats end, rays begin there.
        let origin = (from + distance * outwards).to_array().map(|x| x.clamp(f32::MIN.into(), f32::MAX.into()) as f32);
        let towards = target - Vec3::from(origin).as_dvec3();
        let direction = match towards.length() {
            0.0 => [1.0, 0.0, 0.0],
            far => (towards / far).as_vec3().to_array(),
        };
        Ray { origin, t_min: 0.0, direction, t_max: f32::INFINITY }
    };
    (0..RAYS).map(ray).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::subjects::builders;
    use glam::DVec3;

    fn measured(builders: &str, count: u32) -> Vec<Degenerate> {
        let specs = builders::parse_list(builders).expect("known");
        let stage = DegenerateSetup { device: None, builders: &specs, builds: 3, seed: 1, say: &|_| {} };
        let mut points = Vec::new();
        for scene in scene::degenerate(count) {
            let mut keep = |point| {
                points.push(point);
                Ok(())
            };
            measure(&stage, &scene, &mut keep).expect("nothing is written");
        }
        points
    }

    #[test]
    fn the_builders_on_the_host_survive_every_scene() {
        let points = measured("lbvh-host,lbvh-host:codes=mc63:collapse=off", 300);
        assert_eq!(points.len(), 2 * scene::degenerate(0).len());
        for point in &points {
            assert!(!point.has_failed(), "{point:?}");
            assert_eq!((point.valid, point.same_bytes, point.wrong), (Some(true), Some(true), Some(0)), "{point:?}");
        }
        let of = |scene: &str| points.iter().find(|point| point.scene == scene).expect(scene);
        assert_eq!(of("nothing finite").status.as_deref(), Some(&["not finite".to_owned()][..]));
        assert_eq!((of("empty").active, of("empty").hits), (Some(0), 0));
        let broken = of("not finite and out of range");
        assert_eq!(broken.status.as_deref().map(<[_]>::len), Some(2), "{broken:?}");
        assert!(broken.active.is_some_and(|active| active > 200 && active < 300), "{broken:?}");
    }

    #[test]
    fn rays_meet_what_they_are_sent_to() {
        for scene in scene::degenerate(300) {
            let tree = lbvh::build(&scene.mesh.positions, &scene.mesh.triangles, Code::Mc63.full(), Collapse::OFF);
            let rays = rays(&tree, 1);
            let hits = rays.iter().filter(|ray| closest_hit_by_brute_force(&tree, ray).is_some()).count();
            let has_area = |r: &hedgerow::bvh::layout::Triangle| {
                let [a, b, c] = [r.v0, r.v1, r.v2].map(|v| v.map(f64::from));
                let length = |v: [f64; 3]| DVec3::from(v).length();
                let [p, q]: [[f64; 3]; 2] = [b, c].map(|v| std::array::from_fn(|k| v[k] - a[k]));
                let cross = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
                length(cross) > 1e-3 * length(p) * length(q)
            };
            let sound = tree.records[..tree.header.active as usize].iter().filter(|r| has_area(r)).count();
            // Where most triangles have an area that floats can tell, the rays from near them meet one; from as far as the
            // scene reaches, floats cannot aim at small ones.
            if 2 * sound > tree.header.active as usize && !scene.name.contains("far from the origin") {
                assert!(3 * hits > rays.len(), "{}: {hits} of {} rays hit", scene.name, rays.len());
            }
        }
    }
}
