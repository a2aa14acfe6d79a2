//! Makes SPIR-V of every shader below `glsl/`, the table that `src/gpu/shaders.rs` includes, and the
//! structs of their arguments that `src/gpu/arguments.rs` includes.
//!
//! With the feature `compile-shaders`, shaderc compiles the sources. Without it, SPIR-V is taken from the folder `spirv/`, which
//! the published package has and this repository does not.

#[cfg(feature = "compile-shaders")]
#[path = "build/arguments.rs"]
mod arguments;
#[cfg(feature = "compile-shaders")]
#[path = "build/by_table.rs"]
mod by_table;
#[cfg(feature = "compile-shaders")]
#[path = "build/compile.rs"]
mod compile;
#[cfg(feature = "compile-shaders")]
#[path = "build/kept.rs"]
mod kept;
#[cfg(feature = "compile-shaders")]
#[path = "build/memory_model.rs"]
mod memory_model;
#[cfg(feature = "compile-shaders")]
#[path = "build/push_constants.rs"]
mod push_constants;
#[cfg(feature = "compile-shaders")]
#[path = "build/reflection.rs"]
mod reflection;
#[path = "build/table.rs"]
mod table;

#[cfg(feature = "compile-shaders")]
fn main() {
    println!("cargo:rerun-if-changed=build");
    let compiler = compile::Compiler { roots: &["glsl"] };
    let names = table::write(|source, file| compiler.make(source, file));
    arguments::write(&names);
    compiler.other("examples/engine.comp", "example_engine.spv");
}

#[cfg(not(feature = "compile-shaders"))]
fn main() {
    println!("cargo:rerun-if-changed=spirv");
    table::write(|_, file| {
        copy(file);
        table::file_by_table(file).iter().for_each(|file| copy(file));
    });
    copy("arguments.rs");
}

/// Copies a file of `spirv/`: the target folder may outlive the sources, or meet them again in another place.
#[cfg(not(feature = "compile-shaders"))]
fn copy(file: &str) {
    let root = std::env::var("CARGO_MANIFEST_DIR").expect("cargo sets CARGO_MANIFEST_DIR");
    let from = std::path::Path::new(&root).join("spirv").join(file);
    std::fs::copy(&from, table::out_dir().join(file)).unwrap_or_else(|error| {
        panic!(
            "{}: {error}. The repository has no compiled shaders: build with `--features compile-shaders` (needs cmake and a \
             C++ compiler), or take the package that `make package` writes",
            from.display()
        )
    });
}
