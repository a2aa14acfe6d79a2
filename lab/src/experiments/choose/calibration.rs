//! The measured costs of every candidate on this device: a few generated scenes of each size, built and traced.

use super::{Cost, CostRow, CostTable, SceneClass, candidates};
use crate::device::Device;
use crate::measure::statistics::{Spread, geometric_mean, in_turn};
use crate::random::SplitMix64;
use crate::rays::kinds::{self, RayKind, RayOptions};
use crate::scene::{self, LoadOptions, Scene};
use crate::subjects::Subject;
use crate::subjects::builders::Spec;
use crate::{Error, Result};
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::lbvh;
use hedgerow::trace::twin::tracer as host;
use hedgerow::trace::{Query, Ray, Work};
use rayon::prelude::*;

/// The scenes of each row of the table: of about the same size, and lying differently in their bounds (closed objects, sheets,
/// soups, long thin triangles, a few large ones around many small ones, towns, plants). The last rows are of crowded scenes: an
/// object in a huge arena.
const ROWS: [&[&str]; 6] = [
    &["gen:icosphere:3", "gen:needles:1500:1"],
    &["gen:soup:3000:1", "gen:grid:60", "gen:clutter:24:1"],
    &[
        "gen:forest:20",
        "gen:cells:40",
        "gen:twist:20000:1",
        "gen:clutter:60:2",
        "gen:grid:120",
        "gen:soup:30000:2",
        "gen:clutter:100:3",
    ],
    &["gen:clutter:150:4", "gen:city:60", "gen:icosphere:6", "gen:clutter:240:5"],
    &["gen:stadium:5"],
    &["gen:stadium:6"],
];

/// How much the calibration measures.
const EFFORT: Effort = Effort { rays: RayOptions { size: [128, 96], seed: 1 }, runs: 5, enough_ms: 50.0 };

/// Measures the candidates that `device` can build on generated scenes. `say` is called with what is being done. A candidate
/// that fails on a scene is not in the scene's row.
///
/// # Errors
/// The device can build no candidate.
pub fn measure(device: &Device, say: &mut dyn FnMut(&str)) -> Result<CostTable> {
    if candidates::possible(device).is_empty() {
        return Err(Error::NoVulkan(format!("{} can build none of the candidates of auto", device.found().name)));
    }
    let mut of_scene = |name: &&str| {
        say(&format!("calibrating on {name}"));
        let scene = load(name)?;
        let class = SceneClass::of(&scene.mesh);
        let measured = on_scene(device, &scene, &candidates::possible_for(device, &class), &EFFORT)?;
        Ok(CostRow { class, costs: paced(&measured) })
    };
    let mut of_row = |names: &&[&str]| {
        let scenes: Vec<CostRow> = names.iter().map(&mut of_scene).collect::<Result<_>>()?;
        Ok(CostRow::mean(&scenes))
    };
    Ok(CostTable { rows: ROWS.iter().map(&mut of_row).collect::<Result<_>>()? })
}

/// A generated scene, its triangles in any order: those of generators lie side by side in space, so that it would not show where
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
    /// A builder that has built twice, and for this many milliseconds, builds no more: what disturbs so long a time is small
    /// beside it.
    pub enough_ms: f64,
}

/// What a candidate took on a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct CandidateRun {
    /// Its times.
    pub cost: Cost,
    /// The layout of its tree: `bvh2`, `wide8q`…
    pub layout: &'static str,
    /// Nodes visited and triangles tested by a ray, in the mean.
    pub work: f64,
}

/// The times with those of rays by work: what a node or a triangle takes in the mean over trees of the same layout, times how
/// many a ray meets. Work is counted and the same on every run. It tells trees apart that are nearer to each other than two
/// runs are.
fn paced(measured: &[CandidateRun]) -> Vec<Cost> {
    let cost = |m: &CandidateRun| {
        let alike = measured.iter().filter(|other| other.layout == m.layout);
        let pace = geometric_mean(alike.map(|other| other.cost.ray_ns / other.work));
        Cost { ray_ns: pace.map_or(m.cost.ray_ns, |pace| pace * m.work), ..m.cost.clone() }
    };
    measured.iter().map(cost).collect()
}

