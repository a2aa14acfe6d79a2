//! `hedgerow fly`: a camera path through scenes, trees that are built again at a cadence; records as they are measured, and a page.

use super::cadence::Cadence;
use super::page::{self, Points, totals};
use super::points::{FlownFrame, FlownPath, FlyEntry, FlySetting};
use super::{FlySetup, measure};
use crate::Error;
use crate::cli::options::{Builders, Frames, Kinds, Size};
use crate::cli::{Bar, Common, work};
use crate::device::Device;
use crate::measure::Setting;
use crate::measure::overlap::Epo;
use crate::report::names::distinct;
use crate::scene::Flight;
use crate::subjects::builders::Spec;
use ash::vk;
use std::io::Write;
use std::num::NonZeroU32;
use std::path::PathBuf;

/// Fly a camera through scenes that stand, build trees again at a cadence, each taught by the frame before, and write records and a page:
/// what builds take, what rays take, and when a rebuild pays
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Scenes: files, bare names, or generators; .dyn files and glTF files have paths of their own, others one by their name, or a turn
    #[arg(required = true, value_name = "SCENE")]
    scenes: Vec<String>,
    /// Builders with their options, separated by commas; those that nothing teaches are not built again
    #[arg(
        short,
        long = "builder",
        value_name = "BUILDER[,…]",
        default_value = "binned:axes=all:bins=10,binned:axes=all:bins=10:heuristic=interior-fast,binned:axes=all:bins=10:heuristic=rdh"
    )]
    builders: Builders,
    /// When trees are built again, separated by commas: never, every so many frames, or gain, where it is expected to pay
    #[arg(long, value_name = "never|N|gain[,…]", value_delimiter = ',', default_value = "never,3,1,gain")]
    cadence: Vec<Cadence>,
    /// A file with another path: the lines frames, seconds and camera of a .dyn file
    #[arg(long, value_name = "FILE")]
    path: Option<PathBuf>,
    /// Which frames: a number, spread evenly over the path, so that fewer are a faster flight, or A..B, those from A to before B
    #[arg(long, value_name = "N|A..B", default_value = "16")]
    frames: Frames,
    /// Kinds of rays, separated by commas, or all
    #[arg(long, value_name = "KIND[,KIND…]", default_value = "primary,shadow,ao,diffuse1,diffuse2")]
    rays: Kinds,
    /// Pixels of the pictures that are traced
    #[arg(long, value_name = "WxH", default_value = "160x90")]
    size: Size,
    /// Pixels of the pictures that totals are for, separated by commas: tracing goes with their number; gain flies for each of them
    #[arg(long, value_name = "WxH[,…]", value_delimiter = ',', default_value = "1280x720")]
    frame_size: Vec<Size>,
    /// Counted runs of every trace, after one that warms up; builds are run once
    #[arg(long, value_name = "N", default_value = "3")]
    runs: NonZeroU32,
    /// Whether the end-point overlap of first trees is measured: on, off, or cheap
    #[arg(long, value_name = "on|off|cheap", default_value = "cheap")]
    epo: Epo,
    /// The folder for fly.jsonl, charts and fly.html
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> anyhow::Result<()> {
    let cadences = distinct(arguments.cadence.iter().copied());
    let builders = common.builders(&arguments.builders.0);
    check(&builders, &cadences)?;
    if let (Some(path), true) = (&arguments.path, arguments.scenes.len() > 1) {
        let what = "it is a path through one scene; name one";
        return Err(Error::Argument(format!("--path {}: {what}", path.display())).into());
    }
    let size = arguments.size.rays(common.seed).size;
    let frame_sizes: Vec<[u32; 2]> = distinct(arguments.frame_size.iter().map(|size| size.rays(common.seed).size));
    // Before any work: a scene that cannot be flown through would end it in the middle.
    let flights = arguments.scenes.iter().map(|scene| flight(common, arguments, scene));
    let flights: Vec<(Flight, Vec<u32>)> = flights.collect::<crate::Result<_>>()?;
    let device = work::device_for(common, &builders)?;
    let mut points = Points::create(&arguments.output)?;
    let setting = setting(common, arguments, (&builders, &cadences), device.as_ref())?;
    points.append(FlyEntry::Setting(FlySetting { setting, size, frame_sizes: frame_sizes.clone() }))?;
    let bar = Bar::new(common, "", 0);
    let say = |what: &str| bar.say(what);
    let setup = FlySetup {
        device: device.as_ref(),
        builders: &builders,
        cadences: &cadences,
        kinds: &arguments.rays.0,
        rays: arguments.size.rays(common.seed),
        frame_sizes: &frame_sizes,
        runs: arguments.runs.get(),
        epo: arguments.epo,
        say: &say,
    };
    let mut failures = 0;
    let mut flown: Vec<FlownFrame> = Vec::new();
    let mut done = Ok(());
    for (flight, frames) in &flights {
        points.append(FlyEntry::Path(path(flight, frames)))?;
        let mut point = |entry: FlyEntry| {
            match &entry {
                FlyEntry::Failure(failure) => {
                    eprintln!("hedgerow: {failure}");
                    failures += 1;
                }
                FlyEntry::Fly(frame) => flown.push(frame.clone()),
                _ => {}
            }
            points.append(entry)
        };
        done = done.and(measure(&setup, flight, frames, &mut point));
    }
    drop(bar);
    let page = page::write(&arguments.output)?;
    done?;
    writeln!(std::io::stdout().lock(), "{}", totals::table(&flown, size, &frame_sizes))?;
    work::page_written(device.as_ref(), &page, failures)
}

