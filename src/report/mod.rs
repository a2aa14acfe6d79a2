//! Tables, charts and the page.

pub mod chart;
pub mod charts;
pub mod labels;
pub mod names;
pub mod numbers;
pub mod theme;
