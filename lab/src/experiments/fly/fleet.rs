//! The trees that stand, the cadences that fly with them, and when each is exchanged.

use super::FlySetup;
use super::cadence::Cadence;
use super::gain::{GainRule, Observed};
use super::points::{FlownFrame, FlownRays};
use crate::scene::{Mesh, Scene};
use crate::subjects::Subject;
use crate::subjects::builders::Spec;
use crate::{Error, Result};
use hedgerow::trace::{Query, Ray, Work};

/// Rays of a frame, at most, that `gain` looks at.
const PROBE: f64 = 16_384.0;
/// The part of a frame's rays, at most, that it looks at.
const PROBE_PART: f64 = 1.0 / 64.0;

/// A tree.
pub(super) struct Standing<'a> {
    /// Its builder, by number.
    pub builder: usize,
    /// The frame in which it was built.
    pub built_at: u32,
    /// The frame that taught it.
    pub taught_by: Option<u32>,
    /// What the build took.
    pub build_ms: f64,
    /// Rays and triangles that taught it.
    pub lesson: [Option<u64>; 2],
    /// The builder, which has built it.
    pub subject: Box<dyn Subject + 'a>,
    /// The rays of the frame, by kind.
    pub rays: Vec<FlownRays>,
    /// The work of each, of all kinds.
    pub work: Vec<Work>,
}

/// A plain tree, which the works of others are put beside.
struct Plain<'a> {
    spec: Spec,
    build_ms: f64,
    subject: Box<dyn Subject + 'a>,
    work: Vec<Work>,
}

/// A builder at a cadence.
struct Flyer {
    builder: usize,
    cadence: Cadence,
    /// Of `gain` alone.
    frame_size: Option<[u32; 2]>,
    rule: GainRule,
    /// The frame in which its tree was built.
    built_at: u32,
    build_ms: f64,
}

/// All of them.
pub(super) struct Fleet<'a> {
    mesh: &'a Mesh,
    /// By number.
    builders: &'a [Spec],
    /// What rays are traced through in a frame.
    pub trees: Vec<Standing<'a>>,
    plain: Vec<Plain<'a>>,
    flyers: Vec<Flyer>,
}

fn units(work: &Work) -> f64 {
    f64::from(3 * work.steps + 2 * work.tests)
}

