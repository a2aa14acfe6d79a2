//! Peers: what a user would take instead of our builders, behind the same interface and in the same table.

pub mod driver;
#[cfg(feature = "peer-embree")]
pub mod embree;
#[cfg(feature = "peer-embree")]
pub mod embree_tree;
#[cfg(feature = "peer-obvhs")]
pub mod obvhs;
