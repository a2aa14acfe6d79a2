//! Rays and hits: ray kinds, the tracer on the device, and the tracer and brute force on the host.

use bytemuck::{Pod, Zeroable};

/// A ray, 32 bytes, as ray files hold it (CONTRACT, "Ray files").
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Ray {
    /// Where it starts.
    pub origin: [f32; 3],
    /// A hit counts when `t_min < t < t_max`.
    pub t_min: f32,
    /// Where it goes; need not be of unit length, `t` is in its units.
    pub direction: [f32; 3],
    /// See `t_min`.
    pub t_max: f32,
}

/// What a ray met, 16 bytes, as hit files hold it.
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

    /// Whether something was met.
    pub fn is_some(&self) -> bool {
        self.primitive != u32::MAX
    }
}

/// Work that tracing one ray took: what "steps" and "tests" mean in every figure.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Work {
    /// Inner nodes visited (each tests the boxes of its two children).
    pub steps: u32,
    /// Triangles tested.
    pub tests: u32,
}

/// Whether the nearest hit is wanted or any.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Query {
    /// The nearest hit between `t_min` and `t_max`.
    ClosestHit,
    /// Whether there is a hit at all.
    AnyHit,
}
