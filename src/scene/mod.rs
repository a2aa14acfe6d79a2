//! Scenes: triangles, a camera and lights, from files or generators. What measuring needs and nothing else.

use crate::bvh::layout::Aabb;

/// A scene, ready to build.
#[derive(Debug, Clone)]
pub struct Scene {
    /// The name as records carry it: the file's stem (`sponza`) or the generator with its arguments.
    pub name: String,
    /// The triangles.
    pub mesh: Mesh,
    /// Where to look from.
    pub camera: Camera,
    /// Lights of the file; may be empty.
    pub lights: Vec<Light>,
}

/// An indexed triangle mesh.
#[derive(Debug, Clone, Default)]
pub struct Mesh {
    /// Vertex positions, all finite.
    pub positions: Vec<[f32; 3]>,
    /// Three vertex indices a triangle, all in range, in the order of the file: the primitive index is the position here.
    pub triangles: Vec<[u32; 3]>,
}

/// A pinhole camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Where the camera is.
    pub eye: [f32; 3],
    /// What it looks at.
    pub look: [f32; 3],
    /// Which way is up.
    pub up: [f32; 3],
    /// Vertical field of view in degrees.
    pub fov: f32,
}

/// A parallelogram that sends light: points are `corner + a·edges[0] + b·edges[1]`, a and b in 0..1.
/// A point light has two zero edges.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Light {
    /// One corner.
    pub corner: [f32; 3],
    /// The two edges from it.
    pub edges: [[f32; 3]; 2],
}

impl Mesh {
    /// The box around all triangles (vertices that no triangle uses do not count).
    pub fn bounds(&self) -> Aabb {
        self.triangles.iter().fold(Aabb::EMPTY, |b, t| b.union(&Aabb::around(&t.map(|v| self.positions[v as usize]))))
    }

    /// The corners of a triangle.
    pub fn corners(&self, triangle: usize) -> [[f32; 3]; 3] {
        self.triangles[triangle].map(|v| self.positions[v as usize])
    }
}
