//! The table of shaders that `build.rs` writes: one static for each shader below `glsl/`, named after its path. A program that
//! reaches a shader has it linked, and no other; [`ALL`] reaches them all, and is for tests.

use super::arguments::takes;
use std::fmt;
use std::hash::{Hash, Hasher};

/// One shader: all of [`ALL`] are compute shaders. Two of one name are the same.
pub struct Shader {
    /// Path below `glsl/`, without extension.
    pub name: &'static str,
    /// SPIR-V, little-endian words as bytes.
    pub spirv: &'static [u8],
    /// The same of one that one workgroup runs, for many of them: its push constants are the address of a table, and workgroup i takes row i
    /// (build/by_table.rs).
    pub by_table: Option<&'static [u8]>,
    /// What it takes of the block of push constants that its source declares.
    pub takes: Takes,
}

/// Its name: its code is up to megabytes, and options that are printed have shaders.
impl fmt::Debug for Shader {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Shader").field(&self.name).finish()
    }
}

/// What a shader takes.
#[derive(Debug)]
pub struct Takes {
    /// The [`Block::NAME`] of the block that it declares; empty where it declares none.
    pub block: &'static str,
    /// Where in the block the members lie that it reads: offsets and lengths, in bytes.
    pub ranges: &'static [(u32, u32)],
}

/// A block of push constants, as shaders declare it.
pub trait Block: bytemuck::Pod {
    /// Its name, without the ending `Arguments`.
    const NAME: &'static str;
}

impl Takes {
    /// The push constants of the shader: what it takes of `block`.
    ///
    /// # Panics
    /// The shader declares another block.
    pub fn of<B: Block>(&self, block: &B) -> Vec<u8> {
        assert_eq!(self.block, B::NAME, "a pass is given the arguments of another");
        let bytes = bytemuck::bytes_of(block);
        self.ranges.iter().flat_map(|&(at, length)| &bytes[at as usize..][..length as usize]).copied().collect()
    }
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

#[cfg(test)]
mod tests {
    use super::ALL;

    #[test]
    fn shaders_are_printed_without_their_code() {
        assert!(ALL.iter().all(|shader| format!("{shader:?}") == format!("Shader(\"{}\")", shader.name)));
    }
}
