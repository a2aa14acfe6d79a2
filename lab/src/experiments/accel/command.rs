//! `hedgerow accel`: batches, top levels, re-braiding, orders of children and updates; records as they are measured, and a page.

use crate::Result;
use crate::cli::options::{Kinds, Size};
use crate::cli::{Bar, Common, work};
use crate::device::Device;
use crate::experiments::accel::page::{self, Points};
use crate::experiments::accel::points::AccelEntry;
use crate::experiments::accel::{AccelSetup, Experiment, any_hit, batch, memory, rebraid, top_level, update};
use crate::measure::{Failure, Setting, Sink};
use crate::scene::{self, Animation, Instances, LoadOptions};
use crate::subjects::peers::driver;
use crate::subjects::preference::Preference;
use hedgerow::accel::{AccelOptions, Wide};
use std::num::NonZeroU32;
use std::path::PathBuf;

/// What is re-braided where no scene of instances is named: boxes that overlap in three manners, and some that do not.
const REBRAIDED: [&str; 4] = ["gen:forest:400", "gen:city:400", "gen:cables:400", "gen:cells:1000"];
/// What is updated where no animation is named.
const UPDATED: [&str; 1] = ["gen:twist:20000:12"];

/// Measure batches of builds, top levels, re-braiding, orders of children and updates, beside the driver's by the same calls, and write records
/// and a page
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Scenes to re-braid, any but one of instances as one instance, and animations to update: files, bare names or generators
    /// [default: generated ones of both kinds]
    #[arg(value_name = "SCENE")]
    scenes: Vec<String>,
    /// What is measured, separated by commas: batch, tlas, rebraid, any-hit (always with shadow and ao rays), update, memory (of each
    /// scene as one bottom level)
    #[arg(
        long,
        value_name = "EXPERIMENT[,…]",
        value_delimiter = ',',
        default_value = "batch,tlas,rebraid,any-hit,update"
    )]
    experiments: Vec<Experiment>,
    /// Kinds of rays, separated by commas, or all
    #[arg(long, value_name = "KIND[,KIND…]", default_value = "primary,ao,diffuse1,random")]
    rays: Kinds,
    /// Pixels of the picture that the rays belong to
    #[arg(long, value_name = "WxH", default_value = "128x96")]
    size: Size,
    /// Counted runs of everything, after one that warms up
    #[arg(long, value_name = "N", default_value = "5")]
    runs: NonZeroU32,
    /// Structures of the largest batch
    #[arg(long, value_name = "N", default_value = "4096")]
    structures: NonZeroU32,
    /// What the builds of a batch prefer, separated by commas: fast-build, fast-trace, none
    #[arg(long, value_name = "PREFERENCE[,…]", value_delimiter = ',', default_value = "fast-build")]
    prefer: Vec<Preference>,
    /// Instances of the largest top level
    #[arg(long, value_name = "N", default_value = "100000")]
    instances: NonZeroU32,
    /// Which of ours are in nodes of eight, where no update is allowed: less memory, and other times
    #[arg(long, value_name = "WHICH", default_value = "flags")]
    wide: WhichWide,
    /// Frames of each animation, spread evenly over all of them
    #[arg(long, value_name = "N", default_value = "12")]
    frames: NonZeroU32,
    /// The folder for accel.jsonl, charts and accel.html; where it has an index.html of `hedgerow bench`, the pages name each
    /// other
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

/// [`Wide`] on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum WhichWide {
    /// None.
    Never,
    /// Those of a fast trace, and bottom levels of many primitives.
    Flags,
    /// All.
    Always,
}

impl From<WhichWide> for Wide {
    fn from(which: WhichWide) -> Wide {
        match which {
            WhichWide::Never => Wide::Never,
            WhichWide::Flags => Wide::ByFlags,
            WhichWide::Always => Wide::Always,
        }
    }
}

