//! `hedgerow cpu-builders`: builders of BVHs on the host, on one thread and on all, traced on the host and on the device.

use super::choice::{Choice, on_one_thread};
use super::measured::{BY_DEVICE, BY_HOST};
use super::page::{self, Run};
use crate::cli::options::{Kinds, Size};
use crate::cli::{Bar, Common, Json, work};
use crate::device::Device;
use crate::experiments::bench::matrix::{self, BenchPlan, Entrant, OnScene, Outcome};
use crate::measure::overlap::Epo;
use crate::measure::record::Record;
use crate::measure::{Failure, Setting};
use crate::rays::kinds::RayKind;
use crate::report::lines::Lines;
use crate::report::{beside, table};
use crate::scene::{self, Scene};
use crate::subjects::Subject;
use crate::subjects::builders::{self, Spec};
use crate::subjects::retraced::Retraced;
use anyhow::Context;
use ash::vk;
use std::io::Write;
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// In the names of records that the page alone shows: the table of the terminal has one row a builder.
const TRACED_BY_OURS: &str = ":trace=";
/// Costs of a step and of a test, those of the thesis.
const COSTS: [f64; 2] = [3.0, 2.0];

/// Measure builders of BVHs on the CPU, on one thread and on all, with rays on the host and on the device; beside Frantál 2019
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Scenes: files, bare names or generators [default: those in scenes/]
    #[arg(value_name = "SCENE")]
    scenes: Vec<String>,
    /// Builders on the host with their options, separated by commas [default: those of the thesis, ours beside them, and peers]
    #[arg(short, long, value_name = "BUILDER[,BUILDER…]")]
    builder: Option<String>,
    /// Fewer builders, rays and runs: less than a minute for the scenes in scenes/
    #[arg(long)]
    quick: bool,
    /// Kinds of rays, separated by commas, or all [default: all; primary,shadow,diffuse1 with --quick]
    #[arg(long, value_name = "KIND[,KIND…]")]
    rays: Option<Kinds>,
    /// Pixels of the picture that the rays belong to [default: 256x192; 96x72 with --quick]
    #[arg(long, value_name = "WxH")]
    size: Option<Size>,
    /// Counted runs of every build and trace, after one that warms up [default: 5; 1 with --quick]
    #[arg(long, value_name = "N")]
    runs: Option<NonZeroU32>,
    /// Measure the end-point overlap: on, off, or cheap (given up after 5 s a tree) [default: cheap; off with --quick]
    #[arg(long, value_name = "on|off|cheap")]
    epo: Option<Epo>,
    /// Trace on the host alone
    #[arg(long)]
    no_device: bool,
    /// Keep what DIR holds of other scenes and builders, so that runs add up
    #[arg(long, requires = "output")]
    add: bool,
    #[command(flatten)]
    json: Json,
    /// The folder for cpu-builders.jsonl, charts and cpu-builders.html; without it, tables alone
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> anyhow::Result<()> {
    let choice = match &arguments.builder {
        Some(list) => Choice::of(builders::parse_list(list)?)?,
        None => Choice::by_default(arguments.quick),
    };
    let scenes = scenes(&arguments.scenes)?;
    let mut notes: Vec<String> = choice.note().into_iter().collect();
    let device = match arguments.no_device {
        true => host_alone(&mut notes),
        false => device_if_any(common, &mut notes)?,
    };
    if choice.builders.iter().all(|spec| on_one_thread(spec).is_none()) {
        notes.push("No builder of this run takes threads=1: there are no times of one thread.".into());
    }
    let plan = plan(common, arguments, &choice.builders);
    if plan.epo == Epo::Off {
        notes.push("EPO was not measured; --epo cheap measures it.".into());
    }
    let options = [
        ("Runs", format!("{} after a warm-up, in turn", plan.runs)),
        ("Image", format!("{}x{}, seed {}", plan.rays.size[0], plan.rays.size[1], common.seed)),
        ("Host threads", rayon::current_num_threads().to_string()),
    ];
    let mut run = Run { setting: Setting::of(device.as_ref(), &options, notes)?, failures: Vec::new() };
    // Before any work: a folder that cannot be written would lose all of it.
    let mut records = arguments.output.as_deref().map(|folder| Records::open(folder, arguments.add)).transpose()?;
    let mut all = Vec::new();
    for name in &scenes {
        let (outcomes, failures) = match common.load(name) {
            Ok(scene) => measure(common, &scene, device.as_ref(), &plan),
            Err(error) => (Vec::new(), vec![OnScene::failure(name, None, error)]),
        };
        for Outcome { record, faults, .. } in outcomes {
            let (scene, builder) = (record.scene.clone(), Some(record.builder.clone()));
            let fault = |what: String| Failure { at: OnScene { scene: scene.clone(), builder: builder.clone() }, what };
            run.failures.extend(faults.into_iter().map(fault));
            if let Some(records) = &mut records {
                records.append(&record)?;
            }
            all.push(record);
        }
        run.failures.extend(failures);
    }
    run.failures.iter().for_each(|failure| eprintln!("hedgerow: {failure}"));
    arguments.json.write_each(&all)?;
    if !arguments.json.takes_stdout() {
        let is_traced = |record: &&Record| !record.trace.is_empty() && !record.builder.contains(TRACED_BY_OURS);
        writeln!(std::io::stdout().lock(), "{}", table::table(&all.iter().filter(is_traced).collect::<Vec<_>>()))?;
    }
    match &arguments.output {
        None => work::finish(device.as_ref(), run.failures.is_empty()),
        Some(folder) => {
            run.write(folder)?;
            let page = page::write(folder)?;
            match arguments.json.takes_stdout() {
                true => work::finish(device.as_ref(), run.failures.is_empty()),
                false => work::page_written(device.as_ref(), &page, run.failures.len()),
            }
        }
    }
}

