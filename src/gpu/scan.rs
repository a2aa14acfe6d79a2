//! Exclusive scan (prefix sum) of 32-bit words.
//!
//! Reduce, then scan: three dispatches, no progress between workgroups asked for. `glsl/gpu/scan.glsl` is the device's side.
use super::arguments;
use super::{Context, Kernel, Recorder, Step, shaders};
use crate::Result;

/// The most words that are scanned at once: twice the primitives that a tree may have.
pub const MAX_COUNT: u32 = 1 << 28;

/// How a scan of words is cut for a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Scan {
    count: u32,
    workgroup: u32,
    rounds: u32,
    each: u32,
}

/// Device addresses of one scan, 4-byte aligned.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct ScanBuffers {
    /// The words.
    pub values: u64,
    /// Where the scan goes: as many words; may be `values`.
    pub results: u64,
    /// [`Scan::sums_words`] words of scratch; the last of them is the total when the scan has run.
    pub sums: u64,
}

impl Scan {
    /// A scan of `count` words.
    ///
    /// # Panics
    /// `count` is over [`MAX_COUNT`].
    pub fn new(context: &Context, count: u32) -> Scan {
        assert!(count <= MAX_COUNT, "{count} words, at most {MAX_COUNT} are scanned at once");
        let workgroup = context.tuning.group;
        // At most 2^14 tiles, so that one workgroup scans their sums in little time.
        let rounds = (count >> 14).div_ceil(workgroup).next_power_of_two().max(context.tuning.scan_rounds);
        Scan { count, workgroup, rounds, each: context.tuning.scan_each.min(rounds) }
    }

    fn tiles(&self) -> u32 {
        self.count.div_ceil(self.workgroup * self.rounds)
    }

    /// Words of scratch; the total is in the last one.
    pub fn sums_words(&self) -> u32 {
        self.tiles() + 1
    }

    /// Records the scan: three dispatches with barriers between; the caller places one before and one behind.
    ///
    /// # Errors
    /// A pipeline could not be made.
    pub fn record(&self, recorder: &mut Recorder<'_>, buffers: &ScanBuffers) -> Result<()> {
        let arguments = self.arguments(buffers);
        for (i, (kernel, groups)) in self.dispatches().into_iter().enumerate() {
            if i > 0 {
                recorder.barrier();
            }
            recorder.dispatch(&kernel, &arguments, groups)?;
        }
        Ok(())
    }

    /// The three dispatches in the phase `phase`.
    pub(crate) fn steps(&self, phase: &'static str, buffers: &ScanBuffers) -> Vec<Step> {
        let arguments = self.arguments(buffers);
        self.dispatches().map(|(kernel, groups)| Step::new(phase, kernel, &arguments, groups)).into()
    }

    fn arguments(&self, &ScanBuffers { values, results, sums }: &ScanBuffers) -> arguments::Scan {
        arguments::Scan { values, results, sums, count: self.count, rounds: self.rounds }
    }

    fn dispatches(&self) -> [(Kernel, u32); 3] {
        let kernel = |shader| Kernel::new(shader, self.workgroup, &[self.each]);
        [
            (kernel(&shaders::GPU_SCAN_SUM), self.tiles()),
            (kernel(&shaders::GPU_SCAN_SUMS), 1),
            (kernel(&shaders::GPU_SCAN_APPLY), self.tiles()),
        ]
    }
}
