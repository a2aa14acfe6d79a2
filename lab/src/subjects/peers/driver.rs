//! `driver-fast-build` and `driver-fast-trace`: the Vulkan driver's own acceleration structure, traced by ray queries, or by a
//! ray-tracing pipeline where there are none.
//!
//! The build time is that of the bottom level alone, which is what compares with our builders; the top level of one
//! instance, which rays cannot do without, is the phase `tlas` beside it. Structure bytes hold both.

use crate::device::{Device, Found, driver_is_missing};
use crate::measure::record;
use crate::scene::Mesh;
use crate::subjects::build_memory::memory_record;
use crate::subjects::device_rays::DeviceRays;
use crate::subjects::level::Level;
use crate::subjects::queries::Queries;
use crate::subjects::structures::Structures;
use crate::subjects::{BuildRun, Subject};
use crate::{Error, Result};
use ash::vk::{BuildAccelerationStructureFlagsKHR as Flags, BuildAccelerationStructureModeKHR as Mode};
use hedgerow::accel::Instance;
use hedgerow::gpu::Timestamps;
use hedgerow::trace::{Hit, Query, Ray};

/// What the driver is asked to be good at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum DriverPreference {
    /// `VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_BUILD_BIT_KHR`.
    FastBuild,
    /// `VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR`.
    FastTrace,
}

/// A scene in the driver's acceleration structure.
pub struct Driver<'a> {
    structures: Structures<'a>,
    name: &'static str,
    bottom: Level<'a>,
    top: Level<'a>,
    timestamps: Timestamps,
    rays: DeviceRays<'a>,
}

/// What a reader of the figures must know of this driver's builder, if anything.
pub fn note(found: &Found) -> Option<String> {
    found.workarounds.driver_halves_in_order.then(|| {
        format!(
            "{} ({}) does not sort the triangles of its acceleration structures but halves them in the order of the \
             input: no peer. Mesa 26 does sort them: `make bench-peers` measures under it.",
            found.name, found.driver
        )
    })
}

/// What a reader of the figures must know where the driver has no builder to compare with.
pub fn missing(device: &Device) -> Option<String> {
    device.driver_tracing().is_none().then(|| {
        "The driver has no acceleration structures of its own (VK_KHR_acceleration_structure) to compare with.".into()
    })
}

impl<'a> Driver<'a> {
    /// Uploads `mesh` and makes room for the structure.
    ///
    /// # Errors
    /// [`hedgerow::Error::Unsupported`] where the driver has no structures (or the device was opened without); too many triangles
    /// for it; too little memory.
    pub fn new(device: &'a Device, mesh: &Mesh, preference: DriverPreference) -> Result<Driver<'a>> {
        let structures = Structures::drivers(device).ok_or_else(|| driver_is_missing(device))?;
        let (count, most) = (mesh.triangles.len() as u64, device.most_primitives_of_driver());
        if count > most {
            let message = format!("{count} triangles, {} builds of at most {most}", device.found().name);
            return Err(Error::Argument(format!("{message}; take a smaller scene or another builder")));
        }
        let (name, flags) = match preference {
            DriverPreference::FastBuild => ("driver-fast-build", Flags::PREFER_FAST_BUILD),
            DriverPreference::FastTrace => ("driver-fast-trace", Flags::PREFER_FAST_TRACE),
        };
        let bottom = Level::bottom(&structures, mesh, flags)?;
        let top = Level::top(&structures, &[bottom.instance(&structures, Instance::IDENTITY)], flags)?;
        let (timestamps, rays) = (Timestamps::new(device, 2)?, DeviceRays::new(device)?);
        Ok(Driver { structures, name, bottom, top, timestamps, rays })
    }
}

impl Subject for Driver<'_> {
    fn builder(&self) -> &str {
        self.name
    }

    fn kind(&self) -> &'static str {
        "driver"
    }

    fn device(&self) -> Option<&Device> {
        Some(self.structures.device)
    }

    fn build(&mut self) -> Result<BuildRun> {
        let structures = &self.structures;
        structures.device.run(Some(&mut self.timestamps), |recorder| {
            recorder.phase("build");
            self.bottom.record(structures, recorder, Mode::BUILD)?;
            recorder.phase("tlas");
            self.top.record(structures, recorder, Mode::BUILD)
        })?;
        let phases = self.timestamps.phases()?;
        let bottom = phases.first().map_or(0.0, |p| p.milliseconds);
        Ok(BuildRun { milliseconds: bottom, ..BuildRun::of(phases) })
    }

    fn memory(&self) -> record::MemoryRecord {
        let ([bottom, scratch], [top, _]) = (self.bottom.bytes(), self.top.bytes());
        memory_record(bottom + top, scratch)
    }

    fn set_rays(&mut self, rays: &[Ray]) -> Result<()> {
        self.rays.set(rays)
    }

    fn trace(&mut self, query: Query) -> Result<f64> {
        let (structures, top) = (&self.structures, self.structures.address(self.top.structure()));
        self.rays.trace(top, |recorder, buffers| structures.record_trace(recorder, buffers, query, Queries::OneEach))
    }

    fn hits(&mut self) -> Result<Vec<Hit>> {
        Ok(self.rays.hits())
    }
}
