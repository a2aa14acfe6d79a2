//! Memory of the binary's and the tests' own device: buffers with what they are bound to, and the way of data into memory that the
//! host does not map.
//!
//! A GPU's own memory is filled and read through a staging buffer, a chunk at a time. Where the device's memory is the host's
//! (a CPU, most integrated GPUs), it is mapped.

use super::{Device, locked};
use crate::{Error, Result};
use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme};

/// Bytes that are staged at once.
const CHUNK: usize = 16 << 20;

/// A Vulkan buffer and its memory, until [`Device::release`].
pub(super) struct Memory {
    pub raw: vk::Buffer,
    allocation: Allocation,
}

impl Memory {
    /// Where the host sees it, if it does.
    pub fn mapped(&self) -> Option<*mut u8> {
        self.allocation.mapped_ptr().map(|start| start.as_ptr().cast())
    }
}

/// The buffers that data goes through: on the way to the device, and back.
pub(super) const STAGING: [(&str, vk::BufferUsageFlags, MemoryLocation); 2] = [
    ("staging: upload", vk::BufferUsageFlags::TRANSFER_SRC, MemoryLocation::CpuToGpu),
    ("staging: download", vk::BufferUsageFlags::TRANSFER_DST, MemoryLocation::GpuToCpu),
];
const UPLOAD: usize = 0;
const DOWNLOAD: usize = 1;

/// Whether the memory of a device is best mapped: its largest heap is cached by the host. What the host maps but does not cache
/// (a GPU behind a bus) it reads a hundred times as slowly as it copies.
pub(super) fn is_mapped(instance: &ash::Instance, physical_device: vk::PhysicalDevice) -> bool {
    // SAFETY: the handles are live.
    let memory = unsafe { instance.get_physical_device_memory_properties(physical_device) };
    let largest = largest_local_heap(&memory);
    let wanted = vk::MemoryPropertyFlags::DEVICE_LOCAL
        | vk::MemoryPropertyFlags::HOST_VISIBLE
        | vk::MemoryPropertyFlags::HOST_COHERENT
        | vk::MemoryPropertyFlags::HOST_CACHED;
    memory.memory_types_as_slice().iter().any(|memory_type| {
        let heap = memory.memory_heaps[memory_type.heap_index as usize];
        memory_type.property_flags.contains(wanted) && is_local(&heap) && Some(heap.size) == largest
    })
}

/// Bytes of the largest heap that is the device's own.
pub(super) fn largest_local_heap(memory: &vk::PhysicalDeviceMemoryProperties) -> Option<u64> {
    memory.memory_heaps_as_slice().iter().filter(|heap| is_local(heap)).map(|heap| heap.size).max()
}

fn is_local(heap: &vk::MemoryHeap) -> bool {
    heap.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL)
}

impl Device {
    /// A buffer in memory of its own.
    pub(super) fn memory(
        &self,
        name: &str,
        bytes: u64,
        usage: vk::BufferUsageFlags,
        location: MemoryLocation,
    ) -> Result<Memory> {
        let too_little =
            || Error::OutOfMemory { what: name.into(), needed: bytes, available: self.largest_allocation() };
        if bytes > self.found().memory {
            return Err(too_little());
        }
        let info = vk::BufferCreateInfo::default().size(bytes).usage(usage);
        // SAFETY: the device is live; the buffer is destroyed on failure, or by `release`.
        unsafe {
            let raw = self.raw.create_buffer(&info, None).map_err(|_| too_little())?;
            let allocation = locked(&self.allocator).allocate(&AllocationCreateDesc {
                name,
                requirements: self.raw.get_buffer_memory_requirements(raw),
                location,
                linear: true,
                allocation_scheme: AllocationScheme::GpuAllocatorManaged,
            });
            let Ok(allocation) = allocation else {
                self.raw.destroy_buffer(raw, None);
                return Err(too_little());
            };
            if let Err(result) = self.raw.bind_buffer_memory(raw, allocation.memory(), allocation.offset()) {
                self.release(Memory { raw, allocation });
                return Err(Error::vulkan("vkBindBufferMemory")(result));
            }
            Ok(Memory { raw, allocation })
        }
    }

    /// The address that shaders use of a buffer with the usage for it.
    pub(super) fn address_of(&self, memory: &Memory) -> u64 {
        // SAFETY: the buffer is live and has the usage.
        unsafe { self.raw.get_buffer_device_address(&vk::BufferDeviceAddressInfo::default().buffer(memory.raw)) }
    }

    /// Gives it back. No submit uses it.
    pub(super) fn release(&self, memory: Memory) {
        // SAFETY: ours, and every submit waits.
        unsafe { self.raw.destroy_buffer(memory.raw, None) };
        let _ = locked(&self.allocator).free(memory.allocation);
    }

    pub(super) fn release_staging(&self) {
        let staging = std::mem::take(&mut *locked(&self.staging));
        staging.into_iter().flatten().for_each(|memory| self.release(memory));
    }

    /// Copies `data` to the start of a buffer.
    pub(super) fn stage_in(&self, data: &[u8], target: vk::Buffer) -> Result<()> {
        let mut staging = locked(&self.staging);
        let (source, mapped) = self.staged(&mut staging, UPLOAD)?;
        for (i, chunk) in data.chunks(CHUNK).enumerate() {
            // SAFETY: mapped, at least a chunk long, and the copy out of it before has been waited for.
            unsafe { std::ptr::copy_nonoverlapping(chunk.as_ptr(), mapped, chunk.len()) };
            let to = (i * CHUNK) as u64;
            self.copy((source, 0), (target, to), chunk.len() as u64)?;
        }
        Ok(())
    }

    /// Copies what lies at `offset` of a buffer to `data`.
    pub(super) fn stage_out(&self, source: vk::Buffer, offset: u64, data: &mut [u8]) -> Result<()> {
        let mut staging = locked(&self.staging);
        let (target, mapped) = self.staged(&mut staging, DOWNLOAD)?;
        for (i, chunk) in data.chunks_mut(CHUNK).enumerate() {
            let from = offset + (i * CHUNK) as u64;
            self.copy((source, from), (target, 0), chunk.len() as u64)?;
            // SAFETY: mapped, at least a chunk long, and the copy into it has been waited for.
            unsafe { std::ptr::copy_nonoverlapping(mapped.cast_const(), chunk.as_mut_ptr(), chunk.len()) };
        }
        Ok(())
    }

    /// One of [`STAGING`], and where it is mapped.
    fn staged(&self, staging: &mut [Option<Memory>; 2], which: usize) -> Result<(vk::Buffer, *mut u8)> {
        let (name, usage, location) = STAGING[which];
        let memory = match staging[which].take() {
            Some(memory) => memory,
            None => self.memory(name, CHUNK as u64, usage, location)?,
        };
        let memory = staging[which].insert(memory);
        Ok((memory.raw, memory.mapped().expect("gpu-allocator maps what is visible to the host")))
    }

    fn copy(&self, from: (vk::Buffer, u64), to: (vk::Buffer, u64), bytes: u64) -> Result<()> {
        let region = [vk::BufferCopy { src_offset: from.1, dst_offset: to.1, size: bytes }];
        self.submit(|commands| {
            // SAFETY: both buffers are live, and the command buffer is being recorded.
            unsafe { self.raw.cmd_copy_buffer(commands, from.0, to.0, &region) };
            Ok(())
        })
        .map(drop)
    }
}
