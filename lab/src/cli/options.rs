//! Options that every command takes, and the values they are made of.

use super::Bar;
use crate::device::{Device, DeviceOptions, DriverTracing, Validation};
use crate::rays::kinds::{RayKind, RayOptions};
use crate::report::names::distinct;
use crate::scene::{self, Camera, DynamicScene, Flight, Instances, Scene};
use crate::subjects::builders::{self, Spec};
use clap::builder::{OsStringValueParser, TypedValueParser};
use hedgerow::gpu::TuningChoice;
use std::num::{NonZeroU32, NonZeroUsize};
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Options that every command takes.
#[derive(Debug, Clone, clap::Args)]
#[command(next_help_heading = "Common options")]
pub struct Common {
    /// Vulkan device: its index, or a part of its name
    #[arg(long, global = true, env = "HEDGEROW_DEVICE", value_name = "NAME_OR_INDEX")]
    device: Option<String>,
    /// How work is cut: for what the device is, or as for a CPU or a GPU, to the same bytes
    #[arg(long, global = true, env = "HEDGEROW_TUNING", value_name = "auto|cpu|gpu", default_value = "auto")]
    pub tuning: TuningChoice,
    /// Switch the Vulkan validation layers on; any message is an error
    #[arg(long, global = true)]
    pub validation: bool,
    /// Seed of the rays that are drawn at random
    #[arg(long, global = true, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Threads of builders and tracers on the host [default: one a core]
    #[arg(long, global = true, value_name = "N")]
    pub threads: Option<NonZeroUsize>,
    /// Where the camera is, instead of the scene's own place
    #[arg(long, global = true, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub eye: Option<Point>,
    /// What the camera looks at
    #[arg(long, global = true, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub look: Option<Point>,
    /// The camera's vertical field of view
    #[arg(long, global = true, value_name = "DEGREES", value_parser = number(FIELD_OF_VIEW, |d| d > 0.0 && d < 180.0))]
    pub fov: Option<f32>,
    /// Rays that are traced between two builds: what the builder auto chooses for [default: 1e7]
    #[arg(long, global = true, value_name = "N")]
    pub rays_per_build: Option<RaysPerBuild>,
    /// A folder with more scenes
    #[arg(long, global = true, env = "HEDGEROW_SCENES", value_name = "DIR", value_parser = perhaps_empty())]
    scenes_dir: Option<PathBuf>,
    /// No progress on stderr
    #[arg(long, short, global = true)]
    pub quiet: bool,
}

/// A path, or nothing: a variable of the environment that is empty is as one that is not set.
pub fn perhaps_empty() -> impl TypedValueParser<Value = PathBuf> {
    OsStringValueParser::new().map(PathBuf::from)
}

impl Common {
    /// The device that is asked for.
    pub fn device(&self) -> Option<&str> {
        self.device.as_deref().filter(|device| !device.is_empty())
    }

    /// The folder with more scenes.
    pub fn scenes_dir(&self) -> Option<&Path> {
        self.scenes_dir.as_deref().filter(|folder| !folder.as_os_str().is_empty())
    }

    /// Makes rayon's pool as large as `--threads` asks for. Once a process.
    pub(crate) fn start_threads(&self) -> anyhow::Result<()> {
        if let Some(threads) = self.threads {
            rayon::ThreadPoolBuilder::new().num_threads(threads.get()).build_global()?;
        }
        Ok(())
    }

    /// The builders of `-b`, with the rays of `--rays-per-build` where one chooses by them.
    pub fn builders(&self, asked: &[Spec]) -> Vec<Spec> {
        let with_rays = |spec: &Spec| match self.rays_per_build {
            Some(RaysPerBuild(rays)) => spec.clone().for_rays(rays),
            None => spec.clone(),
        };
        asked.iter().map(with_rays).collect()
    }

