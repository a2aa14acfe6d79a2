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
        let of = |(ray_count, rays, hits): &(u32, Buffer<'_>, Buffer<'_>)| {
            FluxRays::all(rays.region(), hits.region(), *ray_count)
        };
        let samples: Vec<FluxRays> = self.samples.iter().map(of).collect();
        FluxPass::new(recorder.context()).record(recorder, structure, &samples, self.grid.region())?;
        recorder.barrier();
        let cost = Cost::Rays { grid: self.grid.region(), share: Cost::SHARE };
        self.pass.record_rounds(recorder, structure, &cost, scratch)
    }
}

#[cfg(test)]
mod tests {
    use crate::device::{Device, DeviceOptions};
    use crate::scene::{LoadOptions, load};
    use crate::subjects::Subject;
    use crate::subjects::builders::Spec;
    use hedgerow::trace::Query;

    #[test]
    fn rounds_that_rays_teach_are_phases_of_the_build_and_take_less_work() {
        let device = Device::new(&DeviceOptions::default()).expect("a device");
        let scene = load("gen:stadium:3", &LoadOptions::default()).expect("a generator");
        let rays = crate::rays::sample::TeachingRays::of(&scene, &crate::rays::sample::ANY_HIT, 2000).expect("rays");
        let work = |spec: &str| {
            let mut subject: Box<dyn Subject + '_> =
                spec.parse::<Spec>().expect(spec).make_for(Some(&device), &scene).expect(spec);
            let run = subject.build().expect("built");
            subject.validate().expect("sound");
            subject.set_rays(&rays.all()).expect("memory");
            let work = subject.work(Query::AnyHit).expect("traced").expect("counted");
            let names: Vec<&str> = run.phases.iter().map(|phase| phase.name).collect();
            (names, work.iter().map(|work| u64::from(3 * work.steps + 2 * work.tests)).sum::<u64>())
        };
        let (_, before) = work("lbvh:codes=mc30");
        let (phases, after) = work("lbvh:codes=mc30:optimise=fast:by=rays");
        assert_eq!(phases[phases.len() - 3..], ["rays", "flux", "optimise"]);
        assert!(after < before, "{after} of work, {before} before");
    }

    #[test]
    fn what_rays_cannot_teach_is_refused_by_name() {
        let error = |spec: &str| spec.parse::<Spec>().expect_err(spec).to_string();
        assert!(error("lbvh:by=rays").contains("take optimise=fast"));
        assert!(error("lbvh:by=rays:optimise=20ms").contains("take optimise=fast"));
        assert!(error("lbvh:by=rays:optimise=fast:any-hit=opaque").contains("any-hit=near"));
        assert!(error("lbvh:by=light:optimise=fast").contains("by"));
        let spec: Spec = "hploc:optimise=fast:by=rays".parse().expect("known");
        assert!(spec.learns_from_a_view().expect("checked"));
        assert_eq!(spec.untaught().to_string(), "hploc:optimise=fast");
    }
}
