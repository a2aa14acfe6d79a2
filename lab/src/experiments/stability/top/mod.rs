//! Growth on a top level, as Riemersma 2024, section 4.3, runs it: instances stay, others are far away, and a frame is a build and its
//! rays. A far instance's box is that of the far triangle ([`super::far`]).

pub(crate) mod command;
pub mod points;

use super::clipped;
use super::far::{FarTriangle, Side};
use super::points::Experiment;
use crate::Result;
use crate::device::Device;
use crate::measure::agreement::may_both_be_right;
use crate::measure::{Failure, Sink, Spread, in_turn, ratios};
use crate::random::SplitMix64;
use crate::rays::kinds::{self, RayKind, RayOptions};
use crate::scene::{Instances, Mesh, Scene, SceneInstance};
use crate::subjects::device_rays::RayBuffers;
use crate::subjects::levels::Levels;
use crate::subjects::queries::{MeanWork, Queries};
use crate::subjects::structures::Structures;
use hedgerow::accel::Tree;
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::lbvh;
use hedgerow::geometry::Aabb;
use hedgerow::trace::twin::tracer;
use hedgerow::trace::{Hit, Query, Ray};
use points::{FarInstances, FarSides, TopBuilder, TopGrowth};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Costs of a traversal step and of an instance: what a triangle costs in the experiment over bottom levels.
pub const COSTS: (f64, f64) = (3.0, 2.0);
/// Runs that do not count, before those that do.
const WARM_UPS: u32 = 1;

/// What is the same at all points.
pub struct TopGrowthSetup<'a> {
    /// Where they run.
    pub device: &'a Device,
    /// Counted runs of builds and traces, in turn with e = 0, after one that warms up.
    pub runs: u32,
    /// Kinds of rays; none to measure builds and costs alone.
    pub kinds: &'a [RayKind],
    /// Their number and seed, which sides are drawn by, too.
    pub rays: RayOptions,
    /// Is called with what is being done, for a progress bar.
    pub say: &'a dyn Fn(&str),
}

/// Measures one scene with every builder, and everything far by each e, 0 first. What fails goes to `failed`, and the rest goes on. Gives
/// what a reader must know beside: the points that floats cannot hold.
///
/// # Errors
/// The scene has no triangles or too many; those of `point`.
pub fn measure(
    stage: &TopGrowthSetup<'_>,
    scene: &Instances,
    builders: &[TopBuilder],
    (fars, steps): (&[FarInstances], &[u32]),
    failed: &mut dyn FnMut(Failure),
    point: &mut Sink<'_, TopGrowth>,
) -> Result<Vec<String>> {
    let part = Part::new(stage, scene)?;
    let mut notes = Vec::new();
    for &by in fars {
        let grown: Vec<(u32, Vec<SceneInstance>)> =
            steps.iter().map_while(|&e| Some((e, part.placed(stage, by, e)?))).collect();
        if let Some(e) = steps.get(grown.len()) {
            notes.push(format!(
                "{}, {by}: from e = {e} on the far instances would lie beyond the largest float; these points are left out.",
                scene.name
            ));
        }
        for builder in builders {
            let of = format!("{}, {by}, {builder}", scene.name);
            if let Err(error) = measure_one(stage, &part, (*builder, by), &grown, &of, failed, point) {
                failed(Failure::named(of, error));
            }
        }
    }
    Ok(notes)
}

/// What stays, with rays of it and what they hit.
struct Part<'s, 'a> {
    scene: &'s Instances,
    bounds: Aabb,
    rays: Vec<TracedKind<'a>>,
}

struct TracedKind<'a> {
    kind: RayKind,
    rays: Vec<Ray>,
    buffers: RayBuffers<'a>,
    truth: Vec<Hit>,
}

