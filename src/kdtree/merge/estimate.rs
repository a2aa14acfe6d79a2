//! What a merge goes by, and what it needed.

use crate::bvh::layout::status;
use crate::kdtree::builder;
use bytemuck::{Pod, Zeroable};

/// How to merge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MergeOptions {
    /// Bins, exact splits and costs of what is built in leaves, the schedule and its workgroups; the rest is not looked at.
    pub build: builder::KdOptions,
    /// What the memory goes by.
    pub estimate: MergeEstimate,
}

impl MergeOptions {
    /// The builder's, and memory for objects about as dense as what they are put into.
    pub const DEFAULT: MergeOptions =
        MergeOptions { build: builder::KdOptions::DEFAULT, estimate: MergeEstimate::DEFAULT };
}

/// How much a merge has, of each triangle of objects, and of 64 more. [`MergeReport::estimate`] makes one that suffices.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MergeEstimate {
    /// Leaves of the static tree that it is in; where its object has a tree, once for each leaf of that one there.
    pub pairs: f32,
    /// Nodes of objects' trees on their way down the static one, in the step that has most, or leaves of them in its leaves; 0
    /// where no object has a tree.
    pub items: f32,
    /// Leaves of the static tree that any is in.
    pub marked: f32,
    /// As a build has them, with what was in those leaves before.
    pub build: builder::KdEstimate,
}

impl MergeEstimate {
    /// For objects of which nothing is known, but that none has a tree.
    pub const DEFAULT: MergeEstimate = MergeEstimate {
        pairs: 8.0,
        items: 0.0,
        marked: 4.0,
        build: builder::KdEstimate {
            level_references: 24.0,
            level_nodes: 4.0,
            subtree_nodes: 12.0,
            cut_references: 32.0,
            subtree_references: 48.0,
            subtrees: 4.0,
            arena: 0.0,
        },
    };
    /// The same for objects with trees.
    pub const WITH_TREES: MergeEstimate = MergeEstimate { pairs: 20.0, items: 4.0, ..MergeEstimate::DEFAULT };
}

/// What a merge needed, in the scratch memory at [`Merger::report_range`](super::Merger::report_range) when it has run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct MergeReport {
    /// Bits of [`crate::bvh::layout::status`].
    pub status: u32,
    /// Pairs of a static leaf and a triangle; of objects with trees, before those are left out that are there twice.
    pub pairs: u32,
    /// Static leaves.
    pub marked: u32,
    /// References of these leaves and of the triangles in them, as far as pairs and leaves had room.
    pub first_references: u32,
    /// As [`builder::KdReport`] has it.
    pub level_references: u32,
    /// Nodes of all levels, and what is hooked.
    pub level_nodes: u32,
    /// As [`builder::KdReport`] has it.
    pub subtree_nodes: u32,
    /// As [`builder::KdReport`] has it.
    pub cut_references: u32,
    /// As [`builder::KdReport`] has it.
    pub subtree_references: u32,
    /// As [`builder::KdReport`] has it.
    pub subtrees: u32,
    /// As [`builder::KdReport`] has it.
    pub ended: u32,
    /// Nodes of objects' trees on their way, in the step that has most, or leaves of them in static leaves.
    pub items: u32,
    /// The step that found no room for all of them, and 1 more, or 0. What there would have been below is not known.
    pub items_ended: u32,
}

impl MergeReport {
    /// What suffices for this many triangles of objects; twice what was asked for if the merge could not find out.
    pub fn estimate(&self, triangles: u32) -> MergeEstimate {
        let is_known = self.status & status::OUT_OF_ROOM == 0;
        let of = |count: u32, more: f64| (f64::from(count) * more / f64::from(triangles.saturating_add(64))) as f32;
        let exactly = |count: u32| of(count, 1.0) * (1.0 + f32::EPSILON);
        let each = |count: u32| if is_known { exactly(count) } else { of(count.max(self.pairs), 2.0) };
        let pushed = |count: u32| if self.items_ended == 0 { exactly(count) } else { of(count.max(triangles), 2.0) };
        MergeEstimate {
            pairs: pushed(self.pairs),
            items: pushed(self.items),
            marked: each(self.marked),
            build: builder::KdEstimate {
                level_references: each(self.level_references),
                level_nodes: each(self.level_nodes),
                subtree_nodes: each(self.subtree_nodes),
                cut_references: each(self.cut_references),
                subtree_references: each(self.subtree_references),
                subtrees: each(self.subtrees),
                arena: 0.0,
            },
        }
    }
}
