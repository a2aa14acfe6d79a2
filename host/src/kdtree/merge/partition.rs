//! Algorithm 10: one tree of several, whose boxes may overlap (Eleftheriades 2010; Papay 2025, chapter 10).
//!
//! The planes that are looked at first are the faces of the trees' boxes. One that cuts no tree is *clean*: it is taken where it
//! has trees on both sides, or where cutting off empty space pays. Where there is none, the trees are through each other, and the
//! planes of their roots are looked at: the tree of the plane falls into its children, and the others are cut.
//!
//! Deviations. The thesis removes the roots of all trees and takes one of their planes; here the other trees keep theirs, as in
//! its `MergeBSPTrees`. Where all trees are leaves, it looks for clean planes before it makes a tree of them; here that tree is
//! the exact builder's, which looks at those planes too, and so it is where there are few references in all. Which clean plane
//! is best, how `IsTightlyBounding` tells and what `MakeTreeFromLeaves` does is not in the text that is left of it: here the
//! surface area heuristic says all three.

use super::fragment::Fragment;
use super::tree::{At, Branch, Forest, Records, Tree, TreeContent};
use crate::kdtree::exact;
use hedgerow::bvh::layout::Triangle;
use hedgerow::geometry::Aabb;
use hedgerow::kdtree::layout::{KdNode, MAX_DEPTH, halves};
use hedgerow::kdtree::twin::clip::KdReference;
use hedgerow::kdtree::twin::heuristic::{Heuristic, KdSplit};

/// So few references are as soon a tree of their own.
const FEW: u32 = 16;

/// A tree of one of the forests.
#[derive(Debug, Clone, Copy)]
pub(super) struct SourcePart {
    source: usize,
    number: u32,
    tree: Tree,
}

/// Where trees and their triangles are.
pub(super) struct Source<'a> {
    pub forest: Forest<'a>,
    pub records: Records<'a>,
    /// What the first record is named.
    pub first: u32,
}

/// Makes a tree of trees.
pub(super) struct Partition<'a> {
    pub heuristic: Heuristic,
    pub sources: Vec<Source<'a>>,
    pub made: Fragment,
}

