//! What `hedgerow accel` measures: acceleration structures as engines use them, through the calls of
//! `VK_KHR_acceleration_structure`, ours and the driver's by the same.
//!
//! [`batch`]: many small structures at once; [`top_level`]: how top levels grow with their instances; [`rebraid`]: rays through
//! top levels that are re-braided or not; [`any_hit`]: rays that end at any hit through children in order or not; [`update`]:
//! refitting against building again over an animation; [`memory`]: bytes a triangle. Each gives [`points`] as it goes.

pub mod any_hit;
pub mod batch;
pub(crate) mod command;
pub mod memory;
pub mod page;
pub mod points;
pub mod rebraid;
pub mod top_level;
pub mod update;

use crate::device::Device;
use crate::named::named;
use crate::rays::kinds::{self, RayKind, RayOptions};
use crate::scene::{Instances, Scene, SceneInstance};
use crate::subjects::device_rays::RayBuffers;
use crate::subjects::levels::Levels;
use crate::subjects::queries::Queries;
use crate::subjects::structures::Structures;
use crate::{Error, Result};
use ash::vk;
use hedgerow::accel::AccelOptions;
use hedgerow::trace::Query;

/// Runs that do not count, before those that do.
const WARM_UPS: u32 = 1;

/// One of the experiments.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Experiment {
    /// [`batch`].
    Batch,
    /// [`top_level`].
    TopLevel,
    /// [`rebraid`].
    Rebraid,
    /// [`any_hit`].
    AnyHit,
    /// [`update`].
    Update,
    /// [`memory`].
    Memory,
}

named!(Experiment, "experiment":
    Batch = "batch",
    TopLevel = "tlas",
    Rebraid = "rebraid",
    AnyHit = "any-hit",
    Update = "update",
    Memory = "memory",
);

/// What all experiments have in common.
#[derive(Clone, Copy)]
pub struct AccelSetup<'a> {
    /// Where they run.
    pub device: &'a Device,
    /// Of our structures.
    pub options: AccelOptions,
    /// Counted runs of everything, in turn, after one that warms up.
    pub runs: u32,
    /// Kinds of rays.
    pub kinds: &'a [RayKind],
    /// Their number and seed.
    pub rays: RayOptions,
    /// Is called with what is being done, for a progress bar.
    pub say: &'a dyn Fn(&str),
}

impl<'a> AccelSetup<'a> {
    fn ours(&self) -> Structures<'a> {
        Structures::ours(self.device, self.options)
    }

    /// Ours, and the driver's where it has any.
    fn makers(&self) -> Vec<Structures<'a>> {
        std::iter::once(self.ours()).chain(Structures::drivers(self.device)).collect()
    }

    /// The rays of every kind to `scene`, in device memory; kinds without any are left out. What follows from hits is traced on the
    /// device, too.
    fn rays_to(&self, scene: &Scene) -> Result<Vec<(RayKind, RayBuffers<'a>)>> {
        let alone = Instances {
            name: scene.name.clone(),
            parts: vec![scene.mesh.clone()],
            instances: vec![SceneInstance { part: 0, transform: SceneInstance::IDENTITY }],
            camera: scene.camera,
            lights: Vec::new(),
        };
        let mut levels = Levels::new(self.ours(), &alone, vk::BuildAccelerationStructureFlagsKHR::empty())?;
        levels.build()?;
        let mut all = Vec::new();
        for &kind in self.kinds {
            let rays = kinds::generate(kind, scene, &self.rays, &mut |rays| {
                let buffers = RayBuffers::new(self.device, rays)?;
                levels.trace(&buffers, Query::ClosestHit, Queries::OneEach)?;
                Ok(buffers.read_hits())
            })?;
            if !rays.is_empty() {
                all.push((kind, RayBuffers::new(self.device, &rays)?));
            }
        }
        Ok(all)
    }
}

/// What is not there yet is `None`, not an error: a call that says so refuses its arguments.
fn where_possible<T>(result: Result<T>) -> Result<Option<T>> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(Error::Argument(_)) => Ok(None),
        Err(error) => Err(error),
    }
}

/// Milliseconds of all builds, and of the updates that there were.
fn apart(samples: &[(f64, Option<f64>)]) -> (Vec<f64>, Vec<f64>) {
    (samples.iter().map(|(build, _)| *build).collect(), samples.iter().filter_map(|(_, update)| *update).collect())
}
