//! Builders of kd-trees on the host as subjects: wall-clock time, and the host's tracer on every core or the device's.

use super::host::timed;
use super::kd_device::KdDevice;
use super::{BuildRun, KD_TREE, Outcome, Subject};
use crate::Result;
use crate::device::Buffer;
use crate::measure::record;
use crate::scene::Mesh;
use hedgerow::bvh::layout::Bvh2;
use hedgerow::kdtree::layout::KdTree;
use hedgerow::kdtree::quality;
use hedgerow::trace::kd::Traversal;
use hedgerow::trace::twin::kd::trace;
use hedgerow::trace::{Hit, Query, Ray, Work};
use hedgerow_host::kdtree::{Options, build};
use rayon::prelude::*;

/// `kd-exact` and `kd-binned`.
pub struct KdHost<'a> {
    builder: String,
    mesh: &'a Mesh,
    options: Options,
    tree: Option<KdTree>,
    tracing: Tracing<'a>,
}

/// Where rays are traced, and what for.
enum Tracing<'a> {
    Host { traversal: Traversal, rays: Vec<Ray>, hits: Vec<Hit> },
    Device { tracer: Box<KdDevice<'a>>, structure: Option<Buffer<'a>> },
}

impl<'a> KdHost<'a> {
    /// On `mesh`, to be traced in this way on the host.
    pub fn new(builder: &str, mesh: &'a Mesh, options: Options, traversal: Traversal) -> KdHost<'a> {
        let tracing = Tracing::Host { traversal, rays: Vec::new(), hits: Vec::new() };
        KdHost { builder: builder.to_owned(), mesh, options, tree: None, tracing }
    }

    /// The same, to be traced on the device.
    pub fn traced_by(self, tracer: KdDevice<'a>) -> KdHost<'a> {
        KdHost { tracing: Tracing::Device { tracer: Box::new(tracer), structure: None }, ..self }
    }

    fn built(&mut self) -> Result<&KdTree> {
        built(&mut self.tree, self.mesh, &self.options)
    }
}

/// The tree, built where there is none yet.
fn built<'t>(tree: &'t mut Option<KdTree>, mesh: &Mesh, options: &Options) -> Result<&'t KdTree> {
    let there = match tree.take() {
        Some(there) => there,
        None => build(&mesh.positions, &mesh.triangles, options)?,
    };
    Ok(tree.insert(there))
}

fn traced(tree: &KdTree, rays: &[Ray], query: Query, traversal: Traversal) -> Vec<(Hit, Work)> {
    rays.par_iter().map(|ray| trace(tree, ray, query, traversal)).collect()
}

impl Subject for KdHost<'_> {
    fn builder(&self) -> &str {
        &self.builder
    }

    fn kind(&self) -> &'static str {
        KD_TREE
    }

    fn timer(&self) -> &'static str {
        "wall"
    }

    fn traces_on_device(&self) -> bool {
        matches!(self.tracing, Tracing::Device { .. })
    }

    fn build(&mut self) -> Result<BuildRun> {
        self.tree = None;
        if let Tracing::Device { structure, .. } = &mut self.tracing {
            *structure = None;
        }
        let (milliseconds, built) = timed(|| self.built().map(drop));
        built?;
        Ok(BuildRun { milliseconds, phases: Vec::new() })
    }

    fn memory(&self) -> record::Memory {
        let structure_bytes = self.tree.as_ref().map(|tree| tree.header.sizes().bytes);
        record::Memory { structure_bytes, ..Default::default() }
    }

    fn quality(&mut self, c_t: f64, c_i: f64) -> Result<record::Quality> {
        Ok(record::Quality::of(&quality::on_host(self.built()?, c_t, c_i), c_t, c_i))
    }

    fn tree(&mut self) -> Result<Option<Bvh2>> {
        Ok(None)
    }

    fn kd_tree(&mut self) -> Result<Option<KdTree>> {
        self.built().cloned().map(Some)
    }

    fn outcome(&mut self) -> Result<Option<Outcome>> {
        let header = &self.built()?.header;
        Ok(Some(Outcome { active: header.active, status: header.status }))
    }

    fn bytes(&mut self) -> Result<Option<Vec<u8>>> {
        Ok(Some(self.built()?.to_bytes()))
    }

    fn validate(&mut self) -> Result<()> {
        Ok(self.built()?.validate()?)
    }

    fn set_rays(&mut self, new: &[Ray]) -> Result<()> {
        match &mut self.tracing {
            Tracing::Host { rays, .. } => *rays = new.to_vec(),
            Tracing::Device { tracer, structure } => {
                if structure.is_none() {
                    *structure = Some(tracer.upload(built(&mut self.tree, self.mesh, &self.options)?)?);
                }
                tracer.set_rays(new)?;
            }
        }
        Ok(())
    }

    fn trace(&mut self, query: Query) -> Result<f64> {
        match &mut self.tracing {
            Tracing::Host { traversal, rays, hits } => {
                let tree = built(&mut self.tree, self.mesh, &self.options)?;
                let (milliseconds, all) = timed(|| traced(tree, rays, query, *traversal));
                *hits = all.into_iter().map(|(hit, _)| hit).collect();
                Ok(milliseconds)
            }
            Tracing::Device { tracer, structure: Some(structure) } => tracer.trace(structure.address(), query),
            // There are no rays yet.
            Tracing::Device { structure: None, .. } => Ok(0.0),
        }
    }

    fn hits(&mut self) -> Result<Vec<Hit>> {
        Ok(match &self.tracing {
            Tracing::Host { hits, .. } => hits.clone(),
            Tracing::Device { tracer, .. } => tracer.hits(),
        })
    }

    fn work(&mut self, query: Query) -> Result<Option<Vec<Work>>> {
        match &self.tracing {
            Tracing::Host { traversal, rays, .. } => {
                let tree = built(&mut self.tree, self.mesh, &self.options)?;
                let all = traced(tree, rays, query, *traversal);
                Ok(Some(all.into_iter().map(|(_, work)| work).collect()))
            }
            Tracing::Device { tracer, structure: Some(structure) } => tracer.work(structure.address(), query),
            Tracing::Device { structure: None, .. } => Ok(None),
        }
    }
}
