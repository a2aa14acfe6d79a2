//! End-point overlap of a tree of triangles, on the device (Aila, Karras, Laine, "On Quality Metrics of Bounding Volume
//! Hierarchies", 2013, section 3.2).
//!
//! EPO = Σ over nodes n of C(n) · A((S \ Q(n)) ∩ n) / A(S): of all surface S, what lies in the box of n and belongs to triangles
//! that are not below n, weighted by what n costs (c_T an inner node, c_I · triangles a leaf). A ray that ends in a node's box on
//! a triangle of another subtree has to visit that node: SAH, which takes rays for endless, does not see that.
//!
//! `glsl/bvh/epo.glsl` is the device's side, [`super::twin::epo`] the twin in double precision. The device takes any `Bvh2` of
//! triangles, whatever the order of its records, and each record for a triangle of its own: trees in which several records name
//! one triangle (after splitting) are for the twin. Its arithmetic has 24 bits: within 10⁻³ of the twin.

use super::layout::node_slots;
use crate::Result;
use crate::gpu::arguments;
use crate::gpu::{Context, Kernel, Recorder, Region, fill, shaders};
use bytemuck::{Pod, Zeroable};
use std::ops::Range;

/// What the device leaves behind, 12 bytes: areas, scaled by a power of two.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct OverlapFigures {
    inner: f32,
    leaves: f32,
    surface: f32,
}

impl OverlapFigures {
    /// The end-point overlap with these costs of a step and of a test; `None` where there is no surface, or
    /// none in 32 bits beside the scene.
    pub fn epo(&self, c_t: f64, c_i: f64) -> Option<f64> {
        let surface = f64::from(self.surface);
        (surface > 0.0).then(|| (c_t * f64::from(self.inner) + c_i * f64::from(self.leaves)) / surface)
    }
}

/// Sums that one invocation adds: 64 in `glsl/bvh/epo/sum.comp`.
const ADDED: u32 = 64;

/// Measures the end-point overlap of a `Bvh2` on the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OverlapPass {
    slots: u32,
    records: u32,
    workgroup: u32,
    rounds: u32,
}

/// A structure and the memory that measuring it takes, all aligned to 16 bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OverlapBuffers {
    /// The `Bvh2`.
    pub structure: u64,
    /// [`OverlapPass::scratch_bytes`] bytes.
    pub scratch: Region,
    /// [`OverlapFigures`], written.
    pub result: Region,
}

impl OverlapPass {
    /// For a structure with `primitive_count` records.
    pub fn new(context: &Context, primitive_count: u32) -> OverlapPass {
        let (workgroup, rounds) = (context.tuning.small_group, context.tuning.measure_rounds);
        OverlapPass { slots: node_slots(primitive_count), records: primitive_count, workgroup, rounds }
    }

    /// Bytes of scratch memory.
    pub fn scratch_bytes(&self) -> u64 {
        let sums = self.records + self.records.div_ceil(ADDED) + self.records.div_ceil(ADDED * ADDED);
        4 * (u64::from(self.slots) + u64::from(self.records)) + 12 * u64::from(sums)
    }

    /// Records all of it: [`OverlapPass::begin`], [`OverlapPass::overlaps`] of all records, [`OverlapPass::end`]. The caller
    /// places a barrier before and one behind.
    ///
    /// # Errors
    /// A pipeline could not be made.
    pub fn record(&self, recorder: &mut Recorder<'_>, buffers: &OverlapBuffers) -> Result<()> {
        self.begin(recorder, buffers)?;
        recorder.barrier();
        self.overlaps(recorder, buffers, 0..self.records)?;
        recorder.barrier();
        self.end(recorder, buffers)
    }

    /// Records what comes before all overlaps. The caller places the barriers.
    ///
    /// # Errors
    /// A pipeline could not be made.
    pub fn begin(&self, recorder: &mut Recorder<'_>, buffers: &OverlapBuffers) -> Result<()> {
        let arguments = self.arguments(buffers)?;
        fill::record(recorder, arguments.parents, self.slots + self.records, u32::MAX)?;
        recorder.barrier();
        let kernel = Kernel::new(&shaders::BVH_EPO_PARENTS, self.workgroup, &[]);
        recorder.dispatch(&kernel, &arguments, self.tiles(self.slots))
    }

    /// Records the overlaps of some records, behind [`OverlapPass::begin`]: the part that takes time, so that it may be done a
    /// piece at a time. The caller places the barriers; pieces need none between them.
    ///
    /// # Errors
    /// A pipeline could not be made.
    pub fn overlaps(&self, recorder: &mut Recorder<'_>, buffers: &OverlapBuffers, records: Range<u32>) -> Result<()> {
        let (first, count) = (records.start, records.len() as u32);
        let arguments = arguments::Epo { first, count, ..self.arguments(buffers)? };
        let kernel = Kernel::new(&shaders::BVH_EPO_OVERLAPS, self.workgroup, &[]);
        recorder.dispatch(&kernel, &arguments, self.tiles(count))
    }

    /// Records the sum of the overlaps of all records into the [`OverlapFigures`]. The caller places the barriers.
    ///
    /// # Errors
    /// A pipeline could not be made.
    pub fn end(&self, recorder: &mut Recorder<'_>, buffers: &OverlapBuffers) -> Result<()> {
        let kernel = Kernel::new(&shaders::BVH_EPO_SUM, self.workgroup, &[]);
        let arguments = self.arguments(buffers)?;
        let result = buffers.result.checked("memory for figures", size_of::<OverlapFigures>() as u64, 16)?;
        let room = [arguments.results, arguments.results + 12 * u64::from(self.records.div_ceil(ADDED))];
        let (mut sums, mut count, mut room) = (arguments.sums, self.records, room.into_iter().cycle());
        loop {
            let kept = count.div_ceil(ADDED).max(1);
            let results = if kept == 1 { result } else { room.next().expect("a cycle has no end") };
            let step = arguments::Epo { sums, results, count, ..arguments };
            recorder.dispatch(&kernel, &step, kept.div_ceil(self.workgroup))?;
            if kept == 1 {
                return Ok(());
            }
            recorder.barrier();
            (sums, count) = (results, kept);
        }
    }

    fn tiles(&self, count: u32) -> u32 {
        count.div_ceil(self.workgroup * self.rounds)
    }

    fn arguments(&self, buffers: &OverlapBuffers) -> Result<arguments::Epo> {
        let scratch = buffers.scratch.checked("scratch memory of measuring", self.scratch_bytes(), 16)?;
        let sums = scratch + 4 * (u64::from(self.slots) + u64::from(self.records));
        Ok(arguments::Epo {
            structure: buffers.structure,
            parents: scratch,
            sums,
            results: sums + 12 * u64::from(self.records),
            first: 0,
            count: self.records,
            rounds: self.rounds,
        })
    }
}
