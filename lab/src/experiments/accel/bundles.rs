//! Rays of the kinds that are measured, in device memory: what follows from hits is traced on the device, too.

use super::Stage;
use crate::Result;
use crate::device::Buffer;
use crate::rays::kinds::{self, RayKind};
use crate::scene::{Instance, Instances, Scene};
use crate::subjects::levels::Levels;
use ash::vk;
use hedgerow::trace::{Hit, Query, Ray};

/// Rays of one kind, and room for their hits.
pub struct Bundle<'a> {
    /// The kind.
    pub kind: RayKind,
    /// How many.
    pub count: u32,
    /// The rays.
    pub rays: Buffer<'a>,
    /// One hit a ray, of whoever traced last.
    pub hits: Buffer<'a>,
}

impl Bundle<'_> {
    /// The hits of whoever traced last.
    pub fn read_hits(&self) -> Vec<Hit> {
        self.hits.read(self.count as usize)
    }
}

/// The rays of every kind of the stage to `scene`; kinds without any are left out.
pub fn of<'a>(stage: &Stage<'a>, scene: &Scene) -> Result<Vec<Bundle<'a>>> {
    let alone = Instances {
        name: scene.name.clone(),
        parts: vec![scene.mesh.clone()],
        instances: vec![Instance { part: 0, transform: Instance::IDENTITY }],
        camera: scene.camera,
        lights: Vec::new(),
    };
    let mut levels = Levels::new(stage.ours(), &alone, vk::BuildAccelerationStructureFlagsKHR::empty())?;
    levels.build()?;
    let bring = |rays: &[Ray]| -> Result<(Buffer<'a>, Buffer<'a>)> {
        let hits = stage.device.buffer("hits", size_of_val(rays) as u64 / 2)?;
        Ok((stage.device.upload("rays", rays)?, hits))
    };
    let mut bundles = Vec::new();
    for &kind in stage.kinds {
        let rays = kinds::generate(kind, scene, &stage.rays, &mut |rays| {
            let (device_rays, hits) = bring(rays)?;
            levels.trace(&device_rays, &hits, rays.len() as u32, Query::ClosestHit)?;
            Ok(hits.read(rays.len()))
        })?;
        if !rays.is_empty() {
            let count = rays.len() as u32;
            let (rays, hits) = bring(&rays)?;
            bundles.push(Bundle { kind, count, rays, hits });
        }
    }
    Ok(bundles)
}

const _: () = assert!(size_of::<Hit>() * 2 == size_of::<Ray>());
