//! Merging as the device does it (Papay 2025, section 10.3): of each leaf of the static tree that triangles of objects are in, a
//! *marked* leaf, one tree is built over what it had and what has come, in its cell.
//!
//! `hedgerow-host` instead takes trees of the objects apart, which a device does badly. This is the twin of
//! [`crate::kdtree::merge`]: a function of the static tree and of the objects, the same bytes.
//!
//! A triangle is in a leaf where clipping it to the leaf's cell leaves something, however the leaf was found; so a triangle that
//! ends at a plane, or lies in it, is on both of its sides.

use super::assemble::KdParts;
use super::clip::{KdReference, bounds_of, cell_around, clipped};
use super::heuristic::Heuristic;
use super::{InTurn, Subtree, binned};
use crate::bvh::layout::Triangle;
use crate::bvh::sah::area_scale;
use crate::bvh::twin::lbvh;
use crate::geometry::Aabb;
use crate::kdtree::layout::{Inner, KdContent, KdNode, KdTree};
use crate::kdtree::termination::Costs;
use crate::{Error, Result};
use bytemuck::Zeroable;
use std::collections::BTreeMap;

/// Triangles that move; numbered from `first_primitive` on.
#[derive(Debug, Clone, Copy)]
pub struct HostObject<'a> {
    /// What hits of its first triangle say.
    pub first_primitive: u32,
    /// Vertices.
    pub positions: &'a [[f32; 3]],
    /// Three vertices each.
    pub triangles: &'a [[u32; 3]],
}

/// The static tree with objects merged into it, by `bins`, with exact splits of at most `exact` references. The tree's room is
/// not read.
///
/// # Errors
/// [`Error::Argument`] if objects are not numbered one behind the other and behind the static tree; [`Error::Argument`] if the
/// layout cannot name what there would be.
pub fn merge(still: &KdTree, objects: &[HostObject<'_>], costs: Costs, (bins, exact): (u32, u32)) -> Result<KdTree> {
    let mut header = still.header;
    let mut records = still.records.clone();
    let reach = header.reach;
    for object in objects {
        if object.first_primitive < header.primitive_count {
            return Err(Error::Argument(format!(
                "an object's primitives are numbered from {} on, there are {} before; number them apart and in order",
                object.first_primitive, header.primitive_count
            )));
        }
        for (corners, primitive) in lbvh::corners(object.positions, object.triangles).zip(object.first_primitive..) {
            match corners {
                Ok([v0, v1, v2]) => records.push(Triangle { v0, v1, v2, primitive }),
                Err(why) => header.status |= why,
            }
        }
        header.primitive_count = object.first_primitive + object.triangles.len() as u32;
    }
    header.active = records.len() as u32;
    let first = still.records.len();
    let around = |t: &Triangle| cell_around(&[t.v0, t.v1, t.v2], reach);
    let cell = records[first..].iter().fold(header.cell(), |cell, t| cell.union(&around(t)));
    if records.len() > first {
        (header.lo, header.hi, header.area_scale) = (cell.lo, cell.hi, area_scale(&cell));
    }
    let mut find = Find { still, records: &records, reach, marked: BTreeMap::new() };
    (first as u32..records.len() as u32).for_each(|record| find.record(record, cell));

    let heuristic = Heuristic::of_leaf(costs, &cell, still.header.primitive_count);
    let built = |leaf: &MarkedLeaf| {
        let bounds =
            |record: u32| KdReference { bounds: bounds_in(&leaf.cell, &records[record as usize], reach), record };
        let references = leaf.records(still).map(bounds).collect();
        binned::build(&InTurn, &heuristic.below(leaf.depth), (&records, reach), (bins, exact), leaf.cell, references)
    };
    let marked: Vec<(u32, MarkedLeaf)> = find.marked.into_iter().collect();
    let subtrees: Vec<Subtree> = marked.iter().map(|(_, leaf)| built(leaf)).collect();
    let roots = subtrees.into_iter().zip(&marked).map(|(subtree, (_, leaf))| (subtree, leaf.depth)).collect();

    let mut parts = KdParts { header, nodes: still.nodes.clone(), references: still.references.clone() };
    // A pair of nodes for each empty leaf and its sibling.
    let first_pair = parts.nodes.len();
    let pairs = marked.iter().filter(|(id, leaf)| *id != ROOT && leaf.node.is_none()).count();
    parts.nodes.resize(first_pair + 2 * pairs, KdNode::zeroed());
    let first_root = parts.nodes.len();
    parts.write(roots)?;
    hook(still, &mut parts, &marked, (first_pair, first_root));
    let KdParts { mut header, nodes, references } = parts;
    header.node_count = nodes.len() as u32;
    header.reference_count = references.len() as u32;
    header.node_room = header.node_room.max(header.node_count);
    header.reference_room = header.reference_room.max(header.reference_count);
    header.record_room = header.record_room.max(header.active);
    Ok(KdTree { header, nodes, references, records, geometries: still.geometries.clone() })
}

/// The leaf that is the root. The others are numbered by their parents and sides, as those that are empty have no node.
const ROOT: u32 = 0;

fn id_of(parent: u32, side: usize) -> u32 {
    2 * parent + side as u32 + 1
}

/// A static leaf that triangles of objects are in.
struct MarkedLeaf {
    /// `None` of an empty one.
    node: Option<u32>,
    cell: Aabb,
    depth: u32,
    /// Of objects, ascending.
    records: Vec<u32>,
}

impl MarkedLeaf {
    /// Those of the static tree, then those of objects.
    fn records<'a>(&'a self, still: &'a KdTree) -> impl Iterator<Item = u32> + 'a {
        let range = match self.node.map(|node| still.nodes[node as usize].content()) {
            Some(KdContent::Leaf(range)) => range,
            _ => 0..0,
        };
        still.references[range].iter().chain(&self.records).copied()
    }
}

/// The box of a triangle's part in a leaf's cell. What was referenced there and is beside it by rounding stays, at a face.
fn bounds_in(cell: &Aabb, t: &Triangle, reach: f32) -> Aabb {
    let corners = [t.v0, t.v1, t.v2];
    let whole = || bounds_of(&corners, reach);
    clipped(&corners, reach, cell).unwrap_or_else(|| {
        let within = |x: [f32; 3]| std::array::from_fn(|i| x[i].max(cell.lo[i]).min(cell.hi[i]));
        Aabb { lo: within(whole().lo), hi: within(whole().hi) }
    })
}

struct Find<'a> {
    still: &'a KdTree,
    records: &'a [Triangle],
    reach: f32,
    marked: BTreeMap<u32, MarkedLeaf>,
}