    /// Opens the device; with `driver`, the driver's own acceleration structures come with it where it has them.
    ///
    /// # Errors
    /// There is no such device, or it lacks something.
    pub fn open_device(&self, driver: bool) -> crate::Result<Device> {
        Device::new(&DeviceOptions {
            wanted: self.device().map(str::to_owned),
            validation: if self.validation { Validation::All } else { Validation::Off },
            driver_tracing: driver.then_some(DriverTracing::Query),
            tuning: self.tuning,
            ..DeviceOptions::default()
        })
    }

    /// The folders in which bare scene names are looked up.
    pub fn scene_folders(&self) -> Vec<PathBuf> {
        scene::own_folders().into_iter().chain(self.scenes_dir().map(Path::to_owned)).collect()
    }

    /// Loads a scene under a progress bar, with the camera that `--eye`, `--look` and `--fov` ask for.
    ///
    /// # Errors
    /// The scene cannot be found, read or used.
    pub fn load(&self, spec: &str) -> crate::Result<Scene> {
        let mut scene = self.loaded(spec, scene::load)?;
        self.aim(&mut scene.camera);
        Ok(scene)
    }

    /// The same of a scene of instances, whose parts stay apart.
    ///
    /// # Errors
    /// The scene cannot be found, read or used.
    pub fn load_instances(&self, spec: &str) -> crate::Result<Instances> {
        let mut scene = self.loaded(spec, scene::load_instances)?;
        self.aim(&mut scene.camera);
        Ok(scene)
    }

    /// Loads a dynamic scene under a progress bar; each time its camera is aimed again.
    ///
    /// # Errors
    /// The scene cannot be found, read or used, or nothing in it moves.
    pub fn load_dynamic(&self, spec: &str) -> crate::Result<DynamicScene> {
        self.loaded(spec, scene::load_dynamic)
    }

    /// Loads a scene with the way of a camera under a progress bar; see [`scene::load_flight`].
    ///
    /// # Errors
    /// The scene cannot be found, read or used; the path cannot be read.
    pub fn load_flight(&self, spec: &str, path: Option<&Path>) -> crate::Result<Flight> {
        self.loaded(spec, |spec, options| scene::load_flight(spec, path, options))
    }

    fn loaded<T>(
        &self,
        spec: &str,
        load: impl Fn(&str, &scene::LoadOptions<'_>) -> crate::Result<T>,
    ) -> crate::Result<T> {
        let bar = Bar::bytes(self, &format!("loading {spec}"));
        let progress = |p: scene::Progress| bar.set(p.done, p.total);
        load(spec, &scene::LoadOptions { folders: self.scene_folders(), progress: Some(&progress) })
    }

    /// Moves a camera to where `--eye`, `--look` and `--fov` ask for it.
    pub fn aim(&self, camera: &mut Camera) {
        camera.eye = self.eye.map_or(camera.eye, |Point(eye)| eye);
        camera.look = self.look.map_or(camera.look, |Point(look)| look);
        camera.fov = self.fov.unwrap_or(camera.fov);
    }
}

/// A number of rays, from 0 on; may be written `1e6`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RaysPerBuild(pub f64);

impl FromStr for RaysPerBuild {
    type Err = String;

    fn from_str(text: &str) -> Result<RaysPerBuild, String> {
        let rays = text.parse().ok().filter(|n: &f64| *n >= 0.0 && n.is_finite());
        rays.map(RaysPerBuild).ok_or_else(|| format!("{text:?} is not a number of rays; write one as in 1e6"))
    }
}

/// A point, written `X,Y,Z`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point(pub [f32; 3]);

impl FromStr for Point {
    type Err = String;

