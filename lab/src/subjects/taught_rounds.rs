//! Rounds of reinsertion on a finished tree that rays of the scene teach, each build anew: the phases `rays`, `flux` and `optimise`.

use crate::Result;
use crate::device::{Buffer, Device};
use crate::rays::sample::TeachingRays;
use hedgerow::bvh::flux::GRID_BYTES;
use hedgerow::bvh::reinsertion::{Cost, Reinsertion, ReinsertionOptions};
use hedgerow::gpu::{Recorder, Region};
use hedgerow::trace::flux::{FluxPass, FluxRays};
use hedgerow::trace::tracer::{self, TraceBuffers, TraceShape};
use hedgerow::trace::{Hit, Query};

/// Rays in device memory with room for their hits, and what is made of them.
pub struct TaughtRounds<'a> {
    pass: Reinsertion,
    samples: Vec<(u32, Buffer<'a>, Buffer<'a>)>,
    grid: Buffer<'a>,
}

impl<'a> TaughtRounds<'a> {
    /// Uploads these rays, to teach rounds in trees of at most this many records.
    ///
    /// # Errors
    /// Too little memory.
    pub fn new(
        device: &'a Device,
        teaching: &TeachingRays,
        options: &ReinsertionOptions,
        count: u32,
    ) -> Result<TaughtRounds<'a>> {
        let sample = |(_, rays): &(_, Vec<_>)| {
            let hits = device.buffer("hits that teach", (rays.len() * size_of::<Hit>()) as u64)?;
            Ok((rays.len() as u32, device.upload("rays that teach", rays)?, hits))
        };
        Ok(TaughtRounds {
            pass: Reinsertion::new(device, options, count),
            samples: teaching.by_kind.iter().map(sample).collect::<Result<_>>()?,
            grid: device.buffer("flux of rays", GRID_BYTES)?,
        })
    }

    /// Bytes of scratch memory.
    pub fn scratch_bytes(&self) -> u64 {
        self.pass.scratch_bytes_by_rays()
    }

    /// Records the phases `rays`, in which all are traced to their closest hits, `flux` and `optimise`.
    ///
    /// # Errors
    /// The memory is too small; a pipeline could not be made.
    pub fn record(&self, recorder: &mut Recorder<'_>, structure: Region, scratch: Region) -> hedgerow::Result<()> {
        let shape = TraceShape::of(recorder.context());
        recorder.phase("rays");
        for (count, rays, hits) in &self.samples {
            let buffers = TraceBuffers {
                structure: structure.address,
                rays: rays.region(),
                hits: hits.region(),
                work: None,
                count: *count,
            };
            tracer::record(recorder, &shape, Query::ClosestHit, &buffers)?;
        }
        recorder.barrier();
        let of = |(ray_count, rays, hits): &(u32, Buffer<'_>, Buffer<'_>)| FluxRays {
            rays: rays.region(),
            hits: hits.region(),
            ray_count: *ray_count,
            first: 0,
            stride: 1,
        };
        let samples: Vec<FluxRays> = self.samples.iter().map(of).collect();
        FluxPass::new(recorder.context()).record(recorder, structure, &samples, self.grid.region())?;
        recorder.barrier();
        let cost = Cost::Rays { grid: self.grid.region(), share: Cost::SHARE };
        self.pass.record_rounds(recorder, structure, &cost, scratch)
    }
}
