//! Structures as bytes that can be kept in a file and come back at other addresses, in Vulkan's serialised layout.
//!
//! | part | bytes |
//! | --- | --- |
//! | [`Head`] | 56 |
//! | handles: of a top level, the addresses of the structures below it, one a record, in the order of the records | 8 each |
//! | the structure ([`crate::bvh::layout`]) | [`Head::structure_bytes`] |
//!
//! Before a top level is read back, the caller replaces the handles by the addresses that the structures below it have by then;
//! the handle of an instance that was left out is 0 and stays so. Those structures must be the same to the byte, read back or
//! cloned: an instance also names the node to begin at (`Instance::start`), which compacting moves.

use super::Device;
use super::given::not_null;
use crate::bvh::layout::{self, Header, InstanceRecord};
use crate::gpu::arguments;
use crate::gpu::{Grid, Recorder, shaders};
use crate::{Error, Result};
use ash::vk;
use bytemuck::{Pod, Zeroable};
use std::mem::offset_of;
use std::ops::Range;

/// The writer: this library, on any device. The first half of [`VERSION`].
pub const DRIVER_UUID: [u8; vk::UUID_SIZE] = *b"hedgerow, Vulkan";
/// By which version of the layout. The second half of [`VERSION`].
pub const COMPATIBILITY_UUID: [u8; vk::UUID_SIZE] = {
    let mut uuid = *b"Bvh2 layout ....";
    uuid.split_at_mut(12).1.copy_from_slice(&layout::VERSION.to_le_bytes());
    uuid
};
/// What a serialised structure begins with: `vk::AccelerationStructureVersionInfoKHR::version_data`.
pub const VERSION: [u8; 2 * vk::UUID_SIZE] = {
    let mut both = [0; 2 * vk::UUID_SIZE];
    let (driver, compatibility) = both.split_at_mut(vk::UUID_SIZE);
    driver.copy_from_slice(&DRIVER_UUID);
    compatibility.copy_from_slice(&COMPATIBILITY_UUID);
    both
};

/// What the address of a serialised structure must be a multiple of. (Vulkan demands 256 of the caller, and guarantees no buffer
/// without the driver's own structures in it such an address.)
pub const ALIGNMENT: u64 = 16;

/// What a serialised structure begins with. 56 bytes; the handles follow.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Head {
    /// [`VERSION`], if this version of the library can read it.
    pub version: [u8; 2 * vk::UUID_SIZE],
    /// Bytes in all: [`Property::SerializedSize`](super::Property::SerializedSize).
    pub serialized_bytes: u64,
    /// Bytes of the structure: what `vk::AccelerationStructureCreateInfoKHR::size` must be at least to read it back.
    pub structure_bytes: u64,
    /// Handles that follow.
    pub handle_count: u64,
}

impl Head {
    /// Of a structure with this header.
    pub(super) fn of(header: &Header, sizes: &layout::BvhOffsets) -> Head {
        let handle_count = if layout::has_instances(header.kind) { header.primitive_count.into() } else { 0 };
        Head {
            version: VERSION,
            serialized_bytes: size_of::<Head>() as u64 + 8 * handle_count + sizes.bytes,
            structure_bytes: sizes.bytes,
            handle_count,
        }
    }

    /// Where the handles lie in the structure's own bytes.
    pub(super) fn handles(&self, sizes: &layout::BvhOffsets) -> impl Iterator<Item = Range<usize>> {
        let first = sizes.records_offset as usize + offset_of!(InstanceRecord, structure);
        (0..self.handle_count as usize)
            .map(move |i| first + i * size_of::<InstanceRecord>())
            .map(|at| at..at + size_of::<u64>())
    }
}

impl arguments::Serialize {
    fn of(structure: u64, memory: u64) -> arguments::Serialize {
        arguments::Serialize { structure, memory, version: bytemuck::cast(VERSION) }
    }
}

