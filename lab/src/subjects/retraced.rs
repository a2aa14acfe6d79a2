//! BVHs of the host traced by our tracer, on the host or on the device, whoever built them: trees are compared apart from the
//! tracers that come with them.

use super::any_hit::{AnyHit, ordered_on_host};
use super::device_bvh::record_binary;
use super::device_rays::DeviceRays;
use super::host_rays::HostRays;
use super::{BuildRun, OnCpu, Outcome, Subject, joined_choices};
use crate::device::{Buffer, Device};
use crate::measure::overlap::{self, Epo};
use crate::measure::record;
use crate::scene::Frame;
use crate::{Error, Result};
use hedgerow::bvh::layout::Bvh2;
use hedgerow::bvh::twin::quality;
use hedgerow::trace::twin::tracer as on_host;
use hedgerow::trace::{Hit, Query, Ray, Work};
use std::sync::Arc;

/// Where our tracer works.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TreeTracer {
    /// On every core of the host.
    Host,
    /// On the device, over the uploaded tree.
    Device,
}

impl TreeTracer {
    /// Both.
    pub const ALL: [TreeTracer; 2] = [TreeTracer::Host, TreeTracer::Device];

    /// In a word.
    pub fn name(self) -> &'static str {
        match self {
            TreeTracer::Host => "host",
            TreeTracer::Device => "device",
        }
    }
}

/// Where trees come from.
enum Source<'a> {
    /// A builder, which builds again whenever it is asked.
    Builder(Box<dyn Subject + 'a>),
    /// Somebody who has built one already.
    Tree(Arc<Bvh2>),
}

/// What takes rays through them.
enum Tracing<'a> {
    Host { tree: Option<Arc<Bvh2>>, rays: HostRays },
    Device { device: &'a Device, tree: Option<Buffer<'a>>, rays: Box<DeviceRays<'a>> },
}

/// A tree of the host with a tracer of ours.
pub struct Retraced<'a> {
    builder: String,
    source: Source<'a>,
    tracing: Tracing<'a>,
    /// How rays that end at any hit go through what a builder builds.
    any_hit: AnyHit,
    /// What was built last, its children in that order.
    ordered: Option<Bvh2>,
}

impl<'a> Retraced<'a> {
    /// What `subject` builds, traced on `device`, or on the host where there is none. Where children have an order, that is a phase of
    /// the build.
    ///
    /// # Errors
    /// The device failed.
    pub fn by_builder(
        builder: &str,
        subject: Box<dyn Subject + 'a>,
        device: Option<&'a Device>,
        any_hit: AnyHit,
    ) -> Result<Retraced<'a>> {
        Ok(Retraced { any_hit, ..Retraced::new(builder, Source::Builder(subject), device)? })
    }

    /// A tree that is there already: it cannot be built again. On the host it is not copied.
    ///
    /// # Errors
    /// The device failed.
    pub fn of_tree(builder: &str, tree: Arc<Bvh2>, device: Option<&'a Device>) -> Result<Retraced<'a>> {
        Retraced::new(builder, Source::Tree(tree), device)
    }

    fn new(builder: &str, source: Source<'a>, device: Option<&'a Device>) -> Result<Retraced<'a>> {
        let tracing = match device {
            None => Tracing::Host { tree: None, rays: HostRays::default() },
            Some(device) => Tracing::Device { device, tree: None, rays: Box::new(DeviceRays::new(device)?) },
        };
        Ok(Retraced { builder: builder.to_owned(), source, tracing, any_hit: AnyHit::NEAR, ordered: None })
    }

    /// The tree that is traced. It holds together: one that does not might be walked without end.
    fn sound_tree(&mut self) -> Result<Arc<Bvh2>> {
        let tree = match &self.source {
            Source::Tree(tree) => Some(Arc::clone(tree)),
            Source::Builder(_) => self.tree()?.map(Arc::new),
        };
        let tree = tree.ok_or_else(|| {
            let what = "the builder does not show its tree, so that our tracer has none; leave trace= out";
            Error::Argument(format!("{}: {what}", self.builder))
        })?;
        tree.validate()?;
        Ok(tree)
    }

    fn has_tree(&self) -> bool {
        match &self.tracing {
            Tracing::Host { tree, .. } => tree.is_some(),
            Tracing::Device { tree, .. } => tree.is_some(),
        }
    }

    /// Builds, and puts the children in order if they have one.
    fn run(&mut self) -> Result<BuildRun> {
        let Source::Builder(subject) = &mut self.source else {
            return Err(Error::Argument(format!("{}: its tree came from elsewhere", self.builder)));
        };
        self.ordered = None;
        let mut run = subject.build()?;
        if !self.any_hit.reorders() {
            return Ok(run);
        }
        let Some((order, tree)) = self.any_hit.order.as_ref().zip(subject.tree()?) else { return Ok(run) };
        let (phases, tree) = ordered_on_host(tree, order);
        self.ordered = Some(tree);
        let milliseconds: f64 = phases.iter().map(|phase| phase.milliseconds).sum();
        run.milliseconds += milliseconds;
        run.phases.extend(phases);
        run.on_cpu = run.on_cpu.map(|on_cpu| OnCpu { milliseconds: on_cpu.milliseconds + milliseconds, ..on_cpu });
        Ok(run)
    }
}

