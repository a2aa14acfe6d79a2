//! What every room measures with: axis-aligned boxes, and polygons that they are cut at.

mod aabb;
mod polygon;

pub use aabb::Aabb;
pub(crate) use polygon::Polygon;
