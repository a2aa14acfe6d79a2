//! The order of children for rays that end at their first hit: which child of a node they look into first.
//!
//! A ray that only asks whether anything is in its way need not meet what is near first. It is done soonest where the child with the most
//! hits for its work comes first. With h_l, h_r the probabilities that a ray in a child ends there, C_l, C_r what it costs, and p_l, p_r,
//! p_lr the parts of the node's rays that meet the left child, the right one, and both, the left child first costs
//! c_T + p_l·C_l + (p_r − p_lr·h_l)·C_r. The difference to the other order is p_lr·(h_r·C_l − h_l·C_r). So **the left child comes first
//! where h_l / C_l > h_r / C_r**, whatever p_lr is. The published rules, and the one that contains them, are settings of h and C:
//! [`ChildOrder`].
//!
//! [`BuildOptions::child_order`](super::builder::BuildOptions::child_order) asks a builder for an order; [`ChildOrderPass`] puts the children
//! of a finished `Bvh2` in order, whoever built it. The left one is then the one to look into first, and the header says so. Hits
//! stay what they are, but which triangle a ray names that ends at any hit. [`crate::trace::tracer::record_left_first`] and queries of
//! `glsl/trace/query.glsl` are the walks that profit, and [`crate::trace::wide::Order::LeftFirst`] in wide trees made of such. `glsl/bvh/child_order.glsl` is the device's side,
//! [`Bvh2::in_child_order`](super::layout::Bvh2::in_child_order) the twin: the same bytes. An LBVH puts its children in order while it is
//! built (`glsl/bvh/lbvh.glsl`): the same rules, the areas of a leaf's primitives being added up in another order.

use super::counts::LinkCount;
use super::layout::{NODES_OFFSET, node_slots};
use super::sah::Collapse;
use crate::Result;
use crate::gpu::arguments;
use crate::gpu::{Context, Kernel, Recorder, Region, Step, shaders};

/// A rule for which child comes first. Equal children stay as they are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ChildOrder {
    /// The one with the larger box: SATO (Nah and Manocha 2014, "SATO: Surface Area Traversal Order for Shadow Ray Tracing").
    LargerBox,
    /// The one whose primitives have the larger mean area: PrimSATO, of the same paper.
    LargerPrimitives,
    /// The cheaper one, as if every ray that enters a subtree ended there: RTSAH (Ize and Hansen 2011, "RTSAH Traversal Order for
    /// Occlusion Rays"), with p_lr = p_l + p_r − 1.
    Cheaper,
    /// The one with the larger h / C, for opaque primitives: in a leaf of half area A a primitive of area a ends a ray with the
    /// probability a / A (Cauchy and Crofton). Those of a leaf are taken to be side by side, so that the probabilities add up to 1 at
    /// most.
    MoreHitsForItsCost,
}

impl ChildOrder {
    /// All of them.
    pub const ALL: [ChildOrder; 4] =
        [ChildOrder::LargerBox, ChildOrder::LargerPrimitives, ChildOrder::Cheaper, ChildOrder::MoreHitsForItsCost];

    /// `RULE` of glsl/bvh/child_weights.glsl; 0 is no order.
    pub(super) fn rule(self) -> u32 {
        self as u32 + 1
    }

    /// Whether it looks at what is below a child.
    pub(super) fn has_weights(self) -> bool {
        self != ChildOrder::LargerBox
    }
}

/// How many rays the rule without rays ([`ChildOrder::MoreHitsForItsCost`]) stands for, where counts of rays say what comes first.
pub(crate) const PRIOR_RAYS: f32 = 8.0;

/// Puts the children of a `Bvh2` in order on the device.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChildOrderPass {
    order: ChildOrder,
    costs: Collapse,
    slots: u32,
    workgroup: u32,
    rounds: u32,
}

