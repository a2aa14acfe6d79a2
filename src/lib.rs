//! Acceleration structures for ray tracing, built and traced with Vulkan compute shaders.
//!
//! The library takes your device, your command buffer and your memory. It makes pipelines and records dispatches, nothing else.
//!
//! ```
//! use hedgerow::bvh::builder::{BuildOptions, Builder, Input};
//! use hedgerow::trace::{Hit, Query, Ray, tracer};
//! # use hedgerow_lab::device::{Device, DeviceOptions};
//!
//! # fn main() -> Result<(), hedgerow_lab::Error> {
//! // Here the device and the buffers are the laboratory's. An engine brings its own: see `gpu::Context`.
//! let device = Device::new(&DeviceOptions::default())?;
//! let vertices = device.upload("vertices", &[[0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])?;
//! let indices = device.upload("indices", &[[0u32, 1, 2]])?;
//! let ray = Ray { origin: [0.25, 0.25, -2.0], t_min: 0.0, direction: [0.0, 0.0, 1.0], t_max: 10.0 };
//! let (rays, hits) = (device.upload("rays", &[ray])?, device.upload("hits", &[Hit::NONE])?);
//!
//! let triangles = Input::mesh(vertices.address(), 3, indices.address(), 1);
//! let builder = Builder::new(&device, &BuildOptions::DEFAULT, triangles.primitive_count)?;
//! let structure = device.buffer("structure", builder.sizes().structure)?;
//! let scratch = device.buffer("scratch", builder.sizes().scratch)?;
//! device.run(None, |recorder| {
//!     builder.record(recorder, &triangles, structure.region(), scratch.region())?;
//!     recorder.barrier();
//!     let (rays, hits) = (rays.region(), hits.region());
//!     let buffers = tracer::TraceBuffers { structure: structure.address(), rays, hits, work: None, count: 1 };
//!     tracer::record(recorder, &tracer::TraceShape::of(&device), Query::ClosestHit, &buffers)
//! })?;
//! assert_eq!(hits.read::<Hit>(1)[0].t, 2.0);
//! # Ok(())
//! # }
//! ```
//!
//! Six chapters, in the order in which a triangle walks through them:
//!
//! 1. [`geometry`] has the boxes that everything is measured with;
//! 2. [`gpu`] wraps a device and records passes into a command buffer;
//! 3. [`bvh`] turns triangles into codes, codes into an order, the order into a hierarchy, and that into a [`bvh::layout`];
//! 4. [`kdtree`] turns them into a kd-tree instead;
//! 5. [`accel`] does what [`bvh`] does, by the calls and structs of `VK_KHR_acceleration_structure`;
//! 6. [`trace`] finds the hits of rays.
#![warn(missing_docs)]

pub mod accel;
pub mod bvh;
mod error;
pub mod geometry;
pub mod gpu;
pub mod kdtree;
pub mod trace;

pub use ash;
pub use error::{Error, Result};

/// The code of these pages compiles.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
#[doc = include_str!("../docs/linking.md")]
#[doc = include_str!("../docs/engines.md")]
struct Pages;
