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
    /// Workgroups that a shared dispatch may have along x.
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
        Ok(ArgumentTable { memory, address, bytes: Vec::new(), groups_at_most: context.limits.workgroup_count })
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
        let longest = chains.iter().map(Vec::len).max().unwrap_or(0);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::shaders;

    /// What one workgroup does of a build, or what several do; arguments of so many bytes, each this number.
    fn step(shader: &'static shaders::Shader, number: u8, groups: u32) -> Step {
        Step { phase: "", kernel: Kernel::new(shader, 64, &[]), arguments: vec![number; 20], groups }
    }

    fn table(bytes: u64, groups_at_most: u32) -> ArgumentTable {
        let memory = ArgumentMemory { buffer: vk::Buffer::null(), offset: 0, bytes };
        ArgumentTable { memory, address: 0x1000, bytes: Vec::new(), groups_at_most }
    }

    #[test]
    fn steps_of_one_workgroup_and_kernel_are_one_dispatch_with_a_row_each() {
        let alone = &shaders::BVH_COLLAPSE_ALONE;
        let mut chains: Vec<Vec<Step>> = (1..=5).map(|i| vec![step(alone, i, 1), step(alone, 10 + i, 2)]).collect();
        // Not of the same kernel, and by itself; and of a shader that has no form for it.
        chains.push(vec![step(&shaders::BVH_WIDE_ALONE, 6, 1)]);
        chains.push(vec![step(&shaders::BVH_COLLAPSE_ABOVE, 7, 1)]);
        let before = chains.clone();
        let mut table = table(1 << 10, 2);
        table.share_dispatches(&mut chains).expect("room");
        let groups: Vec<Vec<u32>> = chains.iter().map(|steps| steps.iter().map(|step| step.groups).collect()).collect();
        assert_eq!(groups, [vec![2, 2], vec![0, 2], vec![2, 2], vec![0, 2], vec![1, 2], vec![1], vec![1]]);
        // The rows of two dispatches, aligned.
        let row = |number: u8| [vec![number; 20], vec![0; 12]].concat();
        assert_eq!(table.bytes, [row(1), row(2), row(3), row(4)].concat());
        for (chain, address) in [(0, 0x1000u64), (2, 0x1040)] {
            assert_eq!(Some(&chains[chain][0].kernel), before[chain][0].kernel.by_table().as_ref());
            assert_eq!(chains[chain][0].arguments, address.to_le_bytes());
        }
        for chain in [4, 5, 6] {
            assert_eq!(
                (&chains[chain][0].kernel, &chains[chain][0].arguments),
                (&before[chain][0].kernel, &before[chain][0].arguments)
            );
        }
    }

    #[test]
    fn rows_that_do_not_fit_are_refused() {
        let mut chains: Vec<Vec<Step>> = (1..=3).map(|i| vec![step(&shaders::BVH_COLLAPSE_ALONE, i, 1)]).collect();
        let error = table(95, 8).share_dispatches(&mut chains).expect_err("96 bytes are needed").to_string();
        assert!(error.contains("memory for arguments of 95 bytes, at least 96 are needed"), "{error}");
    }
}
