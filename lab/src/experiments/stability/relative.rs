//! A scene that stays, and builders on it with more and more beside it: clipped costs, and speeds of the rays of what stays.

use super::clipped;
use super::points::Failure;
use crate::device::Device;
use crate::measure::agreement::wrong_where_different;
use crate::measure::statistics::{Spread, in_turn, ratios};
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
use std::collections::BTreeMap;

/// Costs of a traversal step and of a triangle test, those of the theses.
const COSTS: (f64, f64) = (3.0, 2.0);
/// Runs that do not count, before those that do.
const WARM_UPS: u32 = 1;
/// Of the speed at e = 0, what is no longer worth measuring on: the rays would soon take hours.
const LOST: f64 = 0.05;
/// Rays that differ between two trees of which brute force looks at, at most.
const DIFFERENCES: usize = 16;

/// What growth and large primitives have in common.
pub struct Stage<'a> {
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
    /// Is told what is being done, for a progress bar.
    pub say: &'a dyn Fn(&str),
}

/// The scene that stays, with rays of it.
pub struct Part<'s> {
    /// The scene.
    pub scene: &'s Scene,
    /// Its bounds.
    pub bounds: Aabb,
    rays: Vec<(RayKind, Vec<Ray>)>,
}

impl<'s> Part<'s> {
    /// Makes the rays of every kind of the stage, on the host; kinds without any are left out.
    ///
    /// # Errors
    /// The scene has no triangles.
    pub fn new(stage: &Stage<'_>, scene: &'s Scene) -> Result<Part<'s>> {
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
    pub fn with(&self, triangles: &[[[f32; 3]; 3]]) -> Mesh {
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

/// What a builder gave at one point.
#[derive(Debug, Clone, PartialEq)]
pub struct Figures {
    /// [`clipped::cost`]; `None` where the builder does not give its tree.
    pub cost: Option<f64>,
    /// The same over that of the first point.
    pub relative_cost: Option<f64>,
    /// Speeds over those of the first point, by kind of ray; without those that had fallen below a twentieth before.
    pub relative_mrays: BTreeMap<String, f64>,
}

/// The meshes of a series: the first is what the others are compared with.
pub struct Series<'m> {
    /// What the series is of, for messages.
    pub name: String,
    /// e, and the part with what is beside it.
    pub meshes: &'m [(u32, Mesh)],
}

/// Measures every builder over a series; what fails goes to `failed`, and the rest goes on.
///
/// # Errors
/// Those of `point`, which is given the builder, e and its figures.
pub fn measure(
    stage: &Stage<'_>,
    part: &Part<'_>,
    series: &Series<'_>,
    failed: &mut dyn FnMut(Failure),
    point: &mut dyn FnMut(&Spec, u32, Figures) -> Result<()>,
) -> Result<()> {
    let Some((_, first)) = series.meshes.first() else { return Ok(()) };
    let truth = tree_of(first);
    for spec in stage.builders {
        let of = |e: Option<u32>| {
            let at = e.map_or(String::new(), |e| format!(", e = {e}"));
            format!("{}, {}, {spec}{at}", part.scene.name, series.name)
        };
        let mut base = match Base::new(stage, part, spec, first, &truth) {
            Ok(base) => base,
            Err(error) => {
                failed(Failure { of: of(None), what: error.to_string() });
                continue;
            }
        };
        for (e, mesh) in series.meshes {
            (stage.say)(&of(Some(*e)));
            match base.against(stage, spec, mesh) {
                Ok((figures, faults)) => {
                    faults.into_iter().for_each(|what| failed(Failure { of: of(Some(*e)), what }));
                    point(spec, *e, figures)?;
                }
                Err(error) => failed(Failure { of: of(Some(*e)), what: error.to_string() }),
            }
        }
    }
    Ok(())
}

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
    fn new(stage: &Stage<'a>, part: &'a Part<'a>, spec: &Spec, mesh: &'a Mesh, truth: &'a Bvh2) -> Result<Base<'a>> {
        let mut subject = spec.make(stage.device, mesh)?;
        subject.build()?;
        let (cost, _) = cost_of(subject.as_mut(), part)?;
        Ok(Base { part, subject, cost, truth, lost: Vec::new() })
    }

    /// The figures of another mesh, and what is wrong with its tree or hits.
    fn against(&mut self, stage: &Stage<'_>, spec: &Spec, mesh: &Mesh) -> Result<(Figures, Vec<String>)> {
        let mut subject = spec.make(stage.device, mesh)?;
        subject.build()?;
        let (cost, mut faults) = cost_of(subject.as_mut(), self.part)?;
        let relative_cost = cost.zip(self.cost).map(|(cost, base)| cost / base).filter(|cost| cost.is_finite());
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
        Ok((Figures { cost, relative_cost, relative_mrays }, faults))
    }

    /// Speed of the rays through the other over that through the first, in the median of runs in turn.
    fn speed(&mut self, stage: &Stage<'_>, other: &mut dyn Subject, kind: RayKind, rays: &[Ray]) -> Result<f64> {
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

/// The clipped cost of what was built, and what is wrong with it.
fn cost_of(subject: &mut dyn Subject, part: &Part<'_>) -> Result<(Option<f64>, Vec<String>)> {
    let Some(tree) = subject.tree()? else { return Ok((None, Vec::new())) };
    let faults = tree.validate().err().map(|error| error.to_string());
    Ok((clipped::cost(&tree, &part.bounds, COSTS.0, COSTS.1), faults.into_iter().collect()))
}
