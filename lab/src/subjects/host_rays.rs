//! Rays on the host, and what tracing them gives: the half of a subject that is the same for every structure there, and for
//! kd-trees of the host wherever rays go through them.

use super::kd_device::KdDevice;
use crate::Result;
use crate::device::Buffer;
use hedgerow::kdtree::layout::KdTree;
use hedgerow::trace::kd::Traversal;
use hedgerow::trace::twin::kd::trace;
use hedgerow::trace::{Hit, Query, Ray, Work};
use rayon::prelude::*;
use std::time::Instant;

/// The time of `work` in milliseconds by the wall's clock, and what it gave.
pub fn timed<T>(work: impl FnOnce() -> T) -> (f64, T) {
    let start = Instant::now();
    let result = work();
    (start.elapsed().as_secs_f64() * 1e3, result)
}

/// The rays that a subject traces by all cores.
#[derive(Debug, Default)]
pub struct HostRays {
    rays: Vec<Ray>,
    hits: Vec<Hit>,
}

impl HostRays {
    /// Takes them.
    pub fn set(&mut self, rays: &[Ray]) {
        self.rays = rays.to_vec();
    }

    /// Traces each once: milliseconds of wall-clock time.
    pub fn trace(&mut self, one: impl Fn(&Ray) -> Hit + Sync + Send) -> f64 {
        let (milliseconds, ()) = timed(|| self.rays.par_iter().map(one).collect_into_vec(&mut self.hits));
        milliseconds
    }

    /// Each ray with its hit of the last trace.
    pub fn met(&self) -> impl Iterator<Item = (&Ray, &Hit)> {
        self.rays.iter().zip(&self.hits)
    }

    /// The hits of the last trace.
    pub fn hits(&self) -> Vec<Hit> {
        self.hits.clone()
    }

    /// The work of each.
    pub fn work(&self, one: impl Fn(&Ray) -> Work + Sync + Send) -> Vec<Work> {
        self.rays.par_iter().map(one).collect()
    }
}

/// A kd-tree, and the number of its first primitive.
pub type Numbered<'t> = (&'t KdTree, u32);

/// Where rays go through kd-trees that the host has built.
pub enum KdRays<'a> {
    /// On the host.
    Host {
        /// How trees are walked.
        traversal: Traversal,
        /// The rays.
        rays: HostRays,
    },
    /// On the device, to which trees are brought with the rays.
    Device {
        /// What traces.
        tracer: Box<KdDevice<'a>>,
        /// The trees, and the numbers of their first primitives.
        trees: Vec<(Buffer<'a>, u32)>,
    },
}

impl<'a> KdRays<'a> {
    /// None yet, on the host.
    pub fn on_host(traversal: Traversal) -> KdRays<'a> {
        KdRays::Host { traversal, rays: HostRays::default() }
    }

    /// None yet, on the device.
    pub fn on_device(tracer: KdDevice<'a>) -> KdRays<'a> {
        KdRays::Device { tracer: Box::new(tracer), trees: Vec::new() }
    }

    /// Says that the trees are other ones from here on.
    pub fn forget_trees(&mut self) {
        if let KdRays::Device { trees, .. } = self {
            trees.clear();
        }
    }

    /// Brings rays, and trees where they are not there yet, to where they are traced; not under the clock.
    ///
    /// # Errors
    /// Too little memory.
    pub fn set(&mut self, through: &[Numbered<'_>], new: &[Ray]) -> Result<()> {
        match self {
            KdRays::Host { rays, .. } => rays.set(new),
            KdRays::Device { tracer, trees } => {
                if trees.is_empty() {
                    for (tree, first) in through {
                        trees.push((tracer.upload(tree)?, *first));
                    }
                }
                tracer.rays.set(new)?;
            }
        }
        Ok(())
    }

    /// Traces the rays once.
    ///
    /// # Errors
    /// The device failed.
    pub fn trace(&mut self, through: &[Numbered<'_>], query: Query) -> Result<f64> {
        match self {
            KdRays::Host { traversal, rays } => Ok(rays.trace(|ray| walk(through, ray, query, *traversal).0)),
            // There are no rays yet.
            KdRays::Device { trees, .. } if trees.is_empty() => Ok(0.0),
            KdRays::Device { tracer, trees } => tracer.trace(&addresses(trees), query),
        }
    }

    /// The hits of the last trace.
    pub fn hits(&self) -> Vec<Hit> {
        match self {
            KdRays::Host { rays, .. } => rays.hits(),
            KdRays::Device { tracer, .. } => tracer.rays.hits(),
        }
    }

    /// Steps and tests of every ray.
    ///
    /// # Errors
    /// The device failed.
    pub fn work(&self, through: &[Numbered<'_>], query: Query) -> Result<Option<Vec<Work>>> {
        match self {
            KdRays::Host { traversal, rays } => Ok(Some(rays.work(|ray| walk(through, ray, query, *traversal).1))),
            KdRays::Device { trees, .. } if trees.is_empty() => Ok(None),
            KdRays::Device { tracer, trees } => tracer.work(&addresses(trees), query),
        }
    }
}

fn addresses(trees: &[(Buffer<'_>, u32)]) -> Vec<(u64, u32)> {
    trees.iter().map(|(tree, first)| (tree.address(), *first)).collect()
}

/// The nearest hit in all trees, of equally near ones that in the earlier; or any.
fn walk(trees: &[Numbered<'_>], ray: &Ray, query: Query, traversal: Traversal) -> (Hit, Work) {
    let (mut nearest, mut work, mut ray) = (Hit::NONE, Work::default(), *ray);
    for &(tree, first) in trees {
        let (hit, more) = trace(tree, &ray, query, traversal);
        work =
            Work { steps: work.steps + more.steps, tests: work.tests + more.tests, leaves: work.leaves + more.leaves };
        if hit.is_some() {
            nearest = Hit { primitive: hit.primitive + first, ..hit };
            if query == Query::AnyHit {
                break;
            }
            ray.t_max = hit.t;
        }
    }
    (nearest, work)
}
