//! Buffers of wgpu's that shaders reach by their addresses, too: made with Vulkan and imported.

use crate::Result;
use hedgerow::ash::vk;
use hedgerow::gpu::Region;
use wgpu::hal::{api::Vulkan, vulkan};

/// A buffer as wgpu and as hedgerow see it.
pub struct Shared {
    pub buffer: wgpu::Buffer,
    pub region: Region,
}

impl Shared {
    /// Memory of the device that wgpu writes by copies and reads in shaders. wgpu frees it with the buffer's last use.
    pub fn new(device: &wgpu::Device, size: u64) -> Result<Shared> {
        // SAFETY: nothing is destroyed through it.
        let hal = unsafe { device.as_hal::<Vulkan>() }.ok_or("the device is not Vulkan's")?;
        let (raw, instance) = (hal.raw_device(), hal.shared_instance().raw_instance());
        let usage = vk::BufferUsageFlags::STORAGE_BUFFER
            | vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS
            | vk::BufferUsageFlags::TRANSFER_DST;
        // SAFETY: the device lives; wgpu owns buffer and memory from `from_raw_managed` on, and nobody else frees them.
        unsafe {
            let buffer = raw.create_buffer(&vk::BufferCreateInfo::default().size(size).usage(usage), None)?;
            let needs = raw.get_buffer_memory_requirements(buffer);
            let types = instance.get_physical_device_memory_properties(hal.raw_physical_device());
            let fits = |&i: &u32| {
                let flags = types.memory_types[i as usize].property_flags;
                needs.memory_type_bits >> i & 1 != 0 && flags.contains(vk::MemoryPropertyFlags::DEVICE_LOCAL)
            };
            let index = (0..types.memory_type_count).find(fits).ok_or("no memory of the device's own for buffers")?;
            let mut by_address = vk::MemoryAllocateFlagsInfo::default().flags(vk::MemoryAllocateFlags::DEVICE_ADDRESS);
            let info = vk::MemoryAllocateInfo::default().allocation_size(needs.size).memory_type_index(index);
            let memory = raw.allocate_memory(&info.push_next(&mut by_address), None)?;
            raw.bind_buffer_memory(buffer, memory, 0)?;
            let address = raw.get_buffer_device_address(&vk::BufferDeviceAddressInfo::default().buffer(buffer));
            let desc = wgpu::BufferDescriptor {
                label: None,
                size,
                usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            };
            let imported = vulkan::Buffer::from_raw_managed(buffer, memory, 0, size);
            let buffer = device.create_buffer_from_hal::<Vulkan>(imported, &desc);
            Ok(Shared { buffer, region: Region { address, bytes: size } })
        }
    }

    /// That shaders only read it next.
    pub fn read(&self) -> wgpu::BufferTransition<&wgpu::Buffer> {
        wgpu::BufferTransition { buffer: &self.buffer, state: wgpu::BufferUses::STORAGE_READ_ONLY }
    }

    /// That shaders write it next.
    pub fn written(&self) -> wgpu::BufferTransition<&wgpu::Buffer> {
        wgpu::BufferTransition { buffer: &self.buffer, state: wgpu::BufferUses::STORAGE_READ_WRITE }
    }
}
