//! The tracer of wide trees on the device, recorded as [`super::tracer`] is: the same rays, hits and work.

use super::Query;
use super::tracer::{self, Loads, TraceBuffers, TraceShape};
use crate::bvh::wide::Form;
use crate::gpu::shaders::{self, Shader};
use crate::gpu::{Context, Kernel, Limits, Recorder};
use crate::{Error, Result};

/// The order in which a ray visits the children of a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Order {
    /// By where the ray enters them, each that waits with its distance: the fewest steps and tests.
    Distance,
    /// Of quantised nodes: the leaves first, then the node that is entered first, and the others by slots, in an order that follows from the
    /// signs of the direction, those of a node waiting as one entry (Ylitie, Karras, Laine 2017): less to sort and to keep. By slots alone, as
    /// rays go that end at any hit, it took 1.0 to 1.2 times the steps over seven scenes and 1.0 to 1.3 times the tests, the most of primary
    /// and random rays, and with the nearest first 0.87 to 0.99 of those steps; lavapipe is as fast.
    Octant,
    /// By slots, wherever the children are: for rays that end at any hit, in trees whose children have an order
    /// ([`crate::bvh::child_order`]). No distances are kept, nothing is sorted, and those of a node wait as one entry.
    LeftFirst,
}

/// The tracer of wide trees of one form on a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct WideTracer {
    /// The nodes of the trees.
    pub form: Form,
    /// The order of children.
    pub order: Order,
    /// How the trace is divided. Only [`Order::Octant`] has [`Loads::LaneByLane`].
    pub shape: TraceShape,
}

// HEDGEROW_LEVELS in glsl/trace/wide/*.comp.
const _: () = assert!(Order::Distance.stack_levels(Form::Four) == 180);
const _: () = assert!(Order::Distance.stack_levels(Form::Eight) == 336);
const _: () = assert!(Order::Distance.stack_levels(Form::EightQuantised) == 343);
const _: () = assert!(Order::Octant.stack_levels(Form::EightQuantised) == 49);
const _: () = assert!(Order::LeftFirst.stack_levels(Form::Four) == 60);
const _: () = assert!(Order::LeftFirst.stack_levels(Form::Eight) == 48);
const _: () = assert!(Order::LeftFirst.stack_levels(Form::EightQuantised) == 49);

impl Order {
    /// Entries of the stack of a ray, as many as the levels of nodes that a tree can have: by distance, of each of them all
    /// children but the nearest wait, each on its own.
    pub const fn stack_levels(self, form: Form) -> u32 {
        match self {
            Order::Distance => form.levels() * (form.width() - 1),
            Order::Octant | Order::LeftFirst => form.levels(),
        }
    }
}

impl WideTracer {
    /// What is fast on a device: quantised nodes by distance on CPUs, unless loads are lane by lane there; on GPUs, of which none
    /// was measured, as their paper has it.
    pub fn of(context: &Context, form: Form) -> WideTracer {
        let by_octant = form.is_quantised() && context.tuning.trace.by_octant;
        WideTracer::in_order(context, form, if by_octant { Order::Octant } else { Order::Distance })
    }

    /// In this order: the shape as of [`TraceShape::of`], but the whole stack in shared memory on CPUs, and no loads lane by lane
    /// but by [`Order::Octant`].
    pub fn in_order(context: &Context, form: Form, order: Order) -> WideTracer {
        let mut shape = TraceShape::of(context);
        if order != Order::Octant {
            let tuning = &context.tuning.trace;
            shape.loads = match () {
                () if tuning.in_vectors => Loads::InVectors,
                () if tuning.in_longs => Loads::InLongs,
                () => Loads::Gathered,
            };
        }
        WideTracer::with(&context.limits, form, order, shape)
    }

    /// With as many levels in shared memory as `shape` has for binary trees: some, or all.
    pub fn with(limits: &Limits, form: Form, order: Order, shape: TraceShape) -> WideTracer {
        let all = shape.shared_levels >= TraceShape::subgroups(limits).shared_levels;
        let shared_levels = if all { order.stack_levels(form) } else { shape.shared_levels };
        WideTracer { form, order, shape: TraceShape { shared_levels, ..shape }.within(limits) }
    }

