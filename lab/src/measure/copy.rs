//! The rate of a plain copy on the device: what the phases of a build are held against.

use super::statistics::Spread;
use crate::Result;
use crate::arguments;
use crate::device::Device;
use crate::shaders;
use hedgerow::gpu::{Kernel, Timestamps};

/// Bytes copied: more than any cache holds.
const BYTES: u64 = 64 << 20;
/// Counted runs, after one that warms up. The fastest counts: a copy can only be held up.
const RUNS: u32 = 5;
/// Invocations a workgroup.
const WORKGROUP: u32 = 256;

/// What the shader takes to copy `count` times 16 bytes.
pub(crate) fn arguments(source: u64, target: u64, count: u32) -> arguments::CopyWords {
    arguments::CopyWords { source, target, count }
}

/// Bytes a second in GB/s (10⁹) that a plain copy moves, reading and writing both counted.
///
/// # Errors
/// Too little memory; the device failed.
pub fn rate_gb_s(device: &Device) -> Result<f64> {
    let source = device.upload("copy: source", &vec![1u32; BYTES as usize / 4])?;
    let target = device.buffer("copy: target", BYTES)?;
    let count = (BYTES / 16) as u32;
    let kernel = Kernel::new(&shaders::MEASURE_COPY, WORKGROUP, &[]);
    let arguments = arguments(source.address(), target.address(), count);
    let mut timestamps = Timestamps::new(device, 1)?;
    let mut times = Vec::new();
    for run in 0..=RUNS {
        device.run(Some(&mut timestamps), |recorder| {
            recorder.phase("copy");
            recorder.dispatch(&kernel, &arguments, count.div_ceil(WORKGROUP))
        })?;
        if run > 0 {
            times.extend(timestamps.phases()?.iter().map(|phase| phase.milliseconds));
        }
    }
    let fastest = Spread::of(&times).map_or(f64::NAN, |spread| spread.min);
    Ok(2.0 * BYTES as f64 / (fastest * 1e6))
}
