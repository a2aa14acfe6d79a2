//! BVHs of every method and schedule, against their twins.

use super::meshes;
use crate::common::twins::{assert_same, on_device, on_host};
use hedgerow::bvh::builder::{BuildOptions, Method, Schedule, Treelets, Window};
use hedgerow::bvh::codes::{Code, Codes};
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::{reinsertion, split};

fn methods() -> [(Method, Codes); 5] {
    [
        (Method::Lbvh, Code::Emc64Var.full()),
        (Method::Hlbvh(Treelets::DEFAULT), Code::Mc30.full()),
        (Method::Ploc { radius: 8 }, Code::Mc63.full().with_bits(17)),
        (Method::Hploc(Window::DEFAULT), Code::Emc64Var.full()),
        (Method::Hploc(Window::PAPER), Code::Mc30.full()),
    ]
}

fn assert_as_on_the_host(options: &BuildOptions, schedules: &[Schedule]) {
    for mesh in meshes() {
        let expected = on_host(&mesh, options);
        let what = format!("{} {:?}", mesh.0, options.method);
        expected.validate().unwrap_or_else(|e| panic!("{what}: {e}"));
        for &schedule in schedules {
            let got = on_device(&mesh, &BuildOptions { schedule: Some(schedule), ..*options });
            assert_same(&got, &expected, &format!("{what} {schedule:?}"));
        }
    }
}

pub fn all_give_the_bytes_of_the_host() {
    for (method, codes) in methods() {
        let options = BuildOptions { method, codes: Some(codes), collapse: Collapse::SAH, ..BuildOptions::DEFAULT };
        let alone: &[Schedule] = if method == Method::Lbvh { &[Schedule::Workgroup] } else { &[] };
        assert_as_on_the_host(&options, &[&[Schedule::Chain, Schedule::PERSISTENT], alone].concat());
        assert_as_on_the_host(&BuildOptions { collapse: Collapse::OFF, ..options }, &[Schedule::Chain]);
    }
}

pub fn splits_and_optimised_trees_too() {
    let optimise = Some(reinsertion::ReinsertionOptions { rounds: 3, stride: 2 });
    let split = Some(split::SplitOptions::DEFAULT);
    let codes = Some(Code::Emc64Var.full());
    for method in [Method::Lbvh, Method::Hploc(Window::DEFAULT)] {
        let options = BuildOptions { method, codes, optimise, ..BuildOptions::DEFAULT };
        assert_as_on_the_host(&options, &[Schedule::Chain, Schedule::Workgroup]);
    }
    assert_as_on_the_host(
        &BuildOptions { codes, split, ..BuildOptions::DEFAULT },
        &[Schedule::Chain, Schedule::PERSISTENT],
    );
}
