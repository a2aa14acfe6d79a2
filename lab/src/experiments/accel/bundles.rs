//! Rays of the kinds that are measured, in device memory: what follows from hits is traced on the device, too.

use super::AccelSetup;
use crate::Result;
use crate::rays::kinds::{self, RayKind};
use crate::scene::{Instances, Scene, SceneInstance};
use crate::subjects::device_rays::RayBuffers;
use crate::subjects::levels::Levels;
use ash::vk;
use hedgerow::trace::Query;

/// Rays of one kind, and room for their hits.
pub struct Bundle<'a> {
    /// The kind.
    pub kind: RayKind,
    /// Its rays.
    pub buffers: RayBuffers<'a>,
}

/// The rays of every kind of the stage to `scene`; kinds without any are left out.
pub fn of<'a>(stage: &AccelSetup<'a>, scene: &Scene) -> Result<Vec<Bundle<'a>>> {
    let alone = Instances {
        name: scene.name.clone(),
        parts: vec![scene.mesh.clone()],
        instances: vec![SceneInstance { part: 0, transform: SceneInstance::IDENTITY }],
        camera: scene.camera,
        lights: Vec::new(),
    };
    let mut levels = Levels::new(stage.ours(), &alone, vk::BuildAccelerationStructureFlagsKHR::empty())?;
    levels.build()?;
    let mut bundles = Vec::new();
    for &kind in stage.kinds {
        let rays = kinds::generate(kind, scene, &stage.rays, &mut |rays| {
            let buffers = RayBuffers::new(stage.device, rays)?;
            levels.trace(&buffers, Query::ClosestHit)?;
            Ok(buffers.read_hits())
        })?;
        if !rays.is_empty() {
            bundles.push(Bundle { kind, buffers: RayBuffers::new(stage.device, &rays)? });
        }
    }
    Ok(bundles)
}
