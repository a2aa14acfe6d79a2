//! Recording: phases, dispatches and barriers into the caller's command buffer, with labels and timestamps.

use super::shaders::Block;
use super::{ArgumentTable, Context, Kernel};
use crate::{Error, Result};
use ash::vk;
use std::ffi::CString;
use std::time::Duration;

/// One phase of a build and how long it took on the device.
#[derive(Debug, Clone, PartialEq)]
pub struct Phase {
    /// What was done.
    pub name: &'static str,
    /// Milliseconds by the device's timestamps.
    pub milliseconds: f64,
}

/// A query pool that a [`Recorder`] writes a timestamp into at each phase.
///
/// Where the queue family has no timestamps ([`super::Limits::timestamp_bits`] is 0), none are written and there are no phases.
pub struct Timestamps {
    device: ash::Device,
    pool: vk::QueryPool,
    capacity: u32,
    period: f32,
    valid_bits: u32,
    names: Vec<&'static str>,
    /// Whether each dispatch of a pass is a phase, by the name of its shader.
    by_kernel: bool,
    /// What the whole took by the host's clock.
    waited: Option<Duration>,
}

impl Timestamps {
    /// The last phase where there was no room for one more: all that was recorded from it on.
    pub const REST: &'static str = "rest";

    /// Room for `phases` phases, in command buffers of the queue family that [`super::requirements`] chooses. Of more, the last one is
    /// all that is left, named [`Timestamps::REST`].
    ///
    /// # Errors
    /// The query pool could not be made.
    pub fn new(context: &Context, phases: u32) -> Result<Timestamps> {
        Timestamps::with_valid_bits(context, phases, context.limits.timestamp_bits)
    }

    /// The same in command buffers of another queue family, whose `VkQueueFamilyProperties::timestampValidBits` these are.
    ///
    /// # Errors
    /// The query pool could not be made.
    pub fn with_valid_bits(context: &Context, phases: u32, valid_bits: u32) -> Result<Timestamps> {
        let capacity = phases + 1;
        let info = vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(capacity);
        let device = context.ash_device().clone();
        // SAFETY: the context's device is live.
        let pool = unsafe { device.create_query_pool(&info, None) }.map_err(Error::vulkan("vkCreateQueryPool"))?;
        Ok(Timestamps {
            device,
            pool,
            capacity,
            period: context.limits.timestamp_period,
            valid_bits,
            names: Vec::new(),
            by_kernel: false,
            waited: None,
        })
    }

    /// The same with a phase for each dispatch of a pass, named after its shader.
    pub fn by_kernel(mut self) -> Timestamps {
        self.by_kernel = true;
        self
    }

    /// The phases of the last recording, read back; none without timestamps. Call after the command buffer has finished.
    ///
    /// Without timestamps there is one phase, `submit`, if [`Timestamps::waited`] was given how long it took.
    ///
    /// # Errors
    /// The timestamps could not be read.
    pub fn phases(&self) -> Result<Vec<Phase>> {
        if self.names.is_empty() || self.valid_bits == 0 {
            return Ok(self.submit().into_iter().collect());
        }
        let mut ticks = vec![0u64; self.names.len() + 1];
        // SAFETY: the pool is ours, and holds one timestamp a phase and one at the end.
        unsafe {
            self.device.get_query_pool_results(
                self.pool,
                0,
                &mut ticks,
                vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT,
            )
        }
        .map_err(Error::vulkan("vkGetQueryPoolResults"))?;
        let phase = |(i, &name): (usize, &&'static str)| Phase {
            name,
            milliseconds: ticks_between(ticks[i], ticks[i + 1], self.valid_bits) as f64 * f64::from(self.period) * 1e-6,
        };
        Ok(self.names.iter().enumerate().map(phase).collect())
    }

    /// How long the last recording took from its submit to its end by the host's clock, which stands in where there are no
    /// timestamps.
    pub fn waited(&mut self, time: Duration) {
        self.waited = Some(time);
    }

    /// All of what was recorded as one phase.
    fn submit(&self) -> Option<Phase> {
        let waited = self.waited.filter(|_| !self.names.is_empty())?;
        Some(Phase { name: "submit", milliseconds: waited.as_secs_f64() * 1e3 })
    }
}

