//! Bounding volume hierarchies: codes, node layouts, builders on the device, and their twins on the host.

pub mod codes;
pub mod compact;
pub mod geometry;
pub mod host;
pub mod layout;
pub mod lbvh;
pub(crate) mod lbvh_workgroup;
pub mod quality;
pub mod refit;
pub mod sah;
pub mod validate;
pub mod wide;
