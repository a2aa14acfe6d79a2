//! PLOC, plainly: neighbours in a window of the sorted order that are each other's nearest become one, until one is left.
//!
//! Meister and Bittner 2018, "Parallel Locally-Ordered Clustering for Bounding Volume Hierarchy Construction". What it leaves
//! open is settled so that the tree does not depend on who runs it:
//!
//! - The distance of two clusters is the half area of the box around both, in `f32` ([`Aabb::scaled_half_area`]); of clusters at
//!   the same distance the one before the others is the nearest.
//! - Of two that merge, the one before is the left child, and its place is that of the new cluster. The node is in the slot
//!   before the position of the right child's first primitive, which no other node can have.
//! - Where all distances are equal, only the first two merge. So a round of n clusters in which fewer than n/16 fell away is
//!   followed by a *forced* one: beside the pairs of before, 2k and 2k + 1 merge wherever neither is in a pair. That leaves at
//!   most three quarters of them.
//!
//! [`Aabb::scaled_half_area`]: crate::bvh::layout::Aabb::scaled_half_area

use crate::bvh::layout::{Bvh2, Child, Node, Record};

/// Of a round's clusters, one in so many falls away, or the next round is forced.
const SLOW: usize = 16;

#[derive(Clone, Copy)]
struct Cluster {
    child: Child,
    /// The position of its first primitive.
    representative: u32,
}

/// The tree that PLOC builds over the records of `sorted`, in which every leaf has one record: any LBVH that is not collapsed.
/// `radius`, at least 1, is how many neighbours on either side are looked at. [`Bvh2::collapsed`] finishes it: the header's
/// costs are zero, and the tree may be deeper than tracers can walk.
pub fn build<R: Record>(sorted: &Bvh2<R>, radius: usize) -> Bvh2<R> {
    let mut tree = sorted.without_nodes();
    let scale = tree.header.area_scale;
    let leaves = sorted.leaf_children().into_iter();
    let mut clusters: Vec<_> = leaves.map(|child| Cluster { child, representative: child.index }).collect();
    let mut is_forced = false;
    while clusters.len() > 1 {
        let count = clusters.len();
        let nearest: Vec<usize> = (0..count).map(|i| nearest(&clusters, i, radius, scale)).collect();
        let in_pair = |i: usize| nearest[nearest[i]] == i;
        let partner = |i: usize| match i ^ 1 {
            _ if in_pair(i) => Some(nearest[i]),
            other if is_forced && other < count && !in_pair(other) => Some(other),
            _ => None,
        };
        let mut next = Vec::with_capacity(count);
        for (i, &cluster) in clusters.iter().enumerate() {
            match partner(i) {
                None => next.push(cluster),
                Some(j) if i < j => next.push(merged(&cluster, &clusters[j], &mut tree.nodes)),
                Some(_) => {}
            }
        }
        is_forced = SLOW * (count - next.len()) < count;
        clusters = next;
    }
    if let Some(root) = clusters.first() {
        tree.header.root = root.child;
    }
    tree.header.inner_nodes = tree.header.active.saturating_sub(1);
    tree
}

/// The cluster nearest to the one at `i`.
fn nearest(clusters: &[Cluster], i: usize, radius: usize, scale: f32) -> usize {
    let bounds = clusters[i].child.bounds();
    let mut best = (f32::INFINITY, i);
    let window = i.saturating_sub(radius)..(i + radius + 1).min(clusters.len());
    for j in window.filter(|&j| j != i) {
        let distance = bounds.union(&clusters[j].child.bounds()).scaled_half_area(scale);
        if distance < best.0 {
            best = (distance, j);
        }
    }
    best.1
}

fn merged(left: &Cluster, right: &Cluster, nodes: &mut [Node]) -> Cluster {
    let bounds = left.child.bounds().union(&right.child.bounds());
    let slot = right.representative - 1;
    nodes[slot as usize] = Node { children: [left.child, right.child] };
    let child = Child { lo: bounds.lo, index: slot, hi: bounds.hi, count: 0 };
    Cluster { child, representative: left.representative }
}
