//! `hedgerow bench`: the whole matrix of scenes, builders and rays; records as they are measured, and the report.

use super::page::{Picture, Report};
use crate::cli::options::{Costs, Kinds, Size, perhaps_empty};
use crate::cli::{Bar, Common, work};
use crate::device::Device;
use crate::experiments::bench::kd_trees::{self, published};
use crate::experiments::bench::matrix::{self, BenchPlan, OnScene, Outcome};
use crate::experiments::bench::results;
use crate::experiments::bench::shard::Shard;
use crate::experiments::choose::command::calibrated;
use crate::experiments::choose::{CostTable, candidates, hindsight};
use crate::measure::overlap::Epo;
use crate::measure::setting::{Failure, Setting};
use crate::report::lines::Lines;
use crate::report::names::slug;
use crate::report::picture::{PictureOptions, View, picture};
use crate::report::table;
use crate::scene::{self, Scene};
use crate::subjects::builders::{self, Needs, Spec};
use crate::subjects::peers::driver;
use anyhow::{Context, bail};
use std::io::Write;
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};

/// What is measured where `-b` does not say: from the fastest build to the fastest rays, on the device and the host, and those of others. A tree
/// of the host is traced on the device, as the others are: then its speed says what the tree is worth.
const DEFAULT_BUILDERS: &str = if cfg!(feature = "peer-obvhs") {
    "lbvh,hlbvh,ploc,hploc,hploc:width=8q,hploc:optimise=fast,kd-gpu,binned:trace=device,driver-fast-build,driver-fast-trace,obvhs-fastest"
} else {
    "lbvh,hlbvh,ploc,hploc,hploc:width=8q,hploc:optimise=fast,kd-gpu,binned:trace=device,driver-fast-build,driver-fast-trace"
};
/// Pixels of the report's pictures.
const PICTURE: [u32; 2] = [480, 320];

/// Measure every builder on every scene with every kind of ray, and write records, charts and a page
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Scenes: files, bare names, generators, or folders of scene files [default: those in scenes/]
    #[arg(value_name = "SCENE")]
    scenes: Vec<String>,
    /// Every scene file of --scenes-dir, beside the scenes named
    #[arg(long)]
    all: bool,
    /// Builders with their options, separated by commas, or all
    #[arg(short, long, value_name = "BUILDER[,BUILDER…]", default_value = DEFAULT_BUILDERS)]
    builder: String,
    /// Kinds of rays, separated by commas, or all
    #[arg(long, value_name = "KIND[,KIND…]", default_value = "all")]
    rays: Kinds,
    /// Pixels of the picture that the rays belong to
    #[arg(long, value_name = "WxH", default_value = "256x192")]
    size: Size,
    /// Counted runs of every build and trace, after one that warms up
    #[arg(long, value_name = "N", default_value = "5")]
    runs: NonZeroU32,
    /// Costs of a traversal step and of a triangle test in the SAH
    #[arg(long, value_name = "C_T,C_I", default_value = "3,2")]
    costs: Costs,
    /// Measure the end-point overlap: on, off, or cheap (given up after 5 s a tree)
    #[arg(long, value_name = "on|off|cheap", default_value = "cheap")]
    epo: Epo,
    /// Published figures of kd-trees to print beside measured ones [default: those of Papay 2025]
    #[arg(long, env = "HEDGEROW_PUBLISHED", value_name = "CSV", value_parser = perhaps_empty())]
    published: Option<PathBuf>,
    /// No pictures of the scenes
    #[arg(long)]
    no_pictures: bool,
    /// Take the I-th of N shares of the scenes, I from 1, each scene with all its builders
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
    /// The folder for results.jsonl, results.csv, charts and index.html
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> anyhow::Result<()> {
    let asked = common.builders(&builders::parse_list(&arguments.builder)?);
    let scenes = shared(common, arguments, scenes(common, arguments)?);
    let published = arguments.published.as_deref().filter(|file| !file.as_os_str().is_empty());
    let published = published.map_or_else(|| Ok(published::papay()), published::read)?;
    // Before any work: a folder that cannot be written would lose all of it.
    let results = results::create(&arguments.output)?;
    // Host builders alone need no device. One is opened with ray queries where it has them.
    let needs_device = asked.iter().any(|spec| spec.needs() != Needs::Nothing);
    let device = needs_device.then(|| common.open_device(true)).transpose()?;
    let no_peer = device.as_ref().and_then(|device| driver::note(device.found()));
    let mut notes = Vec::new();
    let mut builders = possible(asked, arguments, device.as_ref(), no_peer.as_deref(), &mut notes)?;
    let chooses = builders.iter().any(|spec| spec.builder().name == "auto");
    let costs = device.as_ref().filter(|_| chooses).map(|device| calibrated(common, device, false)).transpose()?;
    if let (Some(_), Some(device)) = (&costs, &device) {
        // A choice can be held against the best only where all that could have been chosen are measured.
        for spec in candidates::possible(device) {
            if !builders.contains(&spec) {
                builders.push(spec);
            }
        }
    }
    let plan = BenchPlan {
        builders,
        runs: arguments.runs.get(),
        kinds: arguments.rays.0.clone(),
        rays: arguments.size.rays(common.seed),
        c_t: arguments.costs.step,
        c_i: arguments.costs.test,
        epo: arguments.epo,
        by_kernel: false,
    };
    let options = [
        ("Runs", format!("{} after a warm-up, in turn", arguments.runs)),
        ("Image", format!("{}, seed {}", arguments.size, common.seed)),
        ("Host threads", common.threads.map_or("one a core".into(), |n| n.to_string())),
    ];
    let setting = Setting::of(device.as_ref(), &options, notes)?;
    let baseline = no_peer.is_none().then(|| "driver-fast-build".into());
    let report = Report { published, baseline, ..Report::new(setting) };
    report.write_setting(&arguments.output)?;
    let mut bench = Bench { common, arguments, device: device.as_ref(), plan, costs, results, report };
    for scene in &scenes {
        bench.scene(scene)?;
    }
    let report = &bench.report;
    report.write(&arguments.output)?;
    let mut out = std::io::stdout().lock();
    writeln!(out, "{}", table::table(&report.records()))?;
    if let Some(tables) = kd_trees::text(&report.records(), &report.published) {
        writeln!(out, "{tables}")?;
    }
    drop(out);
    let faults = report.outcomes.iter().map(|o| o.faults.len()).sum::<usize>();
    work::page_written(device.as_ref(), &arguments.output.join("index.html"), report.failures.len() + faults)
}

