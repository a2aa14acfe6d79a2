//! Rays on the device, and what tracing them gives: the half of a subject that is the same for every structure of ours there.

use crate::device::{Buffer, Device};
use crate::{Error, Result};
use hedgerow::gpu::{Recorder, Region, Timestamps};
use hedgerow::trace::tracer::TraceBuffers;
use hedgerow::trace::{Hit, Ray};

/// Rays in device memory, and room for their hits.
pub struct RayBuffers<'a> {
    /// How many.
    pub count: u32,
    /// The rays.
    pub rays: Buffer<'a>,
    /// One hit a ray, of the last trace.
    pub hits: Buffer<'a>,
}

impl<'a> RayBuffers<'a> {
    /// Uploads rays.
    ///
    /// # Errors
    /// Too many rays, or too little memory.
    pub fn new(device: &'a Device, rays: &[Ray]) -> Result<RayBuffers<'a>> {
        let count = u32::try_from(rays.len())
            .map_err(|_| Error::Argument(format!("{} rays; at most 4294967295 at once", rays.len())))?;
        let hits = device.buffer("hits", size_of::<Hit>() as u64 * u64::from(count))?;
        Ok(RayBuffers { count, rays: device.upload("rays", rays)?, hits })
    }

    /// The hits of the last trace.
    pub fn read_hits(&self) -> Vec<Hit> {
        self.hits.read(self.count as usize)
    }

    /// What a tracer takes of them and of the structure at this address.
    pub(crate) fn buffers(&self, structure: u64, work: Option<Region>) -> TraceBuffers {
        TraceBuffers { structure, rays: self.rays.region(), hits: self.hits.region(), work, count: self.count }
    }
}

/// Milliseconds that what `record` records takes by the device's clock, as a phase of this name.
///
/// # Errors
/// It cannot be recorded or run.
pub fn timed_run(
    device: &Device,
    timestamps: &mut Timestamps,
    phase: &'static str,
    record: impl FnOnce(&mut Recorder<'_>) -> hedgerow::Result<()>,
) -> Result<f64> {
    device.run(Some(&mut *timestamps), |recorder| {
        recorder.phase(phase);
        record(recorder)
    })?;
    Ok(timestamps.phases()?.iter().map(|phase| phase.milliseconds).sum())
}

/// The rays that a subject traces.
pub struct DeviceRays<'a> {
    device: &'a Device,
    timestamps: Timestamps,
    uploaded: Option<RayBuffers<'a>>,
}

impl<'a> DeviceRays<'a> {
    /// None yet.
    ///
    /// # Errors
    /// The device failed.
    pub fn new(device: &'a Device) -> Result<DeviceRays<'a>> {
        Ok(DeviceRays { device, timestamps: Timestamps::new(device, 1)?, uploaded: None })
    }

    /// Uploads them; not under the clock.
    ///
    /// # Errors
    /// Too many rays, or too little memory.
    pub fn set(&mut self, rays: &[Ray]) -> Result<()> {
        // Both at once may be too much.
        self.uploaded = None;
        self.uploaded = Some(RayBuffers::new(self.device, rays)?);
        Ok(())
    }

    /// Milliseconds that tracing them takes by the device's clock, as `record` records it.
    ///
    /// # Errors
    /// The device failed.
    pub fn trace(
        &mut self,
        structure: u64,
        record: impl FnOnce(&mut Recorder<'_>, &TraceBuffers) -> hedgerow::Result<()>,
    ) -> Result<f64> {
        let Some(uploaded) = &self.uploaded else { return Ok(0.0) };
        let buffers = uploaded.buffers(structure, None);
        timed_run(self.device, &mut self.timestamps, "trace", |recorder| record(recorder, &buffers))
    }

    /// The hits of the last [`DeviceRays::trace`].
    pub fn hits(&self) -> Vec<Hit> {
        self.uploaded.as_ref().map_or_else(Vec::new, RayBuffers::read_hits)
    }

    /// The work that each ray takes, counted by what `record` records as such a `W`.
    ///
    /// # Errors
    /// Too little memory; the device failed.
    pub fn work<W: bytemuck::Pod>(
        &self,
        structure: u64,
        record: impl FnOnce(&mut Recorder<'_>, &TraceBuffers) -> hedgerow::Result<()>,
    ) -> Result<Option<Vec<W>>> {
        let Some(uploaded) = &self.uploaded else { return Ok(None) };
        let work = self.device.buffer("work", u64::from(uploaded.count) * size_of::<W>() as u64)?;
        let buffers = uploaded.buffers(structure, Some(work.region()));
        self.device.run(None, |recorder| record(recorder, &buffers))?;
        Ok(Some(work.read(uploaded.count as usize)))
    }
}
