//! Rays through a structure on the device: what is found, and with how much work.

use super::cases::same;
use crate::device::Device;
use hedgerow::gpu::Recorder;
use hedgerow::trace::tracer::TraceBuffers;
use hedgerow::trace::{Hit, Ray, Work};

/// The hits of `rays` through the structure, traced by whatever `record` records, and their work; without `count_work` no room
/// is given for work, and all of it is that of no ray.
///
/// # Errors
/// The device failed, or something was written behind the hits.
pub fn traced(
    device: &Device,
    structure: &[u8],
    rays: &[Ray],
    count_work: bool,
    record: impl FnOnce(&mut Recorder<'_>, &TraceBuffers) -> hedgerow::Result<()>,
) -> anyhow::Result<(Vec<Hit>, Vec<Work>)> {
    let unwritten = Hit { t: -1.0, primitive: 7, u: -1.0, v: -1.0 };
    let structure = device.upload("structure", structure)?;
    let ray_buffer = device.upload("rays", rays)?;
    let hits = device.upload("hits", &vec![unwritten; rays.len() + 1])?;
    let work = device.upload("work", &vec![Work::default(); rays.len()])?;
    let buffers = TraceBuffers {
        structure: structure.address(),
        rays: ray_buffer.region(),
        hits: hits.region(),
        work: count_work.then_some(work.region()),
        count: rays.len() as u32,
    };
    device.run(None, |recorder| record(recorder, &buffers))?;
    let mut found: Vec<Hit> = hits.read(rays.len() + 1);
    same("behind the hits", &found.pop(), &Some(unwritten))?;
    Ok((found, work.read(rays.len())))
}