/// A node on the way down; an empty leaf has none.
#[derive(Clone, Copy)]
struct VisitedNode {
    id: u32,
    node: Option<u32>,
    cell: Aabb,
    depth: u32,
}

impl Find<'_> {
    fn record(&mut self, record: u32, cell: Aabb) {
        let t = self.records[record as usize];
        let corners = [t.v0, t.v1, t.v2];
        let bounds = bounds_of(&corners, self.reach);
        let root = (!self.still.nodes.is_empty()).then_some(0);
        let mut stack = vec![VisitedNode { id: ROOT, node: root, cell, depth: 0 }];
        while let Some(place) = stack.pop() {
            let inner = match place.node.map(|node| (node, self.still.nodes[node as usize].content())) {
                Some((node, KdContent::Inner(inner))) => (node, inner),
                _ => {
                    if clipped(&corners, self.reach, &place.cell).is_some() {
                        let VisitedNode { id, node, cell, depth } = place;
                        let new = || MarkedLeaf { node, cell, depth, records: Vec::new() };
                        self.marked.entry(id).or_insert_with(new).records.push(record);
                    }
                    continue;
                }
            };
            let (node, inner) = inner;
            let sides = [bounds.lo[inner.axis] <= inner.plane, bounds.hi[inner.axis] >= inner.plane];
            for (side, cell) in inner.halves(&place.cell).into_iter().enumerate().filter(|&(side, _)| sides[side]) {
                let (id, node) = (id_of(node, side), inner.children[side]);
                stack.push(VisitedNode { id, node, cell, depth: place.depth + 1 });
            }
        }
    }
}

/// Puts the roots in the places of the marked leaves. An empty leaf has none: its parent gets a new pair of children, and what was
/// its only child moves there.
fn hook(still: &KdTree, parts: &mut KdParts, marked: &[(u32, MarkedLeaf)], (first_pair, first_root): (usize, usize)) {
    let KdParts { header, nodes, .. } = parts;
    let mut moved = BTreeMap::new();
    let mut pair = first_pair as u32;
    // The moves first: what is hooked then finds its place.
    for &(id, _) in marked.iter().filter(|(id, leaf)| *id != ROOT && leaf.node.is_none()) {
        let (parent, side) = ((id - 1) / 2, (id - 1) % 2);
        if let KdContent::Inner(Inner { children, .. }) = still.nodes[parent as usize].content()
            && let Some(sibling) = children[1 - side as usize]
        {
            nodes[(pair + 1 - side) as usize] = still.nodes[sibling as usize];
            moved.insert(sibling, pair + 1 - side);
        }
        header.replaced_nodes += 1;
        pair += 2;
    }
    let place = |node: u32| *moved.get(&node).unwrap_or(&node) as usize;
    let mut pair = first_pair as u32;
    for (i, (id, leaf)) in marked.iter().enumerate() {
        let root = nodes[first_root + i];
        match leaf.node {
            Some(node) => {
                nodes[place(node)] = root;
                header.leaves -= 1;
                header.replaced_references += leaf.records(still).count() as u32 - leaf.records.len() as u32;
            }
            None => header.empty_leaves -= 1,
        }
        if leaf.node.is_none() && *id == ROOT {
            continue;
        }
        // The root is where it belongs now, and not named where it was built.
        header.replaced_nodes += 1;
        if leaf.node.is_none() {
            let (parent, side) = ((id - 1) / 2, (id - 1) % 2);
            if let KdContent::Inner(Inner { axis, plane, .. }) = still.nodes[parent as usize].content() {
                nodes[place(parent)] = KdNode::inner(axis, plane, pair, [false; 2]);
            }
            nodes[(pair + side) as usize] = root;
            pair += 2;
        }
    }
}
