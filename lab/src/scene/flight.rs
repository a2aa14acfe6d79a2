//! A camera that flies through a scene that stands: where the scene has no such way of its own, a path that is known by its name, or a
//! turn about it.

use super::dynamic::{CameraPath, Flown, looks_somewhere, read, read_path, time_of};
use super::{Camera, LoadOptions, Scene, check, gltf, load, load_moving, lookup};
use crate::{Error, Result};
use glam::{Quat, Vec3};
use std::path::Path;

/// Paths of scenes that many use, by their names: `scenes/paths/NAME.path`.
const KNOWN: [(&str, &str); 12] = [
    ("sponza", include_str!("../../../scenes/paths/sponza.path")),
    ("classroom", include_str!("../../../scenes/paths/classroom.path")),
    ("country_kitchen", include_str!("../../../scenes/paths/country_kitchen.path")),
    ("salle_de_bain", include_str!("../../../scenes/paths/salle_de_bain.path")),
    ("san_francisco", include_str!("../../../scenes/paths/san_francisco.path")),
    ("samurai_monastery", include_str!("../../../scenes/paths/samurai_monastery.path")),
    ("minecraft_region", include_str!("../../../scenes/paths/minecraft_region.path")),
    ("dragon", include_str!("../../../scenes/paths/dragon.path")),
    ("bunny", include_str!("../../../scenes/paths/bunny.path")),
    ("hall", include_str!("../../../scenes/paths/hall.path")),
    ("pine_hill", include_str!("../../../scenes/paths/pine_hill.path")),
    ("gen:clutter:", include_str!("../../../scenes/paths/clutter.path")),
];

/// A scene and the way of a camera.
#[derive(Debug, Clone)]
pub struct Flight {
    /// The scene; its camera is that of the first frame.
    pub scene: Scene,
    /// Where the way is from, for people.
    pub source: FlightSource,
    flown: Flown,
}

/// Where the way of a camera is from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum FlightSource {
    /// The file of the scene, or one that was named.
    File(String),
    /// The paths that come with the program.
    Known,
    /// None was there: the camera goes once round the scene.
    Around,
    /// None was there, and the camera stands inside: it turns once where it stands.
    Turn,
}

impl std::fmt::Display for FlightSource {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            FlightSource::File(file) => write!(f, "of {file}"),
            FlightSource::Known => f.write_str("known by the scene's name"),
            FlightSource::Around => f.write_str("none is known; once round the scene"),
            FlightSource::Turn => f.write_str("none is known; once round where the camera stands"),
        }
    }
}

impl Flight {
    /// How many frames the way has, evenly spaced.
    pub fn frames(&self) -> u32 {
        self.flown.frames
    }

    /// How long it takes.
    pub fn seconds(&self) -> f32 {
        self.flown.seconds
    }

    /// The camera in a frame, from 0.
    pub fn camera(&self, frame: u32) -> Camera {
        self.flown.at(frame)
    }
}

impl Flown {
    fn at(&self, frame: u32) -> Camera {
        self.camera.at(time_of(frame, self.frames, self.seconds))
    }

    /// The same, if it looks somewhere in every frame.
    fn checked(self, of: &str) -> Result<Flown> {
        match (0..self.frames).find(|&frame| !looks_somewhere(&self.at(frame))) {
            None => Ok(self),
            Some(frame) => Err(check::malformed(
                of,
                format_args!("in frame {frame} (from 0) of its path the camera looks nowhere; correct the keys"),
            )),
        }
    }
}

/// Loads the scene that `spec` names with the way of a camera through it: that of the file `path` if one is given, that of the scene's
/// own file, one that is known by the scene's name, or a turn. What moves besides stands as at time 0.
///
/// # Errors
/// As [`load`], and [`Error::Argument`] if the scene is an animation of its triangles; those of the file of the path.
pub fn load_flight(spec: &str, path: Option<&Path>, options: &LoadOptions<'_>) -> Result<Flight> {
    if load_moving(spec, options)?.is_some() {
        let what = "its triangles move and no camera does; take hedgerow animate, or a scene that stands still";
        return Err(Error::Argument(format!("{spec}: {what}")));
    }
    let (mut scene, of_the_file) = with_own_camera(spec, options)?;
    let (flown, source) = match path {
        Some(path) => {
            let text = std::fs::read_to_string(path).map_err(Error::file(path))?;
            (read_path(path, &text)?, FlightSource::File(path.display().to_string()))
        }
        None => match (of_the_file, known(&scene.name)) {
            (Some(flown), _) => (flown, FlightSource::File(spec.to_owned())),
            (None, Some((name, text))) => (read_path(Path::new(name), text)?, FlightSource::Known),
            (None, None) => round(&scene),
        },
    };
    let flown = flown.checked(spec)?;
    scene.camera = flown.at(0);
    Ok(Flight { scene, source, flown })
}

