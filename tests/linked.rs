//! A program has the SPIR-V that it reaches, and no other: this one traces rays, and builds nothing.

use hedgerow::gpu::Recorder;
use hedgerow::trace::Query;
use hedgerow::trace::tracer::{self, Buffers, Shape};
use std::fs;

/// The shaders whose SPIR-V this program has.
fn linked() -> Vec<String> {
    let program = fs::read(std::env::current_exe().expect("its path")).expect("its own file");
    let files = fs::read_dir(env!("OUT_DIR")).expect("build.rs has made it");
    let shaders =
        files.map(|file| file.expect("a file").path()).filter(|path| path.extension().is_some_and(|e| e == "spv"));
    let is_linked = |path: &std::path::PathBuf| {
        let spirv = fs::read(path).expect("SPIR-V");
        memchr::memmem::find(&program, &spirv).is_some()
    };
    let name = |path: std::path::PathBuf| path.file_stem().expect("a name").to_string_lossy().into_owned();
    shaders.filter(is_linked).map(name).collect()
}

#[test]
fn who_traces_has_no_shader_of_a_builder() {
    // Reached, though not called.
    let record: fn(&mut Recorder<'_>, &Shape, Query, &Buffers) -> hedgerow::Result<()> = tracer::record;
    std::hint::black_box(record);
    let linked = linked();
    assert!(linked.iter().any(|name| name == "trace.tracer_single"), "what is reached is there: {linked:?}");
    let others: Vec<_> = linked.iter().filter(|name| !name.starts_with("trace.")).collect();
    assert!(others.is_empty(), "{others:?}");
}
