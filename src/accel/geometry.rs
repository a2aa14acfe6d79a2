//! The geometries of Vulkan's structs as those of our builders.

use crate::bvh::geometry::{Geometry, GeometryFlags, IndexFormat, VertexFormat};
use crate::{Error, Result};
use ash::vk;

/// The geometries of a build: whichever of the two arrays is given.
///
/// # Safety
/// The pointers of `info` are valid for `geometry_count` elements.
pub(super) unsafe fn given<'a>(
    info: &'a vk::AccelerationStructureBuildGeometryInfoKHR<'_>,
) -> Result<Vec<&'a vk::AccelerationStructureGeometryKHR<'a>>> {
    let count = info.geometry_count as usize;
    match (info.p_geometries.is_null(), info.pp_geometries.is_null()) {
        _ if count == 0 => Ok(Vec::new()),
        // SAFETY: the caller's promise.
        (false, true) => Ok(unsafe { std::slice::from_raw_parts(info.p_geometries, count) }.iter().collect()),
        // SAFETY: the caller's promise.
        (true, false) => Ok(unsafe { std::slice::from_raw_parts(info.pp_geometries, count) }
            .iter()
            .map(|&geometry| unsafe { &*geometry })
            .collect()),
        _ => {
            Err(Error::Argument(format!("geometryCount is {count}; give exactly one of pGeometries and ppGeometries")))
        }
    }
}

fn flags_of(geometry: &vk::AccelerationStructureGeometryKHR<'_>) -> GeometryFlags {
    let mut flags = GeometryFlags::NONE;
    if geometry.flags.contains(vk::GeometryFlagsKHR::OPAQUE) {
        flags = flags | GeometryFlags::OPAQUE;
    }
    if geometry.flags.contains(vk::GeometryFlagsKHR::NO_DUPLICATE_ANY_HIT_INVOCATION) {
        flags = flags | GeometryFlags::NO_DUPLICATES;
    }
    flags
}

/// The triangles of a geometry that `range` takes; `first` triangles come before.
pub(super) fn triangles(
    geometry: &vk::AccelerationStructureGeometryKHR<'_>,
    range: &vk::AccelerationStructureBuildRangeInfoKHR,
    first: u32,
) -> Result<Geometry> {
    if geometry.geometry_type != vk::GeometryTypeKHR::TRIANGLES {
        return Err(Error::Argument(format!(
            "geometryType is {:?}; bottom-level structures hold TRIANGLES",
            geometry.geometry_type
        )));
    }
    // SAFETY: the type says which of the union's members it is; addresses are read as addresses.
    let triangles = unsafe { geometry.geometry.triangles };
    let vertex_format = VertexFormat::try_from(triangles.vertex_format)?;
    let index_format = IndexFormat::try_from(triangles.index_type)?;
    let vertex_stride = u32::try_from(triangles.vertex_stride)
        .map_err(|_| Error::Argument(format!("vertexStride is {}; at most 2^32 − 1", triangles.vertex_stride)))?;
    if !vertex_stride.is_multiple_of(vertex_format.component_bytes()) {
        return Err(Error::Argument(format!(
            "vertexStride is {vertex_stride}; it must be a multiple of the {} bytes of a component",
            vertex_format.component_bytes()
        )));
    }
    // SAFETY: device builds give device addresses.
    let (vertices, indices, transform) = unsafe {
        (
            triangles.vertex_data.device_address,
            triangles.index_data.device_address,
            triangles.transform_data.device_address,
        )
    };
    let offset = u64::from(range.primitive_offset);
    let indexed = index_format != IndexFormat::NONE;
    let first_vertex = u64::from(range.first_vertex) * u64::from(vertex_stride);
    // The size query is given addresses that mean nothing.
    Ok(Geometry {
        vertices: vertices.wrapping_add(first_vertex).wrapping_add(if indexed { 0 } else { offset }),
        indices: if indexed { indices.wrapping_add(offset) } else { 0 },
        transform: if transform == 0 { 0 } else { transform.wrapping_add(range.transform_offset.into()) },
        vertex_stride,
        vertex_count: triangles.max_vertex.saturating_add(1).saturating_sub(range.first_vertex),
        vertex_format,
        index_format,
        flags: flags_of(geometry),
        first,
    })
}
