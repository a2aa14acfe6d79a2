//! Memory of the binary's and the tests' own device.

use super::{Device, Region};
use ash::vk;
use gpu_allocator::vulkan::Allocation;

/// A buffer with its memory, mapped.
pub struct Buffer<'a> {
    pub(super) device: &'a Device,
    pub(super) raw: vk::Buffer,
    pub(super) allocation: Option<Allocation>,
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
        self.raw
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
    /// `data` is larger than the buffer.
    pub fn write<T: bytemuck::NoUninit>(&self, data: &[T]) {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        assert!(bytes.len() as u64 <= self.bytes, "{} bytes into a buffer of {}", bytes.len(), self.bytes);
        // SAFETY: mapped for the buffer's lifetime, large enough, and no other reference to the mapping exists.
        unsafe { std::ptr::copy_nonoverlapping(bytes.as_ptr(), self.mapped(), bytes.len()) };
    }

    /// The first `count` elements of the buffer.
    ///
    /// # Panics
    /// The buffer is smaller than that.
    pub fn read<T: bytemuck::AnyBitPattern + bytemuck::NoUninit>(&self, count: usize) -> Vec<T> {
        self.read_at(0, count)
    }

    /// `count` elements from byte `offset` on.
    ///
    /// # Panics
    /// The buffer is smaller than that.
    pub fn read_at<T: bytemuck::AnyBitPattern + bytemuck::NoUninit>(&self, offset: u64, count: usize) -> Vec<T> {
        let bytes = count * size_of::<T>();
        assert!(offset + bytes as u64 <= self.bytes, "{bytes} bytes at {offset} of a buffer of {}", self.bytes);
        let mut data = vec![T::zeroed(); count];
        let target: &mut [u8] = bytemuck::cast_slice_mut(&mut data);
        // SAFETY: mapped, large enough, and every submit that writes it has been waited for.
        unsafe {
            std::ptr::copy_nonoverlapping(self.mapped().add(offset as usize).cast_const(), target.as_mut_ptr(), bytes);
        }
        data
    }

    fn mapped(&self) -> *mut u8 {
        let allocation = self.allocation.as_ref().expect("held until the drop");
        allocation.mapped_ptr().expect("host-visible memory is mapped").as_ptr().cast()
    }
}

impl Drop for Buffer<'_> {
    fn drop(&mut self) {
        // SAFETY: ours, and no submit that uses it is running.
        unsafe { self.device.raw.destroy_buffer(self.raw, None) };
        if let Some(allocation) = self.allocation.take() {
            let _ = self.device.lock_allocator().free(allocation);
        }
    }
}
