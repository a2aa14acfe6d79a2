//! kd-trees: built, traced, merged and restored, against the host's.

use super::meshes;
use super::tracers::traced;
use crate::common::corpus::{self, Mesh};
use crate::common::device;
use crate::common::shapes::{Corners, hard_rays, icosphere, placed, soup};
use crate::common::twins::{PLENTY, PLENTY_TO_MERGE};
use hedgerow::bvh::builder::Input;
use hedgerow::bvh::layout::status;
use hedgerow::kdtree::builder::{self, KdBuilder, KdOptions, KdSchedule};
use hedgerow::kdtree::layout::{KdHeader, KdTree};
use hedgerow::kdtree::merge::{self, MergeCapacity, MergeMemory, MergeReport, Merger, Object};
use hedgerow::kdtree::twin;
use hedgerow::trace::Query;
use hedgerow::trace::kd::Traversal;
use hedgerow::trace::kd::{KdTracer, TreeEntry};
use hedgerow::trace::twin::kd as kd_host;
use hedgerow_lab::device::Buffer;

const SCHEDULES: [KdSchedule; 2] = [KdSchedule::Chain, KdSchedule::Persistent];
/// Of builds; a merge has no other.
const BUILDS: [KdSchedule; 3] = [KdSchedule::Chain, KdSchedule::Persistent, KdSchedule::AcrossLevels];

fn with(schedule: KdSchedule) -> KdOptions {
    KdOptions { schedule: Some(schedule), estimate: Some(PLENTY), ..KdOptions::DEFAULT }
}

