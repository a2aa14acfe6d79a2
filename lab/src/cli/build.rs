//! `hedgerow build`: builds, validates on the host, and prints phases, quality and memory.

use super::options::{Builders, Costs};
use super::{Common, Json, tables, work};
use crate::experiments::bench::matrix::BenchPlan;
use crate::measure::copy;
use crate::measure::overlap::Epo;
use crate::rays::kinds::RayOptions;
use anyhow::{Context, bail};
use std::io::Write;
use std::num::NonZeroU32;
use std::path::PathBuf;

/// Pixels of the picture whose rays count leaves.
const LEAF_COUNT_RAYS: [u32; 2] = [128, 96];

/// Build a scene, validate the structure on the host, and print phases, quality and memory
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The scene: a file, a bare name, or a generator
    scene: String,
    /// Builders with their options, separated by commas, or all
    #[arg(short, long, value_name = "BUILDER[,BUILDER…]")]
    builder: Builders,
    /// Counted builds, after one that warms up
    #[arg(long, value_name = "N", default_value = "5")]
    runs: NonZeroU32,
    /// Costs of a traversal step and of a triangle test in the SAH
    #[arg(long, value_name = "C_T,C_I", default_value = "3,2")]
    costs: Costs,
    /// Measure the end-point overlap: on, off, or cheap (given up after 5 s a tree)
    #[arg(long, value_name = "on|off|cheap", default_value = "cheap")]
    epo: Epo,
    /// Show how long each kernel of the device took in place of the phases; a timestamp for each dispatch takes time, too
    #[arg(long)]
    by_kernel: bool,
    /// Write the structure's bytes to a file (with one builder)
    #[arg(short, long, value_name = "TREE")]
    output: Option<PathBuf>,
    #[command(flatten)]
    json: Json,
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> anyhow::Result<()> {
    let builders = &common.builders(&arguments.builder.0);
    if arguments.output.is_some() && builders.len() > 1 {
        return Err(crate::Error::Argument("-o takes the structure of one builder; name one with -b".into()).into());
    }
    let scene = common.load(&arguments.scene)?;
    let device = work::device_for(common, builders)?;
    let plan = BenchPlan {
        builders: builders.clone(),
        runs: arguments.runs.get(),
        kinds: Vec::new(),
        rays: RayOptions { size: LEAF_COUNT_RAYS, seed: common.seed },
        c_t: arguments.costs.step,
        c_i: arguments.costs.test,
        epo: arguments.epo,
        by_kernel: arguments.by_kernel,
    };
    let (outcomes, all_right) = work::measured(common, &scene, device.as_ref(), &plan);
    if let Some(path) = &arguments.output {
        let mut subject = builders[0].make_for(device.as_ref(), &scene)?;
        subject.build()?;
        let Some(bytes) = subject.bytes()? else {
            bail!("the structure of {} is the driver's own and cannot be written; choose another builder", builders[0]);
        };
        let written = std::fs::write(path, &bytes).map_err(crate::Error::file(path));
        written.with_context(|| format!("the tree of {}", builders[0]))?;
    }
    arguments.json.write_each(outcomes.iter().map(|outcome| &outcome.record))?;
    if !arguments.json.takes_stdout() {
        let copy_gb_s = device.as_ref().map(copy::rate_gb_s).transpose()?;
        let mut out = std::io::stdout().lock();
        for outcome in &outcomes {
            writeln!(out, "{}", tables::build(outcome, copy_gb_s))?;
        }
    }
    work::finish(device.as_ref(), all_right)
}
