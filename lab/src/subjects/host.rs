//! Builders on the host as subjects: wall-clock time, the host's tracer on every core.

use super::host_rays::{HostRays, timed};
use super::{BuildRun, Subject};
use crate::Result;
use crate::measure::overlap::{self, Epo};
use crate::measure::record;
use crate::scene::Mesh;
use hedgerow::bvh::codes::Codes;
use hedgerow::bvh::geometry::Primitives;
use hedgerow::bvh::layout::{self, Bvh2};
use hedgerow::bvh::reinsertion::ReinsertionOptions;
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::{lbvh, ploc, quality};
use hedgerow::trace::twin::tracer;
use hedgerow::trace::{Hit, Query, Ray, Work};
use hedgerow_host::sweep::{self, Leaves};

/// How a host's builder makes the tree of what is sorted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HostMethod {
    /// `lbvh-host`: the plain LBVH that the device's is tested against.
    Lbvh,
    /// `ploc-host`: the plain PLOC with this radius.
    Ploc(usize),
    /// `sweep`: full sweep, whatever the order.
    Sweep(Leaves),
}

/// What a builder on the host is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HostBvhOptions {
    /// How the tree is made.
    pub hierarchy: HostMethod,
    /// The codes; `None` takes those that the device would take for this many triangles.
    pub codes: Option<Codes>,
    /// Reinsertion behind it.
    pub reinsertion: Option<ReinsertionOptions>,
    /// Whether subtrees become leaves where that is cheaper.
    pub collapse: Collapse,
}

/// A builder on the host.
pub struct Host<'a> {
    builder: String,
    mesh: &'a Mesh,
    options: HostBvhOptions,
    codes: Codes,
    tree: Option<Bvh2>,
    rays: HostRays,
}

impl<'a> Host<'a> {
    /// On `mesh`.
    pub fn new(builder: &str, mesh: &'a Mesh, options: HostBvhOptions) -> Host<'a> {
        Host {
            builder: builder.to_owned(),
            mesh,
            options,
            codes: options.codes.unwrap_or_else(|| Codes::for_count(mesh.triangles.len() as u32)),
            tree: None,
            rays: HostRays::default(),
        }
    }

    /// The tree, built where there is none yet, and what is traced through it.
    fn built(&mut self) -> (&Bvh2, &mut HostRays) {
        let Host { mesh, options, codes, tree, rays, .. } = self;
        let tree = tree.get_or_insert_with(|| {
            let collapse = &options.collapse;
            let lbvh = |collapse| lbvh::build(&mesh.positions, &mesh.triangles, *codes, collapse);
            let tree = match (options.hierarchy, options.reinsertion) {
                (HostMethod::Lbvh, None) => return lbvh(*collapse),
                (HostMethod::Lbvh, _) => lbvh(Collapse::OFF),
                (HostMethod::Ploc(radius), _) => ploc::build(&lbvh(Collapse::OFF), radius),
                (HostMethod::Sweep(leaves), _) => sweep::build(&lbvh(Collapse::OFF), collapse, leaves),
            };
            match &options.reinsertion {
                Some(reinsertion) => tree.reinserted(reinsertion).collapsed(collapse),
                None => tree.collapsed(collapse),
            }
        });
        (tree, rays)
    }
}

impl Subject for Host<'_> {
    fn builder(&self) -> &str {
        &self.builder
    }

    fn kind(&self) -> &'static str {
        "bvh2"
    }

    fn build(&mut self) -> Result<BuildRun> {
        self.tree = None;
        let (milliseconds, _) = timed(|| self.built().0.header.active);
        Ok(BuildRun::whole(milliseconds))
    }

    fn memory(&self) -> record::MemoryRecord {
        let structure =
            layout::offsets(Primitives::Triangles.record_bytes(), self.mesh.triangles.len() as u32, 1).bytes;
        record::MemoryRecord { structure_bytes: Some(structure), ..Default::default() }
    }

    fn quality(&mut self, c_t: f64, c_i: f64) -> Result<record::QualityRecord> {
        Ok(record::QualityRecord::of(&quality::of(self.built().0, c_t, c_i), c_t, c_i))
    }

    fn epo(&mut self, c_t: f64, c_i: f64, epo: Epo) -> Result<Option<f64>> {
        Ok(overlap::on_host(self.built().0, c_t, c_i, epo))
    }

    fn tree(&mut self) -> Result<Option<Bvh2>> {
        Ok(Some(self.built().0.clone()))
    }

    fn choice(&self) -> Option<String> {
        let chosen = self.options.codes.is_none() && !matches!(self.options.hierarchy, HostMethod::Sweep(_));
        chosen.then(|| format!("codes {}", self.codes))
    }

    fn set_rays(&mut self, rays: &[Ray]) -> Result<()> {
        self.rays.set(rays);
        Ok(())
    }

    fn trace(&mut self, query: Query) -> Result<f64> {
        let (tree, rays) = self.built();
        Ok(rays.trace(|ray| tracer::trace(tree, ray, query).0))
    }

    fn hits(&mut self) -> Result<Vec<Hit>> {
        Ok(self.rays.hits())
    }

    fn work(&mut self, query: Query) -> Result<Option<Vec<Work>>> {
        let (tree, rays) = self.built();
        Ok(Some(rays.work(|ray| tracer::trace(tree, ray, query).1)))
    }
}
