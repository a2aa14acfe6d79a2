//! kd-trees: the layout, builders on the host, and what is told of a tree (Papay 2025, "Efficient ray tracing algorithms
//! exploiting kd-trees on a GPU").
//!
//! A kd-tree halves space, not the primitives: cells do not overlap, a ray meets them in its order, and every
//! point of a triangle is in a cell that references it.
//!
//! 1. [`termination`] says when a cell is split no further;
//! 2. `host::exact` takes the best plane of all, `host::binned` the best of a few: both make a [`layout::KdTree`];
//! 3. [`quality`] measures, [`validate`] checks.
//!
//! [`crate::trace::kd_host`] finds the hits of rays in it.

#[cfg(feature = "cli")]
pub mod host;
pub mod layout;
pub mod quality;
pub mod termination;
pub mod validate;
