//! The bytes of a tree: its nodes level by level, the references in the order of the leaves; behind them, one after the other, the
//! subtrees that lie together.

use super::Subtree;
use super::heuristic::Heuristic;
use crate::bvh::layout::{MAGIC, Triangle};
use crate::geometry::Aabb;
use crate::kdtree::layout::{KIND, KdHeader, KdNode, KdTree, MAX_NODES, MAX_REFERENCES};
use crate::{Error, Result};
use bytemuck::Zeroable;

/// The structure of a root over `records`, with this number of primitives and this status.
pub fn assemble(
    root: Subtree,
    heuristic: &Heuristic,
    (cell, reach): (Aabb, f32),
    records: Vec<Triangle>,
    (primitive_count, status): (u32, u32),
) -> Result<KdTree> {
    let mut header = KdHeader {
        magic: MAGIC,
        kind: KIND,
        status,
        primitive_count,
        lo: cell.lo,
        hi: cell.hi,
        active: records.len() as u32,
        geometry_count: 1,
        area_scale: heuristic.area_scale,
        reach,
        ..KdHeader::zeroed()
    };
    let is_empty = matches!(root, Subtree::Empty);
    header.empty_leaves = u32::from(is_empty);
    let mut parts = KdParts { header, nodes: Vec::new(), references: Vec::new() };
    parts.write(if is_empty { Vec::new() } else { vec![(root, 0)] })?;
    let KdParts { mut header, nodes, references } = parts;
    header.node_count = nodes.len() as u32;
    header.reference_count = references.len() as u32;
    header.node_room = header.node_count;
    header.reference_room = header.reference_count;
    header.record_room = header.active;
    Ok(KdTree { header, nodes, references, records, geometries: Vec::new() })
}

/// What is written so far.
pub struct KdParts {
    /// Counts of what was written are added to what it has.
    pub header: KdHeader,
    /// Nodes, the roots first.
    pub nodes: Vec<KdNode>,
    /// References, in the order of the leaves.
    pub references: Vec<u32>,
}

impl KdParts {
    /// Writes what is below these roots, none of them empty, at these depths; the roots themselves come first.
    pub fn write(&mut self, roots: Vec<(Subtree, u32)>) -> Result<()> {
        let mut level = roots;
        // What lies together, behind all levels: where its root is, at which depth, and what it is.
        let mut together = Vec::new();
        while !level.is_empty() {
            // The children come behind the nodes of this level.
            let mut next = Vec::new();
            let first_child = self.nodes.len() + level.len();
            for (subtree, depth) in level {
                self.header.depth = self.header.depth.max(depth);
                if let Subtree::Together(subtree) = subtree {
                    together.push((self.nodes.len(), depth, subtree));
                    self.nodes.push(KdNode::zeroed());
                    continue;
                }
                let (node, children) = self.node_of(subtree, first_child + next.len())?;
                self.nodes.push(node);
                next.extend(children.into_iter().map(|child| (child, depth + 1)));
            }
            level = next;
        }
        together.into_iter().try_for_each(|(at, depth, subtree)| self.write_together(at, depth, *subtree))
    }

    /// A node whose children, those that are not empty, are to lie from `first_child` on; and these.
    fn node_of(&mut self, subtree: Subtree, first_child: usize) -> Result<(KdNode, Vec<Subtree>)> {
        match subtree {
            Subtree::Empty | Subtree::Together(_) => {
                unreachable!("an empty leaf has no node, what lies together is apart")
            }
            Subtree::Leaf(records) => {
                let first = self.references.len();
                within("references", first + records.len(), MAX_REFERENCES)?;
                self.references.extend(&records);
                self.header.leaves += 1;
                Ok((KdNode::leaf(first as u32, records.len() as u32), Vec::new()))
            }
            Subtree::Inner { plane, children } => {
                let empty = children.each_ref().map(|child| matches!(child, Subtree::Empty));
                within("nodes", first_child + 2, MAX_NODES)?;
                self.header.inner_nodes += 1;
                self.header.empty_leaves += empty.map(u32::from).iter().sum::<u32>();
                let children = children.into_iter().filter(|child| !matches!(child, Subtree::Empty)).collect();
                Ok((KdNode::inner(plane.axis, plane.at, first_child as u32, empty), children))
            }
        }
    }

    /// Writes a subtree whose root is the node `at`: of each node the children side by side, then what is below the left one.
    fn write_together(&mut self, at: usize, depth: u32, subtree: Subtree) -> Result<()> {
        let first_child = self.nodes.len();
        let (node, children) = self.node_of(subtree, first_child)?;
        self.nodes[at] = node;
        self.nodes.extend(children.iter().map(|_| KdNode::zeroed()));
        self.header.depth = self.header.depth.max(depth);
        children
            .into_iter()
            .enumerate()
            .try_for_each(|(i, child)| self.write_together(first_child + i, depth + 1, child))
    }
}

fn within(what: &str, count: usize, most: u64) -> Result<()> {
    if count as u64 <= most {
        return Ok(());
    }
    Err(Error::Argument(format!(
        "the kd-tree would have more than {most} {what}, which its layout cannot name; split the scene into several structures"
    )))
}
