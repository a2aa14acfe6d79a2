//! Structures as `PREFER_FAST_TRACE` alone makes them, beside the driver's by the same flag; and the same with no instance opened: what
//! re-braiding takes to build, and what rays of every kind gain.

use super::points::{self, AccelEntry, FlaggedRays, TopLevelPoint};
use super::{AccelSetup, WARM_UPS};
use crate::Result;
use crate::measure::agreement::agree;
use crate::measure::{Sink, Spread, in_turn, ratios};
use crate::rays::kinds::RayKind;
use crate::scene::{Instances, Scene, SceneInstance};
use crate::subjects::device_rays::RayBuffers;
use crate::subjects::levels::Levels;
use crate::subjects::queries::MeanWork;
use crate::subjects::queries::Queries;
use crate::subjects::structures::Structures;
use ash::vk;
use hedgerow::accel::AccelOptions;
use hedgerow::geometry::Aabb;
use rayon::prelude::*;

type Flags = vk::BuildAccelerationStructureFlagsKHR;

/// Where the top levels stand among those that are compared.
const OFF: usize = 0;
const ON: usize = 1;
const DRIVER: usize = 2;

/// Measures one scene.
///
/// # Errors
/// Too little memory; the device failed; the scene is too large to be flattened, which rays are made with.
pub fn measure(stage: &AccelSetup<'_>, instances: &Instances, point: &mut Sink<'_, AccelEntry>) -> Result<()> {
    let say = |what: &str| (stage.say)(&format!("re-braiding {}: {what}", instances.name));
    say("building");
    let unopened = AccelOptions { rebraid_budget: 1.0, ..stage.options };
    let ours = [Structures::ours(stage.device, unopened), stage.ours()];
    let all = ours.into_iter().chain(Structures::drivers(stage.device));
    let levels = all.map(|maker| Levels::new(maker, instances, Flags::PREFER_FAST_TRACE));
    let mut levels: Vec<Levels<'_>> = levels.collect::<Result<_>>()?;
    let builds = in_turn(&mut levels, WARM_UPS, stage.runs, Levels::build);
    let mut sides = Vec::new();
    for (levels, builds) in levels.iter().zip(builds) {
        let [structure_bytes, scratch_bytes] = levels.top_bytes();
        let build_ms = Spread::of_some(&builds?)?;
        sides.push(TopLevelPoint { build_ms, structure_bytes, scratch_bytes, entries: levels.entries() });
    }
    say("making rays");
    let rays = all_traced(stage, instances, &mut levels, &say)?;
    point(AccelEntry::Rebraid(points::RebraidPoint {
        scene: instances.name.clone(),
        instances: instances.instances.len() as u32,
        parts: instances.parts.len() as u32,
        triangles: instances.triangle_count(),
        overlaps: overlaps(instances),
        off: sides[OFF].clone(),
        on: sides[ON].clone(),
        driver: sides.get(DRIVER).cloned(),
        rays,
    }))
}

/// All kinds of rays to a scene of instances, through its levels.
pub(super) fn all_traced(
    stage: &AccelSetup<'_>,
    instances: &Instances,
    levels: &mut [Levels<'_>],
    say: &dyn Fn(&str),
) -> Result<Vec<FlaggedRays>> {
    let scene = Scene {
        name: instances.name.clone(),
        mesh: instances.flatten()?,
        camera: instances.camera,
        lights: instances.lights.clone(),
    };
    let trace = |(kind, buffers): (RayKind, RayBuffers<'_>)| {
        say(kind.name());
        traced(stage, levels, kind, &buffers)
    };
    stage.rays_to(&scene)?.into_iter().map(trace).collect()
}

/// Rays of a kind through levels without a flag, with it, and the driver's where they are there.
fn traced(
    stage: &AccelSetup<'_>,
    levels: &mut [Levels<'_>],
    kind: RayKind,
    rays: &RayBuffers<'_>,
) -> Result<FlaggedRays> {
    let query = kind.query();
    // One ray for each invocation through all of them, and many through the second.
    let mut ways: Vec<(usize, Queries)> = (0..levels.len()).map(|of| (of, Queries::OneEach)).collect();
    ways.push((ON, Queries::InTurn));
    let times = in_turn(&mut ways, WARM_UPS, stage.runs, |&mut (of, way)| levels[of].trace(rays, query, way));
    let mut times: Vec<Vec<f64>> = times.into_iter().collect::<Result<_>>()?;
    let in_turn_ms = times.pop().and_then(|times| Spread::of(&times));
    let mut found = Vec::new();
    for (of, way) in [(OFF, Queries::OneEach), (ON, Queries::OneEach), (ON, Queries::InTurn)] {
        levels[of].trace(rays, query, way)?;
        found.push(rays.read_hits());
    }
    let work: Vec<MeanWork> =
        levels[..=ON].iter_mut().map(|levels| Ok(MeanWork::mean(&levels.work(rays, query)?))).collect::<Result<_>>()?;
    let is_same = |i: usize| found[1..].iter().all(|hits| agree(query, &found[OFF][i], &hits[i]));
    Ok(FlaggedRays {
        rays: kind.name().into(),
        count: rays.count.into(),
        hits: found[OFF].iter().filter(|hit| hit.is_some()).count() as u64,
        different: (0..found[OFF].len()).filter(|&i| !is_same(i)).count() as u64,
        off_ms: Spread::of_some(&times[OFF])?,
        on_ms: Spread::of_some(&times[ON])?,
        in_turn_ms,
        driver_ms: times.get(DRIVER).and_then(|times| Spread::of(times)),
        gain: Spread::of_some(&ratios(&times[OFF], &times[ON]))?,
        off_work: work[OFF],
        on_work: work[ON],
    })
}

/// How many other instances' boxes each one's overlaps, in the mean over at most this many; boxes are around the placed vertices.
fn overlaps(scene: &Instances) -> f64 {
    const SAMPLE: usize = 256;
    let around = |instance: &SceneInstance| {
        let points = scene.parts[instance.part as usize].positions.iter().map(|&p| instance.place(p));
        points.fold(Aabb::EMPTY, |bounds, point| bounds.union(&Aabb::around(&[point])))
    };
    let boxes: Vec<Aabb> = scene.instances.par_iter().map(around).collect();
    let meet = |a: &Aabb, b: &Aabb| (0..3).all(|k| a.lo[k] < b.hi[k] && b.lo[k] < a.hi[k]);
    let count = boxes.len().min(SAMPLE);
    let others = |i: usize| {
        let one = i * boxes.len() / count;
        (0..boxes.len()).filter(|&other| other != one && meet(&boxes[one], &boxes[other])).count()
    };
    (0..count).map(others).sum::<usize>() as f64 / count.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{self, LoadOptions};

    #[test]
    fn boxes_overlap_in_a_forest_and_not_in_cells() {
        let of = |spec| overlaps(&scene::load_instances(spec, &LoadOptions::default()).expect("a generator"));
        assert_eq!(of("gen:cells:1000"), 0.0);
        assert!(of("gen:forest:100") > 2.0 && of("gen:cables:100") > 50.0);
    }
}
