//! The whole matrix for one scene: every builder built and traced in turn, checked, and written down.
//!
//! Everything that is compared runs in turn in one process (A B A B), after a warm-up that does not count: the first run of
//! a shader compiles it. A builder that fails is left out from there on; the others go on.

use crate::device::Device;
use crate::measure::agreement::{Sample, wrong_where_different};
use crate::measure::overlap::Epo;
use crate::measure::provenance::{self, Machine};
use crate::measure::record::{BuildRecord, PhaseRecord, Record, SCHEMA, TraceRecord};
use crate::measure::setting::Failure;
use crate::measure::statistics::{Spread, in_turn, mean_work};
use crate::rays::kinds::{self, RayKind, RayOptions};
use crate::scene::Scene;
use crate::subjects::builders::Spec;
use crate::subjects::{BuildRun, InPool, Subject};
use crate::{Error, Result};
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::layout::Bvh2;
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::lbvh;
use hedgerow::trace::twin::tracer as host;
use hedgerow::trace::{Hit, Query, Ray, Work};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Runs that do not count, before those that do.
const WARM_UPS: u32 = 1;
/// Triangle tests that brute force may take for each kind of ray.
const BRUTE_FORCE_TESTS: usize = 20_000_000;
/// The rays of the leaf count variability: incoherent ones from the surfaces, one from each primary hit.
pub(crate) const LCV_RAYS: RayKind = RayKind::Diffuse1;
/// Rays that differ between two builders of which brute force looks at, at most.
const DIFFERENCES: usize = 16;

/// What is measured on every scene.
#[derive(Debug, Clone)]
pub struct BenchPlan {
    /// The builders.
    pub builders: Vec<Spec>,
    /// Counted runs of every build and of every trace.
    pub runs: u32,
    /// Kinds of rays.
    pub kinds: Vec<RayKind>,
    /// Their number and seed.
    pub rays: RayOptions,
    /// Cost of a traversal step in the SAH.
    pub c_t: f64,
    /// Cost of a triangle test in the SAH.
    pub c_i: f64,
    /// Whether the end-point overlap is measured.
    pub epo: Epo,
    /// Whether phases of builds are the device's kernels.
    pub by_kernel: bool,
}

/// What one builder gave on one scene.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// The figures.
    pub record: Record,
    /// What the builder chose, see [`Subject::choice`].
    pub choice: Option<String>,
    /// Bytes that each phase of the record must move, see [`Subject::traffic`].
    pub traffic: Vec<Option<u64>>,
    /// Why `record.valid` is false.
    pub faults: Vec<String>,
}

/// A builder on a scene; no builder where the scene itself failed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OnScene {
    /// The scene.
    pub scene: String,
    /// The builder.
    pub builder: Option<String>,
}

impl OnScene {
    /// What went wrong with a builder on a scene, or with the scene itself.
    pub fn failure(scene: &str, builder: Option<&Spec>, what: impl ToString) -> Failure<OnScene> {
        let at = OnScene { scene: scene.to_owned(), builder: builder.map(Spec::to_string) };
        Failure { at, what: what.to_string() }
    }
}

impl fmt::Display for OnScene {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.scene)?;
        self.builder.as_ref().map_or(Ok(()), |builder| write!(f, ", {builder}"))
    }
}

/// A subject that takes part in the rounds.
pub struct Entrant<'a> {
    /// The subject.
    pub subject: Box<dyn Subject + 'a>,
    /// Whether rays go through what it builds; otherwise it is built, and its tree measured, but for the end-point overlap.
    pub is_traced: bool,
}

/// Gives, of a subject whose tree is measured, subjects that trace the same tree in other ways. They have records of their own,
/// with the figures of the build.
pub type Besides<'b, 'a> = dyn FnMut(&mut dyn Subject) -> Result<Vec<Box<dyn Subject + 'a>>> + 'b;

