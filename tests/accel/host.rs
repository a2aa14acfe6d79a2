//! Builds on the host have the bytes of the device's.

use crate::common::agree::assert_agrees;
use crate::common::backends::{Backend, Built, Ours, vk_format, vk_geometry, vk_index_type};
use crate::common::device;
use crate::common::geometries::{MOVED, Owned};
use crate::common::matrices::{rotation, scaled};
use crate::common::probe::{CONFIRM, CONFIRM_ODD, IGNORE, ProbeRay, TERMINATE, flags};
use crate::common::shapes::{Corners, boxes, soup};
use crate::common::world::{Part, World};
use hedgerow::accel::{self, ANY_HIT_ORDER, AccelOptions, Instance, Request};
use hedgerow::ash::vk;
use hedgerow::bvh::codes::{Code, CodeBounds, Codes};
use hedgerow::bvh::geometry::{IndexFormat, VertexFormat};
use hedgerow::bvh::layout::{self, Header, Triangle};
use hedgerow::bvh::wide::layout::Wide8q;
use hedgerow::gpu::Recorder;
use hedgerow_lab::random::SplitMix64;

type BuildInfo<'a> = vk::AccelerationStructureBuildGeometryInfoKHR<'a>;
type Geometry = vk::AccelerationStructureGeometryKHR<'static>;
type Range = vk::AccelerationStructureBuildRangeInfoKHR;
use vk::BuildAccelerationStructureFlagsKHR as Flags;

fn info(geometries: &[Geometry], flags: Flags) -> BuildInfo<'_> {
    BuildInfo::default().ty(vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL).flags(flags).geometries(geometries)
}

/// What the host makes of geometries at host addresses.
fn on_the_host(ours: &Ours, geometries: &[Geometry], ranges: &[Range], flags: Flags) -> Vec<u8> {
    let info = info(geometries, flags);
    let counts: Vec<u32> = ranges.iter().map(|r| r.primitive_count).collect();
    let mut sizes = vk::AccelerationStructureBuildSizesInfoKHR::default();
    let place = vk::AccelerationStructureBuildTypeKHR::HOST;
    unsafe { ours.0.get_acceleration_structure_build_sizes(place, &info, &counts, &mut sizes) }.expect("sizes");
    assert_eq!(sizes.build_scratch_size, 0);
    let mut bytes = vec![0; sizes.acceleration_structure_size as usize];
    unsafe { ours.0.build_acceleration_structures(&[info], &[ranges], &mut [&mut bytes]) }.expect("it builds");
    let header: Header = bytemuck::pod_read_unaligned(&bytes[..size_of::<Header>()]);
    let record_bytes = layout::record_bytes(header.kind).expect("a structure");
    bytes.truncate(header.offsets(record_bytes).bytes as usize);
    bytes
}

fn on_the_device(ours: &Ours, geometries: &[Geometry], ranges: &[Range], flags: Flags) -> Vec<u8> {
    let built = Built::new(ours, &info(geometries, flags), ranges, 0);
    built.bytes_in_use()
}

#[test]
fn triangles_of_every_kind_have_the_devices_bytes() {
    let ours = Ours::on(device());
    for flags in [Flags::empty(), Flags::PREFER_FAST_BUILD, Flags::PREFER_FAST_TRACE, Flags::ALLOW_COMPACTION] {
        let parts = [
            Owned::of(&soup(40, 0.9, 1), VertexFormat::FLOAT3, IndexFormat::U32, 4),
            Owned { transform: Some(MOVED), ..Owned::of(&soup(60, 0.9, 2), VertexFormat::SNORM3, IndexFormat::U16, 0) },
            Owned::of(&soup(9, 0.9, 3), VertexFormat::HALF3, IndexFormat::NONE, 2),
        ];
        for parts in [&parts[..], &parts[..1], &[]] {
            let ranges: Vec<Range> =
                parts.iter().map(|p| Range::default().primitive_count(p.primitive_count)).collect();
            let uploaded: Vec<_> = parts.iter().map(|p| p.upload(0, 0)).collect();
            let on_device: Vec<Geometry> = uploaded.iter().zip(parts).map(|((g, _), p)| vk_geometry(g, p)).collect();
            let host: Vec<Geometry> = parts.iter().map(at_host_addresses).collect();
            let expected = on_the_device(&ours, &on_device, &ranges, flags);
            assert!(on_the_host(&ours, &host, &ranges, flags) == expected, "{} geometries, {flags:?}", parts.len());
        }
    }
}

