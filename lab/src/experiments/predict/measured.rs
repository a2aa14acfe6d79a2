//! Trees of a scene, built and traced in turn: every tree by the same two tracers of ours, whoever built it.

use super::own::OwnCosts;
use super::record::{RaysRecord, TreeRecord};
use crate::Result;
use crate::device::Device;
use crate::experiments::bench::matrix::{LCV_RAYS, OnScene, leaf_count_variability};
use crate::measure::agreement::wrong_where_different;
use crate::measure::record::SCHEMA;
use crate::measure::{Failure, Spread, in_turn, mean_work, overlap};
use crate::rays::kinds::{self, RayKind, RayOptions};
use crate::scene::Scene;
use crate::subjects::Subject;
use crate::subjects::builders::Spec;
use crate::subjects::retraced::Retraced;
use crate::subjects::retraced::TreeTracer;
use crate::{Error, report};
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::layout::Bvh2;
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::{lbvh, quality};
use hedgerow::trace::twin::tracer;
use hedgerow::trace::{Hit, Ray};
use rayon::prelude::*;
use std::sync::Arc;

/// What a step and a test cost in static figures, as in the theses.
pub const COSTS: [f64; 2] = [3.0, 2.0];
/// A builder that has built for so long builds no more: what disturbs so long a time is small beside it.
const ENOUGH_MS: f64 = 3000.0;
/// Surfaces that the end-point overlap is taken from, at most.
const SURFACES: usize = 1 << 15;
/// Rays that differ between two trees of which brute force looks at, at most.
const DIFFERENCES: usize = 16;

/// What is measured on every scene.
#[derive(Debug, Clone)]
pub struct Plan {
    /// The builders; the first one's trees are the reference.
    pub builders: Vec<Spec>,
    /// Counted runs of every trace, and of every build that is not long.
    pub runs: u32,
    /// Kinds of rays.
    pub kinds: Vec<RayKind>,
    /// Their number and seed.
    pub rays: RayOptions,
}

/// A builder whose builds are timed.
struct Building<'a> {
    spec: &'a Spec,
    subject: Box<dyn Subject + 'a>,
    /// Of each build.
    milliseconds: Vec<f64>,
}

impl Building<'_> {
    fn build(&mut self) -> Result<()> {
        if self.milliseconds.iter().sum::<f64>() < ENOUGH_MS {
            self.milliseconds.push(self.subject.build()?.milliseconds);
        }
        Ok(())
    }

    /// Those of the builds that count: the first does where it is the only one.
    fn spread(&self) -> Result<Spread> {
        Spread::of_some(if self.milliseconds.len() > 1 { &self.milliseconds[1..] } else { &self.milliseconds })
    }
}

/// A tree and one of the tracers that take rays through it.
struct Traced<'a> {
    /// The number of its record.
    tree: usize,
    tracer: TreeTracer,
    subject: Retraced<'a>,
    /// The kind of the rays that it has.
    has: Option<RayKind>,
}

impl Traced<'_> {
    /// Milliseconds of tracing these rays; not those of bringing them there.
    fn trace(&mut self, kind: RayKind, rays: &[Ray]) -> Result<f64> {
        if self.has != Some(kind) {
            self.subject.set_rays(rays)?;
            self.has = Some(kind);
        }
        self.subject.trace(kind.query())
    }
}

/// The trees of one scene.
struct Trees<'a> {
    scene: &'a Scene,
    records: Vec<TreeRecord>,
    traced: Vec<Traced<'a>>,
    failures: Vec<Failure<OnScene>>,
}

/// Builds and traces every builder of `plan` on `scene`; `say` is called with what is being done.
///
/// # Errors
/// The scene has no triangles.
pub fn measure(
    scene: &Scene,
    device: Option<&Device>,
    plan: &Plan,
    say: &mut dyn FnMut(&str),
) -> Result<(Vec<TreeRecord>, Vec<Failure<OnScene>>)> {
    let mut trees = Trees { scene, records: Vec::new(), traced: Vec::new(), failures: Vec::new() };
    say("drawing the rays that teach");
    let own = OwnCosts::new(scene)?;
    say("building");
    for building in trees.built(device, plan) {
        say(&format!("measuring {}", report::short(&building.spec.to_string())));
        let (spec, reference) = (building.spec, &plan.builders[0]);
        if let Err(error) = trees.take(building, reference, &own, device) {
            trees.failures.push(OnScene::failure(&scene.name, Some(spec), error));
        }
    }
    let mesh = &scene.mesh;
    let truth = lbvh::build(&mesh.positions, &mesh.triangles, Code::Mc63.full(), Collapse::SAH);
    let closest = |rays: &[Ray]| rays.par_iter().map(|ray| tracer::closest_hit(&truth, ray)).collect::<Vec<Hit>>();
    let generate = |kind| kinds::generate(kind, scene, &plan.rays, &mut |rays| Ok(closest(rays)));
    say("counting leaves");
    trees.count_leaves(&generate(LCV_RAYS)?);
    for &kind in &plan.kinds {
        say(&format!("tracing {kind} rays"));
        // Where nothing is hit there is nothing to follow.
        let rays = generate(kind)?;
        if !rays.is_empty() {
            trees.trace(kind, &rays, plan.runs, &truth);
        }
    }
    Ok((trees.records, trees.failures))
}