impl Subject for Retraced<'_> {
    fn builder(&self) -> &str {
        &self.builder
    }

    fn kind(&self) -> &'static str {
        "bvh2"
    }

    fn traces_on_device(&self) -> bool {
        matches!(self.tracing, Tracing::Device { .. })
    }

    fn place(&mut self, frame: &Frame<'_>) -> Result<()> {
        match &mut self.source {
            Source::Builder(subject) => subject.place(frame),
            Source::Tree(_) => Ok(()),
        }
    }

    fn build(&mut self) -> Result<BuildRun> {
        match &mut self.tracing {
            Tracing::Host { tree, .. } => *tree = None,
            Tracing::Device { tree, .. } => *tree = None,
        }
        self.run()
    }

    fn memory(&self) -> record::MemoryRecord {
        match &self.source {
            Source::Builder(subject) => subject.memory(),
            Source::Tree(_) => record::MemoryRecord::default(),
        }
    }

    fn quality(&mut self, c_t: f64, c_i: f64) -> Result<record::QualityRecord> {
        match &mut self.source {
            Source::Builder(subject) => subject.quality(c_t, c_i),
            Source::Tree(tree) => Ok(record::QualityRecord::of(&quality::of(tree, c_t, c_i), c_t, c_i)),
        }
    }

    fn epo(&mut self, c_t: f64, c_i: f64, epo: Epo) -> Result<Option<f64>> {
        match &mut self.source {
            Source::Builder(subject) => subject.epo(c_t, c_i, epo),
            Source::Tree(tree) => Ok(overlap::on_host(tree, c_t, c_i, epo)),
        }
    }

    fn tree(&mut self) -> Result<Option<Bvh2>> {
        if self.any_hit.reorders() && self.ordered.is_none() {
            self.run()?;
        }
        match &mut self.source {
            Source::Builder(_) if self.ordered.is_some() => Ok(self.ordered.clone()),
            Source::Builder(subject) => subject.tree(),
            Source::Tree(tree) => Ok(Some(Bvh2::clone(tree))),
        }
    }

    fn outcome(&mut self) -> Result<Option<Outcome>> {
        match &mut self.source {
            Source::Builder(subject) => subject.outcome(),
            Source::Tree(tree) => Ok(Some(Outcome { active: tree.header.active, status: tree.header.status })),
        }
    }

    fn choice(&self) -> Option<String> {
        let of_builder = match &self.source {
            Source::Builder(subject) => subject.choice(),
            Source::Tree(_) => None,
        };
        joined_choices([of_builder, self.any_hit.choice.clone()])
    }

    fn set_rays(&mut self, new: &[Ray]) -> Result<()> {
        let sound = if self.has_tree() { None } else { Some(self.sound_tree()?) };
        match &mut self.tracing {
            Tracing::Host { tree, rays } => {
                *tree = sound.or(tree.take());
                rays.set(new);
                Ok(())
            }
            Tracing::Device { device, tree, rays } => {
                if let Some(sound) = sound {
                    *tree = Some(device.upload("tree of the host", &sound.to_bytes())?);
                }
                rays.set(new)
            }
        }
    }

    fn trace(&mut self, query: Query) -> Result<f64> {
        let is_ordered = self.any_hit.order.is_some();
        match &mut self.tracing {
            Tracing::Host { tree: Some(tree), rays } => Ok(rays.trace(|ray| traced(tree, is_ordered, ray, query).0)),
            Tracing::Device { tree: Some(tree), rays, .. } => {
                rays.trace(tree.address(), |recorder, buffers| record_binary(recorder, is_ordered, query, buffers))
            }
            // There are no rays yet.
            _ => Ok(0.0),
        }
    }

    fn hits(&mut self) -> Result<Vec<Hit>> {
        Ok(match &self.tracing {
            Tracing::Host { rays, .. } => rays.hits(),
            Tracing::Device { rays, .. } => rays.hits(),
        })
    }

    fn work(&mut self, query: Query) -> Result<Option<Vec<Work>>> {
        let is_ordered = self.any_hit.order.is_some();
        match &self.tracing {
            Tracing::Host { tree: Some(tree), rays } => {
                Ok(Some(rays.work(|ray| traced(tree, is_ordered, ray, query).1)))
            }
            Tracing::Device { tree: Some(tree), rays, .. } => {
                rays.work(tree.address(), |recorder, buffers| record_binary(recorder, is_ordered, query, buffers))
            }
            _ => Ok(None),
        }
    }
}

