//! Copies of structures: clones, compaction, serialisation, and the figures that tell their sizes.

use crate::common::backends::{Backend, Built, Copies, Drivers, Ours, Traces, vk_geometry};
use crate::common::device;
use crate::common::geometries::Owned;
use crate::common::probe::{CONFIRM_ODD, ProbeRay, ProbeReport};
use crate::common::shapes::{Corners, hard_rays, ray, soup, tree_with};
use crate::common::world::{Part, World};
use hedgerow::accel::serialize::Head;
use hedgerow::accel::{self, Property, Tree};
use hedgerow::ash::vk;
use hedgerow::ash::vk::Handle;
use hedgerow::bvh::builder::{BuildOptions, Builder};
use hedgerow::bvh::codes::{Code, Codes};
use hedgerow::bvh::geometry::{Geometry, IndexFormat, Input, Primitives, Source, VertexFormat};
use hedgerow::bvh::layout::{self, BoxRecord, Bvh2, Child, Header, InstanceRecord, Record, status};
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::lbvh;
use hedgerow::bvh::wide::layout::Wide8q;
use hedgerow::geometry::Aabb;
use hedgerow::gpu::Recorder;
use hedgerow::gpu::Region;
use hedgerow::trace::twin::tracer::closest_hit;
use hedgerow::trace::{Hit, Ray};
use hedgerow_lab::device::{Buffer, DriverTracing};
use hedgerow_lab::random::SplitMix64;

type Mode = vk::CopyAccelerationStructureModeKHR;

/// A structure's bytes and those that the host makes of it by compacting.
struct Case {
    name: String,
    bytes: Vec<u8>,
    compacted: Vec<u8>,
}

impl Case {
    fn new<R: Record>(name: impl Into<String>, tree: &Bvh2<R>) -> Case {
        let name = name.into();
        tree.validate().unwrap_or_else(|e| panic!("{name}: {e}"));
        let compacted = tree.compacted();
        compacted.validate().unwrap_or_else(|e| panic!("{name}, compacted: {e}"));
        Case { name, bytes: tree.to_bytes(), compacted: compacted.to_bytes() }
    }

    /// Its nodes of eight, which have no holes.
    fn wide<R: Record>(name: impl std::fmt::Display, tree: &Bvh2<R>) -> Case {
        let bytes = Wide8q::of(tree).to_bytes();
        Case { name: format!("{name}, in nodes of eight"), compacted: bytes.clone(), bytes }
    }

    fn header(&self) -> Header {
        header_of(&self.bytes)
    }
}

fn header_of(structure: &[u8]) -> Header {
    bytemuck::pod_read_unaligned(&structure[..size_of::<Header>()])
}

const COLLAPSES: [Collapse; 2] = [Collapse::OFF, Collapse::SAH];

/// Triangles, every fifth of which is not finite where there are `holes`; of one geometry or of three.
fn triangles(count: usize, holes: bool, geometries: u32, collapse: Collapse) -> Bvh2 {
    let mut corners = soup(count, 0.2, count as u64);
    for triangle in corners.iter_mut().step_by(5).filter(|_| holes) {
        triangle[1][2] = f32::NAN;
    }
    let tree = tree_with(&corners, collapse);
    match geometries {
        1 => tree,
        // An empty one is among them.
        _ => tree.with_geometries(&[(count as u32 / 3, 1), (0, 0), (count as u32 - count as u32 / 3, 3)], 2),
    }
}

fn boxes(count: usize, collapse: Collapse) -> Bvh2<BoxRecord> {
    let boxes: Vec<Aabb> = soup(count, 0.05, 77).iter().map(|c| Aabb::around(c)).collect();
    let mut inside_out = boxes;
    for b in inside_out.iter_mut().step_by(7) {
        std::mem::swap(&mut b.lo, &mut b.hi);
    }
    lbvh::build_aabbs(&inside_out, Code::Emc64Var.full(), collapse)
}

/// Instances of structures at made-up addresses; every fourth is left out.
fn instances(count: u32) -> Bvh2<InstanceRecord> {
    instances_in(&soup_boxes(count), Code::Mc30.full())
}

fn instances_and_one_far(count: u32) -> Bvh2<InstanceRecord> {
    let far = Ok(Aabb { lo: [1e6; 3], hi: [2e6; 3] });
    let boxes: Vec<Result<Aabb, u32>> = soup_boxes(count).into_iter().chain([far]).collect();
    instances_in(&boxes, "emc64var+apart".parse().expect("codes")).with_far_told()
}

fn soup_boxes(count: u32) -> Vec<Result<Aabb, u32>> {
    let soup = soup(count as usize, 0.1, 5);
    let boxes = soup.iter().map(|corners| Aabb::around(corners)).enumerate();
    boxes.map(|(i, b)| if i % 4 == 1 { Err(status::BAD_INSTANCE) } else { Ok(b) }).collect()
}

