//! A dynamic scene frame by frame, in each of five ways to have something to trace when some of it moves (Papay 2025, chapter
//! 10 and section 11.3.2): what each frame's build takes, what its rays take then, and whether all find the same.
//!
//! A [`Subject`] is one of the [`AnimationMethod`]s on a scene. What a way needs once (the tree of what stands still) is made
//! before the clock runs, and so is what all need alike: vertices are placed and uploaded. Under the clock is what is done a
//! frame to have something that can be traced, and the tracing.

pub(crate) mod command;
mod merge_on_device;
mod on_device;
mod on_host;
pub mod page;
pub mod points;
mod two_level;

use crate::device::Device;
use crate::measure::agreement::may_both_be_right;
use crate::measure::{Failure, Sink, Spread, in_turn, mean_work};
use crate::named::named;
use crate::rays::kinds::{self, RayKind, RayOptions};
use crate::scene::{Camera, DynamicScene, Frame, Group, Mesh, Scene};
use crate::subjects::Subject;
use crate::subjects::builders::{KdSpec, Spec};
use crate::subjects::host_rays::KdRays;
use crate::subjects::kd_device::KdDevice;
use crate::{Error, Result};
use hedgerow::trace::{Hit, Query, Ray, Work};
use hedgerow_host::kdtree::HostKdOptions;
use merge_on_device::MergeOnDevice;
use on_device::OnDevice;
use on_host::{OnHost, Trees};
use points::{AnimateEntry, Animated, Rays, WayInFrame};
use two_level::TwoLevel;

/// How there is something to trace in every frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AnimationMethod {
    /// One kd-tree over all triangles, built again.
    Rebuild,
    /// The static tree, and one over all that moves; a ray goes through both.
    TwoTrees,
    /// The static tree, and one of each object; a ray goes through all.
    TreePerObject,
    /// A top level over bottom levels ([`hedgerow::accel`]): rigid objects are moved by their instances, those that morph built
    /// again.
    TwoLevel,
    /// The static tree, which the objects' trees are merged into and taken out of.
    Merge,
}

named!(AnimationMethod, "way":
    Rebuild = "rebuild",
    TwoTrees = "two-trees",
    TreePerObject = "tree-per-object",
    TwoLevel = "two-level",
    Merge = "merge",
);

/// What is measured, and how.
#[derive(Clone, Copy)]
pub struct AnimateSetup<'a> {
    /// Where what is built or traced on a device is.
    pub device: Option<&'a Device>,
    /// The ways, each at most once.
    pub ways: &'a [AnimationMethod],
    /// The builder of the kd-trees of every frame.
    pub builder: &'a Spec,
    /// How that of what stands still is built, once, on the host.
    pub static_options: HostKdOptions,
    /// Counted runs of every build and trace; the first frame has one before that warms up.
    pub runs: u32,
    /// Kinds of rays.
    pub kinds: &'a [RayKind],
    /// Their number and seed.
    pub rays: RayOptions,
    /// Costs of a step and of a test, for SAH costs.
    pub costs: [f64; 2],
    /// Aims the camera where the user wants it.
    pub aim: &'a dyn Fn(&mut Camera),
    /// Is called with what is being done, for a progress bar.
    pub say: &'a dyn Fn(&str),
}

impl<'a> AnimateSetup<'a> {
    /// A way on a scene, in its first frame; what it builds once is built.
    fn subject(&self, way: AnimationMethod, first: &Frame<'a>) -> Result<Box<dyn Subject + 'a>> {
        let device =
            || self.device.ok_or_else(|| Error::NoVulkan(format!("the way {way} needs a device, and none was opened")));
        if way == AnimationMethod::TwoLevel {
            return Ok(Box::new(TwoLevel::new(device()?, first)?));
        }
        let groups = match way {
            AnimationMethod::Rebuild => vec![Group::Whole],
            AnimationMethod::TwoTrees => vec![Group::Moving],
            _ => Group::objects(first),
        };
        let scene = first.dynamic;
        let Mesh { positions, triangles } = &scene.static_mesh;
        let has_still = way != AnimationMethod::Rebuild && !triangles.is_empty();
        let still =
            has_still.then(|| hedgerow_host::kdtree::build(positions, triangles, &self.static_options)).transpose()?;
        if way == AnimationMethod::Merge && still.is_none() {
            let name = &scene.name;
            let what = format!("{name}: nothing in it stands still, so there is nothing to merge into");
            return Err(Error::Scene(what));
        }
        Ok(match (self.builder.kd()?, still) {
            (KdSpec::Device { options, traversal }, Some(still)) if way == AnimationMethod::Merge => {
                Box::new(MergeOnDevice::new(device()?, self.builder, (options, traversal), still, first)?)
            }
            (KdSpec::Device { options, traversal }, still) => {
                let kd = (&options, traversal);
                Box::new(OnDevice::new(device()?, self.builder, kd, still, (first, groups))?)
            }
            (KdSpec::Host { options, traversal, traces_on_device }, still) => {
                let trees = match still {
                    Some(still) if way == AnimationMethod::Merge => {
                        let moving = scene.triangle_count() - triangles.len() as u64;
                        Trees::merged_into(still, moving as u32, options.costs)?
                    }
                    still => Trees::beside(still),
                };
                let rays = match (traces_on_device, self.device) {
                    (false, _) => KdRays::on_host(traversal),
                    (true, Some(device)) => KdRays::on_device(KdDevice::new(device, traversal)?),
                    (true, None) => {
                        return Err(Error::NoVulkan("rays are traced on a device, and none was opened".into()));
                    }
                };
                Box::new(OnHost::new(self.builder, options, (first, groups), trees, rays))
            }
        })
    }
}

/// One of the ways under way.
struct Running<'a> {
    way: AnimationMethod,
    subject: Box<dyn Subject + 'a>,
    /// Milliseconds of the builds of the frame.
    builds: Vec<f64>,
    /// The rays of the frame, by kind.
    rays: Vec<Rays>,
}

