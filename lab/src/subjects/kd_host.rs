//! Builders of kd-trees on the host as subjects: wall-clock time, and the host's tracer on every core or the device's.

use super::host_build::HeapPeak;
use super::host_rays::{KdRays, timed};
use super::{BuildRun, KD_TREE, Subject};
use crate::Result;
use crate::measure::record;
use crate::scene::Mesh;
use hedgerow::kdtree::layout::KdTree;
use hedgerow::trace::{Hit, Query, Ray, Work};
use hedgerow_host::kdtree::{HostKdOptions, build};
use std::borrow::Cow;

/// `kd-exact` and `kd-binned`.
pub struct KdHost<'a> {
    builder: String,
    mesh: &'a Mesh,
    options: HostKdOptions,
    tree: Option<KdTree>,
    peak: HeapPeak,
    rays: KdRays<'a>,
}

impl<'a> KdHost<'a> {
    /// On `mesh`, to be traced by `rays`.
    pub fn new(builder: &str, mesh: &'a Mesh, options: HostKdOptions, rays: KdRays<'a>) -> KdHost<'a> {
        KdHost { builder: builder.to_owned(), mesh, options, tree: None, peak: HeapPeak::default(), rays }
    }

    /// The tree, built where there is none yet, and what traces it.
    fn built(&mut self) -> Result<(&KdTree, &mut KdRays<'a>)> {
        let tree = match self.tree.take() {
            Some(tree) => tree,
            None => build(&self.mesh.positions, &self.mesh.triangles, &self.options)?,
        };
        Ok((self.tree.insert(tree), &mut self.rays))
    }
}

impl Subject for KdHost<'_> {
    fn builder(&self) -> &str {
        &self.builder
    }

    fn kind(&self) -> &'static str {
        KD_TREE
    }

    fn traces_on_device(&self) -> bool {
        matches!(self.rays, KdRays::Device { .. })
    }

    fn build(&mut self) -> Result<BuildRun> {
        self.tree = None;
        self.rays.forget_trees();
        let (mesh, options) = (self.mesh, self.options);
        let (built, run) = self.peak.measured(rayon::current_num_threads() as u32, || {
            let (milliseconds, built) = timed(|| build(&mesh.positions, &mesh.triangles, &options));
            (built, BuildRun::whole(milliseconds))
        });
        self.tree = Some(built?);
        Ok(run)
    }

    fn memory(&self) -> record::MemoryRecord {
        self.peak.memory(self.tree.as_ref().map(|tree| tree.header.offsets().bytes))
    }

    fn kd_tree(&mut self) -> Result<Option<Cow<'_, KdTree>>> {
        Ok(Some(Cow::Borrowed(self.built()?.0)))
    }

    fn set_rays(&mut self, new: &[Ray]) -> Result<()> {
        let (tree, rays) = self.built()?;
        rays.set(&[(tree, 0)], new)
    }

    fn trace(&mut self, query: Query) -> Result<f64> {
        let (tree, rays) = self.built()?;
        rays.trace(&[(tree, 0)], query)
    }

    fn hits(&mut self) -> Result<Vec<Hit>> {
        Ok(self.rays.hits())
    }

    fn work(&mut self, query: Query) -> Result<Option<Vec<Work>>> {
        let (tree, rays) = self.built()?;
        rays.work(&[(tree, 0)], query)
    }
}
