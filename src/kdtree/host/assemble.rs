//! The bytes of a tree: its nodes level by level, the references in the order of the leaves.

use super::Subtree;
use super::heuristic::Heuristic;
use crate::bvh::layout::{Aabb, MAGIC, Triangle};
use crate::kdtree::layout::{Header, KIND, KdTree, MAX_NODES, MAX_REFERENCES, Node};
use crate::{Error, Result};
use bytemuck::Zeroable;

/// The structure of a root over `records`, of so many primitives and with this status.
pub(super) fn assemble(
    root: Subtree,
    heuristic: &Heuristic,
    (cell, reach): (Aabb, f32),
    records: Vec<Triangle>,
    (primitive_count, status): (u32, u32),
) -> Result<KdTree> {
    let mut nodes = Vec::new();
    let mut references: Vec<u32> = Vec::new();
    let mut header = Header {
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
        ..Header::zeroed()
    };
    let mut level = vec![root];
    level.retain(|root| !matches!(root, Subtree::Empty));
    header.empty_leaves = u32::from(level.is_empty());
    while !level.is_empty() {
        // The children come behind the nodes of this level.
        let mut next = Vec::new();
        let first_child = nodes.len() + level.len();
        within("nodes", first_child, MAX_NODES)?;
        for subtree in level {
            match subtree {
                Subtree::Empty => unreachable!("an empty leaf has no node"),
                Subtree::Leaf(records) => {
                    within("references", references.len() + records.len(), MAX_REFERENCES)?;
                    nodes.push(Node::leaf(references.len() as u32, records.len() as u32));
                    references.extend(records);
                    header.leaves += 1;
                }
                Subtree::Inner { plane, children } => {
                    let empty = children.each_ref().map(|child| matches!(child, Subtree::Empty));
                    within("nodes", first_child + next.len() + 2, MAX_NODES)?;
                    nodes.push(Node::inner(plane.axis, plane.at, (first_child + next.len()) as u32, empty));
                    next.extend(children.into_iter().filter(|child| !matches!(child, Subtree::Empty)));
                    header.inner_nodes += 1;
                    header.empty_leaves += empty.map(u32::from).iter().sum::<u32>();
                }
            }
        }
        header.depth += u32::from(!next.is_empty());
        level = next;
    }
    header.node_count = nodes.len() as u32;
    header.reference_count = references.len() as u32;
    Ok(KdTree { header, nodes, references, records, geometries: Vec::new() })
}

fn within(what: &str, count: usize, most: u64) -> Result<()> {
    if count as u64 <= most {
        return Ok(());
    }
    Err(Error::Scene(format!(
        "the kd-tree would have more than {most} {what}, which its layout cannot name; split the scene into several structures"
    )))
}
