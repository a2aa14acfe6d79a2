//! The tracers on the host, plainly: the same hits, the same work and the same counts as on the device.

pub mod counts;
pub mod flux;
pub mod kd;
pub mod tracer;
pub mod trial;
pub mod wide;
