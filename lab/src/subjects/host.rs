//! Builders on the host as subjects: wall-clock time, the host's tracer on every core.

use super::host_build::{BuildThreads, HeapPeak};
use super::host_rays::{HostRays, timed};
#[cfg(feature = "peer-embree")]
use super::peers::{embree, embree_tree::EmbreeTrees};
use super::taught::Taught;
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
use hedgerow::bvh::twin::{lbvh, quality};
use hedgerow::gpu::Phase;
use hedgerow::trace::twin::tracer;
use hedgerow::trace::{Hit, Query, Ray, Work};
use hedgerow_host::bvh::{self, HostBvhOptions};
use std::num::NonZeroU32;

/// What a builder on the host is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum HostPlan {
    /// A builder of `hedgerow_host`.
    Built {
        /// What it builds.
        options: HostBvhOptions,
        /// Threads of its own, where it was given a number.
        threads: Option<NonZeroU32>,
    },
    /// The twin of `lbvh` on the device.
    Twin(TwinPlan),
    /// Embree's builder, its tree in our layout.
    #[cfg(feature = "peer-embree")]
    Embree(embree::Preset),
}

/// What the twin of `lbvh` is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwinPlan {
    /// The codes; `None` takes those that the device would take for this many triangles.
    pub codes: Option<Codes>,
    /// Reinsertion behind it.
    pub reinsertion: Option<ReinsertionOptions>,
    /// Whether subtrees become leaves where that is cheaper.
    pub collapse: Collapse,
}

impl HostPlan {
    /// Threads of its own that the builder has: those that it was given, or one where more would wait for it. Otherwise it shares
    /// those of all.
    fn own_threads(&self) -> Option<NonZeroU32> {
        match self {
            HostPlan::Built { options, threads } => {
                threads.or_else(|| (!options.is_parallel()).then_some(NonZeroU32::MIN))
            }
            HostPlan::Twin(_) => Some(NonZeroU32::MIN),
            #[cfg(feature = "peer-embree")]
            HostPlan::Embree(_) => None,
        }
    }
}

impl TwinPlan {
    fn build(&self, mesh: &Mesh) -> Bvh2 {
        let TwinPlan { codes, reinsertion, collapse } = *self;
        let codes = codes.unwrap_or_else(|| Codes::for_count(mesh.triangles.len() as u32));
        let lbvh = |collapse| lbvh::build(&mesh.positions, &mesh.triangles, codes, collapse);
        match reinsertion {
            None => lbvh(collapse),
            Some(options) => lbvh(Collapse::OFF).reinserted(&options).collapsed(&collapse),
        }
    }
}

/// A builder on the host.
pub struct Host<'a> {
    builder: String,
    mesh: &'a Mesh,
    plan: HostPlan,
    taught: Taught,
    threads: BuildThreads,
    #[cfg(feature = "peer-embree")]
    embree: Option<EmbreeTrees>,
    peak: HeapPeak,
    tree: Option<Bvh2>,
    rays: HostRays,
}