impl WhichWide {
    fn says(self) -> String {
        match self {
            WhichWide::Never => "none of ours".into(),
            WhichWide::Flags => "those of ours that flags give them".into(),
            WhichWide::Always => "all of ours, where there can be".into(),
        }
    }
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> anyhow::Result<()> {
    let (instances, animations) = scenes(common, arguments)?;
    // Before any work: a folder that cannot be written would lose all of it.
    let mut points = Points::create(&arguments.output)?;
    let device = common.open_device(true)?;
    let bar = Bar::new(common, "opening the device", 0);
    let say = |what: &str| bar.say(what);
    let stage = AccelSetup {
        device: &device,
        options: AccelOptions { wide: arguments.wide.into(), ..AccelOptions::DEFAULT },
        runs: arguments.runs.get(),
        kinds: &arguments.rays.0,
        rays: arguments.size.rays(common.seed),
        say: &say,
    };
    points.append(AccelEntry::Setting(setting(common, arguments, &device)?))?;
    let mut failures = 0;
    // Point by point onto the disk. What fails is noted and the rest goes on; only a folder that cannot be written ends the run.
    let mut measured = |name: &str, measure: &dyn Fn(&mut Sink<'_, AccelEntry>) -> Result<()>| {
        let Err(error) = measure(&mut |entry| points.append(entry)) else { return Ok(()) };
        eprintln!("hedgerow: {name}: {error}");
        failures += 1;
        points.append(AccelEntry::Failure(Failure::named(name, error)))
    };
    for experiment in Experiment::ALL.into_iter().filter(|e| arguments.experiments.contains(e)) {
        let name = experiment.name();
        match experiment {
            Experiment::Batch => {
                for &prefer in &arguments.prefer {
                    let most = arguments.structures.get();
                    measured(&format!("{name} {prefer}"), &|point| batch::measure(&stage, most, prefer, point))?;
                }
            }
            Experiment::TopLevel => {
                measured(name, &|point| top_level::measure(&stage, arguments.instances.get(), point))?;
            }
            Experiment::Rebraid => {
                for scene in &instances {
                    measured(&format!("{name} {}", scene.name), &|point| rebraid::measure(&stage, scene, point))?;
                }
            }
            Experiment::AnyHit => {
                for scene in &instances {
                    measured(&format!("{name} {}", scene.name), &|point| any_hit::measure(&stage, scene, point))?;
                }
            }
            Experiment::Memory => {
                for scene in &instances {
                    measured(&format!("{name} {}", scene.name), &|point| memory::measure(&stage, scene, point))?;
                }
            }
            Experiment::Update => {
                for scene in &animations {
                    let frames = arguments.frames.get();
                    measured(&format!("{name} {}", scene.name), &|point| {
                        update::measure(&stage, scene, frames, point)
                    })?;
                }
            }
        }
    }
    drop(bar);
    let page = page::write(&arguments.output)?;
    work::page_written(Some(&device), &page, failures)
}

/// The scenes that are named, by what they are good for; the generated ones of a kind where none of it is named.
fn scenes(common: &Common, arguments: &Arguments) -> anyhow::Result<(Vec<Instances>, Vec<Animation>)> {
    let (mut instances, mut animations) = (Vec::new(), Vec::new());
    let bar = Bar::bytes(common, "loading");
    let progress = |p: scene::Progress| bar.set(p.done, p.total);
    let options = LoadOptions { folders: common.scene_folders(), progress: Some(&progress) };
    for spec in &arguments.scenes {
        if let Some(scene) = scene::load_placed(spec, &options)? {
            instances.push(scene);
        } else if let Some(animation) = scene::load_moving(spec, &options)? {
            animations.push(animation);
        } else {
            instances.push(scene::load_instances(spec, &options)?);
        }
    }
    if instances.is_empty()
        && arguments
            .experiments
            .iter()
            .any(|e| [Experiment::Rebraid, Experiment::AnyHit, Experiment::Memory].contains(e))
    {
        instances = REBRAIDED.iter().map(|spec| scene::load_instances(spec, &options)).collect::<Result<_>>()?;
    }
    if animations.is_empty() && arguments.experiments.contains(&Experiment::Update) {
        animations = UPDATED.iter().map(|spec| scene::load_animation(spec, &options)).collect::<Result<_>>()?;
    }
    instances.iter_mut().for_each(|scene| common.aim(&mut scene.camera));
    animations.iter_mut().for_each(|scene| common.aim(&mut scene.camera));
    Ok((instances, animations))
}

/// Where and how it is measured.
fn setting(common: &Common, arguments: &Arguments, device: &Device) -> Result<Setting> {
    let notes = driver::note(device.found()).into_iter().chain(driver::missing(device)).collect();
    let options = [
        ("Runs", format!("{} after a warm-up, in turn", arguments.runs)),
        ("Image", format!("{}, seed {}", arguments.size, common.seed)),
        ("Nodes of eight", arguments.wide.says()),
    ];
    Setting::of(Some(device), &options, notes)
}
