//! Dynamic scenes: triangles that stay, and objects that move and change their shape. What building and updating structures
//! frame by frame is measured with.
//!
//! After Papay 2025, sections 8.1 to 8.4, as far as measuring needs it: a scene is static triangles and objects, each of one
//! topology. An object is moved by a transform that is animated (its own and, in glTF, that of the nodes above it), and may
//! morph: its mesh goes straight from one key frame to the next. Both begin again when they are through. A structure in two
//! levels needs the two apart, the mesh ([`DynamicObject::mesh_at`]) and where it stands ([`DynamicObject::transform`]);
//! others need the vertices in the world ([`DynamicObject::placed`]).
//!
//! Primitive indices count the static triangles first, then those of each object in turn.

mod camera;
mod content;
mod motion;
mod rotation;
mod shape;
mod smooth;
mod text;
mod track;

use super::animation::{self, load_moving};
use super::{Animation, Camera, Instances, Light, LoadOptions, Mesh, Scene, SceneInstance, check, gltf, lookup};
use crate::{Error, Result};
use hedgerow::geometry::Aabb;
use std::borrow::Cow;
use std::ops::Range;

pub(super) use camera::{CameraPath, carried, eye_and_backwards};
pub(super) use content::{DynamicContent, looks_somewhere};
pub(super) use motion::{Motion, Pose, Step, rows};
pub(super) use rotation::Rotation;
pub(super) use shape::{Shape, morphed};
pub(super) use text::{Flown, read, read_path};
pub(super) use track::{Keys, Track, Value};

/// A scene of which parts move, over and over.
#[derive(Debug, Clone)]
pub struct DynamicScene {
    /// The name, as of a [`Scene`].
    pub name: String,
    /// The triangles that never move; may be empty.
    pub static_mesh: Mesh,
    /// What moves.
    pub objects: Vec<DynamicObject>,
    /// Lights, which stand still; may be empty.
    pub lights: Vec<Light>,
    /// How many frames show it once, evenly spaced; at least one.
    pub frames: u32,
    /// How long it is until it begins again.
    pub seconds: f32,
    pub(super) camera: CameraPath,
}

/// Something that moves, in one piece.
#[derive(Debug, Clone)]
pub struct DynamicObject {
    /// What the scene calls it.
    pub name: String,
    /// Three vertex indices a triangle, the same at any time.
    pub triangles: Vec<[u32; 3]>,
    pub(super) shape: Shape,
    pub(super) motion: Motion,
}

impl DynamicScene {
    /// The most frames of a scene: each is looked at when the scene is loaded.
    pub const MOST_FRAMES: u32 = 10_000;

    /// The time of a frame in seconds; the first is 0, and behind the last comes the first again.
    pub fn time_of(&self, frame: u32) -> f32 {
        time_of(frame, self.frames, self.seconds)
    }

    /// Where to look from at a time.
    pub fn camera(&self, time: f32) -> Camera {
        self.camera.at(time)
    }

    /// How many triangles there are at any time.
    pub fn triangle_count(&self) -> u64 {
        self.static_mesh.triangles.len() as u64 + self.objects.iter().map(|o| o.triangles.len() as u64).sum::<u64>()
    }

    /// The primitive indices of each object, in the order of the objects; what is before the first is static.
    pub fn primitives(&self) -> impl Iterator<Item = Range<usize>> {
        self.objects.iter().scan(self.static_mesh.triangles.len(), |next, object| {
            let first = *next;
            *next += object.triangles.len();
            Some(first..*next)
        })
    }

    /// The box around all triangles in all frames.
    pub fn bounds(&self) -> Aabb {
        let times = (0..self.frames).map(|frame| self.time_of(frame));
        self.static_mesh.bounds().union(&bounds(&self.objects, times))
    }

    /// The scene at a time in two levels: the static triangles, where there are any, and each object are a part that is placed
    /// once, in this order.
    pub fn instances(&self, time: f32) -> Instances {
        let static_part = (!self.static_mesh.triangles.is_empty())
            .then(|| (self.static_mesh.clone(), SceneInstance::IDENTITY))
            .into_iter();
        let objects = self.objects.iter().map(|object| {
            let positions = object.mesh_at(time).into_owned();
            (Mesh { positions, triangles: object.triangles.clone() }, object.transform(time))
        });
        let (parts, transforms): (Vec<Mesh>, Vec<_>) = static_part.chain(objects).unzip();
        let instances = (0..).zip(transforms).map(|(part, transform)| SceneInstance { part, transform }).collect();
        Instances { name: self.name.clone(), parts, instances, camera: self.camera(time), lights: self.lights.clone() }
    }

