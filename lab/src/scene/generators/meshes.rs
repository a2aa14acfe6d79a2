//! Plain meshes: spheres, squares, an arena, and triangles anywhere.

use super::{tube, unit};
use crate::random::SplitMix64;
use crate::scene::Mesh;
use glam::Vec3;
use std::collections::HashMap;
use std::f32::consts::TAU;

/// How many triangles an [`icosphere`] has.
pub fn icosphere_triangles(levels: u64) -> Option<u64> {
    u32::try_from(levels).ok().and_then(|levels| 4_u64.checked_pow(levels)).and_then(|faces| faces.checked_mul(20))
}

/// How many triangles a [`grid`] has.
pub fn grid_triangles(side: u64) -> Option<u64> {
    side.checked_mul(side).and_then(|cells| cells.checked_mul(2))
}

/// The unit sphere: an icosahedron whose triangles are cut in four `levels` times. Closed, 20·4^levels triangles.
pub fn icosphere(levels: u32) -> Mesh {
    let golden = (1.0 + 5_f32.sqrt()) / 2.0;
    let mut positions = Vec::new();
    // Three golden rectangles, one in each plane: (0, ±1, ±golden) and its rotations.
    for axis in 0..3 {
        for (a, b) in [(-1.0, -golden), (-1.0, golden), (1.0, -golden), (1.0, golden)] {
            let mut corner = [0.0, a, b];
            corner.rotate_right(axis);
            positions.push(unit(corner.into()).to_array());
        }
    }
    let mut triangles = icosahedron_faces(&positions);
    for _ in 0..levels {
        let mut midpoints: HashMap<[u32; 2], u32> = HashMap::with_capacity(triangles.len() * 3 / 2);
        let mut finer = Vec::with_capacity(triangles.len() * 4);
        for [a, b, c] in triangles {
            let [ab, bc, ca] = [[a, b], [b, c], [c, a]].map(|edge| {
                *midpoints.entry([edge[0].min(edge[1]), edge[0].max(edge[1])]).or_insert_with(|| {
                    let [p, q] = edge.map(|v| Vec3::from(positions[v as usize]));
                    positions.push(unit(p + q).to_array());
                    positions.len() as u32 - 1
                })
            });
            finer.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    Mesh { positions, triangles }
}

/// The triples of corners that lie an edge apart, each turned to face outwards.
fn icosahedron_faces(corners: &[[f32; 3]]) -> Vec<[u32; 3]> {
    // Neighbours on the unit icosahedron have a dot product of 1/√5, the others at most −1/√5.
    let corners: Vec<Vec3> = corners.iter().copied().map(Vec3::from).collect();
    let adjacent = |a: usize, b: usize| corners[a].dot(corners[b]) > 0.0;
    let mut faces = Vec::with_capacity(20);
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if adjacent(a, b) && adjacent(b, c) && adjacent(c, a) {
                    let outwards = corners[a].cross(corners[b]).dot(corners[c]) > 0.0;
                    faces.push(if outwards { [a, b, c] } else { [a, c, b] }.map(|v| v as u32));
                }
            }
        }
    }
    faces
}

/// Small triangles anywhere: centres uniform in the unit cube, each corner within ±0.02 of its centre.
pub fn soup(count: u32, seed: u64) -> Mesh {
    let mut random = SplitMix64::new(seed);
    Mesh::of_corners((0..count).map(|_| {
        let centre = Vec3::from(random.point(0.0, 1.0));
        [(); 3].map(|()| (centre + Vec3::from(random.point(-0.02, 0.02))).to_array())
    }))
}

/// A flat square of `side` × `side` unit cells in the plane y = 0, two triangles each, row by row.
pub fn grid(side: u32) -> Mesh {
    let corners = side + 1;
    let positions = (0..corners * corners).map(|v| [(v % corners) as f32, 0.0, (v / corners) as f32]).collect();
    let triangles = (0..side * side).flat_map(|cell| {
        let v = cell / side * corners + cell % side;
        [[v, v + corners, v + 1], [v + 1, v + corners, v + corners + 1]]
    });
    Mesh { positions, triangles: triangles.collect() }
}

/// A fine object in a huge coarse one ("teapot in a stadium"): the unit [`icosphere`] on the floor of an arena of
/// 800 triangles, 2,000 across, off its middle.
pub fn stadium(levels: u32) -> Mesh {
    const SECTORS: u32 = 80;
    // Radius and height of each ring of the arena, from the floor's middle to the top of the stands.
    const RINGS: [[f32; 2]; 6] =
        [[0.0, 0.0], [500.0, 0.0], [500.0, 20.0], [800.0, 120.0], [800.0, 150.0], [1000.0, 260.0]];
    let mut mesh = icosphere(levels);
    for p in &mut mesh.positions {
        *p = (Vec3::from(*p) + Vec3::new(123.0, 1.0, -45.0)).to_array();
    }
    let first = mesh.positions.len() as u32;
    for [radius, height] in RINGS {
        mesh.positions.extend((0..SECTORS).map(|sector| {
            let angle = TAU * sector as f32 / SECTORS as f32;
            [radius * angle.cos(), height, radius * angle.sin()]
        }));
    }
    tube::join_rings(&mut mesh, first, SECTORS, RINGS.len() as u32);
    mesh
}

/// Long thin triangles anywhere: middles uniform in the unit cube, directions uniform, 0.2 to 1 long, a thousandth wide.
pub fn needles(count: u32, seed: u64) -> Mesh {
    let mut random = SplitMix64::new(seed);
    Mesh::of_corners((0..count).map(|_| {
        let middle = Vec3::from(random.point(0.0, 1.0));
        let length = random.within(0.2, 1.0);
        let along = direction(&mut random);
        let aside = direction(&mut random);
        let end = |s: f32| middle + s * 0.5 * length * along;
        let tail = end(-1.0);
        [tail, tail + aside * 0.001 * length, end(1.0)].map(|corner| corner.to_array())
    }))
}

/// Uniform on the unit sphere: drawn from the ball by rejection, so that no sine or cosine of the platform is asked.
fn direction(random: &mut SplitMix64) -> Vec3 {
    loop {
        let p = Vec3::from(random.point(-1.0, 1.0));
        if (0.01..=1.0).contains(&p.length_squared()) {
            return unit(p);
        }
    }
}
