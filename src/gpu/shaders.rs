//! The table of shaders that `build.rs` writes: one static for each shader below `glsl/`, named after its path.

/// One shader: all of [`ALL`] are compute shaders.
#[derive(Debug)]
pub struct Shader {
    /// Path below `glsl/`, without extension.
    pub name: &'static str,
    /// SPIR-V, little-endian words as bytes.
    pub spirv: &'static [u8],
}

include!(concat!(env!("OUT_DIR"), "/shaders.rs"));
