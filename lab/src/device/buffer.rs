//! Buffers of the binary's and the tests' own device, as everything else sees them.

use super::Device;
use super::memory::Memory;
use ash::vk;
use hedgerow::gpu::Region;

/// A buffer with its memory, which the host fills and reads.
pub struct Buffer<'a> {
    pub(super) device: &'a Device,
    pub(super) memory: Option<Memory>,
    pub(super) address: u64,
    pub(super) bytes: u64,
}

impl Buffer<'_> {
    /// The address that shaders use.
    pub fn address(&self) -> u64 {
        self.address
    }

    /// The Vulkan handle.
    pub fn raw(&self) -> vk::Buffer {
        self.memory().raw
    }

    /// Size in bytes.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// All of it, for what is recorded.
    pub fn region(&self) -> Region {
        Region { address: self.address, bytes: self.bytes }
    }

    /// Copies `data` to the start of the buffer. Nothing on the device may use it meanwhile: every [`Device::run`] waits.
    ///
    /// # Panics
    /// `data` is larger than the buffer; the device is lost, or too little memory is left to stage the data.
    pub fn write<T: bytemuck::NoUninit>(&self, data: &[T]) {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        assert!(bytes.len() as u64 <= self.bytes, "{} bytes into a buffer of {}", bytes.len(), self.bytes);
        match self.mapped() {
            // SAFETY: mapped for the buffer's lifetime, large enough, and no other reference to the mapping exists.
            Some(mapped) => unsafe { std::ptr::copy_nonoverlapping(bytes.as_ptr(), mapped, bytes.len()) },
            None => self.device.stage_in(bytes, self.raw()).unwrap_or_else(|error| panic!("an upload: {error}")),
        }
    }

    /// The first `count` elements of the buffer.
    ///
    /// # Panics
    /// As [`Buffer::read_at`].
    pub fn read<T: bytemuck::AnyBitPattern + bytemuck::NoUninit>(&self, count: usize) -> Vec<T> {
        self.read_at(0, count)
    }

    /// `count` elements from byte `offset` on.
    ///
    /// # Panics
    /// The buffer is smaller than that; the device is lost, or too little memory is left to stage the data.
    pub fn read_at<T: bytemuck::AnyBitPattern + bytemuck::NoUninit>(&self, offset: u64, count: usize) -> Vec<T> {
        let bytes = count * size_of::<T>();
        assert!(offset + bytes as u64 <= self.bytes, "{bytes} bytes at {offset} of a buffer of {}", self.bytes);
        let mut data = vec![T::zeroed(); count];
        let target: &mut [u8] = bytemuck::cast_slice_mut(&mut data);
        match self.mapped() {
            // SAFETY: mapped, large enough, and every submit that writes it has been waited for.
            Some(mapped) => unsafe {
                std::ptr::copy_nonoverlapping(mapped.add(offset as usize).cast_const(), target.as_mut_ptr(), bytes);
            },
            None => {
                let read = self.device.stage_out(self.raw(), offset, target);
                read.unwrap_or_else(|error| panic!("a download: {error}"));
            }
        }
        data
    }

    fn memory(&self) -> &Memory {
        self.memory.as_ref().expect("held until the drop")
    }

    /// Where the host sees it, unless its data must be staged.
    fn mapped(&self) -> Option<*mut u8> {
        self.memory().mapped().filter(|_| self.device.maps_memory())
    }
}

impl Drop for Buffer<'_> {
    fn drop(&mut self) {
        if let Some(memory) = self.memory.take() {
            self.device.release(memory);
        }
    }
}