/// The scene, and its camera's way if its file has one that moves.
fn with_own_camera(spec: &str, options: &LoadOptions<'_>) -> Result<(Scene, Option<Flown>)> {
    if !spec.starts_with("gen:") {
        let path = lookup::find(spec, &options.folders)?;
        let dynamic = match lookup::format_of(&path).as_deref() {
            Some("dyn") => Some(read(&path, options)?),
            Some("gltf" | "glb") => {
                let content = gltf::read(&path, options)?;
                let flies = content.camera.as_ref().is_some_and(CameraPath::moves);
                flies.then(|| content.into_scene(&path)).transpose()?
            }
            _ => None,
        };
        if let Some(dynamic) = dynamic.filter(|dynamic| dynamic.camera.moves()) {
            let flown = Flown { camera: dynamic.camera.clone(), frames: dynamic.frames, seconds: dynamic.seconds };
            return Ok((dynamic.at(0.0)?, Some(flown)));
        }
    }
    Ok((load(spec, options)?, None))
}

/// The path that is known by a scene's name, or by what the name begins with.
fn known(scene: &str) -> Option<(&'static str, &'static str)> {
    KNOWN.into_iter().find(|(name, _)| *name == scene || name.ends_with(':') && scene.starts_with(name))
}

/// Once round a scene that no path is known of: about its middle where the camera stands outside of its box, otherwise about the camera.
fn round(scene: &Scene) -> (Flown, FlightSource) {
    const KEYS: u16 = 12;
    const FRAMES: u32 = 48;
    /// Ten frames a second, as in the thesis.
    const SECONDS: f32 = 4.8;
    let Camera { eye, look, up, fov } = scene.camera;
    let (bounds, axis) = (scene.mesh.bounds(), Vec3::from(up).normalize_or(Vec3::Y));
    let is_inside = (0..3).all(|i| bounds.lo[i] < eye[i] && eye[i] < bounds.hi[i]);
    let about = |centre: Vec3, point: [f32; 3], turn: Quat| (centre + turn * (Vec3::from(point) - centre)).to_array();
    let (mut eyes, mut looks, mut times) = (Vec::new(), Vec::new(), Vec::new());
    for key in 0..=KEYS {
        let fraction = f32::from(key) / f32::from(KEYS);
        // The last key is the first to the bit, so that the way is closed.
        let turn = Quat::from_axis_angle(axis, std::f32::consts::TAU * if key == KEYS { 0.0 } else { fraction });
        let [from, to] = match is_inside {
            true => [eye, about(eye.into(), look, turn)],
            false => [eye, look].map(|point| about(bounds.centroid().into(), point, turn)),
        };
        eyes.push(from);
        looks.push(to);
        times.push(SECONDS * fraction);
    }
    let camera = CameraPath::smooth(&times, (eyes, looks), Camera { eye, look, up, fov });
    let source = if is_inside { FlightSource::Turn } else { FlightSource::Around };
    (Flown { camera, frames: FRAMES, seconds: SECONDS }, source)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_path_that_comes_with_the_program_can_be_read_and_looks_somewhere() {
        for (name, text) in KNOWN {
            let flown = read_path(Path::new(name), text).and_then(|flown| flown.checked(name)).expect(name);
            assert!(flown.camera.moves() && flown.frames >= 24, "{name}");
        }
        assert_eq!(known("gen:clutter:9:1").map(|(name, _)| name), Some("gen:clutter:"));
        assert_eq!(known("gen:clutter").or(known("sponza2")), None);
    }

    #[test]
    fn a_scene_without_a_path_is_flown_round_from_outside_and_looked_round_in_from_inside() {
        let flight = |spec: &str| load_flight(spec, None, &LoadOptions::default()).expect(spec);
        let outside = flight("gen:icosphere:2");
        assert_eq!(outside.source, FlightSource::Around);
        let first = outside.camera(0);
        assert_eq!(first, outside.scene.camera);
        let distance = |camera: &Camera| Vec3::from(camera.eye).length();
        for frame in 0..outside.frames() {
            let camera = outside.camera(frame);
            assert!((distance(&camera) / distance(&first) - 1.0).abs() < 0.01, "{frame}: {camera:?}");
            assert!((camera.eye[1] - first.eye[1]).abs() < 1e-4, "{frame}: level");
        }
        let across = outside.camera(outside.frames() / 2);
        assert!((across.eye[0] + first.eye[0]).abs() < 1e-3, "half a turn: {across:?}");
        let inside = flight("gen:city:20");
        assert_eq!(inside.source, FlightSource::Turn);
        // The weights of a curve add up to 1 but for rounding.
        let away = |frame| Vec3::from(inside.camera(frame).eye).distance(inside.camera(0).eye.into());
        assert!((0..48).all(|frame| away(frame) < 1e-6));
        assert_ne!(inside.camera(12).look, inside.camera(0).look);
    }
}
