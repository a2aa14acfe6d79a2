//! Copies of structures: as they are, or compacted.

use super::Device;
use super::given::not_null;
use crate::bvh::compact;
use crate::gpu::arguments;
use crate::gpu::{Context, Grid, Recorder, Region, Step, shaders};
use crate::{Error, Result};
use ash::vk;

/// The copying of a structure as it is.
pub(super) fn clone_step(context: &Context, source: u64, target: u64) -> Step {
    let grid = Grid::of(context);
    Step::new("clone", grid.kernel(&shaders::ACCEL_COPY), &arguments::CopyStructure { source, target }, grid.groups)
}

impl Device<'_> {
    /// `vkCmdCopyAccelerationStructureKHR`: `CLONE` copies the bytes; `COMPACT` leaves out the node slots and records that the
    /// tree does not use, which takes [`Property::CompactedSize`](super::Property::CompactedSize) bytes.
    ///
    /// No build flag is needed: every structure can be compacted. A top level names the structures below it by address, so
    /// build it again over their copies.
    ///
    /// # Errors
    /// Another mode; a handle is null; the two are the same. Nothing is recorded then.
    ///
    /// # Safety
    /// `commands` is being recorded, outside a render pass, on a queue with compute. Handles and the memory behind them stay
    /// valid until it has run; the source is built, the destination has the bytes that the copy takes, and the two do not overlap.
    pub unsafe fn cmd_copy_acceleration_structure(
        &self,
        commands: vk::CommandBuffer,
        info: &vk::CopyAccelerationStructureInfoKHR<'_>,
    ) -> Result<()> {
        let source = not_null("src", info.src)?;
        let target = not_null("dst", info.dst)?;
        if source == target {
            return Err(Error::Argument(format!("src and dst are both {source:#x}; give the copy memory of its own")));
        }
        if let Some(checks) = &self.checks {
            checks.copies(info)?;
        }
        // SAFETY: the caller's promise.
        let mut recorder = unsafe { Recorder::new(self.context, commands) };
        match info.mode {
            vk::CopyAccelerationStructureModeKHR::CLONE => {
                recorder.chains(&[vec![clone_step(self.context, source, target)]])
            }
            vk::CopyAccelerationStructureModeKHR::COMPACT => {
                compact::record(&mut recorder, source, Region::unbounded(target))
            }
            mode => Err(Error::Argument(format!(
                "mode is {mode:?}; structures are copied by CLONE or COMPACT, and to and from memory by calls of their own"
            ))),
        }
    }
}
