//! Bonsai: small sweeps side by side, and one over their trees.
//!
//! Ganestam, Barringer, Doggett, Akenine-Möller 2015, "Bonsai: Rapid Bounding Volume Hierarchy Generation using Mini Trees";
//! Frantál 2019, section 3.3. Spatial medians divide the primitives into parts of at most [`BonsaiOptions::mini`]; a full sweep
//! builds a *mini tree* over each; pruning takes the roots off those that are large; and a full sweep over what is left, each
//! mini tree counting for its primitives, builds the top of the tree.
//!
//! Pruning, in the thesis with three stacks: a mini tree larger than a threshold θ is divided into its children, and they in the
//! same way, as long as there is a leaf smaller than θ below. Boxes of children lie in those of their parents, so a subtree has a
//! node smaller than θ exactly where it has such a leaf.

use super::binned::partition;
use super::bounds::{Bounds, Item};
use super::sweep;
use super::topology::{LEAF, Span, Topology};
use super::{ALONE, DIVIDED_ABOVE};
use bytemuck::zeroed_vec;
use hedgerow::bvh::sah::Collapse;
use hedgerow::{Error, Result};
use rayon::prelude::*;

/// How large mini trees are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BonsaiOptions {
    /// Most primitives of a mini tree, at least 1.
    pub mini: u32,
    /// Mini trees are pruned whose area is more than this part of the mean.
    pub prune: Option<f32>,
}

impl BonsaiOptions {
    /// The paper's without pruning.
    pub const PLAIN: BonsaiOptions = BonsaiOptions { mini: 512, prune: None };
    /// The paper's with pruning.
    pub const PRUNED: BonsaiOptions = BonsaiOptions { mini: 512, prune: Some(0.1) };
    /// The paper's for the best trees.
    pub const PRUNED_FINE: BonsaiOptions = BonsaiOptions { mini: 4096, prune: Some(0.01) };

    pub(super) fn check(&self) -> Result<()> {
        match *self {
            BonsaiOptions { mini: 0, .. } => {
                Err(Error::Argument("mini trees of no primitive cannot be used; take 1 or more primitives".into()))
            }
            BonsaiOptions { prune: Some(part), .. } if part.is_nan() || part < 0.0 => {
                Err(Error::Argument(format!("pruning by {part} of the mean area is not possible; take 0 or more")))
            }
            _ => Ok(()),
        }
    }
}

/// The tree over `items`, which it brings into another order.
pub(super) fn build(mut items: Vec<Item>, costs: &Collapse, single: bool, options: &BonsaiOptions) -> Topology {
    let mut spare: Vec<Item> = zeroed_vec(items.len());
    let sizes = parts(&mut items, &mut spare, options.mini as usize, 0);
    drop(spare);
    let mut rest = &items[..];
    let parts: Vec<&[Item]> = sizes
        .into_iter()
        .map(|size| {
            let (part, behind) = rest.split_at(size);
            rest = behind;
            part
        })
        .collect();
    let minis: Vec<MiniTree<'_>> = parts.par_iter().map(|part| MiniTree::new(part, costs, single)).collect();
    if minis.is_empty() {
        return Topology::new(0);
    }
    let mean = minis.iter().map(|mini| f64::from(mini.whole.area)).sum::<f64>() / minis.len() as f64;
    let threshold = options.prune.map_or(f32::INFINITY, |part| (f64::from(part) * mean) as f32);
    let roots: Vec<MiniRoot> =
        minis.par_iter().enumerate().flat_map_iter(|(i, mini)| mini.roots(i as u32, threshold)).collect();
    let item = |(root, number): (&MiniRoot, u32)| Item::new(root.bounds, number, root.span.count);
    let top_items: Vec<Item> = roots.iter().zip(0..).map(item).collect();
    let counts: Vec<u32> = roots.iter().map(|root| root.span.count).collect();
    sweep::positions(&top_items, costs, true).expanded(&counts, |tree, root| {
        let MiniRoot { mini, span, .. } = roots[root as usize];
        let mini = &minis[mini as usize];
        let order = &mini.tree.order[span.primitives()];
        tree.order.extend(order.iter().map(|&i| mini.items[i as usize].primitive()));
        tree.splits.extend_from_slice(&mini.tree.splits[span.slots()]);
    })
}

