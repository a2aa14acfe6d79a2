//! A program that traces rays and builds nothing. tests/linked.rs looks at which shaders it has.

use hedgerow::gpu::Recorder;
use hedgerow::trace::Query;
use hedgerow::trace::tracer::{self, Buffers, Shape};

fn main() {
    // Reached, though not called.
    let record: fn(&mut Recorder<'_>, &Shape, Query, &Buffers) -> hedgerow::Result<()> = tracer::record;
    std::hint::black_box(record);
}
