//! Compaction on the device: the same tree depth first, without unused slots and without the records that are in no leaf.
//!
//! What it saves is what collapsing has freed: subtrees that became leaves leave the slots of their nodes behind. Rays also meet
//! the nodes of a path in the order in which they lie in memory. The source is left as it is; [`Bvh2::compacted`] is the twin,
//! with the same bytes.
//!
//! [`Bvh2::compacted`]: super::layout::Bvh2::compacted

use super::layout::NODES_OFFSET;
use crate::Result;
use crate::gpu::arguments;
use crate::gpu::{Grid, Recorder, Region, Step, shaders};

const STEPS: [&shaders::Shader; 5] = [
    &shaders::BVH_COMPACT_PARENTS,
    &shaders::BVH_COMPACT_SIZES,
    &shaders::BVH_COMPACT_INDICES,
    &shaders::BVH_COMPACT_NODES,
    &shaders::BVH_COMPACT_RECORDS,
];

/// Records the compaction of the structure at address `source` to `target`, both aligned to 16 bytes: five dispatches
/// with barriers between, and no scratch memory.
///
/// The target takes as many bytes as a header with the source's counts says ([`Header::compacted`]): on the device,
/// `accel::Property::CompactedSize`. The caller places a barrier (shader write to shader read and write) before and behind.
///
/// [`Header::compacted`]: super::layout::Header::compacted
///
/// # Errors
/// The target does not even hold a header, which is all that the host knows of; a pipeline could not be made.
pub fn record(recorder: &mut Recorder<'_>, source: u64, target: Region) -> Result<()> {
    let target = target.checked("memory for a compacted BVH", NODES_OFFSET, 16)?;
    let grid = Grid::of(recorder.context());
    let step = |shader| Step::new("compact", grid.kernel(shader), &arguments::Compact { source, target }, grid.groups);
    recorder.chains(&[STEPS.map(step).into()])
}