/// So many quads in two triangles each, with all vertices shared.
fn quads(count: usize) -> Corners {
    let side = (count as f32).sqrt().ceil() as usize;
    let at = |x: usize, y: usize| [x as f32, (x * 7 % 5 + y * 3 % 4) as f32 * 0.2, y as f32];
    let quad = |i: usize| {
        let (x, y) = (i % side, i / side);
        let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y + 1)];
        [[a, b, c], if i.is_multiple_of(3) { [d, c, b] } else { [b, d, c] }]
    };
    (0..count).flat_map(quad).collect()
}

/// From a few thousand triangles on, nodes of eight are made in the structure's own memory: nothing behind it or behind the scratch memory
/// is written, and whatever was there before.
#[test]
fn wide_structures_of_many_triangles_have_the_hosts_bytes_and_keep_to_their_memory() {
    const GUARD: usize = 256;
    let ours = Ours::on(device());
    let parts = [
        Owned::of(&quads(3000), VertexFormat::FLOAT3, IndexFormat::U32, 0),
        Owned { transform: Some(MOVED), ..Owned::of(&soup(900, 0.3, 2), VertexFormat::HALF3, IndexFormat::NONE, 2) },
        Owned::of(&vec![[[0.5; 3], [1.5, 0.5, 0.5], [0.5, 1.5, 0.5]]; 200], VertexFormat::FLOAT3, IndexFormat::U32, 4),
    ];
    for flags in [Flags::empty(), Flags::PREFER_FAST_TRACE, Flags::LOW_MEMORY, ANY_HIT_ORDER] {
        for parts in [&parts[..], &parts[..1]] {
            let ranges: Vec<Range> =
                parts.iter().map(|p| Range::default().primitive_count(p.primitive_count)).collect();
            let uploaded: Vec<_> = parts.iter().map(|p| p.upload(0, 0)).collect();
            let geometries: Vec<Geometry> = uploaded.iter().zip(parts).map(|((g, _), p)| vk_geometry(g, p)).collect();
            let host: Vec<Geometry> = parts.iter().map(at_host_addresses).collect();
            let counts: Vec<u32> = ranges.iter().map(|range| range.primitive_count).collect();
            let sizes = ours.build_sizes(&info(&geometries, flags), &counts);
            let guarded = |bytes: u64| {
                let buffer = device().buffer("guarded", bytes + GUARD as u64).expect("memory");
                buffer.write(&vec![0xA5u8; buffer.bytes() as usize]);
                buffer
            };
            let (structure, scratch) = (guarded(sizes.acceleration_structure_size), guarded(sizes.build_scratch_size));
            let create = vk::AccelerationStructureCreateInfoKHR::default()
                .buffer(structure.raw())
                .size(sizes.acceleration_structure_size)
                .ty(vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL);
            let build = info(&geometries, flags)
                .dst_acceleration_structure(ours.create(&create))
                .scratch_data(vk::DeviceOrHostAddressKHR { device_address: scratch.address() });
            let record = |recorder: &mut Recorder<'_>| {
                ours.build(recorder, &[build], &[&ranges]);
                Ok(())
            };
            device().run(None, record).expect("it builds");
            let expected = on_the_host(&ours, &host, &ranges, flags);
            let tree = Wide8q::<Triangle>::from_bytes(&expected).expect("nodes of eight");
            tree.validate().expect("valid");
            assert!(tree.header.pairs > 2000, "{} pairs", tree.header.pairs);
            assert!(structure.read::<u8>(expected.len()) == expected, "{} geometries, {flags:?}", parts.len());
            for (buffer, bytes) in
                [(&structure, sizes.acceleration_structure_size), (&scratch, sizes.build_scratch_size)]
            {
                assert_eq!(buffer.read_at::<u8>(bytes, GUARD), [0xA5; GUARD], "{} geometries, {flags:?}", parts.len());
            }
        }
    }
}

