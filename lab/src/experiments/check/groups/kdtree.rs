//! kd-trees: builds by every schedule, and objects that come and go.

use crate::device::{Buffer, Device};
use crate::experiments::check::cases::{Cases, Found, same, same_all};
use crate::experiments::check::corpus::{self, Mesh};
use crate::experiments::check::shapes::{Corners, icosphere, placed, soup};
use crate::experiments::check::twins::{PLENTY, PLENTY_TO_MERGE};
use crate::subjects::build_memory::DeviceMesh;
use hedgerow::bvh::layout::status;
use hedgerow::kdtree::builder::{KdBuilder, KdOptions, KdReport, KdSchedule};
use hedgerow::kdtree::layout::{KdHeader, KdTree};
use hedgerow::kdtree::merge::{self, MergeCapacity, MergeMemory, Merger, Object};
use hedgerow::kdtree::twin;

fn meshes(cases: &Cases<'_>) -> Vec<Mesh> {
    let sphere = corpus::soup("a sphere", placed(&icosphere(3), 1.0, [0.1, 0.2, 0.3]));
    let random = |count: usize| corpus::random(&format!("{count} triangles"), count, [-0.5; 3], [1.0; 3]);
    let small = [0, 1, 2, 65, 1025].map(random);
    let hard = corpus::meshes().into_iter().chain([random(9000)]);
    small.into_iter().chain([sphere]).chain(hard.filter(|_| !cases.quick)).collect()
}

pub fn build(cases: &mut Cases<'_>) {
    let schedules: &[(KdSchedule, Option<u32>)] = match cases.quick {
        true => &[(KdSchedule::Chain, None), (KdSchedule::Persistent, None), (KdSchedule::AcrossLevels, None)],
        false => &[
            (KdSchedule::Chain, None),
            (KdSchedule::Persistent, Some(1)),
            (KdSchedule::Persistent, Some(64)),
            (KdSchedule::AcrossLevels, Some(1)),
            (KdSchedule::AcrossLevels, Some(64)),
        ],
    };
    let cuts: &[(u32, u32)] = if cases.quick { &[(32, 32)] } else { &[(128, 32), (7, 4)] };
    for mesh in meshes(cases) {
        for &(bins, exact) in cuts {
            let options = KdOptions { bins, exact, estimate: Some(PLENTY), ..KdOptions::DEFAULT };
            for &(schedule, workgroups) in schedules {
                let what = format!("{}, {bins} bins, exact {exact}, {schedule}, {workgroups:?} workgroups", mesh.0);
                let options = KdOptions { schedule: Some(schedule), workgroups, ..options };
                cases.case(what, |device| built_as_on_host(device, &mesh, &options));
            }
        }
    }
}

/// Memory for a build: whatever was there before changes nothing.
fn garbage<'a>(device: &'a Device, name: &str, bytes: u64) -> crate::Result<Buffer<'a>> {
    device.upload(name, &vec![0xA5u8; bytes as usize])
}

fn built_as_on_host(device: &Device, (_, positions, triangles): &Mesh, options: &KdOptions) -> Found {
    let expected = twin::builder::build(positions, triangles, options)?;
    expected.validate()?;
    let mesh = DeviceMesh::new(device, positions, triangles)?;
    let builder = KdBuilder::new(device, options, mesh.input.primitive_count)?;
    let sizes = builder.sizes();
    let structure = garbage(device, "structure", sizes.structure)?;
    let scratch = garbage(device, "scratch", sizes.scratch)?;
    device.run(None, |recorder| builder.record(recorder, &mesh.input, structure.region(), scratch.region()))?;
    let report: KdReport = scratch.read_at(builder.report_range().start, 1)[0];
    same("out of room", &(report.status & status::OUT_OF_ROOM), &0)?;
    compare(&KdTree::from_bytes(&structure.read::<u8>(sizes.structure as usize))?, &expected)
}

fn compare(got: &KdTree, expected: &KdTree) -> Found {
    let without_room = |tree: &KdTree| KdHeader { node_room: 0, reference_room: 0, record_room: 0, ..tree.header };
    same("header", &without_room(got), &without_room(expected))?;
    let contents = |tree: &KdTree| tree.nodes.iter().map(|node| node.content()).collect::<Vec<_>>();
    same_all("node", &contents(got), &contents(expected))?;
    same_all("reference", &got.references, &expected.references)?;
    same_all("record", &got.records, &expected.records)
}

