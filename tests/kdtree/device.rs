//! kd-trees built on the device equal those of the host, by the chain and by any number of persistent workgroups, level by level and
//! across levels.

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

/// The schedules with a pool.
const POOLS: [KdSchedule; 2] = [KdSchedule::Persistent, KdSchedule::AcrossLevels];

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
    built_with(input, options, 0)
}

/// Given so many bytes of scratch memory more than the builder asks for.
fn built_with(input: &Input, options: &KdOptions, more_scratch: u64) -> (KdTree, KdReport) {
    let device = device();
    let builder = KdBuilder::new(device, options, input.primitive_count).expect("options that can be used");
    let mut sizes = builder.sizes();
    sizes.scratch += more_scratch;
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

/// As one geometry and as several, by every schedule.
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
        arena: 800.0,
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
        for schedule in [KdSchedule::Chain, KdSchedule::Persistent, KdSchedule::AcrossLevels] {
            let options = KdOptions { schedule: Some(schedule), geometry_count, ..with };
            let (got, report) = built_of(&Input { source, primitive_count: first }, &options);
            assert_eq!(report.status & status::OUT_OF_ROOM, 0, "{report:?}");
            assert_same(&got, &expected, &format!("{source:?} {schedule}"));
        }
    }
}

#[test]
fn every_format_and_several_geometries_give_the_bytes_of_the_host() {
    // Each format once. The same code reads them for BVHs, and bvh::geometry tests each vertex format with each index format.
    let index_formats = [IndexFormat::NONE, IndexFormat::U8, IndexFormat::U32, IndexFormat::U16];
    for (i, vertex_format) in VertexFormat::ALL.into_iter().enumerate() {
        let (padding, transform) = if i % 2 == 0 { (0, None) } else { (4, Some(MOVED)) };
        let geometry = Owned::random(vertex_format, index_formats[i % 4], padding, 60, 7);
        assert_geometries_as_on_the_host(&[Owned { transform, ..geometry }]);
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
        for (schedule, workgroups) in POOLS.into_iter().flat_map(|pool| [1, 2, 7, 64, 1024].map(|of| (pool, of))) {
            let options = KdOptions {
                schedule: Some(schedule),
                workgroups: Some(workgroups),
                estimate: Some(PLENTY),
                ..KdOptions::DEFAULT
            };
            let what = format!("{}, {schedule}, {workgroups} workgroups", mesh.0);
            let (got, report) = built(&mesh, &options);
            assert_eq!(report.status & status::OUT_OF_ROOM, 0, "{what}: {report:?}");
            assert_same(&got, &expected, &what);
        }
    }
}

#[test]
fn across_levels_bins_and_exact_splits_give_the_bytes_of_the_host() {
    for mesh in meshes() {
        for (bins, exact) in [(7, 4), (256, 5)] {
            let schedule = Some(KdSchedule::AcrossLevels);
            let options = KdOptions { bins, exact, schedule, estimate: Some(PLENTY), ..KdOptions::DEFAULT };
            let what = format!("{} bins {bins} exact {exact}", mesh.0);
            let (got, report) = built(&mesh, &options);
            assert_eq!(report.status & status::OUT_OF_ROOM, 0, "{what}: {report:?}");
            assert_same(&got, &on_host(&mesh, &options), &what);
        }
    }
}

/// What is counted of the pool: every chunk of a task that workers share is taken out of it, or is the last of a phase that whoever
/// ended the phase before went on with.
#[test]
fn across_levels_the_report_counts_retrievals_and_those_that_were_skipped() {
    let mesh = corpus::random("random 9000", 9000, [-0.5; 3], [1.0; 3]);
    let options = KdOptions { schedule: Some(KdSchedule::AcrossLevels), ..KdOptions::DEFAULT };
    let (tree, report) = built(&mesh, &options);
    let by_one = built(&mesh, &KdOptions { workgroups: Some(1), ..options }).1;
    for report in [&report, &by_one] {
        // Each cell above subtrees takes three steps, and each subtree one; cells that are shared take more: how many, the chunks of
        // the device decide. Who ends the first or the second step of a cell that is divided goes on with the next.
        let steps = report.retrievals + report.skipped_retrievals;
        assert!(steps >= 2 * report.level_nodes - report.subtrees, "{report:?}");
        let divided = (report.level_nodes - 1) / 2;
        assert!(report.retrievals > 0 && report.skipped_retrievals >= 2 * divided, "{report:?}");
        assert_eq!(report.level_nodes + report.subtree_nodes, tree.header.node_count, "{report:?}");
        assert_eq!(report.cut_references + report.subtree_references, tree.header.reference_count, "{report:?}");
        assert!(report.arena > 9000, "{report:?}");
    }
    // Nobody waits for a worker that is alone.
    let again = built(&mesh, &KdOptions { workgroups: Some(1), ..options }).1;
    assert_eq!(by_one, again, "one worker does the same each time");
}

