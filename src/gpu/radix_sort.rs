//! Stable radix sort of 32- or 64-bit keys with a 32-bit payload, doing only the passes that the keys' bits need.
//!
//! Reduce, then scan (Satish, Harris, Garland 2009): each pass counts digits, scans the counts, scatters. It asks for no
//! progress between workgroups, so it runs on any device. `glsl/gpu/radix_sort.glsl` is the device's side.
use super::arguments;
use super::{Context, Kernel, Limits, Recorder, Step, shaders};
use crate::Result;

/// How the sort is cut for a device: what the pipelines are specialised with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SortShape {
    /// Invocations a workgroup.
    pub workgroup: u32,
    /// Bits a pass sorts by.
    pub digit_bits: u32,
    /// Each invocation counts a strip of its own (CPUs), instead of a workgroup a tile (GPUs).
    pub private_counters: bool,
    /// Subgroups of a workgroup that has tiles.
    subgroups: u32,
    /// Keys of a lane in a tile.
    rows: u32,
    /// Strips at most, until they would be over 4,096 keys; at least half as many. 0 of tiles.
    strips: u32,
}

/// Strips of a sort on any machine: those of one with many cores.
const MOST_STRIPS: u32 = 256;

/// Digits whose counts of a tile are scanned together: `SCANNED_TOGETHER` in radix_sort.glsl.
const SCANNED_TOGETHER: u32 = 8;

impl SortShape {
    /// What suits the device: strips on a CPU, tiles on a GPU.
    pub fn of(context: &Context) -> SortShape {
        context.tuning.sort
    }

    /// A strip of keys for each invocation, which counts alone: for CPUs, where an invocation is a lane of a loop.
    ///
    /// Long strips make the table small, short ones keep all cores busy: each core has at least one workgroup of eight strips, and at
    /// most two, as far as cores are known and strips have at most 4,096 keys.
    pub fn strips(limits: &Limits) -> SortShape {
        /// A lane's counters take 1 KiB of shared memory.
        const MOST: u32 = 8;
        let shape = SortShape::strips_of(limits.subgroup_size.min(MOST));
        let enough = limits.cores.map_or(MOST_STRIPS, |cores| cores.min(MOST_STRIPS).next_power_of_two() * 2 * MOST);
        SortShape { strips: enough.min(MOST_STRIPS), ..shape }
    }

    /// The same with workgroups of this many invocations.
    pub(crate) fn strips_of(workgroup: u32) -> SortShape {
        SortShape { workgroup, digit_bits: 8, private_counters: true, subgroups: 0, rows: 0, strips: MOST_STRIPS }
    }

    /// The same for GPUs whose subgroups may be smaller than they report: small digits, so that a workgroup has many strips.
    pub fn many_strips(limits: &Limits) -> SortShape {
        let workgroup = limits.workgroup_invocations.min(64);
        SortShape { digit_bits: 4, ..SortShape::strips_of(workgroup) }
    }

    /// A tile of keys for each workgroup, ranked by ballots: for GPUs whose subgroups have the size that they report.
    ///
    /// A subgroup's counters take 1 KiB of shared memory; the keys of a tile, a word of each, lie there afterwards. Of what a
    /// small device has, half is left to others.
    pub fn tiles(limits: &Limits) -> SortShape {
        const SMALL: u32 = 32 << 10;
        let (most_subgroups, rows) = if limits.shared_memory < SMALL { (4, 8) } else { (8, 16) };
        let most_lanes = limits.workgroup_invocations.min(256);
        let subgroups = (most_lanes / limits.subgroup_size).clamp(1, most_subgroups);
        SortShape {
            workgroup: subgroups * limits.subgroup_size,
            digit_bits: 8,
            private_counters: false,
            subgroups,
            rows,
            strips: 0,
        }
    }

    /// The same with digits of other bits: fewer for few keys, whose passes are short beside the table.
    pub fn with_digit_bits(self, digit_bits: u32) -> SortShape {
        SortShape { digit_bits, ..self }
    }

    /// The same with short tiles: for kernels that hold all phases, which compilers are slow with.
    pub(crate) fn with_short_tiles(self) -> SortShape {
        SortShape { rows: self.rows.min(4), ..self }
    }

    /// Bytes of shared memory that it takes of a workgroup.
    pub(crate) fn shared_bytes(&self) -> u32 {
        let counters = self.digits() * if self.private_counters { self.workgroup } else { self.subgroups };
        let tile = self.workgroup * self.rows;
        let offsets = if self.private_counters { 0 } else { self.digits() + 2 * self.subgroups };
        4 * (counters.max(tile) + offsets)
    }

    /// Digits of a pass.
    fn digits(&self) -> u32 {
        1 << self.digit_bits
    }

    /// Keys of a column of the table, for `count` keys in all.
    pub(crate) fn column_keys(&self, count: u32) -> u32 {
        if self.private_counters {
            (count / self.strips).next_power_of_two().clamp(256, 4096)
        } else {
            self.workgroup * self.rows
        }
    }

    pub(crate) fn columns(&self, count: u32) -> u32 {
        count.div_ceil(self.column_keys(count))
    }

    /// Words of the table for `count` keys.
    pub fn table_words(&self, count: u32) -> u64 {
        u64::from(self.digits()) * (u64::from(self.columns(count)) + 1)
    }

