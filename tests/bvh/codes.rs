//! Codes with a prefix or with sizes: the device's are the host's bit for bit, over scenes that are far, huge, flat and empty in places.

use crate::common::corpus;
use crate::common::twins::{assert_same, on_device, on_host};
use hedgerow::bvh::builder::{BuildOptions, Schedule};
use hedgerow::bvh::codes::Codes;

const CODES: [&str; 29] = [
    "emc64var+robust",
    "emc64var+robust/24",
    "emc64var+robust/5",
    "emc64sort+robust/32",
    "mc63+robust",
    "mc30+robust/9",
    "emc64var+apart",
    "emc64var+apart/5",
    "mc30+apart/9",
    "emc64sort+apart/32",
    "mip6/6",
    "mip9+concise",
    "mip12",
    "mip12+centroid/32",
    "bin2a0",
    "bin4a4+concise",
    "bin4a3~1/20",
    "bin6a9~256",
    "bin6a1~2/6",
    "bin6a5+centroid",
    "bin4a4~512",
    "bin2a9~1024/30",
    "bin6a4~2048+concise",
    "emc64var-size4",
    "emc64var-size4+robust/32",
    "emc64var-extents",
    "emc64var-extents/32",
    "emc64var-extents+concise/13",
    "emc64var-extents+robust",
];

/// Small triangles in a lattice of these cells, which may be far apart, and larger ones with these corners.
fn scene(name: &str, cells: impl Iterator<Item = [f32; 3]>, larger: &[[[f32; 3]; 3]]) -> corpus::Mesh {
    let small = cells.map(|[x, y, z]| [[x, y, z], [x + 0.03, y, z + 0.01], [x, y + 0.02, z]]);
    corpus::soup(name, small.chain(larger.iter().copied()).collect())
}

/// A bent plate of 3,000 cells: of an octant little is occupied.
fn plate() -> impl Iterator<Item = [f32; 3]> {
    (0..3000)
        .map(|i| [(i % 60) as f32 * 0.05, (i / 60) as f32 * 0.05, if i % 60 < 50 { 0.0 } else { (i % 7) as f32 * 0.3 }])
}

fn triangle_at(d: f32) -> [[f32; 3]; 3] {
    [[d, 0.5, 0.5], [d * 1.001, 0.5, 0.5], [d, 0.6, 0.5]]
}

fn meshes() -> Vec<corpus::Mesh> {
    let far = |e: i32| triangle_at(2.0_f32.powi(e));
    let mut meshes = vec![
        scene("plate", plate(), &[]),
        scene("flat", (0..500).map(|i| [(i % 25) as f32, (i / 25) as f32, 0.0]), &[far(30)]),
        scene("line", (0..300).map(|i| [i as f32, 0.0, 0.0]), &[[[0.0; 3], [0.0, 9.0e9, 0.0], [0.0; 3]]]),
        scene("point", (0..100).map(|_| [1.0; 3]), &[far(3), far(60)]),
        scene("two towns", (0..400).map(|i| [if i % 2 == 0 { 0.0 } else { 1.0e12 }, i as f32, 0.5]), &[]),
    ];
    for e in [4, 9, 50, 127] {
        let scale = 2.0_f32.powi(e);
        meshes.push(scene(&format!("far by 2^{e}"), plate(), &[triangle_at(scale)]));
        meshes.push(scene(&format!("far by -2^{e}"), plate(), &[triangle_at(-scale)]));
        let huge = [[-scale, -0.2 * scale, 1.0], [scale, 0.3 * scale, 0.0], [0.0, scale, 2.0]];
        meshes.push(scene(&format!("huge by 2^{e}"), plate(), &[huge]));
    }
    let hundred: Vec<_> = (1..=100).map(|i| far(1 + i)).collect();
    meshes.push(scene("a hundred far", plate(), &hundred));
    // Behind a gap that is longer than the quartiles are apart, and not beyond the fences without it.
    let beside = |axes: usize| {
        let at = move |i: u32| if i.is_multiple_of(2) { 8.0 } else { -5.0 };
        move |i: u32| [0, 1, 2].map(|axis| if axis < axes { at(i) } else { 0.5 })
    };
    meshes.push(scene("a third beside, in one axis", plate().chain((0..1000).map(beside(1))), &[]));
    meshes.push(scene("a third beside, in three", plate().chain((0..1000).map(beside(3))), &[]));
    meshes
}

#[test]
fn every_prefix_and_size_gives_the_bytes_of_the_host() {
    for mesh in meshes().into_iter().chain(corpus::meshes()) {
        for codes in CODES {
            let codes: Codes = codes.parse().unwrap();
            let options = BuildOptions { codes: Some(codes), schedule: Some(Schedule::Chain), ..BuildOptions::DEFAULT };
            let expected = on_host(&mesh, &options);
            expected.validate().unwrap_or_else(|e| panic!("{} {codes}: {e}", mesh.0));
            assert_same(&on_device(&mesh, &options), &expected, &format!("{} {codes}", mesh.0));
        }
    }
}
