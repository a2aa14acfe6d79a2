//! `hedgerow animate`: a dynamic scene frame by frame in each of the ways; records as they are measured, pictures, and a page.

use crate::Error;
use crate::cli::options::{Frames, Kinds, Size};
use crate::cli::{Bar, Common, work};
use crate::device::Device;
use crate::experiments::animate::page::{self, Points, standings};
use crate::experiments::animate::points::{AnimateEntry, Object, SceneSetting};
use crate::experiments::animate::{AnimateSetup, AnimationMethod, measure};
use crate::measure::Setting;
use crate::report::picture::{PictureOptions, View, picture};
use crate::scene::{DynamicScene, Scene};
use crate::subjects::Subject;
use crate::subjects::builders::{KdSpec, Spec};
use ash::vk;
use std::io::Write;
use std::num::NonZeroU32;
use std::path::PathBuf;

/// Build and trace a scene that moves, frame by frame in each of five ways (all anew, a static and a dynamic tree, a tree per
/// object, two levels, merging into the static tree and restoring it), and write records, a page, and the frames as PNG
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The scene: a .dyn or .anim file, a .gltf or .glb with animations, a bare name, or gen:twist:N:FRAMES
    scene: String,
    /// The ways, separated by commas; hits are compared with those of the first, which also makes the pictures
    #[arg(
        long,
        value_name = "WAY[,…]",
        value_delimiter = ',',
        default_value = "rebuild,two-trees,tree-per-object,two-level,merge"
    )]
    ways: Vec<AnimationMethod>,
    /// Builder of the kd-trees of every frame, with options: kd-gpu on the device, kd-binned and others on the host, which then
    /// traces them, too, unless :trace=device follows
    #[arg(short, long, value_name = "BUILDER", default_value = "kd-gpu")]
    builder: Spec,
    /// Builder of the kd-tree of what stands still: runs once, on the host
    #[arg(long, value_name = "BUILDER", default_value = "kd-exact")]
    static_builder: Spec,
    /// Which frames: a number, spread evenly over all, or A..B, those from A to before B
    #[arg(long, value_name = "N|A..B", default_value = "12")]
    frames: Frames,
    /// Kinds of rays, separated by commas, or all
    #[arg(long, value_name = "KIND[,KIND…]", default_value = "primary,shadow,diffuse1")]
    rays: Kinds,
    /// Pixels of the pictures, and of the one that the rays belong to
    #[arg(long, value_name = "WxH", default_value = "320x240")]
    size: Size,
    /// Counted runs of every build and trace, after one in the first frame that warms up
    #[arg(long, value_name = "N", default_value = "3")]
    runs: NonZeroU32,
    /// Whether the frames are written as PNG
    #[arg(long, value_name = "on|off", default_value = "on", value_parser = on_or_off, action = clap::ArgAction::Set)]
    png: bool,
    /// The folder for animate.jsonl, charts, animate.html and frame-0000.png and so on
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

fn on_or_off(text: &str) -> Result<bool, String> {
    match text {
        "on" => Ok(true),
        "off" => Ok(false),
        _ => Err(format!("{text:?} is neither on nor off")),
    }
}

