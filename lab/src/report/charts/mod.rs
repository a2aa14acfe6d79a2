//! The charts of the report, one file a kind.

pub mod bars;
pub mod curves;
pub mod growth;
pub mod phases;
pub mod scatter;
pub mod total_time;
