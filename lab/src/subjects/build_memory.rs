//! What builds on the device have in common: a mesh in device memory, and room for a structure and for scratch.

use crate::device::{Buffer, Device};
use crate::measure::record;
use crate::{Error, Result};
use hedgerow::bvh::builder::Input;
use hedgerow::gpu::Sizes;

/// A mesh in device memory.
pub struct DeviceMesh<'a> {
    /// What a builder takes.
    pub input: Input,
    /// The positions of the vertices.
    pub positions: Buffer<'a>,
    _indices: Buffer<'a>,
}

impl<'a> DeviceMesh<'a> {
    /// Uploads it.
    ///
    /// # Errors
    /// Too little memory.
    pub fn new(device: &'a Device, positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Result<DeviceMesh<'a>> {
        let vertex_count = positions.len() as u32;
        let count = u32::try_from(triangles.len()).unwrap_or(u32::MAX);
        let positions = device.upload("positions", positions)?;
        let indices = device.upload("indices", triangles)?;
        let input = Input::mesh(positions.address(), vertex_count, indices.address(), count);
        Ok(DeviceMesh { input, positions, _indices: indices })
    }
}

/// Room for what a builder makes, and for what it needs meanwhile.
pub struct BuildMemory<'a> {
    /// How large it is.
    pub sizes: Sizes,
    /// The structure.
    pub structure: Buffer<'a>,
    /// What the build needs beside it.
    pub scratch: Buffer<'a>,
}

impl<'a> BuildMemory<'a> {
    /// As much as `sizes` says.
    ///
    /// # Errors
    /// Too little memory.
    pub fn new(device: &'a Device, sizes: Sizes) -> Result<BuildMemory<'a>> {
        let structure = device.buffer("structure", sizes.structure)?;
        let scratch = device.buffer("scratch", sizes.scratch)?;
        Ok(BuildMemory { sizes, structure, scratch })
    }

    /// The bytes of the structure.
    pub fn bytes(&self) -> Vec<u8> {
        self.structure.read(self.sizes.structure as usize)
    }

    /// What it takes.
    pub fn record(&self) -> record::MemoryRecord {
        memory_record(self.sizes.structure, self.sizes.scratch)
    }
}

/// Memory that is all there at the peak.
pub fn memory_record(structure: u64, scratch: u64) -> record::MemoryRecord {
    record::MemoryRecord {
        structure_bytes: Some(structure),
        scratch_bytes: Some(scratch),
        peak_bytes: Some(structure + scratch),
    }
}

/// Whether the device has the memory that `builder` needs for this many triangles.
///
/// # Errors
/// [`Error::OutOfMemory`] says how much is needed, and how much there is.
pub fn check_memory(device: &Device, builder: &str, triangles: u32, needed: u64) -> Result<()> {
    let available = device.found().memory;
    if needed > available {
        return Err(Error::OutOfMemory { what: format!("{builder} of {triangles} triangles"), needed, available });
    }
    Ok(())
}