/// Divides items by spatial medians; how many are in each part, in order.
fn parts(items: &mut [Item], spare: &mut [Item], most: usize, depth: u32) -> Vec<usize> {
    let count = items.len();
    if count <= most {
        return if count == 0 { Vec::new() } else { vec![count] };
    }
    let around =
        |items: &[Item]| items.iter().fold(Bounds::EMPTY, |all, item| all.union(Bounds::point(item.centroid())));
    let centroids = items.par_chunks(ALONE).map(around).reduce(|| Bounds::EMPTY, Bounds::union);
    let axis = centroids.longest_edge().0;
    let middle = 0.5 * centroids.lo[axis] + 0.5 * centroids.hi[axis];
    let is_left = |item: &Item| item.centroid_on(axis) < middle;
    let mut left_count = items.par_iter().with_min_len(ALONE).filter(|item| is_left(item)).count();
    if left_count == 0 || left_count == count {
        left_count = count / 2;
    } else {
        partition(items, spare, left_count, is_left);
        items.par_chunks_mut(ALONE).zip(spare.par_chunks(ALONE)).for_each(|(to, from)| to.copy_from_slice(from));
    }
    let (left_items, right_items) = items.split_at_mut(left_count);
    let (left_spare, right_spare) = spare.split_at_mut(left_count);
    let mut on_left = || parts(left_items, left_spare, most, depth + 1);
    let mut on_right = || parts(right_items, right_spare, most, depth + 1);
    let (mut left, right) =
        if count < ALONE || depth >= DIVIDED_ABOVE { (on_left(), on_right()) } else { rayon::join(on_left, on_right) };
    left.extend(right);
    left
}

/// What pruning knows of a subtree.
#[derive(Debug, Clone, Copy)]
struct MiniNode {
    bounds: Bounds,
    area: f32,
    /// The area of its smallest leaf.
    least_leaf: f32,
}

/// A sweep over a part, and what is in its slots.
struct MiniTree<'a> {
    items: &'a [Item],
    /// Of positions in `items`.
    tree: Topology,
    nodes: Vec<MiniNode>,
    whole: MiniNode,
}

/// A subtree of a mini tree that the top of the tree is built over.
#[derive(Debug, Clone, Copy)]
struct MiniRoot {
    mini: u32,
    bounds: Bounds,
    span: Span,
}

impl<'a> MiniTree<'a> {
    fn new(items: &'a [Item], costs: &Collapse, single: bool) -> MiniTree<'a> {
        let tree = sweep::positions(items, costs, single);
        let mut nodes = vec![MiniNode::NONE; tree.splits.len()];
        let whole = measured(items, &tree.order, &tree.splits, &mut nodes);
        MiniTree { items, tree, nodes, whole }
    }

    /// Its subtrees once it is pruned, from left to right.
    fn roots(&self, mini: u32, threshold: f32) -> Vec<MiniRoot> {
        let mut roots = Vec::new();
        let mut next = vec![(self.whole, Span::whole(self.items.len()))];
        while let Some((node, span)) = next.pop() {
            if node.area <= threshold || node.least_leaf >= threshold {
                roots.push(MiniRoot { mini, bounds: node.bounds, span });
                continue;
            }
            let children = span.children(self.tree.splits[span.slot as usize]);
            next.extend(children.into_iter().rev().map(|child| (self.node(child), child)));
        }
        roots
    }

    fn node(&self, span: Span) -> MiniNode {
        match span.count {
            1 => MiniNode::leaf(self.items, &self.tree.order[span.primitives()]),
            _ => self.nodes[span.slot as usize],
        }
    }
}

impl MiniNode {
    const NONE: MiniNode = MiniNode { bounds: Bounds::EMPTY, area: 0.0, least_leaf: 0.0 };

