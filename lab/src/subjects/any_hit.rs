//! Orders of children for rays that end at any hit: what a spec names, what rays teach, and what is chosen by measured work.

use super::Subject;
use super::counted::Counted;
use super::host_rays::timed;
use crate::Result;
use crate::device::Device;
use crate::rays::sample::TeachingRays;
use hedgerow::bvh::child_order::{ChildOrder, ChildOrderPass};
use hedgerow::bvh::counts::LinkCount;
use hedgerow::bvh::layout::Bvh2;
use hedgerow::bvh::sah::Collapse;
use hedgerow::gpu::{Phase, Recorder, Region};
use hedgerow::trace::counts::CountedWalk;
use hedgerow::trace::twin::counts;
use hedgerow::trace::{Query, Ray};
use std::rc::Rc;

/// What option `any-hit` names, before a scene is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AnyHitSpec {
    /// An order that follows from the tree.
    Rule(ChildOrder),
    /// One that rays teach.
    Rays,
    /// Whatever takes the least work for rays that teach.
    Auto,
    /// That in which the builder has left them.
    Built,
}

/// An order of children.
#[derive(Debug, Clone, PartialEq)]
pub enum ChildrenBy {
    /// That follows from the tree.
    Rule(ChildOrder),
    /// That these rays teach.
    Rays(Rc<[Ray]>),
    /// In which the builder has left them.
    Built,
}

/// How rays that end at any hit are traced.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct AnyHit {
    /// The child of a node that they look into first: the left one, in this order, or else the nearest.
    pub order: Option<ChildrenBy>,
    /// What was chosen, where it was left to be chosen.
    pub choice: Option<String>,
}

impl AnyHit {
    /// The nearest child first.
    pub const NEAR: AnyHit = AnyHit { order: None, choice: None };

    /// Whether children are put in order behind a build.
    pub fn reorders(&self) -> bool {
        !matches!(self.order, None | Some(ChildrenBy::Built))
    }
}

/// A unit of work takes this part of its time where no distances are kept: docs/notes/any_hit_queries.md.
fn left_first(kind: &str) -> f64 {
    match kind {
        "wide4" => 1.0,
        "wide8" => 0.98,
        "wide8q" => 0.95,
        _ => 1.06,
    }
}

/// No kind of rays may take more than this part of its time by the nearest child first.
const MOST: f64 = 1.02;

/// Of all orders and the nearest child first, the one with the least work for rays that teach, of subjects that `make` makes: by the
/// geometric mean over their kinds, each unit of work by its time, and for none of them more than 1.02 of its time by the nearest child
/// first.
///
/// # Errors
/// Those of making, building and tracing.
pub fn chosen<'a>(teaching: &TeachingRays, make: impl Fn(AnyHit) -> Result<Box<dyn Subject + 'a>>) -> Result<AnyHit> {
    let near = make(AnyHit::NEAR)?;
    let of_a_unit = left_first(near.kind());
    let near = work_by_kind(teaching, near)?;
    let mut best = (0.0, "near", None);
    for (name, order) in candidates(teaching) {
        let any_hit = AnyHit { order: Some(order.clone()), choice: None };
        let work = work_by_kind(teaching, make(any_hit)?)?;
        let ratios =
            work.iter().zip(&near).filter(|(_, near)| **near > 0.0).map(|(work, near)| of_a_unit * work / near);
        let logs: Vec<f64> = ratios.map(f64::ln).collect();
        let mean = logs.iter().sum::<f64>() / logs.len().max(1) as f64;
        if logs.iter().all(|log| *log <= MOST.ln()) && mean < best.0 {
            best = (mean, name, Some(order));
        }
    }
    Ok(AnyHit { order: best.2, choice: Some(format!("any-hit {}", best.1)) })
}

