//! Builders of BVHs: the device's bytes against those of the host's twin.

use crate::experiments::check::cases::{Cases, Found};
use crate::experiments::check::corpus::{self, Mesh};
use crate::experiments::check::twins::{compare, on_device, on_host};
use hedgerow::bvh::builder::{BuildOptions, Method, Schedule, Treelets, Window};
use hedgerow::bvh::child_order::ChildOrder;
use hedgerow::bvh::codes::{Code, Codes};
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::{reinsertion, split};

const CHAIN: &[Schedule] = &[Schedule::Chain];
const CHAIN_AND_POOL: &[Schedule] = &[Schedule::Chain, Schedule::PERSISTENT];

/// Meshes of sizes around powers of two and around what a workgroup takes at a time; and those that hurt.
pub(super) fn meshes(cases: &Cases<'_>) -> Vec<Mesh> {
    if cases.quick {
        return sized(&[0, 1, 9, 129, 1025]).collect();
    }
    let tuning = &cases.device.tuning;
    let cut = [tuning.group, tuning.build.small, tuning.group * tuning.build.run].map(|n| n.min(20_000) as usize);
    sized(&cut.map(|n| [n - 1, n, n + 1]).concat()).chain(corpus::meshes()).collect()
}

fn sized(counts: &[usize]) -> impl Iterator<Item = Mesh> {
    counts.iter().map(|&count| corpus::random(&format!("{count} triangles"), count, [-0.5; 3], [1.0; 3]))
}

/// One tree by each of the schedules.
fn as_on_host(cases: &mut Cases<'_>, mesh: &Mesh, options: &BuildOptions, schedules: &[Schedule]) {
    let expected = on_host(mesh, options);
    let what = format!("{}, {}", mesh.0, options.codes.map_or_else(String::new, |codes| codes.to_string()));
    cases.case(format!("{what}, the host's tree"), |_| Ok(expected.validate()?));
    for &schedule in schedules {
        let options = BuildOptions { schedule: Some(schedule), ..*options };
        cases.case(format!("{what}, {:?}, {schedule}", options.method), |device| -> Found {
            compare(&on_device(device, mesh, &options), &expected)
        });
    }
}

fn by_codes(codes: Codes) -> BuildOptions {
    BuildOptions { codes: Some(codes), ..BuildOptions::DEFAULT }
}

pub fn lbvh(cases: &mut Cases<'_>) {
    let schedules = [Schedule::Chain, Schedule::PERSISTENT, Schedule::Workgroup];
    for mesh in meshes(cases) {
        for (code, collapse) in [(Code::Emc64Var.full(), Collapse::SAH), (Code::Mc30.full(), Collapse::OFF)] {
            as_on_host(cases, &mesh, &BuildOptions { collapse, ..by_codes(code) }, &schedules);
        }
    }
    // Longer runs of primitives, where the tuning has them.
    let count = if cases.quick { 40_000 } else { 140_000 };
    for mesh in sized(&[count]) {
        as_on_host(cases, &mesh, &by_codes(Code::Mc63.full()), CHAIN_AND_POOL);
    }
}

/// Children in every order, which an LBVH gets on the way and others behind.
pub fn in_child_order(cases: &mut Cases<'_>) {
    let schedules = [Schedule::Chain, Schedule::Workgroup];
    let optimise = Some(reinsertion::ReinsertionOptions { rounds: 2, stride: 2 });
    let split = Some(split::SplitOptions::DEFAULT);
    for mesh in meshes(cases) {
        for order in ChildOrder::ALL {
            let in_order = BuildOptions { child_order: Some(order), ..by_codes(Code::Emc64Var.full()) };
            as_on_host(cases, &mesh, &in_order, &schedules);
            let others = [
                BuildOptions { collapse: Collapse::OFF, ..in_order },
                BuildOptions { split, ..in_order },
                BuildOptions { optimise, ..in_order },
                BuildOptions { method: Method::Ploc { radius: 8 }, ..in_order },
            ];
            // One for each rule: all would take long.
            as_on_host(cases, &mesh, &others[order as usize], CHAIN);
        }
    }
    let opaque = BuildOptions { child_order: Some(ChildOrder::MoreHitsForItsCost), ..by_codes(Code::Mc63.full()) };
    for mesh in sized(&[if cases.quick { 40_000 } else { 140_000 }]) {
        as_on_host(cases, &mesh, &opaque, CHAIN_AND_POOL);
    }
}

