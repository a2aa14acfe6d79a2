//! The `hedgerow` binary: see `hedgerow --help`, and `program` in the library.

fn main() -> std::process::ExitCode {
    hedgerow_lab::program::main()
}
