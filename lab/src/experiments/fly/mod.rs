//! A camera that flies through a scene that stands, and trees that are built again at a cadence, each time taught by the frame before
//! (van Kralingen 2023, sections 5.1 and 5.2.3): what builds take, what rays take, and when a rebuild pays.
//!
//! A tree of a builder depends on the frame in which it is built and on nothing else, so cadences that build in one frame share the tree:
//! it is built and traced once. Under the clock is the build. What teaches it is not: those are rays that a frame has traced before.

pub mod cadence;
pub(crate) mod command;
mod fleet;
pub mod gain;
pub mod page;
pub mod points;

use crate::device::Device;
use crate::measure::overlap::Epo;
use crate::measure::{Failure, Sink, Spread, in_turn, mean_work};
use crate::rays::kinds::{self, RayKind, RayOptions};
use crate::scene::Flight;
use crate::subjects::builders::Spec;
use crate::{Error, Result};
use cadence::Cadence;
use fleet::{Fleet, Standing};
use hedgerow::trace::{Query, Ray};
use points::{BuilderInFrame, FlownRays, FlownTree, FlyEntry};

/// What is measured, and how.
#[derive(Clone, Copy)]
pub struct FlySetup<'a> {
    /// Where what is built or traced on a device is.
    pub device: Option<&'a Device>,
    /// The builders. Those that nothing teaches are flown at [`Cadence::Never`] alone: a rebuild would give the same tree.
    pub builders: &'a [Spec],
    /// The cadences, each at most once.
    pub cadences: &'a [Cadence],
    /// Kinds of rays.
    pub kinds: &'a [RayKind],
    /// Their number and seed; each frame has a seed of its own that follows from it.
    pub rays: RayOptions,
    /// Pixels of the pictures for which [`Cadence::Gain`] weighs builds against rays.
    pub frame_sizes: &'a [[u32; 2]],
    /// Counted runs of every trace, after one that warms up; builds are run once.
    pub runs: u32,
    /// Whether the end-point overlap of first trees is measured.
    pub epo: Epo,
    /// Is called with what is being done, for a progress bar.
    pub say: &'a dyn Fn(&str),
}

/// The seed of a frame's rays: no two frames of a flight share random numbers, so that the rays of the frame before are others even where
/// the camera stands.
fn seed_of(seed: u64, frame: u32) -> u64 {
    seed.wrapping_add(u64::from(frame).wrapping_mul(0x9e37_79b9_7f4a_7c15))
}

/// Flies through a scene with every builder at every cadence, frame by frame. Entries come as they are measured.
///
/// A builder that fails is noted and left out of what follows.
///
/// # Errors
/// Those of `point`; no builder is left.
pub fn measure<'a>(
    setup: &FlySetup<'a>,
    flight: &'a Flight,
    frames: &[u32],
    point: &mut Sink<'_, FlyEntry>,
) -> Result<()> {
    let name = &flight.scene.name;
    // The scene with the cameras of frames. The trees are over the mesh of the flight, which stays.
    let mut view = flight.scene.clone();
    let mut fleet = Fleet::new(setup, &flight.scene.mesh)?;
    for (i, &frame) in frames.iter().enumerate() {
        (setup.say)(&format!("{name}: frame {frame}, building"));
        let teacher = frames[i.saturating_sub(1)];
        view.camera = flight.camera(teacher);
        for (builder, error) in fleet.rebuild(setup, &view, (i, frame, teacher)) {
            point(failure(name, builder, Some(frame), &error))?;
        }
        fleet.must_fly()?;
        if i == 0 {
            for standing in &mut fleet.trees {
                let quality = standing.subject.quality(3.0, 2.0)?;
                point(FlyEntry::Tree(FlownTree {
                    scene: name.clone(),
                    builder: standing.subject.builder().to_owned(),
                    frame,
                    sah: quality.sah,
                    epo: standing.subject.epo(3.0, 2.0, setup.epo)?,
                }))?;
            }
        }
        (setup.say)(&format!("{name}: frame {frame}, tracing"));
        view.camera = flight.camera(frame);
        let options = RayOptions { seed: seed_of(setup.rays.seed, frame), ..setup.rays };
        for &kind in setup.kinds {
            let leader = &mut fleet.trees[0].subject;
            let rays = kinds::generate(kind, &view, &options, &mut |rays| leader.hits_of(rays, Query::ClosestHit))?;
            if rays.is_empty() {
                continue;
            }
            for (builder, error) in trace(setup, &mut fleet, kind, &rays) {
                point(failure(name, builder, Some(frame), &error))?;
            }
            fleet.must_fly()?;
        }
        for flown in fleet.observe(setup, name, frame)? {
            point(FlyEntry::Fly(flown))?;
        }
    }
    Ok(())
}

fn failure(scene: &str, builder: String, frame: Option<u32>, error: &Error) -> FlyEntry {
    let at = BuilderInFrame { scene: scene.to_owned(), builder, frame };
    FlyEntry::Failure(Failure { at, what: error.to_string() })
}

/// Traces rays through every tree in turn, and counts their work. Builders that failed leave the fleet, and are given with what happened.
fn trace(setup: &FlySetup<'_>, fleet: &mut Fleet<'_>, kind: RayKind, rays: &[Ray]) -> Vec<(String, Error)> {
    let query = kind.query();
    let set: Vec<Result<()>> = fleet.trees.iter_mut().map(|standing| standing.subject.set_rays(rays)).collect();
    let times = in_turn(&mut fleet.trees, 1, setup.runs, |standing| standing.subject.trace(query));
    let one = |standing: &mut Standing<'_>, times: Vec<f64>| -> Result<()> {
        let work = standing.subject.work(query)?;
        standing.rays.push(FlownRays {
            rays: kind.name().to_owned(),
            count: rays.len() as u64,
            trace_ms: Spread::of_some(&times)?.median,
            steps: mean_work(work.as_deref().unwrap_or_default(), |work| work.steps),
            tests: mean_work(work.as_deref().unwrap_or_default(), |work| work.tests),
        });
        standing.work.extend(work.into_iter().flatten());
        Ok(())
    };
    let all = fleet.trees.iter_mut().zip(set).zip(times);
    let failed: Vec<_> = all
        .filter_map(|((standing, set), times)| {
            let error = set.and(times).and_then(|times| one(standing, times)).err()?;
            Some((standing.builder, standing.subject.builder().to_owned(), error))
        })
        .collect();
    for (builder, ..) in &failed {
        fleet.leave(*builder);
    }
    let mut failed: Vec<(String, Error)> = failed.into_iter().map(|(_, name, error)| (name, error)).collect();
    failed.extend(fleet.trace_plain(rays, query));
    failed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_have_seeds_of_their_own() {
        let seeds: std::collections::BTreeSet<u64> = (0..10_000).map(|frame| seed_of(1, frame)).collect();
        assert_eq!((seeds.len(), seed_of(1, 0)), (10_000, 1));
    }
}
