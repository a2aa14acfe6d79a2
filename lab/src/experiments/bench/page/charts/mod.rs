//! The charts of `index.html`, one file a kind.

pub mod growth;
pub mod phases;
pub mod scatter;
pub mod schedules;
pub mod total_time;
