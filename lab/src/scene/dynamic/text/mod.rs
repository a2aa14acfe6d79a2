//! `.dyn`: a dynamic scene as text that a reader understands, one thing a line; `scenes/README.md` describes it.
//!
//! First the lines are read ([`lines`]), then the scenes that they name are loaded and the keys become tracks, here.

mod lines;

use super::{
    CameraPath, DynamicContent, DynamicObject, DynamicScene, Keys, Motion, Pose, Rotation, Shape, Step, Track, Value,
    smooth,
};
use crate::scene::check::malformed;
use crate::scene::{self, Animation, LoadOptions, Mesh, Scene, lookup, source};
use crate::{Error, Result};
use lines::{CameraKeys, Key, Lines, OfLine, Way};
use std::path::Path;

/// Reads a `.dyn` file and the scenes that it names.
pub(in crate::scene) fn read(path: &Path, options: &LoadOptions<'_>) -> Result<DynamicScene> {
    let text = source::bytes(path, options)?;
    let lines = Lines::read(path, &String::from_utf8_lossy(&text))?;
    let Lines { frames, seconds, .. } = lines;
    let mut folders = options.folders.clone();
    if let Some(beside) = path.parent().filter(|beside| !folders.iter().any(|folder| folder == beside)) {
        folders.insert(0, beside.to_owned());
    }
    let file = File { path, seconds, options: LoadOptions { folders, progress: options.progress } };
    let mut content = DynamicContent { frames, seconds, ..DynamicContent::default() };
    if let Some(named) = &lines.static_scene {
        let Scene { mesh, camera, lights, .. } = file.named(named, scene::load)?;
        content = DynamicContent { static_mesh: mesh, camera: Some(CameraPath::Still(camera)), lights, ..content };
    }
    content.objects = lines.objects.iter().map(|object| file.object(object)).collect::<Result<_>>()?;
    if let Some(keys) = lines.camera {
        content.camera = Some(camera(path, seconds, &keys)?);
    }
    content.into_scene(path)
}

/// What a file's lines are turned into a scene with.
struct File<'a> {
    path: &'a Path,
    /// Until it begins again.
    seconds: f32,
    /// The folder of the file first, unless it is one of the others.
    options: LoadOptions<'a>,
}

impl File<'_> {
    fn place(&self, line: usize) -> String {
        format!("{}:{line}", self.path.display())
    }

    /// What `load` makes of the scene that a line names.
    fn named<T>(&self, named: &OfLine<String>, load: impl Fn(&str, &LoadOptions<'_>) -> Result<T>) -> Result<T> {
        let spec = self.spec(named)?;
        let place = self.place(named.0);
        load(&spec, &self.options).map_err(|error| match error {
            Error::Scene(message) => Error::Scene(format!("{place}: {message}")),
            Error::Malformed(message) | Error::Argument(message) => malformed(&place, message),
            other => other,
        })
    }

    /// A path counts from the folder of the file, too.
    fn spec(&self, (line, spec): &OfLine<String>) -> Result<String> {
        if spec.starts_with("gen:") {
            return Ok(spec.clone());
        }
        let beside = self.path.with_file_name(spec);
        let spec = if beside.is_file() { beside.display().to_string() } else { spec.clone() };
        let is_dynamic =
            lookup::find(&spec, &self.options.folders).is_ok_and(|p| lookup::format_of(&p).as_deref() == Some("dyn"));
        if is_dynamic {
            let what = "is a .dyn file itself, these are not nested; name the scenes that it is made of";
            return Err(malformed(self.place(*line), format_args!("{spec} {what}")));
        }
        Ok(spec)
    }

    fn object(&self, object: &lines::Object) -> Result<DynamicObject> {
        let name = object.name.clone();
        let (triangles, shape) = match (self.named(&object.scene, scene::load_moving)?, object.cycle) {
            (Some(Animation { triangles, frames, .. }), cycle) => {
                (triangles, Shape::KeyFrames { frames, seconds: cycle.map_or(self.seconds, |(_, cycle)| cycle) })
            }
            (None, Some((line, _))) => {
                let (_, spec) = &object.scene;
                let what = format_args!("{spec} does not morph, only an animation has a cycle; remove the line");
                return Err(malformed(self.place(line), what));
            }
            (None, None) => {
                let Mesh { positions, triangles } = self.named(&object.scene, scene::load)?.mesh;
                (triangles, Shape::Rigid(positions))
            }
        };
        if object.keys.is_empty() {
            return Ok(DynamicObject { name, triangles, shape, motion: Motion::STILL });
        }
        let keys = &object.keys;
        let pose = Pose {
            translation: track(keys, "move", |n| [n[0], n[1], n[2]]).unwrap_or_else(|| Track::still([0.0; 3])),
            rotation: rotation(keys),
            scale: track(keys, "scale", |n| if let [x, y, z] = *n { [x, y, z] } else { [n[0]; 3] })
                .unwrap_or_else(|| Track::still([1.0; 3])),
        };
        Ok(DynamicObject { name, triangles, shape, motion: Motion::new(vec![Step::Moving(pose)], self.seconds) })
    }
}

