//! A dense old stand after storms: tall bare trunks with a small crown, each leaning its own way, one over the other. A leaning
//! trunk runs along the diagonal of its box, so that boxes are large, mostly empty, and many lie over each other.

use super::tube::{self, Knot};
use super::{Assembly, side_of, turns, unit};
use crate::random::SplitMix64;
use crate::scene::Mesh;
use glam::Vec3;

/// Metres from tree to tree.
const PITCH: f32 = 2.2;
/// Metres that a tree stands off its place at most, in x and in z.
const JITTER: f32 = 0.8;
/// Tangents of the angles that trees lean by: 27 to 50 degrees.
const LEAN: [f32; 2] = [0.5, 1.2];

/// A kind of tree; lengths in metres.
struct Tree {
    height: f32,
    branches: u32,
    /// Of the lowest branches.
    branch_length: f32,
    /// On each branch.
    leaves: u32,
}

/// Of 412, 628 and 964 triangles.
const TREES: [Tree; 3] = [
    Tree { height: 16.0, branches: 12, branch_length: 1.2, leaves: 2 },
    Tree { height: 19.0, branches: 16, branch_length: 1.4, leaves: 9 },
    Tree { height: 22.0, branches: 24, branch_length: 1.6, leaves: 12 },
];

/// `count` trees on a square, row by row, each a little off its place, leaning, turned and scaled.
pub fn place(count: u32) -> Assembly {
    let mut random = SplitMix64::new(0);
    let parts: Vec<Mesh> = TREES.iter().map(|tree| grow(tree, &mut random)).collect();
    let side = side_of(count, 2);
    let instances = (0..count).map(|i| {
        let part = random.bits() as usize % parts.len();
        let scale = random.within(0.8, 1.25);
        let [spin, heading] = [(); 2].map(|()| turns::any(&mut random));
        let lean = turns::towards([1.0, random.within(LEAN[0], LEAN[1])]);
        let [x, z] = [i % side, i / side].map(|c| c as f32 * PITCH + random.within(-JITTER, JITTER));
        turns::leaning(part, scale, spin, lean, heading, [x, 0.0, z])
    });
    let instances = instances.collect();
    (parts, instances)
}

/// A tree that stands on the origin: a trunk, branches off it on all sides, and leaves about their outer halves.
fn grow(tree: &Tree, random: &mut SplitMix64) -> Mesh {
    const TRUNK_SEGMENTS: u32 = 10;
    const BRANCH_SEGMENTS: u32 = 4;
    let mut mesh = Mesh::default();
    let mut foot = Vec3::ZERO;
    let trunk: Vec<Knot> = (0..=TRUNK_SEGMENTS)
        .map(|i| {
            let up = i as f32 / TRUNK_SEGMENTS as f32;
            let [dx, dz] = [(); 2].map(|()| random.within(-0.08, 0.08));
            foot = Vec3::new(foot.x + dx, up * tree.height, foot.z + dz);
            Knot { at: foot, radius: 0.009 * tree.height * (1.0 - 0.8 * up) }
        })
        .collect();
    tube::append(&mut mesh, 5, &trunk);
    for branch in 0..tree.branches {
        // Where neighbours stand close, only the top of the trunk has branches.
        let up = 0.7 + 0.28 * (branch as f32 + random.unit()) / tree.branches as f32;
        let [c, s] = turns::any(random);
        let mut direction = unit(Vec3::new(c, random.within(0.1, 0.5), s));
        let length = tree.branch_length * (1.8 - up) * random.within(0.8, 1.2);
        let mut at = on(&trunk, up);
        let radius = 0.003 * tree.height * (1.4 - up);
        let knots: Vec<Knot> = (0..=BRANCH_SEGMENTS)
            .map(|i| {
                if i > 0 {
                    at += length / BRANCH_SEGMENTS as f32 * direction;
                    // Branches bend, and up rather than down.
                    direction = unit(direction + (Vec3::from(random.point(-0.25, 0.25)) + 0.1 * Vec3::Y));
                }
                Knot { at, radius: radius * (1.0 - 0.8 * i as f32 / BRANCH_SEGMENTS as f32) }
            })
            .collect();
        tube::append(&mut mesh, 3, &knots);
        for _ in 0..tree.leaves {
            let centre = on(&knots, random.within(0.5, 1.0)) + Vec3::from(random.point(-0.45, 0.45));
            let leaf = [(); 3].map(|()| (centre + Vec3::from(random.point(-0.2, 0.2))).to_array());
            mesh.append(leaf, &[[0, 1, 2]]);
        }
    }
    mesh
}

/// A point of a path with evenly spaced knots, 0 at its beginning, 1 at its end.
fn on(path: &[Knot], share: f32) -> Vec3 {
    let segments = path.len() - 1;
    let knot = ((share * segments as f32) as usize).min(segments - 1);
    let [a, b] = [path[knot].at, path[knot + 1].at];
    a + (share * segments as f32 - knot as f32) * (b - a)
}