fn instances_in(boxes: &[Result<Aabb, u32>], codes: Codes) -> Bvh2<InstanceRecord> {
    let record = |instance: u32| InstanceRecord {
        structure: if instance % 4 == 1 { 0 } else { 0x1_0000_0000 * u64::from(instance) + 256 },
        instance,
        index_and_mask: instance * 3,
        to_world: [[instance as f32; 4]; 3],
        ..bytemuck::Zeroable::zeroed()
    };
    lbvh::build_boxes(boxes, record, codes, Collapse::OFF)
}

fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for collapse in COLLAPSES {
        for count in [0, 1, 2, 3, 7, 100, 5000] {
            for (holes, geometries) in [(false, 1), (true, 1), (false, 3), (true, 3)] {
                let name = format!("{count} triangles, holes: {holes}, {geometries} geometries, {collapse:?}");
                let tree = triangles(count, holes, geometries, collapse);
                cases.push(Case::wide(&name, &tree));
                cases.push(Case::new(name, &tree));
            }
        }
        for count in [0, 1, 2, 7, 1000] {
            let (name, tree) = (format!("{count} boxes, {collapse:?}"), boxes(count, collapse));
            cases.push(Case::wide(&name, &tree));
            cases.push(Case::new(name, &tree));
        }
    }
    for count in [0, 1, 2, 9, 500] {
        let (name, tree) = (format!("{count} instances"), instances(count));
        cases.push(Case::wide(&name, &tree));
        cases.push(Case::new(name, &tree));
    }
    let (name, tree) = ("500 instances and one far away", instances_and_one_far(500));
    assert!(tree.header.near_node != 0 && Wide8q::of(&tree).header.near_node != 0);
    cases.push(Case::wide(name, &tree));
    cases.push(Case::new(name, &tree));
    // None of the triangles is left.
    let nowhere: Corners = vec![[[f32::INFINITY; 3]; 3]; 9];
    cases.push(Case::new("all inactive", &tree_with(&nowhere, Collapse::SAH)));
    cases
}

fn ours() -> accel::Device<'static> {
    accel::Device::new(device())
}

const GUARD: usize = 64;
const UNTOUCHED: u8 = 0xa5;

/// Memory of `bytes` bytes with a guard behind.
struct Guarded {
    buffer: Buffer<'static>,
    bytes: usize,
}

impl Guarded {
    fn new(bytes: usize) -> Guarded {
        let buffer = device().buffer("guarded", (bytes + GUARD) as u64).expect("memory");
        buffer.write(&vec![UNTOUCHED; bytes + GUARD]);
        Guarded { buffer, bytes }
    }

    fn of(content: &[u8]) -> Guarded {
        let memory = Guarded::new(content.len());
        memory.buffer.write(content);
        memory
    }

    /// The bytes, if the guard is whole.
    #[track_caller]
    fn read(&self) -> Vec<u8> {
        let mut all = self.buffer.read::<u8>(self.bytes + GUARD);
        assert!(
            all.split_off(self.bytes) == [UNTOUCHED; GUARD],
            "something is written behind the {} bytes",
            self.bytes
        );
        all
    }

    fn handle(&self) -> vk::AccelerationStructureKHR {
        vk::AccelerationStructureKHR::from_raw(self.buffer.address())
    }

    fn address(&self) -> u64 {
        self.buffer.address()
    }

    fn header(&self) -> Header {
        header_of(&self.read())
    }
}

