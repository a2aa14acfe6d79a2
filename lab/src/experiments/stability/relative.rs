//! A scene that stays, and builders on it with more and more beside it: clipped costs, and speeds of the rays of what stays.

use super::clipped;
use super::points::{Experiment, Stretched};
use crate::device::Device;
use crate::measure::agreement::wrong_where_different;
use crate::measure::{Failure, Sink, Spread, in_turn, ratios};
use crate::rays::kinds::{self, RayKind, RayOptions};
use crate::scene::{Mesh, Scene};
use crate::subjects::Subject;
use crate::subjects::builders::Spec;
use crate::{Error, Result};
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::layout::Bvh2;
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::lbvh;
use hedgerow::geometry::Aabb;
use hedgerow::trace::twin::tracer as host;
use hedgerow::trace::{Hit, Ray};
use rayon::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::collections::BTreeMap;
use std::fmt;

/// Costs of a traversal step and of a triangle test, those of the theses.
const COSTS: (f64, f64) = (3.0, 2.0);
/// Runs that do not count, before those that do.
const WARM_UPS: u32 = 1;
/// Of the speed at e = 0, what is no longer worth measuring on: the rays would soon take hours.
const LOST: f64 = 0.05;
/// Rays that differ between two trees of which brute force looks at, at most.
const DIFFERENCES: usize = 16;

/// What growth and large primitives have in common.
pub struct RelativeSetup<'a> {
    /// Where builders that need a device run.
    pub device: Option<&'a Device>,
    /// The builders.
    pub builders: &'a [Spec],
    /// Counted runs of every trace, in turn, after one that warms up.
    pub runs: u32,
    /// Kinds of rays; none to measure costs alone.
    pub kinds: &'a [RayKind],
    /// Their number and seed.
    pub rays: RayOptions,
    /// Is called with what is being done, for a progress bar.
    pub say: &'a dyn Fn(&str),
}

/// The scene that stays, with rays of it.
struct Part<'s> {
    /// The scene.
    scene: &'s Scene,
    /// Its bounds.
    bounds: Aabb,
    rays: Vec<(RayKind, Vec<Ray>)>,
}

impl<'s> Part<'s> {
    /// Makes the rays of every kind of the stage, on the host; kinds without any are left out.
    ///
    /// # Errors
    /// The scene has no triangles.
    fn new(stage: &RelativeSetup<'_>, scene: &'s Scene) -> Result<Part<'s>> {
        let tree = tree_of(&scene.mesh);
        let mut hits = |rays: &[Ray]| Ok(rays.par_iter().map(|ray| host::closest_hit(&tree, ray)).collect());
        let mut rays = Vec::new();
        for &kind in stage.kinds {
            let of_kind = kinds::generate(kind, scene, &stage.rays, &mut hits)?;
            if !of_kind.is_empty() {
                rays.push((kind, of_kind));
            }
        }
        Ok(Part { scene, bounds: scene.mesh.bounds(), rays })
    }

    /// The scene with these triangles behind its own.
    fn with(&self, triangles: &[[[f32; 3]; 3]]) -> Mesh {
        let mut mesh = self.scene.mesh.clone();
        for corners in triangles {
            let first = mesh.positions.len() as u32;
            mesh.positions.extend(corners);
            mesh.triangles.push([first, first + 1, first + 2]);
        }
        mesh
    }
}

fn tree_of(mesh: &Mesh) -> Bvh2 {
    lbvh::build(&mesh.positions, &mesh.triangles, Code::Mc63.full(), Collapse::SAH)
}

/// What stretches the bounds of a scene from beside it, the farther the greater e is.
pub trait Stretch: Copy + PartialEq + fmt::Display + Serialize + DeserializeOwned {
    /// What its points are of.
    const EXPERIMENT: Experiment;
    /// What it is, for messages.
    const WHAT: &'static str;
    /// Its triangles beside a scene of these bounds; `None` where they have no place among the floats.
    fn beside(&self, bounds: &Aabb, e: u32) -> Option<Vec<[[f32; 3]; 3]>>;
}

