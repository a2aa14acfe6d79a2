//! Meshes that hurt builders: empty, tiny, identical, flat, far, huge, degenerate, broken.

/// Name, positions, triangles.
pub type Mesh = (String, Vec<[f32; 3]>, Vec<[u32; 3]>);

/// Three positions of its own for each triangle.
fn soup(name: &str, triangles: Vec<[[f32; 3]; 3]>) -> Mesh {
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
    let unit = [1.0; 3];
    let one = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let mut meshes =
        vec![soup("empty", vec![]), soup("one", vec![one]), soup("two", vec![one, one.map(|p| p.map(|x| x + 2.0))])];
    for count in [3, 7, 8, 9, 127, 128, 129, 1023, 1025, 3000] {
        meshes.push(random(&format!("random {count}"), count, [-0.5; 3], unit));
    }
    meshes.push(soup("identical", vec![one; 500]));
    meshes.push(soup("points", vec![[[0.25; 3]; 3]; 300]));
    meshes.push(random("in a plane", 400, [0.0, 3.0, 0.0], [1.0, 0.0, 1.0]));
    meshes.push(random("in a line", 400, [0.0, 0.0, -5.0], [0.0, 0.0, 10.0]));
    meshes.push(random("long street", 400, [0.0; 3], [1000.0, 1.0, 3.0]));
    meshes.push(random("tiny", 300, [1e-30; 3], [1e-30; 3]));
    meshes.push(random("huge", 300, [-1e30; 3], [2e30; 3]));
    meshes.push(random("as large as floats are", 300, [-3.0e38; 3], [3.0e38; 3]));
    meshes.push(random("far from the origin", 300, [1e6; 3], unit));
    let mut far = random("one far away", 300, [0.0; 3], unit);
    far.1.extend([[1e12, 0.0, 0.0], [1e12, 1.0, 0.0], [1e12, 0.0, 1.0]]);
    far.2.push([900, 901, 902]);
    meshes.push(far);
    let mut large = random("one huge", 300, [0.0; 3], unit);
    large.1.extend([[-1e6, -1e6, 0.0], [1e6, -1e6, 0.0], [0.0, 1e6, 0.5]]);
    large.2.push([900, 901, 902]);
    meshes.push(large);
    let mut broken = random("NaN, infinite and out of range", 300, [0.0; 3], unit);
    broken.1[30] = [f32::NAN, 0.0, 0.0];
    broken.1[70] = [0.0, f32::INFINITY, 0.0];
    broken.2[55] = [0, 1, 900];
    broken.2[299] = [u32::MAX, 1, 2];
    meshes.push(broken);
    meshes.push(soup("nothing finite", vec![[[f32::NAN; 3]; 3]; 40]));
    meshes.push(soup("negative zeros", vec![[[-0.0, 0.0, -0.0], [0.0, -0.0, 1.0], [-0.0, 1.0, 0.0]]; 20]));
    meshes
}
