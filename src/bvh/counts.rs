//! What rays did in a tree, by its links: what traversal is counted in, and what passes that rays teach read.
//!
//! A *link* names a subtree by where it hangs: 2 · slot + side, as in [`super::reinsertion`]. Counts are integers that are added, so
//! they are the same whatever the order of the rays, on every device.

use bytemuck::{Pod, Zeroable};

/// What the rays of a sample did in the subtree at a link. The root, which hangs nowhere, has none.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
pub struct LinkCount {
    /// Rays that went into the subtree.
    pub entered: u32,
    /// Of them, those that met a primitive in it.
    pub hits: u32,
    /// What they cost in it: c_T a step and c_I a test, both taken as whole numbers.
    pub work: u32,
}
