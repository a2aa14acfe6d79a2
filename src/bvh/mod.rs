//! Bounding volume hierarchies: codes, node layouts, builders on the device, and their twins on the host.

pub mod builder;
pub mod codes;
mod collapse;
pub mod compact;
mod cover;
pub(crate) mod encode;
pub mod epo;
pub mod geometry;
mod hlbvh;
pub mod host;
mod hploc;
pub mod layout;
mod lbvh;
pub(crate) mod lbvh_workgroup;
mod ploc;
pub mod quality;
pub mod refit;
pub mod reinsertion;
pub mod sah;
pub mod split;
pub mod validate;
pub mod wide;
