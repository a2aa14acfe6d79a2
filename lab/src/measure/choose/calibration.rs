//! The measured cost of every candidate on this device: a few generated scenes, built and traced.

use super::candidates;
use super::features::Features;
use super::model::Measured;
use super::prices::RayWork;
use crate::device::Device;
use crate::measure::Subject;
use crate::measure::builders::Spec;
use crate::measure::statistics::{Spread, in_turn};
use crate::random::SplitMix64;
use crate::rays::kinds::{self, RayKind, RayOptions};
use crate::scene::{self, LoadOptions, Scene};
use crate::{Error, Result};
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::lbvh;
use hedgerow::trace::twin::tracer as host;
use hedgerow::trace::{Query, Ray};
use rayon::prelude::*;

/// The scenes: of different sizes, and lying differently in their bounds (closed objects, sheets, soups, long thin triangles, a few
/// large ones around many small ones, towns, plants), so that every figure of [`Features`] varies by itself.
pub const SCENES: [&str; 18] = [
    "gen:icosphere:3",
    "gen:icosphere:6",
    "gen:soup:3000:1",
    "gen:soup:30000:2",
    "gen:grid:60",
    "gen:grid:120",
    "gen:stadium:5",
    "gen:stadium:6",
    "gen:needles:1500:1",
    "gen:twist:20000:1",
    "gen:city:60",
    "gen:forest:20",
    "gen:cells:40",
    "gen:clutter:24:1",
    "gen:clutter:60:2",
    "gen:clutter:100:3",
    "gen:clutter:150:4",
    "gen:clutter:240:5",
];
/// Scenes larger than caches. Only the fastest builds of each layout are measured there: they tell how many times its price a ray
/// takes, and what a ray does is told by the others.
pub const LARGE_SCENES: [&str; 8] = [
    "gen:icosphere:7",
    "gen:icosphere:8",
    "gen:grid:400",
    "gen:soup:300000:2",
    "gen:city:300",
    "gen:forest:500",
    "gen:cells:700",
    "gen:clutter:800:6",
];
/// Pixels of the picture that the rays belong to.
const RAYS: RayOptions = RayOptions { size: [128, 96], seed: 1 };
/// Runs that count, after one that does not.
const RUNS: u32 = 3;
/// Milliseconds after which a builder has built enough on a scene.
const ENOUGH_MS: f64 = 50.0;

/// Measures every candidate that `device` can build on every scene of [`SCENES`], and some on [`LARGE_SCENES`]. `say` is told what is being done. A candidate that
/// fails on a scene has no figures there.
///
/// # Errors
/// The device can build no candidate.
pub fn measure(device: &Device, say: &mut dyn FnMut(&str)) -> Result<Vec<Measured>> {
    let specs = candidates::possible(device);
    if specs.is_empty() {
        return Err(Error::NoVulkan(format!("{} can build none of the candidates of auto", device.found().name)));
    }
    let fastest: Vec<Spec> =
        candidates::FASTEST.iter().filter_map(|name| specs.iter().find(|s| s.to_string() == *name)).cloned().collect();
    let mut measured = Vec::new();
    let all = SCENES.map(|name| (name, &specs));
    let large = LARGE_SCENES.map(|name| (name, &fastest));
    for (name, specs) in all.into_iter().chain(large) {
        say(&format!("calibrating on {name}"));
        let scene = load(name)?;
        measured.extend(on_scene(device, &scene, specs, &Effort { rays: RAYS, runs: RUNS, enough_ms: ENOUGH_MS })?);
    }
    Ok(measured)
}

/// A scene of [`SCENES`], its triangles in any order: those of generators lie side by side in space, so that it would not show where
/// codes are too short to tell them apart.
fn load(name: &str) -> Result<Scene> {
    let mut scene = scene::load(name, &LoadOptions::default())?;
    let triangles = &mut scene.mesh.triangles;
    let mut random = SplitMix64::new(triangles.len() as u64);
    for i in (1..triangles.len()).rev() {
        triangles.swap(i, (random.bits() % (i as u64 + 1)) as usize);
    }
    Ok(scene)
}

/// How much is measured.
#[derive(Debug, Clone, Copy)]
pub struct Effort {
    /// The picture that the rays belong to.
    pub rays: RayOptions,
    /// Runs that count, after one that does not.
    pub runs: u32,
    /// A builder that has built twice, and for so many milliseconds, builds no more: what disturbs so long a time is small beside it.
    pub enough_ms: f64,
}