/// Measures these frames of a scene in every way of the stage. Points come as they are measured; `show` is called once a frame with
/// its scene and the first way, which has built it, and may trace rays by it.
///
/// A way that fails is noted and left out of what follows.
///
/// # Errors
/// Those of `point` and `show`; a frame has vertices that are not finite; no way is left.
pub fn measure<'a>(
    stage: &AnimateSetup<'a>,
    scene: &'a DynamicScene,
    frames: &[u32],
    point: &mut Sink<'_, AnimateEntry>,
    show: &mut dyn FnMut(u32, &Scene, &mut dyn Subject) -> Result<()>,
) -> Result<()> {
    let frame_of = |number: u32| -> Result<Frame<'a>> {
        let mut frame = Frame::new(scene, number)?;
        (stage.aim)(&mut frame.scene.camera);
        Ok(frame)
    };
    let Some(&first) = frames.first() else { return Ok(()) };
    let first = frame_of(first)?;
    let mut running = Vec::new();
    for &way in stage.ways {
        (stage.say)(&format!("{}: preparing {way}", scene.name));
        match stage.subject(way, &first) {
            Ok(subject) => running.push(Running { way, subject, builds: Vec::new(), rays: Vec::new() }),
            Err(error) => point(failure(way, None, &error))?,
        }
    }
    for (i, &number) in frames.iter().enumerate() {
        let frame = frame_of(number)?;
        (stage.say)(&format!("{}: frame {number}", scene.name));
        let warm_ups = u32::from(i == 0);
        let built = in_turn(&mut running, warm_ups, stage.runs, |running| {
            running.subject.place(&frame)?;
            Ok(running.subject.build()?.milliseconds)
        });
        keep(&mut running, built, number, point, |running, builds| running.builds = builds)?;
        show(number, &frame.scene, running[0].subject.as_mut())?;
        for &kind in stage.kinds {
            let leader = &mut running[0].subject;
            let rays =
                kinds::generate(kind, &frame.scene, &stage.rays, &mut |rays| leader.hits_of(rays, Query::ClosestHit))?;
            if rays.is_empty() {
                continue;
            }
            let traced = trace(stage, &mut running, warm_ups, kind, &rays);
            keep(&mut running, traced, number, point, |running, rays| running.rays.push(rays))?;
        }
        for Running { way, subject, builds, rays } in &mut running {
            for wrong in rays.iter().filter(|rays| rays.different > 0) {
                let what = format!(
                    "{} of {} {} rays have other hits than by {}",
                    wrong.different, wrong.count, wrong.rays, stage.ways[0]
                );
                point(failure(*way, Some(number), &hedgerow::Error::InvalidStructure(what).into()))?;
            }
            let [c_t, c_i] = stage.costs;
            let static_triangles = scene.static_mesh.triangles.len() as u64;
            point(AnimateEntry::Animate(Animated {
                scene: scene.name.clone(),
                frame: number,
                time: frame.time,
                way: *way,
                builder: subject.builder().to_owned(),
                timer: subject.timer().to_owned(),
                static_triangles,
                dynamic_triangles: scene.triangle_count() - static_triangles,
                build_ms: Spread::of_some(builds)?,
                trace: std::mem::take(rays),
                memory: subject.memory(),
                sah: subject.quality(c_t, c_i)?.sah,
            }))?;
        }
    }
    Ok(())
}

