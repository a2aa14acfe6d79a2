//! Trees that are taken apart, and algorithm 9: a tree in two along a plane.
//!
//! A forest only grows. Of a tree in two, just the nodes that the plane goes through are new, and the whole is still there; all
//! go at once, with the forest.

use hedgerow::bvh::layout::Triangle;
use hedgerow::geometry::Aabb;
use hedgerow::kdtree::layout::{KdContent, KdNode, KdTree, halves};
use hedgerow::kdtree::twin::clip::{KdPlane, KdReference, bounds_of, clipped, divided};

/// A plane: the axis that it is across, and where it is.
pub(super) type At = (usize, f32);
/// A tree of a forest, or nothing where a cell is empty.
pub(super) type Branch = Option<u32>;
/// The triangles of references, and what of them has no room ([`hedgerow::kdtree::twin::clip`]).
pub(super) type Records<'a> = (&'a [Triangle], f32);

/// Trees whose references are of the same records.
#[derive(Debug)]
pub(super) struct Forest<'a> {
    /// Has the first trees, and stays as it is.
    base: Option<&'a Forest<'a>>,
    /// What of the numbers is in the base.
    first: u32,
    /// How many tests a step is worth.
    step: f32,
    trees: Vec<Tree>,
    references: Vec<KdReference>,
}

/// A node, which holds something, and all below it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Tree {
    /// Around all references' boxes: what the thesis calls the tree's bounding box. The cell may be larger.
    pub bounds: Aabb,
    /// References in all leaves.
    pub count: u32,
    /// How many tests it is worth to a ray that meets its box.
    pub cost: f32,
    pub content: TreeContent,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum TreeContent {
    /// The first of its references, which are by ascending record.
    Leaf(u32),
    /// At least one child is not empty.
    Inner { at: At, children: [Branch; 2] },
}

impl Tree {
    pub fn root_plane(&self) -> Option<At> {
        match self.content {
            TreeContent::Inner { at, .. } => Some(at),
            TreeContent::Leaf(_) => None,
        }
    }
}