/// A candidate on a scene.
struct Entry<'a> {
    spec: &'a Spec,
    subject: Box<dyn Subject + 'a>,
    builds_ms: Vec<f64>,
    /// Steps and tests a ray.
    work: RayWork,
}

/// The least times of builders on a scene, over several runs in turn: what disturbs a run only adds to it. One that fails has none.
///
/// # Errors
/// The scene has no triangles, or the image of the rays too many pixels.
pub fn on_scene(device: &Device, scene: &Scene, specs: &[Spec], effort: &Effort) -> Result<Vec<Measured>> {
    let features = Features::of(&scene.mesh);
    let rays = rays(scene, &effort.rays)?;
    let count: usize = rays.iter().map(|(_, rays)| rays.len()).sum();
    let entry = |spec| {
        let subject = Spec::make(spec, Some(device), &scene.mesh).ok()?;
        Some(Entry { spec, subject, builds_ms: Vec::new(), work: RayWork::default() })
    };
    let mut entries: Vec<Entry<'_>> = specs.iter().filter_map(entry).collect();
    // A run is a build and all rays; candidates take turns, as everything that is compared does.
    let runs = in_turn(&mut entries, 1, effort.runs, |entry| {
        let is_first = entry.builds_ms.is_empty();
        // The first build may have waited for its kernels' code.
        if entry.builds_ms.len() < 2 || entry.builds_ms.iter().sum::<f64>() < effort.enough_ms {
            entry.builds_ms.push(entry.subject.build()?.milliseconds);
        }
        let mut trace_ms = 0.0;
        let mut work = Vec::new();
        for (query, rays) in rays.iter().filter(|(_, rays)| !rays.is_empty()) {
            entry.subject.set_rays(rays)?;
            trace_ms += entry.subject.trace(*query)?;
            if is_first {
                work.extend(entry.subject.work(*query)?.unwrap_or_default());
            }
        }
        if is_first {
            entry.work = RayWork::mean(&work);
        }
        Ok(trace_ms)
    });
    let measured = entries.iter().zip(runs).filter_map(|(entry, runs)| {
        Some(Measured {
            scene: scene.name.clone(),
            features,
            builder: entry.spec.to_string(),
            layout: entry.subject.kind().into(),
            build_ms: Spread::of(&entry.builds_ms)?.min,
            ray_ns: Spread::of(&runs.ok()?)?.min * 1e6 / count as f64,
            work: entry.work,
        })
    });
    Ok(measured.collect())
}

/// All kinds of rays together, by what they ask for.
fn rays(scene: &Scene, options: &RayOptions) -> Result<[(Query, Vec<Ray>); 2]> {
    let mesh = &scene.mesh;
    let tree = lbvh::build(&mesh.positions, &mesh.triangles, Code::Mc63.full(), Collapse::SAH);
    let mut hits = |rays: &[Ray]| Ok(rays.par_iter().map(|ray| host::closest_hit(&tree, ray)).collect());
    let mut all = [(Query::ClosestHit, Vec::new()), (Query::AnyHit, Vec::new())];
    for kind in RayKind::ALL {
        let rays = kinds::generate(kind, scene, options, &mut hits)?;
        all[usize::from(kind.query() == Query::AnyHit)].1.extend(rays);
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::choose::features::NAMES;

    #[test]
    fn every_figure_varies_over_the_scenes_and_no_two_go_together() {
        let scenes: Vec<Features> = SCENES.iter().map(|name| Features::of(&load(name).expect(name).mesh)).collect();
        let column = |k: usize| scenes.iter().map(move |f| f.values[k]);
        let mean = |k: usize| column(k).sum::<f64>() / scenes.len() as f64;
        let product =
            |j: usize, k: usize| -> f64 { column(j).zip(column(k)).map(|(a, b)| (a - mean(j)) * (b - mean(k))).sum() };
        for (j, one) in NAMES.iter().enumerate() {
            assert!(product(j, j) > 0.1, "{one} is nearly the same everywhere");
            for (k, other) in NAMES.iter().enumerate().take(j) {
                let correlation = product(j, k) / (product(j, j) * product(k, k)).sqrt();
                assert!(correlation.abs() < 0.97, "{one} and {other}: {correlation}");
            }
        }
        let most = scenes.iter().map(|f| f.triangles).max().expect("there are scenes");
        assert!(scenes.iter().all(|f| f.triangles >= 500) && most >= 80_000, "{scenes:?}");
    }
}
