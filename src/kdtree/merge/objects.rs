//! What is merged, and the list of it.

use crate::bvh::geometry::Input;
use crate::{Error, Result};

/// An object that moves: triangles that a merge puts into the static tree.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Object {
    /// One geometry.
    pub input: Input,
    /// What hits of its first triangle say; behind those of the static tree, and apart from those of other objects.
    pub first_primitive: u32,
    /// The address of a kd-tree of the same triangles as they now are, its primitives numbered from 0 on, in memory of the
    /// caller, who makes it visible to compute shaders as the input is: [`crate::kdtree::builder`] builds one. It is pushed
    /// down the static tree ("merging on the GPU", Papay 2025, section 10.3). Without one the triangles find their leaves each
    /// by itself.
    pub tree: Option<u64>,
}

/// The objects that the tree should hold, by name.
#[derive(Debug, Clone, Default)]
pub struct Objects {
    named: Vec<(String, Object)>,
}

impl Objects {
    /// Inserts an object.
    ///
    /// # Errors
    /// [`Error::Argument`] if one has this name.
    pub fn insert(&mut self, name: &str, object: Object) -> Result<()> {
        if self.named.iter().any(|(other, _)| other == name) {
            return Err(Error::Argument(format!("{name:?} is in the tree already; take it out first")));
        }
        self.named.push((name.to_owned(), object));
        Ok(())
    }

    /// Removes an object.
    ///
    /// # Errors
    /// [`Error::Argument`] if none has this name, with the names of those that are there.
    pub fn take_out(&mut self, name: &str) -> Result<Object> {
        match self.named.iter().position(|(other, _)| other == name) {
            Some(at) => Ok(self.named.remove(at).1),
            None => {
                let names: Vec<&str> = self.named.iter().map(|(name, _)| name.as_str()).collect();
                let there = if names.is_empty() { "nothing".to_owned() } else { names.join(", ") };
                Err(Error::Argument(format!("{name:?} was never inserted or is out again; in the tree is {there}")))
            }
        }
    }

    /// The list of objects for [`Merger::record`](super::Merger::record).
    pub fn list(&self) -> Vec<Object> {
        self.named.iter().map(|(_, object)| *object).collect()
    }
}