impl<'a> Host<'a> {
    /// On `mesh`, by what it was taught.
    ///
    /// # Errors
    /// The system does not start as many threads as the builder asks for, or Embree does not start; the builder cannot use what it was
    /// taught.
    pub fn new(builder: &str, mesh: &'a Mesh, plan: HostPlan, taught: Taught) -> Result<Host<'a>> {
        if let HostPlan::Built { options, .. } = &plan {
            taught.heuristic().check(options, mesh.triangles.len())?;
        }
        let threads = BuildThreads::new(plan.own_threads())?;
        let (builder, peak, rays) = (builder.to_owned(), HeapPeak::default(), HostRays::default());
        Ok(Host {
            #[cfg(feature = "peer-embree")]
            embree: match plan {
                HostPlan::Embree(preset) => Some(EmbreeTrees::new(preset)?),
                _ => None,
            },
            builder,
            mesh,
            plan,
            taught,
            threads,
            peak,
            tree: None,
            rays,
        })
    }

    /// Builds; how that went.
    fn run(&mut self) -> Result<BuildRun> {
        self.tree = None;
        #[cfg(feature = "peer-embree")]
        if let Some(embree) = &mut self.embree {
            let (tree, run) = self.peak.measured(embree.threads(), || match embree.build(self.mesh) {
                Ok((tree, run)) => (Ok(tree), run),
                Err(error) => (Err(error), BuildRun::whole(0.0)),
            });
            self.tree = Some(tree?);
            return Ok(run);
        }
        let (mesh, plan, threads, heuristic) = (self.mesh, self.plan, &self.threads, self.taught.heuristic());
        let build = || match plan {
            HostPlan::Built { options, .. } => {
                let built = bvh::build_by(&heuristic, &mesh.positions, &mesh.triangles, &options);
                let built = built.expect("checked when it was made");
                let phases = built.phases.into_iter().map(|(name, milliseconds)| Phase { name, milliseconds });
                (built.tree, BuildRun::of(phases.collect()))
            }
            HostPlan::Twin(plan) => {
                let (milliseconds, tree) = timed(|| plan.build(mesh));
                (tree, BuildRun::whole(milliseconds))
            }
            #[cfg(feature = "peer-embree")]
            HostPlan::Embree(_) => unreachable!("Embree's trees are built above"),
        };
        let (tree, run) = self.peak.measured(threads.count(), || threads.run(build));
        self.tree = Some(tree);
        Ok(run)
    }

    /// The tree, built where there is none yet, and what is traced through it.
    fn built(&mut self) -> Result<(&Bvh2, &mut HostRays)> {
        if self.tree.is_none() {
            self.run()?;
        }
        Ok((self.tree.as_ref().expect("built above"), &mut self.rays))
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
        self.run()
    }

    fn memory(&self) -> record::MemoryRecord {
        let record_bytes = Primitives::Triangles.record_bytes();
        let structure = match &self.tree {
            Some(tree) => tree.header.offsets(record_bytes),
            None => layout::offsets(record_bytes, self.mesh.triangles.len() as u32, 1),
        };
        self.peak.memory(Some(structure.bytes))
    }

    fn quality(&mut self, c_t: f64, c_i: f64) -> Result<record::QualityRecord> {
        Ok(record::QualityRecord::of(&quality::of(self.built()?.0, c_t, c_i), c_t, c_i))
    }

    fn epo(&mut self, c_t: f64, c_i: f64, epo: Epo) -> Result<Option<f64>> {
        Ok(overlap::on_host(self.built()?.0, c_t, c_i, epo))
    }

    fn tree(&mut self) -> Result<Option<Bvh2>> {
        Ok(Some(self.built()?.0.clone()))
    }

    fn choice(&self) -> Option<String> {
        let codes = match self.plan {
            HostPlan::Twin(plan) => Some(plan.codes),
            HostPlan::Built { options, .. } => options.method.sorts().then_some(options.codes),
            #[cfg(feature = "peer-embree")]
            HostPlan::Embree(_) => None,
        };
        let is_chosen_here = codes.is_some_and(|codes| codes.is_none());
        is_chosen_here.then(|| format!("codes {}", Codes::for_count(self.mesh.triangles.len() as u32)))
    }

    fn set_rays(&mut self, rays: &[Ray]) -> Result<()> {
        self.rays.set(rays);
        Ok(())
    }

    fn trace(&mut self, query: Query) -> Result<f64> {
        let (tree, rays) = self.built()?;
        Ok(rays.trace(|ray| tracer::trace(tree, ray, query).0))
    }

    fn hits(&mut self) -> Result<Vec<Hit>> {
        Ok(self.rays.hits())
    }

    fn work(&mut self, query: Query) -> Result<Option<Vec<Work>>> {
        let (tree, rays) = self.built()?;
        Ok(Some(rays.work(|ray| tracer::trace(tree, ray, query).1)))
    }
}
