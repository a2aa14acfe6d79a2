//! Triangles in every format: the device's tree is the host's, byte for byte, and that of the same triangles as plain floats.

use crate::common::device;
use crate::common::geometries::{MOVED, Owned, half};
use crate::common::shapes::{Corners, soup};
use crate::common::twins::{assert_same, built};
use hedgerow::bvh::builder::{BuildOptions, Schedule};
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::geometry::{IndexFormat, Input, Source, VertexFormat};
use hedgerow::bvh::layout::{Bvh2, status};
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin;

#[track_caller]
fn assert_as_on_the_host(geometries: &[Owned], shift: usize) -> Bvh2 {
    let corners = geometries.iter().flat_map(|g| g.view().corners().collect::<Vec<_>>());
    let expected = twin::lbvh::build_corners(corners, Code::Emc64Var.full(), Collapse::SAH);
    let counts: Vec<_> = geometries.iter().map(|g| (g.primitive_count, 0)).collect();
    let expected = expected.with_geometries(&counts, 0);
    expected.validate().expect("a valid tree");
    let mut first = 0;
    let mut records = Vec::new();
    let mut memory = Vec::new();
    for geometry in geometries {
        let (record, buffers) = geometry.upload(first, shift);
        first += geometry.primitive_count;
        records.push(record);
        memory.push(buffers);
    }
    let buffer = device().upload("records", &records).expect("memory");
    let several = Source::Several { records: buffer.address(), count: records.len() as u32 };
    let mut sources = vec![several];
    sources.extend((records.len() == 1).then(|| Source::One(records[0])));
    for source in sources {
        let geometry_count = match source {
            Source::Several { count, .. } => count,
            _ => 1,
        };
        for schedule in [Schedule::Chain, Schedule::PERSISTENT, Schedule::Workgroup] {
            let (codes, schedule) = (Some(Code::Emc64Var.full()), Some(schedule));
            let options = BuildOptions { codes, schedule, geometry_count, ..BuildOptions::DEFAULT };
            let got = built(&options, &Input { source, primitive_count: first });
            assert_same(&got, &expected, &format!("{source:?} {schedule:?}"));
        }
    }
    expected
}

#[test]
fn every_format_and_layout_gives_the_tree_of_the_host() {
    for vertex_format in VertexFormat::ALL {
        for index_format in IndexFormat::ALL {
            for (padding, transform, shift) in [(0, None, 0), (4, Some(MOVED), 1), (12, None, 3)] {
                let mut geometry = Owned::random(vertex_format, index_format, padding, 150, 7);
                geometry.transform = transform;
                let tree = assert_as_on_the_host(&[geometry], shift);
                assert!(tree.header.active > 20, "{vertex_format:?} {index_format:?}: there is something to compare");
                let left_out = index_format != IndexFormat::NONE || vertex_format.component_bytes() == 2;
                if left_out && vertex_format != VertexFormat::SNORM2 && vertex_format != VertexFormat::SNORM3 {
                    assert_ne!(tree.header.status & (status::NON_FINITE | status::INDEX_OUT_OF_RANGE), 0);
                }
            }
        }
    }
}

#[test]
fn several_geometries_are_one_after_the_other() {
    let geometry = |i: usize, count| {
        let (vertex_format, index_format) = (VertexFormat::ALL[i % 6], IndexFormat::ALL[i % 4]);
        let transform = (i % 3 == 1).then_some(MOVED);
        Owned { transform, ..Owned::random(vertex_format, index_format, 4, count, i as u64) }
    };
    assert_as_on_the_host(&[geometry(0, 1), geometry(1, 1)], 0);
    // Empty ones, at the ends and between.
    assert_as_on_the_host(
        &[geometry(2, 0), geometry(3, 70), geometry(4, 0), geometry(5, 0), geometry(6, 9), geometry(7, 0)],
        1,
    );
    let many: Vec<Owned> = (0..100).map(|i| geometry(i, (i as u32 * 7) % 13)).collect();
    assert_as_on_the_host(&many, 0);
}

/// Vertices are found by address: numbers of bytes and of floats before them need more than 32 bits.
#[test]
fn vertices_behind_four_billion_bytes_are_found() {
    let corners: Corners = soup(200, 0.3, 9);
    let positions: Vec<[f32; 3]> = corners.into_iter().flatten().collect();
    let count = positions.len() as u32;
    let vertices = device().upload("positions", &positions).expect("memory");
    let tree = |first: u32| {
        let triangles: Vec<u32> = (0..count).map(|v| first + v).collect();
        let indices = device().upload("indices", &triangles).expect("memory");
        // Where vertex 0 would lie; nobody reads it.
        let begin = vertices.address().wrapping_sub(12 * u64::from(first));
        let options = BuildOptions { codes: Some(Code::Emc64Var.full()), ..BuildOptions::DEFAULT };
        built(&options, &Input::mesh(begin, first + count, indices.address(), count / 3))
    };
    let expected = tree(0);
    assert_eq!(expected.header.active, 200);
    for first in [u32::MAX / 12, u32::MAX / 3, u32::MAX - count] {
        assert_same(&tree(first), &expected, &format!("from vertex {first} on"));
    }
}

/// Numbers that 16 bits and two components hold exactly give the same hierarchy as the same numbers in 32 bits.
#[test]
fn the_same_triangles_in_other_formats_are_the_same_tree() {
    let corners: Corners = soup(200, 0.3, 3);
    let eighths = |x: f32| (8.0 * x).round();
    let plain: Vec<[f32; 3]> = corners.iter().flatten().map(|v| v.map(|x| eighths(x) / 8.0)).collect();
    let as_floats = Owned {
        vertices: bytemuck::cast_slice(&plain).to_vec(),
        vertex_stride: 12,
        vertex_count: plain.len() as u32,
        vertex_format: VertexFormat::FLOAT3,
        indices: Vec::new(),
        index_format: IndexFormat::NONE,
        transform: None,
        primitive_count: 200,
    };
    let halves: Vec<[u16; 4]> = plain.iter().map(|v| [half(v[0]), half(v[1]), half(v[2]), 0x7e00]).collect();
    let as_halves = Owned {
        vertices: bytemuck::cast_slice(&halves).to_vec(),
        vertex_stride: 8,
        vertex_format: VertexFormat::HALF3,
        ..as_floats.clone()
    };
    let count = plain.len() as u32;
    let indexed = Owned {
        indices: (0..count).flat_map(|i| (i as u16).to_le_bytes()).collect(),
        index_format: IndexFormat::U16,
        ..as_floats.clone()
    };
    let expected = assert_as_on_the_host(&[as_floats], 0);
    assert_eq!(expected.header.active, 200);
    for other in [as_halves, indexed] {
        let tree = assert_as_on_the_host(&[other], 0);
        assert!(tree.to_bytes() == expected.to_bytes());
    }
}