impl<'a> Fleet<'a> {
    /// Every builder at every cadence; nothing is built yet but what `gain` puts others beside.
    ///
    /// # Errors
    /// A plain tree cannot be built.
    pub fn new(setup: &FlySetup<'a>, mesh: &'a Mesh) -> Result<Fleet<'a>> {
        let mut fleet =
            Fleet { mesh, builders: setup.builders, trees: Vec::new(), plain: Vec::new(), flyers: Vec::new() };
        for (builder, spec) in setup.builders.iter().enumerate() {
            if !spec.learns_from_a_view()? {
                fleet.add(builder, Cadence::Never, None);
                continue;
            }
            for &cadence in setup.cadences {
                match cadence {
                    Cadence::Gain => setup.frame_sizes.iter().for_each(|&size| fleet.add(builder, cadence, Some(size))),
                    _ => fleet.add(builder, cadence, None),
                }
            }
            let plain = spec.untaught();
            if setup.cadences.contains(&Cadence::Gain) && fleet.plain.iter().all(|other| other.spec != plain) {
                let mut subject = plain.make(setup.device, mesh)?;
                let build_ms = subject.build()?.milliseconds;
                fleet.plain.push(Plain { spec: plain, build_ms, subject, work: Vec::new() });
            }
        }
        Ok(fleet)
    }

    fn add(&mut self, builder: usize, cadence: Cadence, frame_size: Option<[u32; 2]>) {
        let rule = GainRule::default();
        self.flyers.push(Flyer { builder, cadence, frame_size, rule, built_at: 0, build_ms: 0.0 });
    }

    /// A builder flies no more.
    pub fn leave(&mut self, builder: usize) {
        self.flyers.retain(|flyer| flyer.builder != builder);
        self.trees.retain(|standing| standing.builder != builder);
    }

    /// # Errors
    /// Nothing flies.
    pub fn must_fly(&self) -> Result<()> {
        if self.trees.is_empty() {
            return Err(Error::Argument("no builder is left, see the failures".into()));
        }
        Ok(())
    }

    /// Builds what the cadences ask for, before the i-th frame, which has a number; `view` is the scene as its teacher saw it, another
    /// frame. Builders that failed leave, and are given with what happened.
    pub fn rebuild(
        &mut self,
        setup: &FlySetup<'a>,
        view: &Scene,
        (i, frame, teacher): (usize, u32, u32),
    ) -> Vec<(String, Error)> {
        let mut failed = Vec::new();
        for (builder, spec) in self.builders.iter().enumerate() {
            let asks = |flyer: &Flyer| match flyer.cadence {
                _ if i == 0 => true,
                Cadence::Never => false,
                Cadence::Every(frames) => i.is_multiple_of(frames.get() as usize),
                Cadence::Gain => flyer.rule.rebuilds(flyer.build_ms),
            };
            let of_builder = self.flyers.iter_mut().filter(|flyer| flyer.builder == builder);
            let mut asking: Vec<&mut Flyer> = of_builder.filter(|flyer| asks(flyer)).collect();
            if asking.is_empty() {
                continue;
            }
            match built(setup, spec, self.mesh, view) {
                Ok(mut standing) => {
                    let taught_by = spec.learns_from_a_view().is_ok_and(|learns| learns).then_some(teacher);
                    (standing.builder, standing.built_at, standing.taught_by) = (builder, frame, taught_by);
                    for flyer in &mut asking {
                        flyer.rule.rebuilt();
                        (flyer.built_at, flyer.build_ms) = (frame, standing.build_ms);
                    }
                    self.trees.push(standing);
                }
                Err(error) => {
                    failed.push((spec.to_string(), error));
                    self.leave(builder);
                }
            }
        }
        let flyers = &self.flyers;
        let is_flown = |standing: &Standing<'_>| {
            flyers.iter().any(|flyer| (flyer.builder, flyer.built_at) == (standing.builder, standing.built_at))
        };
        self.trees.retain(is_flown);
        failed
    }

    /// Counts the work of rays through the plain trees, if there are any.
    pub fn trace_plain(&mut self, rays: &[Ray], query: Query) -> Vec<(String, Error)> {
        let mut failed = Vec::new();
        for plain in &mut self.plain {
            match plain.subject.set_rays(rays).and_then(|()| plain.subject.work(query)) {
                Ok(work) => plain.work.extend(work.into_iter().flatten()),
                Err(error) => failed.push((plain.spec.to_string(), error)),
            }
        }
        failed
    }

    /// What the frame was by every cadence, for the records, and for the rule of `gain`; the figures of the frame are forgotten.
    ///
    /// # Errors
    /// `gain` has nothing to go by.
    pub fn observe(&mut self, setup: &FlySetup<'_>, scene: &str, frame: u32) -> Result<Vec<FlownFrame>> {
        let mut all = Vec::new();
        for flyer in &mut self.flyers {
            let key = (flyer.builder, flyer.built_at);
            let Some(standing) = self.trees.iter().find(|s| (s.builder, s.built_at) == key) else { continue };
            let spec = &self.builders[flyer.builder];
            let mut flown = FlownFrame {
                scene: scene.to_owned(),
                builder: spec.to_string(),
                cadence: flyer.cadence,
                frame_size: flyer.frame_size,
                frame,
                built_at: standing.built_at,
                taught_by: standing.taught_by,
                build_ms: if standing.built_at == frame { standing.build_ms } else { 0.0 },
                timer: standing.subject.timer().to_owned(),
                probe_ms: 0.0,
                ratio: None,
                trace: standing.rays.clone(),
                sample_rays: standing.lesson[0],
                seen_triangles: standing.lesson[1],
            };
            if let Some(size) = flyer.frame_size {
                let plain = spec.untaught();
                let plain = self.plain.iter().find(|other| other.spec == plain);
                let plain = plain.filter(|plain| !plain.work.is_empty() && plain.work.len() == standing.work.len());
                let Some(plain) = plain else {
                    let what = "its tracer counts no work, so that gain has nothing to go by; take another cadence";
                    return Err(Error::Argument(format!("{spec}: {what}")));
                };
                let probe = Probe::of(&flown, scale(size, setup.rays.size), [&standing.work, &plain.work]);
                flown.ratio = Some(probe.observed.ratio);
                flown.probe_ms = probe.milliseconds + if flyer.rule.is_new() { plain.build_ms } else { 0.0 };
                flyer.rule.observe(&probe.observed);
            }
            all.push(flown);
        }
        for standing in &mut self.trees {
            standing.rays.clear();
            standing.work.clear();
        }
        self.plain.iter_mut().for_each(|plain| plain.work.clear());
        Ok(all)
    }
}

