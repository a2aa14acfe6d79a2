//! Acceleration structures for ray tracing, built and traced with Vulkan compute shaders.
//!
//! The rooms, in the order in which a triangle walks through them:
//!
//! 1. [`gpu`] records passes into a command buffer: reductions, scans, sorts, the task pool;
//! 2. [`bvh`] turns triangles into codes, codes into an order, the order into a hierarchy, and that into a [`bvh::layout`];
//! 3. [`kdtree`] turns them into a kd-tree instead;
//! 4. [`accel`] does what [`bvh`] does by the calls and structs of `VK_KHR_acceleration_structure`;
//! 5. [`trace`] finds the hits of rays in it.
#![warn(missing_docs)]

pub mod accel;
pub mod bvh;
mod error;
pub mod gpu;
pub mod kdtree;
pub mod trace;

pub use ash;
pub use error::{Error, Result};

/// The code of these pages compiles.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
#[doc = include_str!("../docs/linking.md")]
struct Pages;