/// Codes with bounds and bits: every one of each.
const CODES: [&str; 14] = [
    "mc30",
    "mc63/17",
    "mc63+concise",
    "emc64sort/32",
    "emc64sort+centroid",
    "emc64var",
    "emc64var/32",
    "emc64var+robust/32",
    "emc64var-size4",
    "emc64var-extents/32",
    "emc64var-nosize/17",
    "mip6/32",
    "mip12+concise",
    "bin4a4",
];

pub fn codes(cases: &mut Cases<'_>) {
    let meshes = if cases.quick { sized(&[1025]).collect() } else { meshes(cases) };
    for mesh in meshes {
        for codes in CODES {
            let codes = codes.parse().expect("codes that there are");
            as_on_host(cases, &mesh, &BuildOptions { collapse: Collapse::OFF, ..by_codes(codes) }, CHAIN);
        }
    }
}

/// The first of the methods by the pool, too, unless there is little time: its kernels take long to compile.
fn methods<const N: usize>(cases: &mut Cases<'_>, methods: [Method; N]) {
    let codes = [Code::Emc64Var.full(), Code::Mc30.full(), Code::Mc63.full().with_bits(17)];
    let large = sized(&[9000]).take(usize::from(!cases.quick));
    for mesh in meshes(cases).into_iter().chain(large) {
        for (i, (method, codes)) in methods.into_iter().zip(codes.into_iter().cycle()).enumerate() {
            let collapse = if i % 2 == 0 { Collapse::SAH } else { Collapse::OFF };
            let schedules = if i == 0 && !cases.quick { CHAIN_AND_POOL } else { CHAIN };
            as_on_host(cases, &mesh, &BuildOptions { method, collapse, ..by_codes(codes) }, schedules);
        }
    }
}

pub fn hlbvh(cases: &mut Cases<'_>) {
    let one_each = Treelets { bits: None, primitives: 1 };
    methods(cases, [Treelets::DEFAULT, one_each, Treelets { bits: Some(5), primitives: 5000 }].map(Method::Hlbvh));
}

pub fn ploc(cases: &mut Cases<'_>) {
    methods(cases, [25, 100, 1].map(|radius| Method::Ploc { radius }));
}

/// Windows of an invocation, and of a subgroup.
pub fn hploc(cases: &mut Cases<'_>) {
    let odd = Window { size: 6, radius: 5 };
    let large = Window { size: 64, radius: 16 };
    methods(cases, [Window::DEFAULT, odd, Window { size: 32, radius: 8 }, large].map(Method::Hploc));
}

/// Pairs of triangles, by each method that merges them and each schedule, finished and optimised.
pub fn pairs(cases: &mut Cases<'_>) {
    let optimise = Some(reinsertion::ReinsertionOptions { rounds: 6, stride: 2 });
    let sides = if cases.quick { &[2, 25][..] } else { &[1, 2, 5, 25, 80] };
    for mesh in sides.iter().map(|&side| corpus::sheet(side)).chain(meshes(cases)) {
        let pairs = BuildOptions { pairs: true, ..by_codes(Code::Emc64Var.full()) };
        let hploc = BuildOptions { method: Method::Hploc(Window::DEFAULT), ..pairs };
        as_on_host(cases, &mesh, &hploc, if cases.quick { CHAIN } else { CHAIN_AND_POOL });
        as_on_host(cases, &mesh, &BuildOptions { optimise, ..hploc }, &[Schedule::Chain, Schedule::Workgroup]);
        let codes = Some(Code::Mc63.full().with_bits(17));
        as_on_host(cases, &mesh, &BuildOptions { method: Method::Ploc { radius: 8 }, codes, ..pairs }, CHAIN);
    }
}

pub fn split(cases: &mut Cases<'_>) {
    let mut next = corpus::unit_floats(5);
    let across = (0..130).map(|_| std::array::from_fn(|_| std::array::from_fn(|_| next()))).collect();
    let all = split::SplitOptions { fraction: 1.0, most: split::SplitOptions::MOST_SPLITS };
    for mesh in meshes(cases).into_iter().chain([corpus::soup("130 triangles across the scene", across)]) {
        for split in [split::SplitOptions::DEFAULT, all] {
            let options = BuildOptions { split: Some(split), ..by_codes(Code::Emc64Var.full()) };
            as_on_host(cases, &mesh, &options, CHAIN);
        }
    }
}

pub fn optimise(cases: &mut Cases<'_>) {
    let optimise = Some(reinsertion::ReinsertionOptions { rounds: 6, stride: 2 });
    for mesh in meshes(cases) {
        for method in [Method::Lbvh, Method::Ploc { radius: 8 }] {
            as_on_host(cases, &mesh, &BuildOptions { method, optimise, ..by_codes(Code::Emc64Var.full()) }, CHAIN);
        }
    }
}