    /// The scene at a time as one mesh.
    ///
    /// # Errors
    /// As [`Instances::flatten`], and [`Error::Malformed`] if a vertex is not finite where it is placed.
    pub fn at(&self, time: f32) -> Result<Scene> {
        let instances = self.instances(time);
        let mesh = instances.flatten()?;
        check::vertices_are_finite(format_args!("{} at {time} s", self.name), &mesh.positions)?;
        Ok(Scene { name: instances.name, mesh, camera: instances.camera, lights: instances.lights })
    }

    /// An animation as a scene of one object. Its cycle takes a second: the files do not say how long it does.
    fn of_animation(animation: Animation) -> DynamicScene {
        let Animation { name, triangles, frames, camera } = animation;
        let count = frames.len() as u32;
        let shape = Shape::KeyFrames { frames, seconds: 1.0 };
        DynamicScene {
            static_mesh: Mesh::default(),
            objects: vec![DynamicObject { name: name.clone(), triangles, shape, motion: Motion::STILL }],
            lights: Vec::new(),
            frames: count,
            seconds: 1.0,
            camera: CameraPath::Still(camera),
            name,
        }
    }
}

impl DynamicObject {
    /// Whether its mesh changes; one that does not needs no new structure of its own when it moves.
    pub fn morphs(&self) -> bool {
        self.shape.morphs()
    }

    /// The vertices at a time in the object's own space, for its triangles; always the same unless it morphs.
    pub fn mesh_at(&self, time: f32) -> Cow<'_, [[f32; 3]]> {
        self.shape.at(time)
    }

    /// Object to world at a time, row by row, as of a [`SceneInstance`].
    pub fn transform(&self, time: f32) -> [[f32; 4]; 3] {
        self.motion.at(time)
    }

    /// The vertices at a time in the world: those of [`DynamicObject::mesh_at`] by [`DynamicObject::transform`].
    pub fn placed(&self, time: f32) -> Vec<[f32; 3]> {
        let instance = SceneInstance { part: 0, transform: self.transform(time) };
        self.mesh_at(time).iter().map(|&point| instance.place(point)).collect()
    }
}

/// A time from 0 on and before `seconds`, as often as these went by.
fn looped(time: f32, seconds: f32) -> f32 {
    let time = time.rem_euclid(seconds);
    // A little before 0 is rounded to all of the seconds.
    if time < seconds { time } else { 0.0 }
}

/// The time of a frame, from the number of frames and the seconds that they cover.
pub(super) fn time_of(frame: u32, frames: u32, seconds: f32) -> f32 {
    seconds * frame as f32 / frames as f32
}

/// The box around the triangles of all objects at all times.
pub(super) fn bounds(objects: &[DynamicObject], times: impl IntoIterator<Item = f32>) -> Aabb {
    times.into_iter().fold(Aabb::EMPTY, |bounds, time| {
        let boxes = objects.iter().map(|o| animation::bounds(&o.triangles, &[o.placed(time)]));
        boxes.fold(bounds, |bounds, object| bounds.union(&object))
    })
}

/// Loads the dynamic scene that `spec` names: a `.dyn` file, a glTF file in which nodes or weights are animated, or as a scene
/// of one object an animation (an `.anim` file or `gen:twist:N:FRAMES`).
///
/// # Errors
/// As [`load`](super::load), and [`Error::Scene`] if nothing in the scene moves.
pub fn load_dynamic(spec: &str, options: &LoadOptions<'_>) -> Result<DynamicScene> {
    if let Some(animation) = load_moving(spec, options)? {
        return Ok(DynamicScene::of_animation(animation));
    }
    let nothing_moves = || {
        Error::Scene(format!(
            "{spec}: nothing in it moves; take a .dyn or .anim file, a .gltf or .glb with animations, or gen:twist:N:FRAMES"
        ))
    };
    if spec.starts_with("gen:") {
        return Err(nothing_moves());
    }
    let path = lookup::find(spec, &options.folders)?;
    match lookup::format_of(&path).as_deref() {
        Some("dyn") => read(&path, options),
        Some("gltf" | "glb") => {
            let content = gltf::read(&path, options)?;
            if let Some(node) = content.skinned {
                return Err(Error::Scene(format!(
                    "{spec}: node {node} has a skin, which stands still here; bake it to morph targets, or to an .anim file"
                )));
            }
            if !content.moves() { Err(nothing_moves()) } else { content.into_scene(&path) }
        }
        _ => Err(nothing_moves()),
    }
}
