//! kd-trees: the layout, the builder, and the quality of a tree (Papay 2025, "Efficient ray tracing algorithms
//! exploiting kd-trees on a GPU").
//!
//! A kd-tree halves space, not the primitives: cells do not overlap, a ray meets them in its order, and every
//! point of a triangle is in a cell that references it.
//!
//! 1. [`termination`] says when a cell is split no further;
//! 2. [`builder`] builds on the device, by bins above and perfect splits below: a [`layout::KdTree`];
//! 3. [`quality`] measures, [`validate`] checks.
//!
//! [`merge`] merges the triangles of objects that move into the tree of what stands still, and takes them out again.
//! [`crate::trace::twin::kd`] finds the hits of rays in it.

pub mod across;
pub mod builder;
pub mod layout;
pub mod merge;
pub mod quality;
pub mod termination;
pub mod twin;
pub mod validate;
