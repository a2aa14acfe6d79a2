//! The laboratory of `hedgerow`: scenes, rays, builders of the library and of others, and what they are measured by.
//!
//! 1. [`scene`] reads triangles from files or generates them;
//! 2. [`device`] opens a Vulkan device, with its memory;
//! 3. [`rays`] makes the rays that are measured, and reads and writes files of them;
//! 4. [`measure`] turns builds and hits into figures, finds where methods give way (`stability`) and which to take (`choose`);
//! 5. [`report`] turns figures into tables and charts;
//! 6. [`cli`] is the binary's commands.
#![warn(missing_docs)]

#[doc(hidden)]
pub mod arguments;
pub mod cli;
pub mod device;
mod error;
pub mod measure;
pub mod random;
pub mod rays;
pub mod report;
pub mod scene;
pub mod shaders;

pub use error::{Error, Result};
