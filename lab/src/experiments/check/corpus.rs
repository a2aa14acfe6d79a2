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

/// All of them, small enough for every builder and option.
pub fn meshes() -> Vec<Mesh> {
    let sizes = [3, 7, 8, 9, 127, 128, 129, 1023, 1025, 3000];
    let random = sizes.map(|count| random(&format!("random {count}"), count, [-0.5; 3], [1.0; 3]));
    let hard = degenerate(300).into_iter().map(|hard| (hard.name.into(), hard.mesh.positions, hard.mesh.triangles));
    random.into_iter().chain(hard).collect()
}