/// How many times as many pixels a picture has.
pub(super) fn scale(picture: [u32; 2], measured: [u32; 2]) -> f64 {
    let pixels = |[width, height]: [u32; 2]| f64::from(width) * f64::from(height);
    pixels(picture) / pixels(measured)
}

/// A tree of `spec`, taught by `view`; its builder and frames are not said yet.
fn built<'a>(setup: &FlySetup<'a>, spec: &Spec, mesh: &'a Mesh, view: &Scene) -> Result<Standing<'a>> {
    let taught = spec.taught_by(setup.device, view)?;
    let lesson = [taught.rays(), taught.seen()];
    let mut subject = spec.make_taught(setup.device, mesh, taught)?;
    let build_ms = subject.build()?.milliseconds;
    let (rays, work) = (Vec::new(), Vec::new());
    Ok(Standing { builder: 0, built_at: 0, taught_by: None, build_ms, lesson, subject, rays, work })
}

/// A look at a sample of a frame's rays.
struct Probe {
    observed: Observed,
    /// What it takes.
    milliseconds: f64,
}

impl Probe {
    /// Of a frame with `scale` times as many rays as were traced, whose works through its own and the plain tree these are. As many rays
    /// are looked at as are charged, or all that were traced.
    fn of(flown: &FlownFrame, scale: f64, [own, plain]: [&[Work]; 2]) -> Probe {
        let rays = own.len() as f64;
        let charged = PROBE.min(rays * scale * PROBE_PART).max(1.0);
        let stride = (rays / charged).ceil().max(1.0) as usize;
        let mean = |all: &[Work]| {
            let looked_at = all.iter().step_by(stride);
            looked_at.clone().map(units).sum::<f64>() / looked_at.len() as f64
        };
        let (own_mean, plain_mean) = (mean(own), mean(plain));
        // Milliseconds of a unit of work.
        let price = flown.trace_ms() / own.iter().map(units).sum::<f64>().max(1.0);
        let ratio = if plain_mean > 0.0 { own_mean / plain_mean } else { 1.0 };
        Probe {
            observed: Observed { ratio, plain_ms: plain_mean * price * rays * scale },
            milliseconds: charged * (own_mean + plain_mean) * price,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flown(trace_ms: f64) -> FlownFrame {
        let rays = FlownRays { rays: "primary".into(), count: 1000, trace_ms, steps: None, tests: None };
        FlownFrame {
            scene: "scene".into(),
            builder: "binned".into(),
            cadence: Cadence::Gain,
            frame_size: Some([640, 480]),
            frame: 0,
            built_at: 0,
            taught_by: None,
            build_ms: 0.0,
            timer: "wall".into(),
            probe_ms: 0.0,
            ratio: None,
            trace: vec![rays],
            sample_rays: None,
            seen_triangles: None,
        }
    }

    #[test]
    fn a_probe_prices_work_by_what_the_frame_took_and_takes_a_64th_of_it() {
        // 3 · 4 + 2 · 4 = 20 a ray against 25 through the plain tree.
        let own = vec![Work { steps: 4, tests: 4, leaves: 1 }; 1000];
        let plain = vec![Work { steps: 5, tests: 5, leaves: 1 }; 1000];
        let probe = Probe::of(&flown(8.0), 64.0, [&own, &plain]);
        assert_eq!(probe.observed.ratio, 0.8);
        // 8 ms through its own tree are 10 through the plain one, 64 times as many rays.
        assert!((probe.observed.plain_ms - 640.0).abs() < 1e-9, "{:?}", probe.observed);
        // A 64th of these rays is what was traced: once through each.
        assert!((probe.milliseconds - 18.0).abs() < 1e-9, "{}", probe.milliseconds);
        // Never more rays than are needed: 16,384 of 6.4 million.
        let large = Probe::of(&flown(8.0), 6400.0, [&own, &plain]);
        assert!((large.milliseconds - 18.0 * 16.384).abs() < 1e-6, "{}", large.milliseconds);
    }

    #[test]
    fn pictures_are_compared_by_pixels() {
        assert_eq!(scale([1280, 720], [160, 90]), 64.0);
    }
}
