//! Codes with a prefix: the device's are the host's bit for bit, over scenes that are far, huge, flat and empty in places.

mod common;

use common::{corpus, device};
use hedgerow::bvh::builder::{Builder, Input, Options, Schedule};
use hedgerow::bvh::codes::Codes;
use hedgerow::bvh::host;
use hedgerow::bvh::sah::Collapse;

const CODES: [&str; 16] = [
    "emc64var+robust",
    "emc64var+robust/24",
    "emc64var+robust/5",
    "emc64sort+robust/32",
    "mc63+robust",
    "mc30+robust/9",
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
];

type Mesh = (Vec<[f32; 3]>, Vec<[u32; 3]>);

/// Small triangles in a lattice of these cells, which may be far apart, and larger ones with these corners.
fn scene(cells: impl Iterator<Item = [f32; 3]>, larger: &[[[f32; 3]; 3]]) -> Mesh {
    let small = cells.flat_map(|[x, y, z]| [[x, y, z], [x + 0.03, y, z + 0.01], [x, y + 0.02, z]]);
    let positions: Vec<[f32; 3]> = small.chain(larger.iter().flatten().copied()).collect();
    let triangles = (0..positions.len() as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    (positions, triangles)
}

/// A bent plate of 3,000 cells: of an octant little is occupied.
fn plate() -> impl Iterator<Item = [f32; 3]> {
    (0..3000)
        .map(|i| [(i % 60) as f32 * 0.05, (i / 60) as f32 * 0.05, if i % 60 < 50 { 0.0 } else { (i % 7) as f32 * 0.3 }])
}

fn triangle_at(d: f32) -> [[f32; 3]; 3] {
    [[d, 0.5, 0.5], [d * 1.001, 0.5, 0.5], [d, 0.6, 0.5]]
}

fn meshes() -> Vec<(String, Mesh)> {
    let far = |e: i32| triangle_at(2.0_f32.powi(e));
    let mut meshes = vec![
        ("plate".into(), scene(plate(), &[])),
        ("flat".into(), scene((0..500).map(|i| [(i % 25) as f32, (i / 25) as f32, 0.0]), &[far(30)])),
        ("line".into(), scene((0..300).map(|i| [i as f32, 0.0, 0.0]), &[[[0.0; 3], [0.0, 9.0e9, 0.0], [0.0; 3]]])),
        ("point".into(), scene((0..100).map(|_| [1.0; 3]), &[far(3), far(60)])),
        ("two towns".into(), scene((0..400).map(|i| [if i % 2 == 0 { 0.0 } else { 1.0e12 }, i as f32, 0.5]), &[])),
    ];
    for e in [4, 9, 50, 127] {
        let scale = 2.0_f32.powi(e);
        meshes.push((format!("far by 2^{e}"), scene(plate(), &[triangle_at(scale)])));
        meshes.push((format!("far by -2^{e}"), scene(plate(), &[triangle_at(-scale)])));
        let huge = [[-scale, -0.2 * scale, 1.0], [scale, 0.3 * scale, 0.0], [0.0, scale, 2.0]];
        meshes.push((format!("huge by 2^{e}"), scene(plate(), &[huge])));
    }
    let hundred: Vec<_> = (1..=100).map(|i| far(1 + i)).collect();
    meshes.push(("a hundred far".into(), scene(plate(), &hundred)));
    meshes
}

#[test]
fn every_prefix_gives_the_bytes_of_the_host() {
    let device = device();
    let corpus =
        corpus::meshes().into_iter().map(|(name, positions, triangles)| (name.to_string(), (positions, triangles)));
    for (name, (positions, triangles)) in meshes().into_iter().chain(corpus) {
        let vertices = device.upload("positions", &positions).unwrap();
        let indices = device.upload("indices", &triangles).unwrap();
        for codes in CODES {
            let codes: Codes = codes.parse().unwrap();
            let expected = host::lbvh::build(&positions, &triangles, codes, Collapse::SAH);
            expected.validate().unwrap_or_else(|e| panic!("{name} {codes}: {e}"));
            let options = Options { codes: Some(codes), schedule: Some(Schedule::Chain), ..Options::DEFAULT };
            let builder = Builder::new(device, &options, triangles.len() as u32).unwrap();
            let sizes = builder.sizes();
            let structure = device.buffer("structure", sizes.structure).unwrap();
            let scratch = device.buffer("scratch", sizes.scratch).unwrap();
            structure.write(&vec![0u8; sizes.structure as usize]);
            scratch.write(&vec![0xA5u8; sizes.scratch as usize]);
            let (count, corners) = (triangles.len() as u32, positions.len() as u32);
            let input = Input::mesh(vertices.address(), corners, indices.address(), count);
            device.run(None, |r| builder.record(r, &input, structure.address(), scratch.address())).unwrap();
            let bytes = structure.read::<u8>(sizes.structure as usize);
            assert!(bytes == expected.to_bytes(), "{name} {codes}: other bytes than the host's");
        }
    }
}
