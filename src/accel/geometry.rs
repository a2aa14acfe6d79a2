//! The geometries of Vulkan's structs as those of our builders.

use crate::bvh::geometry::{Geometry, GeometryFlags, IndexFormat, Primitives, VertexFormat};
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

/// What a build is over: geometries of one kind.
#[derive(Debug, Clone)]
pub(super) enum BuildGeometries {
    /// Triangles.
    Triangles(Vec<Geometry>),
    /// Boxes.
    Boxes(Vec<Geometry>),
    /// Instances at an address, or pointers to them.
    Instances {
        /// The address.
        data: u64,
        /// Whether pointers lie there.
        pointers: bool,
    },
}

impl BuildGeometries {
    /// The geometries of a structure of type `ty`, with their ranges and the `first` of each.
    pub fn new(
        ty: vk::AccelerationStructureTypeKHR,
        geometries: &[&vk::AccelerationStructureGeometryKHR<'_>],
        ranges: &[vk::AccelerationStructureBuildRangeInfoKHR],
        firsts: &[u32],
    ) -> Result<BuildGeometries> {
        match ty {
            vk::AccelerationStructureTypeKHR::TOP_LEVEL => {
                let [geometry] = geometries else {
                    return Err(Error::Argument(format!(
                        "geometryCount is {}; a TOP_LEVEL structure has one geometry, of INSTANCES",
                        geometries.len()
                    )));
                };
                instances(geometry, &ranges[0])
            }
            vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL => {
                let kind = geometries.first().map_or(vk::GeometryTypeKHR::TRIANGLES, |g| g.geometry_type);
                if let Some(other) = geometries.iter().position(|g| g.geometry_type != kind) {
                    return Err(Error::Argument(format!(
                        "pGeometries[{other}].geometryType is {:?} and that of the first {kind:?}; all must be the same",
                        geometries[other].geometry_type
                    )));
                }
                let all = geometries.iter().zip(ranges).zip(firsts);
                match kind {
                    vk::GeometryTypeKHR::TRIANGLES => {
                        let given = all.map(|((geometry, range), &first)| triangles(geometry, range, first));
                        given.collect::<Result<_>>().map(BuildGeometries::Triangles)
                    }
                    vk::GeometryTypeKHR::AABBS => {
                        let given = all.map(|((geometry, range), &first)| boxes(geometry, range, first));
                        given.collect::<Result<_>>().map(BuildGeometries::Boxes)
                    }
                    other => Err(Error::Argument(format!(
                        "geometryType is {other:?}; bottom-level structures hold TRIANGLES or AABBS"
                    ))),
                }
            }
            other => {
                Err(Error::Argument(format!("type is {other:?}; a build needs to know: BOTTOM_LEVEL or TOP_LEVEL")))
            }
        }
    }

    /// What the structure will hold.
    pub fn primitives(&self) -> Primitives {
        match self {
            BuildGeometries::Triangles(_) => Primitives::Triangles,
            BuildGeometries::Boxes(_) => Primitives::Boxes,
            BuildGeometries::Instances { .. } => Primitives::Instances,
        }
    }

    /// Geometries, at least 1.
    pub fn count(&self) -> u32 {
        match self {
            BuildGeometries::Triangles(geometries) | BuildGeometries::Boxes(geometries) => {
                geometries.len().max(1) as u32
            }
            BuildGeometries::Instances { .. } => 1,
        }
    }
}

/// The instances of a top level.
fn instances(
    geometry: &vk::AccelerationStructureGeometryKHR<'_>,
    range: &vk::AccelerationStructureBuildRangeInfoKHR,
) -> Result<BuildGeometries> {
    if geometry.geometry_type != vk::GeometryTypeKHR::INSTANCES {
        return Err(Error::Argument(format!(
            "geometryType is {:?}; top-level structures hold INSTANCES",
            geometry.geometry_type
        )));
    }
    // SAFETY: the type says which of the union's members it is; device builds give device addresses.
    let (instances, address) = unsafe {
        let instances = geometry.geometry.instances;
        (instances, instances.data.device_address)
    };
    let pointers = instances.array_of_pointers == vk::TRUE;
    Ok(BuildGeometries::Instances { data: address.wrapping_add(range.primitive_offset.into()), pointers })
}

/// The boxes of a geometry that `range` takes; `first` boxes come before.
fn boxes(
    geometry: &vk::AccelerationStructureGeometryKHR<'_>,
    range: &vk::AccelerationStructureBuildRangeInfoKHR,
    first: u32,
) -> Result<Geometry> {
    // SAFETY: the type says which of the union's members it is; device builds give device addresses.
    let (boxes, address) = unsafe {
        let boxes = geometry.geometry.aabbs;
        (boxes, boxes.data.device_address)
    };
    let stride = u32::try_from(boxes.stride).ok().filter(|stride| stride.is_multiple_of(8));
    let Some(stride) = stride else {
        return Err(Error::Argument(format!(
            "aabbs.stride is {}; it must be a multiple of 8 below 2^32",
            boxes.stride
        )));
    };
    let address = address.wrapping_add(range.primitive_offset.into());
    Ok(Geometry { first, flags: flags_of(geometry), ..Geometry::boxes(address, stride) })
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
fn triangles(
    geometry: &vk::AccelerationStructureGeometryKHR<'_>,
    range: &vk::AccelerationStructureBuildRangeInfoKHR,
    first: u32,
) -> Result<Geometry> {
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
