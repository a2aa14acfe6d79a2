//! A column that is twisted more from frame to frame: a tree that is only refitted grows worse, one that is built again does
//! not.

use super::turns::turned;
use super::{prism, series};
use crate::scene::Mesh;
use std::f64::consts::TAU;

/// Two for each side of a box.
pub const LEAST_TRIANGLES: u64 = 12;
/// Of the column, whose cross-section is the unit square.
const HEIGHT: f32 = 4.0;

/// The straight column: a closed box whose sides are cut in cells, nearly square ones. Its triangles are `triangles` up to
/// ±√`triangles`.
pub fn column(triangles: u32) -> Mesh {
    // With c cells across and r rows there are 8cr + 4c² triangles; r = 4c makes the cells square.
    let cells = (triangles / 36).isqrt().max(1);
    let rows = ((triangles - 4 * cells * cells + 4 * cells) / (8 * cells)).max(1);
    let mut mesh = prism::closed(cells, rows, |_, _| true);
    for position in &mut mesh.positions {
        position[1] *= HEIGHT;
    }
    mesh
}

/// The column's vertices in each frame. The foot stands still, the top is turned by an angle that grows evenly from 0 in the
/// first frame to a whole turn in the last, and what is between by its share of the height.
pub fn frames(column: &Mesh, count: u32) -> Vec<Vec<[f32; 3]>> {
    let frame = |frame: u32| {
        let angle = TAU * f64::from(frame) / f64::from(count.max(2) - 1);
        let twisted = column.positions.iter().map(|&[x, y, z]| {
            let turn = series::turn(angle * f64::from(y / HEIGHT)).map(|c| c as f32);
            let [x, z] = turned(turn, [x, z]);
            [x, y, z]
        });
        twisted.collect()
    };
    (0..count).map(frame).collect()
}
