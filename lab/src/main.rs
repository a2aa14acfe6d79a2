//! The `hedgerow` binary: see `hedgerow --help`, and `cli` in the library.

fn main() -> std::process::ExitCode {
    hedgerow_lab::cli::main()
}
