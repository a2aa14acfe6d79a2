//! Builders on the host: plain, and the specification of those on the device.

pub mod geometry;
pub mod lbvh;
