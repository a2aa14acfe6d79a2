//! Figures: building and tracing under the clock, quality, and the records they end up in.
//!
//! [`Subject`] is a builder on a scene; [`builders`] makes one by name; [`matrix`] measures several of them on a scene and
//! gives a [`record`] for each. [`experiments`] measures what engines do through the calls of `VK_KHR_acceleration_structure`,
//! over [`structures`] and [`levels`] of instances; [`animate`] scenes that move; [`stability`] where methods give way;
//! [`check`] asks whether a device does all of it rightly. The rest
//! is how that is fair and what follows from it: [`agreement`] (right hits), [`overlap`] (a quality that takes time),
//! [`statistics`] (in turn, medians), [`outline`] (boxes level by level, to be drawn), [`growth`] (time over triangles), [`pareto`]
//! and [`total_time`] (who is best for what). [`choose`] says who will be, before anything is built.

pub mod agreement;
pub mod animate;
pub mod builders;
pub mod check;
pub mod choose;
pub mod comparison;
pub mod copy;
mod device_bvh;
mod device_rays;
pub mod experiments;
pub mod growth;
mod host;
mod kd_device;
mod kd_gpu;
mod kd_host;
pub mod levels;
pub mod matrix;
pub mod outline;
pub mod overlap;
pub mod pareto;
pub mod peers;
pub mod provenance;
pub mod record;
pub mod shard;
pub mod stability;
pub mod statistics;
pub mod structures;
mod subject;
pub mod total_time;
mod wide;

pub use subject::{BuildRun, KD_TREE, Outcome, Subject};
