//! Trees whose crowns reach into each other: thin trunks in large boxes that are mostly empty and overlap on every side.

use super::tube::{self, Knot};
use super::vector::{add, along, unit};
use super::{Placed, side_of, turns};
use crate::scene::{Mesh, SplitMix64};

/// Metres from tree to tree: less than a crown is wide.
const PITCH: f32 = 3.5;
/// Metres that a tree stands off its place at most, in x and in z.
const JITTER: f32 = 1.0;

/// A kind of tree; lengths in metres.
struct Tree {
    height: f32,
    branches: u32,
    /// Of the lowest branches.
    branch_length: f32,
    /// On each branch.
    leaves: u32,
}

/// Of 508, 1,060 and 1,972 triangles.
const TREES: [Tree; 3] = [
    Tree { height: 10.0, branches: 12, branch_length: 3.0, leaves: 10 },
    Tree { height: 12.0, branches: 24, branch_length: 3.8, leaves: 16 },
    Tree { height: 15.0, branches: 36, branch_length: 4.4, leaves: 28 },
];

/// `count` trees on a square, row by row, each a little off its place, turned and scaled.
pub fn place(count: u32) -> Placed {
    let mut random = SplitMix64::new(0);
    let parts: Vec<Mesh> = TREES.iter().map(|tree| grow(tree, &mut random)).collect();
    let side = side_of(count, 2);
    let instances = (0..count).map(|i| {
        let part = random.bits() as usize % parts.len();
        let scale = random.within(0.8, 1.25);
        let turn = turns::any(&mut random);
        let [x, z] = [i % side, i / side].map(|c| c as f32 * PITCH + random.within(-JITTER, JITTER));
        turns::upright(part, [scale; 3], turn, [x, 0.0, z])
    });
    let instances = instances.collect();
    (parts, instances)
}

/// A tree that stands on the origin: a trunk, branches off it on all sides, and leaves about their outer halves.
fn grow(tree: &Tree, random: &mut SplitMix64) -> Mesh {
    const TRUNK_SEGMENTS: u32 = 10;
    const BRANCH_SEGMENTS: u32 = 4;
    let mut mesh = Mesh::default();
    let mut foot = [0.0; 3];
    let trunk: Vec<Knot> = (0..=TRUNK_SEGMENTS)
        .map(|i| {
            let up = i as f32 / TRUNK_SEGMENTS as f32;
            foot = [foot[0] + random.within(-0.08, 0.08), up * tree.height, foot[2] + random.within(-0.08, 0.08)];
            Knot { at: foot, radius: 0.02 * tree.height * (1.0 - 0.9 * up) }
        })
        .collect();
    tube::append(&mut mesh, 5, &trunk);
    for branch in 0..tree.branches {
        // The lowest third of the trunk is bare.
        let up = 0.3 + 0.65 * (branch as f32 + random.unit()) / tree.branches as f32;
        let [c, s] = turns::any(random);
        let mut direction = unit([c, random.within(0.1, 0.5), s]);
        let length = tree.branch_length * (1.25 - 0.8 * up) * random.within(0.8, 1.2);
        let mut at = on(&trunk, up);
        let radius = 0.006 * tree.height * (1.2 - up);
        let knots: Vec<Knot> = (0..=BRANCH_SEGMENTS)
            .map(|i| {
                if i > 0 {
                    at = along(at, length / BRANCH_SEGMENTS as f32, direction);
                    // Branches bend, and up rather than down.
                    direction = unit(add(direction, add(random.point(-0.25, 0.25), [0.0, 0.1, 0.0])));
                }
                Knot { at, radius: radius * (1.0 - 0.8 * i as f32 / BRANCH_SEGMENTS as f32) }
            })
            .collect();
        tube::append(&mut mesh, 3, &knots);
        for _ in 0..tree.leaves {
            let centre = add(on(&knots, random.within(0.5, 1.0)), random.point(-0.45, 0.45));
            let first = mesh.positions.len() as u32;
            mesh.positions.extend([(); 3].map(|()| add(centre, random.point(-0.2, 0.2))));
            mesh.triangles.push([first, first + 1, first + 2]);
        }
    }
    mesh
}

/// A point of a path with evenly spaced knots, 0 at its beginning, 1 at its end.
fn on(path: &[Knot], share: f32) -> [f32; 3] {
    let segments = path.len() - 1;
    let knot = ((share * segments as f32) as usize).min(segments - 1);
    let [a, b] = [path[knot].at, path[knot + 1].at];
    along(a, share * segments as f32 - knot as f32, add(b, a.map(|c| -c)))
}