/// Ticks from one timestamp to a later one, of a counter of this many bits that wraps around. What the bits
/// above it hold is undefined.
fn ticks_between(from: u64, to: u64, valid_bits: u32) -> u64 {
    to.wrapping_sub(from) & (u64::MAX >> (64 - valid_bits.clamp(1, 64)))
}

impl Drop for Timestamps {
    fn drop(&mut self) {
        // SAFETY: ours; the caller has waited for the command buffers that write it.
        unsafe { self.device.destroy_query_pool(self.pool, None) };
    }
}

/// Chains whose kernels are looked at before any is recorded.
const FEW_CHAINS: usize = 8;

/// A dispatch that is ready to be recorded: what a build does between two barriers.
#[derive(Debug, Clone)]
pub struct Step {
    pub(super) phase: &'static str,
    pub(super) kernel: Kernel,
    pub(super) arguments: Vec<u8>,
    pub(super) groups: u32,
}

impl Step {
    /// `groups` workgroups of `kernel` with what it takes of `arguments`, in the phase `phase`.
    pub fn new<B: Block>(phase: &'static str, kernel: Kernel, arguments: &B, groups: u32) -> Step {
        let arguments = kernel.takes().of(arguments);
        Step { phase, kernel, arguments, groups }
    }

    /// In its place nothing, while other chains are in the phase `phase`.
    pub(crate) fn idle(self, phase: &'static str) -> Step {
        Step { phase, groups: 0, ..self }
    }
}

/// Records passes into a command buffer that is the caller's, and being recorded.
///
/// Clobbers the bound compute pipeline and the compute push constants, nothing else.
/// Ends the last phase when dropped.
///
/// [`Recorder::warming`] records nothing, and makes the pipelines of what would be recorded.
pub struct Recorder<'a> {
    context: &'a Context,
    /// Null where it only makes pipelines.
    commands: vk::CommandBuffer,
    timestamps: Option<&'a mut Timestamps>,
    in_phase: bool,
}