/// What a ray finds on the host, and its work.
fn traced(tree: &Bvh2, is_ordered: bool, ray: &Ray, query: Query) -> (Hit, Work) {
    match query {
        Query::AnyHit if is_ordered => on_host::trace_left_first(tree, ray),
        _ => on_host::trace(tree, ray, query),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{LoadOptions, load};
    use crate::subjects::builders::Spec;
    use hedgerow::bvh::child_order::ChildOrder;
    use hedgerow::bvh::sah::Collapse;

    fn rays() -> Vec<Ray> {
        let ray = |i: u8| Ray {
            origin: [0.01 * f32::from(i), 0.02, -9.0],
            t_min: 0.0,
            direction: [0.0, 0.0, 1.0],
            t_max: f32::INFINITY,
        };
        (0..40).map(ray).collect()
    }

    #[test]
    fn our_tracer_finds_in_the_tree_what_the_builders_own_does() {
        let mesh = load("gen:icosphere:2", &LoadOptions::default()).expect("a generator").mesh;
        let make = |spec: &str| spec.parse::<Spec>().expect(spec).make(None, &mesh).expect(spec);
        let (mut own, mut again) = (make("sweep"), make("sweep:trace=host"));
        assert_eq!((again.builder(), again.kind(), again.timer()), ("sweep:trace=host", "bvh2", "wall"));
        own.build().expect("built");
        again.build().expect("built");
        let query = Query::ClosestHit;
        let hits = own.hits_of(&rays(), query).expect("traced");
        assert!(hits.iter().any(Hit::is_some));
        assert_eq!(again.hits_of(&rays(), query).expect("traced"), hits);
        assert_eq!(again.work(query).expect("counted"), own.work(query).expect("counted"));
        let tree = own.tree().expect("read").expect("a BVH");
        let mut given = Retraced::of_tree("sweep:trace=host", Arc::new(tree), None).expect("no device");
        assert_eq!(given.hits_of(&rays(), query).expect("traced"), hits);
        assert!(given.build().expect_err("it has no builder").to_string().contains("came from elsewhere"));
    }

    #[test]
    fn an_order_of_children_is_a_phase_of_the_build_and_keeps_the_hits() {
        let mesh = load("gen:icosphere:3", &LoadOptions::default()).expect("a generator").mesh;
        let make = |spec: &str| spec.parse::<Spec>().expect(spec).make(None, &mesh).expect(spec);
        let (mut near, mut ordered) = (make("sweep:any-hit=near"), make("sweep:any-hit=opaque"));
        let run = ordered.build().expect("built");
        assert_eq!(run.phases.last().map(|phase| phase.name), Some("order"));
        let sum: f64 = run.phases.iter().map(|phase| phase.milliseconds).sum();
        assert!((sum / run.milliseconds - 1.0).abs() < 1e-9, "{run:?}");
        for query in [Query::ClosestHit, Query::AnyHit] {
            let hits = ordered.hits_of(&rays(), query).expect("traced");
            let expected = near.hits_of(&rays(), query).expect("traced");
            assert!(hits.iter().any(Hit::is_some));
            assert!(hits.iter().zip(&expected).all(|(a, b)| a.t == b.t), "{query:?}");
        }
        // Both sides of a sphere are as good as each other; the tree itself is in order.
        let tree = near.tree().expect("read").expect("a BVH");
        let in_order = tree.in_child_order(ChildOrder::MoreHitsForItsCost, &Collapse::SAH);
        assert!(ordered.tree().expect("read").expect("a BVH").to_bytes() == in_order.to_bytes());
    }
}