    /// Words that the table of no count up to `count` exceeds: longer strips make it smaller for more keys.
    pub(crate) fn most_table_words(&self, count: u32) -> u64 {
        // Strips hold at least 256 keys and, up to 4,096, at least a 256th of all, rounded down; where cores are few, more.
        let columns = if self.private_counters { count.div_ceil(256).min(MOST_STRIPS + 1) } else { 0 };
        u64::from(self.digits()) * (u64::from(columns.max(self.columns(count))) + 1)
    }

    /// Tasks (workgroups) of the counting and scattering steps.
    pub(crate) fn column_tasks(&self, count: u32) -> u32 {
        if self.private_counters { self.columns(count).div_ceil(self.workgroup) } else { self.columns(count) }
    }

    /// Tasks of the scanning step.
    pub(crate) fn scan_tasks(&self) -> u32 {
        self.digits().div_ceil(if self.private_counters { self.workgroup } else { SCANNED_TOGETHER })
    }

    /// Passes that keys of `bits` bits need.
    pub fn passes(&self, bits: u32) -> u32 {
        bits.div_ceil(self.digit_bits)
    }

    /// Specialisation constants 1 to 4 of everything that includes radix_sort.glsl; 1 is free for the includer.
    pub(crate) fn constants(&self, first: u32, key_words: u32) -> [u32; 4] {
        [first, self.digit_bits, self.rows << 16 | self.subgroups, key_words]
    }
}

/// The most keys that are sorted at once.
pub const MAX_COUNT: u32 = 1 << 27;

/// Device addresses of one sort. Keys are 4 bytes each, or 8 (low word first) where `bits > 32`; values are 4 bytes each.
#[derive(Debug, Clone, Copy)]
pub struct SortBuffers {
    /// Keys and values to sort; overwritten.
    pub keys: [u64; 2],
    /// Room for keys and values, `count` each; [`record`] returns which of the two holds the result.
    pub values: [u64; 2],
    /// [`SortShape::table_words`] words.
    pub table: u64,
}

/// What to sort.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sort {
    /// Keys, at most [`MAX_COUNT`].
    pub count: u32,
    /// The low bits to sort by, at most 64; over 32, keys are 8 bytes each.
    pub bits: u32,
    /// The values are 0, 1, 2, …: they need not be there.
    pub identity: bool,
}

/// Records the sort. Returns the index (0 or 1) of the buffers that hold the result.
///
/// Three dispatches a pass with a barrier behind each; the caller places one before the first.
///
/// # Errors
/// A pipeline could not be made.
///
/// # Panics
/// The count is over [`MAX_COUNT`], or the bits over 64.
pub fn record(recorder: &mut Recorder<'_>, shape: &SortShape, buffers: &SortBuffers, sort: &Sort) -> Result<usize> {
    let steps = steps(shape, buffers, sort);
    let passes = steps.len() / STEPS_OF_A_PASS;
    recorder.chains(&[steps])?;
    recorder.barrier();
    Ok(passes % 2)
}

pub(crate) const STEPS_OF_A_PASS: usize = 3;

/// The sort's dispatches, to be recorded with a barrier between each two.
///
/// # Panics
/// The count is over [`MAX_COUNT`], or the bits over 64.
pub(crate) fn steps(shape: &SortShape, buffers: &SortBuffers, sort: &Sort) -> Vec<Step> {
    steps_but(shape, buffers, sort, 0)
}

/// The same where the device knows how many of the passes, the first, are left out, as keys have no such bits, and how many of the keys, the
/// last, as there are fewer: the two numbers lie at this address (0: nothing is left out). The keys to sort are where the first pass that
/// is done looks for them, so the results are where they are without any left out. An indirect dispatch would take a buffer, and the caller's memory is known by addresses: workgroups of a pass
/// that is left out return at once.
///
/// # Panics
/// As [`steps`].
pub(crate) fn steps_but(shape: &SortShape, buffers: &SortBuffers, sort: &Sort, left_out: u64) -> Vec<Step> {
    let Sort { count, bits, identity } = *sort;
    assert!(count <= MAX_COUNT && bits <= 64, "{count} keys of {bits} bits");
    if count < 2 {
        return Vec::new();
    }
    let [first, digits, tiles, words] = shape.constants(0, if bits > 32 { 2 } else { 1 });
    let constants = [first, digits, tiles, words, u32::from(left_out != 0)];
    let pass = |pass: u32| -> [Step; STEPS_OF_A_PASS] {
        let (from, to) = (pass as usize % 2, (pass as usize + 1) % 2);
        let arguments = arguments::RadixSort {
            keys: buffers.keys[from],
            values: buffers.values[from],
            keys_out: buffers.keys[to],
            values_out: buffers.values[to],
            table: buffers.table,
            left_out,
            count,
            pass,
            columns: shape.columns(count),
            column_keys: shape.column_keys(count),
            identity: u32::from(identity),
        };
        [
            (&shaders::GPU_RADIX_SORT_COUNT, shape.column_tasks(count)),
            (&shaders::GPU_RADIX_SORT_SCAN, shape.scan_tasks()),
            (&shaders::GPU_RADIX_SORT_SCATTER, shape.column_tasks(count)),
        ]
        .map(|(shader, groups)| Step::new("sort", Kernel::new(shader, shape.workgroup, &constants), &arguments, groups))
    };
    (0..shape.passes(bits)).flat_map(pass).collect()
}