/// The scenes that are named, or those of the repository.
pub(crate) fn scenes(named: &[String]) -> anyhow::Result<Vec<String>> {
    if !named.is_empty() {
        return Ok(named.to_vec());
    }
    let own = scene::own_folders().into_iter().find(|folder| folder.is_dir());
    let folder = own.context("there is no folder scenes/ here; name scenes")?;
    let is_static = |file: &PathBuf| file.extension().is_none_or(|extension| extension != "dyn");
    let files = scene::list(&folder)?.into_iter().filter(is_static);
    Ok(files.map(|file| file.display().to_string()).collect())
}

/// No device: the reader is told.
pub(crate) fn host_alone(notes: &mut Vec<String>) -> Option<Device> {
    notes.push("Traced on the host alone, as --no-device asks.".into());
    None
}

/// The device on which trees are traced, too. One that was asked for must be there; otherwise the host is enough.
pub(crate) fn device_if_any(common: &Common, notes: &mut Vec<String>) -> anyhow::Result<Option<Device>> {
    match common.open_device(false) {
        Ok(device) => {
            if device.limits.kind == vk::PhysicalDeviceType::CPU {
                notes.push(
                    "The device is a CPU: its rays say how much work the trees are, not how they stand on a GPU."
                        .into(),
                );
            }
            Ok(Some(device))
        }
        Err(error) if common.device().is_none() => {
            notes.push(format!("Traced on the host alone, for there is no device: {error}"));
            Ok(None)
        }
        Err(error) => Err(error.into()),
    }
}

fn plan(common: &Common, arguments: &Arguments, builders: &[Spec]) -> BenchPlan {
    let quick = arguments.quick;
    let kinds =
        || if quick { vec![RayKind::Primary, RayKind::Shadow, RayKind::Diffuse1] } else { RayKind::ALL.to_vec() };
    let size =
        arguments.size.unwrap_or(if quick { Size { width: 96, height: 72 } } else { Size { width: 256, height: 192 } });
    BenchPlan {
        builders: builders.to_vec(),
        runs: arguments.runs.map_or(if quick { 1 } else { 5 }, NonZeroU32::get),
        kinds: arguments.rays.as_ref().map_or_else(kinds, |rays| rays.0.clone()),
        rays: size.rays(common.seed),
        c_t: COSTS[0],
        c_i: COSTS[1],
        epo: arguments.epo.unwrap_or(if quick { Epo::Off } else { Epo::WhereCheap }),
        by_kernel: false,
    }
}

