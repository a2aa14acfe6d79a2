//! Figures: building and tracing under the clock, quality, and the records they end up in.
//!
//! [`Subject`] is a builder on a scene. The rest is how several of them are measured fairly and what follows from it:
//! [`statistics`] (in turn, medians), [`growth`] (time over triangles), [`pareto`] and [`total_time`] (who is best for what).

pub mod growth;
pub mod pareto;
pub mod peers;
pub mod provenance;
pub mod record;
pub mod statistics;
mod subject;
pub mod total_time;

pub use subject::{BuildRun, Subject};
