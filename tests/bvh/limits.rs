//! Builders on devices that have little: the same bytes with 16 KiB of shared memory, 128 invocations a workgroup, few workgroups a
//! dispatch, and subgroups that are smaller than they report.

use crate::common::twins::{assert_same, on_host};
use crate::common::{OPTIONS, corpus, open};
use hedgerow::bvh::builder::{BuildOptions, Builder, Input, Method, Schedule, Treelets};
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::layout::Bvh2;
use hedgerow::gpu::{Region, TuningChoice};
use hedgerow_lab::device::{Device, DeviceOptions};

const METHODS: [Method; 4] = [
    Method::Lbvh,
    Method::Hlbvh(Treelets::DEFAULT),
    Method::Ploc { radius: 16 },
    Method::Ploc { radius: Method::MOST_RADIUS },
];

fn built(device: &Device, (_, positions, triangles): &corpus::Mesh, options: &BuildOptions) -> Bvh2 {
    let vertices = device.upload("positions", positions).expect("memory");
    let indices = device.upload("indices", triangles).expect("memory");
    let count = triangles.len() as u32;
    let input = Input::mesh(vertices.address(), positions.len() as u32, indices.address(), count);
    let builder = Builder::new(device, options, count).expect("few enough primitives");
    let sizes = builder.sizes();
    let structure = device.buffer("structure", sizes.structure).expect("memory");
    let scratch = device.buffer("scratch", sizes.scratch).expect("memory");
    device.run(None, |r| builder.record(r, &input, structure.region(), scratch.region())).expect("it builds");
    Bvh2::from_bytes(&structure.read::<u8>(sizes.structure as usize)).expect("a structure")
}

fn has_the_bytes_of_the_host(restrict: &str) {
    let restrict = restrict.parse().expect("restrictions");
    let device = open(DeviceOptions { restrict, tuning: TuningChoice::Gpu, ..OPTIONS });
    let meshes = corpus::meshes();
    let mesh = meshes.iter().max_by_key(|mesh| mesh.2.len()).expect("a corpus");
    for method in METHODS {
        let options =
            BuildOptions { method, codes: Some(Code::Emc64Var.full().with_bits(32)), ..BuildOptions::DEFAULT };
        let options = BuildOptions { schedule: Some(Schedule::Chain), ..options };
        assert_same(&built(&device, mesh, &options), &on_host(mesh, &options), &format!("{restrict:?} {method:?}"));
    }
}

#[test]
fn a_small_device_builds_the_same_trees() {
    has_the_bytes_of_the_host("shared=16384,invocations=128,groups=64");
}

/// Four times as large as they are.
#[test]
fn subgroups_smaller_than_they_report_build_the_same_trees() {
    has_the_bytes_of_the_host("subgroup=32,inexact");
}

#[test]
fn too_little_memory_is_refused_by_name() {
    let device = crate::common::device();
    let input = Input::mesh(256, 3000, 256, 1000);
    let refused = |options: &BuildOptions, less: [u64; 2]| {
        let builder = Builder::new(device, options, input.primitive_count).expect("few enough primitives");
        let sizes = builder.sizes();
        let [structure, scratch] = [sizes.structure - less[0], sizes.scratch - less[1]];
        let [structure, scratch] = [structure, scratch].map(|bytes| Region { address: 256, bytes });
        builder.steps(&input, structure, scratch).err().map(|error| error.to_string())
    };
    for schedule in [Schedule::Chain, Schedule::PERSISTENT, Schedule::Workgroup] {
        let options = BuildOptions { schedule: Some(schedule), ..BuildOptions::DEFAULT };
        assert_eq!(refused(&options, [0, 0]), None, "{schedule:?}");
        let structure = refused(&options, [1, 0]).expect("one byte too few");
        assert!(structure.starts_with("memory for a BVH of"), "{structure}");
        let scratch = refused(&options, [0, 1]).expect("one byte too few");
        assert!(scratch.starts_with("scratch memory for a BVH of"), "{scratch}");
    }
}
