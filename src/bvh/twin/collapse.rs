//! Collapsing, plainly: costs bottom-up, then a walk that makes leaves and puts their records side by side.

use crate::bvh::layout::{Bvh2, Child, MAX_DEPTH, Node, Record, UNUSED, status};
use crate::bvh::sah::{Collapse, area_scale};

/// What a subtree costs and holds.
#[derive(Debug, Clone, Copy)]
struct Weight {
    cost: f32,
    count: u32,
    is_leaf: bool,
}

impl<R: Record> Bvh2<R> {
    /// A finished tree made of one whose leaves have any records in any order: subtrees become leaves where `collapse` says that
    /// they are cheaper, or where they are as deep as tracers can walk ([`MAX_DEPTH`]; the status says so, the costs do not),
    /// and records lie in the order of a walk, left child first. Node slots stay; those that fall out are marked. The bytes
    /// of the device's (`src/bvh/collapse.rs`).
    pub fn collapsed(&self, collapse: &Collapse) -> Bvh2<R> {
        let mut tree = Bvh2 { nodes: vec![Node::UNUSED; self.nodes.len()], ..self.clone() };
        tree.header.inner_nodes = 0;
        if self.header.active == 0 {
            return tree;
        }
        let bounds = self.header.root.bounds();
        // A tree that was made of another has its scale, whose codes may have known a part that most of it is in.
        let known = self.header.area_scale;
        let scale = if known > 0.0 { known } else { area_scale(&bounds) };
        let weights = Weights { tree: self, collapse, scale, of_slot: self.weights(collapse, scale) };
        let root = weights.of(&self.header.root);
        let mut order = Vec::with_capacity(self.header.active as usize);
        tree.header.root = weights.place(self.header.root, 0, &mut tree, &mut order);
        tree.records[..order.len()].copy_from_slice(&order);
        tree.header.area_scale = scale;
        (tree.header.cost, tree.header.built_cost) = (root.cost, root.cost);
        tree.header.built_area = bounds.scaled_half_area(scale);
        tree
    }

    /// The weight of every slot that the tree has.
    fn weights(&self, collapse: &Collapse, scale: f32) -> Vec<Option<Weight>> {
        let mut weights = Weights { tree: self, collapse, scale, of_slot: vec![None; self.nodes.len()] };
        // Parents before their children; from the back, children before their parents.
        let mut slots = Vec::new();
        let mut next: Vec<Child> = vec![self.header.root];
        while let Some(child) = next.pop() {
            if !child.is_leaf() {
                slots.push(child);
                next.extend(self.nodes[child.index as usize].children);
            }
        }
        for child in slots.iter().rev() {
            let [left, right] = self.nodes[child.index as usize].children.map(|child| weights.of(&child));
            let area = child.bounds().scaled_half_area(scale);
            let count = left.count + right.count;
            let as_inner = collapse.inner_cost(area, left.cost, right.cost);
            let as_leaf = collapse.leaf_cost(area, count);
            let is_leaf = collapse.enabled && as_leaf < as_inner;
            let cost = if is_leaf { as_leaf } else { as_inner };
            weights.of_slot[child.index as usize] = Some(Weight { cost, count, is_leaf });
        }
        weights.of_slot
    }
}

struct Weights<'a, R: Record> {
    tree: &'a Bvh2<R>,
    collapse: &'a Collapse,
    scale: f32,
    of_slot: Vec<Option<Weight>>,
}

impl<R: Record> Weights<'_, R> {
    fn of(&self, child: &Child) -> Weight {
        if child.is_leaf() {
            let cost = self.collapse.leaf_cost(child.bounds().scaled_half_area(self.scale), child.count);
            return Weight { cost, count: child.count, is_leaf: true };
        }
        self.of_slot[child.index as usize].expect("children come before their parents")
    }

    /// Puts a subtree into `tree` and its records behind `order`; what names it then.
    fn place(&self, child: Child, depth: u32, tree: &mut Bvh2<R>, order: &mut Vec<R>) -> Child {
        let Weight { count, is_leaf, .. } = self.of(&child);
        let first = order.len() as u32;
        if is_leaf || depth == MAX_DEPTH {
            if !is_leaf {
                tree.header.status |= status::DEPTH_LIMITED;
            }
            let mut below = vec![child];
            while let Some(child) = below.pop() {
                if child.is_leaf() {
                    let records = child.index as usize..(child.index + child.count) as usize;
                    order.extend_from_slice(&self.tree.records[records]);
                } else {
                    let children = self.tree.nodes[child.index as usize].children;
                    let [left, right] = children;
                    below.extend([right, left]);
                    // The boxes of what falls out stay as they are.
                    let children = children.map(|child| Child { index: UNUSED, count: UNUSED, ..child });
                    tree.nodes[child.index as usize] = Node { children };
                }
            }
            return Child { index: first, count, ..child };
        }
        let [left, right] = self.tree.nodes[child.index as usize].children;
        tree.header.inner_nodes += 1;
        let left = self.place(left, depth + 1, tree, order);
        let right = self.place(right, depth + 1, tree, order);
        tree.nodes[child.index as usize] = Node { children: [left, right] };
        child
    }
}