fn file_of(frame: u32) -> String {
    format!("frame-{frame:04}.png")
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> anyhow::Result<()> {
    if let Some((i, way)) = arguments.ways.iter().enumerate().find(|&(i, way)| arguments.ways[..i].contains(way)) {
        return Err(Error::Argument(format!("--ways names {way} twice (number {}); once is enough", i + 1)).into());
    }
    let builder = arguments.builder.kd()?;
    let KdSpec::Host { options: static_options, .. } = arguments.static_builder.kd()? else {
        let what = "what stands still is built once, on the host; take kd-exact, kd-binned or kd-gpu-host";
        return Err(Error::Argument(format!("--static-builder {}: {what}", arguments.static_builder)).into());
    };
    let scene = common.load_dynamic(&arguments.scene)?;
    if scene.objects.is_empty() {
        let what =
            "only its camera moves, so that there is nothing to build every frame; take a scene with objects that move";
        return Err(Error::Scene(format!("{}: {what}", scene.name)).into());
    }
    let frames = arguments.frames.of(&scene.name, scene.frames)?;
    let device = match work::device_for(common, std::slice::from_ref(&arguments.builder))? {
        None if arguments.ways.contains(&AnimationMethod::TwoLevel) => Some(common.open_device(false)?),
        device => device,
    };
    // Before any work: a folder that cannot be written would lose all of it.
    let mut points = Points::create(&arguments.output)?;
    points.append(AnimateEntry::Setting(setting(common, arguments, &scene, &frames, builder, device.as_ref())?))?;
    let bar = Bar::new(common, "", frames.len() as u64 + 1);
    let (aim, say) = (|camera: &mut _| common.aim(camera), |what: &str| bar.say(what));
    let stage = AnimateSetup {
        device: device.as_ref(),
        ways: &arguments.ways,
        builder: &arguments.builder,
        static_options,
        runs: arguments.runs.get(),
        kinds: &arguments.rays.0,
        rays: arguments.size.rays(common.seed),
        costs: [3.0, 2.0],
        aim: &aim,
        say: &say,
    };
    let mut failures = 0;
    let mut measured = Vec::new();
    let mut point = |entry: AnimateEntry| {
        if let AnimateEntry::Failure(failure) = &entry {
            eprintln!("hedgerow: {failure}");
            failures += 1;
        } else if let AnimateEntry::Animate(frame) = &entry {
            measured.push(frame.clone());
        }
        points.append(entry)
    };
    let options = PictureOptions { view: View::Shaded, size: stage.rays.size, seed: common.seed, top: None };
    let mut show = |frame: u32, scene: &Scene, subject: &mut dyn Subject| {
        bar.step();
        if !arguments.png {
            return Ok(());
        }
        let path = arguments.output.join(file_of(frame));
        let saved = picture(scene, subject, &options)?.save(&path);
        saved.map_err(|error| Error::file(&path)(std::io::Error::other(error)))
    };
    let done = measure(&stage, &scene, &frames, &mut point, &mut show);
    drop(bar);
    let page = page::write(&arguments.output)?;
    done?;
    writeln!(std::io::stdout().lock(), "{}", standings::table(&measured))?;
    work::page_written(device.as_ref(), &page, failures)
}

/// Where, how and of what it is measured.
fn setting(
    common: &Common,
    arguments: &Arguments,
    scene: &DynamicScene,
    frames: &[u32],
    builder: KdSpec,
    device: Option<&Device>,
) -> crate::Result<SceneSetting> {
    let mut notes = Vec::new();
    if device.is_some_and(|device| device.limits.kind == vk::PhysicalDeviceType::CPU) {
        let note = "The device is a CPU: figures of it say how much work the ways are, not how they stand on a GPU.";
        notes.push(note.to_owned());
    }
    if let KdSpec::Host { traces_on_device, .. } = builder
        && arguments.ways.contains(&AnimationMethod::TwoLevel)
    {
        let traced = if traces_on_device { "" } else { " and traced" };
        notes.push(format!("Kd-trees are built{traced} by the host here, two levels by the device."));
    }
    let options = [
        ("Kd-trees", format!("{} every frame, {} of what stands still", arguments.builder, arguments.static_builder)),
        ("Runs", format!("{} of every build and trace, in turn", arguments.runs)),
        ("Image", format!("{}, seed {}", arguments.size, common.seed)),
        ("Frames", format!("{} of {} in {} s", frames.len(), scene.frames, scene.seconds)),
    ];
    let pictures = frames.iter().filter(|_| arguments.png).map(|&frame| (frame, file_of(frame))).collect();
    let objects = scene.objects.iter();
    let objects =
        objects.map(|o| Object { name: o.name.clone(), triangles: o.triangles.len() as u64, morphs: o.morphs() });
    Ok(SceneSetting {
        setting: Setting::of(device, &options, notes)?,
        scene: scene.name.clone(),
        static_triangles: scene.static_mesh.triangles.len() as u64,
        objects: objects.collect(),
        static_builder: arguments.static_builder.to_string(),
        pictures,
    })
}