/// Measures one scene with every builder, stretched in each way by each e, 0 first, which the others are compared with. What fails
/// goes to `failed`, and the rest goes on. Gives what a reader must know beside: the points that floats cannot hold.
///
/// # Errors
/// The scene has no triangles; those of `point`.
pub fn measure<S: Stretch>(
    stage: &RelativeSetup<'_>,
    scene: &Scene,
    (stretches, steps): (&[S], &[u32]),
    failed: &mut dyn FnMut(Failure),
    point: &mut Sink<'_, Stretched<S>>,
) -> Result<Vec<String>> {
    let part = Part::new(stage, scene)?;
    let mut notes = Vec::new();
    for &by in stretches {
        let mesh = |&e: &u32| Some((e, part.with(&by.beside(&part.bounds, e)?)));
        let meshes: Vec<(u32, Mesh)> = steps.iter().map_while(mesh).collect();
        if let Some(e) = steps.get(meshes.len()) {
            notes.push(format!(
                "{}, {by}: from e = {e} on {} would lie beyond the largest float; these points are left out.",
                scene.name,
                S::WHAT
            ));
        }
        measure_one(stage, &part, by, &meshes, failed, point)?;
    }
    Ok(notes)
}

/// One stretch: every builder over all its meshes.
fn measure_one<S: Stretch>(
    stage: &RelativeSetup<'_>,
    part: &Part<'_>,
    by: S,
    meshes: &[(u32, Mesh)],
    failed: &mut dyn FnMut(Failure),
    point: &mut Sink<'_, Stretched<S>>,
) -> Result<()> {
    let Some((_, first)) = meshes.first() else { return Ok(()) };
    let truth = tree_of(first);
    for spec in stage.builders {
        let of = format!("{}, {by}, {spec}", part.scene.name);
        let mut base = match Base::new(stage, part, spec, first, &truth) {
            Ok(base) => base,
            Err(error) => {
                failed(Failure::named(of, error));
                continue;
            }
        };
        for (e, mesh) in meshes {
            let of = format!("{of}, e = {e}");
            (stage.say)(&of);
            match base.against(stage, spec, mesh) {
                Ok((cost, relative_mrays, faults)) => {
                    let over_base = cost.zip(base.cost).map(|(cost, base)| cost / base);
                    faults.into_iter().for_each(|what| failed(Failure::named(&of, what)));
                    point(Stretched {
                        experiment: S::EXPERIMENT,
                        scene: part.scene.name.clone(),
                        builder: spec.to_string(),
                        by,
                        e: *e,
                        cost: (S::EXPERIMENT == Experiment::Large).then_some(cost),
                        relative_cost: over_base.filter(|cost| cost.is_finite()),
                        relative_mrays,
                    })?;
                }
                Err(error) => failed(Failure::named(of, error)),
            }
        }
    }
    Ok(())
}

/// What a builder gave at one point: cost, relative speeds, faults.
type Figures = (Option<f64>, BTreeMap<String, f64>, Vec<String>);

/// A builder on the first mesh of a series.
struct Base<'a> {
    part: &'a Part<'a>,
    subject: Box<dyn Subject + 'a>,
    cost: Option<f64>,
    truth: &'a Bvh2,
    /// Kinds of rays that are lost, and no longer measured.
    lost: Vec<RayKind>,
}

