//! The tree that [`crate::kdtree::builder`] builds: by bins, and exactly in cells of few references.

use super::{InTurn, binned, grown};
use crate::Result;
use crate::bvh::twin::geometry::Corners;
use crate::bvh::twin::lbvh;
use crate::kdtree::builder::KdOptions;
use crate::kdtree::layout::KdTree;

/// Builds the kd-tree of `triangles` over `positions`. Triangles that are not finite or name vertices that are not there are
/// left out, and the status says so. Of the options it takes the bins, the exact splits and the costs.
///
/// # Errors
/// [`crate::Error::Argument`] if there would be more nodes or references than the layout can name.
pub fn build(positions: &[[f32; 3]], triangles: &[[u32; 3]], options: &KdOptions) -> Result<KdTree> {
    build_corners(lbvh::corners(positions, triangles), options)
}

/// The same of triangles that [`HostGeometry::corners`](crate::bvh::twin::geometry::HostGeometry::corners) read.
///
/// # Errors
/// As [`build`].
pub fn build_corners(corners: impl Iterator<Item = Corners>, options: &KdOptions) -> Result<KdTree> {
    grown(corners, options.costs, |heuristic, records, cell, references| {
        binned::build(&InTurn, heuristic, records, (options.bins, options.exact), cell, references)
    })
}
