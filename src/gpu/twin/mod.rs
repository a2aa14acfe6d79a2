//! What the passes of this room compute, plainly.

pub mod radix_sort;
pub mod reduce;
pub mod scan;
