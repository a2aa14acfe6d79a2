//! Acceleration structures for ray tracing, built and traced with Vulkan compute shaders, and measured.
//!
//! The rooms, in the order in which a triangle walks through them:
//!
//! 1. [`scene`] reads triangles from files or generates them;
//! 2. [`gpu`] records passes into a command buffer: reductions, scans, sorts, the task pool;
//! 3. [`bvh`] turns triangles into codes, codes into an order, the order into a hierarchy, and that into a [`bvh::layout`];
//! 4. [`kdtree`] turns them into a kd-tree instead;
//! 5. [`accel`] does what [`bvh`] does by the calls and structs of `VK_KHR_acceleration_structure`;
//! 6. [`trace`] finds the hits of rays in it;
//! 7. [`measure`] turns builds and hits into figures, finds where methods give way (`stability`) and which to take (`choose`);
//! 8. [`report`] turns figures into tables and charts;
//! 9. [`cli`] is the binary's commands.
//!
//! An engine needs [`gpu`], [`bvh`], [`kdtree`], [`accel`] and [`trace`] alone (`default-features = false`).
#![warn(missing_docs)]
// Without the feature, the rooms of the binary are named above and not there.
#![cfg_attr(not(feature = "cli"), allow(rustdoc::broken_intra_doc_links))]

pub mod accel;
pub mod bvh;
#[cfg(feature = "cli")]
pub mod cli;
mod error;
pub mod gpu;
pub mod kdtree;
#[cfg(all(test, feature = "cli", feature = "compile-shaders"))]
mod layouts;
#[cfg(feature = "cli")]
pub mod measure;
#[cfg(feature = "cli")]
pub mod report;
#[cfg(feature = "cli")]
pub mod scene;
pub mod trace;

pub use ash;
pub use error::{Error, Result};

/// The README's code compiles.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
