//! The tracer of wide trees on the device, recorded as [`super::tracer`] is: the same rays, hits and work.

use super::Query;
use super::tracer::{self, Buffers, Loads, Shape};
use crate::Result;
use crate::bvh::wide::Form;
use crate::gpu::{Kernel, Limits, Recorder, shaders};

/// Entries of the stack of a ray. Of nodes of floats all children that the ray enters but the nearest wait, each on its own, at
/// each of the levels that a tree can have beside the leaves; of quantised ones what is left of a node's children waits as one.
pub const fn stack_levels(form: Form) -> u32 {
    match form {
        Form::Four | Form::Eight => form.levels() * (form.width() - 1),
        Form::EightQuantised => form.levels(),
    }
}

// HEDGEROW_LEVELS in glsl/trace/tracer_wide*.comp.
const _: () = assert!(stack_levels(Form::Four) == 180 && stack_levels(Form::Eight) == 336);
const _: () = assert!(stack_levels(Form::EightQuantised) == 49);

/// What is fast on a device: as [`Shape::of`], with the whole stack in shared memory on CPUs. Nodes of floats are gathered.
pub fn shape_of(limits: &Limits, form: Form) -> Shape {
    let mut shape = Shape::of(limits);
    if !form.is_quantised() {
        shape.loads = Loads::Gathered;
    }
    if limits.is_cpu() { Shape { shared_levels: stack_levels(form), ..shape }.within(limits) } else { shape }
}

/// The kernel that [`record`] takes, for [`Context::warm`](crate::gpu::Context::warm).
pub fn kernel(form: Form, shape: &Shape, query: Query, count_work: bool) -> Kernel {
    let shader = match (form, shape.loads) {
        (Form::Four, _) => &shaders::TRACE_TRACER_WIDE4,
        (Form::Eight, _) => &shaders::TRACE_TRACER_WIDE8,
        (Form::EightQuantised, Loads::Gathered) => &shaders::TRACE_TRACER_WIDE8Q,
        (Form::EightQuantised, Loads::LaneByLane) => &shaders::TRACE_TRACER_WIDE8Q_LANES,
    };
    tracer::kernel_of(shader, shape, query, count_work)
}

/// Records the tracing of all rays through the wide tree at `buffers.structure`, which is of this form and holds triangles: as
/// [`tracer::record`] does for a `Bvh2`, with the same hits.
///
/// # Errors
/// As of [`tracer::record`]; loads lane by lane of nodes of floats, which there is no kernel for.
pub fn record(recorder: &mut Recorder<'_>, form: Form, shape: &Shape, query: Query, buffers: &Buffers) -> Result<()> {
    if shape.loads == Loads::LaneByLane && !form.is_quantised() {
        let message = "nodes of floats are not loaded lane by lane in wide trees; take Loads::Gathered";
        return Err(crate::Error::Argument(message.into()));
    }
    let kernel = kernel(form, shape, query, buffers.work.is_some());
    tracer::record_kernel(recorder, &kernel, shape, buffers)
}
