//! A scene in two levels: a bottom-level structure for each part, a top level over the instances; ours or the driver's, by the
//! same calls.

use super::device_rays::RayBuffers;
use super::level::Level;
use super::queries::{Forms, Queries};
use super::structures::Structures;
use crate::Result;
use crate::scene::Instances;
use ash::vk;
use hedgerow::accel::{ANY_HIT_ORDER, Instance, Tree};
use hedgerow::bvh::layout::InstanceRecord;
use hedgerow::gpu::Timestamps;
use hedgerow::trace;

type Mode = vk::BuildAccelerationStructureModeKHR;

/// A scene's structures.
pub struct Levels<'a> {
    structures: Structures<'a>,
    _parts: Vec<Level<'a>>,
    top: Level<'a>,
    timestamps: Timestamps,
}

impl<'a> Levels<'a> {
    /// Uploads and builds the parts; the top level has memory and is not built yet. `flags` are those of the top level;
    /// [`ANY_HIT_ORDER`] holds for the parts, too.
    ///
    /// # Errors
    /// Too little memory; the structs ask for what there is not.
    pub fn new(
        structures: Structures<'a>,
        scene: &Instances,
        flags: vk::BuildAccelerationStructureFlagsKHR,
    ) -> Result<Levels<'a>> {
        let device = structures.device;
        let of_parts = vk::BuildAccelerationStructureFlagsKHR::PREFER_FAST_TRACE | flags & ANY_HIT_ORDER;
        let mut parts = Vec::new();
        for mesh in &scene.parts {
            let part = Level::bottom(&structures, mesh, of_parts)?;
            device.run(None, |recorder| part.record(&structures, recorder, Mode::BUILD))?;
            parts.push(part.without_inputs());
        }
        let placed = |i: &crate::scene::SceneInstance| parts[i.part as usize].instance(&structures, i.transform);
        let all: Vec<Instance> = scene.instances.iter().map(placed).collect();
        let top = Level::top(&structures, &all, flags)?;
        let timestamps = Timestamps::new(device, 1)?;
        Ok(Levels { structures, _parts: parts, top, timestamps })
    }

    /// The same, traced by a shader for structures of these nodes, whatever they have.
    #[must_use]
    pub fn traced_as(self, forms: Forms) -> Levels<'a> {
        Levels { structures: self.structures.traced_as(forms), ..self }
    }

    /// Writes other transforms, for [`Levels::update`] or a build.
    pub fn place(&self, transforms: impl Iterator<Item = [[f32; 4]; 3]>) {
        let mut all: Vec<Instance> = self.top.input().read(self.top.count as usize);
        for (instance, transform) in all.iter_mut().zip(transforms) {
            instance.transform = transform;
        }
        self.top.input().write(&all);
    }

    /// Builds the top level; milliseconds by the device's timestamps.
    ///
    /// # Errors
    /// The build cannot be recorded or run.
    pub fn build(&mut self) -> Result<f64> {
        self.top.build(&self.structures, &mut self.timestamps, Mode::BUILD)
    }

    /// Updates it in place; it was built with `ALLOW_UPDATE`.
    ///
    /// # Errors
    /// As [`Levels::build`].
    pub fn update(&mut self) -> Result<f64> {
        self.top.build(&self.structures, &mut self.timestamps, Mode::UPDATE)
    }

    /// Bytes of the top level and of its scratch memory.
    pub fn top_bytes(&self) -> [u64; 2] {
        self.top.bytes()
    }

    /// Entries of the top level, where it is one of ours: its instances, those that were opened as their parts.
    pub fn entries(&self) -> Option<u32> {
        self.top.header().map(|header| header.active)
    }

    /// The top level's tree, where it is one of ours.
    ///
    /// # Errors
    /// The structure is another.
    pub fn top_tree(&self) -> Result<Tree<InstanceRecord>> {
        Ok(Tree::from_bytes(&self.top.structure_bytes())?)
    }

    /// Traces rays that lie in device memory; milliseconds by the device's timestamps.
    ///
    /// # Errors
    /// The kernel cannot be made or run.
    pub fn trace(&mut self, rays: &RayBuffers<'_>, query: trace::Query, queries: Queries) -> Result<f64> {
        self.structures.trace(&mut self.timestamps, self.top.structure(), rays, query, queries)
    }

    /// What each of the rays meets on its way, of our structures: nodes of the top level, instances, nodes below, triangles.
    ///
    /// # Errors
    /// The structures are the driver's; the kernel cannot be made or run.
    pub fn work(&mut self, rays: &RayBuffers<'_>, query: trace::Query) -> Result<Vec<[u32; 4]>> {
        self.structures.work(self.top.structure(), rays, query)
    }
}
