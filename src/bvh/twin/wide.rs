//! Collapsing a `Bvh2` into a wide tree, plainly: what [`crate::bvh::wide::device`] must equal, byte for byte.

mod costs;

use self::costs::{Choice, choices_of};
use super::far;
use crate::bvh::counts::LinkCount;
use crate::bvh::layout::{Bvh2, Child, Record};
use crate::bvh::sah::half_area_of_edges;
use crate::bvh::wide::layout::{Slots, Wide, WideNode, is_paired, leaf_max};
use crate::bvh::wide::pairs::{self, Part, Places};
use crate::bvh::wide::{LEVELS_BY_COST, PRIOR_WORK};
use crate::geometry::Aabb;
use std::collections::BTreeMap;
use std::ops::Range;

/// What rays did in a tree, two counts for each node slot; empty where nothing was counted. The same as
/// [`WideCounts`](crate::bvh::wide::device::WideCounts).
#[derive(Debug, Clone, Copy, Default)]
pub struct LinkCounts<'a> {
    /// Nodes are made to cost least by the rays that went into them, rather than by surface area.
    pub opened_by: &'a [LinkCount],
    /// Children in order are those first that end more rays for their work.
    pub ordered_by: &'a [LinkCount],
}

/// A wide node to be: the children of the binary nodes that it takes in, in slots.
struct Opened {
    /// The binary node that it begins with; 0 if the whole tree is a leaf.
    slot: u32,
    children: Slots,
    /// Node that names it, and which of that one's nodes it is.
    place: Option<(u32, u32)>,
}

impl<N: WideNode, R: Record> Wide<N, R> {
    /// The wide tree of `tree`. One that is empty or cannot be traced is empty, with its status.
    pub fn of(tree: &Bvh2<R>) -> Wide<N, R> {
        Wide::of_counts(tree, &LinkCounts::default())
    }

    /// The same by counts of the tree's links.
    ///
    /// # Panics
    /// There are some, but fewer than two a node slot.
    pub fn of_counts(tree: &Bvh2<R>, counts: &LinkCounts<'_>) -> Wide<N, R> {
        for counts in [counts.opened_by, counts.ordered_by] {
            assert!(counts.is_empty() || counts.len() >= 2 * tree.nodes.len(), "two counts a node slot");
        }
        let mut header = tree.header.compacted();
        (header.near_node, header.far_sides) = (0, 0);
        header.kind = Self::KIND;
        (header.root.index, header.root.count) = (0, 0);
        (header.node_slots, header.inner_nodes) = (1, 0);
        let geometries = tree.geometries.clone();
        if header.active == 0 {
            let places = if is_paired::<N, R>() { Places::Units(Vec::new()) } else { Places::InOrder };
            return Wide { header, nodes: vec![N::empty()], records: Vec::new(), places, geometries, far: Vec::new() };
        }
        let opened = open_all::<N, R>(tree, counts);
        let written = Written::<R>::of(&tree.records[..header.active as usize], is_paired::<N, R>());
        let written = opened.iter().fold(written, |written, node| written.with_leaves(&node.children));
        // The nodes that a node names lie behind those that others name whose binary nodes are in lower slots; records likewise.
        let first_children = running_sums(1, opened.iter().map(|o| (o.slot, o.node_children::<N, R>().count() as u32)));
        let first_records = running_sums(0, opened.iter().map(|o| (o.slot, written.units_in(&o.children))));
        let mut nodes = vec![N::empty(); opened.iter().map(|o| o.node_children::<N, R>().count()).sum::<usize>() + 1];
        // Where each record of the binary tree comes to lie.
        let mut units: Vec<u32> = (0..header.active).collect();
        let mut far = Vec::new();
        for node in &opened {
            let mut children = node.children;
            if N::FORM.is_quantised() {
                // The short leaves of a node side by side; long ones, which are nodes of their own, before them.
                let mut next_record = first_records[&node.slot];
                for long in [true, false] {
                    let leaves = children.iter_mut().flatten().filter(|c| c.is_leaf() && is_node::<N, R>(c) == long);
                    for leaf in leaves {
                        written.place(leaf, next_record, &mut units);
                        next_record += written.units(leaf);
                    }
                }
            }
            // From here on leaves count units.
            let is_node: [bool; 8] = std::array::from_fn(|s| children[s].as_ref().is_some_and(is_node::<N, R>));
            for leaf in children.iter_mut().flatten().filter(|child| child.is_leaf()) {
                let at = leaf.index as usize;
                (leaf.index, leaf.count) = (units[at], written.units(leaf));
            }
            let node_children = children.iter_mut().zip(is_node).filter(|(_, is_node)| *is_node);
            for (child, index) in node_children.flat_map(|(child, _)| child).zip(first_children[&node.slot]..) {
                if child.is_leaf() {
                    nodes[index as usize] = N::of_long_leaf(child.index, child.count);
                }
                (child.index, child.count) = (index, 0);
            }
            if node.place.is_none() && N::FORM.is_quantised() {
                far = far::tell_far(tree, &node.children, &children, &mut header);
            }
            let index = node.place.map_or(0, |(parent, rank)| first_children[&parent] + rank);
            nodes[index as usize] = N::of(&children);
        }
        (header.node_slots, header.inner_nodes) = (nodes.len() as u32, nodes.len() as u32);
        let (records, places) = written.in_order_of(&units);
        header.pairs = places.pairs();
        Wide { header, nodes, records, places, geometries, far }
    }
}

