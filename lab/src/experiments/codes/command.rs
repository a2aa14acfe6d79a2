//! `hedgerow codes`: what codes are worth and what they cost; records as they are measured, tables, and a page.

use super::page;
use super::points::CodesEntry;
use super::{CodesSetup, Experiment, added_time, sweep, tables, with_codes};
use crate::cli::options::{Kinds, Size};
use crate::cli::work::{device_for, page_written};
use crate::cli::{Bar, Common};
use crate::experiments::cpu_builders::command::scenes;
use crate::measure::{Failure, Setting};
use crate::report::lines::Points;
use crate::subjects::builders::Spec;
use hedgerow::bvh::codes::Codes;
use std::io::Write;
use std::num::NonZeroU32;
use std::path::PathBuf;

/// Measure what codes are worth and what they add to a build, beside Riemersma 2024, and write records and a page
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Scenes: files, bare names or generators [default: those in scenes/]
    #[arg(value_name = "SCENE")]
    scenes: Vec<String>,
    /// What is measured, separated by commas: sweep (rays through trees by binning over λ, tables 8 to 11), added-time (what codes
    /// add to a build, table 7)
    #[arg(long, value_name = "EXPERIMENT[,…]", value_delimiter = ',', default_value = "sweep,added-time")]
    experiments: Vec<Experiment>,
    /// The builder whose codes are changed, without codes=
    #[arg(short, long, value_name = "BUILDER", default_value = "lbvh")]
    builder: Spec,
    /// Codes whose added time is measured, separated by commas [default: all there are]
    #[arg(long, value_name = "CODES[,CODES…]", value_delimiter = ',')]
    codes: Vec<Codes>,
    /// Kinds of rays of the sweep, separated by commas, or all
    #[arg(long, value_name = "KIND[,KIND…]", default_value = "primary,diffuse1,ao,shadow")]
    rays: Kinds,
    /// Pixels of the picture that the rays belong to
    #[arg(long, value_name = "WxH", default_value = "128x96")]
    size: Size,
    /// Counted runs of everything, in turn with the base, after one that warms up
    #[arg(long, value_name = "N", default_value = "5")]
    runs: NonZeroU32,
    /// The folder for codes.jsonl, charts and codes.html; pages of other experiments there are linked
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> anyhow::Result<()> {
    // Before any work: a builder without codes would fail on every scene.
    let base = with_codes(&arguments.builder, super::BASE)?;
    let scenes = scenes(&arguments.scenes)?;
    let device = device_for(common, std::slice::from_ref(&base))?;
    let mut points = Points::create(&arguments.output)?;
    let options = [
        ("Runs", format!("{} after a warm-up, in turn with {base}", arguments.runs)),
        ("Of a run", format!("{} builds or traces, the least counts", super::OF_A_RUN)),
        ("Image", format!("{}, seed {}", arguments.size, common.seed)),
    ];
    points.append(CodesEntry::Setting(Setting::of(device.as_ref(), &options, Vec::new())?))?;
    let codes = if arguments.codes.is_empty() { added_time::all_codes() } else { arguments.codes.clone() };
    let bar = Bar::new(common, "measuring", 0);
    let stage = CodesSetup {
        device: device.as_ref(),
        builder: arguments.builder.clone(),
        runs: arguments.runs.get(),
        kinds: &arguments.rays.0,
        rays: arguments.size.rays(common.seed),
        say: &|what| bar.say(what),
    };
    let mut measured = Vec::new();
    let mut taken = |entry: CodesEntry| {
        if let CodesEntry::Failure(failure) = &entry {
            eprintln!("hedgerow: {failure}");
        }
        points.append(entry.clone())?;
        measured.push(entry);
        Ok(())
    };
    for name in &scenes {
        let scene = match common.load(name) {
            Ok(scene) => scene,
            Err(error) => {
                taken(CodesEntry::Failure(Failure::named(name, error)))?;
                continue;
            }
        };
        for experiment in Experiment::ALL.into_iter().filter(|e| arguments.experiments.contains(e)) {
            let done = match experiment {
                Experiment::Sweep => sweep::measure(&stage, &scene, &mut taken),
                Experiment::AddedTime => added_time::measure(&stage, &scene, &codes, &mut taken),
            };
            if let Err(error) = done {
                taken(CodesEntry::Failure(Failure::named(format!("{experiment} {}", scene.name), error)))?;
            }
        }
    }
    drop(bar);
    let failures = measured.iter().filter(|entry| matches!(entry, CodesEntry::Failure(_))).count();
    let page = page::write(&arguments.output)?;
    writeln!(std::io::stdout().lock(), "{}", tables::text(&measured))?;
    page_written(device.as_ref(), &page, failures)
}