impl<'a> Trees<'a> {
    fn fail(&mut self, tree: usize, error: impl ToString) {
        let at = OnScene { scene: self.scene.name.clone(), builder: Some(self.records[tree].builder.clone()) };
        self.failures.push(Failure { at, what: error.to_string() });
    }

    /// All builders, which have built in turn.
    fn built(&mut self, device: Option<&'a Device>, plan: &'a Plan) -> Vec<Building<'a>> {
        let mut all = Vec::new();
        for spec in &plan.builders {
            match spec.make_for(device, self.scene) {
                Ok(subject) => all.push(Building { spec, subject, milliseconds: Vec::new() }),
                Err(error) => self.failures.push(OnScene::failure(&self.scene.name, Some(spec), error)),
            }
        }
        let builds = in_turn(&mut all, 0, 1 + plan.runs, Building::build);
        let mut built = Vec::new();
        for (building, runs) in all.into_iter().zip(builds) {
            match runs {
                Ok(_) => built.push(building),
                Err(error) => self.failures.push(OnScene::failure(&self.scene.name, Some(building.spec), error)),
            }
        }
        built
    }

    /// The record of a tree before rays go through it, and its tracers; the builder goes.
    fn take(
        &mut self,
        mut building: Building<'a>,
        reference: &Spec,
        own: &OwnCosts,
        device: Option<&'a Device>,
    ) -> Result<()> {
        building.subject.validate()?;
        let tree = building.subject.tree()?.ok_or_else(|| {
            Error::Argument("the builder does not show its tree, so that our tracers have none; leave it out".into())
        })?;
        let [c_t, c_i] = COSTS;
        let record = TreeRecord {
            schema: SCHEMA,
            scene: self.scene.name.clone(),
            triangles: self.scene.mesh.triangles.len() as u64,
            builder: building.spec.to_string(),
            reference: reference.to_string(),
            build_ms: building.spread()?,
            timer: building.subject.timer().to_owned(),
            sah: quality::of(&tree, c_t, c_i).sah,
            epo: overlap::of_some_on_host(&tree, c_t, c_i, SURFACES),
            lcv: None,
            own: own.of(&tree, COSTS)?,
            host: Vec::new(),
            device: Vec::new(),
        };
        let (name, tree, number) = (record.builder.clone(), Arc::new(tree), self.records.len());
        let on = |device| Retraced::of_tree(&name, Arc::clone(&tree), device);
        let mut traced = vec![Traced { tree: number, tracer: TreeTracer::Host, subject: on(None)?, has: None }];
        if device.is_some() {
            traced.push(Traced { tree: number, tracer: TreeTracer::Device, subject: on(device)?, has: None });
        }
        self.records.push(record);
        self.traced.extend(traced);
        Ok(())
    }

    /// Leaf count variability of every tree.
    fn count_leaves(&mut self, rays: &[Ray]) {
        for traced in self.traced.iter_mut().filter(|traced| traced.tracer == TreeTracer::Host) {
            let counted = traced.subject.set_rays(rays).and_then(|()| traced.subject.work(LCV_RAYS.query()));
            // What fails here fails again where rays are traced, and is told there.
            let work = counted.ok().flatten();
            self.records[traced.tree].lcv = work.as_deref().and_then(leaf_count_variability);
        }
    }

    /// Traces rays of a kind through every tree, in turn, and checks what they hit.
    fn trace(&mut self, kind: RayKind, rays: &[Ray], runs: u32, truth: &Bvh2) {
        let query = kind.query();
        let mut traced = std::mem::take(&mut self.traced);
        let times = in_turn(&mut traced, 1, runs, |traced| traced.trace(kind, rays));
        let expected: Vec<Hit> = rays.par_iter().map(|ray| tracer::trace(truth, ray, query).0).collect();
        for (traced, times) in traced.iter_mut().zip(times) {
            let figures = times.and_then(|times| {
                let hits = traced.subject.hits()?;
                let wrong = wrong_where_different(truth, rays, query, (&hits, &expected), DIFFERENCES);
                if wrong > 0 {
                    let what =
                        format!("{wrong} {kind} rays, on the {}, are wrong by brute force", traced.tracer.name());
                    return Err(Error::Malformed(what));
                }
                let work = traced.subject.work(query)?.unwrap_or_default();
                let per_ray: Vec<f64> = times.iter().map(|ms| ms * 1e6 / rays.len() as f64).collect();
                Ok(RaysRecord {
                    rays: kind.to_string(),
                    count: rays.len() as u64,
                    ns: Spread::of_some(&per_ray)?,
                    steps: mean_work(&work, |work| work.steps).unwrap_or_default(),
                    tests: mean_work(&work, |work| work.tests).unwrap_or_default(),
                })
            });
            match (figures, traced.tracer) {
                (Ok(figures), TreeTracer::Host) => self.records[traced.tree].host.push(figures),
                (Ok(figures), TreeTracer::Device) => self.records[traced.tree].device.push(figures),
                (Err(error), _) => self.fail(traced.tree, error),
            }
        }
        self.traced = traced;
    }
}