impl<'a> Forest<'a> {
    fn new(step: f32) -> Forest<'a> {
        Forest { base: None, first: 0, step, trees: Vec::new(), references: Vec::new() }
    }

    /// The trees of another, and more.
    pub fn over(base: &'a Forest<'a>) -> Forest<'a> {
        let first = base.first + base.trees.len() as u32;
        Forest { base: Some(base), first, ..Forest::new(base.step) }
    }

    pub fn tree(&self, tree: u32) -> Tree {
        match self.base {
            Some(base) if tree < self.first => base.tree(tree),
            _ => self.trees[(tree - self.first) as usize],
        }
    }

    /// A tree's own references: those of a leaf.
    pub fn leaf_references(&self, tree: u32) -> &[KdReference] {
        match (self.base, self.tree(tree)) {
            (Some(base), _) if tree < self.first => base.leaf_references(tree),
            (_, Tree { content: TreeContent::Leaf(first), count, .. }) => {
                &self.references[first as usize..][..count as usize]
            }
            _ => &[],
        }
    }

    /// Appends what is in a tree's leaves; what is in several of them as often.
    pub fn gather(&self, tree: u32, references: &mut Vec<KdReference>) {
        match self.tree(tree).content {
            TreeContent::Leaf(_) => references.extend_from_slice(self.leaf_references(tree)),
            TreeContent::Inner { children, .. } => children.iter().flatten().for_each(|&c| self.gather(c, references)),
        }
    }

    pub fn leaf(&mut self, references: impl IntoIterator<Item = KdReference>) -> Branch {
        let first = self.references.len();
        self.references.extend(references);
        let bounds = self.references[first..].iter().fold(Aabb::EMPTY, |b, reference| b.union(&reference.bounds));
        let count = (self.references.len() - first) as u32;
        let leaf = Tree { bounds, count, cost: count as f32, content: TreeContent::Leaf(first as u32) };
        (count > 0).then(|| self.push(leaf))
    }

    pub fn inner(&mut self, at: At, children: [Branch; 2]) -> Branch {
        let there = || children.iter().flatten().map(|&child| self.tree(child));
        let (bounds, count) =
            there().fold((Aabb::EMPTY, 0), |(bounds, count), child| (bounds.union(&child.bounds), count + child.count));
        let area = bounds.half_area();
        // All of it where areas are too large or too small to tell.
        let part = |part: f32| if part <= 1.0 { part } else { 1.0 };
        let cost = self.step + there().map(|child| part(child.bounds.half_area() / area) * child.cost).sum::<f32>();
        let inner = Tree { bounds, count, cost, content: TreeContent::Inner { at, children } };
        (count > 0).then(|| self.push(inner))
    }

    fn push(&mut self, tree: Tree) -> u32 {
        self.trees.push(tree);
        self.first + self.trees.len() as u32 - 1
    }

    /// A structure as a tree that can be taken apart. Triangles that straddle the planes of the structure are not clipped, but
    /// their boxes are: they will be, where they are cut.
    pub fn of(tree: &KdTree, step: f32) -> (Forest<'a>, Branch) {
        let mut forest = Forest::new(step);
        forest.trees.reserve(tree.nodes.len());
        forest.references.reserve(tree.references.len());
        let root = tree.nodes.first().and_then(|root| forest.below(tree, root, &tree.header.cell()));
        (forest, root)
    }

    fn below(&mut self, tree: &KdTree, node: &KdNode, cell: &Aabb) -> Branch {
        match node.content() {
            KdContent::Leaf(range) => {
                let reference = |&record: &u32| {
                    let Triangle { v0, v1, v2, .. } = tree.records[record as usize];
                    let bounds = bounds_of(&[v0, v1, v2], tree.header.reach).intersection(cell);
                    (0..3).all(|i| bounds.lo[i] <= bounds.hi[i]).then_some(KdReference { bounds, record })
                };
                self.leaf(tree.references[range].iter().filter_map(reference))
            }
            KdContent::Inner(inner) => {
                let [left, right] = inner.halves(cell);
                let mut child = |child: Option<u32>, cell: &Aabb| {
                    child.and_then(|child| self.below(tree, &tree.nodes[child as usize], cell))
                };
                let children = [child(inner.children[0], &left), child(inner.children[1], &right)];
                self.inner((inner.axis, inner.plane), children)
            }
        }
    }

    /// A leaf of a structure, in a cell.
    pub fn of_leaf(references: &[u32], records: Records<'_>, cell: &Aabb, step: f32) -> (Forest<'a>, Branch) {
        let mut forest = Forest::new(step);
        let reference = |&record: &u32| {
            let Triangle { v0, v1, v2, .. } = records.0[record as usize];
            clipped(&[v0, v1, v2], records.1, cell).map(|bounds| KdReference { bounds, record })
        };
        let leaf = forest.leaf(references.iter().filter_map(reference));
        (forest, leaf)
    }

    /// Algorithm 9, `PartitionTreeWithPlane` (Eleftheriades 2010): what of a tree is on the left of a plane and what on its
    /// right. What lies in the plane is on the left.
    pub fn partition_tree_with_plane(&mut self, tree: u32, records: Records<'_>, (axis, at): At) -> [Branch; 2] {
        let Tree { bounds, content, .. } = self.tree(tree);
        if bounds.hi[axis] <= at {
            return [Some(tree), None];
        }
        if at <= bounds.lo[axis] {
            return [None, Some(tree)];
        }
        let (own, children) = match content {
            TreeContent::Leaf(_) => return self.partition_primitives(tree, records, (axis, at)),
            TreeContent::Inner { at: own, children } => (own, children),
        };
        if own == (axis, at) {
            return children;
        }
        let parts = children.map(|child| match child {
            Some(child) => self.partition_tree_with_plane(child, records, (axis, at)),
            None => [None, None],
        });
        let [[left_left, left_right], [right_left, right_right]] = parts;
        if own.0 != axis {
            return [self.inner(own, [left_left, right_left]), self.inner(own, [left_right, right_right])];
        }
        // Of two planes across one axis, each is on one side of the other.
        if own.1 < at {
            [self.inner(own, [left_left, right_left]), right_right]
        } else {
            [left_left, self.inner(own, [left_right, right_right])]
        }
    }

    /// The thesis' `PartitionPrimitives`: each box is cut where the plane goes through it, and the triangle clipped again. What
    /// of a triangle is in its cell is in its box, so that the box does for the cell.
    fn partition_primitives(&mut self, leaf: u32, records: Records<'_>, (axis, at): At) -> [Branch; 2] {
        let plane = KdPlane { axis, at, planar_left: true };
        let mut parts = [Vec::new(), Vec::new()];
        for reference in self.leaf_references(leaf) {
            let divided = divided(reference, records, &plane, &halves(&reference.bounds, axis, at));
            parts.iter_mut().zip(divided).for_each(|(part, reference)| part.extend(reference));
        }
        parts.map(|part| self.leaf(part))
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A triangle across x from `lo` to `hi`, at y, in the plane z = 0.
    pub fn triangle(lo: f32, hi: f32, y: f32) -> Triangle {
        Triangle { v0: [lo, y, 0.0], v1: [hi, y, 0.0], v2: [lo, y + 1.0, 0.0], primitive: 0 }
    }

    pub fn reference(records: &[Triangle], record: u32) -> KdReference {
        let Triangle { v0, v1, v2, .. } = records[record as usize];
        KdReference { bounds: Aabb::around(&[v0, v1, v2]), record }
    }

    /// As text: `(axis@plane left right)`, `[records]`, `-`.
    fn text(forest: &Forest<'_>, branch: Branch) -> String {
        let Some(tree) = branch else { return "-".to_owned() };
        match forest.tree(tree).content {
            TreeContent::Leaf(_) => {
                let records: Vec<u32> = forest.leaf_references(tree).iter().map(|r| r.record).collect();
                format!("{records:?}")
            }
            TreeContent::Inner { at: (axis, at), children: [left, right] } => {
                format!("({}@{at} {} {})", ["x", "y", "z"][axis], text(forest, left), text(forest, right))
            }
        }
    }

    /// All in one leaf.
    pub fn one_leaf(records: &[Triangle]) -> (Forest<'static>, u32) {
        let mut forest = Forest::new(1.5);
        let leaf = forest.leaf((0..records.len() as u32).map(|record| reference(records, record)));
        (forest, leaf.expect("full"))
    }

    /// Four triangles in the quarters of a square, and a long one through the lower two.
    pub fn quarters() -> (Vec<Triangle>, Forest<'static>, u32) {
        let records = vec![
            triangle(0.0, 1.0, 0.0),
            triangle(3.0, 4.0, 0.0),
            triangle(0.0, 1.0, 3.0),
            triangle(3.0, 4.0, 3.0),
            triangle(0.0, 4.0, 0.5),
        ];
        let mut forest = Forest::new(1.5);
        let mut leaf = |numbers: &[u32], hi: f32, lo: f32| {
            let references = numbers.iter().map(|&number| {
                let mut reference = reference(&records, number);
                reference.bounds.hi[0] = reference.bounds.hi[0].min(hi);
                reference.bounds.lo[0] = reference.bounds.lo[0].max(lo);
                reference
            });
            forest.leaf(references.collect::<Vec<_>>())
        };
        let leaves = [leaf(&[0, 4], 2.0, 0.0), leaf(&[2], 2.0, 0.0), leaf(&[1, 4], 4.0, 2.0), leaf(&[3], 4.0, 2.0)];
        let left = forest.inner((1, 2.0), [leaves[0], leaves[1]]);
        let right = forest.inner((1, 2.5), [leaves[2], leaves[3]]);
        let root = forest.inner((0, 2.0), [left, right]).expect("full");
        (records, forest, root)
    }

    #[track_caller]
    fn assert_parts(at: At, left: &str, right: &str) {
        let (records, mut forest, root) = quarters();
        let before = text(&forest, Some(root));
        let parts = forest.partition_tree_with_plane(root, (&records, 9.0), at);
        assert_eq!(parts.map(|part| text(&forest, part)), [left, right].map(str::to_owned), "{at:?}");
        assert_eq!(text(&forest, Some(root)), before, "the whole is still there");
        for (part, is_left) in parts.into_iter().zip([true, false]) {
            let mut references = Vec::new();
            part.inspect(|&part| forest.gather(part, &mut references));
            let is_there =
                |r: &KdReference| if is_left { r.bounds.hi[at.0] <= at.1 } else { at.1 <= r.bounds.lo[at.0] };
            assert!(references.iter().all(is_there), "{at:?}: {references:?}");
        }
    }

    #[test]
    fn a_plane_puts_a_tree_in_two() {
        // The root's own plane: its children. Another across the same axis: one of the children is whole.
        assert_parts((0, 2.0), "(y@2 [0, 4] [2])", "(y@2.5 [1, 4] [3])");
        assert_parts((0, 3.5), "(x@2 (y@2 [0, 4] [2]) (y@2.5 [1, 4] [3]))", "(y@2.5 [1, 4] [3])");
        assert_parts((0, 0.5), "(y@2 [0, 4] [2])", "(x@2 (y@2 [0, 4] [2]) (y@2.5 [1, 4] [3]))");
        // Between the two: nothing but the long one is cut.
        assert_parts((0, 2.5), "(x@2 (y@2 [0, 4] [2]) (y@2.5 [4] -))", "(y@2.5 [1, 4] [3])");
        // Across another axis, the root's plane is in both; of the planes across the same, each is on its side.
        assert_parts((1, 2.25), "(x@2 (y@2 [0, 4] -) [1, 4])", "(x@2 [2] (y@2.5 - [3]))");
        // Beside it, and where it ends.
        let whole = "(x@2 (y@2 [0, 4] [2]) (y@2.5 [1, 4] [3]))";
        assert_parts((0, 4.0), whole, "-");
        assert_parts((0, -1.0), "-", whole);
        assert_parts((2, 0.0), whole, "-");
    }
}
