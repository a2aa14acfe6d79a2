//! How badly a node divides what is below it, and the choice of the worst nodes.
//!
//! Bittner, Hapala, Havran 2013, section 3.3; Frantál 2019, equations 9 to 12.

use super::InsertionTree;
use crate::bvh::ALONE;
use crate::bvh::bounds::half_areas;
use rayon::prelude::*;

/// A measure of inefficiency: a node N is the worse the larger it is. SA are areas, c the children of N.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Inefficiency {
    /// M_SUM = SA(N) over the mean of SA(c): children far apart.
    Sum,
    /// M_MIN = SA(N) over the least of SA(c): children of different sizes.
    Min,
    /// M_AREA = SA(N): what rays often meet.
    Area,
    /// M_COMB, the product of the others.
    Combined,
}

/// A child's area counts as this part of its parent's at least: points and segments would be infinitely bad for ever.
const LEAST_PART: f32 = 1.0 / (1 << 20) as f32;

impl Inefficiency {
    /// Of a node with this area and children of these.
    #[inline(always)]
    fn of(self, area: f32, [left, right]: [f32; 2]) -> f32 {
        let least = LEAST_PART * area;
        // An area of 0 divided by itself: such a node is as good as it gets.
        let ratio = |child: f32| if area > 0.0 { area / child.max(least) } else { 0.0 };
        match self {
            Inefficiency::Sum => ratio(0.5 * (left + right)),
            Inefficiency::Min => ratio(left.min(right)),
            Inefficiency::Area => area,
            Inefficiency::Combined => area * ratio(0.5 * (left + right)) * ratio(left.min(right)),
        }
    }

    fn of_node(self, tree: &InsertionTree, node: u32) -> f32 {
        let [left, right] = tree.children_of(node).map(|child| child.bounds());
        let both = left.union(right);
        let areas = half_areas([both, left, right, both]);
        self.of(areas.x, [areas.y, areas.z])
    }
}

/// How many of `count` nodes this part is, at least one.
pub(in super::super) fn part_of(count: usize, fraction: f32) -> usize {
    (f64::from(fraction) * count as f64).ceil() as usize
}

/// The worst nodes, and room for finding them.
#[derive(Debug, Default)]
pub(in super::super) struct Selection {
    /// In the upper half what is less for a worse node, in the lower one the node.
    keys: Vec<u64>,
}

impl Selection {
    /// The worst of all nodes, the worst first.
    pub fn worst(
        &mut self,
        tree: &InsertionTree,
        measure: Inefficiency,
        wanted: usize,
    ) -> impl Iterator<Item = u32> + use<'_> {
        self.keys.resize(tree.room(), 0);
        let keys = self.keys.par_iter_mut().enumerate().with_min_len(ALONE);
        keys.for_each(|(node, key)| *key = key_of(tree, measure, node as u32));
        self.first(wanted)
    }

    /// The worst of `nodes`, the worst first.
    pub fn worst_of(
        &mut self,
        tree: &InsertionTree,
        measure: Inefficiency,
        nodes: &[u32],
        wanted: usize,
    ) -> impl Iterator<Item = u32> + use<'_> {
        let keys = nodes.par_iter().with_min_len(ALONE).map(|&node| key_of(tree, measure, node));
        keys.collect_into_vec(&mut self.keys);
        self.first(wanted)
    }

    fn first(&mut self, wanted: usize) -> impl Iterator<Item = u32> + use<'_> {
        if wanted < self.keys.len() {
            self.keys.select_nth_unstable(wanted);
            self.keys.truncate(wanted);
        }
        self.keys.sort_unstable();
        self.keys.iter().map(|&key| key as u32)
    }
}

/// No two are equal, so the order is one and the same however it is found.
fn key_of(tree: &InsertionTree, measure: Inefficiency, node: u32) -> u64 {
    u64::from(!measure.of_node(tree, node).to_bits()) << 32 | u64::from(node)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Inefficiency; 4] = [Inefficiency::Sum, Inefficiency::Min, Inefficiency::Area, Inefficiency::Combined];

    #[test]
    fn measures_are_those_of_the_paper() {
        assert_eq!(ALL.map(|measure| measure.of(12.0, [4.0, 2.0])), [4.0, 6.0, 12.0, 288.0]);
    }

    #[test]
    fn measures_are_finite_and_no_node_of_no_area_is_bad() {
        for measure in ALL {
            for (area, children) in [(0.0, [0.0; 2]), (1e-30, [0.0; 2]), (48.0, [0.0; 2]), (48.0, [48.0, 0.0])] {
                let is = measure.of(area, children);
                assert!(is.is_finite() && is >= 0.0, "{measure:?} {area} {children:?}: {is}");
            }
            assert_eq!(measure.of(0.0, [0.0; 2]), 0.0);
        }
    }

    #[test]
    fn a_part_is_one_at_least() {
        assert_eq!([1, 100, 101, 871_413].map(|count| part_of(count, 0.01)), [1, 1, 2, 8715]);
    }
}
