//! Builders of kd-trees on the host as subjects: wall-clock time, the host's tracer on every core.

use super::host::timed;
use super::{BuildRun, Outcome, Subject, record};
use crate::Result;
use crate::bvh::layout::Bvh2;
use crate::kdtree::host::{Options, build};
use crate::kdtree::layout::KdTree;
use crate::kdtree::quality;
use crate::scene::Mesh;
use crate::trace::kd_host::{Traversal, trace};
use crate::trace::{Hit, Query, Ray, Work};
use rayon::prelude::*;

/// `kd-exact` and `kd-binned`.
pub struct KdHost<'a> {
    builder: String,
    mesh: &'a Mesh,
    options: Options,
    traversal: Traversal,
    tree: Option<KdTree>,
    rays: Vec<Ray>,
    hits: Vec<Hit>,
}

impl<'a> KdHost<'a> {
    /// On `mesh`, to be traced in this way.
    pub fn new(builder: &str, mesh: &'a Mesh, options: Options, traversal: Traversal) -> KdHost<'a> {
        KdHost { builder: builder.to_owned(), mesh, options, traversal, tree: None, rays: Vec::new(), hits: Vec::new() }
    }

    fn built(&mut self) -> Result<&KdTree> {
        let tree = match self.tree.take() {
            Some(tree) => tree,
            None => build(&self.mesh.positions, &self.mesh.triangles, &self.options)?,
        };
        Ok(self.tree.insert(tree))
    }

    fn traced(&mut self, query: Query) -> Result<(f64, Vec<(Hit, Work)>)> {
        let (rays, traversal) = (std::mem::take(&mut self.rays), self.traversal);
        let tree = self.built()?;
        let traced = timed(|| rays.par_iter().map(|ray| trace(tree, ray, query, traversal)).collect());
        self.rays = rays;
        Ok(traced)
    }
}

impl Subject for KdHost<'_> {
    fn builder(&self) -> &str {
        &self.builder
    }

    fn kind(&self) -> &'static str {
        "kdtree"
    }

    fn timer(&self) -> &'static str {
        "wall"
    }

    fn build(&mut self) -> Result<BuildRun> {
        self.tree = None;
        let (milliseconds, built) = timed(|| self.built().map(drop));
        built?;
        Ok(BuildRun { milliseconds, phases: Vec::new() })
    }

    fn memory(&self) -> record::Memory {
        let structure_bytes = self.tree.as_ref().map(|tree| tree.header.sizes().bytes);
        record::Memory { structure_bytes, ..Default::default() }
    }

    fn quality(&mut self, c_t: f64, c_i: f64) -> Result<record::Quality> {
        Ok(record::Quality::of_kd_tree(&quality::on_host(self.built()?, c_t, c_i), c_t, c_i))
    }

    fn tree(&mut self) -> Result<Option<Bvh2>> {
        Ok(None)
    }

    fn outcome(&mut self) -> Result<Option<Outcome>> {
        let header = &self.built()?.header;
        Ok(Some(Outcome { active: header.active, status: header.status }))
    }

    fn bytes(&mut self) -> Result<Option<Vec<u8>>> {
        Ok(Some(self.built()?.to_bytes()))
    }

    fn validate(&mut self) -> Result<()> {
        self.built()?.validate()
    }

    fn set_rays(&mut self, rays: &[Ray]) -> Result<()> {
        self.rays = rays.to_vec();
        Ok(())
    }

    fn trace(&mut self, query: Query) -> Result<f64> {
        let (milliseconds, traced) = self.traced(query)?;
        self.hits = traced.into_iter().map(|(hit, _)| hit).collect();
        Ok(milliseconds)
    }

    fn hits(&mut self) -> Result<Vec<Hit>> {
        Ok(self.hits.clone())
    }

    fn work(&mut self, query: Query) -> Result<Option<Vec<Work>>> {
        Ok(Some(self.traced(query)?.1.into_iter().map(|(_, work)| work).collect()))
    }
}