    /// The kernel that [`WideTracer::record`] takes.
    ///
    /// # Errors
    /// No kernel visits such nodes in that order, or loads them in that way; the nearest hit is not found by
    /// [`Order::LeftFirst`].
    fn kernel(&self, query: Query, count_work: bool) -> Result<Kernel> {
        let shader = self.shader()?;
        match (self.order, query) {
            (Order::LeftFirst, Query::AnyHit) => Ok(tracer::kernel_left_first(shader, &self.shape, count_work)),
            (Order::LeftFirst, Query::ClosestHit) => Err(Error::Argument(
                "Order::LeftFirst is for rays that end at any hit; take Order::Distance for the closest".into(),
            )),
            _ => Ok(tracer::kernel_of(shader, &self.shape, query, count_work)),
        }
    }

    fn shader(&self) -> Result<&'static Shader> {
        Ok(match (self.form, self.order, self.shape.loads) {
            (Form::EightQuantised, Order::Octant, Loads::LaneByLane) => &shaders::TRACE_WIDE_OCTANT_LANES,
            (form, order, Loads::LaneByLane) => return Err(self.no_kernel(form, order)),
            (Form::EightQuantised, Order::Octant, Loads::InLongs) => &shaders::TRACE_WIDE_OCTANT_INT64,
            (Form::EightQuantised, Order::Octant, _) => &shaders::TRACE_WIDE_OCTANT,
            (form, Order::Octant, _) => return Err(self.no_kernel(form, Order::Octant)),
            (Form::Four, _, Loads::InLongs) => &shaders::TRACE_WIDE_FOUR_INT64,
            (Form::Four, ..) => &shaders::TRACE_WIDE_FOUR,
            (Form::Eight, _, Loads::InLongs) => &shaders::TRACE_WIDE_EIGHT_INT64,
            (Form::Eight, ..) => &shaders::TRACE_WIDE_EIGHT,
            (Form::EightQuantised, _, Loads::InLongs) => &shaders::TRACE_WIDE_EIGHT_QUANTISED_INT64,
            (Form::EightQuantised, ..) => &shaders::TRACE_WIDE_EIGHT_QUANTISED,
        })
    }

    fn no_kernel(&self, form: Form, order: Order) -> Error {
        let loads = self.shape.loads;
        Error::Argument(format!(
            "no kernel traces {form} in the order {order:?} with loads {loads:?}; take Order::Distance with \
             Loads::Gathered, or Order::Octant of wide8q"
        ))
    }

    /// Records the tracing of all rays through the wide tree at `buffers.structure`, which is of this form and holds triangles:
    /// as [`tracer::record`] does for a `Bvh2`, with the same hits. By [`Order::LeftFirst`] a ray that ends at any hit may name another
    /// triangle.
    ///
    /// # Errors
    /// As of [`tracer::record`]; no kernel visits such nodes in this order, or loads them in this way; the closest hit is asked for by
    /// [`Order::LeftFirst`].
    pub fn record(&self, recorder: &mut Recorder<'_>, query: Query, buffers: &TraceBuffers) -> Result<()> {
        let kernel = self.kernel(query, buffers.work.is_some())?;
        tracer::record_kernel(recorder, &kernel, &self.shape, buffers)
    }

    /// The same by [`Order::Octant`], where the structure is of this form; otherwise hits and work stay what they are.
    pub(super) fn record_where_it_is(
        &self,
        recorder: &mut Recorder<'_>,
        query: Query,
        buffers: &TraceBuffers,
    ) -> Result<()> {
        debug_assert_eq!(self.order, Order::Octant, "no other shader leaves other forms");
        let kernel = tracer::kernel_where_it_is(self.shader()?, &self.shape, query, buffers.work.is_some());
        tracer::record_kernel(recorder, &kernel, &self.shape, buffers)
    }
}
