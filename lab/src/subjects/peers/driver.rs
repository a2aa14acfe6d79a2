//! `driver-fast-build` and `driver-fast-trace`: the Vulkan driver's own acceleration structure, traced by ray queries, or by a
//! ray-tracing pipeline where there are none.
//!
//! The build time is that of the bottom level alone, which is what compares with our builders; the top level of one
//! instance, which rays cannot do without, is the phase `tlas` beside it. Structure bytes hold both.

use crate::device::{Buffer, Device, DriverPreference, DriverRays, DriverStructure, Found};
use crate::measure::record;
use crate::scene::Mesh;
use crate::subjects::{BuildRun, Subject};
use crate::{Error, Result};
use hedgerow::bvh::layout::Bvh2;
use hedgerow::gpu::{self, Timestamps};
use hedgerow::trace::{Hit, Query, Ray, Work};

/// A scene in the driver's acceleration structure.
pub struct Driver<'a> {
    device: &'a Device,
    preference: DriverPreference,
    structure: DriverStructure<'a>,
    timestamps: Timestamps,
    rays: Option<(u32, Buffer<'a>, Buffer<'a>)>,
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
    /// [`hedgerow::Error::Unsupported`] where the driver has no structures (or the device was opened without); too little memory.
    pub fn new(device: &'a Device, mesh: &Mesh, preference: DriverPreference) -> Result<Driver<'a>> {
        let structure = DriverStructure::new(device, &mesh.positions, &mesh.triangles, preference)?;
        Ok(Driver { device, preference, structure, timestamps: Timestamps::new(device, 2)?, rays: None })
    }
}

impl Subject for Driver<'_> {
    fn builder(&self) -> &str {
        match self.preference {
            DriverPreference::FastBuild => "driver-fast-build",
            DriverPreference::FastTrace => "driver-fast-trace",
        }
    }

    fn kind(&self) -> &'static str {
        "driver"
    }

    fn timer(&self) -> &'static str {
        self.device.timer()
    }

    fn traces_on_device(&self) -> bool {
        true
    }

    fn build(&mut self) -> Result<BuildRun> {
        self.device.run(Some(&mut self.timestamps), |recorder| {
            self.structure.record(recorder);
            Ok(())
        })?;
        let phases = self.timestamps.phases()?;
        let bottom = phases.first().map_or(0.0, |p| p.milliseconds);
        Ok(BuildRun { milliseconds: bottom, phases })
    }

    fn memory(&self) -> record::Memory {
        let sizes = self.structure.sizes();
        let structure = sizes.bottom + sizes.top;
        record::Memory {
            structure_bytes: Some(structure),
            scratch_bytes: Some(sizes.scratch),
            peak_bytes: Some(structure + sizes.scratch),
        }
    }

    fn quality(&mut self, c_t: f64, c_i: f64) -> Result<record::Quality> {
        // The driver's nodes are its own.
        Ok(record::Quality { c_t, c_i, ..Default::default() })
    }

    fn tree(&mut self) -> Result<Option<Bvh2>> {
        Ok(None)
    }

    fn set_rays(&mut self, rays: &[Ray]) -> Result<()> {
        let count = u32::try_from(rays.len())
            .map_err(|_| Error::Argument(format!("{} rays; at most 4294967295 at once", rays.len())))?;
        self.rays = None;
        let hits = self.device.buffer("driver: hits", (rays.len() * size_of::<Hit>()) as u64)?;
        self.rays = Some((count, self.device.upload("driver: rays", rays)?, hits));
        Ok(())
    }

    fn trace(&mut self, query: Query) -> Result<f64> {
        let Some((count, rays, hits)) = &self.rays else {
            return Ok(0.0);
        };
        let rays = DriverRays {
            structure: self.structure.address(),
            rays: rays.address(),
            hits: hits.address(),
            count: *count,
            any_hit: query == Query::AnyHit,
        };
        let device = self.device;
        device.run(Some(&mut self.timestamps), |recorder| {
            recorder.phase("trace");
            device.trace_by_driver(recorder, &rays)
        })?;
        Ok(self.timestamps.phases()?.iter().map(|p: &gpu::Phase| p.milliseconds).sum())
    }

    fn hits(&mut self) -> Result<Vec<Hit>> {
        Ok(self.rays.as_ref().map_or_else(Vec::new, |(count, _, hits)| hits.read(*count as usize)))
    }

    fn work(&mut self, _query: Query) -> Result<Option<Vec<Work>>> {
        Ok(None)
    }
}