impl Device<'_> {
    /// `vkCmdCopyAccelerationStructureToMemoryKHR`: serialises a structure into as many bytes as
    /// [`Property::SerializedSize`](super::Property::SerializedSize) gives, in the [layout](self) of Vulkan.
    ///
    /// # Errors
    /// Another mode; the structure is null; the address is not a multiple of [`ALIGNMENT`]. Nothing is recorded then.
    ///
    /// # Safety
    /// `commands` is being recorded, outside a render pass, on a queue with compute. The handle, the address and the memory behind
    /// them stay valid until it has run; the structure is built, and the two do not overlap.
    pub unsafe fn cmd_copy_acceleration_structure_to_memory(
        &self,
        commands: vk::CommandBuffer,
        info: &vk::CopyAccelerationStructureToMemoryInfoKHR<'_>,
    ) -> Result<()> {
        if info.mode != vk::CopyAccelerationStructureModeKHR::SERIALIZE {
            return Err(Error::Argument(format!("mode is {:?}; to memory it must be SERIALIZE", info.mode)));
        }
        // SAFETY: commands on the device take device addresses.
        let memory = aligned("dst", unsafe { info.dst.device_address })?;
        let arguments = arguments::Serialize::of(not_null("src", info.src)?, memory);
        if let Some(checks) = &self.checks {
            checks.reads("src", info.src)?;
        }
        // SAFETY: the caller's promise.
        let mut recorder = unsafe { Recorder::new(self.context, commands) };
        let grid = Grid::of(self.context);
        recorder.phase("serialize");
        let kernel = grid.kernel(&shaders::ACCEL_SERIALIZE_WRITE);
        recorder.dispatch(&kernel, &arguments, grid.groups)
    }

    /// `vkCmdCopyMemoryToAccelerationStructureKHR`: the structure that was serialised, with the handles that stand in the memory
    /// now. What another version wrote becomes an empty structure whose status is
    /// [`WRONG_VERSION`](layout::status::WRONG_VERSION); [`get_device_acceleration_structure_compatibility`] finds that out before.
    ///
    /// [`get_device_acceleration_structure_compatibility`]: Device::get_device_acceleration_structure_compatibility
    ///
    /// # Errors
    /// Another mode; the structure is null; the address is not a multiple of [`ALIGNMENT`]. Nothing is recorded then.
    ///
    /// # Safety
    /// `commands` is being recorded, outside a render pass, on a queue with compute. The handle, the address and the memory behind
    /// them stay valid until it has run; the memory holds as many bytes as its [`Head`] says, the structure has room for
    /// [`Head::structure_bytes`], and the two do not overlap.
    pub unsafe fn cmd_copy_memory_to_acceleration_structure(
        &self,
        commands: vk::CommandBuffer,
        info: &vk::CopyMemoryToAccelerationStructureInfoKHR<'_>,
    ) -> Result<()> {
        if info.mode != vk::CopyAccelerationStructureModeKHR::DESERIALIZE {
            return Err(Error::Argument(format!("mode is {:?}; from memory it must be DESERIALIZE", info.mode)));
        }
        // SAFETY: commands on the device take device addresses.
        let memory = aligned("src", unsafe { info.src.device_address })?;
        let arguments = arguments::Serialize::of(not_null("dst", info.dst)?, memory);
        if let Some(checks) = &self.checks {
            checks.written(info.dst)?;
        }
        // SAFETY: the caller's promise.
        let mut recorder = unsafe { Recorder::new(self.context, commands) };
        let grid = Grid::of(self.context);
        recorder.phase("deserialize");
        recorder.dispatch(&grid.kernel(&shaders::ACCEL_SERIALIZE_READ), &arguments, grid.groups)?;
        recorder.barrier();
        recorder.dispatch(&grid.kernel(&shaders::ACCEL_SERIALIZE_HANDLES), &arguments, grid.groups)
    }

    /// `vkGetDeviceAccelerationStructureCompatibilityKHR`: whether what begins with these bytes can be read back.
    pub fn get_device_acceleration_structure_compatibility(
        &self,
        version: &vk::AccelerationStructureVersionInfoKHR<'_>,
    ) -> vk::AccelerationStructureCompatibilityKHR {
        // SAFETY: null, or a reference to that many bytes: the struct's only setter takes one.
        match unsafe { version.p_version_data.as_ref() } {
            Some(&VERSION) => vk::AccelerationStructureCompatibilityKHR::COMPATIBLE,
            _ => vk::AccelerationStructureCompatibilityKHR::INCOMPATIBLE,
        }
    }
}

/// Memory for a serialised structure.
fn aligned(field: &str, address: u64) -> Result<u64> {
    if address == 0 || !address.is_multiple_of(ALIGNMENT) {
        return Err(Error::Argument(format!(
            "{field}.deviceAddress is {address:#x}; it must be a multiple of {ALIGNMENT} and not zero"
        )));
    }
    Ok(address)
}
