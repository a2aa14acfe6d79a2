//! A mesh whose vertices move, as a bottom-level structure under a top level of one instance.

use crate::Result;
use crate::scene::Mesh;
use crate::subjects::device_rays::RayBuffers;
use crate::subjects::level::Level;
use crate::subjects::structures::Structures;
use ash::vk;
use hedgerow::accel::Instance;
use hedgerow::bvh::layout::Header;
use hedgerow::gpu::Timestamps;
use hedgerow::trace::Query;

type Mode = vk::BuildAccelerationStructureModeKHR;
type Flags = vk::BuildAccelerationStructureFlagsKHR;

/// The mesh and its structures.
pub struct Deforming<'a> {
    structures: Structures<'a>,
    bottom: Level<'a>,
    top: Level<'a>,
    timestamps: Timestamps,
}

impl<'a> Deforming<'a> {
    /// Uploads the mesh; nothing is built yet.
    pub fn new(structures: Structures<'a>, mesh: &Mesh) -> Result<Deforming<'a>> {
        let bottom = Level::bottom(&structures, mesh, Flags::ALLOW_UPDATE)?;
        let top = Level::top(&structures, &[bottom.instance(&structures, Instance::IDENTITY)], Flags::empty())?;
        let timestamps = Timestamps::new(structures.device, 1)?;
        Ok(Deforming { structures, bottom, top, timestamps })
    }

    /// Moves the vertices, for the next build or update.
    pub fn set_positions(&self, positions: &[[f32; 3]]) {
        self.bottom.input().write(positions);
    }

    /// Builds the bottom level; milliseconds by the device's timestamps.
    pub fn build(&mut self) -> Result<f64> {
        self.bottom.build(&self.structures, &mut self.timestamps, Mode::BUILD)
    }

    /// Updates the bottom level in place.
    pub fn update(&mut self) -> Result<f64> {
        self.bottom.build(&self.structures, &mut self.timestamps, Mode::UPDATE)
    }

    /// Builds the top level, whose box follows the bottom level's: before rays are traced.
    pub fn build_top(&mut self) -> Result<f64> {
        self.top.build(&self.structures, &mut self.timestamps, Mode::BUILD)
    }

    /// The head of the bottom level, of ours.
    pub fn header(&self) -> Option<Header> {
        self.bottom.header()
    }

    /// Traces rays through the top level; milliseconds by the device's timestamps.
    pub fn trace(&mut self, rays: &RayBuffers<'_>, query: Query) -> Result<f64> {
        self.structures.trace(&mut self.timestamps, self.top.structure(), rays, query)
    }
}
