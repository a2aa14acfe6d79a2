//! `hedgerow stability`: where methods give way; records as they are measured, and a page for each experiment.

use super::degenerate;
use super::far::{FarTriangle, Side};
use super::greedy::{self, GreedySetup};
use super::large::{HugeTriangles, LargePlacement};
use super::page::{self, Paged};
use super::points::{Run, Stretched};
use super::relative::{self, Stretch};
use super::top::{
    self,
    command::{Shared, TopArguments},
};
use crate::cli::options::{Kinds, Size, Steps};
use crate::cli::work::{device_for_those, page_written};
use crate::cli::{Bar, Common};
use crate::device::Device;
use crate::experiments::stability;
use crate::measure::{Failure, Setting};
use crate::named::named;
use crate::rays::kinds::RayKind;
use crate::report::lines::Points;
use crate::scene::{self, Scene};
use crate::subjects::builders::{self, Spec};
use crate::subjects::peers::driver;
use std::num::NonZeroU32;
use std::path::PathBuf;

/// What is grown and walled in where no scene is named.
const SCENES: [&str; 1] = ["pigman"];

/// Measure where methods give way, and write records and a page
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(subcommand)]
    experiment: Experiment,
}

#[derive(Debug, clap::Subcommand)]
enum Experiment {
    /// One far triangle makes the bounds of a scene 2^e times as long: growth.jsonl and growth.html; or far instances those of a top level:
    /// growth-top.jsonl and growth-top.html
    Growth(Growth),
    /// Huge triangles at the edge of a scene, by the bounds that codes are normalised by: large.jsonl and large.html
    Large(Large),
    /// Scenes that hurt: valid trees, the same bytes each time, right hits? degenerate.jsonl and degenerate.html
    Degenerate(Degenerate),
    /// What greedy trees over up to 64 triangles cost beside the cheapest ones: greedy.jsonl and greedy.html
    Greedy(Greedy),
}

/// What growth and large primitives have in common.
#[derive(Debug, clap::Args)]
struct Relative {
    /// Scenes: files, bare names or generators [default: pigman]
    #[arg(value_name = "SCENE")]
    scenes: Vec<String>,
    /// Kinds of rays, separated by commas, or all
    #[arg(long, value_name = "KIND[,KIND…]", default_value = "primary,diffuse1,ao,shadow")]
    rays: Kinds,
    /// Costs alone: no rays
    #[arg(long, conflicts_with = "rays")]
    no_rays: bool,
    /// Pixels of the picture that the rays belong to
    #[arg(long, value_name = "WxH", default_value = "128x96")]
    size: Size,
    /// Counted runs of every trace, in turn with that at e = 0, after one that warms up
    #[arg(long, value_name = "N", default_value = "5")]
    runs: NonZeroU32,
    /// The folder for records, charts and the page; pages of other experiments there are linked
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

#[derive(Debug, clap::Args)]
struct Growth {
    #[command(flatten)]
    relative: Relative,
    /// What grows: bottom, a structure over triangles, or top, one over instances
    #[arg(long, value_name = "LEVEL", default_value = "bottom")]
    level: GrownLevel,
    /// Of bottom levels: builders with their options, separated by commas, or all [default: LBVHs by all kinds of codes, H-PLOC, PLOC]
    #[arg(short, long, value_name = "BUILDER[,BUILDER…]")]
    builder: Option<String>,
    #[command(flatten)]
    top: TopArguments,
    /// The e that are measured beside 0: a list of numbers, or LAST/STEP for every STEP up to LAST
    #[arg(long, value_name = "E,E…|LAST/STEP", default_value = "60/2")]
    steps: Steps,
    /// In how many axes the bounds grow: 1, 3 or both
    #[arg(long, value_name = "1|3", value_delimiter = ',', default_value = "1,3", value_parser = axes)]
    axes: Vec<u32>,
    /// To which sides: +, - or both
    #[arg(long, value_name = "+|-", value_delimiter = ',', default_value = "+,-", value_parser = side, allow_hyphen_values = true)]
    sides: Vec<Side>,
}

/// Which level of structures grows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum GrownLevel {
    /// One over triangles.
    Bottom,
    /// One over instances.
    Top,
}

named!(GrownLevel, "level": Bottom = "bottom", Top = "top");

#[derive(Debug, clap::Args)]
struct Large {
    #[command(flatten)]
    relative: Relative,
    /// Builders with their options, separated by commas, or all
    #[arg(short, long, value_name = "BUILDER[,BUILDER…]", default_value = stability::LARGE_BUILDERS)]
    builder: String,
    /// The e that are measured beside 0: a list of numbers, or LAST/STEP for every STEP up to LAST
    #[arg(long, value_name = "E,E…|LAST/STEP", default_value = "20/2")]
    steps: Steps,
    /// Where the triangles stand: wall (at one side), walls (at all), outward (from a corner away)
    #[arg(long, value_name = "PLACEMENT[,…]", value_delimiter = ',', default_value = "wall,walls,outward")]
    placements: Vec<LargePlacement>,
    /// How many triangles a side
    #[arg(long, value_name = "N[,N…]", value_delimiter = ',', default_value = "1,16")]
    counts: Vec<NonZeroU32>,
}

