//! End-point overlap, plainly and in double precision: every triangle cut to the boxes on its way down (`bvh::epo`).
//!
//! Several records of one primitive, as splitting makes them, are one surface: it belongs to every node above any of them.

use crate::bvh::layout::{Bvh2, Child};
use crate::geometry::Polygon;

/// A tree made ready: which positions of a walk are below each node, and where each primitive is.
pub struct Surfaces<'a> {
    tree: &'a Bvh2,
    /// Where a walk, left child first, comes to each record; `u32::MAX` for those of no leaf.
    place: Vec<u32>,
    /// The places below each slot: first, and behind the last.
    below: Vec<[u32; 2]>,
    /// Primitive, place and record, sorted.
    refs: Vec<[u32; 3]>,
    /// Where in `refs` each primitive begins, and the end.
    starts: Vec<usize>,
}

/// The areas that the end-point overlap is made of.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Areas {
    /// Σ over inner nodes of the surface that lies in them and is not of them.
    pub inner: f64,
    /// The same over leaves, each times its triangles.
    pub leaves: f64,
    /// All surface.
    pub surface: f64,
}

/// The end-point overlap of `tree` with these costs of a step and of a test; `None` if the surface has no area.
pub fn epo(tree: &Bvh2, c_t: f64, c_i: f64) -> Option<f64> {
    let surfaces = Surfaces::new(tree);
    (0..surfaces.count()).fold(Areas::default(), |sum, i| sum.plus(&surfaces.areas(i))).epo(c_t, c_i)
}

impl Areas {
    /// Both together.
    pub fn plus(&self, other: &Areas) -> Areas {
        Areas {
            inner: self.inner + other.inner,
            leaves: self.leaves + other.leaves,
            surface: self.surface + other.surface,
        }
    }

    /// The end-point overlap with these costs; `None` if the surface has no area.
    pub fn epo(&self, c_t: f64, c_i: f64) -> Option<f64> {
        (self.surface > 0.0).then(|| (c_t * self.inner + c_i * self.leaves) / self.surface)
    }
}

