//! A program has the SPIR-V that it reaches, and no other. `examples/trace_only.rs` traces rays and builds nothing;
//! `examples/engine.rs` builds, but never asks for the persistent schedule.

use std::fs;
use std::path::{Path, PathBuf};

/// The shaders whose SPIR-V a program has.
fn linked(program: &Path) -> Vec<String> {
    let program = fs::read(program).unwrap_or_else(|error| {
        panic!(
            "{}: {error}; `cargo test` builds the examples, `cargo build --release --examples` as well",
            program.display()
        )
    });
    let files = fs::read_dir(env!("OUT_DIR")).expect("build.rs has made it");
    let shaders =
        files.map(|file| file.expect("a file").path()).filter(|path| path.extension().is_some_and(|e| e == "spv"));
    let is_linked = |path: &PathBuf| {
        let spirv = fs::read(path).expect("SPIR-V");
        memchr::memmem::find(&program, &spirv).is_some()
    };
    let name = |path: PathBuf| path.file_stem().expect("a name").to_string_lossy().into_owned();
    shaders.filter(is_linked).map(name).collect()
}

fn linked_into_example(name: &str) -> Vec<String> {
    let tests = std::env::current_exe().expect("the path of this program");
    let examples = tests.ancestors().nth(2).expect("it lies in PROFILE/deps").join("examples");
    linked(&examples.join(format!("{name}{}", std::env::consts::EXE_SUFFIX)))
}

#[test]
fn a_program_that_only_traces_has_no_shader_of_a_builder() {
    let linked = linked_into_example("trace_only");
    assert!(linked.iter().any(|name| name == "trace.tracer.single"), "what is reached is there: {linked:?}");
    let others: Vec<_> =
        linked.iter().filter(|name| !name.starts_with("trace.") && !name.starts_with("example")).collect();
    assert!(others.is_empty(), "{others:?}");
}

#[test]
fn a_program_that_does_not_name_the_persistent_schedule_has_none_of_its_shaders() {
    let linked = linked_into_example("engine");
    assert!(linked.iter().any(|name| name == "bvh.lbvh_workgroup"), "what is reached is there: {linked:?}");
    let persistent: Vec<_> = linked.iter().filter(|name| name.ends_with(".persistent")).collect();
    assert!(persistent.is_empty(), "{persistent:?}");
}
