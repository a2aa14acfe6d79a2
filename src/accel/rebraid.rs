//! Re-braiding: which instances of a top level are opened before it is built (Benthin, Woop, Wald 2017).
//!
//! An instance whose box holds much that is not the instance makes rays visit it in vain, and overlaps others, so that none of
//! them can be told to be nearer. Opened, it stands in the tree as the two children of its structure's root, or their
//! children…, each with a tighter box in the world. That is bought with entries, so the budget goes to where an entry more
//! saves most area: the parent's, less its children's. (The paper opens by the largest area while a tree is built top-down;
//! bottom-up builders need the entries before.) What lies beyond the fences of most entries ([`crate::bvh::codes::CodeBounds::Robust`])
//! is opened last: however large it is, few rays come there. `glsl/accel/rebraid.glsl` has the rounds, [`twin`](super::twin) is the twin.
//!
//! How many times as fast rays are traced, on lavapipe of Mesa 26 with two cores that others used too (load 10): the geometric
//! mean of primary, ambient occlusion, diffuse and random rays, each the ratio of the medians of alternating runs; and what a
//! ray meets (nodes, instances counted as three, triangles as 0.7), which is free of noise. By the budget:
//!
//! | scene | measured, 2 | measured, 4 | met, 2 | met, 4 |
//! | --- | ---: | ---: | ---: | ---: |
//! | `gen:city:400` | 1.59 | 1.59 | 1.66 | 1.66 |
//! | `gen:forest:400` | 1.45 | 1.52 | 1.50 | 1.61 |
//! | `gen:forest:2000` | 1.34 | 1.19 | 1.51 | 1.63 |
//! | `gen:cables:200` | 1.39 | 2.18 | 1.51 | 2.71 |
//! | `gen:cells:512`, `pine_hill` | 1.01, 1.05 | 1.02, 1.02 | 1 | 1 |
//!
//! Where boxes fit (spheres, upright trees), nothing is opened and the tree is the same. The default is the budget at which all
//! loose scenes gain: more gains for cables alone, and takes memory and time to build everywhere.
//!
//! How long it takes beside the rest of a build: docs/notes/rays.md, "Re-braiding, opened from a list".
//!
//! Tried, and not worth it: weighing volume beside area, for rays that begin in boxes (city ±5%, cables −1%); opening what is
//! tight, too (slower); more than three rounds (no change within 1%, but what is very loose among many is opened deeper: four).
use crate::gpu::arguments::{self, REBRAID_STATE_BYTES};
use crate::gpu::{Context, Kernel, Step, fill, shaders};

/// Times that entries are weighed and opened: `ROUNDS` in rebraid.glsl.
pub(super) const ROUNDS: u32 = 4;
/// Classes of gains there.
const CLASSES: u32 = 512;
/// `CHUNKS_AT_MOST` there.
const CHUNKS: u32 = 256;
const STATE_WORDS: u32 = REBRAID_STATE_BYTES as u32 / 4;
/// Bytes of the sample that tells what is far: the `Sample` of glsl/bvh/codes/quartiles.glsl.
const SAMPLE_BYTES: u64 = 256 * 12;
/// Of what is far, the gain at most: `FAR_GAIN` in rebraid.glsl.
pub(super) const FAR_GAIN: f32 = f32::MIN_POSITIVE;
/// Instances up to which one workgroup does all rounds: a chain of dispatches costs more than their work.
const SMALL: u32 = 1024;

/// The class of a gain: two to each power of two.
pub(super) fn class_of(gain: f32) -> u32 {
    gain.to_bits() >> 22 & (CLASSES - 1)
}

/// Opening the entries of a top level.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rebraid {
    /// Entries that there is room for.
    pub capacity: u32,
}

impl Rebraid {
    /// Bytes of scratch memory: the gains of the entries, the state, and the sample.
    pub fn scratch_bytes(&self) -> u64 {
        (4 * (u64::from(self.capacity) + u64::from(STATE_WORDS)) + SAMPLE_BYTES).next_multiple_of(16)
    }

    /// The steps behind the one that writes the entries, of which `count` are of instances.
    pub fn steps(&self, context: &Context, count: u32, entries: u64, scratch: u64) -> Vec<Step> {
        // Enough for all cores; a chunk is a workgroup's.
        let chunks = count.div_ceil(256).clamp(1, CHUNKS);
        let arguments = |this_round, chunks| arguments::Rebraid {
            entries,
            gains: scratch,
            state: scratch + 4 * u64::from(self.capacity),
            table: scratch + 4 * (u64::from(self.capacity) + u64::from(STATE_WORDS)),
            capacity: self.capacity,
            this_round,
            chunks,
            instance_count: count,
        };
        if count <= SMALL {
            let all = Kernel::new(&shaders::ACCEL_REBRAID_WORKGROUP, context.tuning.build.alone_group, &[]);
            return vec![Step::new("re-braid", all, &arguments(0, 1), 1)];
        }
        let fences = Kernel::new(&shaders::ACCEL_REBRAID_FENCES, context.tuning.build.alone_group, &[]);
        let of_chunks = |shader, round| {
            let kernel = Kernel::new(shader, context.tuning.small_group, &[]);
            Step::new("re-braid", kernel, &arguments(round, chunks), chunks)
        };
        let mut steps = vec![
            fill::step("re-braid", scratch + 4 * u64::from(self.capacity), STATE_WORDS, 0),
            Step::new("re-braid", fences, &arguments(0, 1), 1),
            of_chunks(&shaders::ACCEL_REBRAID_WEIGH, 0),
        ];
        let of_round = [&shaders::ACCEL_REBRAID_SELECT, &shaders::ACCEL_REBRAID_LIST, &shaders::ACCEL_REBRAID_OPEN];
        for round in 0..ROUNDS {
            steps.extend(of_round.map(|shader| of_chunks(shader, round)));
        }
        steps
    }
}
