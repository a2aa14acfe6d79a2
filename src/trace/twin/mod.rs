//! The tracers on the host, plainly: the same hits, the same work and the same counts as on the device.

pub mod counts;
pub mod kd;
pub mod tracer;
pub mod wide;
