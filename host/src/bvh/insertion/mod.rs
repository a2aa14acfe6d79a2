//! A tree that subtrees are taken out of and put in again, each where it costs least.
//!
//! Bittner, Hapala, Havran 2013, "Fast Insertion-Based Optimization of Bounding Volume Hierarchies"; Frantál 2019, section 3.4. The
//! tree is in this file, the search for the best place in `search.rs`, the choice of nodes in `inefficiency.rs`, and the
//! optimisation of a finished tree in `optimise.rs`. Incremental construction uses the same tree.

mod inefficiency;
mod optimise;
mod search;

pub use inefficiency::Inefficiency;
pub(super) use inefficiency::{Selection, part_of};
pub(super) use optimise::{optimise, reinsert, shuffle};
pub(super) use search::Search;

use super::bounds::{Bounds, Item};
use super::topology::{LEAF, Span, Topology};
use hedgerow::{Error, Result};

/// How far insertion-based optimisation goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InsertionOptions {
    /// The part of the inner nodes that are taken out in an iteration, more than 0 and at most 1.
    pub fraction: f32,
    /// Which nodes those are.
    pub measure: Inefficiency,
    /// How many iterations there are between two looks at the cost, at least 1.
    pub patience: u32,
    /// The same when nodes are chosen at random, behind the others; 0 for no such iterations.
    pub random_patience: u32,
    /// The part of the cost that must be gained between two looks for more iterations of the kind to follow, less than 1.
    pub least_gain: f32,
    /// The most iterations of either kind, however much they still gain; at least 1.
    pub most: u32,
}

impl InsertionOptions {
    /// The paper's, which goes on for as long as there is any gain: it has no least gain.
    pub const PAPER: InsertionOptions = InsertionOptions {
        fraction: 0.01,
        measure: Inefficiency::Combined,
        patience: 10,
        random_patience: 5,
        least_gain: 1e-4,
        most: 10_000,
    };

    /// Those of the paper with another measure.
    pub const fn by(measure: Inefficiency) -> InsertionOptions {
        InsertionOptions { measure, ..InsertionOptions::PAPER }
    }

    /// Whether they can be used.
    ///
    /// # Errors
    /// [`Error::Argument`] names the option that cannot be used, and what can.
    pub fn check(&self) -> Result<()> {
        let InsertionOptions { fraction, patience, least_gain, most, .. } = *self;
        check_fraction(fraction)?;
        if !(0.0..1.0).contains(&least_gain) {
            let range = "take 0 or more and less than 1";
            return Err(Error::Argument(format!("a least gain of {least_gain} cannot be used; {range}")));
        }
        let iterations = |what: &str| {
            Err(Error::Argument(format!("{what} of 0 iterations cannot be used; take 1 or more iterations")))
        };
        match (patience, most) {
            (0, _) => iterations("a patience"),
            (_, 0) => iterations("an optimisation"),
            _ => Ok(()),
        }
    }
}

/// Whether this part of the nodes can be taken out.
pub(super) fn check_fraction(fraction: f32) -> Result<()> {
    // Not a number is not more than 0.
    if fraction > 0.0 && fraction <= 1.0 {
        return Ok(());
    }
    let range = "take more than 0 and at most 1";
    Err(Error::Argument(format!("a fraction of {fraction} of the nodes cannot be used; {range}")))
}

/// Where a subtree hangs: 2 · its parent + side, or [`ROOT`].
pub(super) type Link = u32;

/// Where the whole tree hangs.
pub(super) const ROOT: Link = Link::MAX;

/// An inner node: a line of the cache. Of a child that is a leaf the item names the primitive and its weight is 1; of another it
/// names the node, and the weight is the number of primitives below.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
struct InnerNode {
    children: [Item; 2],
}

impl InnerNode {
    const UNUSED: InnerNode = InnerNode { children: [Item::NONE; 2] };

    #[inline(always)]
    fn bounds(&self) -> Bounds {
        self.children[0].bounds().union(self.children[1].bounds())
    }

    #[inline(always)]
    fn weight(&self) -> u32 {
        self.children[0].weight() + self.children[1].weight()
    }
}

/// A node that was taken out: its subtrees, and the nodes that are free now.
#[derive(Debug)]
pub(super) struct Taken {
    pub children: [Item; 2],
    pub free: [u32; 2],
    /// What that took off the sum of all areas.
    pub gain: f32,
    /// Where the node hung: on which side of its parent, and where that did.
    side: u32,
    above: Link,
}

impl Taken {
    /// The children, the one of the larger area before the other.
    pub fn larger_first(&self) -> [Item; 2] {
        let [left, right] = self.children;
        if right.bounds().half_area() > left.bounds().half_area() { [right, left] } else { [left, right] }
    }
}

/// A binary tree whose nodes know their parents.
#[derive(Debug, Clone)]
pub(super) struct InsertionTree {
    nodes: Vec<InnerNode>,
    /// Where each node hangs.
    parents: Vec<Link>,
    /// The whole tree; [`Item::NONE`] where there is nothing in it.
    root: Item,
}

