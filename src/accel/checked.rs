//! What [`Options::checked`](super::Options::checked) looks at before anything is recorded: the rules of Vulkan's validation that
//! take memory of what was created and built.
//!
//! Every error names the field and the rule. The device's memory is not looked at: what the structures were built of may have
//! changed, and scratch memory is known by its address alone, so whether a buffer is there behind it is not known.

use crate::{Error, Result};
use ash::vk;
use ash::vk::Handle;
use std::collections::HashMap;
use std::ops::Range;
use std::sync::{Mutex, MutexGuard};

/// What is known of the structures of a device.
#[derive(Debug, Default)]
pub(super) struct Checks(Mutex<HashMap<u64, Known>>);

/// A structure that was created.
#[derive(Debug, Clone)]
struct Known {
    bytes: u64,
    ty: vk::AccelerationStructureTypeKHR,
    built: Option<Built>,
}

/// How it was built last.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Built {
    flags: vk::BuildAccelerationStructureFlagsKHR,
    geometries: Vec<BuildShape>,
}

/// What an update may not change of a geometry.
#[derive(Debug, Clone, PartialEq)]
struct BuildShape {
    ty: vk::GeometryTypeKHR,
    flags: vk::GeometryFlagsKHR,
    count: u32,
    vertex_format: vk::Format,
    index_type: vk::IndexType,
    max_vertex: u32,
    has_transform: bool,
}

/// A build that is about to be recorded.
pub(super) struct CheckedBuild<'a> {
    pub info: &'a vk::AccelerationStructureBuildGeometryInfoKHR<'a>,
    pub geometries: Vec<&'a vk::AccelerationStructureGeometryKHR<'a>>,
    /// The ranges; of an indirect build, the most primitives and no offsets.
    pub ranges: Vec<vk::AccelerationStructureBuildRangeInfoKHR>,
    /// Bytes that the structure and the scratch memory must have.
    pub structure_bytes: u64,
    pub scratch_bytes: u64,
}

fn refuse<T>(what: String) -> Result<T> {
    Err(Error::Argument(what))
}

impl Checks {
    fn known(&self) -> MutexGuard<'_, HashMap<u64, Known>> {
        self.0.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }

    pub fn created(&self, structure: u64, bytes: u64, ty: vk::AccelerationStructureTypeKHR) {
        self.known().insert(structure, Known { bytes, ty, built: None });
    }

    pub fn destroyed(&self, structure: u64) {
        self.known().remove(&structure);
    }

    /// Checks builds against what is known and each other, and takes note of them.
    pub fn builds(&self, asked: &[CheckedBuild<'_>]) -> Result<()> {
        let mut known = self.known();
        let named = |i: usize, error: Error| match error {
            Error::Argument(what) => Error::Argument(format!("pInfos[{i}]: {what}")),
            other => other,
        };
        for (i, build) in asked.iter().enumerate() {
            check(&known, build).map_err(|error| named(i, error))?;
        }
        check_overlaps(&known, asked)?;
        for build in asked {
            if let Some(structure) = known.get_mut(&build.info.dst_acceleration_structure.as_raw()) {
                structure.built = Some(built_as(build));
            }
        }
        Ok(())
    }

    /// Checks a copy, and takes note of it.
    pub fn copies(&self, info: &vk::CopyAccelerationStructureInfoKHR<'_>) -> Result<()> {
        let mut known = self.known();
        let source = find(&known, "src", info.src)?.clone();
        let destination = find(&known, "dst", info.dst)?;
        if source.built.is_none() {
            return refuse(format!("src {:#x} was created and not built; build it first", info.src.as_raw()));
        }
        if info.src == info.dst {
            return refuse("src and dst are the same; a copy needs another place".into());
        }
        if info.mode == vk::CopyAccelerationStructureModeKHR::CLONE && destination.bytes < source.bytes {
            return refuse(format!("dst has {} bytes, src {}; create it as large", destination.bytes, source.bytes));
        }
        if destination.ty != source.ty && destination.ty != vk::AccelerationStructureTypeKHR::GENERIC {
            return refuse(format!("dst is {:?}, src {:?}; create it of the same type", destination.ty, source.ty));
        }
        let built = source.built;
        if let Some(destination) = known.get_mut(&info.dst.as_raw()) {
            destination.built = built;
        }
        Ok(())
    }

    /// Checks that a structure was built, for a call that reads it.
    pub fn reads(&self, field: &str, structure: vk::AccelerationStructureKHR) -> Result<()> {
        match find(&self.known(), field, structure)?.built {
            Some(_) => Ok(()),
            None => refuse(format!("{field} {:#x} was created and not built; build it first", structure.as_raw())),
        }
    }

    /// Takes note of a structure that was written by other means than a build.
    pub fn written(&self, structure: vk::AccelerationStructureKHR) -> Result<()> {
        let mut known = self.known();
        find(&known, "dst", structure)?;
        if let Some(structure) = known.get_mut(&structure.as_raw()) {
            let flags = vk::BuildAccelerationStructureFlagsKHR::empty();
            structure.built = Some(Built { flags, geometries: Vec::new() });
        }
        Ok(())
    }
}

