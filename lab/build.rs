//! Makes SPIR-V of the laboratory's own shaders, the table that `src/shaders.rs` includes, and the structs of
//! their arguments that `src/arguments.rs` includes.

#[path = "../build/arguments.rs"]
mod arguments;
#[path = "../build/by_table.rs"]
mod by_table;
#[path = "../build/compile.rs"]
mod compile;
#[path = "../build/kept.rs"]
mod kept;
#[path = "../build/memory_model.rs"]
mod memory_model;
#[path = "../build/push_constants.rs"]
mod push_constants;
#[path = "../build/reflection.rs"]
mod reflection;
#[path = "../build/table.rs"]
mod table;

fn main() {
    println!("cargo:rerun-if-changed=../build");
    println!("cargo:rerun-if-changed=../glsl");
    let compiler = compile::Compiler { roots: &["glsl", "../glsl"] };
    let names = table::write(|source, file| compiler.make(source, file));
    arguments::write(&names);
}
