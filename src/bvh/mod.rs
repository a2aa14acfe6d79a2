//! Bounding volume hierarchies: node layouts, builders on the device, and their twins on the host.

pub mod host;
pub mod layout;
