//! Bounding volume hierarchies: codes, node layouts, builders on the device, and their twins.
//!
//! The way of a triangle, each step a file here and shaders of the same name in `glsl/bvh`:
//!
//! 1. [`geometry`] is what a caller gives; [`split`] makes several references of a large triangle, if asked;
//! 2. `encode` finds bounds, computes [`codes`] and sorts by them;
//! 3. `lbvh`, `hlbvh`, `ploc` or `hploc` makes the tree; [`builder`] is where a caller chooses;
//! 4. [`reinsertion`] makes it better, if asked, by area or by the [`flux`] of rays;
//! 5. `collapse` makes leaves where they are cheaper ([`sah`]) and orders the records: a [`layout::Bvh2`];
//! 6. [`wide`] makes nodes of four or eight children of it, [`refit`] follows moved vertices, [`compact`] gives back room,
//!    [`child_order`] says which child rays look into first that end at any hit.
//!
//! What came of it: [`quality`] and [`epo`] measure, [`validate`] checks. [`twin`] has a twin of every step, with the same bytes.

pub mod builder;
pub mod child_order;
pub mod codes;
mod collapse;
pub mod compact;
pub mod counts;
pub(crate) mod cover;
pub(crate) mod encode;
pub mod epo;
pub mod far;
pub mod flux;
pub mod geometry;
mod hlbvh;
mod hploc;
pub mod layout;
mod lbvh;
pub(crate) mod lbvh_workgroup;
mod method;
mod ploc;
pub mod quality;
pub mod refit;
pub mod reinsertion;
pub mod sah;
mod scratch;
pub mod split;
pub mod twin;
pub mod validate;
pub mod wide;