#[derive(Debug, clap::Args)]
struct Degenerate {
    /// The scenes, by the names that the page has [default: all]
    #[arg(value_name = "SCENE")]
    scenes: Vec<String>,
    /// Builders with their options, separated by commas, or all
    #[arg(short, long, value_name = "BUILDER[,BUILDER…]", default_value = stability::DEGENERATE_BUILDERS)]
    builder: String,
    /// Triangles of a scene
    #[arg(long, value_name = "N", default_value = "2000")]
    triangles: NonZeroU32,
    /// Builds of each, whose bytes are compared
    #[arg(long, value_name = "N", default_value = "20")]
    builds: NonZeroU32,
    /// The folder for records and the page; pages of other experiments there are linked
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

#[derive(Debug, clap::Args)]
struct Greedy {
    /// Scenes of which parts are measured, too: files, bare names or generators [default: pigman]
    #[arg(value_name = "SCENE")]
    scenes: Vec<String>,
    /// Random scenes of each size up to 30 triangles; of the other kinds half as many, and fewer of more triangles
    #[arg(long, value_name = "N", default_value = "50")]
    seeds: NonZeroU32,
    /// Triangles of a scene at most; from 50 on each takes many seconds
    #[arg(long, value_name = "N", default_value = "64", value_parser = clap::value_parser!(u32).range(3..=64))]
    most: u32,
    /// The folder for records, charts and the page; pages of other experiments there are linked
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

impl Relative {
    /// The kinds of rays; none where costs alone are asked for.
    fn kinds(&self) -> &[RayKind] {
        if self.no_rays { &[] } else { &self.rays.0 }
    }
}

fn axes(text: &str) -> Result<u32, String> {
    let axes = text.parse().ok().filter(|axes| [1, 3].contains(axes));
    axes.ok_or_else(|| format!("{text:?} is not a number of axes; use 1 or 3"))
}

fn side(text: &str) -> Result<Side, String> {
    Side::ALL.into_iter().find(|side| side.name() == text).ok_or_else(|| format!("{text:?} is not a side; use + or -"))
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> anyhow::Result<()> {
    match &arguments.experiment {
        Experiment::Growth(growth) => run_growth(common, growth),
        Experiment::Large(Large { relative, builder, steps, placements, counts }) => {
            let each = |&placement| counts.iter().map(move |count| HugeTriangles { placement, count: count.get() });
            let stretches: Vec<HugeTriangles> = placements.iter().flat_map(each).collect();
            run_relative(common, relative, builder, (&stretches, &steps.0))
        }
        Experiment::Degenerate(degenerate) => run_degenerate(common, degenerate),
        Experiment::Greedy(greedy) => run_greedy(common, greedy),
    }
}

fn run_growth(common: &Common, growth: &Growth) -> anyhow::Result<()> {
    let Growth { relative, level, builder, top, steps, axes, sides } = growth;
    if *level == GrownLevel::Top {
        if builder.is_some() {
            return Err(refused("-b chooses builders of bottom levels; with --level top take --prefer and --codes"));
        }
        let shared = Shared {
            scenes: &relative.scenes,
            kinds: relative.kinds(),
            rays: relative.size.rays(common.seed),
            runs: relative.runs.get(),
            axes,
            sides,
            steps: &steps.0,
            output: &relative.output,
        };
        return top::command::run(common, top, &shared);
    }
    if let Some(given) = top.first_given() {
        return Err(refused(&format!("{given} is for top levels; add --level top, or leave it out")));
    }
    let both = |&axes: &u32| sides.iter().map(move |&side| FarTriangle { axes, side });
    let stretches: Vec<FarTriangle> = axes.iter().flat_map(both).collect();
    let builder = builder.as_deref().unwrap_or(stability::GROWTH_BUILDERS);
    run_relative(common, relative, builder, (&stretches, &steps.0))
}

/// Options that do not go together.
fn refused(what: &str) -> anyhow::Error {
    crate::Error::Argument(what.into()).into()
}

/// The scenes of these names, or those that are taken where none is named.
fn loaded(common: &Common, named: &[String]) -> crate::Result<Vec<Scene>> {
    match named {
        [] => SCENES.iter().map(|spec| common.load(spec)).collect(),
        named => named.iter().map(|spec| common.load(spec)).collect(),
    }
}

fn run_greedy(common: &Common, arguments: &Greedy) -> anyhow::Result<()> {
    let scenes = loaded(common, &arguments.scenes)?;
    let mut points = Points::create(&arguments.output)?;
    let options = [("Random scenes", format!("{} of each size, the first with seed {}", arguments.seeds, common.seed))];
    let run = started(None, &[], &options)?;
    let bar = Bar::new(common, "measuring", 0);
    let setup = GreedySetup {
        seeds: arguments.seeds.get(),
        most: arguments.most,
        first_seed: common.seed,
        say: &|what| bar.say(what),
    };
    greedy::measure(&setup, &scenes, &mut |point| points.append(point))?;
    drop(bar);
    let page = page::finish::<stability::points::Greedy>(&arguments.output, &run)?;
    page_written(None, &page, 0)
}

fn run_relative<S: Stretch>(
    common: &Common,
    arguments: &Relative,
    builders: &str,
    stretches: (&[S], &[u32]),
) -> anyhow::Result<()>
where
    Stretched<S>: Paged,
{
    let scenes = loaded(common, &arguments.scenes)?;
    let (device, specs) = opened(common, builders)?;
    // Before any work: a folder that cannot be written would lose all of it.
    let mut points = Points::<Stretched<S>>::create(&arguments.output)?;
    let kinds = arguments.kinds();
    let options = [
        ("Runs", format!("{} after a warm-up, in turn with e = 0", arguments.runs)),
        ("Image", format!("{}, seed {}", arguments.size, common.seed)),
    ];
    let mut run = started(device.as_ref(), &specs, if kinds.is_empty() { &[] } else { &options })?;
    let bar = Bar::new(common, "measuring", 0);
    let say = |what: &str| bar.say(what);
    let stage = relative::RelativeSetup {
        device: device.as_ref(),
        builders: &specs,
        runs: arguments.runs.get(),
        kinds,
        rays: arguments.size.rays(common.seed),
        say: &say,
    };
    for scene in &scenes {
        let mut failed = |failure: Failure| {
            eprintln!("hedgerow: {failure}");
            run.failures.push(failure);
        };
        let mut point = |point| points.append(point);
        run.setting.notes.extend(relative::measure(&stage, scene, stretches, &mut failed, &mut point)?);
    }
    drop(bar);
    let page = page::finish::<Stretched<S>>(&arguments.output, &run)?;
    page_written(device.as_ref(), &page, run.failures.len())
}

fn run_degenerate(common: &Common, arguments: &Degenerate) -> anyhow::Result<()> {
    let mut scenes = scene::degenerate(arguments.triangles.get());
    if let Some(unknown) = arguments.scenes.iter().find(|name| scenes.iter().all(|scene| scene.name != **name)) {
        let names: Vec<&str> = scenes.iter().map(|scene| scene.name).collect();
        let what = format!("unknown degenerate scene {unknown:?}; use one of {}", names.join(", "));
        return Err(crate::Error::Argument(what).into());
    }
    scenes.retain(|scene| arguments.scenes.is_empty() || arguments.scenes.iter().any(|name| name == scene.name));
    let (device, specs) = opened(common, &arguments.builder)?;
    let mut points = Points::create(&arguments.output)?;
    let options = [
        ("Triangles", format!("about {} a scene", arguments.triangles)),
        ("Builds", format!("{} of each, the first to warm up", arguments.builds)),
    ];
    let mut run = started(device.as_ref(), &specs, &options)?;
    let bar = Bar::new(common, "measuring", scenes.len() as u64);
    let stage = degenerate::DegenerateSetup {
        device: device.as_ref(),
        builders: &specs,
        builds: arguments.builds.get(),
        seed: common.seed,
        say: &|what| bar.say(what),
    };
    let mut failures = 0;
    for scene in &scenes {
        degenerate::measure(&stage, scene, &mut |point| {
            for fault in &point.faults {
                let whose = if point.is_ours { "" } else { " (a peer)" };
                eprintln!("hedgerow: {}: {}{whose}: {fault}", point.scene, point.builder);
            }
            failures += usize::from(point.has_failed());
            points.append(point)
        })?;
        bar.step();
    }
    drop(bar);
    if specs.iter().any(degenerate::is_peer) {
        let note = "Peers get the scenes without triangles whose vertices are not there; what goes wrong with them is shown and is no \
                    failure of ours.";
        run.setting.notes.push(note.into());
    }
    let page = page::finish::<stability::points::Degenerate>(&arguments.output, &run)?;
    page_written(device.as_ref(), &page, failures)
}

/// The device that the builders need, and those of them that can work here: one that came with `all` and cannot is left out.
fn opened(common: &Common, text: &str) -> anyhow::Result<(Option<Device>, Vec<Spec>)> {
    let asked = builders::parse_list(text)?;
    let was_named = |spec: &Spec| text.split(',').any(|part| part.trim() == spec.to_string());
    let (device, specs) = device_for_those(common, &asked, was_named)?;
    Ok((device, specs.into_iter().cloned().collect()))
}

/// Where and how it is measured; nothing has failed yet.
fn started(device: Option<&Device>, specs: &[Spec], options: &[(&str, String)]) -> crate::Result<Run> {
    let has_driver = specs.iter().any(|spec| spec.needs() == builders::Needs::RayQuery);
    let note = device.filter(|_| has_driver).and_then(|device| driver::note(device.found()));
    Ok(Run { setting: Setting::of(device, options, note.into_iter().collect())?, failures: Vec::new() })
}
