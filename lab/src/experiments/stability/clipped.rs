//! The SAH cost of a tree as seen from a part of its scene: boxes are clipped to it, and areas are over its own.
//!
//! What rays of that part meet. Nodes over the whole of a scene that has grown count as one of the part's size, not as
//! everything there is, and so a tree is compared with one over the part alone.

use hedgerow::bvh::layout::{Bvh2, Child, Header, Record};
use hedgerow::bvh::wide::layout::{Wide8q, WideNode};
use hedgerow::geometry::Aabb;

/// (c_T · Σ SA(inner) + c_I · Σ SA(leaf)·n_leaf) / SA(`part`), of boxes clipped to `part`; `None` where that has no area. Where something is
/// far, rays begin at the node over what is near, wherever they go, and those that meet something far at the root
/// ([`hedgerow::bvh::far`]).
pub fn cost<R: Record>(tree: &Bvh2<R>, part: &Aabb, c_t: f64, c_i: f64) -> Option<f64> {
    let below = |inner: &Child| tree.nodes[inner.index as usize].children.to_vec();
    cost_from_near((&tree.header, &tree.far), below, part, [c_t, c_i])
}

/// The same of a tree in nodes of eight, of a step at one of them, by the boxes that rays see.
pub fn cost_of_eight<R: Record>(tree: &Wide8q<R>, part: &Aabb, c_t: f64, c_i: f64) -> Option<f64> {
    let below = |inner: &Child| {
        let node = &tree.nodes[inner.index as usize];
        match node.long_leaf() {
            Some((index, count)) => vec![Child { index, count, ..*inner }],
            None => node.children().into_iter().flatten().collect(),
        }
    };
    cost_from_near((&tree.header, &tree.far), below, part, [c_t, c_i])
}

/// The same of any tree with its boxes of what is far, with what is below an inner child.
fn cost_from_near(
    (header, far): (&Header, &[Aabb]),
    children: impl Fn(&Child) -> Vec<Child>,
    part: &Aabb,
    costs: [f64; 2],
) -> Option<f64> {
    let whole = clipped_half_area(part, part);
    if whole.is_nan() || whole <= 0.0 {
        return None;
    }
    let share = |b: &Aabb| clipped_half_area(b, part) / whole;
    let [c_t, _] = costs;
    if header.active == 0 || header.near_node == 0 {
        let root = if header.active == 0 { vec![] } else { vec![header.root] };
        return Some(cost_below(root, &children, share, costs));
    }
    let is_near = |child: &Child| !child.is_leaf() && child.index == header.near_node;
    let (near, others): (Vec<Child>, Vec<Child>) = children(&header.root).into_iter().partition(is_near);
    // As many rays as meet something far.
    let far = far.iter().map(share).sum::<f64>().min(1.0);
    let at_most_far = |b: &Aabb| share(b).min(far);
    let of_near = c_t + cost_below(near.iter().flat_map(&children).collect(), &children, share, costs);
    Some(c_t * far + of_near + cost_below(others, &children, at_most_far, costs))
}

/// Of these subtrees, of which rays enter a box by its share.
fn cost_below(
    mut below: Vec<Child>,
    children: impl Fn(&Child) -> Vec<Child>,
    share: impl Fn(&Aabb) -> f64,
    [c_t, c_i]: [f64; 2],
) -> f64 {
    let mut cost = 0.0;
    while let Some(child) = below.pop() {
        let share = share(&child.bounds());
        if child.is_leaf() {
            cost += c_i * share * f64::from(child.count);
        } else {
            cost += c_t * share;
            below.extend(children(&child));
        }
    }
    cost
}

