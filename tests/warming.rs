//! Whoever has warmed a context waits for no pipeline: a first build or update makes none.

use crate::common::{OPTIONS, corpus, open};
use hedgerow::accel::{self, ANY_HIT_ORDER, AccelOptions, Instance, Placement, REBRAID, Request, Wide};
use hedgerow::ash::vk;
use hedgerow::ash::vk::Handle;
use hedgerow::bvh::geometry::Geometry;
use hedgerow::gpu::TuningChoice;
use hedgerow_lab::Error;
use hedgerow_lab::device::{Device, DeviceOptions, Restrict, Validation};
use hedgerow_lab::scene::Mesh;
use hedgerow_lab::subjects::builders::Spec;
use vk::BuildAccelerationStructureFlagsKHR as Flags;

/// A device that has no pipelines yet, by this tuning, and runs nothing: pipelines are made when they are recorded. The validation
/// layers look at the shaders of all builders here, too.
fn cold(tuning: TuningChoice) -> Device {
    let restrict = Restrict { unsubmitted: true, timestamp_bits: Some(0), ..Restrict::NONE };
    open(DeviceOptions { tuning, restrict, validation: Validation::All, ..OPTIONS })
}

#[test]
fn first_builds_make_no_pipelines() {
    let builders = [
        "lbvh",
        "lbvh:schedule=persistent",
        "lbvh:codes=mip9",
        "lbvh:codes=bin4a4",
        "lbvh:split=0.3:optimise=fast",
        "lbvh:width=8q",
        "lbvh:any-hit=opaque",
        "lbvh:width=8:any-hit=opaque",
        "hlbvh:any-hit=sato",
        "ploc",
        "hploc:width=4",
        "kd-gpu:schedule=chain",
        "kd-gpu:schedule=persistent",
        "kd-gpu:schedule=across-levels",
    ];
    let (_, positions, triangles) = corpus::random("", 3000, [-0.5; 3], [1.0; 3]);
    let mesh = Mesh { positions, triangles };
    for tuning in [TuningChoice::Cpu, TuningChoice::Gpu] {
        for builder in builders {
            // Pipelines of one builder would do for another.
            let device = cold(tuning);
            let before = device.pipelines().len();
            let mut subject =
                builder.parse::<Spec>().expect("a builder").make(Some(&device), &mesh).expect("a small scene");
            let warm = device.pipelines().len();
            assert!(warm > before, "{builder} {tuning}: nothing was made ahead");
            // It reads reports from memory that nothing was written to: whatever it makes of those is no matter here.
            if let Err(error @ Error::Validation(_)) = subject.build() {
                panic!("{builder} {tuning}: {error}");
            }
            assert_eq!(device.pipelines().len(), warm, "{builder} {tuning}: not all were made ahead");
        }
    }
}

#[test]
fn first_builds_and_updates_make_no_pipelines() {
    let (_, positions, triangles) = corpus::random("", 3000, [-0.5; 3], [1.0; 3]);
    let of_two =
        [Flags::empty(), Flags::PREFER_FAST_BUILD | Flags::ALLOW_UPDATE, Flags::LOW_MEMORY, REBRAID, ANY_HIT_ORDER];
    let of_eight = [Flags::empty(), Flags::PREFER_FAST_TRACE, Flags::PREFER_FAST_TRACE | ANY_HIT_ORDER];
    let of_two = of_two.map(|flags| (flags, Wide::Never)).into_iter();
    for (flags, wide) in of_two.chain(of_eight.map(|flags| (flags, Wide::Always))) {
        let device = cold(TuningChoice::Auto);
        let ours = accel::Device::with_options(&device, AccelOptions { wide, ..AccelOptions::DEFAULT });
        let requests = |vertices: u64, indices: u64, instances: u64| {
            let mesh = |first: u64, count| (Geometry::mesh(vertices, 9000, indices + 12 * first), count);
            let all = [
                Request::triangles(&[mesh(0, 100)]),
                Request::triangles(&[mesh(0, 3000)]),
                Request::triangles(&[mesh(0, 1000), mesh(1000, 1500)]),
                Request::boxes(&[(Geometry::boxes(vertices, 24), 200)]),
                Request::instances(instances, 50),
            ];
            all.map(|request| request.with_flags(flags))
        };
        ours.warm(&requests(0, 0, 0)).expect("pipelines");
        let warm = device.pipelines().len();
        assert!(warm > 0, "{flags:?}: nothing was made ahead");

        let vertices = device.upload("positions", &positions).expect("memory");
        let indices = device.upload("indices", &triangles).expect("memory");
        // All of them inactive.
        let instances = device.upload("instances", &[<Instance as bytemuck::Zeroable>::zeroed(); 50]).expect("memory");
        let requests = requests(vertices.address(), indices.address(), instances.address());
        let memory = requests.each_ref().map(|request| {
            let sizes = request.sizes(&ours).expect("sizes");
            [sizes.structure, sizes.scratch].map(|bytes| device.buffer("memory", bytes).expect("memory"))
        });
        let placements = requests.iter().zip(&memory).map(|(request, [structure, scratch])| Placement {
            request,
            structure: structure.region(),
            scratch: scratch.region(),
        });
        let placements: Vec<_> = placements.collect();
        // SAFETY: recorded by `run`, and all memory lives until it has run.
        device.run(None, |recorder| unsafe { ours.record(recorder.commands(), &placements) }).expect("builds");
        assert_eq!(device.pipelines().len(), warm, "{flags:?}: not all were made ahead");

        if flags.contains(Flags::ALLOW_UPDATE) {
            let [structure, scratch] = &memory[0];
            let copy = device.buffer("another structure", structure.bytes()).expect("memory");
            let triangles = vk::AccelerationStructureGeometryTrianglesDataKHR::default()
                .vertex_format(vk::Format::R32G32B32_SFLOAT)
                .vertex_data(vk::DeviceOrHostAddressConstKHR { device_address: vertices.address() })
                .vertex_stride(12)
                .max_vertex(8999)
                .index_type(vk::IndexType::UINT32)
                .index_data(vk::DeviceOrHostAddressConstKHR { device_address: indices.address() });
            let geometry = [vk::AccelerationStructureGeometryKHR::default()
                .geometry_type(vk::GeometryTypeKHR::TRIANGLES)
                .geometry(vk::AccelerationStructureGeometryDataKHR { triangles })];
            let info = vk::AccelerationStructureBuildGeometryInfoKHR::default()
                .ty(vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL)
                .mode(vk::BuildAccelerationStructureModeKHR::UPDATE)
                .flags(flags)
                .src_acceleration_structure(vk::AccelerationStructureKHR::from_raw(structure.address()))
                .dst_acceleration_structure(vk::AccelerationStructureKHR::from_raw(copy.address()))
                .geometries(&geometry)
                .scratch_data(vk::DeviceOrHostAddressKHR { device_address: scratch.address() });
            let range = [vk::AccelerationStructureBuildRangeInfoKHR::default().primitive_count(100)];
            // SAFETY: as above.
            let update = |commands| unsafe { ours.cmd_build_acceleration_structures(commands, &[info], &[&range]) };
            device.run(None, |recorder| update(recorder.commands())).expect("an update");
            assert_eq!(device.pipelines().len(), warm, "not all of an update were made ahead");
        }
    }
}
