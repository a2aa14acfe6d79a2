//! The table of shaders that `build.rs` writes: one static for each shader below `glsl/`, named after its path. A program that
//! reaches a shader has it linked, and no other; [`ALL`] reaches them all, and is for tests.

use std::hash::{Hash, Hasher};

/// One shader: all of [`ALL`] are compute shaders. Two of one name are the same.
#[derive(Debug)]
pub struct Shader {
    /// Path below `glsl/`, without extension.
    pub name: &'static str,
    /// SPIR-V, little-endian words as bytes.
    pub spirv: &'static [u8],
}

impl PartialEq for Shader {
    fn eq(&self, other: &Shader) -> bool {
        self.name == other.name
    }
}

impl Eq for Shader {}

impl Hash for Shader {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.name.hash(state);
    }
}

include!(concat!(env!("OUT_DIR"), "/shaders.rs"));
