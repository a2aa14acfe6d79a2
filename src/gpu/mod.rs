//! The device: what we need of it, pipelines, recording, timing, and the primitives that every builder stands on.
//!
//! [`Context`] takes a device that the caller made and owns nothing but pipelines. `Device` is the binary's and the tests'
//! own device, built on the same public calls.

#[cfg(feature = "cli")]
mod buffer;
mod context;
#[cfg(feature = "cli")]
mod device;
#[cfg(feature = "cli")]
mod driver_structure;
pub mod fill;
mod grid;
#[cfg(feature = "cli")]
pub mod probe;
pub(crate) mod push_constants;
pub mod radix_sort;
mod recorder;
pub mod reduce;
mod region;
mod requirements;
pub mod scan;
pub mod shaders;
pub mod task_pool;
mod tuning;

#[cfg(feature = "cli")]
pub use buffer::Buffer;
pub use context::{Context, ContextDesc, Kernel, Limits};
#[cfg(feature = "cli")]
pub use device::{Device, DeviceOptions, Found, list};
#[cfg(feature = "cli")]
pub use driver_structure::{DriverPreference, DriverSizes, DriverStructure};
pub use grid::Grid;
pub use recorder::{Phase, Recorder, Step, Timestamps};
pub use region::Region;
pub use requirements::{Features, Requirements, requirements};
pub(crate) use tuning::MOST_LANES;
pub use tuning::{BuildTuning, KdTuning, RefitTuning, TraceTuning, Tuning, TuningChoice};
