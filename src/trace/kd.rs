//! The tracer of kd-trees on the device, recorded as [`super::tracer`] is: each [`Traversal`] is a variant of one shader, with the
//! hits and the work that [`super::twin::kd`] has.
//!
//! ```no_run
//! # use hedgerow::gpu::{Recorder, Region};
//! # use hedgerow::trace::{Query, kd::{KdTracer, Traversal}, tracer::TraceBuffers};
//! # fn example(recorder: &mut Recorder<'_>, structure: u64, rays: Region, hits: Region) -> hedgerow::Result<()> {
//! let tracer = KdTracer::new(recorder.context(), Traversal::short_stack_with_push_down(4));
//! tracer.record(recorder, Query::ClosestHit, &TraceBuffers { structure, rays, hits, work: None, count: 1 << 20 })?;
//! recorder.barrier();
//! # Ok(())
//! # }
//! ```
//!
//! Shaders of others trace by `glsl/trace/kd_tree.glsl`.

use super::Query;
use super::tracer::{self, Loads, TraceBuffers, TraceShape};
use crate::Result;
use crate::gpu::shaders::Shader;
use crate::gpu::{Context, Kernel, Recorder, shaders};
use crate::kdtree::layout::MAX_DEPTH;
use bytemuck::{Pod, Zeroable};

/// How a ray traverses a kd-tree. Every way finds the same hits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Traversal {
    /// The most cells that wait on the stack.
    pub capacity: usize,
    /// Whether a restart begins at the lowest node above which nothing waits, not at the root.
    pub push_down: bool,
}

impl Traversal {
    /// Algorithm 1: every cell that waits is on the stack.
    pub const STACK: Traversal = Traversal { capacity: MAX_DEPTH as usize, push_down: false };
    /// Algorithm 2, kd-restart: no stack.
    pub const RESTART: Traversal = Traversal { capacity: 0, push_down: false };
    /// Algorithm 3: restarts begin as far down as they can.
    pub const PUSH_DOWN: Traversal = Traversal { capacity: 0, push_down: true };

    /// The stack holds the last `capacity` cells that wait; restarts find the others again.
    pub const fn short_stack(capacity: usize) -> Traversal {
        Traversal { capacity, push_down: false }
    }

    /// Algorithm 4: a short stack, and restarts begin as far down as they can.
    pub const fn short_stack_with_push_down(capacity: usize) -> Traversal {
        Traversal { capacity, push_down: true }
    }
}

/// A tree of several that are traced together ([`KdTracer::record_several`]). Also the head of their table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct TreeEntry {
    /// Its address; 0 in the head.
    pub structure: u64,
    /// What its first primitive is numbered; in the head, how many trees follow.
    pub first: u32,
    /// Zero.
    pub reserved: u32,
}

impl TreeEntry {
    /// The table of these trees, each an address and the number of its first primitive.
    pub fn table(trees: &[(u64, u32)]) -> Vec<TreeEntry> {
        let entry = |&(structure, first): &(u64, u32)| TreeEntry { structure, first, reserved: 0 };
        [entry(&(0, trees.len() as u32))].into_iter().chain(trees.iter().map(entry)).collect()
    }
}

/// The tracer of kd-trees on a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct KdTracer {
    traversal: Traversal,
    shape: TraceShape,
}

impl KdTracer {
    /// By this traversal, cut as [`TraceShape::of`] does, but with loads gathered. Stacks of up to 8 cells, which lie in
    /// registers, are the fastest where that was measured: `docs/notes/kdtree.md`.
    pub fn new(context: &Context, traversal: Traversal) -> KdTracer {
        KdTracer::with(traversal, TraceShape::of(context))
    }

    /// Cut as `shape` has it. Nothing lies in shared memory and loads are gathered, whatever it says.
    pub fn with(traversal: Traversal, shape: TraceShape) -> KdTracer {
        let capacity = traversal.capacity.min(MAX_DEPTH as usize);
        let shape = TraceShape { shared_levels: 0, loads: Loads::Gathered, ..shape };
        KdTracer { traversal: Traversal { capacity, ..traversal }, shape }
    }

    /// The kernel that [`KdTracer::record`] takes.
    fn kernel(&self, query: Query, count_work: bool) -> Kernel {
        self.kernel_of(&shaders::TRACE_KD_SINGLE, query, count_work)
    }

    fn kernel_of(&self, shader: &'static Shader, query: Query, count_work: bool) -> Kernel {
        let any_hit = u32::from(query == Query::AnyHit);
        let Traversal { capacity, push_down } = self.traversal;
        let constants = [any_hit, u32::from(count_work), capacity as u32, u32::from(push_down)];
        Kernel::new(shader, self.shape.workgroup, &constants)
    }

    /// Records the tracing of all rays through the kd-tree at `buffers.structure`: as [`tracer::record`] does for a `Bvh2`,
    /// with the same hits. Anything else at that address is traced as an empty tree.
    ///
    /// # Errors
    /// More than [`MAX_RAYS`](super::MAX_RAYS) rays; the kernel's pipeline could not be made.
    pub fn record(&self, recorder: &mut Recorder<'_>, query: Query, buffers: &TraceBuffers) -> Result<()> {
        let kernel = self.kernel(query, buffers.work.is_some());
        tracer::record_kernel(recorder, &kernel, &self.shape, buffers)
    }

    /// The same through several trees, one after the other: at `buffers.structure` is their [`TreeEntry::table`], of at least
    /// one. A ray ends in each where the trees before it have its nearest hit; of equally near ones that in the earlier tree
    /// counts.
    ///
    /// # Errors
    /// As [`KdTracer::record`].
    pub fn record_several(&self, recorder: &mut Recorder<'_>, query: Query, buffers: &TraceBuffers) -> Result<()> {
        let kernel = self.kernel_of(&shaders::TRACE_KD_SEVERAL, query, buffers.work.is_some());
        tracer::record_kernel(recorder, &kernel, &self.shape, buffers)
    }
}
