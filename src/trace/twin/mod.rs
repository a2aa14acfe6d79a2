//! The tracers on the host, plainly: the same hits and the same work as on the device.

pub mod kd;
pub mod tracer;
pub mod wide;