impl Opened {
    /// The children that are nodes.
    fn node_children<N: WideNode, R: Record>(&self) -> impl Iterator<Item = &Child> {
        self.children.iter().flatten().filter(|child| is_node::<N, R>(child))
    }
}

/// Whether a child of a wide node is a node: an inner one, or a leaf that is too long.
fn is_node<N: WideNode, R: Record>(child: &Child) -> bool {
    !child.is_leaf() || child.count > leaf_max::<N, R>()
}

/// How the records of the binary tree are written.
struct Written<'a, R: Record> {
    records: &'a [R],
    /// Empty where none may be pairs.
    parts: Vec<Part>,
}

impl<'a, R: Record> Written<'a, R> {
    fn of(records: &'a [R], is_paired: bool) -> Written<'a, R> {
        Written { records, parts: if is_paired { vec![Part::One; records.len()] } else { Vec::new() } }
    }

    fn range(leaf: &Child) -> Range<usize> {
        leaf.index as usize..(leaf.index + leaf.count) as usize
    }

    /// Knowing these leaves.
    fn with_leaves(mut self, children: &Slots) -> Self {
        let is_paired = !self.parts.is_empty();
        for leaf in children.iter().flatten().filter(|child| child.is_leaf() && is_paired) {
            let range = Written::<R>::range(leaf);
            self.parts[range.clone()].copy_from_slice(&pairs::parts_of(bytemuck::cast_slice(&self.records[range])));
        }
        self
    }

    /// What a leaf of the binary tree takes: units where some may be pairs, otherwise records.
    fn units(&self, leaf: &Child) -> u32 {
        if self.parts.is_empty() { leaf.count } else { pairs::units_of(&self.parts[Written::<R>::range(leaf)]) }
    }

    /// What all leaves among the children take.
    fn units_in(&self, children: &Slots) -> u32 {
        children.iter().flatten().filter(|child| child.is_leaf()).map(|leaf| self.units(leaf)).sum()
    }

    /// Lays the records of a leaf from unit `next` on.
    fn place(&self, leaf: &Child, mut next: u32, units: &mut [u32]) {
        for at in Written::<R>::range(leaf) {
            match self.parts.get(at) {
                None => (units[at], next) = (next, next + 1),
                Some(Part::Second) => {}
                Some(part) => {
                    units[at] = next;
                    if let Part::First(behind, _) = part {
                        units[at + behind] = next;
                    }
                    next += pairs::units_of(&[*part]);
                }
            }
        }
    }

    /// The records as they lie, and where.
    fn in_order_of(&self, units: &[u32]) -> (Vec<R>, Places) {
        let mut order: Vec<usize> = (0..units.len()).collect();
        // The first of a pair is before the second in the binary tree, too.
        order.sort_by_key(|&at| units[at]);
        let places = order.iter().map(|&at| units[at]).collect();
        let places = if self.parts.is_empty() { Places::InOrder } else { Places::Units(places) };
        (order.iter().map(|&at| self.records[at]).collect(), places)
    }
}

/// For each slot, `from` and the sum of those of lower slots.
fn running_sums(from: u32, values: impl Iterator<Item = (u32, u32)>) -> BTreeMap<u32, u32> {
    let mut sums: BTreeMap<u32, u32> = values.collect();
    let mut sum = from;
    for value in sums.values_mut() {
        sum += std::mem::replace(value, sum);
    }
    sums
}

/// All wide nodes to be, level by level.
fn open_all<N: WideNode, R: Record>(tree: &Bvh2<R>, counts: &LinkCounts<'_>) -> Vec<Opened> {
    let width = N::FORM.width();
    let choices = choices_of(tree, width, counts.opened_by);
    let mut opened: Vec<Opened> = Vec::new();
    let mut this_level = vec![(tree.header.root, None)];
    for level in 0.. {
        let mut next_level = Vec::new();
        for (root, place) in this_level {
            let is_closed = |child: &Child| level == 0 && N::FORM.is_quantised() && is_closed(tree, child);
            let apart = if level == 0 && N::FORM.is_quantised() { far::root_links(tree) } else { None };
            let children = open(tree, &choices, (&root, level, apart), is_closed, width, counts.ordered_by);
            let mut slots = [None; 8];
            if N::FORM.is_quantised() && tree.header.child_order == 0 {
                slots = octant_slots(&children);
            } else {
                slots.iter_mut().zip(&children).for_each(|(slot, child)| *slot = Some(*child));
            }
            let slot = if root.is_leaf() { 0 } else { root.index };
            let node = Opened { slot, children: slots, place };
            let inner = node.node_children::<N, R>().zip(0..).filter(|(child, _)| !child.is_leaf());
            next_level.extend(inner.map(|(&child, rank)| (child, Some((slot, rank)))));
            opened.push(node);
        }
        if next_level.is_empty() {
            return opened;
        }
        this_level = next_level;
    }
    unreachable!("a tree has an end")
}

/// Whether a visit of an inner child of a quantised root costs less than to have its children in the root, whose cells may be much larger
/// than they are: boxes in the root may be a cell longer.
fn is_closed<R: Record>(tree: &Bvh2<R>, child: &Child) -> bool {
    let edges = |child: &Child| child.bounds().scaled_edges(tree.header.area_scale);
    let area = |child: &Child| half_area_of_edges(edges(child));
    let whole = edges(&tree.header.root);
    let area_in_root = |child: &Child| {
        let edges = edges(child);
        half_area_of_edges(std::array::from_fn(|i| edges[i] + whole[i] * (1.0 / 128.0)))
    };
    let [left, right] = &tree.nodes[child.index as usize].children;
    area_in_root(left) + area_in_root(right) > area_in_root(child) + (area(left) + area(right))
}

/// The children of a wide node: those of the binary node, of which those are opened that are given several places ([`choices_of`]); far
/// down ([`LEVELS_BY_COST`]) the places are halved. A tree that is a leaf is its own child. Of links that stand `apart` the first, which is near,
/// stays closed, and the others begin with a place each. Children come as a walk meets them that takes left ones first, or, where the tree's
/// have an order, by hits.
fn open<R: Record>(
    tree: &Bvh2<R>,
    choices: &[Choice],
    (root, level, apart): (&Child, u32, Option<Vec<u32>>),
    is_closed: impl Fn(&Child) -> bool,
    width: u32,
    ordered_by: &[LinkCount],
) -> Vec<Child> {
    if root.is_leaf() {
        return vec![*root];
    }
    let by_cost = level < LEVELS_BY_COST;
    let choice = |child: &Child| choices[child.index as usize];
    // The links of a node's two children, with the places of theirs; the left one is taken next.
    let below = |child: &Child, places: u32| {
        let left = if by_cost { choice(child).left_of(places) } else { places / 2 };
        [(2 * child.index + 1, places - left), (2 * child.index, left)]
    };
    let child_at = |link: u32| tree.nodes[(link >> 1) as usize].children[(link & 1) as usize];
    let mut waiting = below(root, width).to_vec();
    // Places that the choices leave free.
    let mut room = if by_cost { width - choice(root).children() } else { 0 };
    let mut children = Vec::new();
    if let Some(links) = apart {
        room = width - links.len() as u32;
        waiting = links[1..].iter().rev().map(|&link| (link, 1)).collect();
        children.push((links[0], child_at(links[0])));
    }
    while let Some((link, mut places)) = waiting.pop() {
        let child = child_at(link);
        if by_cost && !child.is_leaf() {
            places = choice(&child).places_of(places);
            // What fits as a whole is taken in, even where sums of costs were too large to tell.
            let more = choice(&child).children() - 1;
            if places == 1 && more <= room {
                (places, room) = (width, room - more);
            }
        }
        if child.is_leaf() || places == 1 || is_closed(&child) {
            children.push((link, child));
        } else {
            waiting.extend(below(&child, places));
        }
    }
    if tree.header.child_order != 0 && !ordered_by.is_empty() {
        // Insertion, as the device does, so that equal ones stay as they are.
        for mut at in 1..children.len() {
            while at > 0 && ends_more_rays([at, at - 1].map(|at| ordered_by[children[at].0 as usize])) {
                children.swap(at, at - 1);
                at -= 1;
            }
        }
    }
    children.into_iter().map(|(_, child)| child).collect()
}

/// Whether the rays that went into the first of two children ended there for less work than those in the second.
fn ends_more_rays([first, second]: [LinkCount; 2]) -> bool {
    let worth = |hits: &LinkCount, beside: &LinkCount| hits.hits as f32 * (beside.work as f32 + PRIOR_WORK);
    worth(&first, &second) > worth(&second, &first)
}

/// The children in slots by the octants that they lie in (Ylitie, Karras, Laine 2017, section 3.1): a child gains by a slot what
/// its centre lies in the direction of that octant's corner. The paper maximises the sum of gains by auction; here children take
/// the best slot that is left, those that lie farthest from the middle first.
fn octant_slots(children: &[Child]) -> Slots {
    let bounds = children.iter().fold(Aabb::EMPTY, |b, child| b.union(&child.bounds()));
    // A quarter, so that a sum of three stays a float.
    let middle = |b: &Aabb| -> [f32; 3] { std::array::from_fn(|i| 0.25 * b.lo[i] + 0.25 * b.hi[i]) };
    let centre = middle(&bounds);
    let offsets: Vec<[f32; 3]> = children
        .iter()
        .map(|child| {
            let of_child = middle(&child.bounds());
            std::array::from_fn(|i| of_child[i] - centre[i])
        })
        .collect();
    let mut left: Vec<usize> = (0..children.len()).collect();
    let mut slots = [None; 8];
    while !left.is_empty() {
        let distance = |i: usize| offsets[i][0].abs() + offsets[i][1].abs() + offsets[i][2].abs();
        // Of equal ones the first.
        let farthest = (0..left.len()).rev().max_by(|&a, &b| distance(left[a]).total_cmp(&distance(left[b])));
        let child = left.remove(farthest.expect("some are left"));
        let gain = |slot: usize| {
            let [x, y, z]: [f32; 3] =
                std::array::from_fn(|i| if slot >> i & 1 != 0 { offsets[child][i] } else { -offsets[child][i] });
            x + y + z
        };
        let free = (0..8).rev().filter(|&slot: &usize| slots[slot].is_none());
        // −0 and 0 are equal gains.
        let best = free.max_by(|&a, &b| gain(a).partial_cmp(&gain(b)).expect("finite")).expect("eight slots");
        slots[best] = Some(children[child]);
    }
    slots
}
