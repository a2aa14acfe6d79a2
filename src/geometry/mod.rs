//! What every room measures with: axis-aligned boxes.

mod aabb;

pub use aabb::Aabb;
