//! H-PLOC, plainly: PLOC within each node of the radix tree, bottom-up, with half a window of clusters left for the parent.
//!
//! Benthin, Meister, Barczak, Mehalwal, Tsakok, Kensler 2024, "H-PLOC: Hierarchical Parallel Locally-Ordered Clustering for
//! Bounding Volume Hierarchy Construction". There the window is as wide as a subgroup; here it is what it is given as, so that
//! the tree is the same on every device. Distances, ties and slots are those of PLOC.

use crate::bvh::layout::{Bvh2, Child, Node, Record};

/// How many clusters are merged at a time, and how far each looks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Window {
    /// Clusters of a window: half of it from each child of the radix tree's node, at most. Even.
    pub size: usize,
    /// Neighbours on either side that a cluster looks at.
    pub radius: usize,
}

#[derive(Clone, Copy)]
struct Cluster {
    child: Child,
    /// The position of its first primitive.
    representative: u32,
}

/// The tree that H-PLOC builds over the records of `radix`, the LBVH that is not collapsed. [`Bvh2::collapsed`] finishes it:
/// the header's costs are zero, and the tree may be deeper than tracers can walk.
pub fn build<R: Record>(radix: &Bvh2<R>, window: Window) -> Bvh2<R> {
    let mut tree = radix.without_nodes();
    if radix.header.active > 0 {
        let mut build = Build { radix, window, scale: tree.header.area_scale, nodes: &mut tree.nodes };
        let mut clusters = build.clusters_of(radix.header.root);
        build.merge_down_to(1, &mut clusters);
        tree.header.root = clusters[0].child;
    }
    tree.header.inner_nodes = tree.header.active.saturating_sub(1);
    tree
}

struct Build<'a, R: Record> {
    radix: &'a Bvh2<R>,
    window: Window,
    scale: f32,
    nodes: &'a mut [Node],
}

impl<R: Record> Build<'_, R> {
    /// The clusters that a node of the radix tree leaves for its parent.
    fn clusters_of(&mut self, child: Child) -> Vec<Cluster> {
        if child.is_leaf() {
            return vec![Cluster { child, representative: child.index }];
        }
        let [left, right] = self.radix.nodes[child.index as usize].children;
        let mut clusters = self.clusters_of(left);
        clusters.extend(self.clusters_of(right));
        self.merge_down_to(self.window.size / 2, &mut clusters);
        clusters
    }

    /// Rounds of PLOC until so many clusters are left, at most.
    fn merge_down_to(&mut self, most: usize, clusters: &mut Vec<Cluster>) {
        while clusters.len() > most {
            let nearest: Vec<usize> = (0..clusters.len()).map(|i| self.nearest(clusters, i)).collect();
            let mut next = Vec::with_capacity(clusters.len());
            for (i, &cluster) in clusters.iter().enumerate() {
                let j = nearest[i];
                match (nearest[j] == i, i < j) {
                    (false, _) => next.push(cluster),
                    (true, true) => next.push(self.merged(&cluster, &clusters[j])),
                    (true, false) => {}
                }
            }
            *clusters = next;
        }
    }

    fn nearest(&self, clusters: &[Cluster], i: usize) -> usize {
        let bounds = clusters[i].child.bounds();
        let mut best = (f32::INFINITY, i);
        let within = i.saturating_sub(self.window.radius)..(i + self.window.radius + 1).min(clusters.len());
        for j in within.filter(|&j| j != i) {
            let distance = bounds.union(&clusters[j].child.bounds()).scaled_half_area(self.scale);
            if distance < best.0 {
                best = (distance, j);
            }
        }
        best.1
    }

    fn merged(&mut self, left: &Cluster, right: &Cluster) -> Cluster {
        let bounds = left.child.bounds().union(&right.child.bounds());
        let slot = right.representative - 1;
        self.nodes[slot as usize] = Node { children: [left.child, right.child] };
        let child = Child { lo: bounds.lo, index: slot, hi: bounds.hi, count: 0 };
        Cluster { child, representative: left.representative }
    }
}