    fn leaf(items: &[Item], order: &[u32]) -> MiniNode {
        let bounds = order.iter().fold(Bounds::EMPTY, |bounds, &i| bounds.union(items[i as usize].bounds()));
        let area = bounds.half_area();
        MiniNode { bounds, area, least_leaf: area }
    }
}

/// Fills in the nodes of a subtree.
fn measured(items: &[Item], order: &[u32], splits: &[u32], nodes: &mut [MiniNode]) -> MiniNode {
    let (Some((&split, splits)), Some((node, nodes))) = (splits.split_first(), nodes.split_first_mut()) else {
        return MiniNode::leaf(items, order);
    };
    *node = if split == LEAF {
        MiniNode::leaf(items, order)
    } else {
        let (left_order, right_order) = order.split_at(split as usize);
        let (left_splits, right_splits) = splits.split_at(split as usize - 1);
        let (left_nodes, right_nodes) = nodes.split_at_mut(split as usize - 1);
        let left = measured(items, left_order, left_splits, left_nodes);
        let right = measured(items, right_order, right_splits, right_nodes);
        let bounds = left.bounds.union(right.bounds);
        MiniNode { bounds, area: bounds.half_area(), least_leaf: left.least_leaf.min(right.least_leaf) }
    };
    *node
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::bounds::tests::boxes;

    /// Pruning as the thesis has it (section 3.3.3). It walks depth first to the first node smaller than the threshold. What was
    /// left behind on the way, and that node, are roots; what still waits is pruned in the same way; the path to the node is
    /// deleted. The stack of the path only says what is deleted, and is not kept here.
    fn pruned_by_stacks(mini: &MiniTree<'_>, threshold: f32) -> Vec<Span> {
        /// What the walk does next.
        enum Step {
            Visit(Span),
            /// Both children have been walked and hold nothing small: their parent takes their place among the roots.
            Join(Span),
        }
        let mut pruned = Vec::new();
        let mut to_check = vec![Span::whole(mini.items.len())];
        while let Some(span) = to_check.pop() {
            if mini.node_of(span).area <= threshold {
                pruned.push(span);
                continue;
            }
            let (mut traversal, mut roots) = (vec![Step::Visit(span)], Vec::new());
            while let Some(step) = traversal.pop() {
                match step {
                    Step::Join(parent) => {
                        roots.truncate(roots.len() - 2);
                        roots.push(parent);
                    }
                    Step::Visit(node) if mini.node_of(node).area < threshold => {
                        roots.push(node);
                        let waiting = traversal.drain(..).filter_map(|step| match step {
                            Step::Visit(node) => Some(node),
                            Step::Join(_) => None,
                        });
                        to_check.extend(waiting);
                    }
                    Step::Visit(node) => match mini.children_of(node) {
                        None => roots.push(node),
                        Some([left, right]) => {
                            traversal.extend([Step::Join(node), Step::Visit(right), Step::Visit(left)])
                        }
                    },
                }
            }
            pruned.extend(roots);
        }
        pruned
    }

    impl MiniTree<'_> {
        fn node_of(&self, span: Span) -> MiniNode {
            let items: Vec<Item> = self.tree.order[span.primitives()].iter().map(|&i| self.items[i as usize]).collect();
            let bounds = crate::bvh::bounds::around(&items);
            MiniNode { bounds, area: bounds.half_area(), least_leaf: f32::NAN }
        }

        fn children_of(&self, span: Span) -> Option<[Span; 2]> {
            let split = (span.count > 1).then(|| self.tree.splits[span.slot as usize])?;
            (split != LEAF).then(|| span.children(split))
        }
    }

    #[test]
    fn pruning_is_that_of_the_thesis_with_its_stacks() {
        let mut roots_seen = Vec::new();
        for count in [1, 2, 3, 40, 300] {
            let items = boxes(count);
            for single in [false, true] {
                let mini = MiniTree::new(&items, &Collapse::SAH, single);
                for part in [0.0, 0.001, 0.01, 0.03, 0.1, 0.3, 0.9, 1.5] {
                    let threshold = part * mini.whole.area;
                    let key = |span: &Span| (span.first, span.count);
                    let ours: Vec<_> = mini.roots(0, threshold).iter().map(|root| key(&root.span)).collect();
                    let theirs: Vec<_> = pruned_by_stacks(&mini, threshold).iter().map(key).collect();
                    assert_eq!(ours, theirs, "{count} boxes, {part} of their area");
                    roots_seen.push(ours.len());
                }
            }
        }
        assert!(roots_seen.iter().any(|&roots| roots > 50) && roots_seen.contains(&1));
    }
}