impl Partition<'_> {
    pub fn part(&self, source: usize, number: u32) -> SourcePart {
        SourcePart { source, number, tree: self.sources[source].forest.tree(number) }
    }

    /// `PartitionTrees`: one tree in `cell` of all `parts`, which are in it.
    pub fn partition_trees(&mut self, mut parts: Vec<SourcePart>, cell: Aabb, depth: u32) -> Option<KdNode> {
        loop {
            if parts.is_empty() {
                return None;
            }
            let all_leaves = parts.iter().all(|part| part.tree.root_plane().is_none());
            if parts.len() > 1 && (all_leaves || total(&parts) <= FEW) {
                return self.make_tree_from_leaves(&parts, &cell, depth);
            }
            if depth >= MAX_DEPTH {
                return self.limited(&parts, depth);
            }
            if let Some(at) = self.best_clean_plane(&parts, &cell) {
                return self.divided(&parts, &cell, at, depth);
            }
            if let [alone] = parts[..] {
                return self.as_it_is(alone, cell, depth);
            }
            if let Some(at) = self.best_root_plane(&parts, &cell) {
                return self.divided(&parts, &cell, at, depth);
            }
            match self.dissolved(&parts, &cell) {
                Some(dissolved) => parts = dissolved,
                None => return self.make_tree_from_leaves(&parts, &cell, depth),
            }
        }
    }

    /// A node with this plane, and below it what is on its sides.
    fn divided(&mut self, parts: &[SourcePart], cell: &Aabb, at: At, depth: u32) -> Option<KdNode> {
        let mut sides = [Vec::new(), Vec::new()];
        for &SourcePart { source, number, .. } in parts {
            let Source { forest, records, .. } = &mut self.sources[source];
            let divided = forest.partition_tree_with_plane(number, *records, at);
            for (side, branch) in sides.iter_mut().zip(divided) {
                side.extend(branch.map(|number| self.part(source, number)));
            }
        }
        let [left, right] = sides;
        let [left_cell, right_cell] = halves(cell, at.0, at.1);
        let left = self.partition_trees(left, left_cell, depth + 1);
        let right = self.partition_trees(right, right_cell, depth + 1);
        self.made.inner(at, [left, right])
    }

    /// `FindBestPlane`, of those that cut no tree. Unlike a builder, who knows only how many references there are, this one
    /// knows what the trees are worth.
    fn best_clean_plane(&self, parts: &[SourcePart], cell: &Aabb) -> Option<At> {
        let mut best: Option<(f32, At)> = None;
        for axis in 0..3 {
            let faces = |part: &SourcePart| [part.tree.bounds.lo[axis], part.tree.bounds.hi[axis]];
            for at in parts.iter().flat_map(faces).filter(|&at| is_inside(cell, (axis, at))) {
                let Some(tests) = tests_beside(parts, (axis, at)) else { continue };
                let (cost, pays) = self.heuristic.between(cell, (axis, at), tests);
                let parts_them = tests[0] > 0.0 && tests[1] > 0.0;
                if (parts_them || pays) && best.is_none_or(|(least, _)| cost < least) {
                    best = Some((cost, (axis, at)));
                }
            }
        }
        best.map(|(_, at)| at)
    }

    /// `FindBestPlane`, of those of the roots.
    fn best_root_plane(&self, parts: &[SourcePart], cell: &Aabb) -> Option<At> {
        let split = |at: At| {
            let [left, right] = counts(parts, at);
            self.heuristic.split(cell, at, [left, 0, right])
        };
        let best = parts.iter().filter_map(|part| part.tree.root_plane()).map(split).fold(None, KdSplit::better);
        let best = self.heuristic.paying(best, cell, total(parts) as usize);
        best.map(|split| (split.plane.axis, split.plane.at))
    }

    /// `Dissolve`: the trees whose root's plane is beyond the cell fall into their children. `None` where there are none.
    fn dissolved(&self, parts: &[SourcePart], cell: &Aabb) -> Option<Vec<SourcePart>> {
        let is_beyond = |part: &SourcePart| part.tree.root_plane().is_some_and(|at| !is_inside(cell, at));
        parts.iter().any(is_beyond).then(|| {
            let fallen = |part: &SourcePart| match part.tree.content {
                TreeContent::Inner { children, .. } if is_beyond(part) => children.map(|child| self.child(part, child)),
                _ => [Some(*part), None],
            };
            parts.iter().flat_map(fallen).flatten().collect()
        })
    }

    fn child(&self, part: &SourcePart, child: Branch) -> Option<SourcePart> {
        child.map(|number| self.part(part.source, number))
    }

    /// A tree that is alone in a cell that is tight enough.
    fn as_it_is(&mut self, part: SourcePart, cell: Aabb, depth: u32) -> Option<KdNode> {
        let TreeContent::Inner { at, children } = part.tree.content else {
            let Source { forest, first, .. } = &self.sources[part.source];
            let references = forest.leaf_references(part.number).iter();
            return self.made.leaf(references.map(|reference| first + reference.record), depth);
        };
        if depth >= MAX_DEPTH {
            return self.limited(&[part], depth);
        }
        match children.map(|child| self.child(&part, child)) {
            // It cut off empty space, and the cell may have become smaller since.
            [Some(only), None] if !self.pays(&cell, at, [only.tree.cost, 0.0]) => self.as_it_is(only, cell, depth),
            [None, Some(only)] if !self.pays(&cell, at, [0.0, only.tree.cost]) => self.as_it_is(only, cell, depth),
            [left, right] if is_inside(&cell, at) => {
                let [left_cell, right_cell] = halves(&cell, at.0, at.1);
                let left = left.and_then(|left| self.as_it_is(left, left_cell, depth + 1));
                let right = right.and_then(|right| self.as_it_is(right, right_cell, depth + 1));
                self.made.inner(at, [left, right])
            }
            // The plane is a face of the cell by now, and one of the children lies in it.
            both => self.partition_trees(both.into_iter().flatten().collect(), cell, depth),
        }
    }

    fn pays(&self, cell: &Aabb, at: At, tests: [f32; 2]) -> bool {
        is_inside(cell, at) && self.heuristic.between(cell, at, tests).1
    }

    /// `MakeTreeFromLeaves`: a tree over all references, none of them twice.
    fn make_tree_from_leaves(&mut self, parts: &[SourcePart], cell: &Aabb, depth: u32) -> Option<KdNode> {
        let gathered = self.gathered(parts);
        if self.heuristic.is_leaf(gathered.len(), depth) {
            return self.made.leaf(gathered.iter().map(|&(name, ..)| name), depth);
        }
        let triangles: Vec<Triangle> = gathered.iter().map(|(.., triangle)| *triangle).collect();
        // What is longer than another tree's reach and not than that of its own needs no room.
        let reach = parts.iter().fold(0.0, |reach: f32, part| reach.max(self.sources[part.source].records.1));
        let reference = |(i, &(_, bounds, _)): (usize, &Gathered)| KdReference { bounds, record: i as u32 };
        let references = gathered.iter().enumerate().map(reference).collect();
        let tree = exact::build(&self.heuristic.below(depth), (&triangles, reach), *cell, references);
        self.made.subtree(&tree, &|record| gathered[record as usize].0, depth)
    }

    fn limited(&mut self, parts: &[SourcePart], depth: u32) -> Option<KdNode> {
        self.made.is_limited = true;
        let gathered = self.gathered(parts);
        self.made.leaf(gathered.iter().map(|&(name, ..)| name), depth)
    }

    /// All that is referenced, by ascending name; what is referenced several times once, with the box around all.
    fn gathered(&self, parts: &[SourcePart]) -> Vec<Gathered> {
        let mut gathered: Vec<Gathered> = Vec::new();
        let mut references = Vec::new();
        for part in parts {
            let Source { forest, records, first } = &self.sources[part.source];
            forest.gather(part.number, &mut references);
            gathered.extend(references.drain(..).map(|r| (first + r.record, r.bounds, records.0[r.record as usize])));
        }
        gathered.sort_unstable_by_key(|&(name, ..)| name);
        gathered.dedup_by(|next, kept| {
            let is_same = next.0 == kept.0;
            if is_same {
                kept.1 = kept.1.union(&next.1);
            }
            is_same
        });
        gathered
    }
}

