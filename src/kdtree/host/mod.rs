//! Builders of kd-trees on the host: plain, and the specification of those on the device.
//!
//! Every figure that decides is an `f32` in a fixed order of plain operations, every count an integer: the bytes do not depend on
//! how many threads there are.

mod assemble;
mod binned;
mod clip;
mod exact;
mod heuristic;
pub mod marked;
pub mod merge;
mod small;

use super::layout::KdTree;
use super::termination::Costs;
use crate::bvh::host::geometry::{self, Corners};
use crate::bvh::host::lbvh;
use crate::bvh::layout::{Aabb, Triangle};
use crate::{Error, Result};
use clip::{Plane, Reference};
use heuristic::Heuristic;
use rayon::prelude::*;

/// Which planes are looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Planes {
    /// Every face of every box: perfect splits (Wald and Havran 2006).
    Exact,
    /// Between so many bins along each axis (Shevtsov, Soupikov and Kapustin 2007).
    Binned(u32),
    /// The same in cells of more than `exact` references, and every face of every box in the others: what the device builds.
    Mixed {
        /// Bins along each axis.
        bins: u32,
        /// References of a cell below which no bins are taken.
        exact: u32,
    },
}

impl Planes {
    /// Bins unless told. The thesis' number is not in the text that is left of it; 32 is a subgroup's lanes on its device.
    pub const BINS: u32 = 32;
    /// The most bins there may be.
    pub const MAX_BINS: u32 = 1024;
    /// The most there may be: looking at every plane takes time by the square.
    pub const MAX_EXACT: u32 = 64;
}

/// What a build is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Which planes are looked at.
    pub planes: Planes,
    /// The costs by which the best is chosen.
    pub costs: Costs,
}

impl Options {
    /// Perfect splits.
    pub const EXACT: Options = Options { planes: Planes::Exact, costs: Costs::DEFAULT };
    /// Bins.
    pub const BINNED: Options = Options { planes: Planes::Binned(Planes::BINS), costs: Costs::DEFAULT };

    /// # Errors
    /// [`Error::Argument`] names the option that cannot be used, and what can.
    pub fn check(&self) -> Result<()> {
        if !self.check_planes() {
            return Err(Error::Argument(format!(
                "{:?} cannot be used; take 2 to {} bins, and exact splits of at most {} references",
                self.planes,
                Planes::MAX_BINS,
                Planes::MAX_EXACT
            )));
        }
        match [self.costs.c_t, self.costs.c_i].into_iter().find(|&cost| !Costs::check(cost)) {
            Some(cost) => Err(Error::Argument(format!("a cost of {cost} cannot be used; take 0.001 to 1000"))),
            None => Ok(()),
        }
    }

    /// Whether there can be so many bins.
    pub fn check_planes(&self) -> bool {
        match self.planes {
            Planes::Exact => true,
            Planes::Binned(bins) => (2..=Planes::MAX_BINS).contains(&bins),
            Planes::Mixed { bins, exact } => (2..=Planes::MAX_BINS).contains(&bins) && exact <= Planes::MAX_EXACT,
        }
    }
}

/// Builds the kd-tree of `triangles` over `positions`. Triangles that are not finite or name vertices that are not there are
/// left out, and the status says so.
///
/// # Errors
/// [`Error::Argument`] if an option cannot be used; [`Error::Scene`] if there would be more nodes or references than the layout can
/// name.
pub fn build(positions: &[[f32; 3]], triangles: &[[u32; 3]], options: &Options) -> Result<KdTree> {
    build_corners(lbvh::corners(positions, triangles), options)
}

/// The same of triangles that [`HostGeometry::corners`](crate::bvh::host::geometry::HostGeometry::corners) read.
///
/// # Errors
/// As [`build`].
pub fn build_corners(corners: impl Iterator<Item = Corners>, options: &Options) -> Result<KdTree> {
    options.check()?;
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
    let reference = |(record, t): (usize, &Triangle)| Reference {
        bounds: clip::bounds_of(&[t.v0, t.v1, t.v2], reach),
        record: record as u32,
    };
    let references: Vec<Reference> = records.par_iter().enumerate().map(reference).collect();
    let around = |t: &Triangle| clip::cell_around(&[t.v0, t.v1, t.v2], reach);
    let cell = records.iter().fold(Aabb::EMPTY, |b, t| b.union(&around(t)));
    let heuristic = Heuristic::new(options.costs, &cell, primitive_count);
    let root = match options.planes {
        Planes::Exact => exact::build(&heuristic, (&records, reach), cell, references),
        Planes::Binned(bins) => binned::build(&heuristic, (&records, reach), (bins, 0), cell, references),
        Planes::Mixed { bins, exact } => binned::build(&heuristic, (&records, reach), (bins, exact), cell, references),
    };
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
const ALONE: usize = 2048;

/// A cell and all below it.
enum Subtree {
    Empty,
    /// The records, ascending.
    Leaf(Vec<u32>),
    Inner {
        plane: Plane,
        children: Box<[Subtree; 2]>,
    },
    /// One whose nodes lie together, depth first.
    Together(Box<Subtree>),
}

impl Subtree {
    fn leaf(references: &[Reference]) -> Subtree {
        if references.is_empty() {
            return Subtree::Empty;
        }
        Subtree::Leaf(references.iter().map(|reference| reference.record).collect())
    }

    /// Both sides of a plane, each made by a thread of its own if there is work enough.
    fn inner(
        plane: Plane,
        count: usize,
        left: impl FnOnce() -> Subtree + Send,
        right: impl FnOnce() -> Subtree + Send,
    ) -> Subtree {
        let children = if count < ALONE { (left(), right()) } else { rayon::join(left, right) };
        Subtree::Inner { plane, children: Box::new([children.0, children.1]) }
    }
}