impl<'a> Surfaces<'a> {
    /// Walks `tree` once.
    pub fn new(tree: &'a Bvh2) -> Surfaces<'a> {
        let mut surfaces = Surfaces {
            tree,
            place: vec![u32::MAX; tree.records.len()],
            below: vec![[0; 2]; tree.nodes.len()],
            refs: Vec::new(),
            starts: Vec::new(),
        };
        if tree.header.active != 0 {
            surfaces.walk();
        }
        surfaces.refs.sort_unstable();
        let refs = &surfaces.refs;
        let begins = |&i: &usize| i == 0 || refs[i - 1][0] != refs[i][0];
        surfaces.starts = (0..refs.len()).filter(begins).chain([refs.len()]).collect();
        surfaces
    }

    fn walk(&mut self) {
        // A node is met twice: before what is below it, and behind.
        let mut next = vec![(self.tree.header.root, false)];
        while let Some((child, behind)) = next.pop() {
            let here = self.refs.len() as u32;
            if child.is_leaf() {
                for record in child.index..child.index + child.count {
                    let place = self.refs.len() as u32;
                    self.place[record as usize] = place;
                    self.refs.push([self.tree.records[record as usize].primitive, place, record]);
                }
            } else {
                self.below[child.index as usize][usize::from(behind)] = here;
                if !behind {
                    let [left, right] = self.tree.nodes[child.index as usize].children;
                    next.extend([(child, true), (right, false), (left, false)]);
                }
            }
        }
    }

    /// How many there are: primitives that a leaf holds.
    pub fn count(&self) -> usize {
        self.starts.len() - 1
    }

    /// The areas of one of them.
    pub fn areas(&self, surface: usize) -> Areas {
        let refs = &self.refs[self.starts[surface]..self.starts[surface + 1]];
        let triangle = &self.tree.records[refs[0][2] as usize];
        let polygon = Polygon::of(&[triangle.v0, triangle.v1, triangle.v2]);
        let mut areas = Areas { surface: polygon.area(), ..Areas::default() };
        let mut next = vec![(self.tree.header.root, polygon)];
        while let Some((child, polygon)) = next.pop() {
            let cut = polygon.inside(&child.bounds());
            let area = cut.area();
            if area == 0.0 {
                continue;
            }
            if !self.holds(&child, refs) {
                if child.is_leaf() {
                    areas.leaves += area * f64::from(child.count);
                } else {
                    areas.inner += area;
                }
            }
            if !child.is_leaf() {
                next.extend(self.tree.nodes[child.index as usize].children.map(|child| (child, cut)));
            }
        }
        areas
    }

    /// Whether one of these is below the child.
    fn holds(&self, child: &Child, refs: &[[u32; 3]]) -> bool {
        let [first, end] = if child.is_leaf() {
            let first = self.place[child.index as usize];
            [first, first + child.count]
        } else {
            self.below[child.index as usize]
        };
        refs[refs.partition_point(|r| r[1] < first)..].first().is_some_and(|r| r[1] < end)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::codes::Code;
    use crate::bvh::layout::{Header, MAGIC, Node, Record, Triangle};
    use crate::bvh::sah::Collapse;
    use crate::bvh::twin::lbvh;
    use crate::geometry::Aabb;
    use bytemuck::Zeroable;

    type Corners = [[f32; 3]; 3];

    /// A leaf of `count` records with the box around these triangles.
    fn leaf(index: u32, triangles: &[Corners]) -> Child {
        let Aabb { lo, hi } = Aabb::around(triangles.as_flattened());
        Child { lo, hi, index, count: triangles.len() as u32 }
    }

    fn inner(index: u32, node: &Node) -> Child {
        let Aabb { lo, hi } = node.children[0].bounds().union(&node.children[1].bounds());
        Child { lo, hi, index, count: 0 }
    }

    fn tree(root: Child, nodes: Vec<Node>, records: &[(u32, Corners)]) -> Bvh2 {
        let count = records.len() as u32;
        let record = |&(primitive, [v0, v1, v2]): &(u32, Corners)| Triangle { v0, v1, v2, primitive };
        let header = Header {
            magic: MAGIC,
            kind: Triangle::KIND,
            primitive_count: count,
            root,
            active: count,
            node_slots: nodes.len() as u32,
            ..Header::zeroed()
        };
        Bvh2 { header, nodes, records: records.iter().map(record).collect(), geometries: Vec::new(), far: Vec::new() }
    }

    #[test]
    fn what_reaches_into_another_leaf_counts_by_its_area() {
        // The box of the first is [0, 2]², that of the second [1, 3]². Of the second, [1, 2]² lies in the box of the first; of the
        // first, a point in the box of the second.
        let a = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]];
        let b = [[1.0, 1.0, 0.0], [3.0, 1.0, 0.0], [1.0, 3.0, 0.0]];
        let node = Node { children: [leaf(0, &[a]), leaf(1, &[b])] };
        let tree = tree(inner(0, &node), vec![node], &[(0, a), (1, b)]);
        assert_eq!(epo(&tree, 3.0, 2.0), Some(2.0 * 1.0 / 4.0));
    }

    #[test]
    fn inner_nodes_count_by_the_cost_of_a_step() {
        // Two triangles, one above the other, and between them a third that is of another subtree.
        let at = |z| [[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]];
        let pair = Node { children: [leaf(0, &[at(0.0)]), leaf(1, &[at(1.0)])] };
        let root = Node { children: [inner(0, &pair), leaf(2, &[at(0.5)])] };
        let tree = tree(inner(1, &root), vec![pair, root], &[(0, at(0.0)), (1, at(1.0)), (2, at(0.5))]);
        assert_eq!(epo(&tree, 3.0, 2.0), Some(3.0 * 0.5 / 1.5));
    }

    #[test]
    fn a_leaf_counts_once_a_triangle() {
        let at = |z| [[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]];
        let root = Node { children: [leaf(0, &[at(0.0), at(1.0)]), leaf(2, &[at(0.5)])] };
        let tree = tree(inner(0, &root), vec![root], &[(0, at(0.0)), (1, at(1.0)), (2, at(0.5))]);
        assert_eq!(epo(&tree, 3.0, 2.0), Some(2.0 * 2.0 * 0.5 / 1.5));
    }

