//! Builders on the host: plain, and the specification of those on the device.

mod build;
mod child_order;
mod clusters;
mod collapse;
mod compact;
pub mod epo;
mod far;
pub mod geometry;
pub mod hlbvh;
pub mod hploc;
pub mod lbvh;
mod over;
pub mod pairs;
pub mod ploc;
pub mod quality;
pub mod refit;
pub mod reinsertion;
pub mod split;
pub mod wide;

pub use build::{build, build_within};
