//! The device's H-PLOC equals the host's, byte for byte, for every window, code and schedule, over inputs that hurt.

mod common;

use common::{corpus, device};
use hedgerow::bvh::builder::{Builder, Input, Method, Options, Schedule, Window};
use hedgerow::bvh::codes::{Code, Codes};
use hedgerow::bvh::host;
use hedgerow::bvh::layout::Bvh2;
use hedgerow::bvh::sah::Collapse;

const WINDOWS: [Window; 3] = [Window::DEFAULT, Window { size: 64, radius: 16 }, Window { size: 4, radius: 1 }];

fn on_host(positions: &[[f32; 3]], triangles: &[[u32; 3]], codes: Codes, window: Window, collapse: &Collapse) -> Bvh2 {
    let radix = host::lbvh::build(positions, triangles, codes, Collapse::OFF);
    let window = host::hploc::Window { size: window.size as usize, radius: window.radius as usize };
    host::hploc::build(&radix, window).collapsed(collapse)
}

fn on_device(positions: &[[f32; 3]], triangles: &[[u32; 3]], options: &Options) -> Bvh2 {
    let device = device();
    let builder = Builder::new(device, options, triangles.len() as u32).unwrap();
    let sizes = builder.sizes();
    let vertices = device.upload("positions", positions).unwrap();
    let indices = device.upload("indices", triangles).unwrap();
    let structure = device.buffer("structure", sizes.structure).unwrap();
    let scratch = device.buffer("scratch", sizes.scratch).unwrap();
    // Whatever was there before changes nothing.
    structure.write(&vec![0x5Au8; sizes.structure as usize]);
    scratch.write(&vec![0xA5u8; sizes.scratch as usize]);
    let input = Input::mesh(vertices.address(), positions.len() as u32, indices.address(), triangles.len() as u32);
    device.run(None, |r| builder.record(r, &input, structure.address(), scratch.address())).unwrap();
    Bvh2::from_bytes(&structure.read::<u8>(sizes.structure as usize)).unwrap()
}

#[test]
fn every_window_code_and_schedule_gives_the_bytes_of_the_host() {
    for (name, positions, triangles) in corpus::meshes() {
        for (window, codes) in
            WINDOWS.into_iter().zip([Code::Emc64Var.full(), Code::Mc30.full(), Code::Mc63.full().with_bits(17)])
        {
            for collapse in [Collapse::OFF, Collapse::SAH] {
                let expected = on_host(&positions, &triangles, codes, window, &collapse);
                expected.validate().unwrap_or_else(|e| panic!("{name} {codes} {window:?}: {e}"));
                for schedule in [Schedule::Chain, Schedule::Persistent] {
                    let method = Method::Hploc(window);
                    let options =
                        Options { method, codes: Some(codes), collapse, schedule: Some(schedule), ..Options::DEFAULT };
                    let got = on_device(&positions, &triangles, &options);
                    assert_eq!(got.header, expected.header, "{name} {codes} {window:?} {schedule:?}");
                    let same = got.to_bytes() == expected.to_bytes();
                    assert!(same, "{name} {codes} {window:?} {collapse:?} {schedule:?}: other bytes");
                }
            }
        }
    }
}
