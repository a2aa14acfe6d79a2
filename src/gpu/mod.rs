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
pub(crate) mod driver_rays;
#[cfg(feature = "cli")]
mod driver_structure;
#[cfg(feature = "cli")]
mod driver_tracing;
pub mod fill;
mod grid;
#[cfg(feature = "cli")]
mod instance;
#[cfg(feature = "cli")]
mod memory;
#[cfg(feature = "cli")]
pub mod probe;
pub(crate) mod push_constants;
pub mod radix_sort;
mod reconvergence;
mod recorder;
pub mod reduce;
mod region;
mod requirements;
#[cfg(feature = "cli")]
mod restrict;
pub mod scan;
pub mod shaders;
mod specialise;
pub mod task_pool;
mod tuning;
mod workarounds;

#[cfg(feature = "cli")]
pub use buffer::Buffer;
pub use context::{Context, ContextDesc, Kernel, Limits};
#[cfg(feature = "cli")]
pub use device::{Device, DeviceOptions};
#[cfg(feature = "cli")]
pub(crate) use driver_rays::Arguments as RayArguments;
#[cfg(feature = "cli")]
pub use driver_rays::DriverRays;
#[cfg(feature = "cli")]
pub use driver_structure::{DriverPreference, DriverSizes, DriverStructure};
#[cfg(feature = "cli")]
pub use driver_tracing::DriverTracing;
pub use grid::Grid;
#[cfg(feature = "cli")]
pub use instance::{Found, list};
pub use recorder::{Phase, Recorder, Step, Timestamps};
pub use region::Region;
pub use requirements::{Features, Optional, Requirements, requirements};
#[cfg(feature = "cli")]
pub use restrict::Restrict;
pub(crate) use tuning::MOST_LANES;
pub use tuning::{BuildTuning, KdTuning, RefitTuning, TraceTuning, Tuning, TuningChoice};
pub use workarounds::Workarounds;
