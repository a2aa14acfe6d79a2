//! Re-braiding: which instances of a top level are opened before it is built (Benthin, Woop, Wald 2017).
//!
//! An instance whose box holds much that is not the instance makes rays visit it in vain, and overlaps others, so that none of
//! them can be told to be nearer. Opened, it stands in the tree as the two children of its structure's root, or their
//! children…, each with a tighter box in the world. That is bought with entries, so the budget goes to where an entry more
//! saves most area: the parent's, less its children's. (The paper opens by the largest area while a tree is built top-down;
//! bottom-up builders need the entries before.) `glsl/accel/rebraid.glsl` has the rounds.

use crate::gpu::push_constants::push_constants;
use crate::gpu::{Context, Kernel, Step, fill, shaders};

/// Times that entries are weighed and opened: `ROUNDS` in rebraid.glsl.
const ROUNDS: u32 = 8;
/// `CHUNKS_AT_MOST` there.
const CHUNKS: u32 = 256;
/// Words of its `RebraidState`.
const STATE_WORDS: u32 = ROUNDS + 1 + ROUNDS * 512 + 2 * CHUNKS;

push_constants! {
    /// Push constants of `glsl/accel/rebraid_*.comp`.
    struct Arguments {
        entries: u64,
        gains: u64,
        state: u64,
        capacity: u32,
        round: u32,
        chunks: u32,
        tolerance: f32,
        instance_count: u32,
        padding: u32,
    }
}

/// Opening the entries of a top level.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rebraid {
    /// Entries that there is room for.
    pub capacity: u32,
    /// How much more area the children of an entry may have together than itself: above 1, what overlaps is opened too.
    pub tolerance: f32,
}

impl Rebraid {
    /// Bytes of scratch memory: the gains of the entries, and the state.
    pub fn scratch_bytes(&self) -> u64 {
        (4 * (u64::from(self.capacity) + u64::from(STATE_WORDS))).next_multiple_of(16)
    }

    /// The steps behind the one that writes the entries, of which `count` are of instances.
    pub fn steps(&self, context: &Context, count: u32, entries: u64, scratch: u64) -> Vec<Step> {
        let is_cpu = context.limits.is_cpu();
        let workgroup = if is_cpu { context.limits.subgroup_size } else { 64 };
        // Enough for all cores; a chunk has one invocation that opens.
        let chunks = count.div_ceil(if is_cpu { 256 } else { 64 }).clamp(1, CHUNKS);
        let state = scratch + 4 * u64::from(self.capacity);
        let mut steps = vec![fill::step("re-braid", scratch, self.capacity + STATE_WORDS, 0)];
        let kernel = |shader| Kernel::new(shader, workgroup, &[]);
        for round in 0..ROUNDS {
            let arguments = Arguments {
                entries,
                gains: scratch,
                state,
                capacity: self.capacity,
                round,
                chunks,
                tolerance: self.tolerance,
                instance_count: count,
                padding: 0,
            };
            for shader in [&shaders::ACCEL_REBRAID_WEIGH, &shaders::ACCEL_REBRAID_SELECT, &shaders::ACCEL_REBRAID_OPEN]
            {
                steps.push(Step::new("re-braid", kernel(shader), &arguments, chunks));
            }
        }
        steps
    }
}
