//! kd-trees on the host: plain, and the specification of those on the device.
//!
//! Every figure that decides is an `f32` in a fixed order of plain operations, every count an integer: the bytes do not depend on
//! how many threads there are. Builders for the CPU (`hedgerow-host`) stand on the same cells, costs and bytes, and bring threads
//! by a [`Fork`].

#[doc(hidden)]
pub mod assemble;
#[doc(hidden)]
pub mod binned;
pub mod builder;
#[doc(hidden)]
pub mod clip;
#[doc(hidden)]
pub mod heuristic;
pub mod merge;
mod small;

use super::layout::KdTree;
use super::termination::Costs;
use crate::Result;
use crate::bvh::layout::Triangle;
use crate::bvh::twin::geometry::{self, Corners};
use crate::geometry::Aabb;
use clip::{KdPlane, KdReference};
use heuristic::Heuristic;

/// How the work on two sides of a plane, or along several axes, is shared out.
pub trait Fork: Sync {
    /// The results of both.
    fn join<A: Send, B: Send>(&self, a: impl FnOnce() -> A + Send, b: impl FnOnce() -> B + Send) -> (A, B);

    /// The results of `of` along each axis.
    fn axes<T: Send>(&self, of: impl Fn(usize) -> T + Sync) -> [T; 3] {
        let (x, (y, z)) = self.join(|| of(0), || self.join(|| of(1), || of(2)));
        [x, y, z]
    }
}

/// One after the other.
#[derive(Debug, Clone, Copy)]
pub struct InTurn;

impl Fork for InTurn {
    fn join<A: Send, B: Send>(&self, a: impl FnOnce() -> A + Send, b: impl FnOnce() -> B + Send) -> (A, B) {
        (a(), b())
    }
}

/// What `grow` makes of all triangles that can be used: of their records and what of these has no room, of the root's cell and of
/// the references in it.
///
/// # Errors
/// [`crate::Error::Argument`] if there would be more nodes or references than the layout can name.
pub fn grown(
    corners: impl Iterator<Item = Corners>,
    costs: Costs,
    grow: impl FnOnce(&Heuristic, (&[Triangle], f32), Aabb, Vec<KdReference>) -> Subtree,
) -> Result<KdTree> {
    let (mut status, mut primitive_count) = (0, 0u32);
    let mut records = Vec::new();
    for corners in corners {
        match corners {
            Ok([v0, v1, v2]) => records.push(Triangle { v0, v1, v2, primitive: primitive_count }),
            Err(why) => status |= why,
        }
        primitive_count += 1;
    }
    let reach = clip::reach_of(&records);
    let reference = |(record, t): (usize, &Triangle)| KdReference {
        bounds: clip::bounds_of(&[t.v0, t.v1, t.v2], reach),
        record: record as u32,
    };
    let references: Vec<KdReference> = records.iter().enumerate().map(reference).collect();
    let around = |t: &Triangle| clip::cell_around(&[t.v0, t.v1, t.v2], reach);
    let cell = records.iter().fold(Aabb::EMPTY, |b, t| b.union(&around(t)));
    let heuristic = Heuristic::new(costs, &cell, primitive_count);
    let root = grow(&heuristic, (&records, reach), cell, references);
    assemble::assemble(root, &heuristic, (cell, reach), records, (primitive_count, status))
}

impl KdTree {
    /// The same with the geometries that its primitives are of: how many primitives each has, and its flags.
    pub fn with_geometries(mut self, geometries: &[(u32, u32)]) -> KdTree {
        self.header.geometry_count = geometries.len().max(1) as u32;
        (self.header.geometry_flags, self.geometries) = geometry::table_of(geometries);
        self
    }
}

/// Fewer references than this are not worth another thread.
pub const ALONE: usize = 2048;

/// A cell and all below it.
pub enum Subtree {
    /// Nothing is in it.
    Empty,
    /// The records, ascending.
    Leaf(Vec<u32>),
    /// A cell that a plane divides.
    Inner {
        /// The plane.
        plane: KdPlane,
        /// Both sides.
        children: Box<[Subtree; 2]>,
    },
    /// One whose nodes lie together, depth first.
    Together(Box<Subtree>),
}

impl Subtree {
    /// A leaf of these references, ascending.
    pub fn leaf(references: &[KdReference]) -> Subtree {
        if references.is_empty() {
            return Subtree::Empty;
        }
        Subtree::Leaf(references.iter().map(|reference| reference.record).collect())
    }

    /// Both sides of a plane, shared out by `fork` if there is work enough.
    pub fn inner(
        fork: &impl Fork,
        plane: KdPlane,
        count: usize,
        left: impl FnOnce() -> Subtree + Send,
        right: impl FnOnce() -> Subtree + Send,
    ) -> Subtree {
        let children = if count < ALONE { (left(), right()) } else { fork.join(left, right) };
        Subtree::Inner { plane, children: Box::new([children.0, children.1]) }
    }
}