impl ChildOrderPass {
    /// For structures of at most `primitive_count` primitives, by the costs of a step and of a test; whether the tree was collapsed means
    /// nothing here.
    pub fn new(context: &Context, order: ChildOrder, costs: Collapse, primitive_count: u32) -> ChildOrderPass {
        let (workgroup, rounds) = (context.tuning.group, context.tuning.measure_rounds);
        ChildOrderPass { order, costs, slots: node_slots(primitive_count), workgroup, rounds }
    }

    /// Bytes of scratch memory: 16 for each node slot.
    pub fn scratch_bytes(&self) -> u64 {
        16 * u64::from(self.slots)
    }

    /// Records the ordering of `structure`, with scratch memory of [`ChildOrderPass::scratch_bytes`], both aligned to 16 bytes. A structure
    /// of more primitives than was planned for, or one that cannot be traced, stays as it is. Twice is once.
    ///
    /// The caller places a barrier before, from what has written the structure, and one behind, to what reads the structure or writes
    /// the scratch memory. No ray may be traced meanwhile. Label: `order`.
    ///
    /// # Errors
    /// The memory is too small; a pipeline could not be made.
    pub fn record(&self, recorder: &mut Recorder<'_>, structure: Region, scratch: Region) -> Result<()> {
        recorder.chains(&[self.steps(structure, scratch)?])
    }

    /// The steps of [`ChildOrderPass::record`]. [`Recorder::chains`] records them side by side with others.
    ///
    /// # Errors
    /// The memory is too small.
    pub fn steps(&self, structure: Region, scratch: Region) -> Result<Vec<Step>> {
        self.steps_by(self.order, structure, 0, scratch)
    }

    /// Records the same with an order that rays have taught: first comes the child with more hits for its work by `counts`
    /// ([`LinkCount`] × 2 for each node slot, of rays that were counted exhaustively). [`ChildOrder::MoreHitsForItsCost`] weighs as much as
    /// 8 rays into each child, whatever the order of this pass is. Counts of children that are swapped are swapped, too, so that they
    /// stay those of their links.
    ///
    /// # Errors
    /// As [`ChildOrderPass::record`].
    pub fn record_by_counts(
        &self,
        recorder: &mut Recorder<'_>,
        structure: Region,
        counts: Region,
        scratch: Region,
    ) -> Result<()> {
        let counts_bytes = 2 * size_of::<LinkCount>() as u64 * u64::from(self.slots);
        let counts = counts.checked("counts of rays that teach an order of children", counts_bytes, 4)?;
        recorder.chains(&[self.steps_by(ChildOrder::MoreHitsForItsCost, structure, counts, scratch)?])
    }

    /// The steps by counts, where there are any.
    fn steps_by(&self, order: ChildOrder, structure: Region, counts: u64, scratch: Region) -> Result<Vec<Step>> {
        let structure = structure.checked("the BVH whose children are put in order", NODES_OFFSET, 16)?;
        let scratch = scratch.checked("scratch memory of an order of children", self.scratch_bytes(), 16)?;
        let slots = u64::from(self.slots);
        let arguments = arguments::ChildOrder {
            structure,
            parents: scratch + 8 * slots,
            waits: scratch + 12 * slots,
            weights: scratch,
            counts,
            slots: self.slots,
            rounds: self.rounds,
            c_t: self.costs.c_t,
            c_i: self.costs.c_i,
        };
        let groups = self.slots.div_ceil(self.workgroup * self.rounds);
        let constants = [order.rule(), u32::from(counts != 0)];
        let climb = Kernel::new(&shaders::BVH_CHILD_ORDER_CLIMB, self.workgroup, &constants);
        let step = |kernel| Step::new("order", kernel, &arguments, groups);
        let mut steps = vec![step(climb)];
        if order.has_weights() {
            steps.insert(0, step(parents_kernel(self.workgroup)));
        }
        Ok(steps)
    }
}

/// The kernel that finds the parent of each node, and how many of its children are nodes: what a climb from the leaves begins with.
pub(crate) fn parents_kernel(workgroup: u32) -> Kernel {
    Kernel::new(&shaders::BVH_CHILD_ORDER_PARENTS, workgroup, &[])
}
