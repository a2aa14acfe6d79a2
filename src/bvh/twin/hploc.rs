//! H-PLOC, plainly: PLOC within each node of the radix tree, bottom-up, with half a window of clusters left for the parent.
//!
//! Benthin, Meister, Barczak, Mehalwal, Tsakok, Kensler 2024, "H-PLOC: Hierarchical Parallel Locally-Ordered Clustering for
//! Bounding Volume Hierarchy Construction". There the window is as wide as a subgroup; here it is what it is given as, so that
//! the tree is the same on every device. Distances, ties and slots: `clusters.rs`.

use super::clusters::{Cluster, merged, nearest, number};
use crate::bvh::hploc::Window;
use crate::bvh::layout::{Bvh2, Child, Node, Record};

/// The tree that H-PLOC builds over the records of `radix`, the LBVH that is not collapsed. [`Bvh2::collapsed`] finishes it:
/// the header's costs are zero, and the tree may be deeper than tracers can walk.
pub fn build<R: Record>(radix: &Bvh2<R>, window: Window) -> Bvh2<R> {
    let mut tree = radix.without_nodes();
    if radix.header.active > 0 {
        let mut build = Build { radix, window, scale: tree.header.area_scale, nodes: &mut tree.nodes };
        tree.header.root = build.clusters_of(radix.header.root, 1)[0].child;
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
    /// The clusters that a node of the radix tree leaves for its parent, at most `most`.
    fn clusters_of(&mut self, child: Child, most: usize) -> Vec<Cluster> {
        if child.is_leaf() {
            return vec![Cluster::of_leaf(child)];
        }
        let [left, right] = self.radix.nodes[child.index as usize].children;
        let half = self.window.size as usize / 2;
        let mut clusters = self.clusters_of(left, half);
        clusters.extend(self.clusters_of(right, half));
        self.merge_down_to(most, &mut clusters);
        clusters
    }

    /// Rounds of PLOC until at most `most` clusters are left.
    fn merge_down_to(&mut self, most: usize, clusters: &mut Vec<Cluster>) {
        number(clusters);
        while clusters.len() > most {
            let nearest = nearest(clusters, self.window.radius as usize, self.scale);
            let partner = |i: usize| Some(nearest[i]).filter(|&j| nearest[j] == i);
            *clusters = merged(clusters, partner, self.nodes);
        }
    }
}
