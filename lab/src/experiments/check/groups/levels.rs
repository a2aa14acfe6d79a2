//! What becomes of levels once they are built: updates, copies, and instances that are opened.

use crate::device::{Buffer, Device};
use crate::experiments::check::agree::assert_reports;
use crate::experiments::check::backend::{Backend, BuildInfo, Built, Ours, scratch_of, submit_build};
use crate::experiments::check::cases::{Cases, Found, same, same_all};
use crate::experiments::check::matrices::{moved, rotation};
use crate::experiments::check::mixture::{ReadBack, mixture};
use crate::experiments::check::probe::{CONFIRM_ODD, ProbeRay};
use crate::experiments::check::shapes::{boxes, soup};
use crate::experiments::check::world::{BuiltWorld, Part, World};
use crate::random::SplitMix64;
use crate::subjects::structures::{Geometry, Range, Structure};
use ash::vk::{self, Handle};
use hedgerow::accel::{AccelOptions, Instance, Property, REBRAID, Tree, twin};
use hedgerow::bvh::layout::{self, Record, Triangle};
use vk::BuildAccelerationStructureFlagsKHR as Flags;
use vk::CopyAccelerationStructureModeKHR as Mode;
use vk::GeometryFlagsKHR as GeometryFlags;

fn rays(count: usize, spread: f32) -> Vec<ProbeRay> {
    let mut random = SplitMix64::new(9);
    let ray = |_| {
        let ray = ProbeRay::to(random.around(8.0), random.around(spread));
        ProbeRay { decision: CONFIRM_ODD, generated_t: 0.75, ..ray }
    };
    (0..count).map(ray).collect()
}

fn info(ty: vk::AccelerationStructureTypeKHR, geometries: &[Geometry]) -> BuildInfo<'_> {
    BuildInfo::default().ty(ty).flags(Flags::ALLOW_UPDATE).geometries(geometries)
}

/// Updates `source` into `target`, with scratch memory of the size that an update asks for.
fn updated(ours: &Ours, info: BuildInfo<'_>, ranges: &[Range], source: &Built, target: &Built) -> Found {
    let counts: Vec<u32> = ranges.iter().map(|range| range.primitive_count).collect();
    let (_scratch, scratch) = scratch_of(ours, ours.build_sizes(&info, &counts).update_scratch_size);
    let info = info
        .mode(vk::BuildAccelerationStructureModeKHR::UPDATE)
        .src_acceleration_structure(source.structure)
        .dst_acceleration_structure(target.structure)
        .scratch_data(vk::DeviceOrHostAddressKHR { device_address: scratch });
    Ok(submit_build(ours, &info, ranges)?)
}

pub fn update(cases: &mut Cases<'_>) {
    let (opaque, none) = (GeometryFlags::OPAQUE, GeometryFlags::empty());
    let triangles = |seed, counts: [usize; 2]| {
        // Smaller ones where they are many: a ray that passes near some edge tells nothing.
        let size = 0.4 * (500.0 / counts[0] as f32).sqrt().min(1.0);
        Part::Triangles(vec![(soup(counts[0], size, seed), opaque), (soup(counts[1], 0.3, seed + 1), none)])
    };
    let all_boxes = |seed| Part::Boxes(vec![(boxes(40, 0.2, seed), none), (boxes(9, 0.3, seed + 1), opaque)]);
    let many = if cases.quick { 500 } else { 20_000 };
    for (name, before, after) in [
        ("80 triangles", triangles(1, [50, 30]), triangles(11, [50, 30])),
        ("boxes", all_boxes(21), all_boxes(22)),
        ("many triangles", triangles(3, [many, 1]), triangles(13, [many, 1])),
    ] {
        for in_place in [true, false] {
            cases.case(format!("{name}, in place: {in_place}"), |device| {
                bottom_level(device, &before, &after, in_place)
            });
        }
    }
    for count in [1, 2, 30, 400] {
        cases.case(format!("{count} instances"), |device| top_level_follows(device, count));
    }
}