/// A builder under measurement.
struct Entry<'a> {
    subject: Box<dyn Subject + 'a>,
    record: Record,
    faults: Vec<String>,
    failure: Option<Error>,
    is_traced: bool,
}

/// Measures every builder of `plan` on `scene`. `say` is called with what is being done, for a progress bar.
pub fn measure(
    scene: &Scene,
    device: Option<&Device>,
    plan: &BenchPlan,
    say: &mut dyn FnMut(&str),
) -> (Vec<Outcome>, Vec<Failure<OnScene>>) {
    let (mut entrants, mut failures) = (Vec::new(), Vec::new());
    for spec in &plan.builders {
        let made = spec.make_for(device, scene).and_then(|mut subject| {
            if plan.by_kernel {
                subject.time_kernels()?;
            }
            Ok(subject)
        });
        match made {
            Ok(subject) => entrants.push(Entrant { subject, is_traced: true }),
            Err(error) => failures.push(OnScene::failure(&scene.name, Some(spec), error)),
        }
    }
    let (outcomes, more) = measure_subjects(scene, device, entrants, plan, &mut |_| Ok(Vec::new()), say);
    failures.extend(more);
    (outcomes, failures)
}

/// Measures subjects on `scene` as `plan` has it, whose builders are not looked at.
pub fn measure_subjects<'a>(
    scene: &Scene,
    device: Option<&Device>,
    entrants: Vec<Entrant<'a>>,
    plan: &BenchPlan,
    besides: &mut Besides<'_, 'a>,
    say: &mut dyn FnMut(&str),
) -> (Vec<Outcome>, Vec<Failure<OnScene>>) {
    let entry = |Entrant { subject, is_traced }| {
        let record = blank(scene, device, &*subject);
        Entry { subject, record, faults: Vec::new(), failure: None, is_traced }
    };
    let mut failures = Vec::new();
    let mut rounds = Rounds { entries: entrants.into_iter().map(entry).collect() };

    say("building");
    let builds = all_rounds(rounds.live(), plan.runs, |entry| entry.subject.build());
    for (entry, runs) in builds {
        entry.record.build = build_of(entry.subject.timer(), &runs);
    }
    say("validating");
    once(rounds.live(), |entry| {
        entry.record.memory = entry.subject.memory();
        entry.record.quality = entry.subject.quality(plan.c_t, plan.c_i)?;
        let epo = if entry.is_traced { plan.epo } else { Epo::Off };
        entry.record.quality.epo = entry.subject.epo(plan.c_t, plan.c_i, epo)?;
        match entry.subject.validate() {
            Err(error @ Error::Library(hedgerow::Error::InvalidStructure(_))) => entry.faults.push(error.to_string()),
            other => other?,
        }
        Ok(())
    });

    rounds.entries = rounds.entries.into_iter().flat_map(|entry| with_others(entry, scene, device, besides)).collect();

    // Rays follow from hits. Those of a plain tree on the host are the same on every machine and for every builder.
    let mesh = &scene.mesh;
    let reference = lbvh::build(&mesh.positions, &mesh.triangles, Code::Mc63.full(), Collapse::SAH);
    let mut closest_hits = Remembered { tree: &reference, last: Vec::new() };
    // Where no kind is asked for, that of the leaf count variability is traced.
    let kinds = if plan.kinds.is_empty() { &[LCV_RAYS] } else { &plan.kinds[..] };
    for &kind in kinds {
        say(&format!("tracing {kind} rays"));
        let rays = kinds::generate(kind, scene, &plan.rays, &mut |rays| Ok(closest_hits.of(rays)));
        match rays {
            // Where nothing is hit there is nothing to follow: the kind is left out of the records.
            Ok(rays) if rays.is_empty() => {}
            Ok(rays) if !plan.kinds.contains(&kind) => rounds.variability(kind, &rays),
            Ok(rays) => rounds.trace(kind, &rays, plan.runs, &reference),
            Err(error) => failures.push(OnScene::failure(&scene.name, None, format!("{kind} rays: {error}"))),
        }
    }

    let mut outcomes = Vec::new();
    for entry in rounds.entries {
        let Entry { subject, mut record, faults, failure, is_traced } = entry;
        if let Some(error) = failure {
            let at = OnScene { scene: scene.name.clone(), builder: Some(record.builder) };
            failures.push(Failure { at, what: error.to_string() });
            continue;
        }
        record.valid = (is_traced || !faults.is_empty()).then_some(faults.is_empty());
        let traffic = record.build.phases.iter().map(|phase| subject.traffic(&phase.name)).collect();
        outcomes.push(Outcome { choice: subject.choice(), traffic, record, faults });
    }
    (outcomes, failures)
}

