//! Meshes that hurt builders: sizes around powers of two, and every degenerate scene.
#![allow(missing_docs, reason = "names and types say it all: groups and tests are the only readers")]

use crate::scene::degenerate;

/// Name, positions, triangles.
pub type Mesh = (String, Vec<[f32; 3]>, Vec<[u32; 3]>);

/// Three positions of its own for each triangle.
pub fn soup(name: &str, triangles: Vec<[[f32; 3]; 3]>) -> Mesh {
    let indices = (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    (name.into(), triangles.into_iter().flatten().collect(), indices)
}

/// A sequence of floats in 0..1, the same for ever.
pub fn unit_floats(seed: u64) -> impl FnMut() -> f32 {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 40) as f32 / (1u64 << 24) as f32
    }
}

/// `count` small triangles in the box from `lo` with edges `extent`.
pub fn random(name: &str, count: usize, lo: [f32; 3], extent: [f32; 3]) -> Mesh {
    let mut next = unit_floats(count as u64 + 7);
    let triangles = (0..count)
        .map(|_| {
            let centre: [f32; 3] = std::array::from_fn(|i| lo[i] + extent[i] * next());
            std::array::from_fn(|_| std::array::from_fn(|i| centre[i] + 0.05 * extent[i] * (next() - 0.5)))
        })
        .collect();
    soup(name, triangles)
}

/// A bumpy sheet of so many quads along either side, whose triangles share edges with those before and behind them; of some their order is
/// another, some are there twice, and some are left out.
pub fn sheet(side: u32) -> Mesh {
    let mut next = unit_floats(u64::from(side) + 3);
    let vertex = |i: u32, j: u32| i * (side + 1) + j;
    let mut positions: Vec<[f32; 3]> = (0..(side + 1) * (side + 1))
        .map(|v| [(v / (side + 1)) as f32, 0.3 * next(), (v % (side + 1)) as f32])
        .collect();
    let quads = (0..side)
        .flat_map(|i| (0..side).map(move |j| [vertex(i, j), vertex(i + 1, j), vertex(i, j + 1), vertex(i + 1, j + 1)]));
    let mut triangles: Vec<[u32; 3]> = quads.flat_map(|[a, b, c, d]| [[a, b, c], [c, b, d]]).collect();
    let count = triangles.len();
    for at in (0..count).step_by(7) {
        triangles.swap(at, (at + (10.0 * next()) as usize).min(count - 1));
    }
    for at in (1..count).step_by(11) {
        triangles[at] = triangles[at - 1];
    }
    positions.push([f32::NAN; 3]);
    for at in (0..count).step_by(29) {
        triangles[at][at % 3] = positions.len() as u32 - 1 + (at % 2) as u32;
    }
    (format!("sheet {side}"), positions, triangles)
}

/// All of them, small enough for every builder and option.
pub fn meshes() -> Vec<Mesh> {
    let sizes = [3, 7, 8, 9, 127, 128, 129, 1023, 1025, 3000];
    let random = sizes.map(|count| random(&format!("random {count}"), count, [-0.5; 3], [1.0; 3]));
    let hard = degenerate(300).into_iter().map(|hard| (hard.name.into(), hard.mesh.positions, hard.mesh.triangles));
    random.into_iter().chain(hard).collect()
}
