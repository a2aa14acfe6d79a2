//! What a wide tree costs: a walk on the host.

use super::layout::{Wide, WideNode};
use crate::bvh::layout::Record;
use crate::bvh::quality::Quality;
use crate::geometry::Aabb;

/// The quality of a wide tree, with c_t the cost of a step: of visiting one wide node, whatever its width, for it tests the boxes
/// of all its children. So figures of different widths compare numbers of visits, not times.
///
/// Boxes are those that tracers see: of quantised nodes a little larger than what is in them. A long leaf costs a step beside
/// its tests. An empty tree has zeros.
pub fn on_host<N: WideNode, R: Record>(tree: &Wide<N, R>, c_t: f64, c_i: f64) -> Quality {
    let mut quality = Quality::default();
    if tree.header.active == 0 {
        return quality;
    }
    let area = |b: &Aabb| {
        let [x, y, z]: [f64; 3] = std::array::from_fn(|i| f64::from(b.hi[i]) - f64::from(b.lo[i]));
        x * y + y * z + z * x
    };
    let root = area(&tree.header.root.bounds());
    let (mut leaf_area, mut depths) = (0.0, 0u64);
    let mut leaf = |quality: &mut Quality, area: f64, count: u32, depth: u32| {
        leaf_area += area * f64::from(count);
        quality.leaves += 1;
        quality.refs += u64::from(count);
        quality.leaf_max = quality.leaf_max.max(count);
        quality.depth_max = quality.depth_max.max(depth);
        depths += u64::from(depth);
    };
    let mut inner_area = 0.0;
    let mut stack = vec![(0u32, root, 0u32)];
    while let Some((index, node_area, depth)) = stack.pop() {
        let node = &tree.nodes[index as usize];
        quality.inner += 1;
        inner_area += node_area;
        if let Some((first, count)) = node.long_leaf() {
            leaf(&mut quality, node_area, tree.leaf(first, count).len() as u32, depth);
        }
        for child in node.children().iter().flatten() {
            let area = area(&child.bounds());
            if child.is_leaf() {
                leaf(&mut quality, area, tree.leaf(child.index, child.count).len() as u32, depth + 1);
            } else {
                stack.push((child.index, area, depth + 1));
            }
        }
    }
    quality.set_cost([inner_area, leaf_area], root, [c_t, c_i]);
    quality.depth_avg = depths as f64 / quality.leaves as f64;
    quality
}
