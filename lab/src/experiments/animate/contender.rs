//! What a way is to whoever measures it, and what it is given a frame.

use crate::Result;
use crate::measure::record::Memory;
use crate::scene::{DynamicScene, Mesh, Scene};
use hedgerow::trace::{Hit, Query, Ray, Work};

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
    pub(super) fn mesh(&self, group: Group) -> Mesh {
        match group {
            Group::Whole => self.scene.mesh.clone(),
            Group::Moving => {
                let objects = 0..self.dynamic.objects.len();
                objects.map(|k| self.mesh(Group::Object(k))).fold(Mesh::default(), |mut all, mesh| {
                    let first = all.positions.len() as u32;
                    all.positions.extend(mesh.positions);
                    all.triangles.extend(mesh.triangles.iter().map(|triangle| triangle.map(|v| v + first)));
                    all
                })
            }
            Group::Object(k) => {
                let object = &self.dynamic.objects[k];
                Mesh { positions: object.placed(self.time), triangles: object.triangles.clone() }
            }
        }
    }

    /// The number of its first primitive.
    pub(super) fn first(&self, group: Group) -> u32 {
        match group {
            Group::Whole => 0,
            Group::Moving => self.dynamic.static_mesh.triangles.len() as u32,
            Group::Object(k) => self.dynamic.primitives().nth(k).map_or(0, |primitives| primitives.start as u32),
        }
    }
}

/// What is built as one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Group {
    /// All triangles.
    Whole,
    /// Those of all objects.
    Moving,
    /// Those of one.
    Object(usize),
}

impl Group {
    /// Each object by itself.
    pub(super) fn objects(frame: &Frame<'_>) -> Vec<Group> {
        (0..frame.dynamic.objects.len()).map(Group::Object).collect()
    }
}

/// One of the ways on a scene.
///
/// Order of calls a frame: `place`, `build`, any number of times; then the others.
pub trait Contender {
    /// Who builds what is built a frame.
    fn builder(&self) -> &str;
    /// `device` where build times are timestamps, otherwise `wall`.
    fn timer(&self) -> &'static str;
    /// Brings a frame's vertices and transforms to where they are built from; not under the clock.
    ///
    /// # Errors
    /// Too little memory.
    fn place(&mut self, frame: &Frame<'_>) -> Result<()>;
    /// Does all that must be done a frame to have something that can be traced: milliseconds.
    ///
    /// # Errors
    /// The device failed, or there is too little room.
    fn build(&mut self) -> Result<f64>;
    /// Bytes of all structures together, and of what their builds need beside.
    ///
    /// # Errors
    /// The device failed.
    fn memory(&mut self) -> Result<Memory>;
    /// The SAH cost, where rays go through one tree, with the costs of a step and of a test.
    ///
    /// # Errors
    /// The device failed.
    fn sah(&mut self, c_t: f64, c_i: f64) -> Result<Option<f64>>;
    /// Brings rays, and trees of the host, to where they are traced; not under the clock.
    ///
    /// # Errors
    /// Too little memory.
    fn set_rays(&mut self, rays: &[Ray]) -> Result<()>;
    /// Traces the rays once: milliseconds by timestamps where that is on the device, otherwise of wall-clock time.
    ///
    /// # Errors
    /// The device failed.
    fn trace(&mut self, query: Query) -> Result<f64>;
    /// The hits of the last `trace`, one a ray, with the scene's primitives.
    ///
    /// # Errors
    /// The device failed.
    fn hits(&mut self) -> Result<Vec<Hit>>;
    /// Steps and tests of every ray, through all trees; not under the clock.
    ///
    /// # Errors
    /// The device failed.
    fn work(&mut self, query: Query) -> Result<Option<Vec<Work>>>;
}
