//! Scenes: triangles, placed parts or moving ones, a camera and lights, from files or generators. What measuring needs and
//! nothing else.
//!
//! [`load`] takes what a user types: the path of a file, the bare name of one in a folder of scenes, or a generator.
//! Every file may also lie there packed, with `.zst` behind its name. Triangles keep the order of the file, polygons are
//! fan-triangulated from their first vertex; the position of a triangle in that order is its primitive index everywhere.
//! Instances come flattened, and what moves stands still in its first frame, unless [`load_instances`], [`load_animation`] or
//! [`load_dynamic`] ask for all of it.

mod animation;
mod cameras;
mod check;
mod degenerate;
mod dynamic;
mod flight;
mod frame;
mod generators;
mod gltf;
mod inst;
mod instances;
mod lookup;
mod obj;
mod ply;
mod source;
mod tri;

use crate::{Error, Result};
use hedgerow::geometry::Aabb;
use std::path::{Path, PathBuf};

pub use animation::{Animation, load_animation, load_moving};
pub use degenerate::{Degenerate, degenerate};
pub use dynamic::{DynamicObject, DynamicScene, load_dynamic};
pub use flight::{Flight, FlightSource, load_flight};
pub use frame::{Frame, Group};
pub use generators::generators;
pub use instances::{Instances, SceneInstance, load_instances, load_placed};
pub use lookup::{list, own_folders, weight};

/// A scene, ready to build.
#[derive(Debug, Clone)]
pub struct Scene {
    /// The name as records carry it: the file's stem (`sponza`) or the generator with its arguments.
    pub name: String,
    /// The triangles.
    pub mesh: Mesh,
    /// Where to look from.
    pub camera: Camera,
    /// Lights of the file; may be empty.
    pub lights: Vec<Light>,
}

/// An indexed triangle mesh.
#[derive(Debug, Clone, Default)]
pub struct Mesh {
    /// Vertex positions, all finite.
    pub positions: Vec<[f32; 3]>,
    /// Three vertex indices a triangle, all in range, in the order of the file: the primitive index is the position here.
    pub triangles: Vec<[u32; 3]>,
}

/// A pinhole camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Where the camera is.
    pub eye: [f32; 3],
    /// What it looks at.
    pub look: [f32; 3],
    /// Which way is up.
    pub up: [f32; 3],
    /// Vertical field of view in degrees.
    pub fov: f32,
}

/// A parallelogram that sends light: points are `corner + a·edges[0] + b·edges[1]`, a and b in 0..1.
/// A point light has two zero edges.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Light {
    /// One corner.
    pub corner: [f32; 3],
    /// The two edges from it.
    pub edges: [[f32; 3]; 2],
}

impl Mesh {
    /// The box around all triangles (vertices that no triangle uses do not count).
    pub fn bounds(&self) -> Aabb {
        self.triangles.iter().fold(Aabb::EMPTY, |b, t| b.union(&Aabb::around(&t.map(|v| self.positions[v as usize]))))
    }

    /// Triangles that share no vertex.
    fn of_corners(triangles: impl IntoIterator<Item = [[f32; 3]; 3]>) -> Mesh {
        let positions: Vec<[f32; 3]> = triangles.into_iter().flatten().collect();
        let triangles = (0..positions.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        Mesh { positions, triangles }
    }

    /// Adds triangles with vertices of their own.
    fn append(&mut self, positions: impl IntoIterator<Item = [f32; 3]>, triangles: &[[u32; 3]]) {
        let first = self.positions.len() as u32;
        self.positions.extend(positions);
        self.triangles.extend(triangles.iter().map(|triangle| triangle.map(|v| v + first)));
    }

    /// Adds the two triangles of a quad.
    fn add_quad(&mut self, [a, b, c, d]: [u32; 4]) {
        self.triangles.extend([[a, b, c], [a, c, d]]);
    }

    /// The corners of a triangle.
    pub fn corners(&self, triangle: usize) -> [[f32; 3]; 3] {
        self.triangles[triangle].map(|v| self.positions[v as usize])
    }
}

/// The triangles of a polygon, fanned out from its first vertex; `None` if it has fewer than three vertices.
fn fan(polygon: &[u32]) -> Option<impl Iterator<Item = [u32; 3]>> {
    let (first, others) = polygon.split_first()?;
    (others.len() >= 2).then(|| others.windows(2).map(|edge| [*first, edge[0], edge[1]]))
}

/// How [`load`] finds files and tells how far it is.
#[derive(Clone, Default)]
pub struct LoadOptions<'a> {
    /// Folders in which bare names are looked up, in this order; see [`own_folders`].
    pub folders: Vec<PathBuf>,
    /// Called now and then while a file is read.
    pub progress: Option<&'a dyn Fn(Progress)>,
}

/// How far reading a file is, in bytes of the file as it lies on the disk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Bytes read.
    pub done: u64,
    /// Bytes of the file.
    pub total: u64,
}

/// What a file holds before the camera is chosen.
#[derive(Debug, Default)]
struct Content {
    mesh: Mesh,
    /// The camera of the file, if it has one.
    camera: Option<Camera>,
    lights: Vec<Light>,
}

/// Loads the scene that `spec` names: a path, the bare name of a file in one of the folders, or a generator
/// (`gen:icosphere:6`).
///
/// # Errors
/// [`Error::Scene`] if there is no such scene or it has no triangles, [`Error::Malformed`] with file, line or item and the
/// remedy if the file is broken, [`Error::Argument`] if a generator's arguments are wrong.
pub fn load(spec: &str, options: &LoadOptions<'_>) -> Result<Scene> {
    if let Some(scene) = load_placed(spec, options)? {
        let mesh = scene.flatten()?;
        return Ok(Scene { name: scene.name, mesh, camera: scene.camera, lights: scene.lights });
    }
    let (name, content) = if let Some(generated) = generators::Generated::find(spec)? {
        (spec.to_owned(), Content { mesh: generated.mesh().unwrap_or_default(), ..Content::default() })
    } else {
        let path = lookup::find(spec, &options.folders)?;
        (lookup::name_of(&path), read(&path, options)?)
    };
    let Content { mesh, camera, lights } = content;
    if mesh.triangles.is_empty() {
        return Err(no_triangles(spec));
    }
    let camera = camera.or_else(|| cameras::known(&name)).unwrap_or_else(|| cameras::around(&mesh.bounds()));
    Ok(Scene { name, mesh, camera, lights })
}

fn no_triangles(spec: &str) -> Error {
    Error::Scene(format!("{spec}: no triangles; a scene needs at least one"))
}

/// Reads a file of any of the formats that hold a mesh.
fn read(path: &Path, options: &LoadOptions<'_>) -> Result<Content> {
    let mesh = match lookup::format_of(path).as_deref() {
        Some("obj") => obj::read(path, options)?,
        Some("ply") => ply::read(path, options)?,
        Some("gltf" | "glb") => return gltf::read_at_rest(path, options),
        Some("tri") => tri::read_tri(path, options)?,
        Some("anim") => tri::read_anim(path, options)?,
        _ => {
            return Err(Error::Scene(format!(
                "{}: not a format we read; take one of {}, each also with .zst behind",
                path.display(),
                lookup::FORMATS.map(|f| format!(".{f}")).join(", ")
            )));
        }
    };
    Ok(Content { mesh, ..Content::default() })
}
