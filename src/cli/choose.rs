//! `hedgerow choose`: what `auto` would build, and why; and how good its choices are in hindsight.

use super::options::{RaysPerBuild, Size};
use super::{Bar, Common, Json, tables, work};
use crate::gpu::Device;
use crate::measure::choose::calibration::{self, Effort};
use crate::measure::choose::hindsight::{self, Choice, Pair, Taken};
use crate::measure::choose::model::Measured;
use crate::measure::choose::{DEFAULT_RAYS, Estimate, Features, Model, cache, candidates};
use crate::report::names::short;
use crate::report::numbers::{duration, grouped, short_count, three_digits};
use crate::scene::Scene;
use std::io::Write;
use std::num::NonZeroU32;

/// Say which builder auto takes for a scene and --rays-per-build, by the measured costs of this device
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Scenes: files, bare names or generators; without one, the device is calibrated and nothing else
    #[arg(value_name = "SCENE")]
    scenes: Vec<String>,
    /// Measure the costs of this device again
    #[arg(long)]
    recalibrate: bool,
    /// Measure every candidate on the scenes, and hold choices for 1e4 to 1e9 rays a build against the best
    #[arg(long)]
    hindsight: bool,
    /// Pixels of the picture that the rays of --hindsight belong to
    #[arg(long, value_name = "WxH", default_value = "128x96")]
    size: Size,
    /// Counted runs of every build and trace of --hindsight
    #[arg(long, value_name = "N", default_value = "3")]
    runs: NonZeroU32,
    #[command(flatten)]
    json: Json,
}

pub(super) fn run(common: &Common, arguments: &Arguments) -> anyhow::Result<()> {
    let device = work::device_for(common, &["auto".parse()?])?.expect("auto works on a device");
    let model = {
        let bar = Bar::new(common, "calibrating", 0);
        cache::model_of(&device, arguments.recalibrate, &mut |what| bar.say(what))?
    };
    let rays = common.rays_per_build.map_or(DEFAULT_RAYS, |RaysPerBuild(rays)| rays);
    let (mut choices, mut taken, mut all) = (Vec::new(), Vec::new(), Vec::new());
    for name in &arguments.scenes {
        let scene = common.load(name)?;
        if arguments.hindsight {
            choices.extend(hindsight::choices(&model, &scene));
            let measured = measured(common, arguments, &device, &scene)?;
            let text = beside_estimates(&model, &scene, &measured);
            writeln!(std::io::stdout(), "{text}\n")?;
            taken.extend(measured.iter().map(Taken::from));
            all.extend(measured);
        } else {
            writeln!(std::io::stdout(), "{}\n", estimates(&model, &scene, rays))?;
        }
    }
    if arguments.hindsight {
        arguments.json.write_each(&all)?;
        writeln!(std::io::stdout(), "{}", in_hindsight(&choices, &taken))?;
    }
    work::finish(Some(&device), true)
}

/// Every candidate measured on a scene, with all kinds of rays.
fn measured(common: &Common, arguments: &Arguments, device: &Device, scene: &Scene) -> crate::Result<Vec<Measured>> {
    let _bar = Bar::new(common, &format!("measuring {}", scene.name), 0);
    let effort = Effort { rays: arguments.size.rays(common.seed), runs: arguments.runs.get() };
    calibration::on_scene(device, scene, &candidates::possible(device), &effort)
}

/// What every candidate is expected to take, the choice marked.
fn estimates(model: &Model, scene: &Scene, rays: f64) -> String {
    let features = Features::of(&scene.mesh);
    let chosen = model.choose(&features, rays).map(|estimate| estimate.builder);
    let mut table = tables::table(&["", "builder", "build", "a ray", "in all"], 2);
    for estimate in model.estimates(&features) {
        let mark = if chosen.as_ref() == Some(&estimate.builder) { "→" } else { "" };
        table.add_row([
            mark.to_owned(),
            estimate.builder.clone(),
            duration(estimate.build_ms),
            format!("{} ns", three_digits(estimate.ray_ns)),
            duration(estimate.total_ms(rays)),
        ]);
    }
    format!("{}, {} triangles, {} rays a build\n{table}", scene.name, grouped(features.triangles), short_count(rays))
}

/// What every candidate took beside what it was expected to take.
fn beside_estimates(model: &Model, scene: &Scene, measured: &[Measured]) -> String {
    let features = Features::of(&scene.mesh);
    let mut table = tables::table(&["builder", "build", "expected", "a ray", "expected"], 1);
    for Estimate { builder, build_ms, ray_ns } in model.estimates(&features) {
        let Some(took) = measured.iter().find(|took| took.builder == builder) else { continue };
        table.add_row([
            builder,
            duration(took.build_ms),
            duration(build_ms),
            format!("{} ns", three_digits(took.ray_ns)),
            format!("{} ns", three_digits(ray_ns)),
        ]);
    }
    format!("{}, {} triangles\n{table}", scene.name, grouped(features.triangles))
}

/// Each choice beside the best, and the part that is good.
fn in_hindsight(choices: &[Choice], taken: &[Taken]) -> String {
    let pairs = hindsight::pairs(choices, taken);
    let mut table = tables::table(&["scene", "rays a build", "chosen", "best", "chosen / best"], 4);
    for pair in &pairs {
        let Pair { choice, best, .. } = pair;
        table.add_row([
            choice.scene.clone(),
            short_count(choice.rays),
            short(&choice.builder),
            short(best),
            format!("{:.3}", pair.ratio()),
        ]);
    }
    let percent = |part: f64| format!("{:.1}%", 100.0 * part);
    let part = hindsight::good_part(&pairs).map_or("–".into(), percent);
    let mut text = format!("{table}\nwithin 10% of the best: {part} of {} choices\n", pairs.len());
    for (builder, part) in hindsight::good_parts_of_each(&pairs, taken) {
        text += &format!("  {} always: {}\n", builder, percent(part));
    }
    text
}