/// What the scene arguments name: folders become the scene files in them.
fn scenes(common: &Common, arguments: &Arguments) -> anyhow::Result<Vec<String>> {
    let in_folder = |folder: &Path| -> anyhow::Result<Vec<String>> {
        let files = scene::list(folder)?;
        if files.is_empty() {
            bail!("{} holds no scene files; name another folder, or scenes", folder.display());
        }
        Ok(files.iter().map(|file| file.display().to_string()).collect())
    };
    let mut scenes = Vec::new();
    for name in &arguments.scenes {
        let folder = Path::new(name);
        if folder.is_dir() { scenes.extend(in_folder(folder)?) } else { scenes.push(name.clone()) }
    }
    if arguments.all {
        let folder = common.scenes_dir().ok_or_else(|| {
            crate::Error::Argument(
                "--all takes the scenes of a folder; name it with --scenes-dir or HEDGEROW_SCENES".into(),
            )
        })?;
        scenes.extend(in_folder(folder)?);
    }
    if scenes.is_empty() {
        let own = scene::own_folders().into_iter().find(|folder| folder.is_dir());
        let folder = own.context("there is no folder scenes/ here; name scenes, or a folder of them")?;
        scenes = in_folder(&folder)?;
    }
    Ok(scenes)
}

/// The scenes of the share that is asked for.
fn shared(common: &Common, arguments: &Arguments, scenes: Vec<String>) -> Vec<String> {
    let Some(shard) = arguments.shard else { return scenes };
    let folders = common.scene_folders();
    let costs: Vec<u64> = scenes.iter().map(|scene| scene::weight(scene, &folders)).collect();
    let own = shard.of(&costs);
    if own.is_empty() && !common.quiet {
        eprintln!("hedgerow: share {} of {} has none of the {} scenes", shard.index, shard.count, scenes.len());
    }
    own.into_iter().map(|i| scenes[i].clone()).collect()
}

/// The builders that can be measured. One that was named stays, and fails where it must; one that came with `all` or by
/// default is left out, with a note.
fn possible(
    asked: Vec<Spec>,
    arguments: &Arguments,
    device: Option<&Device>,
    no_peer: Option<&str>,
    notes: &mut Vec<String>,
) -> anyhow::Result<Vec<Spec>> {
    let by_default = arguments.builder == DEFAULT_BUILDERS;
    let was_named =
        |spec: &Spec| !by_default && arguments.builder.split(',').any(|part| part.trim() == spec.to_string());
    let is_driver = |spec: &Spec| spec.needs() == Needs::RayQuery;
    if asked.iter().any(is_driver) {
        notes.extend(no_peer.map(str::to_owned));
        notes.extend(device.and_then(driver::missing));
    }
    let keep = |spec: &Spec| {
        was_named(spec) || spec.is_possible(device) && !(by_default && is_driver(spec) && no_peer.is_some())
    };
    let kept: Vec<Spec> = asked.into_iter().filter(keep).collect();
    if kept.is_empty() {
        bail!("none of the builders can work here: {}; choose others with -b", arguments.builder);
    }
    Ok(kept)
}

