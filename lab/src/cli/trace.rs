//! `hedgerow trace`: builds and traces rays, of the kinds that we know or of a file.

use super::options::{Builders, Kinds};
use super::{Common, Json, Size, tables, work};
use crate::device::Device;
use crate::experiments::bench::matrix::BenchPlan;
use crate::measure::overlap::Epo;
use crate::rays::files;
use crate::report::numbers::{grouped, three_digits};
use crate::scene::Scene;
use crate::subjects::builders::Spec;
use hedgerow::trace::{Hit, Query, Ray};
use std::io::Write;
use std::num::NonZeroU32;
use std::path::PathBuf;

/// Build a scene, trace rays through it, and print Mrays/s, steps and tests a ray
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The scene: a file, a bare name, or a generator
    scene: String,
    /// Builders with their options, separated by commas, or all
    #[arg(short, long, value_name = "BUILDER[,BUILDER…]")]
    builder: Builders,
    /// Kinds of rays, separated by commas, or all
    #[arg(long, value_name = "KIND[,KIND…]", default_value = "all", conflicts_with = "rays_file")]
    rays: Kinds,
    /// Pixels of the picture that the rays belong to
    #[arg(long, value_name = "WxH", default_value = "640x480")]
    size: Size,
    /// Counted runs, after one that warms up
    #[arg(long, value_name = "N", default_value = "5")]
    runs: NonZeroU32,
    /// Trace the rays of a file, 32 bytes each
    #[arg(long, value_name = "RAYS", requires = "hits_file")]
    rays_file: Option<PathBuf>,
    /// Where the hits of these rays go, 16 bytes each
    #[arg(long, value_name = "HITS", requires = "rays_file")]
    hits_file: Option<PathBuf>,
    /// Any hit of these rays instead of the nearest
    #[arg(long, requires = "rays_file")]
    any_hit: bool,
    #[command(flatten)]
    json: Json,
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> anyhow::Result<()> {
    let builders = &common.builders(&arguments.builder.0);
    let files = arguments.rays_file.as_deref().zip(arguments.hits_file.as_deref());
    if files.is_some() && (builders.len() > 1 || arguments.json.json.is_some()) {
        let message =
            "--rays-file is traced with one builder and gives hits, no record; name one builder, without --json";
        return Err(crate::Error::Argument(message.into()).into());
    }
    let scene = common.load(&arguments.scene)?;
    let device = work::device_for(common, builders)?;
    if let Some((rays_file, hits_file)) = files {
        let query = if arguments.any_hit { Query::AnyHit } else { Query::ClosestHit };
        let rays = files::read_rays(rays_file)?;
        let (hits, milliseconds) = traced(&scene, device.as_ref(), &builders[0], &rays, query)?;
        files::write_hits(hits_file, &hits)?;
        let hits = hits.iter().filter(|hit| hit.is_some()).count() as u64;
        let speed = rays.len() as f64 / (milliseconds * 1e3);
        let (rays, hits, speed) = (grouped(rays.len() as u64), grouped(hits), three_digits(speed));
        writeln!(std::io::stdout(), "{}: {rays} rays, {hits} hits, {speed} Mrays/s", builders[0])?;
        return work::finish(device.as_ref(), true);
    }
    let plan = BenchPlan {
        builders: builders.clone(),
        runs: arguments.runs.get(),
        kinds: arguments.rays.0.clone(),
        rays: arguments.size.rays(common.seed),
        c_t: 3.0,
        c_i: 2.0,
        epo: Epo::Off,
        by_kernel: false,
    };
    let (outcomes, all_right) = work::measured(common, &scene, device.as_ref(), &plan);
    arguments.json.write_each(outcomes.iter().map(|outcome| &outcome.record))?;
    if !arguments.json.takes_stdout() {
        let mut out = std::io::stdout().lock();
        for outcome in &outcomes {
            writeln!(out, "{}", tables::trace(&outcome.record))?;
        }
    }
    work::finish(device.as_ref(), all_right)
}

/// The hits of `rays`, and the milliseconds that they took.
fn traced(
    scene: &Scene,
    device: Option<&Device>,
    builder: &Spec,
    rays: &[Ray],
    query: Query,
) -> crate::Result<(Vec<Hit>, f64)> {
    if rays.is_empty() {
        return Ok((Vec::new(), f64::NAN));
    }
    let mut subject = builder.make_for(device, scene)?;
    subject.build()?;
    subject.set_rays(rays)?;
    // The first run of a shader compiles it.
    subject.trace(query)?;
    let milliseconds = subject.trace(query)?;
    Ok((subject.hits()?, milliseconds))
}