/// An entry whose tree is measured, and behind it those of the subjects that trace the same tree.
fn with_others<'a>(
    mut entry: Entry<'a>,
    scene: &Scene,
    device: Option<&Device>,
    besides: &mut Besides<'_, 'a>,
) -> Vec<Entry<'a>> {
    if entry.failure.is_some() {
        return vec![entry];
    }
    let others = match besides(entry.subject.as_mut()) {
        Ok(others) => others,
        Err(error) => {
            entry.failure = Some(error);
            return vec![entry];
        }
    };
    let mut all = vec![entry];
    for subject in others {
        let Entry { record: of_build, faults, .. } = &all[0];
        let record = Record {
            build: of_build.build.clone(),
            memory: of_build.memory.clone(),
            quality: of_build.quality.clone(),
            ..blank(scene, device, &*subject)
        };
        let faults = faults.clone();
        all.push(Entry { subject, record, faults, failure: None, is_traced: true });
    }
    all
}

/// The record before anything was measured.
fn blank(scene: &Scene, device: Option<&Device>, subject: &dyn Subject) -> Record {
    let (device, driver, subgroup) = match device.filter(|_| subject.traces_on_device()).map(Device::found) {
        Some(found) => (found.name.clone(), found.driver.clone(), found.subgroup_size),
        None => (Machine::this().cpu, format!("hedgerow {}", env!("CARGO_PKG_VERSION")), 0),
    };
    Record {
        schema: SCHEMA,
        scene: scene.name.clone(),
        triangles: scene.mesh.triangles.len() as u64,
        builder: subject.builder().to_owned(),
        kind: subject.kind().to_owned(),
        device,
        driver,
        subgroup,
        commit: provenance::commit(),
        when: provenance::now(),
        build: build_of(subject.timer(), &[]),
        memory: Default::default(),
        quality: Default::default(),
        trace: Vec::new(),
        valid: None,
    }
}

/// Medians of the runs; each phase's by itself.
fn build_of(timer: &str, runs: &[BuildRun]) -> BuildRecord {
    let times: Vec<f64> = runs.iter().map(|run| run.milliseconds).collect();
    let spread = Spread::of(&times).unwrap_or(Spread { runs: 0, ..Spread::once(0.0) });
    let names = runs.first().map_or(&[][..], |run| &run.phases);
    let phase = |(i, phase): (usize, &hedgerow::gpu::Phase)| {
        let times: Vec<f64> = runs.iter().filter_map(|run| Some(run.phases.get(i)?.milliseconds)).collect();
        PhaseRecord { name: phase.name.to_owned(), median_ms: Spread::of(&times).map_or(0.0, |s| s.median) }
    };
    let on_cpu: Vec<f64> = runs.iter().filter_map(|run| Some(run.on_cpu?.milliseconds)).collect();
    let cpu = Spread::of(&on_cpu);
    let of_pool = |figure: fn(&InPool) -> f64| {
        Spread::of(&runs.iter().filter_map(|run| Some(figure(run.pool.as_ref()?))).collect::<Vec<_>>())
            .map(|s| s.median)
    };
    BuildRecord {
        runs: spread.runs,
        median_ms: spread.median,
        min_ms: spread.min,
        max_ms: spread.max,
        timer: timer.to_owned(),
        phases: names.iter().enumerate().map(phase).collect(),
        threads: runs.last().and_then(|run| run.on_cpu).map(|on_cpu| on_cpu.threads),
        cpu_median_ms: cpu.map(|cpu| cpu.median),
        cpu_min_ms: cpu.map(|cpu| cpu.min),
        cpu_max_ms: cpu.map(|cpu| cpu.max),
        pool_ms: of_pool(|pool| pool.milliseconds),
        retrievals: of_pool(|pool| pool.retrievals.into()).map(|n| n as u64),
        skipped_retrievals: of_pool(|pool| pool.skipped.into()).map(|n| n as u64),
    }
}