/// Both triangles of a record are met as brute force meets them, as hits and as candidates, whatever the shader says of the first: sheets of
/// quads over each other, some opaque and some not.
#[test]
fn triangles_that_share_a_record_are_met_each() {
    let sheets = |height: f32, count: usize| -> Corners {
        let lift = |[x, y, z]: [f32; 3]| [0.1 * x - 0.5, 0.1 * y + height, 0.1 * z - 0.5];
        quads(count).into_iter().map(|corners| corners.map(lift)).collect()
    };
    let part = Part::Triangles(vec![
        (sheets(-0.4, 100), vk::GeometryFlagsKHR::empty()),
        (sheets(0.0, 100), vk::GeometryFlagsKHR::OPAQUE),
        (sheets(0.4, 81), vk::GeometryFlagsKHR::NO_DUPLICATE_ANY_HIT_INVOCATION),
    ]);
    let ours = Ours::on(device());
    let (geometries, ranges, _memory) = part.geometries(device());
    let header: Header = bytemuck::pod_read_unaligned(
        &on_the_device(&ours, &geometries, &ranges, Flags::PREFER_FAST_TRACE)[..size_of::<Header>()],
    );
    assert!(header.pairs > 100, "{} pairs of {}", header.pairs, header.active);
    let transforms = [Instance::IDENTITY, scaled(rotation(3), [1.5, 0.5, 1.0])];
    let instances = transforms.map(|transform| Instance::new(1, transform)).to_vec();
    let mut random = SplitMix64::new(31);
    let all = [flags::NONE, flags::OPAQUE, flags::NO_OPAQUE, flags::FIRST_HIT, flags::CULL_BACK, flags::CULL_OPAQUE];
    let ray = |i: usize| {
        let ray = ProbeRay::to(random.around(2.0), random.around(0.5));
        let decision = [IGNORE, CONFIRM, CONFIRM_ODD, TERMINATE][i % 4];
        ProbeRay { flags: all[i / 4 % all.len()], decision, ..ray }
    };
    let rays: Vec<ProbeRay> = (0..1200).map(ray).collect();
    for flags in [Flags::PREFER_FAST_TRACE, Flags::PREFER_FAST_TRACE | ANY_HIT_ORDER] {
        let world = World { flags, ..World::new(vec![part.clone()], instances.clone()) };
        let hits = assert_agrees(&ours, &format!("{flags:?}"), &world, &rays);
        assert!(hits > 400, "{hits} hits are no test");
    }
}

/// A triangle's share of a structure as it is asked for and of the scratch memory of its build.
#[test]
fn wide_structures_and_their_builds_take_less_than_180_bytes_a_triangle() {
    let ours = Ours::on(device());
    let geometry = Owned::of(&soup(1, 0.5, 9), VertexFormat::FLOAT3, IndexFormat::U32, 0);
    let (geometry, _memory) = geometry.upload(0, 0);
    for flags in [Flags::empty(), Flags::PREFER_FAST_TRACE, Flags::ALLOW_COMPACTION | Flags::LOW_MEMORY] {
        for count in [20_000, 100_000, 1_000_003, 20_000_000] {
            let request = Request::triangles(&[(geometry, count)]).with_flags(flags);
            let sizes = request.sizes(&ours.0).expect("few enough");
            let each = (sizes.structure + sizes.scratch) as f64 / f64::from(count);
            assert!(each <= 180.0, "{count} triangles, {flags:?}: {each} bytes each");
        }
    }
}

