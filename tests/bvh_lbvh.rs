//! The device's LBVH equals the host's, byte for byte, for every code and schedule, over inputs that hurt.

mod common;

use common::{corpus, device};
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::host;
use hedgerow::bvh::layout::Bvh2;
use hedgerow::bvh::lbvh::{Input, Lbvh, Options, Schedule};
use hedgerow::bvh::sah::Collapse;

fn build_on_device(positions: &[[f32; 3]], triangles: &[[u32; 3]], options: &Options) -> (Bvh2, Vec<u8>) {
    let device = device();
    let builder = Lbvh::new(device, options, triangles.len() as u32).unwrap();
    let sizes = builder.sizes();
    let vertices = device.upload("positions", positions).unwrap();
    let indices = device.upload("indices", triangles).unwrap();
    let structure = device.buffer("structure", sizes.structure).unwrap();
    let scratch = device.buffer("scratch", sizes.scratch).unwrap();
    structure.write(&vec![0u8; sizes.structure as usize]);
    let input = Input {
        positions: vertices.address(),
        vertex_count: positions.len() as u32,
        vertex_stride: 3,
        indices: indices.address(),
        primitive_count: triangles.len() as u32,
    };
    device.run(None, |r| builder.record(r, &input, structure.address(), scratch.address())).unwrap();
    let bytes = structure.read::<u8>(sizes.structure as usize);
    (Bvh2::from_bytes(&bytes).unwrap(), bytes)
}

#[test]
fn every_code_and_schedule_gives_the_bytes_of_the_host() {
    for (name, positions, triangles) in corpus::meshes() {
        for code in Code::ALL {
            for concise in [false, true] {
                for collapse in [Collapse::OFF, Collapse::SAH] {
                    let mut codes = code.full();
                    codes.concise = concise;
                    let expected = host::lbvh::build(&positions, &triangles, codes, collapse);
                    expected.validate().unwrap_or_else(|e| panic!("{name} {codes}: {e}"));
                    for schedule in [Schedule::Chain, Schedule::Persistent] {
                        let options = Options { codes: Some(codes), collapse, schedule: Some(schedule) };
                        let (got, bytes) = build_on_device(&positions, &triangles, &options);
                        assert_eq!(got.header, expected.header, "{name} {codes} {schedule:?}");
                        assert!(bytes == expected.to_bytes(), "{name} {codes} {collapse:?} {schedule:?}: other bytes");
                    }
                }
            }
        }
    }
}
