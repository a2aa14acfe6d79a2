//! Quality of a kd-tree: SAH cost, depth and leaf statistics, by a walk on the host.

use super::layout::{KdContent, KdTree};
use crate::bvh::quality::Quality;
use crate::geometry::Aabb;

/// The quality of `tree` with these costs of a step and of a test. Areas are those of the cells; empty leaves count in the mean
/// depth. An empty tree has one empty leaf and costs nothing.
pub fn on_host(tree: &KdTree, c_t: f64, c_i: f64) -> Quality {
    let mut quality = Quality::default();
    let mut depths = 0u64;
    let mut leaf = |quality: &mut Quality, depth: u32, count: u32| {
        quality.leaves += 1;
        quality.empty_leaves += u64::from(count == 0);
        quality.refs += u64::from(count);
        quality.leaf_max = quality.leaf_max.max(count);
        quality.depth_max = quality.depth_max.max(depth);
        depths += u64::from(depth);
    };
    let (mut inner_area, mut leaf_area) = (0.0, 0.0);
    let root = tree.header.cell();
    let mut stack = vec![((!tree.nodes.is_empty()).then_some(0), root, 0)];
    while let Some((node, cell, depth)) = stack.pop() {
        let Some(node) = node else {
            leaf(&mut quality, depth, 0);
            continue;
        };
        match tree.nodes[node as usize].content() {
            KdContent::Leaf(range) => {
                leaf_area += half_area(&cell) * range.len() as f64;
                leaf(&mut quality, depth, range.len() as u32);
            }
            KdContent::Inner(inner) => {
                inner_area += half_area(&cell);
                quality.inner += 1;
                let [left, right] = inner.halves(&cell);
                stack.push((inner.children[1], right, depth + 1));
                stack.push((inner.children[0], left, depth + 1));
            }
        }
    }
    quality.set_cost([inner_area, leaf_area], half_area(&root), [c_t, c_i]);
    quality.depth_avg = depths as f64 / quality.leaves as f64;
    quality
}

fn half_area(cell: &Aabb) -> f64 {
    let [x, y, z]: [f64; 3] = std::array::from_fn(|i| f64::from(cell.hi[i]) - f64::from(cell.lo[i]));
    if x < 0.0 { 0.0 } else { x * y + y * z + z * x }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kdtree::layout::{KdHeader, KdNode};
    use bytemuck::Zeroable;

    #[test]
    fn the_cost_of_a_tree_of_three_leaves_is_that_of_its_areas() {
        // A cube of edge 2, cut in the middle along x; its right half is cut again along y, where the lower part is empty.
        let header = KdHeader { lo: [0.0; 3], hi: [2.0; 3], ..KdHeader::zeroed() };
        let nodes = vec![
            KdNode::inner(0, 1.0, 1, [false, false]),
            KdNode::leaf(0, 3),
            KdNode::inner(1, 0.5, 3, [true, false]),
            KdNode::leaf(3, 1),
        ];
        let tree = KdTree { header, nodes, references: vec![0, 1, 2, 0], records: Vec::new(), geometries: Vec::new() };
        let quality = on_host(&tree, 3.0, 2.0);
        // Half areas: 12 the root, 8 a half, 1·1.5 + 1.5·2 + 2·1 = 6.5 the upper part.
        let (inner, leaf) = ((12.0 + 8.0) / 12.0, (3.0 * 8.0 + 6.5) / 12.0);
        assert!((quality.sah_inner - inner).abs() + (quality.sah_leaf - leaf).abs() < 1e-12, "{quality:?}");
        assert_eq!(quality.sah, 3.0 * quality.sah_inner + 2.0 * quality.sah_leaf);
        let expected = Quality {
            sah: quality.sah,
            sah_inner: quality.sah_inner,
            sah_leaf: quality.sah_leaf,
            inner: 2,
            leaves: 3,
            empty_leaves: 1,
            refs: 4,
            leaf_max: 3,
            depth_avg: 5.0 / 3.0,
            depth_max: 2,
        };
        assert_eq!(quality, expected);
        assert_eq!(quality.prims_per_leaf(), 2.0);
    }
}
