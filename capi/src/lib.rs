//! The C ABI of [`hedgerow`]: `hedgerow.h`, a shared and a static library.
//!
//! The functions take the structs and handles of `<vulkan/vulkan.h>`, which those of [`hedgerow::ash::vk`] are bit for bit,
//! and are the calls of the crate, nothing more: what each does is said there.
//!
//! - [`requirements`](hedgerow_create_requirements) lists what a device needs, [`context`](hedgerow_create_context) wraps it;
//! - [`accel`](hedgerow::accel) has the functions of `VK_KHR_acceleration_structure`;
//! - `copy` has those that copy structures and write their properties;
//! - [`trace`](hedgerow_cmd_trace_rays) traces a buffer of rays;
//! - [`status`](hedgerow_last_error_message) turns errors, null pointers and panics into what C can look at.
//!
//! `build.rs` writes the header from these files; `examples/trace.c` is a program that uses it.
#![warn(missing_docs)]

mod accel;
mod context;
mod copy;
mod loader;
mod pointers;
mod requirements;
mod status;
mod trace;
mod vulkan;

pub use accel::*;
pub use context::*;
pub use copy::*;
pub use requirements::*;
pub use status::hedgerow_last_error_message;
pub use trace::*;
