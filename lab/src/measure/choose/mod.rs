//! Which builder for a scene and so many rays a build, before anything is built: `auto`.
//!
//! The device is measured once ([`calibration`]): every candidate ([`candidates`]) builds and traces a few generated scenes. What
//! rays do there is counted and has its [`prices`]. A [`model`] of these figures tells build time and time of a ray on a scene by
//! its [`features`]: triangles, how their boxes lie, and what reinsertion gains on a sample of them. The choice is the least of
//! build + rays · ray. The figures are kept in a file ([`cache`]), and [`hindsight`] holds choices against what was measured afterwards.

mod auto;
pub mod cache;
pub mod calibration;
pub mod candidates;
pub mod features;
pub mod hindsight;
pub mod model;
pub mod prices;
mod ridge;
mod sample;

pub use auto::{Auto, DEFAULT_RAYS, rays_of};
pub use features::Features;
pub use model::{Estimate, Model};
