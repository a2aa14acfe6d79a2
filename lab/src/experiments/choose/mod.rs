//! Which builder for a scene and a number of rays per build, before anything is built: `auto`.
//!
//! [`calibration`] measures the device once: every candidate ([`candidates`]) builds and traces generated scenes of several
//! sizes. A [`CostTable`] holds what they took, for scenes of each size whose codes tell triangles apart and for those whose
//! codes do not. For a scene, [`auto`](crate::subjects::auto) looks up its [`SceneClass`] there and takes the candidate with
//! the least of build + rays · ray. [`cache`] keeps the table in a file, and [`hindsight`] compares choices with what was
//! measured afterwards.

pub mod cache;
pub mod calibration;
pub mod candidates;
mod class;
pub(crate) mod command;
mod costs;
pub mod hindsight;
pub(crate) mod page;

pub use class::SceneClass;
pub use costs::{Cost, CostRow, CostTable, SceneCost};
