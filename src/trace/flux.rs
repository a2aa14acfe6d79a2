//! Rays that were traced, on a grid over the scene: what [`crate::bvh::reinsertion`] learns from.
//!
//! An engine gives rays with the hits that it traced, each kind of rays in memory of its own, or every so many of them.
//! [`FluxPass::record`] makes a [`crate::bvh::flux`] grid of them. Each ray counts from its origin, or from `t_min` on, to its hit or `t_max`.
//!
//! Rays that end at any hit have no distance there. Trace those that teach to the closest hit: a sixteenth of a frame's is enough.
//!
//! ```no_run
//! # use hedgerow::{gpu::{Context, Recorder, Region}, trace::flux::{FluxPass, FluxRays}};
//! # fn example(context: &Context, recorder: &mut Recorder<'_>, structure: Region, rays: Region, hits: Region, ray_count: u32,
//! #            grid: Region) -> hedgerow::Result<()> {
//! let every_16th = FluxRays { rays, hits, ray_count, first: 0, stride: 16 };
//! FluxPass::new(context).record(recorder, structure, &[every_16th], grid)?;
//! # Ok(())
//! # }
//! ```

use super::{Hit, Ray};
use crate::bvh::flux::{GRID_BYTES, HEAD_BYTES, MAX_FLUX_RAYS, POINTS};
use crate::bvh::layout::NODES_OFFSET;
use crate::gpu::{Context, Kernel, Recorder, Region, arguments, shaders};
use crate::{Error, Result};

/// Rays that teach, with their hits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FluxRays {
    /// [`Ray`] × `ray_count`, aligned to 16 bytes.
    pub rays: Region,
    /// [`Hit`] × `ray_count`, aligned to 16 bytes: closest hits. A ray that ends before it begins, as all do whose hit is at a distance of
    /// 0, is left out.
    pub hits: Region,
    /// How many there are.
    pub ray_count: u32,
    /// The first that is taken.
    pub first: u32,
    /// From one that is taken to the next, 1 or more.
    pub stride: u32,
}

impl FluxRays {
    /// All of so many rays.
    pub fn all(rays: Region, hits: Region, ray_count: u32) -> FluxRays {
        FluxRays { rays, hits, ray_count, first: 0, stride: 1 }
    }

    /// How many are taken.
    fn taken(&self) -> u32 {
        self.ray_count.saturating_sub(self.first).div_ceil(self.stride.max(1))
    }
}

/// Makes a grid of rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FluxPass {
    workgroup: u32,
}

impl FluxPass {
    /// For a device.
    pub fn new(context: &Context) -> FluxPass {
        FluxPass { workgroup: context.tuning.small_group }
    }

    /// Records a grid of all these rays over the box of `structure`, a `Bvh2` aligned to 16 bytes. `grid` has [`GRID_BYTES`], aligned to 16
    /// bytes, whatever is in it. Without rays no box has any, and reinsertion is by area.
    ///
    /// The caller places a barrier before, from what has written structure, rays and hits, and one behind. Label: `flux`.
    ///
    /// # Errors
    /// A stride is 0; more than [`MAX_FLUX_RAYS`] rays are taken, or than the memory holds; a pipeline could not be made.
    pub fn record(
        &self,
        recorder: &mut Recorder<'_>,
        structure: Region,
        rays: &[FluxRays],
        grid: Region,
    ) -> Result<()> {
        let structure = structure.checked("the BVH in which rays were traced", NODES_OFFSET, 16)?;
        let grid = grid.checked("memory for a grid of rays", GRID_BYTES, 16)?;
        if rays.iter().any(|rays| rays.stride == 0) {
            let what = "a grid of every 0th ray of a sample; take a stride of 1 for all rays, or more for a part";
            return Err(Error::Argument(what.into()));
        }
        let taken: u64 = rays.iter().map(|rays| u64::from(rays.taken())).sum();
        if taken > u64::from(MAX_FLUX_RAYS) {
            return Err(Error::Argument(format!(
                "{taken} rays on a grid, at most {MAX_FLUX_RAYS}: take a larger stride"
            )));
        }
        let none = arguments::Flux {
            structure,
            grid,
            counts: grid + HEAD_BYTES,
            rays: 0,
            hits: 0,
            first: 0,
            stride: 1,
            begin: 0,
            count: 0,
            axis: 0,
        };
        let kernel = |shader| Kernel::new(shader, self.workgroup, &[]);
        let groups = |items: u32| items.div_ceil(self.workgroup);
        recorder.phase("flux");
        recorder.dispatch(&kernel(&shaders::TRACE_FLUX_BEGIN), &none, groups(POINTS * POINTS * POINTS))?;
        recorder.barrier();
        for sample in rays {
            let bytes = |each: usize| u64::from(sample.ray_count) * each as u64;
            let arguments = arguments::Flux {
                rays: sample.rays.checked("memory of rays", bytes(size_of::<Ray>()), 16)?,
                hits: sample.hits.checked("memory of hits", bytes(size_of::<Hit>()), 16)?,
                first: sample.first,
                stride: sample.stride,
                count: sample.taken(),
                ..none
            };
            recorder.dispatch(&kernel(&shaders::TRACE_FLUX_RAYS), &arguments, groups(sample.taken()))?;
        }
        for axis in 0..3 {
            recorder.barrier();
            let arguments = arguments::Flux { axis, ..none };
            recorder.dispatch(&kernel(&shaders::TRACE_FLUX_SUMS), &arguments, groups(POINTS * POINTS))?;
        }
        Ok(())
    }
}