impl<'a> Base<'a> {
    fn new(
        stage: &RelativeSetup<'a>,
        part: &'a Part<'a>,
        spec: &Spec,
        mesh: &'a Mesh,
        truth: &'a Bvh2,
    ) -> Result<Base<'a>> {
        let (subject, cost, _) = built(stage, part, spec, mesh)?;
        Ok(Base { part, subject, cost, truth, lost: Vec::new() })
    }

    /// Of another mesh the cost, the speeds over those of this one by kind of ray (without those that had fallen below a twentieth
    /// before), and what is wrong with its tree or hits.
    fn against(&mut self, stage: &RelativeSetup<'_>, spec: &Spec, mesh: &Mesh) -> Result<Figures> {
        let (mut subject, cost, mut faults) = built(stage, self.part, spec, mesh)?;
        let mut relative_mrays = BTreeMap::new();
        for (kind, rays) in &self.part.rays {
            if self.lost.contains(kind) {
                continue;
            }
            let speed = self.speed(stage, subject.as_mut(), *kind, rays)?;
            relative_mrays.insert(kind.name().to_owned(), speed);
            if speed < LOST {
                self.lost.push(*kind);
            }
            let wrong = self.wrong(subject.as_mut(), *kind, rays)?;
            if wrong > 0 {
                faults.push(format!("{wrong} {kind} rays differ from e = 0 and are wrong by brute force"));
            }
        }
        Ok((cost, relative_mrays, faults))
    }

    /// Speed of the rays through the other over that through the first, in the median of runs in turn.
    fn speed(
        &mut self,
        stage: &RelativeSetup<'_>,
        other: &mut dyn Subject,
        kind: RayKind,
        rays: &[Ray],
    ) -> Result<f64> {
        let mut subjects: [&mut dyn Subject; 2] = [self.subject.as_mut(), other];
        for subject in &mut subjects {
            subject.set_rays(rays)?;
        }
        let times = in_turn(&mut subjects, WARM_UPS, stage.runs, |subject| subject.trace(kind.query()));
        let times: Vec<Vec<f64>> = times.into_iter().collect::<Result<_>>()?;
        Ok(Spread::of_some(&ratios(&times[0], &times[1]))?.median)
    }

    /// Rays that meet another triangle of the part than through the first tree, and are wrong by brute force.
    fn wrong(&mut self, other: &mut dyn Subject, kind: RayKind, rays: &[Ray]) -> Result<usize> {
        let own = self.part.scene.mesh.triangles.len() as u32;
        let is_beside = |hit: &Hit| hit.is_some() && hit.primitive >= own;
        let (expected, found) = (self.subject.hits()?, other.hits()?);
        if expected.len() != rays.len() || found.len() != rays.len() {
            return Err(Error::Argument(format!("{} rays, but {} hits", rays.len(), found.len())));
        }
        // What is beside the part stands elsewhere at every point: rays that meet it tell nothing.
        let compared: Vec<usize> =
            (0..rays.len()).filter(|&i| !is_beside(&expected[i]) && !is_beside(&found[i])).collect();
        let of = |hits: &[Hit]| -> Vec<Hit> { compared.iter().map(|&i| hits[i]).collect() };
        let rays: Vec<Ray> = compared.iter().map(|&i| rays[i]).collect();
        Ok(wrong_where_different(self.truth, &rays, kind.query(), (&of(&found), &of(&expected)), DIFFERENCES))
    }
}

/// A structure, its cost where it gives its tree, and what is wrong with that.
type BuiltSubject<'a> = (Box<dyn Subject + 'a>, Option<f64>, Vec<String>);

/// A builder's structure of a mesh, with its [`clipped::cost`] where it gives its tree, and what is wrong with that.
fn built<'a>(stage: &RelativeSetup<'a>, part: &Part<'_>, spec: &Spec, mesh: &'a Mesh) -> Result<BuiltSubject<'a>> {
    let mut subject = spec.make(stage.device, mesh)?;
    subject.build()?;
    let Some(tree) = subject.tree()? else { return Ok((subject, None, Vec::new())) };
    let faults = tree.validate().err().map(|error| error.to_string());
    Ok((subject, clipped::cost(&tree, &part.bounds, COSTS.0, COSTS.1), faults.into_iter().collect()))
}
