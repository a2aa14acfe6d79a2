//! Upright prisms over a footprint of square cells.

use crate::scene::Mesh;
use std::collections::HashMap;

/// The closed surface over the cells of a `cells` × `cells` raster that the footprint holds, `rows` high, facing outwards.
///
/// The raster is the unit square about the y axis, the height runs from 0 to 1. Every face of a cell is two triangles;
/// corners are shared.
pub fn closed(cells: u32, rows: u32, footprint: impl Fn(u32, u32) -> bool) -> Mesh {
    let mut surface = Surface { cells, rows, corners: HashMap::new(), mesh: Mesh::default() };
    // Whether a cell is there; those around the raster are not.
    let is_there = |x: u32, z: u32| x < cells && z < cells && footprint(x, z);
    for z in 0..cells {
        for x in (0..cells).filter(|&x| footprint(x, z)) {
            surface.face([[x, 0, z], [x + 1, 0, z], [x + 1, 0, z + 1], [x, 0, z + 1]]);
            surface.face([[x, rows, z], [x, rows, z + 1], [x + 1, rows, z + 1], [x + 1, rows, z]]);
            // The ends of each edge of the cell, in the order that lets a wall over them face outwards, and whether there is
            // a cell beyond it.
            let edges = [
                ([x, z + 1], [x, z], is_there(x.wrapping_sub(1), z)),
                ([x + 1, z], [x + 1, z + 1], is_there(x + 1, z)),
                ([x, z], [x + 1, z], is_there(x, z.wrapping_sub(1))),
                ([x + 1, z + 1], [x, z + 1], is_there(x, z + 1)),
            ];
            for ([ax, az], [bx, bz], _) in edges.into_iter().filter(|(.., inside)| !inside) {
                for y in 0..rows {
                    surface.face([[ax, y, az], [ax, y + 1, az], [bx, y + 1, bz], [bx, y, bz]]);
                }
            }
        }
    }
    surface.mesh
}

struct Surface {
    cells: u32,
    rows: u32,
    /// The vertex of each corner of the raster that has one.
    corners: HashMap<[u32; 3], u32>,
    mesh: Mesh,
}

impl Surface {
    fn face(&mut self, corners: [[u32; 3]; 4]) {
        let quad = corners.map(|corner| self.vertex(corner));
        self.mesh.add_quad(quad);
    }

    fn vertex(&mut self, corner: [u32; 3]) -> u32 {
        let (cells, rows, positions) = (self.cells, self.rows, &mut self.mesh.positions);
        *self.corners.entry(corner).or_insert_with(|| {
            let [x, y, z] = corner.map(|c| c as f32);
            positions.push([x / cells as f32 - 0.5, y / rows as f32, z / cells as f32 - 0.5]);
            positions.len() as u32 - 1
        })
    }
}
