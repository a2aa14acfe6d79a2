//! `hedgerow choose`: what `auto` would build, and why; and how good its choices are in hindsight.

use super::options::{RaysPerBuild, Size};
use super::{Bar, Common, Json, tables, work};
use crate::device::Device;
use crate::measure::choose::calibration::{self, Effort};
use crate::measure::choose::hindsight::{self, Choice, Miss, Pair, Taken};
use crate::measure::choose::model::Measured;
use crate::measure::choose::{DEFAULT_RAYS, Estimate, Features, Model, cache, candidates};
use crate::report::names::short;
use crate::report::numbers::{duration, grouped, short_count, three_digits};
use crate::scene::Scene;
use std::io::Write;
use std::num::NonZeroU32;
use std::time::Instant;

/// Milliseconds that a builder builds on a scene of `--hindsight`, and then no more.
const ENOUGH_MS: f64 = 500.0;

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
    if arguments.scenes.is_empty() || arguments.recalibrate {
        writeln!(std::io::stdout(), "{}\n", prices(&model))?;
    }
    let (mut choices, mut expected, mut all) = (Vec::new(), Vec::new(), Vec::new());
    for name in &arguments.scenes {
        let scene = common.load(name)?;
        if arguments.hindsight {
            choices.extend(hindsight::choices(&model, &scene));
            let measured = measured(common, arguments, &device, &scene)?;
            let text = beside_estimates(&model, &scene, &measured);
            writeln!(std::io::stdout(), "{text}\n")?;
            let estimates = model.estimates(&Features::of(&scene.mesh));
            expected.extend(estimates.iter().map(|estimate| Taken::expected(&scene.name, estimate)));
            all.extend(measured);
        } else {
            writeln!(std::io::stdout(), "{}\n", estimates(&model, &scene, rays))?;
        }
    }
    if arguments.hindsight {
        arguments.json.write_each(&all)?;
        writeln!(std::io::stdout(), "{}", in_hindsight(&choices, &expected, &all))?;
    }
    work::finish(Some(&device), true)
}

/// Every candidate measured on a scene, with all kinds of rays.
fn measured(common: &Common, arguments: &Arguments, device: &Device, scene: &Scene) -> crate::Result<Vec<Measured>> {
    let _bar = Bar::new(common, &format!("measuring {}", scene.name), 0);
    let effort = Effort { rays: arguments.size.rays(common.seed), runs: arguments.runs.get(), enough_ms: ENOUGH_MS };
    calibration::on_scene(device, scene, &candidates::possible(device), &effort)
}

/// What the device asks for what rays do.
fn prices(model: &Model) -> String {
    let mut text = model.prices.lines().join("\n");
    text += &format!("\ntimes of rays by these prices are right within {:.1}%", 100.0 * model.deviation.exp_m1());
    text
}

/// What every candidate is expected to take, the choice marked.
fn estimates(model: &Model, scene: &Scene, rays: f64) -> String {
    let start = Instant::now();
    let features = Features::of(&scene.mesh);
    let took = duration(start.elapsed().as_secs_f64() * 1e3);
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
    let (name, triangles, rays) = (&scene.name, grouped(features.triangles), short_count(rays));
    format!("{name}, {triangles} triangles, {rays} rays a build (its figures took {took})\n{table}")
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

/// Of choices that are not good, so many are shown.
const WORST: usize = 12;

/// Each choice beside the best, the part that is good, and why the others are not.
fn in_hindsight(choices: &[Choice], expected: &[Taken], measured: &[Measured]) -> String {
    let taken: Vec<Taken> = measured.iter().map(Taken::from).collect();
    let pairs = hindsight::pairs(choices, &taken);
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
    let mut text = format!(
        "{table}\n{}\nwithin 10% of the best: {part} of {} choices\n",
        worst(&pairs, expected, &taken),
        pairs.len()
    );
    for (builder, part) in hindsight::good_parts_of_each(&pairs, &taken) {
        text += &format!("  {} always: {}\n", builder, percent(part));
    }
    text
}

/// The worst choices with what was expected wrongly: how many times what was expected a build and a ray took.
fn worst(pairs: &[Pair], expected: &[Taken], taken: &[Taken]) -> String {
    let mut bad: Vec<&Pair> = pairs.iter().filter(|pair| pair.ratio() > 1.0 + hindsight::GOOD).collect();
    bad.sort_by(|a, b| b.ratio().total_cmp(&a.ratio()));
    let mut table =
        tables::table(&["worst", "rays a build", "chosen / best", "chosen: build, ray", "best: build, ray"], 1);
    for pair in bad.into_iter().take(WORST) {
        let misses = hindsight::misses(pair, expected, taken);
        let [chosen, best] = misses.map_or_else(Default::default, |misses| {
            misses.map(|Miss { build, ray }| format!("× {build:.2}, × {ray:.2} of what was expected"))
        });
        let Choice { scene, rays, .. } = &pair.choice;
        table.add_row([scene.clone(), short_count(*rays), format!("{:.3}", pair.ratio()), chosen, best]);
    }
    table.to_string()
}
