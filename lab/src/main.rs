//! The `hedgerow` binary: see `hedgerow --help`, and `program` in the library.

use hedgerow_lab::measure::heap::CountingAllocator;

#[global_allocator]
static HEAP: CountingAllocator = CountingAllocator;

fn main() -> std::process::ExitCode {
    hedgerow_lab::program::main()
}
