//! The reduction of boxes, plainly.

use crate::gpu::reduce::{Bounds, EMPTY};

/// The box around all of them.
pub fn bounds(boxes: &[Bounds]) -> Bounds {
    boxes.iter().fold(EMPTY, |[lo, hi], b| {
        [std::array::from_fn(|i| lo[i].min(b[0][i])), std::array::from_fn(|i| hi[i].max(b[1][i]))]
    })
}