/// An arena grows into what the caller gave, beyond what the builder has asked for.
#[test]
fn across_levels_a_build_takes_what_it_needs_of_the_memory_that_it_is_given() {
    let mesh = corpus::random("random 3000", 3000, [-0.5; 3], [1.0; 3]);
    let (_, positions, triangles) = &mesh;
    let vertices = device().upload("positions", positions).expect("memory");
    let indices = device().upload("indices", triangles).expect("memory");
    let input = Input::mesh(vertices.address(), positions.len() as u32, indices.address(), 3000);
    let schedule = Some(KdSchedule::AcrossLevels);
    let plenty = KdOptions { schedule, estimate: Some(PLENTY), ..KdOptions::DEFAULT };
    let needed = built_of(&input, &plenty).1.arena;
    let little = KdOptions { estimate: Some(KdEstimate { arena: 1.0, ..PLENTY }), ..plenty };
    let (cut, report) = built_of(&input, &little);
    assert_ne!(report.status & status::OUT_OF_ROOM, 0, "{report:?}");
    assert!(report.arena < needed, "{report:?}");
    cut.validate().expect("a valid tree");
    assert!(cut.header.reference_count < on_host(&mesh, &plenty).header.reference_count, "some cells are leaves");
    let (got, report) = built_with(&input, &little, 64 * u64::from(needed));
    assert_eq!(report.status & status::OUT_OF_ROOM, 0, "{report:?}");
    assert_same(&got, &on_host(&mesh, &plenty), "with more memory");
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
    let of_levels = short.map(|estimate| (Some(KdSchedule::Persistent), estimate));
    let across = [
        KdEstimate { arena: 1.0, ..plenty },
        KdEstimate { level_nodes: 0.0, subtree_nodes: 0.1, ..plenty },
        KdEstimate { cut_references: 0.0, subtree_references: 0.0, ..plenty },
        KdEstimate { arena: 0.0, level_nodes: 0.0, subtree_nodes: 0.0, ..plenty },
    ];
    let across = across.map(|estimate| (Some(KdSchedule::AcrossLevels), estimate));
    for (schedule, estimate) in of_levels.into_iter().chain(across) {
        let mut options = KdOptions { schedule, estimate: Some(estimate), ..KdOptions::DEFAULT };
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
            // A cell that is cut off may have as many references as its leaves would, but they are nodes that are not there.
            assert!(got.header.node_count < expected.header.node_count, "{estimate:?}: {:?}", got.header);
            assert!(got.header.reference_count <= expected.header.reference_count, "{estimate:?}: {:?}", got.header);
            assert!(!should_suffice && builds < 8, "{estimate:?}: {report:?}");
            // Of levels that were cut off nothing is known.
            should_suffice = report.ended == 0;
            options.estimate = Some(report.estimate(3000));
        }
        assert!(builds > 1, "{estimate:?} was enough");
    }
}

