//! What a file of a dynamic scene holds, and what makes a scene of it: a camera where it has none, and what is checked of every
//! frame.

use super::{CameraPath, DynamicObject, DynamicScene, bounds, time_of};
use crate::Result;
use crate::scene::check::malformed;
use crate::scene::{Camera, Light, Mesh, SceneInstance, cameras, lookup, no_triangles};
use hedgerow::geometry::Aabb;
use std::path::Path;

/// As [`Content`](crate::scene::Content), of what moves.
#[derive(Debug, Default)]
pub(in crate::scene) struct DynamicContent {
    pub static_mesh: Mesh,
    pub objects: Vec<DynamicObject>,
    /// The camera of the file, if it has one.
    pub camera: Option<CameraPath>,
    pub lights: Vec<Light>,
    pub frames: u32,
    pub seconds: f32,
    /// A node whose skin is left alone, if there is one.
    pub skinned: Option<usize>,
}

impl DynamicContent {
    /// Whether anything does.
    pub fn moves(&self) -> bool {
        !self.objects.is_empty() || self.camera.as_ref().is_some_and(CameraPath::moves)
    }

    /// The scene, if it has triangles, and in every frame its objects are somewhere and its camera looks somewhere.
    pub fn into_scene(self, path: &Path) -> Result<DynamicScene> {
        let name = lookup::name_of(path);
        if self.static_mesh.triangles.is_empty() && self.objects.iter().all(|o| o.triangles.is_empty()) {
            return Err(no_triangles(&path.display().to_string()));
        }
        let wrong = |(frame, time): (u32, f32), what: &str| {
            let at = format_args!("in frame {frame} (from 0), at {time} s");
            malformed(path.display(), format_args!("{at}, {what}; correct its keys"))
        };
        let times = || (0..self.frames).map(|frame| (frame, time_of(frame, self.frames, self.seconds)));
        for object in &self.objects {
            if let Some(at) = times().find(|&(_, time)| !is_somewhere(object, time)) {
                return Err(wrong(at, &format!("{} is not at a finite place", object.name)));
            }
        }
        let all = || self.static_mesh.bounds().union(&bounds(&self.objects, times().map(|(_, time)| time)));
        let camera = match self.camera {
            Some(path) => path,
            None => CameraPath::Still(cameras::known(&name).unwrap_or_else(|| cameras::around(&all()))),
        };
        if let Some(at) = times().find(|&(_, time)| !looks_somewhere(&camera.at(time))) {
            return Err(wrong(at, "the camera looks nowhere"));
        }
        let DynamicContent { static_mesh, objects, lights, frames, seconds, .. } = self;
        Ok(DynamicScene { name, static_mesh, objects, lights, frames, seconds, camera })
    }
}

/// All vertices are finite where they are placed.
fn is_somewhere(object: &DynamicObject, time: f32) -> bool {
    let mesh = object.mesh_at(time);
    // The corners of the box go as far as any vertex.
    let Aabb { lo, hi } = SceneInstance { part: 0, transform: object.transform(time) }.place_box(&Aabb::around(&mesh));
    mesh.is_empty() || lo.into_iter().chain(hi).all(f32::is_finite)
}

/// It has a place, a direction, and an angle that a picture can have.
pub(in crate::scene) fn looks_somewhere(camera: &Camera) -> bool {
    let Camera { eye, look, fov, .. } = camera;
    eye.iter().chain(look).all(|c| c.is_finite()) && eye != look && *fov > 0.0 && *fov < 180.0
}
