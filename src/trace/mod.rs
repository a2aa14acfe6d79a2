//! Rays and hits: the tracer on the device, and the tracer and brute force on the host.
//!
//! A hit is a property of a ray and a triangle alone: [`triangle`] defines it, ties go to the lower primitive index, and
//! [`slab`] proves that a box test never hides one. So every tree over the same triangles, traversed in any order, gives the
//! same [`Hit`]s, bit for bit, and they are those of [`twin::tracer::closest_hit_by_brute_force`].
//!
//! - [`ray`] prepares a ray: shear, reciprocals, error bounds;
//! - [`determinant`], [`triangle`], [`slab`] are the arithmetic, each the twin of a file in `glsl/trace/`;
//! - [`tracer`] traverses on the device, [`wide`] in wide trees, [`bottom_level`] in either, [`kd`] in kd-trees;
//! - [`counts`] says where rays go in a tree, [`flux`] where in space; [`trial`] takes the better of two trees;
//! - [`twin`] does the same on the host.

pub mod bottom_level;
pub mod counts;
pub mod determinant;
pub mod flux;
pub mod kd;
pub mod ray;
pub mod slab;
pub mod tracer;
pub mod trial;
pub mod triangle;
pub mod twin;
pub mod wide;

use bytemuck::{Pod, Zeroable};

/// The most rays that one call traces.
pub const MAX_RAYS: u32 = 1 << 27;

/// A ray, 32 bytes, as ray files hold it (CONTRACT, "Ray files").
///
/// A ray hits nothing if a component of origin or direction is NaN or infinite, if the largest
/// component of the direction has no magnitude between 2⁻¹⁰⁰ and 2¹⁰⁰, or if `t_min ≤ t_max` does not hold.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Ray {
    /// The origin.
    pub origin: [f32; 3],
    /// A hit counts when `t_min < t < t_max`.
    pub t_min: f32,
    /// The direction; its length is the unit of `t` and need not be 1.
    pub direction: [f32; 3],
    /// See `t_min`.
    pub t_max: f32,
}

/// A hit, 16 bytes, as hit files hold it.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Hit {
    /// Distance in units of the direction; +inf for none. Any-hit: 0 for a hit, +inf for none.
    pub t: f32,
    /// Primitive index; [`Hit::NONE`] has `u32::MAX`.
    pub primitive: u32,
    /// Barycentric weight of the second vertex.
    pub u: f32,
    /// Barycentric weight of the third vertex.
    pub v: f32,
}

impl Hit {
    /// No hit.
    pub const NONE: Hit = Hit { t: f32::INFINITY, primitive: u32::MAX, u: 0.0, v: 0.0 };

    /// Whether it is a hit.
    pub fn is_some(&self) -> bool {
        self.primitive != u32::MAX
    }
}

/// The work of tracing one ray, 12 bytes. All figures count steps and tests in this way.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Work {
    /// Inner nodes visited (each tests the boxes of its children: two, four or eight; of a kd-tree, its plane).
    pub steps: u32,
    /// Triangles tested.
    pub tests: u32,
    /// Leaves visited.
    pub leaves: u32,
}

/// Which hit a ray looks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Query {
    /// The nearest hit between `t_min` and `t_max`.
    ClosestHit,
    /// Whether there is a hit at all.
    AnyHit,
}