/// Whether there is something to fly at these cadences.
fn check(builders: &[Spec], cadences: &[Cadence]) -> crate::Result<()> {
    let learns: Vec<bool> = builders.iter().map(Spec::learns_from_a_view).collect::<crate::Result<_>>()?;
    if let (Some(other), false) = (cadences.iter().find(|cadence| **cadence != Cadence::Never), learns.contains(&true))
    {
        let names: Vec<String> = builders.iter().map(Spec::to_string).collect();
        return Err(Error::Argument(format!(
            "--cadence {other}: {} learns nothing from a camera, so that a rebuild gives the same tree; take --cadence never, or a \
             builder with heuristic=perspective, rdh or osah",
            names.join(", ")
        )));
    }
    Ok(())
}

/// A scene with the way of a camera, and the frames of it.
fn flight(common: &Common, arguments: &Arguments, spec: &str) -> crate::Result<(Flight, Vec<u32>)> {
    let flight = common.load_flight(spec, arguments.path.as_deref())?;
    let frames = arguments.frames.of(&flight.scene.name, flight.frames())?;
    Ok((flight, frames))
}

fn path(flight: &Flight, frames: &[u32]) -> FlownPath {
    FlownPath {
        scene: flight.scene.name.clone(),
        triangles: flight.scene.mesh.triangles.len() as u64,
        path: flight.source.to_string(),
        path_frames: flight.frames(),
        seconds: flight.seconds(),
        frames: frames.to_vec(),
    }
}

/// Where and how it is measured.
fn setting(
    common: &Common,
    arguments: &Arguments,
    (builders, cadences): (&[Spec], &[Cadence]),
    device: Option<&Device>,
) -> crate::Result<Setting> {
    let mut notes = Vec::new();
    if device.is_some_and(|device| device.limits.kind == vk::PhysicalDeviceType::CPU) {
        let note = "The device is a CPU: figures of it say how much work there is, not how builders stand on a GPU.";
        notes.push(note.to_owned());
    }
    let untaught = builders.iter().filter(|spec| !spec.learns_from_a_view().is_ok_and(|learns| learns));
    let untaught: Vec<String> = untaught.map(Spec::to_string).collect();
    if !untaught.is_empty() && cadences.iter().any(|cadence| *cadence != Cadence::Never) {
        notes.push(format!("{}: built once, as a rebuild gives the same tree.", untaught.join(", ")));
    }
    let sizes: Vec<String> = arguments.frame_size.iter().map(Size::to_string).collect();
    let cadences: Vec<String> = cadences.iter().map(Cadence::to_string).collect();
    let options = [
        ("Cadences", cadences.join(", ")),
        ("Image", format!("{}, seed {}; totals for {}", arguments.size, common.seed, sizes.join(", "))),
        ("Runs", format!("{} of every trace, in turn; one of every build", arguments.runs)),
    ];
    Setting::of(device, &options, notes)
}