/// A candidate on a scene.
struct Entry<'a> {
    spec: &'a Spec,
    subject: Box<dyn Subject + 'a>,
    builds_ms: Vec<f64>,
    work: f64,
}

/// The least times of builders on a scene, over several runs in turn: what disturbs a run only adds to it. One that fails has none.
///
/// # Errors
/// The scene has no triangles, or the image of the rays too many pixels.
pub fn on_scene(device: &Device, scene: &Scene, specs: &[Spec], effort: &Effort) -> Result<Vec<CandidateRun>> {
    let rays = rays(scene, &effort.rays)?;
    let count: usize = rays.iter().map(|(_, rays)| rays.len()).sum();
    let entry = |spec| {
        let subject = Spec::make(spec, Some(device), &scene.mesh).ok()?;
        Some(Entry { spec, subject, builds_ms: Vec::new(), work: 0.0 })
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
        for (query, rays) in rays.iter().filter(|(_, rays)| !rays.is_empty()) {
            entry.subject.set_rays(rays)?;
            trace_ms += entry.subject.trace(*query)?;
            if is_first {
                let work = entry.subject.work(*query)?.unwrap_or_default();
                entry.work += work.iter().map(|Work { steps, tests, .. }| f64::from(steps + tests)).sum::<f64>();
            }
        }
        Ok(trace_ms)
    });
    let measured = entries.iter().zip(runs).filter_map(|(entry, runs)| {
        let build_ms = Spread::of(&entry.builds_ms)?.min;
        let ray_ns = Spread::of(&runs.ok()?)?.min * 1e6 / count as f64;
        let cost = Cost { builder: entry.spec.to_string(), build_ms, ray_ns };
        Some(CandidateRun { cost, layout: entry.subject.kind(), work: entry.work / count as f64 })
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

    #[test]
    fn trees_of_a_layout_are_told_apart_by_their_work() {
        let measured = |builder: &str, layout, ray_ns, work| {
            let cost = Cost { builder: builder.into(), build_ms: 1.0, ray_ns };
            CandidateRun { cost, layout, work }
        };
        // The second was disturbed: it does less and took as long. 10 and 40 ns a node, 20 in the mean.
        let paced = paced(&[
            measured("a", "wide8q", 100.0, 10.0),
            measured("b", "wide8q", 100.0, 2.5),
            measured("c", "bvh2", 70.0, 35.0),
        ]);
        for (cost, expected) in paced.iter().zip([200.0, 50.0, 70.0]) {
            assert!((cost.ray_ns - expected).abs() < 1e-9, "{cost:?}");
        }
        assert_eq!(paced.len(), 3);
    }

    #[test]
    fn rows_hold_scenes_of_one_kind_and_grow() {
        let class = |name: &&str| SceneClass::of(&load(name).expect(name).mesh);
        let rows: Vec<Vec<SceneClass>> = ROWS.iter().map(|names| names.iter().map(class).collect()).collect();
        let (crowded, plain): (Vec<_>, Vec<_>) = rows.iter().partition(|row| row[0].is_crowded);
        assert!(!plain.is_empty() && !crowded.is_empty());
        for rows in [plain, crowded] {
            assert!(rows.iter().flat_map(|row| row.iter()).all(|class| class.is_crowded == rows[0][0].is_crowded));
            let least = |row: &[SceneClass]| row.iter().map(|class| class.triangles).min();
            let most = |row: &[SceneClass]| row.iter().map(|class| class.triangles).max();
            assert!(rows.windows(2).all(|pair| most(pair[0]) < least(pair[1])), "{rows:?}");
        }
    }
}