/// Every builder of the plan on a scene: by all threads, by one, and its tree by our tracers.
fn measure(
    common: &Common,
    scene: &Scene,
    device: Option<&Device>,
    plan: &BenchPlan,
) -> (Vec<Outcome>, Vec<Failure<OnScene>>) {
    let (mut entrants, mut failures) = (Vec::new(), Vec::new());
    for spec in &plan.builders {
        let of_one = on_one_thread(spec);
        for (spec, is_traced) in [Some((spec, true)), of_one.as_ref().map(|spec| (spec, false))].into_iter().flatten() {
            match spec.make_for(None, scene) {
                Ok(subject) => entrants.push(Entrant { subject, is_traced }),
                Err(error) => failures.push(OnScene::failure(&scene.name, Some(spec), error)),
            }
        }
    }
    let of_one: Vec<String> = plan.builders.iter().filter_map(on_one_thread).map(|spec| spec.to_string()).collect();
    let mut besides = |subject: &mut dyn Subject| {
        let is_of_one = of_one.iter().any(|name| name == subject.builder());
        if is_of_one { Ok(Vec::new()) } else { traced_besides(subject, device) }
    };
    let bar = Bar::new(common, &scene.name, 0);
    let mut say = |what: &str| bar.say(&format!("{}: {what}", scene.name));
    let (outcomes, more) = matrix::measure_subjects(scene, device, entrants, plan, &mut besides, &mut say);
    failures.extend(more);
    (outcomes, failures)
}

/// Our tracers over the tree that a subject has built: on the device, and of a peer, which has its own, on the host. Nothing where
/// there is no tree to see.
fn traced_besides<'a>(
    subject: &mut dyn Subject,
    device: Option<&'a Device>,
) -> crate::Result<Vec<Box<dyn Subject + 'a>>> {
    let Some(tree) = subject.tree()?.map(Arc::new) else { return Ok(Vec::new()) };
    let mut others: Vec<Box<dyn Subject + 'a>> = Vec::new();
    if subject.kind() == "host" {
        let name = format!("{}{BY_HOST}", subject.builder());
        others.push(Box::new(Retraced::of_tree(&name, Arc::clone(&tree), None)?));
    }
    if let Some(device) = device {
        let name = format!("{}{BY_DEVICE}", subject.builder());
        others.push(Box::new(Retraced::of_tree(&name, tree, Some(device))?));
    }
    Ok(others)
}

/// The file of records, and what it keeps of earlier runs: one that is measured again takes the place of the old one.
struct Records {
    folder: PathBuf,
    kept: Vec<Record>,
    file: Lines,
}

impl Records {
    fn open(folder: &Path, is_added: bool) -> crate::Result<Records> {
        let has_some = is_added && beside::CPU_BUILDERS.is_in(folder);
        let kept = if has_some { page::read(folder)? } else { Vec::new() };
        let mut file = Lines::create(folder, beside::CPU_BUILDERS.records)?;
        kept.iter().try_for_each(|record| file.append(record))?;
        Ok(Records { folder: folder.to_owned(), kept, file })
    }

    fn append(&mut self, record: &Record) -> crate::Result<()> {
        let is_same = |other: &Record| (&other.scene, &other.builder) == (&record.scene, &record.builder);
        if self.kept.iter().any(is_same) {
            self.kept.retain(|other| !is_same(other));
            self.kept.push(record.clone());
            self.file = Lines::create(&self.folder, beside::CPU_BUILDERS.records)?;
            self.kept.iter().try_for_each(|record| self.file.append(record))
        } else {
            self.kept.push(record.clone());
            self.file.append(record)
        }
    }
}
