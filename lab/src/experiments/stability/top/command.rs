//! `hedgerow stability growth --level top`: its options, its table in the terminal, and its run.

use super::points::{FarInstances, FarSides, TopBuilder, TopGrowth, codes_of};
use crate::cli::work::page_written;
use crate::cli::{Bar, Common, tables};
use crate::experiments::stability::far::Side;
use crate::experiments::stability::page::{self, top::rows};
use crate::experiments::stability::points::Run;
use crate::experiments::stability::top;
use crate::measure::{Failure, Setting};
use crate::rays::kinds::{RayKind, RayOptions};
use crate::report::lines::Points;
use crate::report::numbers::three_digits;
use crate::scene::Instances;
use crate::subjects::preference::Preference;
use hedgerow::bvh::codes::Codes;
use std::io::Write;
use std::num::NonZeroU32;
use std::path::Path;

/// What grows where no scene is named.
const SCENE: &str = "gen:city:400";
/// Flags where `--prefer` does not say.
const PREFERENCES: [Preference; 2] = [Preference::FastTrace, Preference::FastBuild];
/// How many are far where `--far` does not say.
const FAR: [u32; 2] = [1, 100];

/// What a growth of top levels has beside.
#[derive(Debug, clap::Args)]
pub struct TopArguments {
    /// Of top levels: what their builds prefer, separated by commas: fast-trace, fast-build, none [default: fast-trace,fast-build]
    #[arg(long, value_name = "PREFERENCE[,…]", value_delimiter = ',')]
    prefer: Vec<Preference>,
    /// Of top levels: their codes, by name or default [default: default]
    #[arg(long, value_name = "CODES[,…]", value_delimiter = ',', value_parser = codes)]
    codes: Vec<NamedCodes>,
    /// Of top levels: re-braiding, on, off or both [default: on,off]
    #[arg(long, value_name = "on|off", value_delimiter = ',')]
    rebraid: Vec<OnOff>,
    /// Of top levels: nodes of eight where there can be, in both levels, on, off or both [default: on]
    #[arg(long, value_name = "on|off", value_delimiter = ',')]
    of_eight: Vec<OnOff>,
    /// Of top levels: how many instances are far; several have sides that are drawn [default: 1,100]
    #[arg(long, value_name = "N[,N…]", value_delimiter = ',')]
    far: Vec<NonZeroU32>,
}

/// On or off.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum OnOff {
    On,
    Off,
}

/// Codes that have a name; `None`: the default ones.
#[derive(Debug, Clone, Copy)]
struct NamedCodes(Option<Codes>);

fn codes(name: &str) -> Result<NamedCodes, String> {
    codes_of(name).map(NamedCodes).map_err(|error| error.to_string())
}

impl TopArguments {
    /// An option that was given, if one was: those of bottom levels have no use for it.
    pub fn first_given(&self) -> Option<&'static str> {
        let given = [
            (!self.prefer.is_empty(), "--prefer"),
            (!self.codes.is_empty(), "--codes"),
            (!self.rebraid.is_empty(), "--rebraid"),
            (!self.of_eight.is_empty(), "--of-eight"),
            (!self.far.is_empty(), "--far"),
        ];
        given.into_iter().find_map(|(is_given, name)| is_given.then_some(name))
    }

    fn builders(&self) -> Vec<TopBuilder> {
        let or_default = |given: &[OnOff], default: &[bool]| match given {
            [] => default.to_vec(),
            given => given.iter().map(|on| *on == OnOff::On).collect(),
        };
        let rebraid = or_default(&self.rebraid, &[true, false]);
        let of_eight = or_default(&self.of_eight, &[true]);
        let prefer = if self.prefer.is_empty() { &PREFERENCES[..] } else { &self.prefer };
        let default = [NamedCodes(None)];
        let codes = if self.codes.is_empty() { &default[..] } else { &self.codes };
        let mut builders = Vec::new();
        for &prefer in prefer {
            for &rebraid in &rebraid {
                for &of_eight in &of_eight {
                    builders.extend(codes.iter().map(|codes| TopBuilder { prefer, rebraid, of_eight, codes: codes.0 }));
                }
            }
        }
        builders
    }

    fn fars(&self, axes: &[u32], sides: &[Side]) -> Vec<FarInstances> {
        let counts: Vec<u32> = self.far.iter().map(|far| far.get()).collect();
        let mut fars = Vec::new();
        for &far in if counts.is_empty() { &FAR[..] } else { &counts } {
            let sides: Vec<FarSides> = match far {
                1 => sides.iter().map(|&side| FarSides::from(side)).collect(),
                _ => vec![FarSides::Drawn],
            };
            fars.extend(
                axes.iter().flat_map(|&axes| sides.iter().map(move |&sides| FarInstances { far, axes, sides })),
            );
        }
        fars
    }
}