/// Closest hits on the host, of the last few sets of rays: primary rays are asked for by most kinds.
struct Remembered<'a> {
    tree: &'a Bvh2,
    last: Vec<(Vec<Ray>, Vec<Hit>)>,
}

impl Remembered<'_> {
    fn of(&mut self, rays: &[Ray]) -> Vec<Hit> {
        if let Some((_, hits)) = self.last.iter().find(|(known, _)| known == rays) {
            return hits.clone();
        }
        let hits: Vec<Hit> = rays.par_iter().map(|ray| host::closest_hit(self.tree, ray)).collect();
        if self.last.len() == 2 {
            self.last.pop();
        }
        self.last.push((rays.to_vec(), hits.clone()));
        hits
    }
}

/// The builders that have not failed, run in turn.
struct Rounds<'a> {
    entries: Vec<Entry<'a>>,
}

impl<'a> Rounds<'a> {
    fn live(&mut self) -> Vec<&mut Entry<'a>> {
        self.entries.iter_mut().filter(|entry| entry.failure.is_none()).collect()
    }

    /// Those of them that rays go through.
    fn traced(&mut self) -> Vec<&mut Entry<'a>> {
        self.live().into_iter().filter(|entry| entry.is_traced).collect()
    }

    /// Traces `rays` with every builder for the leaves that they visit, and nothing else.
    fn variability(&mut self, kind: RayKind, rays: &[Ray]) {
        once(self.traced(), |entry| {
            entry.subject.set_rays(rays)?;
            entry.record.quality.lcv = entry.subject.work(kind.query())?.as_deref().and_then(leaf_count_variability);
            Ok(())
        });
    }

    /// Traces `rays` with every builder and compares what they hit.
    fn trace(&mut self, kind: RayKind, rays: &[Ray], runs: u32, truth: &Bvh2) {
        let query = kind.query();
        once(self.traced(), |entry| entry.subject.set_rays(rays));
        let speeds: Vec<Option<Spread>> = {
            let runs = all_rounds(self.traced(), runs, |entry| entry.subject.trace(query));
            runs.iter().map(|(_, times)| Spread::of(times)).collect()
        };
        let sample = Sample::take(truth, rays, query, BRUTE_FORCE_TESTS);
        let mut reference: Option<(String, Vec<Hit>)> = None;
        let mut speeds = speeds.into_iter();
        once(self.traced(), |entry| {
            let milliseconds = speeds.next().flatten().map_or(f64::NAN, |s| s.median);
            let hits = entry.subject.hits()?;
            if let Some((i, truth)) = sample.first_wrong(rays, &hits) {
                entry.faults.push(format!("{kind} ray {i}: found {:?}, brute force {truth:?}", hits[i]));
            }
            match &reference {
                None => reference = Some((entry.record.builder.clone(), hits.clone())),
                Some((other, others)) => {
                    let wrong = wrong_where_different(truth, rays, query, (&hits, others), DIFFERENCES);
                    if wrong > 0 {
                        let fault = format!("{wrong} {kind} rays differ from {other} and are wrong by brute force");
                        entry.faults.push(fault);
                    }
                }
            }
            let work = entry.subject.work(query)?;
            if kind == LCV_RAYS {
                entry.record.quality.lcv = work.as_deref().and_then(leaf_count_variability);
            }
            let mean = |of: fn(&Work) -> u32| mean_work(work.as_deref()?, of);
            entry.record.trace.push(TraceRecord {
                rays: kind.to_string(),
                count: rays.len() as u64,
                hits: hits.iter().filter(|hit| hit.is_some()).count() as u64,
                mrays_s: rays.len() as f64 / (milliseconds * 1e3),
                steps: mean(|w| w.steps),
                tests: mean(|w| w.tests),
                runs,
                checksum: checksum(query, &hits).to_string(),
            });
            Ok(())
        });
    }
}

