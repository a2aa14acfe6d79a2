//! Animations: one topology, the vertices of every frame. What updating a structure is measured with.

use super::{Camera, LoadOptions, Mesh, cameras, generators, lookup, no_triangles, tri};
use crate::{Error, Result};
use hedgerow::geometry::Aabb;

/// A mesh whose vertices move.
#[derive(Debug, Clone)]
pub struct Animation {
    /// The name, as of a [`Scene`](super::Scene).
    pub name: String,
    /// Three vertex indices a triangle, the same in every frame.
    pub triangles: Vec<[u32; 3]>,
    /// The vertex positions of each frame: one frame or more, all of equal length, all finite.
    pub frames: Vec<Vec<[f32; 3]>>,
    /// Where to look from, in every frame.
    pub camera: Camera,
}

impl Animation {
    /// An animation with the camera of its name, or one that sees all of every frame.
    pub(super) fn new(name: String, triangles: Vec<[u32; 3]>, frames: Vec<Vec<[f32; 3]>>) -> Animation {
        let camera = cameras::known(&name).unwrap_or_else(|| cameras::around(&bounds(&triangles, &frames)));
        Animation { name, triangles, frames, camera }
    }

    /// The box around all triangles in all frames.
    pub fn bounds(&self) -> Aabb {
        bounds(&self.triangles, &self.frames)
    }

    /// The mesh in a frame; the first is 0.
    ///
    /// # Panics
    /// There is no frame of this number.
    pub fn mesh(&self, frame: usize) -> Mesh {
        Mesh { positions: self.frames[frame].clone(), triangles: self.triangles.clone() }
    }
}

/// The box around all triangles in all frames.
pub(super) fn bounds(triangles: &[[u32; 3]], frames: &[Vec<[f32; 3]>]) -> Aabb {
    let corners = frames.iter().flat_map(|frame| triangles.iter().flatten().map(|&v| frame[v as usize]));
    corners.fold(Aabb::EMPTY, |bounds, corner| bounds.union(&Aabb::around(&[corner])))
}

/// Loads all frames of the animation that `spec` names: an `.anim` file or a generator of one (`gen:twist:20000:24`).
///
/// # Errors
/// As [`load`](super::load), and [`Error::Scene`] if the scene is not an animation.
pub fn load_animation(spec: &str, options: &LoadOptions<'_>) -> Result<Animation> {
    load_moving(spec, options)?
        .ok_or_else(|| Error::Scene(format!("{spec}: not an animation; take an .anim file or gen:twist:N:FRAMES")))
}

/// [`load_animation`] of a scene that is one; `None` if it is of another kind.
///
/// # Errors
/// As [`load`](super::load).
pub fn load_moving(spec: &str, options: &LoadOptions<'_>) -> Result<Option<Animation>> {
    if let Some(generated) = generators::Generated::find(spec)? {
        return Ok(generated.animation());
    }
    let path = lookup::find(spec, &options.folders)?;
    if lookup::format_of(&path).as_deref() != Some("anim") {
        return Ok(None);
    }
    let (triangles, frames) = tri::read_frames(&path, options)?;
    if triangles.is_empty() {
        return Err(no_triangles(spec));
    }
    Ok(Some(Animation::new(lookup::name_of(&path), triangles, frames)))
}
