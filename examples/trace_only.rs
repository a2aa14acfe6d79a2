//! A program that traces rays and builds nothing. tests/linked.rs looks at which shaders it has.

use hedgerow::gpu::Recorder;
use hedgerow::trace::Query;
use hedgerow::trace::tracer::{self, TraceBuffers, TraceShape};

fn main() {
    // Reached, though not called.
    let record: fn(&mut Recorder<'_>, &TraceShape, Query, &TraceBuffers) -> hedgerow::Result<()> = tracer::record;
    std::hint::black_box(record);
}
