//! Makes SPIR-V of the laboratory's own shaders, and the table that `src/shaders.rs` includes.

#[path = "../build/compile.rs"]
mod compile;
#[path = "../build/shared_memory.rs"]
mod shared_memory;
#[path = "../build/table.rs"]
mod table;

fn main() {
    println!("cargo:rerun-if-changed=../build");
    println!("cargo:rerun-if-changed=../glsl");
    let compiler = compile::Compiler { roots: &["glsl", "../glsl"] };
    table::write(|source, file| compiler.make(source, file));
}
