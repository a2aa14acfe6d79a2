//! Rays on the device, and what tracing them gives: the half of a subject that is the same for every structure of ours there.

use crate::device::{Buffer, Device};
use crate::{Error, Result};
use hedgerow::gpu::{Recorder, Timestamps};
use hedgerow::trace::tracer::Buffers;
use hedgerow::trace::{Hit, Ray, Work};

/// The rays that a subject traces.
pub struct DeviceRays<'a> {
    device: &'a Device,
    timestamps: Timestamps,
    uploaded: Option<Uploaded<'a>>,
}

struct Uploaded<'a> {
    count: u32,
    rays: Buffer<'a>,
    hits: Buffer<'a>,
}

impl Uploaded<'_> {
    fn buffers(&self, structure: u64, work: Option<u64>) -> Buffers {
        Buffers { structure, rays: self.rays.address(), hits: self.hits.address(), work, count: self.count }
    }
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
        let count = u32::try_from(rays.len())
            .map_err(|_| Error::Argument(format!("{} rays; at most 4294967295 at once", rays.len())))?;
        self.uploaded = None;
        let hits = self.device.buffer("hits", size_of_val(rays) as u64 / 2)?;
        self.uploaded = Some(Uploaded { count, rays: self.device.upload("rays", rays)?, hits });
        Ok(())
    }

    /// Milliseconds that tracing them takes by the device's clock, as `record` records it.
    ///
    /// # Errors
    /// The device failed.
    pub fn trace(
        &mut self,
        structure: u64,
        record: impl FnOnce(&mut Recorder<'_>, &Buffers) -> hedgerow::Result<()>,
    ) -> Result<f64> {
        let Some(uploaded) = &self.uploaded else { return Ok(0.0) };
        let buffers = uploaded.buffers(structure, None);
        self.device.run(Some(&mut self.timestamps), |recorder| {
            recorder.phase("trace");
            record(recorder, &buffers)
        })?;
        Ok(self.timestamps.phases()?.iter().map(|p| p.milliseconds).sum())
    }

    /// The hits of the last [`DeviceRays::trace`].
    pub fn hits(&self) -> Vec<Hit> {
        self.uploaded.as_ref().map_or_else(Vec::new, |u| u.hits.read(u.count as usize))
    }

    /// The work that each ray takes, counted by what `record` records.
    ///
    /// # Errors
    /// Too little memory; the device failed.
    pub fn work(
        &self,
        structure: u64,
        record: impl FnOnce(&mut Recorder<'_>, &Buffers) -> hedgerow::Result<()>,
    ) -> Result<Option<Vec<Work>>> {
        let Some(uploaded) = &self.uploaded else { return Ok(None) };
        let work = self.device.buffer("work", u64::from(uploaded.count) * size_of::<Work>() as u64)?;
        let buffers = uploaded.buffers(structure, Some(work.address()));
        self.device.run(None, |recorder| record(recorder, &buffers))?;
        Ok(Some(work.read(uploaded.count as usize)))
    }
}