    fn from_str(text: &str) -> Result<Point, String> {
        let wrong = || format!("{text:?} is not a point; write three numbers with commas, as in 1,2.5,-3");
        let numbers: Vec<f32> =
            text.split(',').map(|n| n.trim().parse()).collect::<Result<_, _>>().map_err(|_| wrong())?;
        let point: [f32; 3] = numbers.try_into().map_err(|_| wrong())?;
        point.iter().all(|c| c.is_finite()).then_some(Point(point)).ok_or_else(wrong)
    }
}

/// What [`Common::fov`] is.
const FIELD_OF_VIEW: &str = "an angle between 0 and 180 degrees";

/// A number that `is_right`: what it is, for messages.
pub fn number(what: &'static str, is_right: fn(f32) -> bool) -> impl TypedValueParser<Value = f32> {
    move |text: &str| match text.parse() {
        Ok(number) if is_right(number) => Ok(number),
        _ => Err(format!("{text:?} is not {what}")),
    }
}

/// Width and height in pixels, written `WxH`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Size {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Size, String> {
        let side = |s: &str| s.parse().ok().filter(|n| (1..=16_384).contains(n));
        text.split_once('x')
            .and_then(|(w, h)| Some(Size { width: side(w)?, height: side(h)? }))
            .ok_or_else(|| format!("{text:?} is not a size; write WxH, each from 1 to 16384, as in 640x480"))
    }
}

impl Size {
    /// As many rays as pixels.
    pub fn rays(self, seed: u64) -> RayOptions {
        RayOptions { size: [self.width, self.height], seed }
    }
}

impl std::fmt::Display for Size {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

/// `-b`: builders, separated by commas.
#[derive(Debug, Clone)]
pub struct Builders(pub Vec<Spec>);

impl FromStr for Builders {
    type Err = crate::Error;

    fn from_str(text: &str) -> crate::Result<Builders> {
        builders::parse_list(text).map(Builders)
    }
}

/// `--rays`: kinds of rays, separated by commas, or `all`.
#[derive(Debug, Clone)]
pub struct Kinds(pub Vec<RayKind>);

impl FromStr for Kinds {
    type Err = crate::Error;

    fn from_str(text: &str) -> crate::Result<Kinds> {
        if text == "all" {
            return Ok(Kinds(RayKind::ALL.to_vec()));
        }
        let kinds: crate::Result<Vec<RayKind>> = text.split(',').map(|name| name.trim().parse()).collect();
        Ok(Kinds(distinct(kinds?)))
    }
}

/// `--costs`: what a traversal step and a triangle test cost in the SAH.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Costs {
    /// c_T.
    pub step: f64,
    /// c_I.
    pub test: f64,
}

impl FromStr for Costs {
    type Err = String;

    fn from_str(text: &str) -> Result<Costs, String> {
        let cost = |s: &str| s.trim().parse().ok().filter(|c: &f64| *c > 0.0 && c.is_finite());
        text.split_once(',')
            .and_then(|(step, test)| Some(Costs { step: cost(step)?, test: cost(test)? }))
            .ok_or_else(|| format!("{text:?} are not two positive costs; write C_T,C_I, as in 3,2"))
    }
}

/// `--steps`: the exponents e at which something is measured, ascending; 0 is always among them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Steps(pub Vec<u32>);

impl FromStr for Steps {
    type Err = String;

    fn from_str(text: &str) -> Result<Steps, String> {
        /// Beyond it lie the floats' ends, wherever one begins.
        const MOST: u32 = 254;
        let number = |s: &str| s.trim().parse().ok().filter(|e: &u32| *e <= MOST);
        let steps: Option<Vec<u32>> = match text.split_once('/') {
            Some((last, step)) => number(last)
                .zip(number(step).filter(|step| *step > 0))
                .map(|(last, step)| (0..=last).step_by(step as usize).collect()),
            None => text.split(',').map(number).collect(),
        };
        let steps = steps.ok_or_else(|| {
            format!("{text:?} are no steps; write numbers from 0 to {MOST}, as in 14,42, or LAST/STEP, as in 60/2")
        })?;
        let all: std::collections::BTreeSet<u32> = steps.into_iter().chain([0]).collect();
        Ok(Steps(all.into_iter().collect()))
    }
}

/// `--frames`: which frames of a scene or path.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Frames {
    /// So many, with the first, evenly over all.
    Spread(NonZeroU32),
    /// From one to before another.
    Range(u32, u32),
}