/// The camera of a file that begins again after `seconds`.
fn camera(path: &Path, seconds: f32, camera: &CameraKeys) -> Result<CameraPath> {
    let keys = &camera.keys;
    let points = |part: &str| match camera.way {
        Way::Straight => track(keys, part, point),
        Way::Smooth => curve(keys, part),
    };
    let needed = |name: &str| {
        points(name).ok_or_else(|| {
            let what = format_args!("no key of the camera says its {name}; write it as in {name} 0 1 5");
            malformed(format_args!("{}:{}", path.display(), keys[0].line), what)
        })
    };
    Ok(CameraPath::Keys {
        eye: needed("eye")?,
        look: needed("look")?,
        up: points("up").unwrap_or_else(|| Track::still([0.0, 1.0, 0.0])),
        fov: track(keys, "fov", |n| n[0]).unwrap_or_else(|| Track::still(lines::FOV)),
        seconds,
    })
}

fn point(numbers: &[f32]) -> [f32; 3] {
    [numbers[0], numbers[1], numbers[2]]
}

/// A camera's way with the frames that it is shown in, apart from any scene.
#[derive(Debug, Clone)]
pub(in crate::scene) struct Flown {
    pub camera: CameraPath,
    pub frames: u32,
    pub seconds: f32,
}

/// Reads the text of a camera's path: `frames`, `seconds` and `camera` with its keys, as in a `.dyn` file. `path` is where it stands,
/// for messages.
pub(in crate::scene) fn read_path(path: &Path, text: &str) -> Result<Flown> {
    let lines = Lines::read(path, text)?;
    let Lines { frames, seconds, .. } = lines;
    let wrong = |line: usize, what: &str| malformed(format_args!("{}:{line}", path.display()), what);
    let placed = lines.static_scene.iter().map(|(line, _)| *line).chain(lines.objects.iter().map(|o| o.scene.0));
    if let Some(line) = placed.min() {
        return Err(wrong(
            line,
            "a path has a camera and nothing else; remove the line, or name the file as the scene",
        ));
    }
    let Some(keys) = lines.camera else {
        return Err(malformed(path.display(), "no camera; write a line camera smooth with keys below"));
    };
    Ok(Flown { camera: camera(path, seconds, &keys)?, frames, seconds })
}

/// The keys that name a part, straight from each to the next; `None` if none does.
fn track<V: Value>(keys: &[Key], part: &str, value: impl Fn(&[f32]) -> V) -> Option<Track<V>> {
    let keys: Vec<(f32, V)> = keys.iter().filter_map(|key| Some((key.time, value(key.part(part)?)))).collect();
    (!keys.is_empty()).then(|| of(keys))
}

/// The keys that name a part, along a curve; `None` if none does.
fn curve(keys: &[Key], part: &str) -> Option<Track<[f32; 3]>> {
    let (times, points): (Vec<f32>, Vec<[f32; 3]>) =
        keys.iter().filter_map(|key| Some((key.time, point(key.part(part)?)))).unzip();
    (!times.is_empty()).then(|| Track::new(times.clone(), smooth::catmull_rom(&times, &points)))
}

fn of<V: Value>(keys: Vec<(f32, V)>) -> Track<V> {
    let (times, values) = keys.into_iter().unzip();
    Track::new(times, Keys::Linear(values))
}

/// The rotation by `turn` and `quaternion`. Between two turns about one axis all degrees are gone through, in the direction in
/// which they are written: quaternions alone would go the shorter way, and never round.
fn rotation(keys: &[Key]) -> Track<Rotation> {
    // So little that the way is the shorter one beyond doubt.
    const PIECE: f32 = 60.0;
    let about = |axis, degrees| Rotation::about(axis, degrees).unwrap_or_default();
    let mut rotations: Vec<(f32, Rotation)> = Vec::new();
    let mut before: Option<(f32, [f32; 3], f32)> = None;
    for key in keys {
        if let Some(&[x, y, z, degrees]) = key.part("turn") {
            let axis = [x, y, z];
            if let Some((time, _, start)) = before.filter(|&(_, same, _)| same == axis) {
                let pieces = ((degrees - start).abs() / PIECE).ceil() as u32;
                rotations.extend((1..pieces).map(|piece| {
                    let fraction = piece as f32 / pieces as f32;
                    (f32::between(&time, &key.time, fraction), about(axis, f32::between(&start, &degrees, fraction)))
                }));
            }
            rotations.push((key.time, about(axis, degrees)));
            before = Some((key.time, axis, degrees));
        } else if let Some(&[x, y, z, w]) = key.part("quaternion") {
            rotations.push((key.time, Rotation([x, y, z, w].map(f64::from)).unit().unwrap_or_default()));
            before = None;
        }
    }
    // Pieces of a moment are shorter than its time can tell.
    rotations.dedup_by(|behind, before| behind.0 <= before.0);
    if rotations.is_empty() { Track::still(Rotation::default()) } else { of(rotations) }
}
