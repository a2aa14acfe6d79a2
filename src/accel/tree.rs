//! A structure on the host, in either form of node.

use crate::Result;
use crate::bvh::layout::{Bvh2, Header, Record, header_of};
use crate::bvh::wide::layout::Wide8q;

/// What a build makes: in nodes of two children, or in quantised nodes of eight
/// ([`AccelOptions::wide`](crate::accel::AccelOptions::wide)).
#[derive(Debug, Clone)]
pub enum Tree<R: Record> {
    /// Of nodes of two.
    OfTwo(Bvh2<R>),
    /// Of quantised nodes of eight.
    OfEight(Wide8q<R>),
}

impl<R: Record> Tree<R> {
    /// In the form that is asked for; of a top level with what is far told.
    pub(crate) fn of(tree: Bvh2<R>, is_wide: bool) -> Tree<R> {
        if is_wide { Tree::OfEight(Wide8q::of(&tree)) } else { Tree::OfTwo(tree.with_far_told()) }
    }

    /// Takes a structure's bytes apart; what lies behind them is of no interest.
    ///
    /// # Errors
    /// [`Error::InvalidStructure`](crate::Error::InvalidStructure): they are not those of a structure of such records.
    pub fn from_bytes(bytes: &[u8]) -> Result<Tree<R>> {
        let is_wide = header_of::<Header>(bytes, Wide8q::<R>::KIND).is_ok();
        if is_wide { Wide8q::from_bytes(bytes).map(Tree::OfEight) } else { Bvh2::from_bytes(bytes).map(Tree::OfTwo) }
    }

    /// The structure's bytes, as the device has them.
    pub fn to_bytes(&self) -> Vec<u8> {
        match self {
            Tree::OfTwo(tree) => tree.to_bytes(),
            Tree::OfEight(tree) => tree.to_bytes(),
        }
    }

    /// What a compacting copy makes of it; nodes of eight have no holes.
    #[must_use]
    pub fn compacted(&self) -> Tree<R> {
        match self {
            Tree::OfTwo(tree) => Tree::OfTwo(tree.compacted()),
            Tree::OfEight(_) => self.clone(),
        }
    }

    /// Checks all rules of its form.
    ///
    /// # Errors
    /// [`Error::InvalidStructure`](crate::Error::InvalidStructure): the rule that is broken.
    pub fn validate(&self) -> Result<()> {
        match self {
            Tree::OfTwo(tree) => tree.validate(),
            Tree::OfEight(tree) => tree.validate(),
        }
    }

    /// Its head.
    pub fn header(&self) -> &Header {
        match self {
            Tree::OfTwo(tree) => &tree.header,
            Tree::OfEight(tree) => &tree.header,
        }
    }

    /// What the leaves hold; in nodes of two what no leaf holds lies behind it, in nodes of eight it is not there.
    pub fn records(&self) -> &[R] {
        match self {
            Tree::OfTwo(tree) => &tree.records,
            Tree::OfEight(tree) => &tree.records,
        }
    }
}
