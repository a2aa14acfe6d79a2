//! Reduction of bounds: the box around many boxes.
use super::arguments;
use super::{Context, Kernel, Recorder, shaders};
use crate::Result;

/// The least and the greatest corner, as the device has them: 24 bytes.
pub type Bounds = [[f32; 3]; 2];

/// The box that holds nothing.
pub const EMPTY: Bounds = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];

/// How a reduction of boxes is cut for a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reduction {
    count: u32,
    workgroup: u32,
    rounds: u32,
}

impl Reduction {
    /// A reduction of `count` boxes.
    pub fn new(context: &Context, count: u32) -> Reduction {
        Reduction { count, workgroup: context.tuning.group, rounds: context.tuning.reduce_rounds }
    }

    fn tile(&self) -> u32 {
        self.workgroup * self.rounds
    }

    /// Boxes of scratch (24 bytes each) that [`Reduction::record`] needs.
    pub fn scratch_boxes(&self) -> u32 {
        let first = self.count.div_ceil(self.tile());
        if first <= 1 { 0 } else { first + first.div_ceil(self.tile()) }
    }

    /// Records the reduction of the boxes at `boxes` to the one at `result`, with scratch memory at `scratch` (4-byte
    /// aligned). One dispatch a level with barriers between; the caller places one before and one behind.
    ///
    /// # Errors
    /// A pipeline could not be made.
    pub fn record(&self, recorder: &mut Recorder<'_>, boxes: u64, result: u64, scratch: u64) -> Result<()> {
        let kernel = Kernel::new(&shaders::GPU_REDUCE_BOUNDS, self.workgroup, &[]);
        let second = scratch + u64::from(self.count.div_ceil(self.tile())) * size_of::<Bounds>() as u64;
        let (mut from, mut count, mut room) = (boxes, self.count, [scratch, second].into_iter().cycle());
        loop {
            let tiles = count.div_ceil(self.tile()).max(1);
            let to = if tiles == 1 { result } else { room.next().expect("a cycle has no end") };
            let arguments = arguments::Reduce { boxes: from, results: to, count, rounds: self.rounds };
            recorder.dispatch(&kernel, &arguments, tiles)?;
            if tiles == 1 {
                return Ok(());
            }
            recorder.barrier();
            (from, count) = (to, tiles);
        }
    }
}
