//! Scenes that need no file: `gen:NAME:ARGUMENTS`. The same name gives the same scene every time.

mod cables;
mod cells;
mod city;
mod clutter;
mod forest;
mod meshes;
mod prism;
mod series;
mod tube;
mod turns;
mod twist;

use super::{Animation, Instances, Mesh, SceneInstance, cameras};
use crate::{Error, Result};
use glam::Vec3;
pub(super) use meshes::needles;
pub(super) use series::turn;

/// The most triangles that the engine's primitives are made for.
pub(super) const MOST_TRIANGLES: u64 = 1 << 27;
/// The most instances: what every Vulkan driver with acceleration structures takes.
const MOST_INSTANCES: u64 = (1 << 24) - 1;

/// One generator: its name with its arguments (N, and perhaps a second one), what N means, and how the scene is made.
type Generator = (&'static str, &'static str, Recipe);

/// How a scene is made of N and of the second argument (0 where there is none).
#[derive(Clone, Copy)]
enum Recipe {
    /// Triangles for an N (none: too many to be counted), and the mesh.
    Mesh(fn(u64) -> Option<u64>, fn(u32, u64) -> Mesh),
    /// Parts and where they stand, N of them.
    Instances(fn(u32) -> Assembly),
    /// The mesh of about N triangles in its first frame, and where its vertices are in each of this many frames.
    Animation(fn(u32) -> Mesh, fn(&Mesh, u32) -> Vec<Vec<[f32; 3]>>),
}

/// Parts and their instances.
type Assembly = (Vec<Mesh>, Vec<SceneInstance>);

const GENERATORS: [Generator; 11] = [
    (
        "gen:icosphere:N",
        "a sphere of 20*4^N triangles",
        Recipe::Mesh(meshes::icosphere_triangles, |n, _| meshes::icosphere(n)),
    ),
    ("gen:soup:N:SEED", "N small triangles anywhere", Recipe::Mesh(Some, meshes::soup)),
    ("gen:grid:N", "a flat square of 2*N*N triangles", Recipe::Mesh(meshes::grid_triangles, |n, _| meshes::grid(n))),
    (
        "gen:stadium:N",
        "a sphere of 20*4^N triangles in a huge coarse arena",
        Recipe::Mesh(meshes::icosphere_triangles, |n, _| meshes::stadium(n)),
    ),
    ("gen:needles:N:SEED", "N long thin triangles anywhere", Recipe::Mesh(Some, meshes::needles)),
    ("gen:clutter:N:SEED", "N things of all sizes in a room", Recipe::Mesh(clutter::triangles, clutter::clutter)),
    ("gen:forest:N", "N instances of 3 thin trees that lean over each other", Recipe::Instances(forest::place)),
    (
        "gen:city:N",
        "N instances of 2 L-shaped blocks, each in the notch of the one before, none touching",
        Recipe::Instances(city::place),
    ),
    ("gen:cables:N", "N instances of 4 long thin cables that hang across the scene", Recipe::Instances(cables::place)),
    ("gen:cells:N", "N instances of 3 spheres in a grid, each in a cell of its own", Recipe::Instances(cells::place)),
    (
        "gen:twist:N:FRAMES",
        "an animation: a column of about N (12 or more) triangles, twisted once round over the frames",
        Recipe::Animation(twist::column, twist::frames),
    ),
];

/// The least side of a square (2 dimensions) or cube (3) of at least `count` cells.
fn side_of(count: u32, dimensions: u32) -> u32 {
    (0..).find(|side: &u32| side.pow(dimensions) >= count).unwrap_or_default()
}

/// The same direction, of length 1. By a division, unlike glam's: the bytes of scenes depend on it.
fn unit(v: Vec3) -> Vec3 {
    v / v.length()
}

/// The generators that [`load`](super::load) knows: the name with its arguments, and what it makes.
pub fn generators() -> impl Iterator<Item = (&'static str, &'static str)> {
    GENERATORS.iter().map(|&(pattern, what, _)| (pattern, what))
}

/// A generator with its arguments, of a size that can be made.
pub(super) struct Generated {
    name: String,
    recipe: Recipe,
    n: u32,
    second: u64,
}

impl Generated {
    /// What `spec` names; `None` if it does not name a generator (without `gen:`).
    ///
    /// # Errors
    /// [`Error::Argument`] with the usage.
    pub fn find(spec: &str) -> Result<Option<Generated>> {
        if !spec.starts_with("gen:") {
            return Ok(None);
        }
        let words: Vec<&str> = spec.split(':').collect();
        let is_named = |(pattern, ..): &&Generator| pattern.split(':').nth(1) == Some(words[1]);
        let Some(&(pattern, what, recipe)) = GENERATORS.iter().find(is_named) else {
            let patterns = GENERATORS.map(|(pattern, ..)| pattern).join(", ");
            return Err(Error::Argument(format!("{spec}: unknown generator; use one of {patterns}")));
        };
        let usage = format!("{pattern} ({what})");
        let wrong = || Error::Argument(format!("{spec}: not the arguments of this generator; write {usage}"));
        if words.len() != pattern.split(':').count() {
            return Err(wrong());
        }
        let n: u64 = words[2].parse().map_err(|_| wrong())?;
        let second: u64 = words.get(3).map_or(Ok(0), |word| word.parse()).map_err(|_| wrong())?;
        let (size, most, unit) = match recipe {
            Recipe::Mesh(triangles, _) => (triangles(n), MOST_TRIANGLES, "triangles"),
            Recipe::Instances(_) => (Some(n), MOST_INSTANCES, "instances"),
            Recipe::Animation(..) if n < twist::LEAST_TRIANGLES || second == 0 => return Err(wrong()),
            Recipe::Animation(..) => (n.checked_mul(second), MOST_TRIANGLES, "triangles in all frames together"),
        };
        if size.is_none_or(|size| size > most) {
            return Err(Error::Argument(format!("{spec}: more than {most} {unit}; take a smaller N of {usage}")));
        }
        // What is counted is at least N, except for the exponents, which are smaller still.
        Ok(Some(Generated { name: spec.to_owned(), recipe, n: n as u32, second }))
    }

    /// Its triangles, or its instances; of an animation the triangles of a frame.
    pub fn size(&self) -> u64 {
        let n = u64::from(self.n);
        match self.recipe {
            Recipe::Mesh(triangles, _) => triangles(n).unwrap_or(n),
            _ => n,
        }
    }

    /// The mesh, if it is one; of an animation the first frame.
    pub fn mesh(&self) -> Option<Mesh> {
        match self.recipe {
            Recipe::Mesh(_, make) => Some(make(self.n, self.second)),
            Recipe::Animation(first, _) => Some(first(self.n)),
            Recipe::Instances(_) => None,
        }
    }

    /// The instances, if it is a scene of such.
    pub fn instances(&self) -> Option<Instances> {
        let Recipe::Instances(place) = self.recipe else { return None };
        let (parts, instances) = place(self.n);
        Some(Instances::new(self.name.clone(), parts, instances, cameras::from_corner))
    }

    /// The animation, if it is one.
    pub fn animation(&self) -> Option<Animation> {
        let Recipe::Animation(first, frames) = self.recipe else { return None };
        let mesh = first(self.n);
        let frames = frames(&mesh, self.second as u32);
        Some(Animation::new(self.name.clone(), mesh.triangles, frames))
    }
}
