//! The device's trees equal the host's, byte for byte, for every method, code and schedule, over inputs that hurt.

mod common;

use common::{corpus, device};
use hedgerow::bvh::builder::{Builder, Input, Method, Options, Schedule, Treelets, Window};
use hedgerow::bvh::codes::{Code, Codes};
use hedgerow::bvh::host;
use hedgerow::bvh::layout::Bvh2;
use hedgerow::bvh::reinsertion;
use hedgerow::bvh::sah::Collapse;

fn on_host(positions: &[[f32; 3]], triangles: &[[u32; 3]], codes: Codes, method: Method) -> Bvh2 {
    let radix = host::lbvh::build(positions, triangles, codes, Collapse::OFF);
    match method {
        Method::Lbvh => radix,
        Method::Hlbvh(treelets) => {
            let bits = treelets.bits(codes, triangles.len() as u32);
            host::hlbvh::build(&radix, codes, host::hlbvh::Treelets { bits, primitives: treelets.primitives })
        }
        Method::Ploc { radius } => host::ploc::build(&radix, radius as usize),
        Method::Hploc(Window { size, radius }) => {
            host::hploc::build(&radix, host::hploc::Window { size: size as usize, radius: radius as usize })
        }
    }
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

/// The trees of `methods`, one for each of some codes, by the chain; of the first also by the pool, whose kernels take long to
/// compile.
fn equals_the_host<const N: usize>(methods: [Method; N]) {
    let codes = [Code::Emc64Var.full(), Code::Mc30.full(), Code::Mc63.full().with_bits(17)];
    // The largest takes rounds that many workgroups share.
    let meshes = corpus::meshes().into_iter().chain([corpus::random("random 9000", 9000, [-0.5; 3], [1.0; 3])]);
    for (name, positions, triangles) in meshes {
        for (i, (method, codes)) in methods.into_iter().zip(codes.into_iter().cycle()).enumerate() {
            let schedules = if i == 0 { &[Schedule::Chain, Schedule::Persistent][..] } else { &[Schedule::Chain] };
            let tree = on_host(&positions, &triangles, codes, method);
            for collapse in [Collapse::OFF, Collapse::SAH] {
                let expected = tree.collapsed(&collapse);
                expected.validate().unwrap_or_else(|e| panic!("{name} {codes} {method:?}: {e}"));
                for &schedule in schedules {
                    let options =
                        Options { method, codes: Some(codes), collapse, schedule: Some(schedule), ..Options::DEFAULT };
                    let got = on_device(&positions, &triangles, &options);
                    assert_eq!(got.header, expected.header, "{name} {codes} {method:?} {schedule:?}");
                    let same = got.to_bytes() == expected.to_bytes();
                    assert!(same, "{name} {codes} {method:?} {collapse:?} {schedule:?}: other bytes");
                }
            }
        }
    }
}

#[test]
fn hlbvh_gives_the_bytes_of_the_host() {
    // Treelets of one primitive each, and those that the first bits alone tell apart.
    let treelets =
        [Treelets::DEFAULT, Treelets { bits: None, primitives: 1 }, Treelets { bits: Some(5), primitives: 5000 }];
    equals_the_host(treelets.map(Method::Hlbvh));
}

#[test]
fn optimised_trees_are_those_of_the_host() {
    for (name, positions, triangles) in corpus::meshes() {
        for method in
            [Method::Lbvh, Method::Hlbvh(Treelets::DEFAULT), Method::Ploc { radius: 8 }, Method::Hploc(Window::DEFAULT)]
        {
            let (codes, collapse) = (Code::Emc64Var.full(), Collapse::SAH);
            let optimise = reinsertion::Options { rounds: 6, stride: 2 };
            let tree = on_host(&positions, &triangles, codes, method).reinserted(&optimise);
            let expected = tree.collapsed(&collapse);
            expected.validate().unwrap_or_else(|e| panic!("{name} {method:?}: {e}"));
            let options =
                Options { method, codes: Some(codes), optimise: Some(optimise), collapse, ..Options::DEFAULT };
            let got = on_device(&positions, &triangles, &options);
            assert_eq!(got.header, expected.header, "{name} {method:?}");
            assert!(got.to_bytes() == expected.to_bytes(), "{name} {method:?}: other bytes");
        }
    }
}

#[test]
fn ploc_gives_the_bytes_of_the_host() {
    equals_the_host([25, 100, 1].map(|radius| Method::Ploc { radius }));
}

#[test]
fn hploc_gives_the_bytes_of_the_host() {
    // Those of an invocation, and of a subgroup.
    let alone = [Window::DEFAULT, Window { size: 6, radius: 5 }];
    let windows = [alone[0], alone[1], Window { size: 64, radius: 16 }, Window { size: 4, radius: 1 }];
    equals_the_host(windows.map(Method::Hploc));
}