impl InsertionTree {
    /// A tree of nothing, with nodes for `count` primitives.
    pub fn with_room(count: usize) -> InsertionTree {
        let inner = count.saturating_sub(1);
        InsertionTree { nodes: vec![InnerNode::UNUSED; inner], parents: vec![ROOT; inner], root: Item::NONE }
    }

    /// That of a topology; `items` are its primitives from left to right. A leaf of several is divided in the middle.
    pub fn of_topology(topology: &Topology, items: &[Item]) -> InsertionTree {
        let mut tree = InsertionTree::with_room(items.len());
        let mut spans = vec![[Span::whole(0); 2]; tree.nodes.len()];
        let mut next = Vec::new();
        if items.len() > 1 {
            next.push(Span::whole(items.len()));
        }
        while let Some(span) = next.pop() {
            let left_count = match topology.splits[span.slot as usize] {
                LEAF => span.count / 2,
                split => split,
            };
            let children = span.children(left_count);
            spans[span.slot as usize] = children;
            next.extend(children.into_iter().filter(|child| child.count > 1));
        }
        // Slots are depth first: the children's come behind their parent's.
        for (node, children) in spans.iter().enumerate().rev() {
            for (span, side) in children.iter().zip(0..) {
                tree.nodes[node].children[side] = match span.count {
                    1 => items[span.first as usize],
                    count => Item::new(tree.nodes[span.slot as usize].bounds(), span.slot, count),
                };
                if span.count > 1 {
                    tree.parents[span.slot as usize] = 2 * node as u32 + side as u32;
                }
            }
        }
        tree.root = match items {
            [] => Item::NONE,
            [item] => *item,
            _ => Item::new(tree.nodes[0].bounds(), 0, items.len() as u32),
        };
        tree
    }

    /// The same without boxes.
    pub fn topology(&self) -> Topology {
        let count = self.root.weight() as usize;
        let (mut order, mut splits) = (Vec::with_capacity(count), Vec::with_capacity(count));
        let mut next = Vec::new();
        if count > 0 {
            next.push(self.root);
        }
        while let Some(item) = next.pop() {
            match self.children(&item) {
                None => order.push(item.primitive()),
                Some([left, right]) => {
                    splits.push(left.weight());
                    next.extend([*right, *left]);
                }
            }
        }
        Topology { order, splits }
    }

    /// How many inner nodes there is room for. All of them are in use in a tree of all primitives.
    pub fn room(&self) -> usize {
        self.nodes.len()
    }

    /// What hangs at a link.
    #[inline(always)]
    pub fn at(&self, link: Link) -> &Item {
        match link {
            ROOT => &self.root,
            _ => &self.nodes[link as usize >> 1].children[link as usize & 1],
        }
    }

    /// The subtrees of one that is not a leaf.
    #[inline(always)]
    pub fn children(&self, item: &Item) -> Option<&[Item; 2]> {
        (item.weight() > 1).then(|| &self.nodes[item.primitive() as usize].children)
    }

    /// The children of a node.
    #[inline(always)]
    pub fn children_of(&self, node: u32) -> &[Item; 2] {
        &self.nodes[node as usize].children
    }

    /// The nodes above `node` and itself, from below.
    pub fn path(&self, node: u32) -> impl Iterator<Item = u32> {
        let up = |&node: &u32| (self.parents[node as usize] != ROOT).then(|| self.parents[node as usize] >> 1);
        std::iter::successors(Some(node), up)
    }

    fn hang(&mut self, item: Item, link: Link) {
        match link {
            ROOT => self.root = item,
            _ => self.nodes[link as usize >> 1].children[link as usize & 1] = item,
        }
        if item.weight() > 1 {
            self.parents[item.primitive() as usize] = link;
        }
    }

    /// A subtree of two, made of a free node. It hangs nowhere yet.
    pub fn join(&mut self, children: [Item; 2], free: u32) -> Item {
        for (child, side) in children.into_iter().zip(0..) {
            self.hang(child, 2 * free + side);
        }
        let node = &self.nodes[free as usize];
        Item::new(node.bounds(), free, node.weight())
    }

    /// Takes a node and its parent out, with what is below the node; its sibling takes the parent's place. The root cannot be taken
    /// out.
    pub fn take_out(&mut self, node: u32) -> Option<Taken> {
        let link = self.parents[node as usize];
        if link == ROOT {
            return None;
        }
        let (parent, sibling) = (link >> 1, *self.at(link ^ 1));
        let above = self.parents[parent as usize];
        let own = [self.at(link), self.at(above)].map(|item| item.bounds().half_area());
        self.hang(sibling, above);
        let taken = self.nodes[node as usize];
        let less = self.refit(above, 0u32.wrapping_sub(taken.weight()));
        let gain = (own[0] + own[1]) - less;
        Some(Taken { children: taken.children, free: [node, parent], gain, side: link & 1, above })
    }

    /// Undoes [`InsertionTree::take_out`]; since then the tree has not changed, or has become the same again.
    pub fn put_back(&mut self, taken: &Taken) {
        let Taken { children, free: [node, parent], side, above, .. } = *taken;
        let item = self.join(children, node);
        let sibling = *self.at(above);
        let both = if side == 0 { [item, sibling] } else { [sibling, item] };
        let both = self.join(both, parent);
        self.hang(both, above);
        self.refit(above, item.weight());
    }

