//! Fills words with a value: `vkCmdFillBuffer` for memory that is known by its address.
use super::arguments;
use super::{Kernel, Recorder, Step, shaders};
use crate::Result;

/// Invocations a workgroup.
const WORKGROUP: u32 = 64;
/// Words of an invocation.
const ROUNDS: u32 = 16;

/// Records the fill of `count` words at address `words` with `value`. One dispatch; the caller places the barriers.
///
/// # Errors
/// The pipeline could not be made.
pub fn record(recorder: &mut Recorder<'_>, words: u64, count: u32, value: u32) -> Result<()> {
    let kernel = Kernel::new(&shaders::GPU_FILL, WORKGROUP, &[ROUNDS]);
    recorder.dispatch(&kernel, &arguments::Fill { words, count, value }, count.div_ceil(WORKGROUP * ROUNDS))
}

/// The same as a step of the phase `phase`.
pub(crate) fn step(phase: &'static str, words: u64, count: u32, value: u32) -> Step {
    let kernel = Kernel::new(&shaders::GPU_FILL, WORKGROUP, &[ROUNDS]);
    Step::new(phase, kernel, &arguments::Fill { words, count, value }, count.div_ceil(WORKGROUP * ROUNDS))
}
