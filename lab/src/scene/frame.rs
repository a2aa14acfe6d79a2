//! A moment of a dynamic scene, and what of it is built as one.

use super::{DynamicScene, Mesh, Scene};
use crate::Result;

/// A moment of a dynamic scene.
pub struct Frame<'a> {
    /// Which, from 0.
    pub number: u32,
    /// When, in seconds.
    pub time: f32,
    /// What moves, and how.
    pub dynamic: &'a DynamicScene,
    /// All of it as one mesh: the static triangles, then those of each object.
    pub scene: Scene,
}

impl<'a> Frame<'a> {
    /// The frame of this number.
    ///
    /// # Errors
    /// A vertex is not finite where it is placed.
    pub fn new(dynamic: &'a DynamicScene, number: u32) -> Result<Frame<'a>> {
        let time = dynamic.time_of(number);
        Ok(Frame { number, time, dynamic, scene: dynamic.at(time)? })
    }

    /// What is built as one, in the world.
    pub fn mesh(&self, group: Group) -> Mesh {
        match group {
            Group::Whole => self.scene.mesh.clone(),
            Group::Moving => {
                let mut all = Mesh::default();
                for object in &self.dynamic.objects {
                    all.append(object.placed(self.time), &object.triangles);
                }
                all
            }
            Group::Object(k) => {
                let object = &self.dynamic.objects[k];
                Mesh { positions: object.placed(self.time), triangles: object.triangles.clone() }
            }
        }
    }

    /// The number of its first primitive.
    pub fn first(&self, group: Group) -> u32 {
        match group {
            Group::Whole => 0,
            Group::Moving => self.dynamic.static_mesh.triangles.len() as u32,
            Group::Object(k) => self.dynamic.primitives().nth(k).map_or(0, |primitives| primitives.start as u32),
        }
    }
}

/// What is built as one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Group {
    /// All triangles.
    Whole,
    /// Those of all objects.
    Moving,
    /// Those of one.
    Object(usize),
}

impl Group {
    /// Each object by itself.
    pub fn objects(frame: &Frame<'_>) -> Vec<Group> {
        (0..frame.dynamic.objects.len()).map(Group::Object).collect()
    }
}