impl<'s, 'a> Part<'s, 'a> {
    fn new(stage: &TopGrowthSetup<'a>, scene: &'s Instances) -> Result<Part<'s, 'a>> {
        let flat = Scene {
            name: scene.name.clone(),
            mesh: scene.flatten()?,
            camera: scene.camera,
            lights: scene.lights.clone(),
        };
        let tree = lbvh::build(&flat.mesh.positions, &flat.mesh.triangles, Code::Mc63.full(), Collapse::SAH);
        let hits = |rays: &[Ray]| -> Vec<Hit> { rays.par_iter().map(|ray| tracer::closest_hit(&tree, ray)).collect() };
        let mut all = Vec::new();
        for &kind in stage.kinds {
            let rays = kinds::generate(kind, &flat, &stage.rays, &mut |rays| Ok(hits(rays)))?;
            if !rays.is_empty() {
                let truth = hits(&rays);
                all.push(TracedKind { kind, buffers: RayBuffers::new(stage.device, &rays)?, rays, truth });
            }
        }
        Ok(Part { scene, bounds: flat.mesh.bounds(), rays: all })
    }

    /// What is far at an e; `None` where it has no place among the floats. Its part is the last.
    fn placed(&self, stage: &TopGrowthSetup<'_>, by: FarInstances, e: u32) -> Option<Vec<SceneInstance>> {
        let mut random = SplitMix64::new(stage.rays.seed);
        let mut drawn = || if random.bits() >> 63 == 0 { Side::Positive } else { Side::Negative };
        let place = |_| {
            let side = match by.sides {
                FarSides::Positive => Side::Positive,
                FarSides::Negative => Side::Negative,
                FarSides::Drawn => drawn(),
            };
            let far = FarTriangle { axes: by.axes, side }.bounds(&self.bounds, e)?;
            let row = |axis: usize| {
                let mut row = [0.0; 4];
                (row[axis], row[3]) = (far.hi[axis] - far.lo[axis], far.lo[axis]);
                row
            };
            Some(SceneInstance { part: self.scene.parts.len() as u32, transform: [0, 1, 2].map(row) })
        };
        (0..by.far).map(place).collect()
    }

    /// The scene with these behind its own.
    fn with(&self, far: &[SceneInstance]) -> Instances {
        let mut scene = self.scene.clone();
        scene.parts.push(unit_cube());
        scene.instances.extend(far);
        scene
    }
}

/// What is placed far away: something that can be opened.
fn unit_cube() -> Mesh {
    let corner = |i: u32| [0, 1, 2].map(|axis| (i >> axis & 1) as f32);
    // The faces by the axis that they stand on, as two triangles each.
    let face = |axis: u32, at: u32| {
        let (u, v) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
        let o = at << axis;
        [[o, o + u, o + u + v], [o, o + u + v, o + v]]
    };
    Mesh {
        positions: (0..8).map(corner).collect(),
        triangles: (0..3).flat_map(|axis| [face(axis, 0), face(axis, 1)]).flatten().collect(),
    }
}