fn run(record: impl FnOnce(&mut Recorder<'_>, vk::CommandBuffer) -> hedgerow::Result<()>) {
    let result = device().run(None, |recorder| {
        let commands = recorder.commands();
        record(recorder, commands)
    });
    result.expect("it runs");
}

fn copy(source: &Guarded, target: &Guarded, mode: Mode) {
    copy_of(source.handle(), target.handle(), mode);
}

fn copy_of(source: vk::AccelerationStructureKHR, target: vk::AccelerationStructureKHR, mode: Mode) {
    let info = vk::CopyAccelerationStructureInfoKHR::default().src(source).dst(target).mode(mode);
    run(|_, commands| unsafe { ours().cmd_copy_acceleration_structure(commands, &info) });
}

fn serialized(source: &Guarded, bytes: usize) -> Guarded {
    serialized_of(source.handle(), bytes)
}

fn serialized_of(source: vk::AccelerationStructureKHR, bytes: usize) -> Guarded {
    let memory = Guarded::new(bytes);
    let info = vk::CopyAccelerationStructureToMemoryInfoKHR::default()
        .src(source)
        .dst(vk::DeviceOrHostAddressKHR { device_address: memory.address() })
        .mode(Mode::SERIALIZE);
    run(|_, commands| unsafe { ours().cmd_copy_acceleration_structure_to_memory(commands, &info) });
    memory
}

fn deserialized(memory: &Guarded, bytes: usize) -> Guarded {
    let target = Guarded::new(bytes);
    let info = vk::CopyMemoryToAccelerationStructureInfoKHR::default()
        .src(vk::DeviceOrHostAddressConstKHR { device_address: memory.address() })
        .dst(target.handle())
        .mode(Mode::DESERIALIZE);
    run(|_, commands| unsafe { ours().cmd_copy_memory_to_acceleration_structure(commands, &info) });
    target
}

fn properties(structures: &[vk::AccelerationStructureKHR], property: Property) -> Vec<u64> {
    let results = Guarded::new(8 * structures.len());
    run(|_, commands| unsafe {
        ours().cmd_write_acceleration_structures_properties(commands, structures, property, results.address())
    });
    bytemuck::pod_collect_to_vec(&results.read())
}

fn property(structure: &Guarded, property: Property) -> u64 {
    properties(&[structure.handle()], property)[0]
}

#[test]
fn a_clone_is_the_same_bytes() {
    for case in cases() {
        let source = Guarded::of(&case.bytes);
        assert_eq!(property(&source, Property::Size), case.bytes.len() as u64, "{}", case.name);
        let target = Guarded::new(case.bytes.len());
        copy(&source, &target, Mode::CLONE);
        assert!(target.read() == case.bytes, "{}", case.name);
    }
}

#[test]
fn compacting_gives_the_bytes_of_the_host() {
    for case in cases() {
        let source = Guarded::of(&case.bytes);
        assert_eq!(property(&source, Property::CompactedSize), case.compacted.len() as u64, "{}", case.name);
        let target = Guarded::new(case.compacted.len());
        copy(&source, &target, Mode::COMPACT);
        assert!(target.read() == case.compacted, "{}", case.name);
        assert!(source.read() == case.bytes, "{}: the source is written", case.name);
        // What is compact stays as it is.
        let again = Guarded::new(case.compacted.len());
        copy(&target, &again, Mode::COMPACT);
        assert!(again.read() == case.compacted, "{} twice", case.name);
    }
}

/// The twin has the same tree, met in the order of its slots, and nothing else.
#[test]
fn the_host_compacts_depth_first() {
    fn walk(tree: &Bvh2, compacted: &Bvh2, a: Child, b: Child, next: &mut u32) {
        assert_eq!((a.bounds(), a.count), (b.bounds(), b.count));
        if a.is_leaf() {
            assert_eq!(a.index, b.index);
            return;
        }
        assert_eq!(b.index, *next);
        *next += 1;
        let [a, b] = [tree.nodes[a.index as usize], compacted.nodes[b.index as usize]];
        walk(tree, compacted, a.children[0], b.children[0], next);
        walk(tree, compacted, a.children[1], b.children[1], next);
    }
    let mut freed = 0;
    for collapse in COLLAPSES {
        for count in [2, 3, 100, 5000] {
            let tree = triangles(count, true, 3, collapse);
            let compacted = tree.compacted();
            let mut nodes = 0;
            walk(&tree, &compacted, tree.header.root, compacted.header.root, &mut nodes);
            assert_eq!(nodes, tree.header.inner_nodes);
            assert_eq!(compacted.nodes.len() as u32, nodes.max(1));
            assert_eq!(compacted.records, tree.records[..tree.header.active as usize]);
            assert_eq!(compacted.geometries, tree.geometries);
            freed += tree.header.active.max(1) - 1 - nodes;
        }
    }
    assert!(freed > 500, "collapsed leaves free slots: {freed}");
}

/// Built, compacted and cloned in one command buffer: hits are the same bits, and those of the host.
#[test]
fn what_is_copied_is_hit_as_before() {
    let backend = Ours::on(device());
    for (count, parts) in [(1, 1), (2, 2), (700, 3), (6000, 1)] {
        let corners: Vec<Corners> = (0..parts).map(|part| soup(count, 0.1, 40 + part)).collect();
        let owned: Vec<Owned> =
            corners.iter().map(|c| Owned::of(c, VertexFormat::FLOAT3, IndexFormat::U32, 0)).collect();
        let uploaded: Vec<_> = owned.iter().map(|o| o.upload(0, 0)).collect();
        let geometries: Vec<_> = uploaded.iter().zip(&owned).map(|((g, _), o)| vk_geometry(g, o)).collect();
        let ranges: Vec<_> = owned
            .iter()
            .map(|o| vk::AccelerationStructureBuildRangeInfoKHR::default().primitive_count(o.primitive_count))
            .collect();
        let counts: Vec<u32> = owned.iter().map(|o| o.primitive_count).collect();
        let info = vk::AccelerationStructureBuildGeometryInfoKHR::default()
            .ty(vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL)
            // Nodes of two, which have holes.
            .flags(vk::BuildAccelerationStructureFlagsKHR::PREFER_FAST_BUILD)
            .geometries(&geometries);
        let built = Built::place(&backend, &info, &counts, 0);
        let (_scratch, scratch) = built.scratch(&backend, &info, &counts);
        let info = info
            .dst_acceleration_structure(built.structure)
            .scratch_data(vk::DeviceOrHostAddressKHR { device_address: scratch });
        let compact = Guarded::new(built.bytes as usize);
        let clone = Guarded::new(built.bytes as usize);
        let copied = |src, dst, mode| vk::CopyAccelerationStructureInfoKHR::default().src(src).dst(dst).mode(mode);
        run(|recorder, commands| unsafe {
            backend.0.cmd_build_acceleration_structures(commands, &[info], &[&ranges])?;
            recorder.barrier();
            let to_compact = copied(built.structure, compact.handle(), Mode::COMPACT);
            backend.0.cmd_copy_acceleration_structure(commands, &to_compact)?;
            recorder.barrier();
            let to_clone = copied(compact.handle(), clone.handle(), Mode::CLONE);
            backend.0.cmd_copy_acceleration_structure(commands, &to_clone)
        });
        let tree: Bvh2 = Bvh2::from_bytes(&built.memory.read::<u8>(built.bytes as usize)).expect("it is built");
        let expected = tree.compacted().to_bytes();
        assert!(compact.read()[..expected.len()] == expected, "{count} triangles");
        assert!(compact.read()[expected.len()..].iter().all(|&byte| byte == UNTOUCHED));
        let rays = hard_rays(&corners.concat(), 3000, 1.0, [0.0; 3], 8);
        let hits: Vec<Hit> = rays.iter().map(|ray| closest_hit(&tree, ray)).collect();
        assert!(hits.iter().any(Hit::is_some), "rays that hit nothing are no test");
        for structure in [built.structure, compact.handle(), clone.handle()] {
            assert_eq!(backend.trace(structure, &rays), hits, "{count} triangles in {parts} geometries");
        }
    }
}

/// Boxes that the device built, not the host.
#[test]
fn boxes_of_the_device_are_compacted() {
    let given: Vec<[[f32; 3]; 2]> = soup(3000, 0.05, 3).iter().map(|c| Aabb::around(c)).map(|b| [b.lo, b.hi]).collect();
    let codes = Code::Emc64Var.full();
    let options = BuildOptions { primitives: Primitives::Boxes, codes: Some(codes), ..BuildOptions::DEFAULT };
    let builder = Builder::new(device(), &options, given.len() as u32).expect("few enough");
    let aabbs = device().upload("boxes", &given).expect("memory");
    let geometry = Geometry { vertex_stride: 24, ..Geometry::mesh(aabbs.address(), given.len() as u32, 0) };
    let input = Input { source: Source::One(geometry), primitive_count: given.len() as u32 };
    let sizes = builder.sizes();
    let source = Guarded::new(sizes.structure as usize);
    let scratch = device().buffer("scratch", sizes.scratch).expect("memory");
    run(|recorder, _| {
        builder.record(recorder, &input, Region { address: source.address(), bytes: sizes.structure }, scratch.region())
    });
    let boxes: Vec<Aabb> = given.iter().map(|&[lo, hi]| Aabb { lo, hi }).collect();
    let expected = lbvh::build_aabbs(&boxes, codes, Collapse::SAH);
    assert!(source.read() == expected.to_bytes());
    let target = Guarded::new(property(&source, Property::CompactedSize) as usize);
    copy(&source, &target, Mode::COMPACT);
    assert!(target.read() == expected.compacted().to_bytes());
}

#[test]
fn serialising_and_back_gives_the_same_bytes() {
    let device = ours();
    for case in cases() {
        for bytes in [&case.bytes, &case.compacted] {
            let source = Guarded::of(bytes);
            let expected = hedgerow::accel::twin::serialize::write(bytes).expect("a structure");
            assert_eq!(property(&source, Property::SerializedSize), expected.len() as u64, "{}", case.name);
            let memory = serialized(&source, expected.len());
            assert!(memory.read() == expected, "{}", case.name);

            let head: Head = bytemuck::pod_read_unaligned(&expected[..size_of::<Head>()]);
            let header = header_of(bytes);
            let handles = u64::from(if layout::has_instances(header.kind) { header.primitive_count } else { 0 });
            assert_eq!(property(&source, Property::BottomLevelPointers), handles, "{}", case.name);
            let sizes = (head.serialized_bytes, head.structure_bytes, head.handle_count);
            assert_eq!(sizes, (56 + 8 * handles + bytes.len() as u64, bytes.len() as u64, handles));
            let version = vk::AccelerationStructureVersionInfoKHR::default().version_data(&head.version);
            assert_eq!(
                device.get_device_acceleration_structure_compatibility(&version),
                vk::AccelerationStructureCompatibilityKHR::COMPATIBLE
            );

            assert!(&deserialized(&memory, bytes.len()).read() == bytes, "{}", case.name);
            assert!(&hedgerow::accel::twin::serialize::read(&expected).expect("its own") == bytes, "{}", case.name);
        }
    }
}

#[test]
fn handles_that_were_rewritten_come_back_in_the_instances() {
    let tree = instances(500);
    let mut wide = Wide8q::of(&tree);
    // A tree of nodes of two has records of what is left out; nodes of eight have none.
    assert!(tree.records.len() == 500 && wide.records.len() == 375);
    let mut of_two = tree.clone();
    handles_come_back(&tree.to_bytes(), &tree.records, |records| {
        of_two.records = records;
        of_two.to_bytes()
    });
    assert!(tree.records.iter().any(|record| record.structure == 0));
    let before = wide.clone();
    handles_come_back(&before.to_bytes(), &before.records, |records| {
        wide.records = records;
        wide.to_bytes()
    });
}

/// The handles of a structure are those of its records; others come back in the structure that has `with` them.
fn handles_come_back(bytes: &[u8], records: &[InstanceRecord], with: impl FnOnce(Vec<InstanceRecord>) -> Vec<u8>) {
    let mut memory = hedgerow::accel::twin::serialize::write(bytes).expect("a structure");
    let handles: Vec<u64> = bytemuck::pod_collect_to_vec(&memory[56..56 + 8 * records.len()]);
    assert!(handles.iter().zip(records).all(|(&handle, record)| handle == record.structure));
    assert!(handles.iter().any(|&handle| handle > u64::from(u32::MAX)));
    let mut rewritten = records.to_vec();
    for (i, record) in rewritten.iter_mut().enumerate() {
        record.structure = 0xfedc_ba98_0000_0000 + 256 * i as u64;
        memory[56 + 8 * i..][..8].copy_from_slice(&record.structure.to_le_bytes());
    }
    let expected = with(rewritten);
    let got = deserialized(&Guarded::of(&memory), bytes.len());
    assert!(got.read() == expected);
    assert!(hedgerow::accel::twin::serialize::read(&memory).expect("its own") == expected);
}

/// Triangles of two geometries and boxes, each seen twenty times.
fn world() -> World {
    let (triangles, boxes) = (soup(300, 0.4, 1), soup(40, 0.1, 2));
    let boxes = boxes.iter().map(|c| Aabb::around(c)).map(|b| [b.lo, b.hi]).collect();
    let (opaque, asked) = (vk::GeometryFlagsKHR::OPAQUE, vk::GeometryFlagsKHR::empty());
    let parts = vec![
        Part::Triangles(vec![(triangles[..200].to_vec(), opaque), (triangles[200..].to_vec(), asked)]),
        Part::Boxes(vec![(boxes, asked)]),
    ];
    let mut random = SplitMix64::new(31);
    let instances = (0..40)
        .map(|i| {
            let turn = |row: usize| -> [f32; 4] {
                let at = 4.0 * random.signed();
                std::array::from_fn(|k| if k == 3 { at } else { f32::from(u8::from(k == row)) + 0.4 * random.signed() })
            };
            accel::Instance::new(if i % 9 == 4 { 0 } else { 1 + i % 2 }, [0, 1, 2].map(turn))
        })
        .collect();
    World::new(parts, instances)
}

fn probe_rays() -> Vec<ProbeRay> {
    let mut random = SplitMix64::new(8);
    (0..2000)
        .map(|_| {
            let (origin, target) = (random.around(8.0), random.around(4.0));
            let ray = ProbeRay::new(origin, std::array::from_fn(|k| target[k] - origin[k]));
            ProbeRay { decision: CONFIRM_ODD, generated_t: 0.75, ..ray }
        })
        .collect()
}

/// All of two levels is kept as bytes and brought back elsewhere; nothing of what was built is left.
#[test]
fn a_world_that_was_read_back_answers_queries_as_before() {
    let backend = Ours::on(device());
    let rays = probe_rays();
    // The last one's top level is of nodes of two.
    let by_two = accel::REBRAID | vk::BuildAccelerationStructureFlagsKHR::PREFER_FAST_BUILD;
    for flags in [vk::BuildAccelerationStructureFlagsKHR::empty(), accel::REBRAID, by_two] {
        let built = World { flags, ..world() }.build(&backend);
        let before: Vec<ProbeReport> = backend.probe(built.top.structure, &rays);
        assert!(
            before.iter().filter(|report| report.committed.kind != 0).count() > 500,
            "rays that hit nothing are no test"
        );

        let top = bytes_of(&built.top);
        let compacted = Guarded::new(size_after(&built.top, Property::CompactedSize));
        copy_of(built.top.structure, compacted.handle(), Mode::COMPACT);
        let expected = Tree::<InstanceRecord>::from_bytes(&top).expect("a top level").compacted();
        assert_eq!(matches!(expected, Tree::OfTwo(_)), flags == by_two);
        assert!(compacted.read() == expected.to_bytes());
        assert_eq!(backend.probe(compacted.handle(), &rays), before, "compacted, {flags:?}");

        let mut kept = hedgerow::accel::twin::serialize::write(&compacted.read()).expect("a structure");
        let parts: Vec<(u64, Guarded)> = built
            .parts
            .iter()
            .map(|part| {
                let memory = serialized_of(part.structure, size_after(part, Property::SerializedSize));
                let back = deserialized(&memory, bytes_of(part).len());
                assert!(back.read() == bytes_of(part));
                (backend.address(part.structure), back)
            })
            .collect();
        let handles = compacted.header().primitive_count as usize;
        for handle in kept[size_of::<Head>()..][..8 * handles].chunks_exact_mut(8) {
            let old = u64::from_le_bytes(handle.try_into().expect("eight bytes"));
            let (_, new) = parts.iter().find(|(address, _)| *address == old).expect("the handle of a part");
            handle.copy_from_slice(&new.address().to_le_bytes());
        }
        for gone in built.parts.iter().chain([&built.top]) {
            gone.memory.write(&vec![0u8; gone.memory.bytes() as usize]);
        }
        let back = deserialized(&Guarded::of(&kept), compacted.bytes);
        assert_eq!(backend.probe(back.handle(), &rays), before, "read back, {flags:?}");
        assert!(backend.probe(built.top.structure, &rays).iter().all(|report| report.committed.kind == 0));
    }
}

fn bytes_of(built: &Built) -> Vec<u8> {
    built.memory.read(size_after(built, Property::Size))
}

/// Bytes of a copy.
fn size_after(built: &Built, property: Property) -> usize {
    properties(&[built.structure], property)[0] as usize
}

fn rays() -> Vec<Ray> {
    hard_rays(&soup(100, 0.2, 100), 500, 1.0, [0.0; 3], 3)
}

#[test]
fn what_another_version_wrote_is_an_empty_structure_that_says_so() {
    let bytes = triangles(100, false, 1, Collapse::SAH).to_bytes();
    let good = hedgerow::accel::twin::serialize::write(&bytes).expect("a structure");
    // A bit of each byte of the version, then sizes that are not those of the structure, then what is no structure.
    let structure = size_of::<Head>();
    let (backend, rays) = (Ours::on(device()), rays());
    let changes = (0..32).chain([32, 40, 44, 48, structure, structure + 4, structure + 12, structure + 52]);
    for at in changes {
        let mut memory = good.clone();
        memory[at] ^= 0x10;
        let head: Head = bytemuck::pod_read_unaligned(&memory[..structure]);
        let version = vk::AccelerationStructureVersionInfoKHR::default().version_data(&head.version);
        let compatible = ours().get_device_acceleration_structure_compatibility(&version)
            == vk::AccelerationStructureCompatibilityKHR::COMPATIBLE;
        assert_eq!(compatible, at >= 32, "byte {at}");
        let target = deserialized(&Guarded::of(&memory), bytes.len());
        assert_eq!(property(&target, Property::Status), u64::from(status::WRONG_VERSION), "byte {at}");
        let empty: Bvh2 = Bvh2::from_bytes(&target.read()).expect("a structure");
        empty.validate().expect("a valid one");
        assert_eq!((empty.header.active, empty.header.status), (0, status::WRONG_VERSION));
        assert_eq!(empty.to_bytes().len() as u64, property(&target, Property::Size));
        assert!(backend.trace(target.handle(), &rays).iter().all(|hit| !hit.is_some()), "byte {at}");
        hedgerow::accel::twin::serialize::read(&memory).expect_err("another version's");
    }
    for cut in [0, 10, 56, 100, good.len() - 1] {
        hedgerow::accel::twin::serialize::read(&good[..cut]).expect_err("cut off");
        hedgerow::accel::twin::serialize::write(&bytes[..cut.min(bytes.len() - 1)]).expect_err("cut off");
    }
    let nothing = ours().get_device_acceleration_structure_compatibility(&Default::default());
    assert_eq!(nothing, vk::AccelerationStructureCompatibilityKHR::INCOMPATIBLE);
}

/// Nothing says how large it is: copies are empty, and their properties are those that it has.
#[test]
fn what_is_no_structure_is_copied_as_nothing() {
    let noise: Vec<u8> = {
        let mut random = SplitMix64::new(4);
        (0..4096).map(|_| random.bits() as u8).collect()
    };
    for content in [noise, vec![0; 4096]] {
        let source = Guarded::of(&content);
        let size = property(&source, Property::Size) as usize;
        assert_eq!(property(&source, Property::CompactedSize), size as u64);
        assert_eq!(property(&source, Property::SerializedSize), size as u64 + 56);
        assert_eq!(property(&source, Property::Status), u64::from(status::WRONG_VERSION));
        for other in [Property::BottomLevelPointers, Property::NodeCount, Property::Sah, Property::SahGrowth] {
            assert_eq!(property(&source, other), 0);
        }
        let back = deserialized(&serialized(&source, size + 56), size);
        let copies = [Mode::CLONE, Mode::COMPACT].map(|mode| {
            let target = Guarded::new(size);
            copy(&source, &target, mode);
            target
        });
        for target in copies.into_iter().chain([back]) {
            let empty: Bvh2 = Bvh2::from_bytes(&target.read()).expect("a structure");
            empty.validate().expect("a valid one");
            assert_eq!(empty.header.status, status::WRONG_VERSION);
        }
    }
}

#[test]
fn what_cannot_be_traced_is_compacted_to_its_status() {
    for bit in [status::SPIN_RAN_OUT, status::TOO_DEEP] {
        let mut tree = triangles(100, true, 3, Collapse::SAH);
        tree.header.status |= bit;
        let source = Guarded::of(&tree.to_bytes());
        let expected = tree.compacted();
        assert_eq!((expected.header.active, expected.records.len()), (0, 0));
        expected.validate().expect("an empty tree");
        let target = Guarded::new(property(&source, Property::CompactedSize) as usize);
        copy(&source, &target, Mode::COMPACT);
        assert!(target.read() == expected.to_bytes());
        assert_eq!(property(&target, Property::Status), u64::from(bit | status::NON_FINITE));
    }
}

#[test]
fn properties_are_the_figures_of_the_host() {
    for case in cases() {
        let mut header = case.header();
        // As after an update that made it worse.
        header.cost *= 1.75;
        let mut bytes = case.bytes.clone();
        bytes[..size_of::<Header>()].copy_from_slice(bytemuck::bytes_of(&header));
        let structure = Guarded::of(&bytes);
        let figure = |p| property(&structure, p);
        assert_eq!(figure(Property::NodeCount), u64::from(header.inner_nodes), "{}", case.name);
        assert_eq!(figure(Property::Status), u64::from(header.status), "{}", case.name);
        let close = |what, got: u64, expected: f32| {
            let got = f32::from_bits(u32::try_from(got).expect("32 bits"));
            // GPUs divide to within 2.5 units in the last place.
            assert!((got - expected).abs() <= 1e-6 * expected.abs(), "{}: {what} is {got}, not {expected}", case.name);
        };
        close("SAH", figure(Property::Sah), header.sah());
        close("growth", figure(Property::SahGrowth), header.sah_growth());
        if header.inner_nodes > 0 {
            assert!((header.sah_growth() - 1.75).abs() < 1e-5 && header.sah() > 3.0, "{}", case.name);
        }
    }
}

#[test]
fn many_structures_are_asked_at_once() {
    let cases = cases();
    // More than fit into one dispatch's push constants, and not a multiple.
    let structures: Vec<Guarded> = cases.iter().map(|case| Guarded::of(&case.bytes)).collect();
    let handles: Vec<_> = structures.iter().map(Guarded::handle).collect();
    assert!(handles.len() > 50 && handles.len() % 14 != 0);
    let expected: Vec<u64> = cases.iter().map(|case| case.compacted.len() as u64).collect();
    for count in [0, 1, 13, 14, 15, handles.len()] {
        assert_eq!(properties(&handles[..count], Property::CompactedSize), expected[..count]);
    }
}

#[test]
fn properties_have_vulkans_names() {
    for (query, property) in [
        (vk::QueryType::ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR, Property::CompactedSize),
        (vk::QueryType::ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR, Property::SerializedSize),
        (vk::QueryType::ACCELERATION_STRUCTURE_SERIALIZATION_BOTTOM_LEVEL_POINTERS_KHR, Property::BottomLevelPointers),
        (vk::QueryType::ACCELERATION_STRUCTURE_SIZE_KHR, Property::Size),
    ] {
        assert_eq!(Property::try_from(query).expect("a property"), property);
    }
    let refused = Property::try_from(vk::QueryType::OCCLUSION).expect_err("no property of structures");
    assert!(refused.to_string().contains("OCCLUSION"), "{refused}");
}

#[test]
fn what_cannot_be_copied_is_refused_by_name() {
    let (one, two) = (vk::AccelerationStructureKHR::from_raw(256), vk::AccelerationStructureKHR::from_raw(512));
    let null = vk::AccelerationStructureKHR::null();
    let copies: [(_, _, _, &str); 4] = [
        (null, two, Mode::CLONE, "src is null"),
        (one, null, Mode::COMPACT, "dst is null"),
        (one, one, Mode::CLONE, "src and dst"),
        (one, two, Mode::SERIALIZE, "mode is SERIALIZE"),
    ];
    let mut refused = Vec::new();
    run(|_, commands| {
        for (src, dst, mode, says) in copies {
            let info = vk::CopyAccelerationStructureInfoKHR::default().src(src).dst(dst).mode(mode);
            refused.push((unsafe { ours().cmd_copy_acceleration_structure(commands, &info) }, says));
        }
        for (structure, address, mode, says) in [
            (null, 256, Mode::SERIALIZE, "src is null"),
            (one, 0, Mode::SERIALIZE, "dst.deviceAddress"),
            (one, 264, Mode::SERIALIZE, "dst.deviceAddress"),
            (one, 256, Mode::CLONE, "mode is CLONE"),
        ] {
            let info = vk::CopyAccelerationStructureToMemoryInfoKHR::default()
                .src(structure)
                .dst(vk::DeviceOrHostAddressKHR { device_address: address })
                .mode(mode);
            refused.push((unsafe { ours().cmd_copy_acceleration_structure_to_memory(commands, &info) }, says));
        }
        for (structure, address, mode, says) in [
            (null, 256, Mode::DESERIALIZE, "dst is null"),
            (one, 257, Mode::DESERIALIZE, "src.deviceAddress"),
            (one, 256, Mode::SERIALIZE, "mode is SERIALIZE"),
        ] {
            let info = vk::CopyMemoryToAccelerationStructureInfoKHR::default()
                .src(vk::DeviceOrHostAddressConstKHR { device_address: address })
                .dst(structure)
                .mode(mode);
            refused.push((unsafe { ours().cmd_copy_memory_to_acceleration_structure(commands, &info) }, says));
        }
        for (structures, address, says) in [([one, null], 8, "structures[1] is null"), ([one, two], 12, "address")] {
            let written = unsafe {
                ours().cmd_write_acceleration_structures_properties(commands, &structures, Property::Size, address)
            };
            refused.push((written, says));
        }
        Ok(())
    });
    for (result, says) in refused {
        let message = result.expect_err(says).to_string();
        assert!(message.contains(says), "{says}: {message}");
    }
}

/// Builds, compacts, serialises and reads back; the hits in what was built, in what was compacted, and in what came back.
fn hits_of_copies(backend: &dyn Copies, corners: &Corners, rays: &[Ray]) -> [Vec<Hit>; 3] {
    let owned = Owned::of(corners, VertexFormat::FLOAT3, IndexFormat::U32, 0);
    let (geometry, _memory) = owned.upload(0, 0);
    let geometries = [vk_geometry(&geometry, &owned)];
    let ty = vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL;
    let info = vk::AccelerationStructureBuildGeometryInfoKHR::default()
        .ty(ty)
        .flags(backend.flags_to_compact())
        .geometries(&geometries);
    let range = vk::AccelerationStructureBuildRangeInfoKHR::default().primitive_count(owned.primitive_count);
    let built = Built::new(backend, &info, &[range], 0);
    let place = |bytes: u64| {
        let memory = device().buffer("copy", bytes).expect("memory");
        let create = vk::AccelerationStructureCreateInfoKHR::default().buffer(memory.raw()).size(bytes).ty(ty);
        (backend.create(&create), memory)
    };
    let bytes = backend.property(built.structure, vk::QueryType::ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR);
    assert!(bytes > 0 && bytes <= built.bytes, "{}: {bytes} of {}", backend.name(), built.bytes);
    let (compact, _compact) = place(bytes);
    let copied = vk::CopyAccelerationStructureInfoKHR::default().src(built.structure).dst(compact).mode(Mode::COMPACT);
    backend.copy(&copied);

    let bytes = backend.property(compact, vk::QueryType::ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR);
    let memory = device().buffer("serialised", bytes + 256).expect("memory");
    let device_address = memory.address().next_multiple_of(256);
    let to_memory = vk::CopyAccelerationStructureToMemoryInfoKHR::default()
        .src(compact)
        .dst(vk::DeviceOrHostAddressKHR { device_address })
        .mode(Mode::SERIALIZE);
    backend.serialize(&to_memory);
    let head: Head = memory.read_at(device_address - memory.address(), 1)[0];
    assert_eq!((head.serialized_bytes, head.handle_count), (bytes, 0), "{}", backend.name());
    let (back, _back) = place(head.structure_bytes);
    let from_memory = vk::CopyMemoryToAccelerationStructureInfoKHR::default()
        .src(vk::DeviceOrHostAddressConstKHR { device_address })
        .dst(back)
        .mode(Mode::DESERIALIZE);
    backend.deserialize(&from_memory);
    let version = vk::AccelerationStructureVersionInfoKHR::default().version_data(&head.version);
    assert_eq!(backend.compatibility(&version), vk::AccelerationStructureCompatibilityKHR::COMPATIBLE);
    [built.structure, compact, back].map(|structure| {
        let hits = backend.trace(structure, rays);
        backend.destroy(structure);
        hits
    })
}

#[test]
fn the_same_calls_of_the_driver_give_the_same_hits() {
    let corners = soup(2000, 0.5, 12);
    let mut random = SplitMix64::new(9);
    let rays: Vec<Ray> = (0..2000)
        .map(|_| {
            let (origin, target) = (random.around(2.0), random.around(1.0));
            ray(origin, std::array::from_fn(|k| target[k] - origin[k]))
        })
        .collect();
    let ours = hits_of_copies(&Ours::on(device()), &corners, &rays);
    assert!(ours[0].iter().filter(|hit| hit.is_some()).count() > 1000, "rays that hit nothing are no test");
    assert_eq!(ours[1], ours[0]);
    assert_eq!(ours[2], ours[0]);
    if device().driver_tracing() == Some(DriverTracing::Query) {
        for (i, theirs) in hits_of_copies(&Drivers::new(), &corners, &rays).iter().enumerate() {
            // Arithmetic of its own: rays within rounding of an edge.
            let differ = theirs.iter().zip(&ours[0]).filter(|(a, b)| a.primitive != b.primitive).count();
            assert!(differ <= 10, "structure {i}: {differ} of 2000 rays differ");
        }
    }
}