fn failure(way: AnimationMethod, frame: Option<u32>, error: &Error) -> AnimateEntry {
    AnimateEntry::Failure(Failure { at: WayInFrame { way, frame }, what: error.to_string() })
}

/// Hands each way its result with `take`. Those that failed are noted and run no more.
///
/// # Errors
/// Those of `point`; no way is left.
fn keep<T>(
    running: &mut Vec<Running<'_>>,
    results: Vec<Result<T>>,
    frame: u32,
    point: &mut Sink<'_, AnimateEntry>,
    take: impl Fn(&mut Running<'_>, T),
) -> Result<()> {
    for (mut one, result) in std::mem::take(running).into_iter().zip(results) {
        match result {
            Ok(value) => {
                take(&mut one, value);
                running.push(one);
            }
            Err(error) => point(failure(one.way, Some(frame), &error))?,
        }
    }
    if running.is_empty() {
        return Err(Error::Argument("no way is left, see the failures".into()));
    }
    Ok(())
}

/// The rays in every way, in turn, and their hits against those of the first.
fn trace(
    stage: &AnimateSetup<'_>,
    running: &mut [Running<'_>],
    warm_ups: u32,
    kind: RayKind,
    rays: &[Ray],
) -> Vec<Result<Rays>> {
    let query = kind.query();
    let set: Vec<Result<()>> = running.iter_mut().map(|running| running.subject.set_rays(rays)).collect();
    let times = in_turn(running, warm_ups, stage.runs, |running| running.subject.trace(query));
    let mut reference: Option<(Vec<Hit>, bool)> = None;
    let mut one = |running: &mut Running<'_>, times: Vec<f64>| {
        let hits = running.subject.hits()?;
        let is_kd = running.way != AnimationMethod::TwoLevel;
        let (expected, expected_is_kd) = reference.get_or_insert_with(|| (hits.clone(), is_kd));
        let is_exact = is_kd && *expected_is_kd;
        let is_other = |((ray, a), b): &((&Ray, &Hit), &Hit)| !is_same(is_exact, query, ray, a, b);
        let different = rays.iter().zip(&hits).zip(expected.iter()).filter(is_other).count() as u64;
        let met = || hits.iter().filter(|hit| hit.is_some());
        let work = running.subject.work(query)?;
        let mean = |of: fn(&Work) -> u32| mean_work(work.as_deref()?, of);
        Ok(Rays {
            rays: kind.name().to_owned(),
            count: rays.len() as u64,
            hits: met().count() as u64,
            trace_ms: Spread::of_some(&times)?,
            steps: mean(|work| work.steps),
            tests: mean(|work| work.tests),
            checksum: met().map(|hit| f64::from(hit.t)).sum::<f64>().to_string(),
            different,
        })
    };
    let all = running.iter_mut().zip(set).zip(times);
    all.map(|((running, set), times)| set.and(times).and_then(|times| one(running, times))).collect()
}

/// Kd-trees find the same bit for bit, however many there are; instances are met in spaces of their own.
fn is_same(is_exact: bool, query: Query, ray: &Ray, a: &Hit, b: &Hit) -> bool {
    match query {
        Query::AnyHit if is_exact => a.is_some() == b.is_some(),
        Query::ClosestHit if is_exact => a.t.to_bits() == b.t.to_bits() && a.primitive == b.primitive,
        _ => may_both_be_right(query, ray, a, b),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_ways_are_their_own_inverse() {
        for way in AnimationMethod::ALL {
            assert_eq!(way.name().parse::<AnimationMethod>().expect("a way"), way);
            assert_eq!(serde_json::to_value(way).expect("JSON"), way.name());
        }
        assert!(
            "two".parse::<AnimationMethod>().expect_err("no way").to_string().contains("use one of rebuild, two-trees")
        );
    }

    #[test]
    fn kd_trees_must_find_the_same_bits_and_instances_nearly_the_same() {
        let ray = Ray { origin: [0.0; 3], t_min: 0.0, direction: [0.0, 0.0, 1.0], t_max: 10.0 };
        let hit = |t: f32, primitive| Hit { t, primitive, u: 0.25, v: 0.25 };
        let (a, b) = (hit(1.0, 7), hit(1.0_f32.next_up(), 7));
        let same = |is_exact, a: &Hit, b: &Hit| is_same(is_exact, Query::ClosestHit, &ray, a, b);
        assert!(same(true, &a, &a) && !same(true, &a, &b) && same(false, &a, &b));
        assert!(!same(true, &a, &hit(1.0, 8)), "another primitive");
        assert!(!same(false, &a, &Hit::NONE) && !same(true, &a, &Hit::NONE));
        assert!(is_same(true, Query::AnyHit, &ray, &a, &hit(0.0, 9)));
    }
}