/// A benchmark under way.
struct Bench<'a> {
    common: &'a Common,
    arguments: &'a Arguments,
    device: Option<&'a Device>,
    plan: BenchPlan,
    /// Where `auto` is measured.
    costs: Option<CostTable>,
    results: Lines,
    report: Report,
}

impl Bench<'_> {
    /// Measures one scene. What fails is noted and the rest goes on; only a folder that cannot be written ends the run.
    fn scene(&mut self, spec: &str) -> crate::Result<()> {
        let scene = match self.common.load(spec) {
            Ok(scene) => scene,
            Err(error) => {
                self.failed(OnScene::failure(spec, None, error));
                return Ok(());
            }
        };
        if let Some(costs) = &self.costs {
            self.report.choices.extend(hindsight::choices(costs, &scene));
        }
        let bar = Bar::new(self.common, &scene.name, 0);
        let say = |what: &str| bar.say(&format!("{}: {what}", scene.name));
        let (outcomes, failures) = matrix::measure(&scene, self.device, &self.plan, &mut |what| say(what));
        failures.into_iter().for_each(|failure| self.failed(failure));
        for outcome in &outcomes {
            self.results.append(&outcome.record)?;
            for fault in &outcome.faults {
                eprintln!("hedgerow: {}: {} is wrong: {fault}", scene.name, outcome.record.builder);
            }
        }
        if !self.arguments.no_pictures {
            say("pictures");
            if let Err(error) = self.pictures(&scene, &outcomes) {
                self.failed(OnScene::failure(&scene.name, None, format!("pictures: {error:#}")));
            }
        }
        self.report.outcomes.extend(outcomes);
        Ok(())
    }

    /// Notes a failure.
    fn failed(&mut self, failure: Failure<OnScene>) {
        eprintln!("hedgerow: {failure}");
        self.report.failures.push(failure);
    }

    /// The scene shaded, and the steps that rays take through the first two trees that count them, in the same colours.
    fn pictures(&mut self, scene: &Scene, outcomes: &[Outcome]) -> anyhow::Result<()> {
        let steps = |outcome: &Outcome| outcome.record.rays("primary").and_then(|trace| trace.steps);
        let counting: Vec<(&Outcome, f64)> = outcomes.iter().filter_map(|o| Some((o, steps(o)?))).take(2).collect();
        // Most pixels stay below three times the mean.
        let top = counting.iter().map(|(_, mean)| 3.0 * mean).fold(0.0, f64::max);
        let top = (top / 10.0).ceil().max(1.0) as f32 * 10.0;
        for (i, (outcome, _)) in counting.iter().enumerate() {
            let builder = &outcome.record.builder;
            let spec: Spec = builder.parse()?;
            let mut subject = spec.make_for(self.device, scene)?;
            subject.build()?;
            let views: &[View] = if i == 0 { &[View::Shaded, View::Steps] } else { &[View::Steps] };
            for &view in views {
                let options = PictureOptions { view, size: PICTURE, seed: self.common.seed, top: Some(top) };
                let image = picture(scene, subject.as_mut(), &options)?;
                let (caption, alt, file) = match view {
                    View::Shaded => ("The scene, shaded".into(), format!("{}, shaded", scene.name), slug(&scene.name)),
                    _ => (
                        format!("Inner nodes visited by the ray of each pixel: {builder}"),
                        format!("{}, heat map of the steps a ray through the tree of {builder}", scene.name),
                        format!("{}-steps-{}", slug(&scene.name), slug(builder)),
                    ),
                };
                let folder = self.arguments.output.join("pictures");
                std::fs::create_dir_all(&folder).map_err(crate::Error::file(&folder))?;
                let path = folder.join(format!("{file}.png"));
                image.save(&path).with_context(|| format!("{} cannot be written", path.display()))?;
                let file = format!("pictures/{file}.png");
                self.report.pictures.push(Picture { scene: scene.name.clone(), file, caption, alt });
            }
        }
        Ok(())
    }
}
