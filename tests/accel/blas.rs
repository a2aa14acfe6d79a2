//! Bottom-level structures by Vulkan's structs: the same cases through ours and the driver's.

use crate::common::backends::{Backend, Built, Ours, backends, vk_format, vk_geometry};
use crate::common::device;
use crate::common::geometries::{MOVED, Owned};
use crate::common::probe::ProbeRay;
use crate::common::shapes::{Corners, ray, soup};
use hedgerow::accel::{self, AccelOptions, Request, Wide};
use hedgerow::ash::vk;
use hedgerow::ash::vk::Handle;
use hedgerow::bvh::codes::Codes;
use hedgerow::bvh::geometry::{GeometryFlags, IndexFormat, VertexFormat};
use hedgerow::bvh::layout::{self, Bvh2, Header};
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin;
use hedgerow::trace::twin::tracer::closest_hit_by_brute_force;
use hedgerow::trace::{Hit, Ray};
use hedgerow_lab::random::SplitMix64;

type BuildInfo<'a> = vk::AccelerationStructureBuildGeometryInfoKHR<'a>;
type Flags = vk::BuildAccelerationStructureFlagsKHR;
type Range = vk::AccelerationStructureBuildRangeInfoKHR;

fn bottom_level<'a>(geometries: &'a [vk::AccelerationStructureGeometryKHR<'a>]) -> BuildInfo<'a> {
    BuildInfo::default().ty(vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL).geometries(geometries)
}

fn range_of(owned: &Owned) -> Range {
    Range::default().primitive_count(owned.primitive_count)
}

/// The tree that the host builds of the same bytes.
fn on_the_host(geometries: &[Owned]) -> Bvh2 {
    let corners: Vec<_> = geometries.iter().flat_map(|g| g.view().corners().collect::<Vec<_>>()).collect();
    let codes = Codes::for_count(corners.len() as u32);
    let opaque: Vec<_> = geometries.iter().map(|g| (g.primitive_count, GeometryFlags::OPAQUE.bits())).collect();
    twin::lbvh::build_corners(corners.into_iter(), codes, Collapse::SAH).with_geometries(&opaque, 0)
}

/// Rays to random points of random triangles, from around them.
fn rays_to(tree: &Bvh2, count: usize) -> Vec<Ray> {
    let mut random = SplitMix64::new(17);
    let bounds = tree.header.root.bounds();
    let radius = bounds.diagonal();
    (0..count)
        .map(|_| {
            let t = &tree.records[random.bits() as usize % tree.header.active as usize];
            let (u, v) = (0.5 * random.signed().abs(), 0.5 * random.signed().abs());
            let target: [f32; 3] = std::array::from_fn(|k| t.v0[k] + u * (t.v1[k] - t.v0[k]) + v * (t.v2[k] - t.v0[k]));
            let out = random.around(radius);
            let origin: [f32; 3] = std::array::from_fn(|k| bounds.centroid()[k] + out[k]);
            ray(origin, std::array::from_fn(|k| target[k] - origin[k]))
        })
        .collect()
}

/// Ours exactly; the driver's, whose arithmetic is its own, but for rays within rounding of an edge or of two surfaces.
/// `local` tells the primitive index within its geometry, which the driver reports, or nothing where triangles lie in each
/// other's planes: the driver may report any of them.
#[track_caller]
fn assert_hits(
    backend: &dyn Backend,
    what: &str,
    tree: &Bvh2,
    rays: &[Ray],
    hits: &[Hit],
    local: impl Fn(u32) -> Option<u32>,
) {
    let expected: Vec<Hit> = rays.iter().map(|ray| closest_hit_by_brute_force(tree, ray)).collect();
    assert!(
        expected.iter().filter(|h| h.is_some()).count() > rays.len() / 2,
        "{what}: rays that hit nothing are no test"
    );
    if backend.name() == "hedgerow" {
        assert_eq!(hits, expected, "{what}");
        return;
    }
    let close = |a: f32, b: f32| a == b || (a - b).abs() <= 1e-4 * a.abs().max(b.abs());
    let differ = (hits.iter().zip(&expected))
        .filter(|(hit, expected)| {
            let same = !expected.is_some() || local(expected.primitive).is_none_or(|local| hit.primitive == local);
            !(hit.is_some() == expected.is_some() && close(hit.t, expected.t) && same)
        })
        .count();
    assert!(differ * 200 <= rays.len(), "{what}: {differ} of {} rays differ from brute force", rays.len());
}

fn takes(backend: &dyn Backend, format: VertexFormat) -> bool {
    if backend.name() == "hedgerow" {
        return true;
    }
    let mut properties = vk::FormatProperties2::default();
    unsafe {
        device().ash_instance().get_physical_device_format_properties2(
            device().physical_device(),
            vk_format(format),
            &mut properties,
        );
    }
    properties
        .format_properties
        .buffer_features
        .contains(vk::FormatFeatureFlags::ACCELERATION_STRUCTURE_VERTEX_BUFFER_KHR)
}

#[test]
fn every_format_and_layout_is_hit_where_it_is() {
    // Flat formats need triangles that are not seen edge-on: rays come from all around.
    let corners = soup(80, 0.9, 23);
    for backend in backends() {
        let mut built_formats = 0;
        for vertex_format in VertexFormat::ALL {
            if !takes(&*backend, vertex_format) {
                continue;
            }
            built_formats += 1;
            for index_format in IndexFormat::ALL {
                // The validation layers on the machine know 8-bit indices only with their extension.
                if index_format == IndexFormat::U8 && backend.name() == "driver" {
                    continue;
                }
                let transform = Some(MOVED).filter(|_| {
                    backend.name() == "hedgerow"
                        || vertex_format.component_bytes() == 4
                        || !device().workarounds.driver_misreads_geometry
                });
                for (padding, transform, offset) in [(0, None, 0), (8, transform, 256)] {
                    let what = format!("{} {vertex_format:?} {index_format:?} {padding}", backend.name());
                    let count = if index_format == IndexFormat::U8 { 80 } else { corners.len() };
                    let corners: Corners = corners[..count].to_vec();
                    let owned = Owned { transform, ..Owned::of(&corners, vertex_format, index_format, padding) };
                    let tree = on_the_host(std::slice::from_ref(&owned));
                    let (geometry, _memory) = owned.upload(0, 0);
                    let geometries = [vk_geometry(&geometry, &owned)];
                    let built = Built::new(&*backend, &bottom_level(&geometries), &[range_of(&owned)], offset);
                    let rays = rays_to(&tree, 400);
                    let hits = backend.trace(built.structure, &rays);
                    let flat = vertex_format.components() == 2;
                    assert_hits(&*backend, &what, &tree, &rays, &hits, |primitive| (!flat).then_some(primitive));
                    backend.destroy(built.structure);
                }
            }
        }
        assert!(built_formats >= 3, "{}: {built_formats} formats", backend.name());
    }
}

#[test]
fn offsets_of_a_range_begin_in_the_middle_of_the_buffers() {
    let corners = soup(90, 0.9, 5);
    for backend in backends() {
        for index_format in [IndexFormat::NONE, IndexFormat::U16, IndexFormat::U32] {
            let no_first_vertex = backend.name() == "driver" && device().workarounds.driver_misreads_geometry;
            let owned = Owned::of(&corners, VertexFormat::FLOAT3, index_format, 4);
            let transforms = device().upload("transforms", &[[[0f32; 4]; 3], MOVED]).expect("memory");
            let (geometry, _memory) = owned.upload(0, 0);
            let mut given = vk_geometry(&geometry, &owned);
            given.geometry.triangles.transform_data.device_address = transforms.address();
            // Fifty triangles from the 20th on; or forty whose indices begin at the 20th and count from the 20th's first vertex.
            let mut range = Range { primitive_count: 50, transform_offset: 48, ..Range::default() };
            let (primitives, shift) = match index_format {
                IndexFormat::NONE => {
                    range.first_vertex = if no_first_vertex { 0 } else { 30 };
                    range.primitive_offset = if no_first_vertex { 60 } else { 30 } * owned.vertex_stride;
                    (20..70, 0)
                }
                _ if no_first_vertex => {
                    range.primitive_offset = 3 * 20 * index_format.bytes();
                    (20..70, 0)
                }
                _ => {
                    range.primitive_count = 40;
                    range.first_vertex = 60;
                    range.primitive_offset = 3 * 20 * index_format.bytes();
                    (20..60, 20)
                }
            };
            let moved: Corners = primitives.map(|i| corners[i + shift]).collect();
            let expected =
                Owned { transform: Some(MOVED), ..Owned::of(&moved, VertexFormat::FLOAT3, IndexFormat::NONE, 0) };
            let tree = on_the_host(&[expected]);
            let geometries = [given];
            let built = Built::new(&*backend, &bottom_level(&geometries), &[range], 0);
            let rays = rays_to(&tree, 400);
            let hits = backend.trace(built.structure, &rays);
            let what = format!("{} {index_format:?}", backend.name());
            assert_hits(&*backend, &what, &tree, &rays, &hits, Some);
            backend.destroy(built.structure);
        }
    }
}

/// Nodes of eight: hits are those of brute force, whichever way the walk goes; of many triangles in one place, which are a leaf that is too long
/// for its byte, too.
#[test]
fn structures_for_fast_rays_are_hit_where_they_are() {
    let mut in_one_place = soup(40, 0.9, 5);
    in_one_place.extend(vec![in_one_place[7]; 700]);
    let flags = [Flags::PREFER_FAST_TRACE, Flags::PREFER_FAST_TRACE | accel::ANY_HIT_ORDER, Flags::LOW_MEMORY];
    let backend = Ours::on(device());
    for (what, corners) in [("one", soup(1, 0.9, 3)), ("soup", soup(3000, 0.1, 7)), ("in one place", in_one_place)] {
        for flags in flags {
            let owned = Owned::of(&corners, VertexFormat::FLOAT3, IndexFormat::U32, 0);
            let (geometry, _memory) = owned.upload(0, 0);
            let geometries = [vk_geometry(&geometry, &owned)];
            let built = Built::new(&backend, &bottom_level(&geometries).flags(flags), &[range_of(&owned)], 0);
            let header: Header = built.memory.read_at(0, 1)[0];
            let is_wide = flags.contains(Flags::PREFER_FAST_TRACE) || corners.len() > 2048;
            assert_eq!(layout::is_quantised(header.kind), is_wide, "{what}, {flags:?}");
            let tree = on_the_host(std::slice::from_ref(&owned));
            let rays = rays_to(&tree, 1000);
            let probes: Vec<ProbeRay> = rays.iter().map(|ray| ProbeRay::new(ray.origin, ray.direction)).collect();
            for (ray, report) in rays.iter().zip(backend.probe(built.structure, &probes)) {
                let hit = closest_hit_by_brute_force(&tree, ray);
                let met = report.committed;
                assert_eq!(met.kind == 1, hit.is_some(), "{what}, {flags:?}, {ray:?}");
                if hit.is_some() {
                    assert_eq!(
                        (met.t, met.primitive, met.barycentrics),
                        (hit.t, hit.primitive, [hit.u, hit.v]),
                        "{what}, {flags:?}, {ray:?}"
                    );
                }
            }
        }
    }
}

/// Five geometries, empty ones among them.
fn several() -> Vec<Owned> {
    let part = |i: u64, count, vertex_format, index_format, transform| Owned {
        transform,
        ..Owned::of(&soup(count, 0.9, i), vertex_format, index_format, 0)
    };
    vec![
        part(1, 40, VertexFormat::FLOAT3, IndexFormat::U32, None),
        part(2, 0, VertexFormat::FLOAT3, IndexFormat::NONE, None),
        part(3, 1, VertexFormat::HALF3, IndexFormat::NONE, None),
        part(4, 70, VertexFormat::SNORM3, IndexFormat::U16, Some(MOVED)),
        part(5, 25, VertexFormat::FLOAT2, IndexFormat::U16, None),
    ]
}

#[test]
fn several_geometries_are_one_structure() {
    for backend in backends() {
        let mut parts: Vec<Owned> = several().into_iter().filter(|p| takes(&*backend, p.vertex_format)).collect();
        if backend.name() == "driver" && device().workarounds.driver_misreads_geometry {
            parts.retain(|part| part.transform.is_none());
        }
        let tree = on_the_host(&parts);
        let uploaded: Vec<_> = parts.iter().map(|part| part.upload(0, 0)).collect();
        let geometries: Vec<_> = uploaded.iter().zip(&parts).map(|((g, _), part)| vk_geometry(g, part)).collect();
        let ranges: Vec<Range> = parts.iter().map(range_of).collect();
        let pointers: Vec<_> = geometries.iter().collect();
        // Both ways to name them.
        let by_pointers =
            BuildInfo::default().ty(vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL).geometries_ptrs(&pointers);
        for info in [bottom_level(&geometries), by_pointers] {
            let built = Built::new(&*backend, &info, &ranges, 512);
            let rays = rays_to(&tree, 600);
            let hits = backend.trace(built.structure, &rays);
            let local = |primitive: u32| -> Option<u32> {
                let mut left = primitive;
                let part = parts.iter().find(|part| {
                    let here = left < part.primitive_count;
                    left -= if here { 0 } else { part.primitive_count };
                    here
                })?;
                (part.vertex_format.components() == 3).then_some(left)
            };
            assert_hits(&*backend, backend.name(), &tree, &rays, &hits, local);
            backend.destroy(built.structure);
        }
    }
}

/// Our bytes are those of the host, whether built alone or beside others, and nothing else is written.
#[test]
fn builds_of_a_batch_are_those_of_the_host() {
    let ours = Ours::on(device());
    let cases: Vec<Vec<Owned>> = (0..40)
        .map(|i| match i % 5 {
            0 => several(),
            1 => Vec::new(),
            _ => vec![Owned::of(&soup(i * i % 300, 0.5, i as u64), VertexFormat::FLOAT3, IndexFormat::U32, 0)],
        })
        .collect();
    let uploaded: Vec<Vec<_>> = cases.iter().map(|parts| parts.iter().map(|p| p.upload(0, 0)).collect()).collect();
    let geometries: Vec<Vec<_>> = uploaded
        .iter()
        .zip(&cases)
        .map(|(uploaded, parts)| uploaded.iter().zip(parts).map(|((g, _), part)| vk_geometry(g, part)).collect())
        .collect();
    let ranges: Vec<Vec<Range>> = cases.iter().map(|parts| parts.iter().map(range_of).collect()).collect();
    const GUARD: u64 = 64;
    let mut infos = Vec::new();
    let mut memory = Vec::new();
    for (geometries, ranges) in geometries.iter().zip(&ranges) {
        let info = bottom_level(geometries);
        let counts: Vec<u32> = ranges.iter().map(|r| r.primitive_count).collect();
        let sizes = ours.build_sizes(&info, &counts);
        let structure = device().buffer("structure", sizes.acceleration_structure_size + GUARD).expect("memory");
        let scratch = device().buffer("scratch", sizes.build_scratch_size + GUARD).expect("memory");
        structure.write(&vec![0xa5u8; structure.bytes() as usize]);
        scratch.write(&vec![0xa5u8; scratch.bytes() as usize]);
        let create = vk::AccelerationStructureCreateInfoKHR::default()
            .buffer(structure.raw())
            .size(sizes.acceleration_structure_size)
            .ty(vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL);
        infos.push(
            info.dst_acceleration_structure(ours.create(&create))
                .scratch_data(vk::DeviceOrHostAddressKHR { device_address: scratch.address() }),
        );
        memory.push((structure, scratch, sizes));
    }
    let ranges: Vec<&[Range]> = ranges.iter().map(Vec::as_slice).collect();
    device()
        .run(None, |recorder| {
            ours.build(recorder, &infos, &ranges);
            Ok(())
        })
        .expect("they build");
    for (i, (parts, (structure, scratch, sizes))) in cases.iter().zip(&memory).enumerate() {
        let expected = on_the_host(parts).to_bytes();
        let got = structure.read::<u8>(structure.bytes() as usize);
        assert_eq!(expected.len() as u64, sizes.acceleration_structure_size, "build {i}");
        assert!(got[..expected.len()] == expected, "build {i}");
        let guards = [&got[expected.len()..], &scratch.read_at::<u8>(sizes.build_scratch_size, GUARD as usize)];
        assert!(
            guards.iter().all(|guard| guard.iter().all(|&byte| byte == 0xa5)),
            "build {i} writes behind its memory"
        );
    }
}

#[test]
fn fewer_primitives_than_were_planned_for_fit() {
    let ours = Ours::on(device());
    let owned = Owned::of(&soup(300, 0.5, 9), VertexFormat::FLOAT3, IndexFormat::U32, 0);
    let (geometry, _memory) = owned.upload(0, 0);
    let geometries = [vk_geometry(&geometry, &owned)];
    let info = bottom_level(&geometries);
    let built = Built::place(&ours, &info, &[300], 0);
    let (_scratch, scratch) = built.scratch(&ours, &info, &[300]);
    let info = info
        .dst_acceleration_structure(built.structure)
        .scratch_data(vk::DeviceOrHostAddressKHR { device_address: scratch });
    for count in [0, 1, 2, 299, 300] {
        let range = Range::default().primitive_count(count);
        device()
            .run(None, |recorder| {
                ours.build(recorder, &[info], &[&[range]]);
                Ok(())
            })
            .expect("it builds");
        let expected = on_the_host(&[Owned { primitive_count: count, ..owned.clone() }]).to_bytes();
        assert!(built.memory.read::<u8>(expected.len()) == expected, "{count} triangles");
    }
}

/// More triangles have a smaller table to sort with at some counts: what is asked for must suffice for fewer, too.
#[test]
fn the_sizes_of_a_maximum_suffice_for_every_smaller_count() {
    let owned = Owned::of(&soup(1, 0.5, 9), VertexFormat::FLOAT3, IndexFormat::U32, 0);
    let (geometry, _memory) = owned.upload(0, 0);
    let geometries = [vk_geometry(&geometry, &owned)];
    let all = [Flags::empty(), Flags::PREFER_FAST_BUILD, Flags::PREFER_FAST_TRACE, Flags::ALLOW_UPDATE];
    let mut counts: Vec<u32> = (0..25)
        .flat_map(|bit| [-300, -1, 0, 1, 255, 256, 257].map(|by| (1i64 << bit) + by))
        .collect::<Vec<_>>()
        .into_iter()
        .filter_map(|count| u32::try_from(count).ok())
        .collect();
    counts.sort_unstable();
    let all = all.into_iter().flat_map(|flags| [Wide::Never, Wide::ByFlags, Wide::Always].map(|wide| (flags, wide)));
    for (flags, wide) in all {
        let ours = Ours::with_options(device(), AccelOptions { wide, ..AccelOptions::DEFAULT });
        let mut most = [0; 2];
        for &count in &counts {
            let sizes = ours.build_sizes(&bottom_level(&geometries).flags(flags), &[count]);
            let needed = Request::triangles(&[(geometry, count)]).with_flags(flags).sizes(&ours.0).expect("few enough");
            most = [most[0].max(needed.structure), most[1].max(needed.scratch)];
            assert!(
                sizes.acceleration_structure_size >= most[0] && sizes.build_scratch_size >= most[1],
                "{count}, {flags:?}, {wide:?}: {sizes:?}, {most:?}"
            );
        }
    }
}

/// Of a fast trace, or of as many primitives as the documentation says, where they are not built in haste and allow no update.
#[test]
fn bottom_levels_are_of_nodes_of_eight_by_flags_and_size() {
    let ours = Ours::with_options(device(), AccelOptions::DEFAULT);
    let owned = Owned::of(&soup(4096, 0.05, 21), VertexFormat::FLOAT3, IndexFormat::U32, 0);
    let (geometry, _memory) = owned.upload(0, 0);
    let geometries = [vk_geometry(&geometry, &owned)];
    let (trace, none) = (Flags::PREFER_FAST_TRACE, Flags::empty());
    for (flags, count, is_wide) in [
        (trace, 4096, true),
        (trace, 2, true),
        (none, 4096, true),
        (none, 4095, false),
        (Flags::PREFER_FAST_BUILD, 4096, false),
        (trace | Flags::ALLOW_UPDATE, 4096, false),
    ] {
        let info = bottom_level(&geometries).flags(flags);
        // SAFETY: the geometries live.
        let says = unsafe { ours.0.makes_nodes_of_eight(&info, &[count]) }.expect("it can be built");
        assert_eq!(says, is_wide, "{count}, {flags:?}");
        // In memory for the most.
        let built = Built::place(&ours, &info, &[4096], 0);
        let (_scratch, scratch) = built.scratch(&ours, &info, &[4096]);
        let info = info
            .dst_acceleration_structure(built.structure)
            .scratch_data(vk::DeviceOrHostAddressKHR { device_address: scratch });
        let range = Range::default().primitive_count(count);
        let done = device().run(None, |recorder| {
            ours.build(recorder, &[info], &[&[range]]);
            Ok(())
        });
        done.expect("it builds");
        let header: Header = built.memory.read_at(0, 1)[0];
        assert_eq!((layout::is_quantised(header.kind), header.primitive_count), (is_wide, count), "{flags:?}");
    }
}

#[test]
fn what_cannot_be_built_is_refused_by_name() {
    let ours = accel::Device::new(device());
    let owned = Owned::of(&soup(4, 0.5, 9), VertexFormat::FLOAT3, IndexFormat::U32, 0);
    let (geometry, _memory) = owned.upload(0, 0);
    let good = [vk_geometry(&geometry, &owned)];
    let handle = vk::AccelerationStructureKHR::from_raw(256);
    let scratch = |device_address| vk::DeviceOrHostAddressKHR { device_address };
    let info = bottom_level(&good).dst_acceleration_structure(handle).scratch_data(scratch(16));
    let range = range_of(&owned);
    let changed = |change: fn(&mut vk::AccelerationStructureGeometryKHR<'_>)| {
        let mut geometry = good;
        change(&mut geometry[0]);
        geometry
    };
    let instances = changed(|g| g.geometry_type = vk::GeometryTypeKHR::INSTANCES);
    let format = changed(|g| g.geometry.triangles.vertex_format = vk::Format::R8G8B8A8_UNORM);
    let indices = changed(|g| g.geometry.triangles.index_type = vk::IndexType::from_raw(77));
    let stride = changed(|g| g.geometry.triangles.vertex_stride = 13);
    let with = |geometries| BuildInfo { p_geometries: geometries, ..info };
    let both = BuildInfo { pp_geometries: &raw const info.p_geometries, ..info };
    let update = vk::BuildAccelerationStructureModeKHR::UPDATE;
    let one = [range];
    let cases: [(BuildInfo<'_>, &[Range], &str); 13] = [
        (info.ty(vk::AccelerationStructureTypeKHR::GENERIC), &one, "type"),
        (info.ty(vk::AccelerationStructureTypeKHR::TOP_LEVEL), &one, "geometryType"),
        (info.mode(update), &one, "mode"),
        (info.flags(vk::BuildAccelerationStructureFlagsKHR::MOTION_NV), &one, "flags"),
        (info.dst_acceleration_structure(vk::AccelerationStructureKHR::null()), &one, "dstAccelerationStructure"),
        (info.scratch_data(scratch(24)), &one, "scratchData"),
        (info.scratch_data(scratch(0)), &one, "scratchData"),
        (info, &[], "ranges"),
        (with(instances.as_ptr()), &one, "geometryType"),
        (with(format.as_ptr()), &one, "vertexFormat"),
        (with(indices.as_ptr()), &one, "indexType"),
        (with(stride.as_ptr()), &one, "vertexStride"),
        (both, &one, "pGeometries"),
    ];
    for (info, ranges, field) in cases {
        let mut refused = None;
        device()
            .run(None, |recorder| {
                refused =
                    unsafe { ours.cmd_build_acceleration_structures(recorder.commands(), &[info], &[ranges]) }.err();
                Ok(())
            })
            .expect("nothing was recorded");
        let message = refused.unwrap_or_else(|| panic!("{field} is taken")).to_string();
        assert!(message.starts_with("pInfos[0]: ") && message.contains(field), "{field}: {message}");
    }
    let huge = Range { primitive_count: u32::MAX, ..range };
    let mut message = String::new();
    device()
        .run(None, |recorder| {
            let refused = unsafe { ours.cmd_build_acceleration_structures(recorder.commands(), &[info], &[&[huge]]) };
            message = refused.expect_err("too many").to_string();
            Ok(())
        })
        .expect("nothing was recorded");
    assert!(message.contains("at most"), "{message}");
}
