//! `hedgerow bench`: builders on scenes, built and traced in turn.
//!
//! [`matrix`] measures and gives a [`record`](crate::measure::record) for each builder and scene; [`results`] writes them for
//! programs, [`page`] for people. [`pareto`] and [`total_time`](crate::measure::total_time) say who is best for what.

pub(crate) mod command;
pub mod kd_trees;
pub mod matrix;
pub mod page;
pub mod pareto;
pub mod results;
pub mod shard;