/// Half the surface area of what `b` and `part` share; 0 where they are apart.
fn clipped_half_area(b: &Aabb, part: &Aabb) -> f64 {
    let [x, y, z]: [f64; 3] =
        std::array::from_fn(|i| f64::from(b.hi[i].min(part.hi[i])) - f64::from(b.lo[i].max(part.lo[i])));
    if x < 0.0 || y < 0.0 || z < 0.0 { 0.0 } else { x * y + y * z + z * x }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hedgerow::bvh::codes::Code;
    use hedgerow::bvh::sah::Collapse;
    use hedgerow::bvh::twin::lbvh;
    use hedgerow::bvh::twin::quality;

    /// One triangle in each box, alone in its leaf.
    fn tree(boxes: &[[[f32; 3]; 2]]) -> Bvh2 {
        let positions: Vec<[f32; 3]> = boxes.iter().flat_map(|&[lo, hi]| [lo, hi, [hi[0], lo[1], hi[2]]]).collect();
        let triangles: Vec<[u32; 3]> = (0..boxes.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        lbvh::build(&positions, &triangles, Code::Mc63.full(), Collapse::OFF)
    }

    #[test]
    fn without_anything_outside_it_is_the_plain_cost() {
        let tree =
            tree(&[[[0.0; 3], [1.0; 3]], [[3.0, 0.0, 0.0], [4.0, 1.0, 1.0]], [[0.0, 5.0, 0.0], [1.0, 6.0, 2.0]]]);
        let plain = quality::of(&tree, 3.0, 2.0).sah;
        let clipped = cost(&tree, &tree.header.root.bounds(), 3.0, 2.0).expect("an area");
        assert!((clipped - plain).abs() < 1e-12 * plain, "{clipped} {plain}");
    }

    #[test]
    fn boxes_are_clipped_and_what_is_outside_costs_nothing() {
        // Two unit boxes in the part, 2 × 1 × 1; one far away to the right, and one that reaches from inside to far above.
        let part = Aabb { lo: [0.0; 3], hi: [2.0, 1.0, 1.0] };
        let near = [[0.0; 3], [1.0; 3]];
        let next = [[1.0, 0.0, 0.0], [2.0, 1.0, 1.0]];
        let far = [[1e6, 0.0, 0.0], [1e6 + 1.0, 1.0, 1.0]];
        // Half areas: of the part 2 + 1 + 2 = 5, of a unit box 3.
        let two = cost(&tree(&[near, next]), &part, 3.0, 2.0).expect("an area");
        assert_eq!(two, (3.0 * 5.0 + 2.0 * (3.0 + 3.0)) / 5.0);
        // The root over all is clipped to the part and a node over the two is the part; the far leaf costs nothing.
        let three = cost(&tree(&[near, next, far]), &part, 3.0, 2.0).expect("an area");
        assert_eq!(three, (3.0 * (5.0 + 5.0) + 2.0 * (3.0 + 3.0)) / 5.0);
        // Inside the part it is 1 × ½ × 1, half area 2.
        let tall = [[0.0, 0.5, 0.0], [1.0, 1e6, 1.0]];
        let one = cost(&tree(&[tall]), &part, 3.0, 2.0).expect("an area");
        assert_eq!(one, 2.0 * 2.0 / 5.0);
        assert_eq!(cost(&tree(&[far]), &part, 3.0, 2.0), Some(0.0));
    }

    #[test]
    fn rays_that_begin_near_are_spared_the_root_but_for_those_that_meet_what_is_far() {
        // A grid of thirty boxes over the part, and one far away.
        let part = Aabb { lo: [0.0; 3], hi: [6.0, 5.0, 1.0] };
        let near = (0..30).map(|i| [(i % 6) as f32, (i / 6) as f32, 0.0]).map(|lo| [lo, lo.map(|x| x + 1.0)]);
        let far = [[1e6, 0.0, 0.0], [1e6 + 1.0, 1.0, 1.0]];
        let mut wide = Wide8q::of(&tree(&near.chain([far]).collect::<Vec<_>>()));
        let from_the_root = cost_of_eight(&wide, &part, 3.0, 2.0).expect("an area");
        let inner: Vec<Child> =
            wide.nodes[0].children().into_iter().flatten().filter(|child| !child.is_leaf()).collect();
        assert_eq!(inner.len(), 1, "what is near has a node of its own");
        wide.header.near_node = inner[0].index;
        wide.far = vec![Aabb::EMPTY; 6];
        wide.far[1] = Aabb { lo: far[0], hi: far[1] };
        let cost = cost_of_eight(&wide, &part, 3.0, 2.0).expect("an area");
        assert!((from_the_root - 3.0 - cost).abs() < 1e-9, "{from_the_root} {cost}");
        // What is far reaches into the part.
        wide.far[1] = Aabb { lo: [0.0, 0.0, 0.5], hi: [2.0, 5.0, 1.0] };
        let met = (2.0 * 5.0 + 5.0 * 0.5 + 0.5 * 2.0) / (6.0 * 5.0 + 5.0 * 1.0 + 1.0 * 6.0);
        let cost = cost_of_eight(&wide, &part, 3.0, 2.0).expect("an area");
        assert!((from_the_root - 3.0 + 3.0 * met - cost).abs() < 1e-9, "{from_the_root} {cost}");
    }

    /// The node over what is far on two sides is around the part, too, but no ray comes there that meets none of it.
    #[test]
    fn in_nodes_of_two_rays_that_begin_near_meet_no_node_over_what_is_far() {
        let part = Aabb { lo: [0.0; 3], hi: [4.0, 1.0, 1.0] };
        let at = |x: f32| [[x, 0.0, 0.0], [x + 1.0, 1.0, 1.0]];
        let robust = "emc64var+apart".parse().expect("codes");
        let boxes: Vec<[[f32; 3]; 2]> = (0..4).map(|i| at(i as f32)).chain([-1e6, 1e6].map(at)).collect();
        let positions: Vec<[f32; 3]> = boxes.iter().flat_map(|&[lo, hi]| [lo, hi, [hi[0], lo[1], hi[2]]]).collect();
        let triangles: Vec<[u32; 3]> = (0..6).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let mut tree = lbvh::build(&positions, &triangles, robust, Collapse::OFF);
        let [near, others] = tree.nodes[tree.header.root.index as usize].children;
        assert!(!others.is_leaf() && near.bounds() == part, "{near:?} {others:?}");
        let from_the_root = cost(&tree, &part, 3.0, 2.0).expect("an area");
        (tree.header.near_node, tree.header.far_sides) = (near.index, 0b11);
        tree.far = [[-1e6], [1e6]].concat().into_iter().map(at).map(|[lo, hi]| Aabb { lo, hi }).collect();
        tree.far.resize(6, Aabb::EMPTY);
        let cost = cost(&tree, &part, 3.0, 2.0).expect("an area");
        assert!((from_the_root - 6.0 - cost).abs() < 1e-9, "{from_the_root} {cost}");
    }

    #[test]
    fn a_part_without_area_has_no_cost_and_an_empty_tree_none_to_speak_of() {
        let point = Aabb { lo: [1.0; 3], hi: [1.0; 3] };
        assert_eq!(cost(&tree(&[[[0.0; 3], [1.0; 3]]]), &point, 3.0, 2.0), None);
        assert_eq!(cost(&tree(&[]), &Aabb { lo: [0.0; 3], hi: [1.0; 3] }, 3.0, 2.0), Some(0.0));
    }
}
