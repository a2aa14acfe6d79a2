//! Rays of a scene that are counted in a tree on the device, each build anew: the phase `rays` of builders that they teach.

use crate::Result;
use crate::device::{Buffer, Device};
use hedgerow::bvh::sah::Collapse;
use hedgerow::gpu::{Recorder, Region};
use hedgerow::trace::Ray;
use hedgerow::trace::counts::{CountPass, CountedRays, CountedWalk, Earlier, Tallies};

/// Rays in device memory, and what is counted of them.
pub struct Counted<'a> {
    pass: CountPass,
    samples: Vec<(CountedWalk, u32, Buffer<'a>)>,
    tallies: Buffer<'a>,
    counts: Buffer<'a>,
}

impl<'a> Counted<'a> {
    /// Uploads these rays, to be counted by these walks in trees of at most this many records.
    ///
    /// # Errors
    /// Too little memory.
    pub fn new<'r>(
        device: &'a Device,
        samples: impl IntoIterator<Item = (CountedWalk, &'r [Ray])>,
        costs: Collapse,
        count: u32,
    ) -> Result<Counted<'a>> {
        let pass = CountPass::new(device, costs, count);
        let upload = |(walk, rays): (CountedWalk, &[Ray])| {
            Ok((walk, rays.len() as u32, device.upload("rays that teach", rays)?))
        };
        Ok(Counted {
            pass,
            samples: samples.into_iter().map(upload).collect::<Result<_>>()?,
            tallies: device.buffer("tallies of rays", pass.tally_bytes())?,
            counts: device.buffer("counts of rays", pass.counts_bytes())?,
        })
    }

    /// Bytes of scratch memory.
    pub fn scratch_bytes(&self) -> u64 {
        self.pass.scratch_bytes()
    }

    /// Where the counts are.
    pub fn counts(&self) -> Region {
        self.counts.region()
    }

    /// Records the phase `rays`, and a barrier behind it.
    ///
    /// # Errors
    /// The memory is too small; a pipeline could not be made.
    pub fn record(&self, recorder: &mut Recorder<'_>, structure: Region, scratch: Region) -> hedgerow::Result<()> {
        let tallies = Tallies { structure, tallies: self.tallies.region() };
        recorder.phase("rays");
        self.pass.record_clear(recorder, &tallies)?;
        recorder.barrier();
        for (walk, ray_count, rays) in &self.samples {
            let rays = CountedRays { rays: rays.region(), ray_count: *ray_count, first: 0, stride: 1 };
            self.pass.record_rays(recorder, *walk, &rays, &tallies)?;
        }
        recorder.barrier();
        self.pass.record_gather(recorder, &tallies, self.counts.region(), scratch, Earlier::Dropped)?;
        recorder.barrier();
        Ok(())
    }
}