impl<'a> Recorder<'a> {
    /// Records into `commands`.
    ///
    /// # Safety
    /// `commands` is in the recording state, outside a render pass, from a compute queue family of the context's device,
    /// and nobody else records into it meanwhile. Device addresses given to the passes stay valid until it has run.
    pub unsafe fn new(context: &'a Context, commands: vk::CommandBuffer) -> Recorder<'a> {
        Recorder { context, commands, timestamps: None, in_phase: false }
    }

    /// A recorder without a command buffer. It makes the pipelines of what it is given, and records nothing. Recording the same
    /// later, for the same number of primitives, makes no pipeline any more. Addresses are not read:
    /// `Region::unbounded(0)` will do.
    ///
    /// ```no_run
    /// # use hedgerow::bvh::builder::{Builder, Input};
    /// # use hedgerow::gpu::{Context, Recorder, Region};
    /// # fn example(context: &Context, builder: &Builder, triangles: &Input) -> hedgerow::Result<()> {
    /// let nowhere = Region::unbounded(0);
    /// builder.record(&mut Recorder::warming(context), triangles, nowhere, nowhere)
    /// # }
    /// ```
    pub fn warming(context: &'a Context) -> Recorder<'a> {
        Recorder { context, commands: vk::CommandBuffer::null(), timestamps: None, in_phase: false }
    }

    /// The device, if there is something to record into.
    fn device(&self) -> Option<&'a ash::Device> {
        (self.commands != vk::CommandBuffer::null()).then_some(self.context.ash_device())
    }

    /// Writes a timestamp at every phase into `timestamps`, which it resets.
    pub fn timed(mut self, timestamps: &'a mut Timestamps) -> Recorder<'a> {
        timestamps.names.clear();
        if let Some(device) = self.device().filter(|_| timestamps.valid_bits > 0) {
            // SAFETY: `new`'s promise; the pool is ours.
            unsafe { device.cmd_reset_query_pool(self.commands, timestamps.pool, 0, timestamps.capacity) };
        }
        self.timestamps = Some(timestamps);
        self
    }

    /// The context whose kernels are recorded.
    pub fn context(&self) -> &'a Context {
        self.context
    }

    /// The command buffer being recorded; null if there is none ([`Recorder::warming`]).
    pub fn commands(&self) -> vk::CommandBuffer {
        self.commands
    }

    /// Ends the phase before and begins the phase `name`: a debug label and a timestamp.
    pub fn phase(&mut self, name: &'static str) {
        self.end_label();
        if let Some(debug) = self.debug_utils() {
            let label = CString::new(name).expect("phase names hold no zero byte");
            // SAFETY: `new`'s promise.
            unsafe {
                debug.cmd_begin_debug_utils_label(self.commands, &vk::DebugUtilsLabelEXT::default().label_name(&label));
            }
        }
        self.in_phase = true;
        let Some(timestamps) = &mut self.timestamps else { return };
        let at = timestamps.names.len() as u32;
        if at + 1 < timestamps.capacity {
            timestamps.names.push(name);
            self.stamp(at);
        } else if let Some(last) = timestamps.names.last_mut() {
            *last = Timestamps::REST;
        }
    }

    /// Dispatches `groups` workgroups of `kernel` with what it takes of `arguments`.
    ///
    /// # Errors
    /// The kernel's pipeline could not be made.
    pub fn dispatch<B: Block>(&mut self, kernel: &Kernel, arguments: &B, groups: u32) -> Result<()> {
        self.dispatch_bytes(kernel, &kernel.takes().of(arguments), groups)
    }

    /// Records chains of steps side by side: the first steps of all of them, a barrier, the second steps, … with no barrier
    /// behind the last. Chains must not touch each other's memory.
    ///
    /// # Errors
    /// A kernel's pipeline could not be made.
    pub fn chains(&mut self, chains: &[Vec<Step>]) -> Result<()> {
        // Many chains have the kernels of a few; what the others have more is made when it is met.
        let few = chains.iter().take(FEW_CHAINS).flatten();
        self.context.make(few.filter(|step| step.groups > 0).map(|step| &step.kernel))?;
        let longest = chains.iter().max_by_key(|chain| chain.len()).map_or(&[][..], Vec::as_slice);
        let by_kernel = self.timestamps.as_ref().is_some_and(|timestamps| timestamps.by_kernel);
        let name = |step: &Step| if by_kernel { step.kernel.name() } else { step.phase };
        for (at, named) in longest.iter().enumerate() {
            if at > 0 {
                self.barrier();
            }
            // Shorter chains may be ahead: the longest names the phase.
            if at == 0 || name(&longest[at - 1]) != name(named) {
                self.phase(name(named));
            }
            for step in chains.iter().filter_map(|chain| chain.get(at)) {
                self.dispatch_bytes(&step.kernel, &step.arguments, step.groups)?;
            }
        }
        Ok(())
    }

    /// Makes the pipelines that [`ArgumentTable::share_dispatches`] has in place of those of these steps.
    ///
    /// # Errors
    /// A pipeline could not be made.
    pub(crate) fn warm_by_table<'s>(&self, steps: impl Iterator<Item = &'s Step>) -> Result<()> {
        self.context.warm(&steps.filter_map(|step| step.kernel.by_table()).collect::<Vec<_>>())
    }

    /// More workgroups than the device takes along x are rows of as many as it takes, and behind them what is left:
    /// `group_number()` in glsl/gpu/pass.glsl numbers them through.
    fn dispatch_bytes(&mut self, kernel: &Kernel, arguments: &[u8], groups: u32) -> Result<()> {
        let row = self.context.limits.workgroup_count;
        let (rows, rest) = (groups / row, groups % row);
        if groups > row && !kernel.takes_rows() {
            return Err(Error::Argument(format!(
                "{groups} workgroups of {kernel:?}, which takes one row of at most {row} on this device; give less at a time"
            )));
        }
        if rows > 0
            && let Some(device) = self.bind(kernel, arguments)?
        {
            // SAFETY: `new`'s promise; the pipeline is live.
            unsafe { device.cmd_dispatch(self.commands, row, rows, 1) };
        }
        let behind = if rows > 0 { kernel.behind_rows() } else { kernel.clone() };
        if rest > 0
            && let Some(device) = self.bind(&behind, arguments)?
        {
            // SAFETY: the same; where rows are before, the pipeline was made for it.
            unsafe { device.cmd_dispatch_base(self.commands, 0, rows, 0, rest, 1, 1) };
        }
        Ok(())
    }