fn candidates(teaching: &TeachingRays) -> [(&'static str, ChildrenBy); 5] {
    [
        ("rtsah", ChildrenBy::Rule(ChildOrder::Cheaper)),
        ("sato", ChildrenBy::Rule(ChildOrder::LargerBox)),
        ("prim-sato", ChildrenBy::Rule(ChildOrder::LargerPrimitives)),
        ("opaque", ChildrenBy::Rule(ChildOrder::MoreHitsForItsCost)),
        ("rays", ChildrenBy::Rays(teaching.all())),
    ]
}

/// 3 a step and 2 a test, of each kind of ray.
fn work_by_kind(teaching: &TeachingRays, mut subject: Box<dyn Subject + '_>) -> Result<Vec<f64>> {
    subject.build()?;
    let mut all = Vec::new();
    for (_, rays) in &teaching.by_kind {
        subject.set_rays(rays)?;
        let work = subject.work(Query::AnyHit)?.unwrap_or_default();
        all.push(work.iter().map(|work| 3.0 * f64::from(work.steps) + 2.0 * f64::from(work.tests)).sum());
    }
    Ok(all)
}

/// The children of `tree` in order, and the phases that this took: `rays` where some are counted, and `order`.
pub fn ordered_on_host(tree: Bvh2, order: &ChildrenBy) -> (Vec<Phase>, Bvh2) {
    let costs = Collapse::SAH;
    match order {
        ChildrenBy::Built => (Vec::new(), tree),
        ChildrenBy::Rule(order) => {
            let (milliseconds, tree) = timed(|| tree.in_child_order(*order, &costs));
            (vec![Phase { name: "order", milliseconds }], tree)
        }
        ChildrenBy::Rays(rays) => {
            let mut of_links = vec![LinkCount::default(); 2 * tree.nodes.len()];
            let (counting, ()) =
                timed(|| counts::count(&tree, rays.iter(), CountedWalk::Exhaustive, &costs, &mut of_links));
            let (ordering, tree) = timed(|| tree.in_order_of_counts(&mut of_links, &costs));
            let phases = [("rays", counting), ("order", ordering)];
            (phases.map(|(name, milliseconds)| Phase { name, milliseconds }).to_vec(), tree)
        }
    }
}

/// Puts the children of a tree on the device in an order that rays teach.
pub struct TaughtOrder<'a> {
    pass: ChildOrderPass,
    counted: Counted<'a>,
}

impl<'a> TaughtOrder<'a> {
    /// By these rays, for trees of at most this many records.
    ///
    /// # Errors
    /// Too little memory.
    pub fn new(device: &'a Device, rays: &[Ray], costs: Collapse, count: u32) -> Result<TaughtOrder<'a>> {
        let counted = Counted::new(device, [(CountedWalk::Exhaustive, rays)], costs, count)?;
        let pass = ChildOrderPass::new(device, ChildOrder::MoreHitsForItsCost, costs, count);
        Ok(TaughtOrder { pass, counted })
    }

    /// What was counted, of the links as they are once they are in order.
    pub fn counts(&self) -> Region {
        self.counted.counts()
    }

    /// Bytes of scratch memory.
    pub fn scratch_bytes(&self) -> u64 {
        self.pass.scratch_bytes().max(self.counted.scratch_bytes())
    }

    /// Records the phases `rays`, in which they are counted, and `order`.
    ///
    /// # Errors
    /// The memory is too small; a pipeline could not be made.
    pub fn record(&self, recorder: &mut Recorder<'_>, structure: Region, scratch: Region) -> hedgerow::Result<()> {
        self.counted.record(recorder, structure, scratch)?;
        self.pass.record_by_counts(recorder, structure, self.counted.counts(), scratch)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rays::sample;
    use crate::scene::{LoadOptions, Scene, load};
    use crate::subjects::builders::Spec;

    fn subject<'a>(spec: &str, scene: &'a Scene) -> Box<dyn Subject + 'a> {
        spec.parse::<Spec>().expect(spec).make_for(None, scene).expect(spec)
    }

    #[test]
    fn rays_are_a_phase_of_the_build_and_the_chosen_order_takes_no_more_work() {
        let scene = load("gen:stadium:3", &LoadOptions::default()).expect("a generator");
        let run = subject("binned:any-hit=rays", &scene).build().expect("built");
        let names: Vec<&str> = run.phases.iter().rev().map(|phase| phase.name).take(2).collect();
        assert_eq!(names, ["order", "rays"]);

        let teaching = TeachingRays::of(&scene, &sample::ANY_HIT, 4000).expect("rays");
        assert!(teaching.by_kind.iter().all(|(_, rays)| (1..=4000).contains(&rays.len())));
        let near = work_by_kind(&teaching, subject("binned:any-hit=near", &scene)).expect("counted");
        let chosen = subject("binned:any-hit=auto", &scene);
        let choice = chosen.choice().expect("what was chosen");
        assert!(choice.contains("any-hit "), "{choice}");
        let work = work_by_kind(&teaching, chosen).expect("counted");
        let of_a_unit = if choice == "any-hit near" { 1.0 } else { left_first("bvh2") };
        let ratios: Vec<f64> = work.iter().zip(&near).map(|(work, near)| of_a_unit * work / near).collect();
        // These are other rays than those that taught, a few thousand: two parts in a hundred.
        assert!(ratios.iter().product::<f64>() <= 1.02 * 1.02, "{choice}: {ratios:?}");
        assert!(ratios.iter().all(|ratio| *ratio <= 1.02 * MOST), "{choice}: {ratios:?}");
    }

    #[test]
    fn rays_teach_where_there_is_a_scene() {
        let scene = load("gen:icosphere:1", &LoadOptions::default()).expect("a generator");
        for spec in ["sweep:any-hit=rays", "sweep:any-hit=auto"] {
            let error = spec.parse::<Spec>().expect(spec).make(None, &scene.mesh).err().expect("only a mesh");
            assert!(error.to_string().contains("there is only a mesh here"), "{error}");
        }
    }
}
