//! Tubes: polygons swept along a path.

use super::{series, unit};
use crate::scene::Mesh;
use glam::Vec3;
use std::f64::consts::TAU;

/// A point of a path, and how thick the tube is there.
#[derive(Clone, Copy)]
pub struct Knot {
    pub at: Vec3,
    pub radius: f32,
}

/// Adds a tube of `sides` sides around `path` (two points or more, no two in a row the same), open at its ends:
/// 2·`sides` triangles between two points, facing outwards.
pub fn append(mesh: &mut Mesh, sides: u32, path: &[Knot]) {
    let spokes: Vec<[f32; 2]> =
        (0..sides).map(|k| series::turn(TAU * f64::from(k) / f64::from(sides)).map(|c| c as f32)).collect();
    let first = mesh.positions.len() as u32;
    let mut aside = Vec3::ZERO;
    for (i, knot) in path.iter().enumerate() {
        let (before, after) = (path[i.saturating_sub(1)].at, path[(i + 1).min(path.len() - 1)].at);
        let tangent = unit(after - before);
        if i == 0 {
            // Any direction that is not the tangent's.
            let least = (0..3).min_by(|&a, &b| tangent[a].abs().total_cmp(&tangent[b].abs())).unwrap_or_default();
            aside[least] = 1.0;
        }
        // Carried along from ring to ring, so that the tube does not twist.
        aside = unit(aside - aside.dot(tangent) * tangent);
        let other = tangent.cross(aside);
        let corner = |[c, s]: &[f32; 2]| knot.at + knot.radius * c * aside + knot.radius * s * other;
        mesh.positions.extend(spokes.iter().map(|spoke| corner(spoke).to_array()));
    }
    join_rings(mesh, first, sides, path.len() as u32);
}

/// Adds the quads between rings that lie one after the other from vertex `first` on, each of `sides` vertices.
pub fn join_rings(mesh: &mut Mesh, first: u32, sides: u32, rings: u32) {
    for ring in 0..rings - 1 {
        for side in 0..sides {
            let at = |ring, side| first + ring * sides + side % sides;
            mesh.add_quad([at(ring, side), at(ring, side + 1), at(ring + 1, side + 1), at(ring + 1, side)]);
        }
    }
}
