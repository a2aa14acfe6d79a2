//! What the laboratory measures and asks, one folder each: its measuring, its records, its page and its command.

pub mod accel;
pub mod animate;
pub mod bench;
pub mod check;
pub mod compare;
pub mod navigate;
pub mod report;
pub mod stability;