/// What stands still, and objects that come and go.
type World = (&'static str, Corners, Vec<Corners>);

pub fn merge(cases: &mut Cases<'_>) {
    let sphere = |scale: f32, at: [f32; 3]| placed(&icosphere(3), scale, at);
    let worlds: [World; 6] = [
        ("one in a soup", soup(3000, 0.1, 1), vec![sphere(0.3, [0.1, 0.2, 0.3])]),
        ("one still", soup(1, 0.5, 6), vec![soup(100, 0.5, 7)]),
        ("overlapping", soup(500, 0.2, 2), vec![sphere(0.3, [0.1; 3]), soup(300, 0.3, 3), sphere(0.2, [0.2; 3])]),
        ("outside", sphere(0.5, [0.0; 3]), vec![sphere(0.5, [2.0, 0.1, 0.0]), sphere(0.1, [-0.2, -3.0, 0.0])]),
        ("nothing still", Corners::new(), vec![sphere(0.5, [0.0; 3]), soup(100, 0.2, 5)]),
        ("large in small", sphere(0.5, [0.0; 3]), vec![soup(40, 5.0, 9)]),
    ];
    for (name, still, objects) in worlds.iter().take(if cases.quick { 2 } else { 6 }) {
        // The pool's kernels take long to compile; the build's have been tried.
        let schedules = [KdSchedule::Chain, KdSchedule::Persistent];
        for schedule in schedules.into_iter().take(if cases.quick { 1 } else { 2 }) {
            cases.case(format!("{name}, {schedule}"), |device| merged_as_on_host(device, still, objects, schedule));
        }
    }
}

fn merged_as_on_host(device: &Device, still: &Corners, objects: &[Corners], schedule: KdSchedule) -> Found {
    let options = merge::MergeOptions {
        build: KdOptions { schedule: Some(schedule), ..KdOptions::DEFAULT },
        estimate: PLENTY_TO_MERGE,
    };
    let (_, positions, triangles) = corpus::soup("", still.clone());
    let meshes: Vec<Mesh> = objects.iter().map(|corners| corpus::soup("object", corners.clone())).collect();
    let most = MergeCapacity {
        objects: meshes.len() as u32,
        triangles: meshes.iter().map(|(_, _, triangles)| triangles.len() as u32).sum(),
    };
    let still =
        twin::builder::build(&positions, &triangles, &options.build)?.with_room(Merger::room(&options, most))?;
    let merger = Merger::new(device, &options, &still.header, most)?;
    let before = still.to_bytes();
    let structure = device.upload("structure", &before)?;
    let sizes = merger.sizes();
    let scratch = garbage(device, "scratch", sizes.scratch)?;
    let undo = garbage(device, "undo", sizes.undo)?;

    let mut first_primitive = still.header.primitive_count;
    let (mut given, mut twins) = (Vec::new(), Vec::new());
    let mut uploaded: Vec<DeviceMesh<'_>> = Vec::new();
    for (_, positions, triangles) in &meshes {
        let mesh = DeviceMesh::new(device, positions, triangles)?;
        given.push(Object { input: mesh.input, first_primitive, tree: None });
        twins.push(twin::merge::HostObject { first_primitive, positions, triangles });
        uploaded.push(mesh);
        first_primitive += triangles.len() as u32;
    }
    let KdOptions { bins, exact, costs, .. } = options.build;
    let expected = twin::merge::merge(&still, &twins, costs, (bins, exact))?;
    expected.validate()?;

    let memory = || MergeMemory { structure: structure.region(), scratch: scratch.region(), undo: undo.region() };
    let tree = || KdTree::from_bytes(&structure.read::<u8>(before.len()));
    device.run(None, |recorder| merger.record(recorder, memory(), &given))?;
    let report: merge::MergeReport = scratch.read_at(merger.report_range().start, 1)[0];
    same("out of room", &(report.status & status::OUT_OF_ROOM), &0)?;
    compare(&tree()?, &expected)?;
    device.run(None, |recorder| merger.restore(recorder, memory()))?;
    let is_as_before = tree()?.to_bytes() == KdTree::from_bytes(&before)?.to_bytes();
    same("the tree after a restore is the static one", &is_as_before, &true)
}
