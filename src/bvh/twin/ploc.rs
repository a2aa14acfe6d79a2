//! PLOC, plainly: neighbours in a window of the sorted order that are each other's nearest become one, until one is left.
//!
//! Meister and Bittner 2018, "Parallel Locally-Ordered Clustering for Bounding Volume Hierarchy Construction". What it leaves
//! open is settled so that the tree does not depend on who runs it:
//!
//! - Where all distances are equal, or boxes grow from each cluster to the next, everyone's nearest is the one before, and only
//!   the first two merge. So once rounds have looked at 16 clusters a primitive and 131 072 more, a round of n in which fewer
//!   than n/16 fall away is followed by a *forced* one: beside the pairs of before, 2k and 2k + 1 merge wherever neither is in
//!   a pair. That leaves at most three quarters of them. Rounds forced wherever one is slow have cost a bathroom
//!   (salle_de_bain), whose last 2000 clusters take 170 rounds, 37%.
//!
//! Distances, ties and slots: `clusters.rs`.

use super::clusters::{Cluster, merged, nearest};
use crate::bvh::layout::{Bvh2, Record};

/// Clusters that rounds may look at before merges are forced: this many per primitive, and a fixed number.
const LOOKS: [usize; 2] = [16, 1 << 17];
/// A round is slow if fewer than one in this many clusters merges.
const SLOW: usize = 16;

/// The tree that PLOC builds over the records of `sorted`, in which every leaf has one record: any LBVH that is not collapsed.
/// `radius`, at least 1, is how many neighbours on either side are looked at. [`Bvh2::collapsed`] finishes it: the header's
/// costs are zero, and the tree may be deeper than tracers can walk.
pub fn build<R: Record>(sorted: &Bvh2<R>, radius: usize) -> Bvh2<R> {
    let mut tree = sorted.without_nodes();
    let scale = tree.header.area_scale;
    let mut clusters: Vec<_> = sorted.leaf_children().into_iter().map(Cluster::of_leaf).collect();
    let most_looks = LOOKS[0] * clusters.len() + LOOKS[1];
    let (mut looks, mut is_forced) = (0, false);
    while clusters.len() > 1 {
        let count = clusters.len();
        let nearest = nearest(&clusters, radius, scale);
        let in_pair = |i: usize| nearest[nearest[i]] == i;
        let partner = |i: usize| match i ^ 1 {
            _ if in_pair(i) => Some(nearest[i]),
            other if is_forced && other < count && !in_pair(other) => Some(other),
            _ => None,
        };
        clusters = merged(&clusters, partner, &mut tree.nodes);
        looks += count;
        is_forced = looks > most_looks && SLOW * (count - clusters.len()) < count;
    }
    if let Some(root) = clusters.first() {
        tree.header.root = root.child;
    }
    tree.header.inner_nodes = tree.header.active.saturating_sub(1);
    tree
}
