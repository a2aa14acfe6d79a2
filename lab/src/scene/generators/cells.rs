//! Spheres in a grid: instances whose boxes do not overlap, for which a top-level structure has nothing to open.

use super::{Assembly, meshes, side_of, turns};
use crate::random::SplitMix64;

/// Edge of a cell.
const CELL: f32 = 2.0;
/// Radii, uniform between these; a sphere's box stays in its cell, whichever way the sphere is turned.
const RADIUS: [f32; 2] = [0.5, 0.9];

/// `count` spheres of 80, 320 or 1,280 triangles, one in the middle of each cell of a cube of cells, in rows.
pub fn place(count: u32) -> Assembly {
    let parts: Vec<_> = (1..=3).map(meshes::icosphere).collect();
    let mut random = SplitMix64::new(0);
    let side = side_of(count, 3);
    let instances = (0..count).map(|i| {
        let cell = [i % side, i / side % side, i / (side * side)];
        let part = random.bits() as usize % parts.len();
        let radius = random.within(RADIUS[0], RADIUS[1]);
        turns::upright(part, [radius; 3], turns::any(&mut random), cell.map(|c| (c as f32 + 0.5) * CELL))
    });
    let instances = instances.collect();
    (parts, instances)
}
