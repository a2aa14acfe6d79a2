//! `hedgerow predict`: trees built, weighed and traced, and what of them tells the time of rays.

use super::choice;
use super::measured::{self, Plan};
use super::page::{self, Run};
use crate::cli::options::{Builders, Kinds, Size};
use crate::cli::{Bar, Common, work};
use crate::experiments::bench::matrix::OnScene;
use crate::experiments::cpu_builders::command::{device_if_any, host_alone, scenes};
use crate::measure::Setting;
use crate::report::beside;
use crate::report::lines::Lines;
use std::num::NonZeroU32;
use std::path::PathBuf;

/// Ask which static figure of a tree tells how fast it is traced, and how many rays a build pays for; beside van Kralingen 2023
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Scenes: files, bare names or generators [default: those in scenes/]
    #[arg(value_name = "SCENE")]
    scenes: Vec<String>,
    /// Builders of BVHs, separated by commas; the others are held against the first [default: thirteen, by area first]
    #[arg(short, long, value_name = "BUILDER[,BUILDER…]")]
    builder: Option<Builders>,
    /// Kinds of rays, separated by commas, or all
    #[arg(long, value_name = "KIND[,KIND…]", default_value = "all")]
    rays: Kinds,
    /// Pixels of the picture that the rays belong to
    #[arg(long, value_name = "WxH", default_value = "160x120")]
    size: Size,
    /// Counted runs of every trace and of every short build, after one that warms up
    #[arg(long, value_name = "N", default_value = "5")]
    runs: NonZeroU32,
    /// Trace on the host alone
    #[arg(long)]
    no_device: bool,
    /// The folder for predict.jsonl, charts and predict.html
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> anyhow::Result<()> {
    let asked = match &arguments.builder {
        Some(Builders(asked)) => choice::checked(asked.clone())?,
        None => choice::by_default(),
    };
    let scenes = scenes(&arguments.scenes)?;
    let mut notes = Vec::new();
    let device = match arguments.no_device {
        true => host_alone(&mut notes),
        false => device_if_any(common, &mut notes)?,
    };
    let (builders, impossible): (Vec<_>, Vec<_>) =
        asked.into_iter().partition(|spec| spec.is_possible(device.as_ref()));
    if !impossible.is_empty() {
        let names: Vec<String> = impossible.iter().map(ToString::to_string).collect();
        notes.push(format!("Left out, for they need a device: {}.", names.join(", ")));
    }
    let builders = choice::checked(builders)?;
    notes.push(format!("The reference is {}.", builders[0]));
    let Size { width, height } = arguments.size;
    let options = [
        ("Runs", format!("{} after a warm-up, in turn", arguments.runs)),
        ("Image", format!("{width}x{height}, seed {}", common.seed)),
        ("Host threads", rayon::current_num_threads().to_string()),
    ];
    let setting = Setting::of(device.as_ref(), &options, notes)?;
    let plan = Plan {
        builders,
        runs: arguments.runs.get(),
        kinds: arguments.rays.0.clone(),
        rays: arguments.size.rays(common.seed),
    };
    let mut run = Run { setting, failures: Vec::new() };
    // Before any work: a folder that cannot be written would lose all of it.
    let mut lines = Lines::create(&arguments.output, beside::PREDICT.records)?;
    for name in &scenes {
        let bar = Bar::new(common, name, 0);
        let measured = common.load(name).and_then(|scene| {
            measured::measure(&scene, device.as_ref(), &plan, &mut |what| bar.say(&format!("{name}: {what}")))
        });
        match measured {
            Ok((records, failures)) => {
                records.iter().try_for_each(|record| lines.append(record))?;
                run.failures.extend(failures);
            }
            Err(error) => run.failures.push(OnScene::failure(name, None, error)),
        }
    }
    run.failures.iter().for_each(|failure| eprintln!("hedgerow: {failure}"));
    run.write(&arguments.output)?;
    let page = page::write(&arguments.output)?;
    work::page_written(device.as_ref(), &page, run.failures.len())
}
