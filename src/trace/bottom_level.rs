//! Rays through a bottom level of [`accel`](crate::accel), whose nodes are of two or of eight children by its size and flags
//! ([`AccelOptions::wide`](crate::accel::AccelOptions::wide)), which whoever records need not know.

use super::Query;
use super::tracer::{self, TraceBuffers, TraceShape};
use super::wide::{Order, WideTracer};
use crate::Result;
use crate::bvh::wide::Form;
use crate::gpu::Recorder;

/// Records the tracing of all rays through triangles: as [`tracer::record`], with the same hits, whichever the nodes are.
///
/// By two dispatches, one for each form. The second leaves what the first has written, unless the structure is of nodes of eight, which the
/// first takes as empty.
///
/// # Errors
/// As of [`tracer::record`].
pub fn record(recorder: &mut Recorder<'_>, query: Query, buffers: &TraceBuffers) -> Result<()> {
    tracer::record(recorder, &TraceShape::of(recorder.context()), query, buffers)?;
    recorder.barrier();
    let wide = WideTracer::in_order(recorder.context(), Form::EightQuantised, Order::Octant);
    wide.record_where_it_is(recorder, query, buffers)
}