fn bottom_level(device: &'static Device, before: &Part, after: &Part, in_place: bool) -> Found {
    let ours = Ours::on(device);
    let (geometries, ranges, memory) = before.geometries(device);
    let asked = info(vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL, &geometries);
    let counts: Vec<u32> = ranges.iter().map(|range| range.primitive_count).collect();
    let first = Built::new(&ours, &asked, &ranges, 0);
    let other = Built::place(&ours, &asked, &counts, 0);
    let (_, _, moved) = after.geometries(device);
    memory.iter().zip(&moved).for_each(|(buffer, moved)| buffer.write(&bytes_of(moved)));
    updated(&ours, asked, &ranges, &first, if in_place { &first } else { &other })?;
    let target = if in_place { first } else { other };
    let world = World::new(vec![after.clone()], vec![Instance::new(1, Instance::IDENTITY)]);
    let rays = rays(60, 1.2);
    let built = world.build_over(&ours, vec![target], memory);
    assert_reports("updated", &world, &rays, &ours.probe(built.top.structure, &rays));
    Ok(())
}

fn top_level_follows(device: &'static Device, count: usize) -> Found {
    let ours = Ours::on(device);
    let mut random = SplitMix64::new(3);
    let mut placed = || -> Vec<Instance> {
        (0..count)
            .map(|i| Instance::new(1 + i as u64 % 2, moved(rotation(random.bits()), random.around(4.0))))
            .collect()
    };
    let part = |count, seed| Part::Triangles(vec![(soup(count, 0.3, seed), GeometryFlags::OPAQUE)]);
    let parts = vec![part(12, 1), part(5, 2)];
    let before = World { flags: Flags::ALLOW_UPDATE, ..World::new(parts.clone(), placed()) };
    let after = World { flags: Flags::ALLOW_UPDATE, ..World::new(parts, placed()) };
    let BuiltWorld { top, parts, instances, geometry, .. } = &before.build(&ours);
    instances.write(&after.placed(&ours, parts));
    let geometries = [*geometry];
    let asked = info(vk::AccelerationStructureTypeKHR::TOP_LEVEL, &geometries);
    updated(&ours, asked, &[Range::default().primitive_count(count as u32)], top, top)?;
    let rays = rays(200, 3.0);
    assert_reports("updated", &after, &rays, &ours.probe(top.structure, &rays));
    Ok(())
}

fn bytes_of(buffer: &Buffer<'_>) -> Vec<u8> {
    buffer.read(buffer.bytes() as usize)
}

/// Memory for a copy.
fn room(ours: &Ours, bytes: u64) -> crate::Result<Buffer<'static>> {
    ours.device().upload("copy", &vec![0xa5u8; bytes as usize])
}

/// The handle of a structure of ours, by its memory.
fn handle(memory: &Buffer<'_>) -> Structure {
    Structure::from_raw(memory.address())
}

/// Submits a call of ours.
fn run(ours: &Ours, call: impl FnOnce(vk::CommandBuffer) -> hedgerow::Result<()>) -> crate::Result<()> {
    ours.device().run(None, |recorder| call(recorder.commands()))
}

fn size_after(ours: &Ours, structure: Structure, property: Property) -> crate::Result<u64> {
    let result = ours.device().buffer("property", 16)?;
    // SAFETY: the structure is built, and the results have room for one word.
    run(ours, |commands| unsafe {
        ours.0.cmd_write_acceleration_structures_properties(commands, &[structure], property, result.address())
    })?;
    Ok(result.read::<u64>(1)[0])
}

fn copied(ours: &Ours, source: Structure, bytes: u64, mode: Mode) -> crate::Result<Buffer<'static>> {
    let target = room(ours, bytes)?;
    let info = vk::CopyAccelerationStructureInfoKHR::default().src(source).dst(handle(&target)).mode(mode);
    // SAFETY: the structure is built, and its copy has the room that the property says.
    run(ours, |commands| unsafe { ours.0.cmd_copy_acceleration_structure(commands, &info) })?;
    Ok(target)
}

fn serialised(ours: &Ours, source: Structure) -> crate::Result<Buffer<'static>> {
    let target = room(ours, size_after(ours, source, Property::SerializedSize)?)?;
    let info = vk::CopyAccelerationStructureToMemoryInfoKHR::default()
        .src(source)
        .dst(vk::DeviceOrHostAddressKHR { device_address: target.address() })
        .mode(Mode::SERIALIZE);
    // SAFETY: as above.
    run(ours, |commands| unsafe { ours.0.cmd_copy_acceleration_structure_to_memory(commands, &info) })?;
    Ok(target)
}

