//! The laboratory of `hedgerow`: scenes, rays, builders of the library and of others, and what they are measured by.
//!
//! 1. [`scene`] reads triangles from files or generates them;
//! 2. [`device`] opens a Vulkan device, with its memory;
//! 3. [`rays`] makes the rays that are measured, and reads and writes files of them;
//! 4. [`subjects`] is what is measured: builders of ours, of the host and of others, behind one interface;
//! 5. [`measure`] makes figures fair and keeps them as records;
//! 6. [`report`] turns figures into tables, charts and pages;
//! 7. [`experiments`] has a folder for each experiment: its measuring, its records, its page and its command;
//! 8. [`cli`] has the options that commands share, and the commands that print and keep nothing else;
//! 9. [`program`] is the binary: the list of all commands.
#![warn(missing_docs)]

#[doc(hidden)]
pub mod arguments;
pub mod cli;
pub mod device;
mod error;
pub mod experiments;
pub mod measure;
mod named;
pub mod program;
pub mod random;
pub mod rays;
pub mod report;
pub mod scene;
pub mod shaders;
pub mod subjects;

pub use error::{Error, Result};
