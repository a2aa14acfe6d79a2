//! Quality of a tree, by a walk over it.

use crate::bvh::layout::{Bvh2, Record};
use crate::bvh::quality::Quality;

/// The quality of `tree` with these costs of a step and of a test. An empty tree has zeros.
pub fn of<R: Record>(tree: &Bvh2<R>, c_t: f64, c_i: f64) -> Quality {
    let mut quality = Quality::default();
    if tree.header.active == 0 {
        return quality;
    }
    let area = |lo: [f32; 3], hi: [f32; 3]| {
        let [x, y, z]: [f64; 3] = std::array::from_fn(|i| f64::from(hi[i]) - f64::from(lo[i]));
        x * y + y * z + z * x
    };
    let mut stack = vec![(tree.header.root, 0u32)];
    let (mut inner_area, mut leaf_area, mut depths) = (0.0, 0.0, 0u64);
    while let Some((child, depth)) = stack.pop() {
        let area = area(child.lo, child.hi);
        if child.is_leaf() {
            leaf_area += area * f64::from(child.count);
            quality.leaves += 1;
            quality.refs += u64::from(child.count);
            quality.leaf_max = quality.leaf_max.max(child.count);
            quality.depth_max = quality.depth_max.max(depth);
            depths += u64::from(depth);
        } else {
            inner_area += area;
            quality.inner += 1;
            stack.extend(tree.nodes[child.index as usize].children.map(|c| (c, depth + 1)));
        }
    }
    let root = area(tree.header.root.lo, tree.header.root.hi);
    quality.set_cost([inner_area, leaf_area], root, [c_t, c_i]);
    quality.depth_avg = depths as f64 / quality.leaves as f64;
    quality
}