    #[test]
    fn parts_of_one_triangle_do_not_overlap_each_other() {
        let whole = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]];
        let part = |index, lo: [f32; 3], hi: [f32; 3]| Child { lo, hi, index, count: 1 };
        let children = [part(0, [0.0; 3], [1.0, 2.0, 0.0]), part(1, [1.0, 0.0, 0.0], [2.0, 1.0, 0.0])];
        let root = Node { children };
        let tree = tree(inner(0, &root), vec![root], &[(7, whole), (7, whole)]);
        let surfaces = Surfaces::new(&tree);
        assert_eq!((surfaces.count(), surfaces.areas(0)), (1, Areas { inner: 0.0, leaves: 0.0, surface: 2.0 }));
    }

    #[test]
    fn without_surface_there_is_no_figure() {
        let line = [[0.0; 3], [1.0; 3], [2.0; 3]];
        assert_eq!(epo(&tree(leaf(0, &[line]), Vec::new(), &[(0, line)]), 3.0, 2.0), None);
        assert_eq!(epo(&lbvh::build(&[], &[], Code::Mc63.full(), Collapse::SAH), 3.0, 2.0), None);
        let one = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        assert_eq!(epo(&tree(leaf(0, &[one]), Vec::new(), &[(0, one)]), 3.0, 2.0), Some(0.0));
    }

    /// Numbers from 0 to 1 (xorshift64*, Vigna 2016).
    struct Random(u64);

    impl Random {
        fn next(&mut self) -> f64 {
            self.0 ^= self.0 >> 12;
            self.0 ^= self.0 << 25;
            self.0 ^= self.0 >> 27;
            (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1u64 << 53) as f64
        }
    }

    /// The primitives of a subtree, and what points of the surface cost there: a walk that shares nothing with the figure's.
    fn costs(tree: &Bvh2, child: &Child, points: &[(u32, [f64; 3])], sums: &mut [f64]) -> Vec<u32> {
        let (own, cost) = if child.is_leaf() {
            let records = &tree.records[child.index as usize..][..child.count as usize];
            (records.iter().map(|r| r.primitive).collect(), 2.0 * f64::from(child.count))
        } else {
            let below = tree.nodes[child.index as usize].children.map(|c| costs(tree, &c, points, sums));
            (below.concat(), 3.0)
        };
        for ((primitive, at), sum) in points.iter().zip(sums) {
            let inside = (0..3).all(|k| f64::from(child.lo[k]) <= at[k] && at[k] <= f64::from(child.hi[k]));
            if inside && !own.contains(primitive) {
                *sum += cost;
            }
        }
        own
    }

    #[test]
    fn points_drawn_on_the_surface_meet_as_many_foreign_nodes() {
        const POINTS: usize = 40_000;
        let mut random = Random(9);
        let mut corner = || -> [f32; 3] { std::array::from_fn(|_| random.next() as f32) };
        let mut positions = Vec::new();
        for _ in 0..60 {
            let middle = corner();
            positions.extend([corner(), corner(), corner()].map(|c| [0, 1, 2].map(|k| middle[k] + 0.4 * c[k])));
        }
        let triangles: Vec<[u32; 3]> = (0..60).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        for collapse in [Collapse::OFF, Collapse::SAH] {
            let tree = lbvh::build(&positions, &triangles, Code::Mc63.full(), collapse);
            let areas: Vec<f64> = tree.records.iter().map(|t| Polygon::of(&[t.v0, t.v1, t.v2]).area()).collect();
            let total: f64 = areas.iter().sum();
            let points: Vec<(u32, [f64; 3])> = (0..POINTS)
                .map(|_| {
                    let mut left = random.next() * total;
                    let at = areas.iter().position(|area| (left -= area, left < 0.0).1).unwrap_or(0);
                    let t = &tree.records[at];
                    let (u, v) = (random.next(), random.next());
                    let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
                    let along = |k: usize| {
                        let [a, b, c] = [t.v0, t.v1, t.v2].map(|v| f64::from(v[k]));
                        a + u * (b - a) + v * (c - a)
                    };
                    (t.primitive, [along(0), along(1), along(2)])
                })
                .collect();
            let mut sums = vec![0.0; POINTS];
            costs(&tree, &tree.header.root, &points, &mut sums);
            let mean = sums.iter().sum::<f64>() / POINTS as f64;
            let variance = sums.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / POINTS as f64;
            let error = (variance / POINTS as f64).sqrt();
            let figure = epo(&tree, 3.0, 2.0).expect("there is surface");
            assert!((figure - mean).abs() < 4.0 * error, "{figure}, drawn {mean} ± {error}");
            assert!(error < 0.02 * figure, "{figure} ± {error}: drawn often enough to tell");
        }
    }
}
