//! The device: what we need of it, pipelines, recording, timing, and the primitives that every builder stands on.
//!
//! [`Context`] takes a device that the caller made and owns nothing but pipelines. [`Recorder`] writes passes into the caller's
//! command buffer. [`Region`] and [`Sizes`] are how memory is passed and asked for.
//!
//! Passes that only builders use (fill, scan, reduction, task pool) are public for the laboratory and hidden here.

pub(crate) mod arguments;
mod context;
mod execution_modes;
mod features;
#[doc(hidden)]
pub mod fill;
mod grid;
mod lanes;
mod longs;
pub(crate) mod plan;
pub mod radix_sort;
mod recorder;
#[doc(hidden)]
pub mod reduce;
mod region;
#[doc(hidden)]
pub mod requirements;
#[doc(hidden)]
pub mod scan;
pub mod shaders;
mod sizes;
mod specialise;
mod spirv;
mod table;
#[doc(hidden)]
pub mod task_pool;
mod tuning;
pub mod twin;
mod workarounds;

pub use context::{Context, ContextDesc, Kernel, Limits};
pub use features::Features;
pub use grid::Grid;
pub use recorder::{Phase, Recorder, Step, Timestamps};
pub use region::Region;
pub use requirements::{Optional, Requirements, requirements};
pub use sizes::Sizes;
pub use table::{ArgumentMemory, ArgumentTable};
pub(crate) use tuning::MOST_LANES;
pub use tuning::{BuildTuning, KdTuning, RefitTuning, TraceTuning, Tuning, TuningChoice};
pub use workarounds::Workarounds;
