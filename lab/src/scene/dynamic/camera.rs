//! Where to look from at any time.

use super::motion::Motion;
use super::track::Track;
use super::{looped, smooth};
use crate::scene::Camera;
use glam::Vec3;

/// A camera that may move.
#[derive(Debug, Clone)]
pub(in crate::scene) enum CameraPath {
    /// It stands.
    Still(Camera),
    /// Each part of it by its own keys, again from the beginning after each period in seconds.
    Keys { eye: Track<[f32; 3]>, look: Track<[f32; 3]>, up: Track<[f32; 3]>, fov: Track<f32>, seconds: f32 },
    /// As a node of a scene carries it, which it looks along backwards.
    Carried { motion: Motion, fov: f32 },
}

impl CameraPath {
    /// Along curves through these eyes and looks at these times, the last of which is when it begins again; the rest as `still` has it.
    pub fn smooth(times: &[f32], (eyes, looks): (Vec<[f32; 3]>, Vec<[f32; 3]>), still: Camera) -> CameraPath {
        let curve = |points: &[[f32; 3]]| Track::new(times.to_vec(), smooth::catmull_rom(times, points));
        CameraPath::Keys {
            eye: curve(&eyes),
            look: curve(&looks),
            up: Track::still(still.up),
            fov: Track::still(still.fov),
            seconds: times[times.len() - 1],
        }
    }

    pub fn at(&self, time: f32) -> Camera {
        match self {
            CameraPath::Still(camera) => *camera,
            CameraPath::Keys { eye, look, up, fov, seconds } => {
                let time = looped(time, *seconds);
                let up = Vec3::from(up.at(time)).normalize_or(Vec3::Y).into();
                Camera { eye: eye.at(time), look: look.at(time), up, fov: fov.at(time) }
            }
            CameraPath::Carried { motion, fov } => carried(&motion.at(time), *fov),
        }
    }

    /// Whether it is ever elsewhere.
    pub fn moves(&self) -> bool {
        !matches!(self, CameraPath::Still(_))
    }
}

/// The camera of a node: it looks down the node's −z, and up is its y.
pub(in crate::scene) fn carried(to_world: &[[f32; 4]; 3], fov: f32) -> Camera {
    let (eye, backwards) = eye_and_backwards(to_world);
    let up = column(to_world, 1).normalize_or(Vec3::Y);
    Camera { eye: eye.into(), look: (eye - backwards).into(), up: up.into(), fov }
}

/// Where a node is and the direction of its z, zero where that has no length: what it carries looks and shines the other way.
pub(in crate::scene) fn eye_and_backwards(to_world: &[[f32; 4]; 3]) -> (Vec3, Vec3) {
    (column(to_world, 3), column(to_world, 2).normalize_or_zero())
}

fn column(to_world: &[[f32; 4]; 3], j: usize) -> Vec3 {
    to_world.map(|row| row[j]).into()
}