fn on_host((name, positions, triangles): &Mesh) -> KdTree {
    twin::builder::build(positions, triangles, &KdOptions::DEFAULT).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn uploaded((_, positions, triangles): &Mesh) -> (Input, [Buffer<'static>; 2]) {
    let vertices = device().upload("positions", positions).expect("memory");
    let indices = device().upload("indices", triangles).expect("memory");
    let input = Input::mesh(vertices.address(), positions.len() as u32, indices.address(), triangles.len() as u32);
    (input, [vertices, indices])
}

fn built(input: &Input, schedule: KdSchedule) -> Buffer<'static> {
    let builder = KdBuilder::new(device(), &with(schedule), input.primitive_count).expect("a builder");
    let sizes = builder.sizes();
    let [structure, scratch] =
        [sizes.structure, sizes.scratch].map(|bytes| device().buffer("tree", bytes).expect("memory"));
    device().run(None, |r| builder.record(r, input, structure.region(), scratch.region())).expect("a build");
    structure
}

#[track_caller]
fn assert_same(structure: &Buffer<'_>, bytes: u64, expected: &KdTree, what: &str) {
    let got = KdTree::from_bytes(&structure.read::<u8>(bytes as usize)).expect("a kd-tree");
    let without_room = |header: &KdHeader| KdHeader { node_room: 0, reference_room: 0, record_room: 0, ..*header };
    assert_eq!(without_room(&got.header), without_room(&expected.header), "{what}");
    assert!(got.nodes == expected.nodes, "{what}: nodes");
    assert_eq!(got.references, expected.references, "{what}");
    assert_eq!(got.records, expected.records, "{what}");
}

pub fn builds_and_hits_are_those_of_the_host() {
    for mesh in meshes() {
        let expected = on_host(&mesh);
        let (input, _memory) = uploaded(&mesh);
        for schedule in BUILDS {
            let structure = built(&input, schedule);
            assert_same(&structure, structure.bytes(), &expected, &format!("{} {schedule}", mesh.0));
        }
    }
    let corners = soup(300, 0.2, 81);
    let tree = on_host(&corpus::soup("", corners.clone()));
    let rays = hard_rays(&corners, 300, 1.0, [0.0; 3], 82);
    for traversal in
        [Traversal::STACK, Traversal::RESTART, Traversal::PUSH_DOWN, Traversal::short_stack_with_push_down(4)]
    {
        let tracer = KdTracer::new(device(), traversal);
        for query in [Query::ClosestHit, Query::AnyHit] {
            let expected: Vec<_> = rays.iter().map(|ray| kd_host::trace(&tree, ray, query, traversal)).collect();
            let got = traced(&tree.to_bytes(), &rays, |r, buffers| tracer.record(r, query, buffers));
            assert_eq!(got, expected, "{traversal:?} {query:?}");
        }
        // As the only one of several.
        let structure = device().upload("structure", &tree.to_bytes()).expect("memory");
        let table = TreeEntry::table(&[(structure.address(), 0)]);
        let got = traced(bytemuck::cast_slice(&table), &rays, |r, buffers| {
            tracer.record_several(r, Query::ClosestHit, buffers)
        });
        let expected = rays.iter().map(|ray| kd_host::trace(&tree, ray, Query::ClosestHit, traversal).0);
        assert!(got.iter().map(|&(hit, _)| hit).eq(expected), "{traversal:?} of several");
    }
}

pub fn merges_and_restores_are_those_of_the_host() {
    let still = on_host(&corpus::soup("still", soup(1000, 0.1, 1)));
    let objects: [Corners; 2] = [placed(&icosphere(2), 0.3, [0.1, 0.2, 0.3]), soup(100, 0.3, 3)];
    for schedule in SCHEDULES {
        for pushed in [false, true] {
            merge(&still, &objects, schedule, pushed);
        }
    }
}

/// Merged, it is the host's tree; restored, the one that was there.
fn merge(still: &KdTree, objects: &[Corners], schedule: KdSchedule, pushed: bool) {
    let options = merge::MergeOptions { build: with(schedule), estimate: PLENTY_TO_MERGE };
    let triangles = objects.iter().map(|object| object.len() as u32).sum();
    let most = MergeCapacity { objects: objects.len() as u32, triangles };
    let still = still.clone().with_room(Merger::room(&options, most)).expect("room");
    let merger = Merger::new(device(), &options, &still.header, most).expect("a merger");
    let sizes = merger.sizes();
    let structure = device().upload("structure", &still.to_bytes()).expect("memory");
    let [scratch, undo] = [sizes.scratch, sizes.undo].map(|bytes| device().buffer("memory", bytes).expect("memory"));
    let memory = MergeMemory { structure: structure.region(), scratch: scratch.region(), undo: undo.region() };

    let meshes: Vec<Mesh> = objects.iter().map(|corners| corpus::soup("object", corners.clone())).collect();
    let inputs: Vec<_> = meshes.iter().map(uploaded).collect();
    let trees: Vec<_> = inputs.iter().map(|(input, _)| built(input, schedule)).collect();
    let mut first_primitive = still.header.primitive_count;
    let (mut given, mut marked) = (Vec::new(), Vec::new());
    for ((input, _), (tree, (_, positions, triangles))) in inputs.iter().zip(trees.iter().zip(&meshes)) {
        given.push(Object { input: *input, first_primitive, tree: pushed.then(|| tree.address()) });
        marked.push(twin::merge::HostObject { first_primitive, positions, triangles });
        first_primitive += triangles.len() as u32;
    }
    let builder::KdOptions { bins, exact, costs, .. } = KdOptions::DEFAULT;
    let expected = twin::merge::merge(&still, &marked, costs, (bins, exact)).expect("a merged tree");

    let what = format!("{schedule}, pushed: {pushed}");
    let bytes = still.header.offsets().bytes;
    let before = KdTree::from_bytes(&structure.read::<u8>(bytes as usize)).expect("a kd-tree").to_bytes();
    device().run(None, |r| merger.record(r, memory, &given)).expect("a merge");
    let report: MergeReport = scratch.read_at(merger.report_range().start, 1)[0];
    assert_eq!(report.status & status::OUT_OF_ROOM, 0, "{what}: {report:?}");
    assert_same(&structure, bytes, &expected, &what);
    device().run(None, |r| merger.restore(r, memory)).expect("a restore");
    let after = KdTree::from_bytes(&structure.read::<u8>(bytes as usize)).expect("a kd-tree").to_bytes();
    assert!(after == before, "{what}: the static tree is another");
}
