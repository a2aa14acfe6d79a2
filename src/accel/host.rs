//! Builds on the host: the same structs with host addresses, the same bytes.

use super::build::{self, Build, Counts};
use super::geometry::BuildGeometries;
use super::{AccelOptions, Device, Tree};
use crate::bvh::geometry::{Geometry, IndexFormat};
use crate::bvh::twin::geometry::{Corners, HostGeometry};
use crate::bvh::twin::{self, lbvh, pairs};
use crate::geometry::Aabb;
use crate::gpu::Context;
use crate::{Error, Result};
use ash::vk;

impl Device<'_> {
    /// `vkBuildAccelerationStructuresKHR`, but for where the structures go: the bytes of build i, those that a device's build of
    /// the same input writes, into `memory[i]`, to be copied to where the structure shall lie. Handles and scratch memory are
    /// not looked at. The host's builder is the plain one that the device's is tested with: one thread, no deferred operations.
    /// Top levels are built by [`twin`](super::twin), which takes what lies below them.
    ///
    /// # Errors
    /// As [`Device::cmd_build_acceleration_structures`]; a build of instances, or an update; too little memory.
    ///
    /// # Safety
    /// Pointers and host addresses are valid, for as many bytes as the structs say.
    pub unsafe fn build_acceleration_structures(
        &self,
        infos: &[vk::AccelerationStructureBuildGeometryInfoKHR<'_>],
        build_range_infos: &[&[vk::AccelerationStructureBuildRangeInfoKHR]],
        memory: &mut [&mut [u8]],
    ) -> Result<()> {
        if infos.len() != build_range_infos.len() || infos.len() != memory.len() {
            return Err(Error::Argument(format!(
                "{} builds, {} arrays of ranges and {} places; give one for each",
                infos.len(),
                build_range_infos.len(),
                memory.len()
            )));
        }
        for (i, ((info, ranges), place)) in infos.iter().zip(build_range_infos).zip(memory).enumerate() {
            // SAFETY: the caller's promise.
            let built = unsafe { built(self.context, self.options(), info, ranges) };
            let bytes = built.map_err(|error| super::device::within(i, error))?;
            let there = place.len();
            let Some(place) = place.get_mut(..bytes.len()) else {
                return Err(Error::Argument(format!(
                    "pInfos[{i}]: the structure has {} bytes, {there} are there; take as many as \
                     get_acceleration_structure_build_sizes says",
                    bytes.len()
                )));
            };
            place.copy_from_slice(&bytes);
        }
        Ok(())
    }
}

unsafe fn built(
    context: &Context,
    options: &AccelOptions,
    info: &vk::AccelerationStructureBuildGeometryInfoKHR<'_>,
    ranges: &[vk::AccelerationStructureBuildRangeInfoKHR],
) -> Result<Vec<u8>> {
    if info.mode != vk::BuildAccelerationStructureModeKHR::BUILD {
        return Err(Error::Argument(format!("mode is {:?}; the host only builds; set it to BUILD", info.mode)));
    }
    // SAFETY: the caller's promise.
    let (given, count) = unsafe { build::told(info, ranges) }?;
    let build = Build::new(context, options, info.flags, given, Counts::OnHost, count)?;
    let (options, codes) = build.host_options();
    let flags_of = |geometries: &[Geometry]| -> Vec<(u32, u32)> {
        geometries.iter().zip(ranges).map(|(g, range)| (range.primitive_count, g.flags.bits())).collect()
    };
    match build.given() {
        BuildGeometries::Triangles(geometries) => {
            let mut corners: Vec<Corners> = Vec::new();
            for (geometry, range) in geometries.iter().zip(ranges) {
                // SAFETY: the caller's promise.
                corners.extend(unsafe { triangles(geometry, range.primitive_count) }.corners());
            }
            let lbvh = |finish| match options.pairs {
                true => pairs::build_corners(corners.into_iter(), codes, finish),
                false => lbvh::build_corners(corners.into_iter(), codes, finish).into(),
            };
            let tree = twin::build(&options, codes, lbvh).with_geometries(&flags_of(geometries), options.build_flags);
            Ok(Tree::of(tree, build.is_wide()).to_bytes())
        }
        BuildGeometries::Boxes(geometries) => {
            let mut boxes = Vec::new();
            for (geometry, range) in geometries.iter().zip(ranges) {
                // SAFETY: the caller's promise.
                boxes.extend((0..range.primitive_count).map(|i| unsafe { box_at(geometry, i) }));
            }
            let lbvh = |finish| lbvh::build_aabbs(&boxes, codes, finish);
            let tree = twin::build(&options, codes, lbvh).with_geometries(&flags_of(geometries), options.build_flags);
            Ok(Tree::of(tree, build.is_wide()).to_bytes())
        }
        BuildGeometries::Instances { .. } => Err(Error::Argument(
            "type is TOP_LEVEL; this call does not have the structures that instances name: take accel::twin::top_level"
                .into(),
        )),
    }
}

/// Triangles at host addresses.
unsafe fn triangles<'a>(geometry: &Geometry, primitive_count: u32) -> HostGeometry<'a> {
    let format = geometry.vertex_format;
    let last = u64::from(geometry.vertex_count).saturating_sub(1) * u64::from(geometry.vertex_stride);
    let vertex_bytes = u64::from(format.component_bytes() * format.components());
    let index_bytes = 3 * u64::from(primitive_count) * u64::from(geometry.index_format.bytes());
    let indexed = geometry.index_format != IndexFormat::NONE;
    // SAFETY: the caller's promise.
    unsafe {
        HostGeometry {
            vertices: if geometry.vertex_count == 0 { &[] } else { bytes_at(geometry.vertices, last + vertex_bytes) },
            vertex_stride: geometry.vertex_stride,
            vertex_count: geometry.vertex_count,
            vertex_format: format,
            indices: if indexed { bytes_at(geometry.indices, index_bytes) } else { &[] },
            index_format: geometry.index_format,
            transform: (geometry.transform != 0)
                .then(|| bytemuck::pod_read_unaligned(bytes_at(geometry.transform, size_of::<[[f32; 4]; 3]>() as u64))),
            primitive_count,
        }
    }
}

unsafe fn box_at(geometry: &Geometry, i: u32) -> Aabb {
    // SAFETY: the caller's promise.
    let bytes = unsafe { bytes_at(geometry.vertices + u64::from(i) * u64::from(geometry.vertex_stride), 24) };
    bytemuck::pod_read_unaligned(bytes)
}

unsafe fn bytes_at<'a>(address: u64, count: u64) -> &'a [u8] {
    if count == 0 {
        return &[];
    }
    // SAFETY: the caller's promise.
    unsafe { std::slice::from_raw_parts(address as *const u8, count as usize) }
}