fn find<'a>(known: &'a HashMap<u64, Known>, field: &str, structure: vk::AccelerationStructureKHR) -> Result<&'a Known> {
    known.get(&structure.as_raw()).ok_or_else(|| {
        Error::Argument(format!(
            "{field} {:#x} is not a structure of this device; create it with the same accel::Device, and destroy it later",
            structure.as_raw()
        ))
    })
}

fn check(known: &HashMap<u64, Known>, build: &CheckedBuild<'_>) -> Result<()> {
    let info = build.info;
    let destination = find(known, "dstAccelerationStructure", info.dst_acceleration_structure)?;
    if destination.ty != info.ty && destination.ty != vk::AccelerationStructureTypeKHR::GENERIC {
        return refuse(format!(
            "type is {:?}, and dstAccelerationStructure was created as {:?}; both must be the same",
            info.ty, destination.ty
        ));
    }
    if destination.bytes < build.structure_bytes {
        return refuse(format!(
            "dstAccelerationStructure has {} bytes, the build needs {}; create it as large as \
             get_acceleration_structure_build_sizes says",
            destination.bytes, build.structure_bytes
        ));
    }
    for (i, (geometry, range)) in build.geometries.iter().zip(&build.ranges).enumerate() {
        check_addresses(i, geometry, range)?;
    }
    if info.mode == vk::BuildAccelerationStructureModeKHR::UPDATE {
        check_update(known, build)?;
    }
    Ok(())
}

/// Addresses are multiples of what lies there, and there where something is read.
fn check_addresses(
    i: usize,
    geometry: &vk::AccelerationStructureGeometryKHR<'_>,
    range: &vk::AccelerationStructureBuildRangeInfoKHR,
) -> Result<()> {
    let aligned = |field: &str, address: u64, alignment: u64, offset: (&str, u32)| -> Result<()> {
        if address == 0 && range.primitive_count > 0 {
            return refuse(format!(
                "pGeometries[{i}].{field} is 0, and there are {} primitives; give their address",
                range.primitive_count
            ));
        }
        if !address.is_multiple_of(alignment) {
            return refuse(format!("pGeometries[{i}].{field} is {address:#x}; it must be a multiple of {alignment}"));
        }
        if !u64::from(offset.1).is_multiple_of(alignment) {
            return refuse(format!("ranges[{i}].{} is {}; it must be a multiple of {alignment}", offset.0, offset.1));
        }
        Ok(())
    };
    let primitive_offset = ("primitiveOffset", range.primitive_offset);
    // SAFETY: the type says which of the union's members it is; addresses are read as addresses.
    unsafe {
        match geometry.geometry_type {
            vk::GeometryTypeKHR::TRIANGLES => {
                let triangles = geometry.geometry.triangles;
                let component =
                    crate::bvh::geometry::VertexFormat::try_from(triangles.vertex_format)?.component_bytes().into();
                let index =
                    u64::from(crate::bvh::geometry::IndexFormat::try_from(triangles.index_type)?.bytes()).max(1);
                let is_indexed = triangles.index_type != vk::IndexType::NONE_KHR;
                let none = ("primitiveOffset", 0);
                let offsets = if is_indexed { [none, primitive_offset] } else { [primitive_offset, none] };
                aligned("vertexData", triangles.vertex_data.device_address, component, offsets[0])?;
                if is_indexed {
                    aligned("indexData", triangles.index_data.device_address, index, offsets[1])?;
                }
                if triangles.transform_data.device_address != 0 {
                    let offset = ("transformOffset", range.transform_offset);
                    aligned("transformData", triangles.transform_data.device_address, 16, offset)?;
                }
                Ok(())
            }
            vk::GeometryTypeKHR::AABBS => {
                aligned("aabbs.data", geometry.geometry.aabbs.data.device_address, 8, primitive_offset)
            }
            _ => {
                let instances = geometry.geometry.instances;
                let alignment = if instances.array_of_pointers == vk::TRUE { 8 } else { 16 };
                aligned("instances.data", instances.data.device_address, alignment, primitive_offset)
            }
        }
    }
}

