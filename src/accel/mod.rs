//! Acceleration structures by the calls and structs of `VK_KHR_acceleration_structure`, on any device with compute shaders.
//!
//! [`Device`] stands where an engine has `ash::khr::acceleration_structure::Device`: the same methods take the same structs
//! of [`ash::vk`] and record compute dispatches. There are bottom-level structures of triangles, built on the device; what
//! else the structs can ask for is refused with an error that names the field.
//!
//! A handle is the structure's device address, in the type that the structs want: it owns nothing, and lives as long as the
//! buffer that it lies in. That buffer needs `STORAGE_BUFFER` and `SHADER_DEVICE_ADDRESS` usage, and so does scratch memory,
//! whose address must be a multiple of [`SCRATCH_ALIGNMENT`]. Builds read and write in compute shaders: where the driver's
//! want the stage `ACCELERATION_STRUCTURE_BUILD` in a barrier, these want `COMPUTE_SHADER` with `SHADER_READ` and
//! `SHADER_WRITE`.
//!
//! Of the build flags, both preferences give an LBVH whose subtrees are leaves where that is cheaper; the others are refused.

mod device;
mod geometry;

pub use device::{Device, SCRATCH_ALIGNMENT, STRUCTURE_ALIGNMENT};

#[cfg(all(test, feature = "cli", feature = "compile-shaders"))]
pub(crate) use device::push_constants;