/// A triangle's name, its box and itself.
type Gathered = (u32, Aabb, Triangle);

/// The references on the left and on the right of a plane, as far as can be told without cutting: those of a tree that it cuts
/// go with the extents.
fn counts(parts: &[SourcePart], at: At) -> [u32; 2] {
    let (axis, plane) = at;
    parts.iter().fold([0; 2], |[left, right], SourcePart { tree, .. }| {
        let (lo, hi, count) = (tree.bounds.lo[axis], tree.bounds.hi[axis], tree.count);
        let on_left = if hi <= plane {
            count
        } else if plane <= lo {
            0
        } else {
            // A half where the extent is too large to tell.
            let part = (plane - lo) / (hi - lo);
            let part = if (0.0..=1.0).contains(&part) { part } else { 0.5 };
            (part * count as f32).round() as u32
        };
        [left + on_left, right + count.saturating_sub(on_left)]
    })
}

/// What the trees on the left and on the right of a plane are worth; `None` where it cuts one.
fn tests_beside(parts: &[SourcePart], (axis, at): At) -> Option<[f32; 2]> {
    parts.iter().try_fold([0.0; 2], |[left, right], SourcePart { tree, .. }| {
        if tree.bounds.hi[axis] <= at {
            Some([left + tree.cost, right])
        } else {
            (at <= tree.bounds.lo[axis]).then_some([left, right + tree.cost])
        }
    })
}

fn total(parts: &[SourcePart]) -> u32 {
    parts.iter().map(|part| part.tree.count).sum()
}

fn is_inside(cell: &Aabb, (axis, at): At) -> bool {
    cell.lo[axis] < at && at < cell.hi[axis]
}

#[cfg(test)]
mod tests {
    use super::super::tree::tests::{one_leaf, quarters, triangle};
    use super::*;
    use hedgerow::kdtree::layout::{Inner, KdContent};
    use hedgerow::kdtree::termination::Costs;

    const CELL: Aabb = Aabb { lo: [-1.0; 3], hi: [9.0; 3] };

