//! What an engine on wgpu writes for hedgerow. docs/engines.md shows it, and `make test-wgpu` runs it.

use crate::Result;
use hedgerow::{accel, ash::vk, gpu};
use wgpu::hal::{api::Vulkan, vulkan};

/// Once: a device with what wgpu and hedgerow need, which is wgpu's from now on. Drop the context before it.
pub unsafe fn open(adapter: &wgpu::Adapter) -> Result<((wgpu::Device, wgpu::Queue), gpu::Context)> {
    let desc = wgpu::DeviceDescriptor::default();
    let (wanted, limits, hints) = (desc.required_features, &desc.required_limits, &desc.memory_hints);
    let hal = unsafe { adapter.as_hal::<Vulkan>() }.ok_or("wgpu is not on Vulkan here")?;
    let (instance, physical) = (hal.shared_instance().raw_instance(), hal.raw_physical_device());
    let mut needs = gpu::requirements(instance, physical)?;
    let names = [hal.required_device_extensions(wanted), needs.extensions].concat();
    let pointers: Vec<_> = names.iter().map(|name| name.as_ptr()).collect();
    let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(0).queue_priorities(&[1.0])];
    let info = vk::DeviceCreateInfo::default().queue_create_infos(&queues).enabled_extension_names(&pointers);
    let mut features = hal.physical_device_features(&names, wanted);
    let info = unsafe { needs.features.merge_into(features.add_to_device_create(info)) };
    let raw = unsafe { instance.create_device(physical, &info, None) }?;
    let open = unsafe { hal.device_from_raw(raw.clone(), None, &names, wanted, limits, hints, 0, 0) }?;
    let device = unsafe { adapter.create_device_from_hal(open, &desc) }?;
    Ok((device, unsafe { gpu::Context::new(&gpu::ContextDesc::new(instance, physical, &raw, needs.optional)) }?))
}

/// Each frame: a build behind wgpu's uploads, and rays. wgpu knows the `uses` and places the barriers before and behind.
pub unsafe fn frame<'a>(
    context: &gpu::Context,
    [before, encoder]: [&mut wgpu::CommandEncoder; 2],
    uses: impl Iterator<Item = wgpu::BufferTransition<&'a wgpu::Buffer>>,
    mesh: accel::Placement<'_>,
    trace: impl FnOnce(vk::CommandBuffer) -> Result<()>,
) -> Result<()> {
    before.transition_resources(uses, std::iter::empty());
    let record = |hal: Option<&mut vulkan::CommandEncoder>| {
        let commands = unsafe { hal.ok_or("the encoder is broken")?.raw_handle() };
        unsafe { accel::Device::new(context).record(commands, &[mesh]) }?;
        unsafe { gpu::Recorder::new(context, commands) }.barrier();
        trace(commands)
    };
    unsafe { encoder.as_hal_mut::<Vulkan, _, _>(record) }
}
