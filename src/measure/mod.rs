//! Figures: building and tracing under the clock, quality, and the records they end up in.

pub mod record;
mod subject;

pub use subject::{BuildRun, Subject};
