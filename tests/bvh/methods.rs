//! The device's trees equal the host's, byte for byte, for every method, code and schedule, over inputs that hurt.

use crate::common::twins::{assert_same, on_device, on_host};
use crate::common::{corpus, device};
use hedgerow::bvh::builder::{BuildOptions, Builder, Geometry, Input, Method, Schedule, Source, Treelets, Window};
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::reinsertion;
use hedgerow::bvh::sah::Collapse;
use hedgerow::gpu::Region;

/// The trees of `methods`, one for each of some codes, by the chain; of the first also by the pool, whose kernels take long to
/// compile.
fn equals_the_host<const N: usize>(methods: [Method; N]) {
    let codes = [Code::Emc64Var.full(), Code::Mc30.full(), Code::Mc63.full().with_bits(17)];
    // The largest takes rounds that many workgroups share.
    let meshes = corpus::meshes().into_iter().chain([corpus::random("random 9000", 9000, [-0.5; 3], [1.0; 3])]);
    for mesh in meshes {
        for (i, (method, codes)) in methods.into_iter().zip(codes.into_iter().cycle()).enumerate() {
            let schedules = if i == 0 { &[Schedule::Chain, Schedule::PERSISTENT][..] } else { &[Schedule::Chain] };
            for collapse in [Collapse::OFF, Collapse::SAH] {
                let options = BuildOptions { method, codes: Some(codes), collapse, ..BuildOptions::DEFAULT };
                let expected = on_host(&mesh, &options);
                let what = format!("{} {codes} {method:?} {collapse:?}", mesh.0);
                expected.validate().unwrap_or_else(|e| panic!("{what}: {e}"));
                for &schedule in schedules {
                    let got = on_device(&mesh, &BuildOptions { schedule: Some(schedule), ..options });
                    assert_same(&got, &expected, &format!("{what} {schedule:?}"));
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
    let optimise = reinsertion::ReinsertionOptions { rounds: 6, stride: 2 };
    for mesh in corpus::meshes() {
        for method in [
            Method::Lbvh,
            Method::Hlbvh(Treelets::DEFAULT),
            Method::Ploc { radius: 8 },
            Method::Hploc(Window::DEFAULT),
            Method::Hploc(Window { size: 64, radius: 16 }),
        ] {
            let codes = Some(Code::Emc64Var.full());
            let options = BuildOptions { method, codes, optimise: Some(optimise), ..BuildOptions::DEFAULT };
            let expected = on_host(&mesh, &options);
            let what = format!("{} {method:?}", mesh.0);
            expected.validate().unwrap_or_else(|e| panic!("{what}: {e}"));
            // Without a schedule one workgroup optimises what is small, and makes its tree if that is an LBVH or by H-PLOC.
            for schedule in [None, Some(Schedule::Chain)] {
                let got = on_device(&mesh, &BuildOptions { schedule, ..options });
                assert_same(&got, &expected, &format!("{what} {schedule:?}"));
            }
        }
    }
}

/// A dispatch for the tree, or of H-PLOC one for the order and one for the hierarchy, one for all rounds, one for leaves and records; of the chain
/// each phase and each round has its own.
#[test]
fn small_optimised_trees_take_a_few_dispatches() {
    let input = Input { source: Source::One(Geometry::mesh(16, 16, 3)), primitive_count: 200 };
    let steps = |method, schedule| {
        let optimise = Some(reinsertion::ReinsertionOptions::MEDIUM);
        let options = BuildOptions { method, optimise, schedule, ..BuildOptions::DEFAULT };
        let builder = Builder::new(device(), &options, input.primitive_count).expect("options that fit");
        builder.steps(&input, Region::unbounded(16), Region::unbounded(16)).expect("memory without an end").len()
    };
    let hploc = Method::Hploc(Window::DEFAULT);
    assert_eq!([steps(Method::Lbvh, None), steps(hploc, None)], [3, 4]);
    for method in [Method::Lbvh, hploc] {
        let chain = steps(method, Some(Schedule::Chain));
        assert!(chain > 30, "{method:?}: {chain}");
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

/// From a count on, invocations of a CPU take longer runs of primitives: 131,072 for subgroups of 16 lanes.
#[test]
fn large_inputs_give_the_bytes_of_the_host() {
    let mesh = corpus::random("random 140,000", 140_000, [-0.5; 3], [1.0; 3]);
    for method in
        [Method::Lbvh, Method::Hlbvh(Treelets::DEFAULT), Method::Ploc { radius: 3 }, Method::Hploc(Window::DEFAULT)]
    {
        let options = BuildOptions { method, codes: Some(Code::Mc30.full()), ..BuildOptions::DEFAULT };
        let expected = on_host(&mesh, &options);
        expected.validate().unwrap_or_else(|e| panic!("{method:?}: {e}"));
        assert_same(&on_device(&mesh, &options), &expected, &format!("{method:?}"));
    }
}
