//! kd-trees: the layout, builders on the device and on the host, and what is told of a tree (Papay 2025, "Efficient ray tracing algorithms
//! exploiting kd-trees on a GPU").
//!
//! A kd-tree halves space, not the primitives: cells do not overlap, a ray meets them in its order, and every
//! point of a triangle is in a cell that references it.
//!
//! 1. [`termination`] says when a cell is split no further;
//! 2. `host::exact` takes the best plane of all, `host::binned` the best of a few: both make a [`layout::KdTree`];
//!    [`builder`] builds on the device, by bins above and perfect splits below;
//! 3. [`quality`] measures, [`validate`] checks.
//!
//! `host::merge` merges the trees of objects that move into one of what stands still, and takes them out again.
//! [`crate::trace::kd_host`] finds the hits of rays in it.

pub mod builder;
#[cfg(feature = "cli")]
pub mod host;
pub mod layout;
pub mod merge;
pub mod quality;
pub mod termination;
pub mod validate;