/// The samples of every builder that goes through all rounds; the others are marked as failed.
fn all_rounds<'e, 'a, T>(
    mut entries: Vec<&'e mut Entry<'a>>,
    runs: u32,
    mut run: impl FnMut(&mut Entry<'a>) -> Result<T>,
) -> Vec<(&'e mut Entry<'a>, Vec<T>)> {
    let samples = in_turn(&mut entries, WARM_UPS, runs, |entry| run(entry));
    let mut collected = Vec::new();
    for (entry, samples) in entries.into_iter().zip(samples) {
        match samples {
            Ok(samples) => collected.push((entry, samples)),
            Err(error) => entry.failure = Some(error),
        }
    }
    collected
}

/// Once for every builder, no clock running.
fn once<'a>(entries: Vec<&mut Entry<'a>>, mut run: impl FnMut(&mut Entry<'a>) -> Result<()>) {
    for entry in entries {
        entry.failure = run(entry).err();
    }
}

/// Standard deviation of the number of leaves that a ray visits (Aila, Karras, Laine 2013, section 3.3); `None` without rays.
pub(crate) fn leaf_count_variability(work: &[Work]) -> Option<f64> {
    let mean = |of: &dyn Fn(f64) -> f64| work.iter().map(|w| of(f64::from(w.leaves))).sum::<f64>() / work.len() as f64;
    let leaves = mean(&|leaves| leaves);
    (!work.is_empty()).then(|| mean(&|l| (l - leaves).powi(2)).sqrt())
}

/// Sum of t over the hits; of an any-hit query, the number of hits.
fn checksum(query: Query, hits: &[Hit]) -> f64 {
    let hits = hits.iter().filter(|hit| hit.is_some());
    match query {
        // From +0: the sum of no floats is −0.
        Query::ClosestHit => hits.fold(0.0, |sum, hit| sum + f64::from(hit.t)),
        Query::AnyHit => hits.count() as f64,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{self, LoadOptions};
    use crate::subjects::{OnCpu, builders};

    fn plan(builders: &str) -> BenchPlan {
        BenchPlan {
            builders: builders::parse_list(builders).expect("known builders"),
            runs: 2,
            kinds: RayKind::ALL.to_vec(),
            rays: RayOptions { size: [16, 12], seed: 1 },
            c_t: 3.0,
            c_i: 2.0,
            epo: Epo::On,
            by_kernel: false,
        }
    }

    #[test]
    fn every_builder_is_measured_validated_and_traced_with_every_kind() {
        let scene = scene::load("gen:stadium:3", &LoadOptions::default()).expect("a generator");
        let plan = plan("lbvh-host,lbvh-host:collapse=off");
        let (outcomes, failures) = measure(&scene, None, &plan, &mut |_| {});
        assert!(failures.is_empty(), "{failures:?}");
        assert_eq!(outcomes.len(), 2);
        for outcome in &outcomes {
            let record = &outcome.record;
            assert_eq!(record.valid, Some(true), "{:?}", outcome.faults);
            assert_eq!((record.build.runs, record.trace.len()), (2, RayKind::ALL.len()));
            assert!(record.build.min_ms <= record.build.median_ms && record.build.median_ms <= record.build.max_ms);
            assert_eq!(record.quality.refs, Some(record.triangles));
            let sums = record.quality.sah_inner.zip(record.quality.sah_leaf);
            assert_eq!(record.quality.sah, sums.map(|(inner, leaf)| 3.0 * inner + 2.0 * leaf));
            assert!(record.quality.epo.is_some_and(|epo| epo > 0.0), "{:?}", record.quality);
            assert!(record.quality.lcv.is_some_and(|lcv| lcv > 0.0), "{:?}", record.quality);
            let primary = record.rays("primary").expect("traced");
            assert_eq!(primary.count, 16 * 12);
            assert!(primary.steps.is_some_and(|steps| steps > 0.0), "{primary:?}");
        }
        let [collapsed, flat] = &outcomes[..] else { panic!("two builders") };
        assert!(collapsed.record.quality.sah < flat.record.quality.sah, "collapsing lowers the cost");
        for (a, b) in collapsed.record.trace.iter().zip(&flat.record.trace) {
            assert_eq!((a.hits, &a.checksum), (b.hits, &b.checksum), "{} rays hit the same in both trees", a.rays);
        }
    }

    #[test]
    fn a_builder_that_needs_a_device_fails_alone() {
        let scene = scene::load("gen:icosphere:2", &LoadOptions::default()).expect("a generator");
        let (outcomes, failures) = measure(&scene, None, &plan("driver-fast-build,lbvh-host"), &mut |_| {});
        assert_eq!(outcomes.len(), 1);
        assert_eq!(failures[0].at.builder.as_deref(), Some("driver-fast-build"));
    }

    #[test]
    fn leaves_are_counted_even_where_no_kind_is_traced() {
        let scene = scene::load("gen:stadium:3", &LoadOptions::default()).expect("a generator");
        let plan = BenchPlan { kinds: Vec::new(), epo: Epo::Off, ..plan("lbvh-host") };
        let (outcomes, _) = measure(&scene, None, &plan, &mut |_| {});
        let record = &outcomes[0].record;
        assert!(record.trace.is_empty() && record.quality.lcv.is_some() && record.quality.epo.is_none(), "{record:?}");
    }

    #[test]
    fn variability_is_the_standard_deviation_of_the_leaves() {
        let work = |leaves| Work { leaves, ..Work::default() };
        // Mean 5, variance (9 + 1 + 1 + 9) / 4.
        let lcv = leaf_count_variability(&[work(2), work(4), work(6), work(8)]).expect("four rays");
        assert!((lcv - 5.0f64.sqrt()).abs() < 1e-12, "{lcv}");
        assert_eq!(leaf_count_variability(&[]), None);
    }

    #[test]
    fn medians_of_builds_are_taken_phase_by_phase() {
        let run = |a, b| BuildRun {
            pool: Some(InPool { milliseconds: b, retrievals: 2 * a as u32, skipped: 7 }),
            on_cpu: Some(OnCpu { threads: 2, milliseconds: 2.0 * b }),
            ..BuildRun::of(vec![
                hedgerow::gpu::Phase { name: "sort", milliseconds: a },
                hedgerow::gpu::Phase { name: "hierarchy", milliseconds: b },
            ])
        };
        let build = build_of("device", &[run(1.0, 9.0), run(2.0, 4.0), run(3.0, 5.0)]);
        assert_eq!((build.median_ms, build.min_ms, build.max_ms, build.runs), (8.0, 6.0, 10.0, 3));
        let medians: Vec<_> = build.phases.iter().map(|p| (p.name.as_str(), p.median_ms)).collect();
        assert_eq!(medians, [("sort", 2.0), ("hierarchy", 5.0)]);
        assert_eq!((build.threads, build.cpu_median_ms), (Some(2), Some(10.0)));
        assert_eq!((build.cpu_min_ms, build.cpu_max_ms), (Some(8.0), Some(18.0)));
        assert_eq!((build.pool_ms, build.retrievals, build.skipped_retrievals), (Some(5.0), Some(4), Some(7)));
    }
}