    /// Makes the pipeline if needed, and binds it and its arguments. Returns the device if there is a command buffer.
    fn bind(&mut self, kernel: &Kernel, arguments: &[u8]) -> Result<Option<&'a ash::Device>> {
        let pipeline = self.context.pipeline(kernel)?;
        let Some(device) = self.device() else { return Ok(None) };
        // SAFETY: `new`'s promise; the pipeline is live and the arguments fit the layout's 128 bytes.
        unsafe {
            device.cmd_bind_pipeline(self.commands, vk::PipelineBindPoint::COMPUTE, pipeline);
            let layout = self.context.layout();
            device.cmd_push_constants(self.commands, layout, vk::ShaderStageFlags::COMPUTE, 0, arguments);
        }
        Ok(Some(device))
    }

    /// Writes a table of arguments, which dispatches after it read. Dispatches before it have read what lay there.
    pub fn write_table(&mut self, table: &ArgumentTable) {
        let Some(device) = self.device() else { return };
        let (shaders, transfer) = (vk::PipelineStageFlags::COMPUTE_SHADER, vk::PipelineStageFlags::TRANSFER);
        let none = vk::DependencyFlags::empty();
        let written = vk::MemoryBarrier::default()
            .src_access_mask(vk::AccessFlags::TRANSFER_WRITE)
            .dst_access_mask(vk::AccessFlags::SHADER_READ | vk::AccessFlags::SHADER_WRITE);
        let (buffer, writes) = table.writes();
        // SAFETY: `new`'s promise; the table's is that the buffer has its bytes.
        unsafe {
            device.cmd_pipeline_barrier(self.commands, shaders, transfer, none, &[], &[], &[]);
            for (at, bytes) in writes {
                device.cmd_update_buffer(self.commands, buffer, at, bytes);
            }
            device.cmd_pipeline_barrier(self.commands, transfer, shaders, none, &[written], &[], &[]);
        }
    }

    /// Makes what dispatches before have written visible to dispatches after.
    pub fn barrier(&mut self) {
        let Some(device) = self.device() else { return };
        let barrier = vk::MemoryBarrier::default()
            .src_access_mask(vk::AccessFlags::SHADER_WRITE)
            .dst_access_mask(vk::AccessFlags::SHADER_READ | vk::AccessFlags::SHADER_WRITE);
        let stage = vk::PipelineStageFlags::COMPUTE_SHADER;
        // SAFETY: `new`'s promise.
        unsafe {
            device.cmd_pipeline_barrier(
                self.commands,
                stage,
                stage,
                vk::DependencyFlags::empty(),
                &[barrier],
                &[],
                &[],
            );
        }
    }

    fn stamp(&mut self, at: u32) {
        if let Some(device) = self.device()
            && let Some(timestamps) = self.timestamps.as_ref().filter(|timestamps| timestamps.valid_bits > 0)
        {
            // SAFETY: `new`'s promise; the query was reset by `timed` and is written once.
            unsafe {
                device.cmd_write_timestamp(self.commands, vk::PipelineStageFlags::BOTTOM_OF_PIPE, timestamps.pool, at);
            }
        }
    }

    /// What labels phases, if there is something to record into.
    fn debug_utils(&self) -> Option<&'a ash::ext::debug_utils::Device> {
        self.device().and(self.context.debug_utils())
    }

    fn end_label(&mut self) {
        if self.in_phase
            && let Some(debug) = self.debug_utils()
        {
            // SAFETY: `new`'s promise; a label is open.
            unsafe { debug.cmd_end_debug_utils_label(self.commands) };
        }
    }
}

impl Drop for Recorder<'_> {
    fn drop(&mut self) {
        self.end_label();
        if self.in_phase {
            let at = self.timestamps.as_ref().map_or(0, |t| t.names.len() as u32);
            self.stamp(at);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_counted_over_the_counters_end_and_without_what_lies_above_it() {
        assert_eq!(ticks_between(5, 9, 64), 4);
        assert_eq!(ticks_between(u64::MAX, 3, 64), 4);
        assert_eq!(ticks_between((1 << 36) - 2, 5, 36), 7, "the counter began again");
        assert_eq!(ticks_between(0xabc0_0000_0000_0010, 0x1230_0000_0000_0017, 36), 7, "garbage above 36 bits");
    }
}