impl From<Side> for FarSides {
    fn from(side: Side) -> FarSides {
        match side {
            Side::Positive => FarSides::Positive,
            Side::Negative => FarSides::Negative,
        }
    }
}

/// What both growths have.
pub struct Shared<'a> {
    /// The scenes that are named.
    pub scenes: &'a [String],
    /// Kinds of rays.
    pub kinds: &'a [RayKind],
    /// Their number and seed.
    pub rays: RayOptions,
    /// Counted runs.
    pub runs: u32,
    /// In how many axes the bounds grow.
    pub axes: &'a [u32],
    /// To which sides.
    pub sides: &'a [Side],
    /// By which e.
    pub steps: &'a [u32],
    /// The folder.
    pub output: &'a Path,
}

pub(in crate::experiments::stability) fn run(
    common: &Common,
    arguments: &TopArguments,
    shared: &Shared<'_>,
) -> anyhow::Result<()> {
    let default = [SCENE.to_owned()];
    let specs = if shared.scenes.is_empty() { &default[..] } else { shared.scenes };
    let scenes: Vec<Instances> = specs.iter().map(|spec| common.load_instances(spec)).collect::<crate::Result<_>>()?;
    let mut lines = Points::<TopGrowth>::create(shared.output)?;
    let device = common.open_device(false)?;
    let options = [
        ("Runs", format!("{} after a warm-up, in turn with e = 0", shared.runs)),
        ("Image", format!("{}x{}, seed {}", shared.rays.size[0], shared.rays.size[1], shared.rays.seed)),
    ];
    let mut run = Run { setting: Setting::of(Some(&device), &options, Vec::new())?, failures: Vec::new() };
    let bar = Bar::new(common, "measuring", 0);
    let say = |what: &str| bar.say(what);
    let stage =
        top::TopGrowthSetup { device: &device, runs: shared.runs, kinds: shared.kinds, rays: shared.rays, say: &say };
    let (builders, fars) = (arguments.builders(), arguments.fars(shared.axes, shared.sides));
    let mut points = Vec::new();
    for scene in &scenes {
        let mut failed = |failure: Failure| {
            eprintln!("hedgerow: {failure}");
            run.failures.push(failure);
        };
        let mut point = |point: TopGrowth| {
            lines.append(point.clone())?;
            points.push(point);
            Ok(())
        };
        let notes = top::measure(&stage, scene, &builders, (&fars, shared.steps), &mut failed, &mut point)?;
        run.setting.notes.extend(notes);
    }
    drop(bar);
    writeln!(std::io::stdout().lock(), "{}", table(&points))?;
    let page = page::finish::<TopGrowth>(shared.output, &run)?;
    page_written(Some(&device), &page, run.failures.len())
}

/// The worst of all e, over e = 0, and the e that has it.
fn table(points: &[TopGrowth]) -> String {
    let header = ["scene", "top level", "far", "bits", "cost", "work", "speed", "build", "frame"];
    let mut table = tables::table(&header, 3);
    for row in rows(points) {
        let worst = |worst: page::top::Worst| {
            worst.map_or_else(|| "-".to_owned(), |(value, e)| format!("{} at {e}", three_digits(value)))
        };
        let figures = [row.cost(), row.work(), row.speed(), row.build(), row.frame()].map(worst);
        let what = [row.scene.to_owned(), row.builder.to_string(), row.by.to_string(), row.code_bits().to_string()];
        table.add_row(what.into_iter().chain(figures));
    }
    format!("the worst of all e, over e = 0\n{table}")
}