    /// Undoes [`InsertionTree::put_in`], likewise.
    pub fn pull_out(&mut self, link: Link, free: u32) {
        let [was, item] = self.nodes[free as usize].children;
        self.hang(was, link);
        self.refit(link, 0u32.wrapping_sub(item.weight()));
    }

    /// Puts a subtree beside what hangs at `link`, under a node that is free.
    pub fn put_in(&mut self, item: Item, link: Link, free: u32) {
        if self.root.weight() == 0 {
            return self.hang(item, ROOT);
        }
        let both = self.join([*self.at(link), item], free);
        self.hang(both, link);
        self.refit(link, item.weight());
    }

    /// Makes boxes above a link fit again, as far up as they change, and adds to all weights there. How much area that adds.
    fn refit(&mut self, mut link: Link, more: u32) -> f32 {
        let (mut is_changed, mut growth) = (true, 0.0);
        while link != ROOT {
            let node = link >> 1;
            link = self.parents[node as usize];
            let was = *self.at(link);
            let mut bounds = was.bounds();
            if is_changed {
                bounds = self.nodes[node as usize].bounds();
                is_changed = bounds != was.bounds();
                if is_changed {
                    growth += bounds.half_area() - was.bounds().half_area();
                }
            }
            let item = Item::new(bounds, node, was.weight().wrapping_add(more));
            match link {
                ROOT => self.root = item,
                _ => self.nodes[link as usize >> 1].children[link as usize & 1] = item,
            }
        }
        growth
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::bounds::tests::boxes;
    use crate::bvh::sweep;
    use hedgerow::bvh::sah::Collapse;

    pub(super) fn swept(items: &[Item]) -> InsertionTree {
        let topology = sweep::positions(items, &Collapse::SAH, true);
        let sorted: Vec<Item> = topology.order.iter().map(|&i| items[i as usize]).collect();
        InsertionTree::of_topology(&topology, &sorted)
    }

    /// Every box fits, every weight counts, every parent is one, and every primitive is there once.
    fn check(tree: &InsertionTree, count: u32) {
        let mut primitives: Vec<u32> = tree.topology().order;
        primitives.sort_unstable();
        assert!(primitives.into_iter().eq(0..count));
        assert_eq!(tree.root.weight(), count);
        let mut links = vec![ROOT];
        while let Some(link) = links.pop() {
            let item = tree.at(link);
            if tree.children(item).is_some() {
                let node = &tree.nodes[item.primitive() as usize];
                assert_eq!((item.bounds(), item.weight()), (node.bounds(), node.weight()));
                assert_eq!(tree.parents[item.primitive() as usize], link);
                links.extend([0, 1].map(|side| 2 * item.primitive() + side));
            }
        }
    }

    #[test]
    fn taking_out_and_putting_in_leaves_every_box_tight() {
        for count in [3, 4, 60, 200] {
            let mut tree = swept(&boxes(count));
            check(&tree, count);
            for step in 0..300u32 {
                let Some(taken) = tree.take_out(step % (count - 1)) else { continue };
                if step % 3 == 0 {
                    // And back again, which leaves no trace.
                    tree.put_back(&taken);
                    check(&tree, count);
                    let Some(again) = tree.take_out(step % (count - 1)) else { continue };
                    assert_eq!(again.gain, taken.gain);
                }
                for (child, free) in taken.children.into_iter().zip(taken.free) {
                    // Anywhere in the tree, by a walk down.
                    let (mut link, mut turns) = (ROOT, step.wrapping_mul(2_654_435_761) >> 8);
                    while tree.children(tree.at(link)).is_some() && turns % 5 > 0 {
                        link = 2 * tree.at(link).primitive() + turns % 2;
                        turns /= 3;
                    }
                    tree.put_in(child, link, free);
                    tree.pull_out(link, free);
                    tree.put_in(child, link, free);
                }
                check(&tree, count);
            }
        }
    }

    #[test]
    fn a_tree_becomes_the_topology_that_it_was_made_of() {
        for count in [0, 1, 2, 3, 100] {
            let items = boxes(count);
            let topology = sweep::positions(&items, &Collapse::SAH, true);
            assert_eq!(swept(&items).topology(), topology);
        }
    }

    #[test]
    fn options_out_of_their_ranges_are_refused() {
        let paper = InsertionOptions::PAPER;
        assert!(paper.check().is_ok());
        for (options, says) in [
            (InsertionOptions { fraction: 0.0, ..paper }, "more than 0 and at most 1"),
            (InsertionOptions { fraction: f32::NAN, ..paper }, "more than 0 and at most 1"),
            (InsertionOptions { least_gain: 1.0, ..paper }, "0 or more and less than 1"),
            (InsertionOptions { patience: 0, ..paper }, "take 1 or more iterations"),
            (InsertionOptions { most: 0, ..paper }, "take 1 or more iterations"),
        ] {
            let error = options.check().expect_err("wrong").to_string();
            assert!(error.contains(says), "{error}");
        }
    }
}
