//! What an engine on ash writes for hedgerow. docs/engines.md shows it, and tests/engines.rs runs it.

use hedgerow::{accel, ash, ash::vk, gpu};

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// Once: a device with what hedgerow needs, and its queue family. Drop the context before the device.
pub unsafe fn open(instance: &ash::Instance, physical: vk::PhysicalDevice) -> Result<(ash::Device, u32, gpu::Context)> {
    let mut needs = gpu::requirements(instance, physical)?;
    let family = needs.queue_family;
    let pointers: Vec<_> = needs.extensions.iter().map(|name| name.as_ptr()).collect();
    let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&[1.0])];
    let info = vk::DeviceCreateInfo::default().queue_create_infos(&queues).enabled_extension_names(&pointers);
    let device = unsafe { instance.create_device(physical, &needs.features.push_into(info), None) }?;
    let context = unsafe { gpu::Context::new(&gpu::ContextDesc::new(instance, physical, &device, needs.optional)) }?;
    Ok((device, family, context))
}

/// Each frame: a build behind the engine's uploads, and rays. What reads the picture places the barrier behind them.
pub unsafe fn frame(
    context: &gpu::Context,
    commands: vk::CommandBuffer,
    mesh: accel::Placement<'_>,
    trace: impl FnOnce(vk::CommandBuffer) -> Result<()>,
) -> Result<()> {
    let (read, write) = (vk::AccessFlags::SHADER_READ, vk::AccessFlags::TRANSFER_WRITE);
    let uploaded = [vk::MemoryBarrier::default().src_access_mask(write).dst_access_mask(read)];
    let (from, to) = (vk::PipelineStageFlags::TRANSFER, vk::PipelineStageFlags::COMPUTE_SHADER);
    let (device, none) = (context.ash_device(), vk::DependencyFlags::empty());
    unsafe { device.cmd_pipeline_barrier(commands, from, to, none, &uploaded, &[], &[]) };
    unsafe { accel::Device::new(context).record(commands, &[mesh]) }?;
    unsafe { gpu::Recorder::new(context, commands) }.barrier();
    trace(commands)
}