fn check_update(known: &HashMap<u64, Known>, build: &CheckedBuild<'_>) -> Result<()> {
    let source = find(known, "srcAccelerationStructure", build.info.src_acceleration_structure)?;
    let Some(built) = &source.built else {
        return refuse("srcAccelerationStructure was created and not built; an update needs a build before".into());
    };
    if !built.flags.contains(vk::BuildAccelerationStructureFlagsKHR::ALLOW_UPDATE) {
        return refuse("srcAccelerationStructure was built without ALLOW_UPDATE; build it with that flag".into());
    }
    let now = built_as(build);
    if now.flags != built.flags {
        return refuse(format!("flags are {:?} and were {:?}; an update changes none", now.flags, built.flags));
    }
    if now.geometries.len() != built.geometries.len() {
        let (now, before) = (now.geometries.len(), built.geometries.len());
        return refuse(format!("geometryCount is {now} and was {before}; an update cannot change it"));
    }
    for (i, (now, before)) in now.geometries.iter().zip(&built.geometries).enumerate() {
        if now.count != before.count {
            let (now, before) = (now.count, before.count);
            return refuse(format!("ranges[{i}].primitiveCount is {now} and was {before}; an update cannot change it"));
        }
        if now != before {
            return refuse(format!("pGeometries[{i}] is {now:?} and was {before:?}; an update changes data alone"));
        }
    }
    Ok(())
}

/// No memory that one build writes is another's, and none is both structure and scratch.
fn check_overlaps(known: &HashMap<u64, Known>, asked: &[CheckedBuild<'_>]) -> Result<()> {
    let mut all: Vec<(Range<u64>, String)> = Vec::new();
    for (i, build) in asked.iter().enumerate() {
        let structure = build.info.dst_acceleration_structure.as_raw();
        let bytes = known.get(&structure).map_or(0, |k| k.bytes);
        all.push((structure..structure + bytes, format!("pInfos[{i}].dstAccelerationStructure")));
        // SAFETY: device builds give device addresses.
        let scratch = unsafe { build.info.scratch_data.device_address };
        all.push((scratch..scratch + build.scratch_bytes, format!("pInfos[{i}].scratchData")));
        let source = build.info.src_acceleration_structure;
        if build.info.mode == vk::BuildAccelerationStructureModeKHR::UPDATE
            && source != build.info.dst_acceleration_structure
        {
            let bytes = known.get(&source.as_raw()).map_or(0, |k| k.bytes);
            all.push((source.as_raw()..source.as_raw() + bytes, format!("pInfos[{i}].srcAccelerationStructure")));
        }
    }
    all.retain(|(range, _)| !range.is_empty());
    all.sort_by_key(|(range, _)| range.start);
    for pair in all.windows(2) {
        let [(a, a_name), (b, b_name)] = pair else { continue };
        if b.start < a.end {
            return refuse(format!(
                "{a_name} ({:#x}..{:#x}) and {b_name} ({:#x}..{:#x}) overlap; give each memory of its own",
                a.start, a.end, b.start, b.end
            ));
        }
    }
    Ok(())
}

fn built_as(build: &CheckedBuild<'_>) -> Built {
    let shape = |(geometry, range): (
        &&vk::AccelerationStructureGeometryKHR<'_>,
        &vk::AccelerationStructureBuildRangeInfoKHR,
    )| {
        let mut shape = BuildShape {
            ty: geometry.geometry_type,
            flags: geometry.flags,
            count: range.primitive_count,
            vertex_format: vk::Format::UNDEFINED,
            index_type: vk::IndexType::NONE_KHR,
            max_vertex: 0,
            has_transform: false,
        };
        if geometry.geometry_type == vk::GeometryTypeKHR::TRIANGLES {
            // SAFETY: the type says which of the union's members it is; addresses are read as addresses.
            unsafe {
                let triangles = geometry.geometry.triangles;
                shape.vertex_format = triangles.vertex_format;
                shape.index_type = triangles.index_type;
                shape.max_vertex = triangles.max_vertex;
                shape.has_transform = triangles.transform_data.device_address != 0;
            }
        }
        shape
    };
    let geometries = build.geometries.iter().zip(&build.ranges).map(shape).collect();
    Built { flags: build.info.flags, geometries }
}