/// One builder with what is far in one manner, at every e.
fn measure_one(
    stage: &TopGrowthSetup<'_>,
    part: &Part<'_, '_>,
    (builder, by): (TopBuilder, FarInstances),
    grown: &[(u32, Vec<SceneInstance>)],
    of: &str,
    failed: &mut dyn FnMut(Failure),
    point: &mut Sink<'_, TopGrowth>,
) -> Result<()> {
    let Some((_, first)) = grown.first() else { return Ok(()) };
    let scene = part.with(first);
    let structures = Structures::ours(stage.device, builder.options());
    let levels = || Levels::new(structures.clone(), &scene, builder.flags());
    // The one stays as at e = 0, the other's far instances move.
    let mut levels = [levels()?, levels()?];
    let mut base_cost = None;
    for (e, far) in grown {
        (stage.say)(&format!("{of}, e = {e}"));
        levels[1].place(scene.instances.iter().take(scene.instances.len() - far.len()).chain(far).map(|i| i.transform));
        let builds = in_turn(&mut levels, WARM_UPS, stage.runs, Levels::build);
        let builds: Vec<Vec<f64>> = builds.into_iter().collect::<Result<_>>()?;
        let tree = levels[1].top_tree()?;
        if let Err(error) = tree.validate() {
            failed(Failure::named(format!("{of}, e = {e}"), error));
        }
        let cost = match &tree {
            Tree::OfTwo(tree) => clipped::cost(tree, &part.bounds, COSTS.0, COSTS.1),
            Tree::OfEight(tree) => clipped::cost_of_eight(tree, &part.bounds, COSTS.0, COSTS.1),
        };
        base_cost = base_cost.or(cost);
        let [mut frame, mut base_frame] =
            [Spread::of_some(&builds[1])?, Spread::of_some(&builds[0])?].map(|s| s.median);
        let mut relative_mrays = BTreeMap::new();
        let mut work = BTreeMap::new();
        let mut relative_work = BTreeMap::new();
        for traced in &part.rays {
            let query = traced.kind.query();
            let times = in_turn(&mut levels, WARM_UPS, stage.runs, |levels| {
                levels.trace(&traced.buffers, query, Queries::OneEach)
            });
            let times: Vec<Vec<f64>> = times.into_iter().collect::<Result<_>>()?;
            frame += Spread::of_some(&times[1])?.median;
            base_frame += Spread::of_some(&times[0])?.median;
            relative_mrays.insert(traced.kind.name().to_owned(), Spread::of_some(&ratios(&times[0], &times[1]))?);
            let works = levels.iter_mut().map(|levels| Ok(MeanWork::mean(&levels.work(&traced.buffers, query)?)));
            let works: Vec<MeanWork> = works.collect::<Result<_>>()?;
            work.insert(traced.kind.name().to_owned(), works[1]);
            relative_work.insert(traced.kind.name().to_owned(), works[1].all() / works[0].all());
            // The other was traced last: its hits are there.
            let wrong = traced.wrong(query);
            if wrong > 0 {
                failed(Failure::named(
                    format!("{of}, e = {e}"),
                    format!("{wrong} {} rays miss what they hit", traced.kind),
                ));
            }
        }
        let has_rays = !part.rays.is_empty();
        point(TopGrowth {
            experiment: Experiment::GrowthTop,
            scene: part.scene.name.clone(),
            instances: part.scene.instances.len() as u32,
            builder,
            by,
            e: *e,
            code_bits: tree.header().code_bits,
            entries: tree.header().active,
            cost: cost.filter(|cost| cost.is_finite()),
            relative_cost: cost.zip(base_cost).map(|(cost, base)| cost / base).filter(|cost| cost.is_finite()),
            build_ms: Spread::of_some(&builds[1])?,
            relative_build: Spread::of_some(&ratios(&builds[1], &builds[0]))?,
            relative_mrays,
            work,
            relative_work,
            frame_ms: has_rays.then_some(frame),
            relative_frame: has_rays.then_some(frame / base_frame),
        })?;
    }
    Ok(())
}

impl TracedKind<'_> {
    /// Rays of the last trace that have not hit what stays where they must: they may have hit something far before it, and nothing
    /// behind it.
    fn wrong(&self, query: Query) -> usize {
        let found = self.buffers.read_hits();
        let is_wrong = |(ray, (found, truth)): (&Ray, (&Hit, &Hit))| {
            let may_be_before = found.is_some() && (query == Query::AnyHit || found.t < truth.t);
            truth.is_some() && !may_be_before && !may_both_be_right(query, ray, found, truth)
        };
        self.rays.iter().zip(found.iter().zip(&self.truth)).filter(|&pair| is_wrong(pair)).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cube_has_six_faces_of_two_triangles_and_its_boxes() {
        let cube = unit_cube();
        assert_eq!(cube.bounds(), Aabb { lo: [0.0; 3], hi: [1.0; 3] });
        assert_eq!(cube.triangles.len(), 12);
        let mut area = 0.0;
        for triangle in &cube.triangles {
            let [a, b, c] = triangle.map(|i| cube.positions[i as usize]);
            let [p, q]: [[f32; 3]; 2] = [b, c].map(|to| std::array::from_fn(|i| to[i] - a[i]));
            let cross = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
            area += 0.5 * cross.iter().map(|x| x * x).sum::<f32>().sqrt();
        }
        assert_eq!(area, 6.0);
    }
}
