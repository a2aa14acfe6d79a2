//! The device: what we need of it, pipelines, recording, timing, and the primitives that every builder stands on.
//!
//! [`Context`] takes a device that the caller made and owns nothing but pipelines.

pub(crate) mod arguments;
mod context;
pub mod fill;
mod grid;
pub(crate) mod plan;
pub mod radix_sort;
mod reconvergence;
mod recorder;
pub mod reduce;
mod region;
#[doc(hidden)]
pub mod requirements;
pub mod scan;
pub mod shaders;
mod sizes;
mod specialise;
pub mod task_pool;
mod tuning;
pub mod twin;
mod workarounds;

pub use context::{Context, ContextDesc, Kernel, Limits};
pub use grid::Grid;
pub use recorder::{Phase, Recorder, Step, Timestamps};
pub use region::Region;
pub use requirements::{Features, Optional, Requirements, requirements};
pub use sizes::Sizes;
pub(crate) use tuning::MOST_LANES;
pub use tuning::{BuildTuning, KdTuning, RefitTuning, TraceTuning, Tuning, TuningChoice};
pub use workarounds::Workarounds;
