//! Arguments of many dispatches in one table: memory of the caller's in place of push constants.

use super::{Context, Kernel, Step};
use crate::{Error, Result};
use ash::vk;
use bytemuck::Pod;

/// Where a table of arguments may lie: a part of a buffer with `TRANSFER_DST`, `STORAGE_BUFFER` and `SHADER_DEVICE_ADDRESS` usage.
///
/// It is like scratch memory: written and read while the command buffer runs, and nobody else's meanwhile. The arguments themselves are
/// in the command buffer (`vkCmdUpdateBuffer`), which may be submitted again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ArgumentMemory {
    /// The buffer.
    pub buffer: vk::Buffer,
    /// Where in the buffer it begins. The address there is a multiple of 16.
    pub offset: u64,
    /// Length in bytes.
    pub bytes: u64,
}

/// Arguments that dispatches read from memory, gathered while these are planned. [`Recorder::write_table`](super::Recorder::write_table)
/// writes them before.
#[derive(Debug)]
pub struct ArgumentTable {
    memory: ArgumentMemory,
    address: u64,
    bytes: Vec<u8>,
    /// Workgroups that a shared dispatch may have along x; 0 where there is none.
    groups_at_most: u32,
}

impl ArgumentTable {
    /// Parts of a table begin at multiples of this.
    pub(crate) const ALIGNMENT: u64 = 16;

    /// Bytes of the arguments of a step in a table, at most: what push constants hold.
    pub(crate) const ROW_BYTES: u64 = super::requirements::PUSH_CONSTANT_BYTES as u64;

    /// An empty table in this memory.
    ///
    /// # Errors
    /// The memory begins at an address that is not a multiple of 16.
    ///
    /// # Safety
    /// The buffer is live, of the context's device, and has the usage and as many bytes as [`ArgumentMemory`] says.
    pub unsafe fn new(context: &Context, memory: ArgumentMemory) -> Result<ArgumentTable> {
        let info = vk::BufferDeviceAddressInfo::default().buffer(memory.buffer);
        // SAFETY: the caller's promise.
        let address = unsafe { context.ash_device().get_buffer_device_address(&info) } + memory.offset;
        if !address.is_multiple_of(Self::ALIGNMENT) {
            return Err(Error::Argument(format!(
                "memory for arguments at {address:#x}; its address is a multiple of {}",
                Self::ALIGNMENT
            )));
        }
        let shares = !context.workarounds.no_shared_dispatches;
        let groups_at_most = if shares { context.limits.workgroup_count } else { 0 };
        Ok(ArgumentTable { memory, address, bytes: Vec::new(), groups_at_most })
    }

    /// Puts `records` behind what is there. Returns the address where they will lie.
    ///
    /// # Errors
    /// The memory is too small.
    pub(crate) fn put<T: Pod>(&mut self, records: &[T]) -> Result<u64> {
        self.put_rows(&[bytemuck::cast_slice(records)])
    }

    /// Has what steps of these chains do by one workgroup, side by side and by one kernel, be one dispatch, where the kernel can take its
    /// arguments from a table: a row each.
    ///
    /// # Errors
    /// The memory is too small.
    pub(crate) fn share_dispatches(&mut self, chains: &mut [Vec<Step>]) -> Result<()> {
        let longest = chains.iter().map(Vec::len).max().filter(|_| self.groups_at_most > 0).unwrap_or(0);
        for at in 0..longest {
            let mut same: Vec<(Kernel, Vec<usize>)> = Vec::new();
            for (chain, steps) in chains.iter().enumerate() {
                let of_one_group = steps.get(at).filter(|step| step.groups == 1);
                let Some(kernel) = of_one_group.and_then(|step| step.kernel.by_table()) else { continue };
                match same.iter_mut().find(|(known, _)| *known == kernel) {
                    Some((_, of)) => of.push(chain),
                    None => same.push((kernel, vec![chain])),
                }
            }
            for (kernel, of) in same {
                for shared in of.chunks(self.groups_at_most as usize).filter(|shared| shared.len() > 1) {
                    let rows: Vec<&[u8]> = shared.iter().map(|&chain| &chains[chain][at].arguments[..]).collect();
                    let arguments = self.put_rows(&rows)?.to_le_bytes().to_vec();
                    // The first does it for all.
                    shared.iter().for_each(|&chain| chains[chain][at].groups = 0);
                    let first = &mut chains[shared[0]][at];
                    *first = Step { kernel: kernel.clone(), arguments, groups: shared.len() as u32, ..first.clone() };
                }
            }
        }
        Ok(())
    }

    /// Puts these rows behind what is there, each from a multiple of [`ArgumentTable::ALIGNMENT`] on. Returns the address of the first.
    ///
    /// # Errors
    /// The memory is too small.
    fn put_rows(&mut self, rows: &[&[u8]]) -> Result<u64> {
        let at = self.bytes.len();
        for row in rows {
            self.bytes.extend_from_slice(row);
            self.bytes.resize(self.bytes.len().next_multiple_of(Self::ALIGNMENT as usize), 0);
        }
        let needs = self.bytes.len() as u64;
        if needs > self.memory.bytes {
            return Err(Error::Argument(format!(
                "memory for arguments of {} bytes, at least {needs} are needed; give more",
                self.memory.bytes
            )));
        }
        Ok(self.address + at as u64)
    }

    /// The buffer, and for each write where it begins and what it writes.
    pub(super) fn writes(&self) -> (vk::Buffer, impl Iterator<Item = (u64, &[u8])>) {
        /// The most that `vkCmdUpdateBuffer` takes.
        const AT_ONCE: usize = 65_536;
        let begin = move |i: usize| self.memory.offset + (i * AT_ONCE) as u64;
        (self.memory.buffer, self.bytes.chunks(AT_ONCE).enumerate().map(move |(i, bytes)| (begin(i), bytes)))
    }
}
