//! kd-trees built on the device equal those of the host, by the chain and by any number of persistent workgroups.

use crate::common::corpus::{self, Mesh};
use crate::common::device;
use crate::common::geometries::{MOVED, Owned};
use crate::common::shapes::{icosphere, placed};
use crate::common::twins::PLENTY;
use hedgerow::bvh::builder::{Input, Source};
use hedgerow::bvh::geometry::{Geometry, GeometryFlags, IndexFormat, VertexFormat};
use hedgerow::bvh::layout::status;
use hedgerow::gpu::Region;
use hedgerow::kdtree::builder::{KdBuilder, KdEstimate, KdOptions, KdReport, KdSchedule};
use hedgerow::kdtree::layout::{KdHeader, KdTree};
use hedgerow::kdtree::twin;

fn on_host((name, positions, triangles): &Mesh, options: &KdOptions) -> KdTree {
    twin::builder::build(positions, triangles, options).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// The structure and the report of a build.
fn built((_, positions, triangles): &Mesh, options: &KdOptions) -> (KdTree, KdReport) {
    let vertices = device().upload("positions", positions).expect("memory");
    let indices = device().upload("indices", triangles).expect("memory");
    built_of(
        &Input::mesh(vertices.address(), positions.len() as u32, indices.address(), triangles.len() as u32),
        options,
    )
}

fn built_of(input: &Input, options: &KdOptions) -> (KdTree, KdReport) {
    let device = device();
    let builder = KdBuilder::new(device, options, input.primitive_count).expect("options that can be used");
    let sizes = builder.sizes();
    // Whatever was there before changes nothing.
    let garbage = |bytes: u64| vec![0xA5u8; bytes as usize];
    let buffer = |name: &str, bytes: u64| device.buffer(name, bytes).expect("memory");
    let (structure, scratch) = (buffer("structure", sizes.structure), buffer("scratch", sizes.scratch));
    structure.write(&garbage(sizes.structure));
    scratch.write(&garbage(sizes.scratch));
    device
        .run(None, |recorder| builder.record(recorder, input, structure.region(), scratch.region()))
        .expect("a build");
    let range = builder.report_range();
    let scratch: Vec<u8> = scratch.read(range.end as usize);
    let report = bytemuck::pod_read_unaligned(&scratch[range.start as usize..]);
    (KdTree::from_bytes(&structure.read::<u8>(sizes.structure as usize)).expect("a kd-tree"), report)
}

/// The header without what tells of room.
fn without_room(header: &KdHeader) -> KdHeader {
    KdHeader { node_room: 0, reference_room: 0, record_room: 0, ..*header }
}

#[track_caller]
fn assert_same(got: &KdTree, expected: &KdTree, what: &str) {
    assert_eq!(without_room(&got.header), without_room(&expected.header), "{what}: header");
    let differs = got.nodes.iter().zip(&expected.nodes).position(|(a, b)| a != b);
    assert_eq!(differs, None, "{what}: {:?}", differs.map(|i| (got.nodes[i].content(), expected.nodes[i].content())));
    assert_eq!(got.references, expected.references, "{what}: references");
    assert_eq!(got.records, expected.records, "{what}: records");
    assert_eq!(got.geometries, expected.geometries, "{what}: geometries");
}

fn meshes() -> Vec<Mesh> {
    let sphere = corpus::soup("sphere", placed(&icosphere(4), 1.0, [0.1, 0.2, 0.3]));
    let random = corpus::random("random 9000", 9000, [-0.5; 3], [1.0; 3]);
    corpus::meshes().into_iter().chain([sphere, random]).collect()
}

#[test]
fn the_chain_gives_the_bytes_of_the_host() {
    for mesh in meshes() {
        for (bins, exact) in [(128, 32), (7, 4), (32, 64)] {
            let schedule = Some(KdSchedule::Chain);
            let options = KdOptions { bins, exact, schedule, estimate: Some(PLENTY), ..KdOptions::DEFAULT };
            let what = format!("{} bins {bins} exact {exact}", mesh.0);
            let expected = on_host(&mesh, &options);
            expected.validate().unwrap_or_else(|error| panic!("{what}: {error}"));
            let (got, report) = built(&mesh, &options);
            assert_eq!(report.status & status::OUT_OF_ROOM, 0, "{what}: {report:?}");
            assert_same(&got, &expected, &what);
        }
    }
}

/// As one geometry and as several, by both schedules.
#[track_caller]
fn assert_geometries_as_on_the_host(geometries: &[Owned]) {
    // Each triangle is as large as all of them.
    let estimate = KdEstimate {
        level_references: 200.0,
        level_nodes: 200.0,
        subtree_nodes: 200.0,
        cut_references: 200.0,
        subtree_references: 400.0,
        subtrees: 200.0,
    };
    let with = KdOptions { estimate: Some(estimate), ..KdOptions::DEFAULT };
    let corners = geometries.iter().flat_map(|g| g.view().corners().collect::<Vec<_>>());
    let expected = twin::builder::build_corners(corners, &with).expect("a tree");
    let flags = |i: usize| if i % 3 == 1 { GeometryFlags::OPAQUE } else { GeometryFlags::NONE };
    let counts = geometries.iter().enumerate().map(|(i, g)| (g.primitive_count, flags(i).bits()));
    let expected = expected.with_geometries(&counts.collect::<Vec<_>>());
    expected.validate().expect("a valid tree");
    let mut first = 0;
    let (mut records, mut memory) = (Vec::new(), Vec::new());
    for (i, geometry) in geometries.iter().enumerate() {
        let (record, buffers) = geometry.upload(first, 1);
        first += geometry.primitive_count;
        records.push(Geometry { flags: flags(i), ..record });
        memory.push(buffers);
    }
    let buffer = device().upload("records", &records).expect("memory");
    let geometry_count = records.len() as u32;
    let several = Source::Several { records: buffer.address(), count: geometry_count };
    for source in [several].into_iter().chain((records.len() == 1).then(|| Source::One(records[0]))) {
        for schedule in [KdSchedule::Chain, KdSchedule::Persistent] {
            let options = KdOptions { schedule: Some(schedule), geometry_count, ..with };
            let (got, report) = built_of(&Input { source, primitive_count: first }, &options);
            assert_eq!(report.status & status::OUT_OF_ROOM, 0, "{report:?}");
            assert_same(&got, &expected, &format!("{source:?} {schedule}"));
        }
    }
}

#[test]
fn every_format_and_several_geometries_give_the_bytes_of_the_host() {
    for vertex_format in VertexFormat::ALL {
        for index_format in [IndexFormat::NONE, IndexFormat::U8, IndexFormat::U32] {
            for (padding, transform) in [(0, None), (4, Some(MOVED))] {
                let geometry = Owned::random(vertex_format, index_format, padding, 60, 7);
                assert_geometries_as_on_the_host(&[Owned { transform, ..geometry }]);
            }
        }
    }
    let geometry = |i: usize, count| {
        let (vertices, indices) = (VertexFormat::ALL[i % 6], IndexFormat::ALL[i % 4]);
        Owned::random(vertices, indices, 0, count, i as u64)
    };
    assert_geometries_as_on_the_host(&[geometry(0, 1), geometry(1, 1)]);
    assert_geometries_as_on_the_host(&[geometry(2, 0), geometry(3, 0)]);
    assert_geometries_as_on_the_host(&[2, 3, 4, 5, 6, 7].map(|i| geometry(i, [0, 70, 0, 0, 9, 0][i - 2])));
    assert_geometries_as_on_the_host(&(0..50).map(|i| geometry(i, (i as u32 * 7) % 13)).collect::<Vec<_>>());
}

#[test]
fn any_number_of_persistent_workgroups_gives_the_bytes_of_the_host() {
    for mesh in meshes() {
        let expected = on_host(&mesh, &KdOptions::DEFAULT);
        for workgroups in [1, 2, 7, 64, 1024] {
            let (schedule, workgroups) = (Some(KdSchedule::Persistent), Some(workgroups));
            let options = KdOptions { schedule, workgroups, estimate: Some(PLENTY), ..KdOptions::DEFAULT };
            assert_same(&built(&mesh, &options).0, &expected, &format!("{}, {workgroups:?} workgroups", mesh.0));
        }
    }
}

/// Whatever there is too little of, the tree is valid, the status says so, and the report says what would have sufficed.
#[test]
fn what_is_out_of_room_is_a_leaf_and_the_report_says_what_would_suffice() {
    let mesh = corpus::random("random 3000", 3000, [-0.5; 3], [1.0; 3]);
    let expected = on_host(&mesh, &KdOptions::DEFAULT);
    let plenty = KdEstimate::for_exact(KdOptions::DEFAULT.exact);
    let short = [
        KdEstimate { level_references: 1.0, ..plenty },
        KdEstimate { level_nodes: 0.0, ..plenty },
        KdEstimate { subtree_nodes: 0.1, ..plenty },
        KdEstimate { cut_references: 1.0, ..plenty },
        KdEstimate { subtree_references: 1.0, ..plenty },
        KdEstimate { subtrees: 0.0, ..plenty },
    ];
    for estimate in short {
        let mut options = KdOptions { estimate: Some(estimate), ..KdOptions::DEFAULT };
        let (mut builds, mut should_suffice) = (0, false);
        loop {
            let (got, report) = built(&mesh, &options);
            got.validate().unwrap_or_else(|error| panic!("{estimate:?}: {error}"));
            assert_eq!(got.header.status, report.status, "{estimate:?}");
            builds += 1;
            if report.status & status::OUT_OF_ROOM == 0 {
                assert_same(&got, &expected, &format!("{estimate:?}"));
                break;
            }
            assert!(got.header.reference_count < expected.header.reference_count, "{estimate:?}");
            assert!(!should_suffice && builds < 8, "{estimate:?}: {report:?}");
            // Of levels that were cut off nothing is known.
            should_suffice = report.ended == 0;
            options.estimate = Some(report.estimate(3000));
        }
        assert!(builds > 1, "{estimate:?} was enough");
    }
}

/// A little less of one thing, or much less: other trees, none of them wrong.
#[test]
fn whatever_is_short_by_little_gives_a_valid_tree() {
    let sphere = corpus::soup("sphere", placed(&icosphere(4), 1.0, [0.1, 0.2, 0.3]));
    for mesh in [sphere, corpus::random("random 9000", 9000, [-0.5; 3], [1.0; 3])] {
        let expected = on_host(&mesh, &KdOptions::DEFAULT);
        let enough =
            built(&mesh, &KdOptions { estimate: Some(PLENTY), ..KdOptions::DEFAULT }).1.estimate(mesh.2.len() as u32);
        let fields: [fn(&mut KdEstimate) -> &mut f32; 6] = [
            |e| &mut e.level_references,
            |e| &mut e.level_nodes,
            |e| &mut e.subtree_nodes,
            |e| &mut e.cut_references,
            |e| &mut e.subtree_references,
            |e| &mut e.subtrees,
        ];
        for field in fields {
            for factor in [0.98, 0.95, 0.9, 0.8, 0.5] {
                let mut estimate = enough;
                *field(&mut estimate) *= factor;
                let what = format!("{} {estimate:?}", mesh.0);
                let (got, report) = built(&mesh, &KdOptions { estimate: Some(estimate), ..KdOptions::DEFAULT });
                got.validate().unwrap_or_else(|error| panic!("{what}: {error}"));
                if report.status & status::OUT_OF_ROOM == 0 {
                    assert_same(&got, &expected, &what);
                }
            }
        }
    }
}

/// Builds one after the other in the same memory, by all numbers of workgroups up to 1,024.
fn many_builds(builds: u32) {
    let device = device();
    let mesh = corpus::random("random 400", 400, [-0.5; 3], [1.0; 3]);
    let expected = on_host(&mesh, &KdOptions::DEFAULT);
    let (_, positions, triangles) = &mesh;
    let vertices = device.upload("positions", positions).expect("memory");
    let indices = device.upload("indices", triangles).expect("memory");
    let input = Input::mesh(vertices.address(), positions.len() as u32, indices.address(), 400);
    let builder = |workgroups| {
        let options =
            KdOptions { schedule: Some(KdSchedule::Persistent), workgroups: Some(workgroups), ..KdOptions::DEFAULT };
        KdBuilder::new(device, &options, 400).expect("options that can be used")
    };
    let most = builder(1024).sizes();
    let structure = device.buffer("structure", most.structure).expect("memory");
    let scratch = device.buffer("scratch", most.scratch).expect("memory");
    for build in 0..builds {
        let builder = builder(build * 37 % 1024 + 1);
        device
            .run(None, |recorder| builder.record(recorder, &input, structure.region(), scratch.region()))
            .expect("a build");
        let bytes = structure.read::<u8>(builder.sizes().structure as usize);
        let got = KdTree::from_bytes(&bytes).expect("a kd-tree");
        assert_same(&got, &expected, &format!("build {build}"));
    }
}

#[test]
fn builds_in_a_row_give_the_same_bytes() {
    many_builds(300);
}

#[test]
#[ignore = "ten thousand builds take more than a minute; the same with 300 is not ignored"]
fn ten_thousand_builds_in_a_row_give_the_same_bytes() {
    many_builds(10_000);
}

#[test]
fn options_that_cannot_be_used_are_refused_by_name() {
    let refused = |options: KdOptions, count: u32, says: &str| {
        let error = KdBuilder::new(device(), &options, count).expect_err("it cannot be used").to_string();
        assert!(error.contains(says), "{error}");
    };
    let with = KdOptions::DEFAULT;
    refused(KdOptions { bins: 1, ..with }, 1, "1 bins; a kd-tree is built by 2 to 256");
    refused(KdOptions { bins: 257, ..with }, 1, "257 bins");
    refused(KdOptions { exact: 3, ..with }, 1, "exact splits of 3 references; it is 4 to 64");
    refused(KdOptions { exact: 65, ..with }, 1, "exact splits of 65 references");
    refused(KdOptions { workgroups: Some(0), ..with }, 1, "no workgroups");
    let mut costs = with.costs;
    costs.c_i = f32::NAN;
    refused(KdOptions { costs, ..with }, 1, "a cost of NaN");
    refused(with, u32::MAX, "a kd-tree holds at most 134217728; split the mesh");
    let builder = KdBuilder::new(device(), &with, 2).expect("options that can be used");
    let (sizes, input) = (builder.sizes(), Input::mesh(0, 0, 0, 2));
    let region = |bytes: u64| Region { address: 0x1000, bytes };
    let error_of = |input: &Input, structure, scratch| {
        let recorded = device().run(None, |recorder| builder.record(recorder, input, structure, scratch));
        recorded.expect_err("refused before anything runs").to_string()
    };
    let (structure, scratch) = (region(sizes.structure), region(sizes.scratch));
    assert!(error_of(&input, region(sizes.structure - 1), scratch).contains("memory for a kd-tree of"));
    assert!(error_of(&input, structure, region(sizes.scratch - 1)).contains("scratch memory for a kd-tree of"));
    assert!(error_of(&Input::mesh(0, 0, 0, 3), structure, scratch).contains('3'), "names the number");
}
