//! The device's LBVH equals the host's, byte for byte, for every code and schedule, over inputs that hurt.

use crate::common::twins::{assert_same, on_device, on_host};
use crate::common::{corpus, device};
use hedgerow::bvh::builder::{BuildOptions, Schedule};
use hedgerow::bvh::codes::{Code, Codes};
use hedgerow::bvh::layout::Bvh2;
use hedgerow::bvh::quality::{Quality, QualityFigures, QualityPass};
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin;
use hedgerow::bvh::twin::quality;

#[test]
fn quality_on_the_device_equals_the_walk_on_the_host() {
    for (name, positions, triangles) in corpus::meshes() {
        for collapse in [Collapse::OFF, Collapse::SAH] {
            let tree = twin::lbvh::build(&positions, &triangles, Code::Emc64Var.full(), collapse);
            let expected = quality::of(&tree, 3.0, 2.0);
            let got = quality_on_device(&tree).quality(3.0, 2.0);
            let counts = |q: &Quality| (q.inner, q.leaves, q.refs, q.leaf_max, q.depth_max);
            assert_eq!(counts(&got), counts(&expected), "{name}");
            // Sums of thousands of areas in 32 bits against 64.
            for (what, got, expected) in [("SAH", got.sah, expected.sah), ("depth", got.depth_avg, expected.depth_avg)]
            {
                assert!(
                    (got - expected).abs() <= 1e-4 * expected.abs(),
                    "{name} {collapse:?}: {what} {got}, {expected}"
                );
            }
        }
    }
}

fn quality_on_device(tree: &Bvh2) -> QualityFigures {
    let device = device();
    let measure = QualityPass::new(device, tree.header.primitive_count);
    let structure = device.upload("structure", &tree.to_bytes()).unwrap();
    let scratch = device.buffer("scratch", measure.scratch_bytes()).unwrap();
    let result = device.buffer("result", size_of::<QualityFigures>() as u64).unwrap();
    device.run(None, |r| measure.record(r, structure.address(), scratch.region(), result.region())).unwrap();
    result.read(1)[0]
}

/// Codes with bounds, bits and collapsing: every one of each, not all together. `tests/bvh/codes.rs` has more by the chain.
const KINDS: [(&str, Collapse); 12] = [
    ("mc30", Collapse::SAH),
    ("mc63/17", Collapse::OFF),
    ("mc63+concise", Collapse::SAH),
    ("emc64sort/32", Collapse::SAH),
    ("emc64sort+centroid", Collapse::OFF),
    ("emc64var", Collapse::SAH),
    ("emc64var/32", Collapse::OFF),
    ("emc64var+robust/32", Collapse::SAH),
    ("emc64var-nosize/17", Collapse::SAH),
    ("mip6/32", Collapse::SAH),
    ("mip12+concise", Collapse::OFF),
    ("bin4a4", Collapse::SAH),
];

/// Each kind is kernels of its own, which a driver compiles for seconds: so a test has one schedule.
fn every_code_gives_the_bytes_of_the_host(schedule: Schedule) {
    for mesh in corpus::meshes() {
        for (codes, collapse) in KINDS {
            let codes: Codes = codes.parse().unwrap();
            let options = BuildOptions { codes: Some(codes), collapse, ..BuildOptions::DEFAULT };
            let expected = on_host(&mesh, &options);
            let what = format!("{} {codes} {collapse:?}", mesh.0);
            expected.validate().unwrap_or_else(|e| panic!("{what}: {e}"));
            let got = on_device(&mesh, &BuildOptions { schedule: Some(schedule), ..options });
            assert_same(&got, &expected, &what);
        }
    }
}

#[test]
fn the_chain_gives_the_bytes_of_the_host_by_every_code() {
    every_code_gives_the_bytes_of_the_host(Schedule::Chain);
}

#[test]
fn the_task_pool_gives_the_bytes_of_the_host_by_every_code() {
    every_code_gives_the_bytes_of_the_host(Schedule::PERSISTENT);
}

#[test]
fn one_workgroup_gives_the_bytes_of_the_host_by_every_code() {
    every_code_gives_the_bytes_of_the_host(Schedule::Workgroup);
}
