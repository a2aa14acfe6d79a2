//! Quality of a tree: SAH cost, depth and leaf statistics, on the device and, plainly, on the host.
//!
//! `glsl/bvh/quality.glsl` is the device's side; it takes a `Bvh2` of any builder.

use super::layout::node_slots;
use crate::Result;
use crate::gpu::arguments;
use crate::gpu::{Context, Kernel, Recorder, Region, fill, shaders};
use bytemuck::{Pod, Zeroable};

/// What a walk over a tree finds, of whatever kind it is.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Quality {
    /// SAH cost (CONTRACT): (c_T · Σ SA(inner) + c_I · Σ SA(leaf)·n_leaf) / SA(root), the root included.
    pub sah: f64,
    /// Its first sum: Σ SA(inner) / SA(root), the root included.
    pub sah_inner: f64,
    /// Its second sum: Σ SA(leaf)·n_leaf / SA(root).
    pub sah_leaf: f64,
    /// Inner nodes.
    pub inner: u64,
    /// Leaves, those that hold nothing among them.
    pub leaves: u64,
    /// Leaves that hold nothing: of kd-trees alone.
    pub empty_leaves: u64,
    /// Triangles in all leaves.
    pub refs: u64,
    /// Most triangles in a leaf.
    pub leaf_max: u32,
    /// Mean depth of a leaf; the root has depth 0.
    pub depth_avg: f64,
    /// Depth of the deepest leaf.
    pub depth_max: u32,
}

impl Quality {
    /// Sets the SAH cost and its two sums, from sums of areas and the root's, by the costs of a step and of a test. Without area
    /// at the root all are 0.
    pub(crate) fn set_cost(&mut self, [inner, leaf]: [f64; 2], root: f64, [c_t, c_i]: [f64; 2]) {
        let relative = |area: f64| if root > 0.0 { area / root } else { 0.0 };
        (self.sah_inner, self.sah_leaf) = (relative(inner), relative(leaf));
        self.sah = c_t * self.sah_inner + c_i * self.sah_leaf;
    }

    /// Mean triangles in a leaf that has any; 0 where none has.
    pub fn prims_per_leaf(&self) -> f64 {
        self.refs as f64 / (self.leaves - self.empty_leaves).max(1) as f64
    }
}

/// What the device leaves behind, 36 bytes: `Figures` in quality.glsl. Areas are relative to that of the root.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct QualityFigures {
    inner_area: f32,
    leaf_area: f32,
    inner: u32,
    leaves: u32,
    refs: u32,
    leaf_max: u32,
    depth_sum: [u32; 2],
    depth_max: u32,
}

impl QualityFigures {
    /// The figures with these costs of a step and of a test.
    pub fn quality(&self, c_t: f64, c_i: f64) -> Quality {
        let depths = f64::from(self.depth_sum[0]) + f64::from(self.depth_sum[1]) * 4_294_967_296.0;
        let mut quality = Quality {
            inner: self.inner.into(),
            leaves: self.leaves.into(),
            empty_leaves: 0,
            refs: self.refs.into(),
            leaf_max: self.leaf_max,
            depth_avg: if self.leaves == 0 { 0.0 } else { depths / f64::from(self.leaves) },
            depth_max: self.depth_max,
            ..Quality::default()
        };
        quality.set_cost([self.inner_area, self.leaf_area].map(f64::from), 1.0, [c_t, c_i]);
        quality
    }
}

/// Measures the quality of a `Bvh2` on the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct QualityPass {
    slots: u32,
    workgroup: u32,
    rounds: u32,
}

impl QualityPass {
    /// For a structure of `primitive_count` triangles.
    pub fn new(context: &Context, primitive_count: u32) -> QualityPass {
        // Figures of every invocation lie in shared memory.
        let most = context.limits.shared_memory / size_of::<QualityFigures>() as u32;
        let (workgroup, rounds) = (context.tuning.group.min(most), context.tuning.measure_rounds);
        QualityPass { slots: node_slots(primitive_count), workgroup, rounds }
    }

    fn tiles(&self) -> u32 {
        self.slots.div_ceil(self.workgroup * self.rounds)
    }

    /// Bytes of scratch memory.
    pub fn scratch_bytes(&self) -> u64 {
        4 * u64::from(self.slots) + u64::from(self.tiles()) * size_of::<QualityFigures>() as u64
    }

    /// Records the measuring of the structure at address `structure` into the [`QualityFigures`] at `result`, with scratch
    /// memory of [`QualityPass::scratch_bytes`]; all aligned to 16 bytes. The caller places a barrier before and one behind.
    ///
    /// # Errors
    /// The memory is too small; a pipeline could not be made.
    pub fn record(&self, recorder: &mut Recorder<'_>, structure: u64, scratch: Region, result: Region) -> Result<()> {
        let scratch = scratch.checked("scratch memory of measuring", self.scratch_bytes(), 16)?;
        let result = result.checked("memory for figures", size_of::<QualityFigures>() as u64, 16)?;
        let arguments = arguments::Quality {
            structure,
            parents: scratch,
            partials: scratch + 4 * u64::from(self.slots),
            result,
            rounds: self.rounds,
            tiles: self.tiles(),
        };
        let kernel = |shader| Kernel::new(shader, self.workgroup, &[]);
        fill::record(recorder, scratch, self.slots, u32::MAX)?;
        recorder.barrier();
        recorder.dispatch(&kernel(&shaders::BVH_QUALITY_PARENTS), &arguments, self.tiles())?;
        recorder.barrier();
        recorder.dispatch(&kernel(&shaders::BVH_QUALITY_MEASURE), &arguments, self.tiles())?;
        recorder.barrier();
        recorder.dispatch(&kernel(&shaders::BVH_QUALITY_SUM), &arguments, 1)
    }
}