impl FromStr for Frames {
    type Err = String;

    fn from_str(text: &str) -> Result<Frames, String> {
        let wrong = || format!("{text:?} are no frames; write a number of them, or A..B for those from A to before B");
        match text.split_once("..") {
            None => text.parse().map(Frames::Spread).map_err(|_| wrong()),
            Some((from, to)) => match (from.parse(), to.parse()) {
                (Ok(from), Ok(to)) if from < to => Ok(Frames::Range(from, to)),
                _ => Err(wrong()),
            },
        }
    }
}

impl Frames {
    /// Those of a scene or path of this name that has `count`.
    ///
    /// # Errors
    /// It has fewer.
    pub fn of(self, name: &str, count: u32) -> crate::Result<Vec<u32>> {
        match self {
            Frames::Spread(some) => {
                let some = some.get().min(count);
                Ok((0..some).map(|i| (u64::from(i) * u64::from(count) / u64::from(some)) as u32).collect())
            }
            Frames::Range(from, to) if to <= count => Ok((from..to).collect()),
            Frames::Range(from, to) => {
                let what = format!("{name} has {count}, counted from 0; end at {count} or before");
                Err(crate::Error::Argument(format!("--frames {from}..{to}: {what}")))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_a_number_or_a_range() {
        assert_eq!("7".parse(), Ok(Frames::Spread(NonZeroU32::new(7).expect("not 0"))));
        assert_eq!("3..9".parse(), Ok(Frames::Range(3, 9)));
        for wrong in ["", "0", "9..3", "4..4", "1..", "a..b", "-1"] {
            assert!(wrong.parse::<Frames>().is_err(), "{wrong}");
        }
        assert_eq!(Frames::Range(3, 5).of("hop", 6).expect("there are"), [3, 4]);
        assert_eq!("3".parse::<Frames>().expect("three").of("hop", 6).expect("there are"), [0, 2, 4]);
    }

    #[test]
    fn a_point_is_three_finite_numbers() {
        assert_eq!("1,-2.5, 3e2".parse(), Ok(Point([1.0, -2.5, 300.0])));
        for wrong in ["", "1,2", "1,2,3,4", "1,2,x", "1,2,nan", "1,2,inf"] {
            assert!(wrong.parse::<Point>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_size_is_two_positive_numbers() {
        assert_eq!("640x480".parse(), Ok(Size { width: 640, height: 480 }));
        for wrong in ["", "640", "640x", "0x480", "640x480x3", "-1x5", "99999x2"] {
            assert!(wrong.parse::<Size>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn kinds_are_listed_once_each_and_costs_are_positive() {
        assert_eq!("all".parse::<Kinds>().expect("all").0, RayKind::ALL);
        assert_eq!("ao, primary,ao".parse::<Kinds>().expect("two").0, [RayKind::Ao, RayKind::Primary]);
        assert!("ao,light".parse::<Kinds>().is_err() && "".parse::<Kinds>().is_err());
        assert_eq!("3,2".parse(), Ok(Costs { step: 3.0, test: 2.0 }));
        for wrong in ["3", "3,0", "-1,2", "3,nan", "3,2,1"] {
            assert!(wrong.parse::<Costs>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn steps_ascend_from_zero() {
        assert_eq!("42, 14,42".parse(), Ok(Steps(vec![0, 14, 42])));
        assert_eq!("9/4".parse(), Ok(Steps(vec![0, 4, 8])));
        for wrong in ["", "x", "1,", "-1", "300", "60/0", "60/x", "/2"] {
            assert!(wrong.parse::<Steps>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn rays_per_build_are_counted_from_zero() {
        assert_eq!("1e6".parse(), Ok(RaysPerBuild(1e6)));
        for wrong in ["", "-1", "inf", "x"] {
            assert!(wrong.parse::<RaysPerBuild>().is_err(), "{wrong}");
        }
    }
}