    /// The tree of all trees, as text: `(axis@plane left right)`, `[names]`, `-`.
    fn merged(trees: Vec<(Forest<'_>, &[Triangle], u32)>, depth: u32) -> (String, Fragment) {
        let heuristic = Heuristic::of_leaf(Costs::DEFAULT, &CELL, 10);
        let (mut sources, mut roots, mut first) = (Vec::new(), Vec::new(), 0);
        for (forest, records, root) in trees {
            sources.push(Source { forest, records: (records, 9.0), first });
            roots.push(root);
            first += 10;
        }
        let mut partition = Partition { heuristic, sources, made: Fragment::default() };
        let parts = roots.into_iter().enumerate().map(|(source, root)| partition.part(source, root)).collect();
        let root = partition.partition_trees(parts, CELL, depth);
        (text(&partition.made, root), partition.made)
    }

    fn text(made: &Fragment, node: Option<KdNode>) -> String {
        match node.map(|node| node.content()) {
            None => "-".to_owned(),
            Some(KdContent::Leaf(range)) => format!("{:?}", &made.references[range]),
            Some(KdContent::Inner(Inner { axis, plane, children })) => {
                let [left, right] = children.map(|child| text(made, child.map(|child| made.nodes[child as usize])));
                format!("({}@{plane} {left} {right})", ["x", "y", "z"][axis])
            }
        }
    }

    /// Many triangles that no plane parts.
    fn stack(lo: f32, hi: f32, count: usize) -> Vec<Triangle> {
        vec![triangle(lo, hi, 0.0); count]
    }

    #[test]
    fn nothing_is_an_empty_leaf_and_a_tree_alone_stays_as_it_is_without_space_around_it() {
        assert_eq!(merged(Vec::new(), 0).0, "-");
        let (records, forest, root) = quarters();
        let (text, made) = merged(vec![(forest, &records, root)], 0);
        assert!(text.contains("(x@2 (y@2 [0, 4] [2]) (y@2.5 [1, 4] [3]))"), "{text}");
        assert!(text.starts_with('(') && made.empty_leaves > 0 && made.inner_nodes == 3 + made.empty_leaves, "{text}");
    }

    #[test]
    fn trees_apart_are_parted_by_a_clean_plane_and_not_taken_apart() {
        let (records, forest, root) = quarters();
        let beside = stack(6.0, 7.0, 20);
        let (other, leaf) = one_leaf(&beside);
        let (text, _) = merged(vec![(forest, &records, root), (other, &beside, leaf)], 0);
        assert!(text.contains("(x@2 (y@2 [0, 4] [2]) (y@2.5 [1, 4] [3]))"), "{text}");
        assert!(text.contains("x@4") || text.contains("x@6"), "{text}");
        let names: Vec<u32> = (10..30).collect();
        assert!(text.contains(&format!("{names:?}")), "{text}");
    }

    #[test]
    fn trees_through_each_other_are_cut_by_the_plane_of_a_root() {
        let (records, forest, root) = quarters();
        // Through all that is on the right.
        let through = stack(2.5, 4.5, 20);
        let (other, leaf) = one_leaf(&through);
        let (text, _) = merged(vec![(forest, &records, root), (other, &through, leaf)], 0);
        assert!(text.contains("(y@2 [0, 4] [2])"), "the left is whole: {text}");
        assert!(text.contains("3]") && text.contains("1, 4, 10, 11"), "the right is with the others: {text}");
    }

    #[test]
    fn leaves_are_one_tree_that_has_each_triangle_once() {
        let records = stack(0.0, 1.0, 2);
        let (mut forest, leaf) = one_leaf(&records);
        let parts = forest.partition_tree_with_plane(leaf, (&records, 9.0), (0, 0.5)).map(|part| part.expect("cut"));
        let both = forest.inner((0, -2.0), parts.map(Some)).expect("full");
        // The plane is beyond the cell: what was cut comes together again.
        let (text, made) = merged(vec![(forest, &records, both)], 0);
        assert_eq!(made.references, [0, 1], "{text}");
    }

    #[test]
    fn where_no_tree_may_be_deeper_there_is_a_leaf_that_says_so() {
        let (records, forest, root) = quarters();
        let (text, made) = merged(vec![(forest, &records, root)], MAX_DEPTH);
        assert_eq!((text.as_str(), made.is_limited, made.depth), ("[0, 1, 2, 3, 4]", true, MAX_DEPTH));
    }
}
