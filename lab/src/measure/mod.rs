//! How figures are made and kept: what makes them fair and comparable, and the records they end up in.
//!
//! [`statistics`] (in turn, medians), [`agreement`] (right hits), [`overlap`] (a quality that takes time), [`copy`] (what the
//! memory can do), [`correlation`] (what goes with what), [`heap`] (what builds on the CPU hold), [`total_time`] (builds and rays together), [`provenance`] (where figures come from), [`record`] (one builder
//! on one scene) and [`setting`] (where and how, and what failed).

pub mod agreement;
pub mod copy;
pub mod correlation;
pub mod heap;
pub mod overlap;
pub mod provenance;
pub mod record;
pub mod setting;
pub mod statistics;
pub mod total_time;

pub use record::MemoryRecord;
pub use setting::{Failure, Setting};
pub use statistics::{Spread, geometric_mean, in_turn, mean_work, ratios};

/// Takes records as soon as they are measured.
pub type Sink<'s, R> = dyn FnMut(R) -> crate::Result<()> + 's;
