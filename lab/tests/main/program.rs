//! The program as tests run it, and what it has said.

use std::path::Path;
use std::process::{Command, Output};

/// The program, to be started in an environment that names no scenes.
pub fn program(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_hedgerow"));
    command.args(arguments).env_remove("HEDGEROW_SCENES");
    command
}

/// A run of it.
pub fn hedgerow(arguments: &[&str]) -> Output {
    program(arguments).output().expect("the binary starts")
}

/// What it wrote to stdout.
pub fn out(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// What it wrote to stderr.
pub fn err(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// A path as an argument.
pub fn text(path: &Path) -> &str {
    path.to_str().expect("a temporary folder's name is text")
}
