//! Builders that run on the CPU in their own right, with as many threads as rayon has.
//!
//! The library's own host code (`hedgerow::bvh::twin`, `hedgerow::kdtree::twin`) says what a device pass computes, on one thread.
//! What is here is for tools that build on the CPU, and is what the builders of the device are measured against.
//!
//! - [`bvh`]: BVHs, by every method that Frantál 2019 compares and by splitting triangles, by area or by rays, and what makes them
//!   better;
//! - [`kdtree`]: kd-trees by perfect splits and by bins, and merging of one into another.
#![warn(missing_docs)]

pub mod bvh;
pub mod kdtree;