#[test]
fn codes_that_are_asked_for_are_those_of_both() {
    let owned = Owned::of(&soup(900, 0.2, 4), VertexFormat::FLOAT3, IndexFormat::U32, 0);
    let (uploaded, _memory) = owned.upload(0, 0);
    let on_device = [vk_geometry(&uploaded, &owned)];
    let (host, ranges) = ([at_host_addresses(&owned)], [Range::default().primitive_count(owned.primitive_count)]);
    let mut all = Vec::new();
    for codes in [Code::Mc30.full(), Code::Mip9.full(), Code::Emc64VarNoSize.full().with_bits(33)] {
        let options = AccelOptions { bottom_codes: Some(codes), ..AccelOptions::DEFAULT };
        let ours = Ours::with_options(device(), options);
        for flags in [Flags::PREFER_FAST_BUILD, Flags::PREFER_FAST_TRACE] {
            let expected = on_the_device(&ours, &on_device, &ranges, flags);
            let header: Header = bytemuck::pod_read_unaligned(&expected[..size_of::<Header>()]);
            assert_eq!(header.code_bits, codes.bits, "{codes:?}, {flags:?}");
            assert!(on_the_host(&ours, &host, &ranges, flags) == expected, "{codes:?}, {flags:?}");
            all.push(expected);
        }
    }
    assert!(all[0] != all[2] && all[2] != all[4], "the codes make no difference");
}

#[test]
fn codes_that_there_are_not_are_refused_by_the_fields_name() {
    let none = Codes { code: Code::Mip6, bounds: CodeBounds::Robust, bits: 64 };
    let too_many = Codes { bits: 65, ..Code::Emc64Var.full() };
    for (field, options) in [
        ("bottom_codes", AccelOptions { bottom_codes: Some(none), ..AccelOptions::DEFAULT }),
        ("top_codes", AccelOptions { top_codes: Some(too_many), ..AccelOptions::DEFAULT }),
    ] {
        let structures = accel::Device::with_options(device(), options);
        let refused = Request::instances(16, 3).sizes(&structures).expect_err("no such codes");
        assert!(refused.to_string().starts_with(field), "{refused}");
    }
}

fn at_host_addresses(owned: &Owned) -> Geometry {
    let at = |bytes: *const u8| vk::DeviceOrHostAddressConstKHR { host_address: bytes.cast() };
    let triangles = vk::AccelerationStructureGeometryTrianglesDataKHR::default()
        .vertex_format(vk_format(owned.vertex_format))
        .vertex_data(at(owned.vertices.as_ptr()))
        .vertex_stride(owned.vertex_stride.into())
        .max_vertex(owned.vertex_count.saturating_sub(1))
        .index_type(vk_index_type(owned.index_format))
        .index_data(at(owned.indices.as_ptr()))
        .transform_data(at(owned.transform.as_ref().map_or(std::ptr::null(), |m| m.as_ptr().cast())));
    vk::AccelerationStructureGeometryKHR::default()
        .geometry_type(vk::GeometryTypeKHR::TRIANGLES)
        .geometry(vk::AccelerationStructureGeometryDataKHR { triangles })
        .flags(vk::GeometryFlagsKHR::OPAQUE)
}

#[test]
fn boxes_have_the_devices_bytes_and_small_memory_is_refused() {
    let ours = Ours::on(device());
    let all = boxes(70, 0.2, 5);
    let part = Part::Boxes(vec![(all.clone(), vk::GeometryFlagsKHR::OPAQUE)]);
    let (geometries, ranges, _memory) = part.geometries(device());
    let expected = on_the_device(&ours, &geometries, &ranges, Flags::empty());
    let mut host = geometries.clone();
    host[0].geometry.aabbs.data = vk::DeviceOrHostAddressConstKHR { host_address: all.as_ptr().cast() };
    assert!(on_the_host(&ours, &host, &ranges, Flags::empty()) == expected);
    let mut small = vec![0; expected.len() - 1];
    let refused =
        unsafe { ours.0.build_acceleration_structures(&[info(&host, Flags::empty())], &[&ranges], &mut [&mut small]) };
    let message = refused.expect_err("too small").to_string();
    assert!(message.starts_with("pInfos[0]: ") && message.contains(&expected.len().to_string()), "{message}");
    assert!(device().validation_messages().is_ok());
}