/// The same across levels. Whether a tree is whole depends on the memory of the structure alone, not on who was first.
#[test]
fn across_levels_whatever_is_short_by_little_gives_a_valid_tree() {
    let sphere = corpus::soup("sphere", placed(&icosphere(4), 1.0, [0.1, 0.2, 0.3]));
    let schedule = Some(KdSchedule::AcrossLevels);
    for mesh in [sphere, corpus::random("random 9000", 9000, [-0.5; 3], [1.0; 3])] {
        let plenty = KdOptions { schedule, estimate: Some(PLENTY), ..KdOptions::DEFAULT };
        let expected = on_host(&mesh, &plenty);
        let header = &expected.header;
        let each = |count: u32| count as f32 / header.primitive_count as f32;
        let enough = built(&mesh, &plenty).1.estimate(header.primitive_count);
        // Of nodes and references, builders add a few.
        let of_nodes = |factor: f32| (each(header.node_count) * factor, header.node_count as f32 * factor + 256.0);
        for factor in [0.98, 0.95, 0.9, 0.8, 0.5, 0.2] {
            let (nodes, node_room) = of_nodes(factor);
            let references = each(header.reference_count) * factor;
            let reference_room = header.reference_count as f32 * factor + 512.0;
            let cases = [
                (KdEstimate { level_nodes: nodes, subtree_nodes: 0.0, ..enough }, node_room < header.node_count as f32),
                (
                    KdEstimate { cut_references: references, subtree_references: 0.0, ..enough },
                    reference_room < header.reference_count as f32,
                ),
                (KdEstimate { arena: enough.arena * factor, ..enough }, false),
            ];
            for (estimate, is_short) in cases {
                let what = format!("{} {estimate:?}", mesh.0);
                let (got, report) = built(&mesh, &KdOptions { estimate: Some(estimate), ..plenty });
                got.validate().unwrap_or_else(|error| panic!("{what}: {error}"));
                assert_eq!(got.header.status, report.status, "{what}");
                if report.status & status::OUT_OF_ROOM == 0 {
                    assert!(!is_short, "{what}: {report:?}");
                    assert_same(&got, &expected, &what);
                }
            }
        }
    }
}

/// A little less of one thing, or much less: other trees, none of them wrong.
#[test]
fn whatever_is_short_by_little_gives_a_valid_tree() {
    let sphere = corpus::soup("sphere", placed(&icosphere(4), 1.0, [0.1, 0.2, 0.3]));
    for mesh in [sphere, corpus::random("random 9000", 9000, [-0.5; 3], [1.0; 3])] {
        let expected = on_host(&mesh, &KdOptions::DEFAULT);
        // Across levels there are other things.
        let schedule =
            (KdOptions::DEFAULT.schedule_on(device()) == KdSchedule::AcrossLevels).then_some(KdSchedule::Persistent);
        let with = KdOptions { schedule, ..KdOptions::DEFAULT };
        let enough = built(&mesh, &KdOptions { estimate: Some(PLENTY), ..with }).1.estimate(mesh.2.len() as u32);
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
                let (got, report) = built(&mesh, &KdOptions { estimate: Some(estimate), ..with });
                got.validate().unwrap_or_else(|error| panic!("{what}: {error}"));
                if report.status & status::OUT_OF_ROOM == 0 {
                    assert_same(&got, &expected, &what);
                }
            }
        }
    }
}

/// Builds one after the other in the same memory, by all numbers of workgroups up to 1,024.
fn many_builds(builds: u32, schedule: KdSchedule) {
    let device = device();
    let mesh = corpus::random("random 400", 400, [-0.5; 3], [1.0; 3]);
    let expected = on_host(&mesh, &KdOptions::DEFAULT);
    let (_, positions, triangles) = &mesh;
    let vertices = device.upload("positions", positions).expect("memory");
    let indices = device.upload("indices", triangles).expect("memory");
    let input = Input::mesh(vertices.address(), positions.len() as u32, indices.address(), 400);
    let builder = |workgroups| {
        let options = KdOptions { schedule: Some(schedule), workgroups: Some(workgroups), ..KdOptions::DEFAULT };
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
        assert_same(&got, &expected, &format!("{schedule}, build {build}"));
    }
}

#[test]
fn builds_in_a_row_give_the_same_bytes() {
    for pool in POOLS {
        many_builds(300, pool);
    }
}

#[test]
#[ignore = "ten thousand builds take more than a minute; the same with 300 is not ignored"]
fn ten_thousand_builds_in_a_row_give_the_same_bytes() {
    many_builds(10_000, KdSchedule::Persistent);
}

#[test]
#[ignore = "ten thousand builds take more than a minute; the same with 300 is not ignored"]
fn ten_thousand_builds_across_levels_give_the_same_bytes() {
    many_builds(10_000, KdSchedule::AcrossLevels);
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
