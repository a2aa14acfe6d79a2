//! `hedgerow choose`: what `auto` would build, and why; and how good its choices are in hindsight.

use super::calibration::{self, Effort};
use super::hindsight::{self, Choice, Pair};
use super::{Cost, CostRow, CostTable, SceneClass, SceneCost, cache, candidates};
use crate::cli::options::{RaysPerBuild, Size};
use crate::cli::{Bar, Common, Json, tables, work};
use crate::device::Device;
use crate::measure::total_time::{Line, lower_envelope};
use crate::report::names::short;
use crate::report::numbers::{duration, grouped, short_count, three_digits};
use crate::scene::Scene;
use crate::subjects::auto::DEFAULT_RAYS;
use std::io::Write;
use std::num::NonZeroU32;

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

pub(crate) fn run(common: &Common, arguments: &Arguments) -> anyhow::Result<()> {
    let device = work::device_for(common, &["auto".parse()?])?.expect("auto works on a device");
    let costs = calibrated(common, &device, arguments.recalibrate)?;
    let rays = common.rays_per_build.map_or(DEFAULT_RAYS, |RaysPerBuild(rays)| rays);
    if arguments.scenes.is_empty() || arguments.recalibrate {
        writeln!(std::io::stdout(), "{}\n", builders(&costs))?;
    }
    let (mut choices, mut taken) = (Vec::new(), Vec::new());
    for name in &arguments.scenes {
        let scene = common.load(name)?;
        if arguments.hindsight {
            choices.extend(hindsight::choices(&costs, &scene));
            let measured = measured(common, arguments, &device, &scene)?;
            writeln!(std::io::stdout(), "{}\n", beside_expected(&costs, &scene, &measured))?;
            taken.extend(measured);
        } else {
            writeln!(std::io::stdout(), "{}\n", expected(&costs, &scene, rays))?;
        }
    }
    if arguments.hindsight {
        arguments.json.write_each(&taken)?;
        writeln!(std::io::stdout(), "{}", in_hindsight(&choices, &taken))?;
    }
    work::finish(Some(&device), true)
}

/// The table of costs of the device, measured under a progress bar where it is not known, or with `anew`.
pub(crate) fn calibrated(common: &Common, device: &Device, anew: bool) -> crate::Result<CostTable> {
    let bar = Bar::new(common, "calibrating", 0);
    cache::table_of(device, anew, &mut |what| bar.say(what))
}

/// Every candidate measured on a scene, with all kinds of rays.
fn measured(common: &Common, arguments: &Arguments, device: &Device, scene: &Scene) -> crate::Result<Vec<SceneCost>> {
    let _bar = Bar::new(common, &format!("measuring {}", scene.name), 0);
    let effort = Effort { rays: arguments.size.rays(common.seed), runs: arguments.runs.get(), enough_ms: ENOUGH_MS };
    let measured = calibration::on_scene(device, scene, &candidates::possible(device), &effort)?;
    Ok(measured.into_iter().map(|m| SceneCost { scene: scene.name.clone(), cost: m.cost }).collect())
}

/// Which builder is taken for scenes of each size, from how many rays a build on.
fn builders(costs: &CostTable) -> String {
    let mut table = tables::table(&["scenes", "from rays a build", "builder", "build", "a ray"], 1);
    for CostRow { class, costs } in &costs.rows {
        let lines: Vec<Line> = costs.iter().map(Cost::line).collect();
        for (i, stretch) in lower_envelope(&lines).into_iter().enumerate() {
            let cost = &costs[stretch.line];
            table.add_row([
                if i == 0 { described(class) } else { String::new() },
                short_count(stretch.from),
                cost.builder.clone(),
                duration(cost.build_ms),
                nanoseconds(cost),
            ]);
        }
    }
    table.to_string()
}

fn described(class: &SceneClass) -> String {
    let crowded = if class.is_crowded { ", crowded" } else { "" };
    format!("{} triangles{crowded}", grouped(class.triangles))
}

fn nanoseconds(cost: &Cost) -> String {
    format!("{} ns", three_digits(cost.ray_ns))
}

/// What every candidate is expected to take, the choice marked.
fn expected(costs: &CostTable, scene: &Scene, rays: f64) -> String {
    let class = SceneClass::of(&scene.mesh);
    let chosen = costs.choose(&class, rays).map(|cost| cost.builder);
    let mut table = tables::table(&["", "builder", "build", "a ray", "in all"], 2);
    for cost in costs.costs(&class) {
        let mark = if chosen.as_ref() == Some(&cost.builder) { "→" } else { "" };
        let (build, ray, total) = (duration(cost.build_ms), nanoseconds(&cost), duration(cost.total_ms(rays)));
        table.add_row([mark.to_owned(), cost.builder, build, ray, total]);
    }
    format!("{}, {}, {} rays a build\n{table}", scene.name, described(&class), short_count(rays))
}

/// What every candidate took beside what it was expected to take.
fn beside_expected(costs: &CostTable, scene: &Scene, measured: &[SceneCost]) -> String {
    let class = SceneClass::of(&scene.mesh);
    let mut table = tables::table(&["builder", "build", "expected", "a ray", "expected"], 1);
    for expected in costs.costs(&class) {
        let Some(took) = measured.iter().map(|m| &m.cost).find(|cost| cost.builder == expected.builder) else {
            continue;
        };
        let builds = [took, &expected].map(|cost| duration(cost.build_ms));
        let rays = [took, &expected].map(nanoseconds);
        table.add_row([vec![took.builder.clone()], builds.to_vec(), rays.to_vec()].concat());
    }
    format!("{}, {}\n{table}", scene.name, described(&class))
}

/// Each choice beside the best, and the part that is good.
fn in_hindsight(choices: &[Choice], taken: &[SceneCost]) -> String {
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
        text += &format!("  {builder} always: {}\n", percent(part));
    }
    text
}