fn deserialised(ours: &Ours, memory: &Buffer<'_>, bytes: u64) -> crate::Result<Buffer<'static>> {
    let target = room(ours, bytes)?;
    let info = vk::CopyMemoryToAccelerationStructureInfoKHR::default()
        .src(vk::DeviceOrHostAddressConstKHR { device_address: memory.address() })
        .dst(handle(&target))
        .mode(Mode::DESERIALIZE);
    // SAFETY: the memory holds what was serialised.
    run(ours, |commands| unsafe { ours.0.cmd_copy_memory_to_acceleration_structure(commands, &info) })?;
    Ok(target)
}

pub fn copies(cases: &mut Cases<'_>) {
    let opaque = GeometryFlags::OPAQUE;
    let counts: &[usize] = if cases.quick { &[0, 1, 700] } else { &[0, 1, 2, 7, 100, 5000] };
    for &count in counts {
        let halves = [count / 2, count - count / 2].map(|count| (soup(count, 0.1, 40 + count as u64), opaque));
        let part = Part::Triangles(halves.to_vec());
        cases.case(format!("{count} triangles"), |device| {
            let ours = Ours::on(device);
            let (built, _memory) = part.build(&ours);
            copies_are_those_of_the_host::<Triangle>(&ours, &built)
        });
    }
    for count in if cases.quick { [2, 30] } else { [9, 500] } {
        let world = mixture(count, 5);
        cases.case(format!("{count} instances"), |device| {
            let ours = Ours::on(device);
            let built = world.build(&ours);
            copies_are_those_of_the_host::<layout::InstanceRecord>(&ours, &built.top)?;
            let rays = rays(200, 8.0);
            let before = ours.probe(built.top.structure, &rays);
            let bytes = size_after(&ours, built.top.structure, Property::CompactedSize)?;
            let compacted = copied(&ours, built.top.structure, bytes, Mode::COMPACT)?;
            same_all("report of ray", &ours.probe(handle(&compacted), &rays), &before)
        });
    }
}

fn copies_are_those_of_the_host<R: Record>(ours: &Ours, built: &Built) -> Found {
    let bytes: Vec<u8> = built.memory.read(built.bytes as usize);
    let tree = Tree::<R>::from_bytes(&bytes)?;
    if let Tree::OfTwo(tree) = &tree {
        tree.validate()?;
    }
    let bytes = tree.to_bytes();
    same("size", &size_after(ours, built.structure, Property::Size)?, &(bytes.len() as u64))?;
    let clone = copied(ours, built.structure, bytes.len() as u64, Mode::CLONE)?;
    same_all("cloned byte", &bytes_of(&clone), &bytes)?;
    let expected = tree.compacted().to_bytes();
    let compacted_bytes = size_after(ours, built.structure, Property::CompactedSize)?;
    same("compacted size", &compacted_bytes, &(expected.len() as u64))?;
    let compacted = copied(ours, built.structure, compacted_bytes, Mode::COMPACT)?;
    same_all("compacted byte", &bytes_of(&compacted), &expected)?;
    let memory = serialised(ours, handle(&compacted))?;
    same_all("serialised byte", &bytes_of(&memory), &twin::serialize::write(&expected)?)?;
    let back = deserialised(ours, &memory, compacted_bytes)?;
    same_all("byte brought back", &bytes_of(&back), &expected)
}

pub fn rebraid(cases: &mut Cases<'_>) {
    let all = [(0, 2.0), (1, 7.5), (30, 4.0), (300, 2.0), (1025, 2.0), (2500, 3.3)];
    for (count, budget) in all.into_iter().take(if cases.quick { 4 } else { 6 }) {
        for flags in [REBRAID, Flags::empty()] {
            let world = World { flags, ..mixture(count, count as u64) };
            cases.case(format!("{count} instances, budget {budget}, {flags:?}"), |device| {
                let options = AccelOptions { rebraid_budget: budget, ..Ours::OPTIONS };
                let read = ReadBack::new(&Ours::with_options(device, options), &world);
                let expected = twin::top_level(&read.instances, |a| read.below(a), flags, &options);
                same("header", read.top.header(), expected.header())?;
                same_all("record", read.top.records(), expected.records())?;
                same_all("byte", &read.top.to_bytes(), &expected.to_bytes())
            });
        }
    }
}
