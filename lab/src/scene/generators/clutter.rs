//! Things of all sizes in a room: what interiors have in common. Large walls, and clumps of round, flat, boxy and long things,
//! turned any way, some fine and some coarse.

use super::{series, unit};
use crate::random::SplitMix64;
use crate::scene::Mesh;
use glam::Vec3;
use std::f64::consts::{PI, TAU};

/// Cells around and along a thing: each has those of its place in the row, again and again.
const CELLS: [[u32; 2]; 6] = [[4, 3], [8, 6], [16, 12], [48, 4], [24, 24], [2, 2]];
/// Triangles of a floor and two walls.
const WALLS: u64 = 6;

/// How many triangles a [`clutter`] has.
pub fn triangles(things: u64) -> Option<u64> {
    let of = |cells: &[[u32; 2]]| cells.iter().map(|&[u, v]| 2 * u64::from(u) * u64::from(v)).sum::<u64>();
    let (rows, rest) = (things / CELLS.len() as u64, things % CELLS.len() as u64);
    rows.checked_mul(of(&CELLS))?.checked_add(of(&CELLS[..rest as usize]) + WALLS)
}

/// `things` things in a room 2 wide, 0.8 high and 2 deep.
pub fn clutter(things: u32, seed: u64) -> Mesh {
    let mut random = SplitMix64::new(seed);
    let mut mesh = room();
    let (mut middle, mut size) = (0.4 * Vec3::Y, 0.0);
    for i in 0..things {
        // Every other one is near the one before.
        middle = if i % 2 == 1 {
            middle + 1.5 * size * unit(Vec3::from(random.point(-1.0, 1.0)) + 1e-3 * Vec3::Y)
        } else {
            Vec3::new(random.within(-0.9, 0.9), random.within(0.05, 0.75), random.within(-0.9, 0.9))
        };
        // From 0.01 to 0.35, most of them small.
        let smaller = random.unit();
        size = 0.35 / (1.0 + 34.0 * smaller * smaller);
        let extent: [f32; 3] = std::array::from_fn(|_| size / (1.0 + 2.0 * random.unit()));
        let axes = frame(&mut random);
        let cells = CELLS[i as usize % CELLS.len()];
        append(&mut mesh, cells, |u, v| {
            let p = point_of(i / CELLS.len() as u32, u, v);
            (0..3).fold(middle, |at, k| at + p[k] * extent[k] * axes[k])
        });
    }
    mesh
}

/// A floor and two walls; the camera looks in from the open sides.
fn room() -> Mesh {
    let corner = |i: u32| [0, 1, 2].map(|k| if i >> k & 1 == 0 { [-1.0, 0.0, -1.0][k] } else { [1.0, 0.8, 1.0][k] });
    let quads = [[0, 1, 5, 4], [0, 2, 3, 1], [0, 4, 6, 2]];
    Mesh {
        positions: (0..8).map(corner).collect(),
        triangles: quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
    }
}

/// Three directions at right angles.
fn frame(random: &mut SplitMix64) -> [Vec3; 3] {
    // Never both zero or in one line: they differ from two axes by less than half.
    let a = unit(Vec3::X + Vec3::from(random.point(-0.45, 0.45)));
    let b = Vec3::Y + Vec3::from(random.point(-0.45, 0.45));
    let c = unit(a.cross(b));
    [a, c.cross(a), c]
}

/// A point of a thing's surface, u around and v along, both in 0..1.
fn point_of(kind: u32, u: f32, v: f32) -> [f32; 3] {
    let [cos, sin] = series::turn(TAU * f64::from(u)).map(|c| c as f32);
    let [height, radius] = series::turn(PI * f64::from(v)).map(|c| c as f32);
    let round = [radius * cos, height, radius * sin];
    match kind % 4 {
        0 => round,
        // A box with round edges.
        1 => round.map(|c| (1.6 * c).clamp(-0.8, 0.8)),
        // A pipe.
        2 => [0.15 * cos, 2.0 * v - 1.0, 0.15 * sin],
        // A wavy sheet.
        _ => [2.0 * u - 1.0, 0.2 * cos * height, 2.0 * v - 1.0],
    }
}

/// Adds a net of cells, two triangles each, over u and v in 0..1.
fn append(mesh: &mut Mesh, [around, long]: [u32; 2], point: impl Fn(f32, f32) -> Vec3) {
    let first = mesh.positions.len() as u32;
    for j in 0..=long {
        let v = j as f32 / long as f32;
        mesh.positions.extend((0..=around).map(|i| point(i as f32 / around as f32, v).to_array()));
    }
    for cell in 0..around * long {
        let v = first + cell / around * (around + 1) + cell % around;
        let above = v + around + 1;
        mesh.triangles.extend([[v, v + 1, above], [v + 1, above + 1, above]]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_are_counted_before_they_are_made() {
        for things in 0..20 {
            let mesh = clutter(things, 3);
            assert_eq!(Some(mesh.triangles.len() as u64), triangles(things.into()), "{things} things");
            assert!(mesh.positions.iter().flatten().all(|c| c.is_finite()));
            assert!(mesh.triangles.iter().flatten().all(|&v| (v as usize) < mesh.positions.len()));
        }
    }

    #[test]
    fn frames_are_at_right_angles() {
        let mut random = SplitMix64::new(1);
        for _ in 0..1000 {
            let axes = frame(&mut random);
            for (i, j) in [(0, 1), (0, 2), (1, 2), (0, 0), (1, 1), (2, 2)] {
                let dot: f32 = (0..3).map(|k| axes[i][k] * axes[j][k]).sum();
                assert!((dot - f32::from(u8::from(i == j))).abs() < 1e-5, "{axes:?}");
            }
        }
    }
}
