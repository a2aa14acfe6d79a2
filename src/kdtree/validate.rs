//! Walks a kd-tree on the host and says what is wrong and where.

use super::layout::{Inner, KdContent, KdTree, MAX_DEPTH};
use crate::bvh::layout::Triangle;
use crate::geometry::{Aabb, Polygon};
use crate::{Error, Result};

impl KdTree {
    /// Checks every rule of the layout: indices in range, no cycle and no node that none names, planes strictly inside of their
    /// cells, a depth that tracers can walk, every reference in one leaf and none twice in it, and every point of every
    /// triangle in a closed cell that references it, in double precision. What the header counts is there. Of a tree that
    /// something is merged into, as many nodes and references are left over as the header says that others are in place of.
    ///
    /// # Errors
    /// [`Error::InvalidStructure`] names the first node that breaks a rule, and the rule.
    pub fn validate(&self) -> Result<()> {
        self.validate_records()?;
        let mut walk = Walk {
            tree: self,
            visited: vec![false; self.nodes.len()],
            in_leaf: vec![false; self.references.len()],
            found: Counts::default(),
        };
        let cell = self.header.cell();
        if self.nodes.is_empty() {
            if self.header.active > 0 {
                return invalid(format!("{} records and no node", self.header.active));
            }
            walk.found.empty_leaves = 1;
        } else {
            walk.run(cell)?;
            (0..self.records.len() as u32).try_for_each(|record| self.validate_cover(record))?;
        }
        let header = &self.header;
        left_over(&walk.visited, header.replaced_nodes, |node| format!("node {node} is named by none"))?;
        left_over(&walk.in_leaf, header.replaced_references, |lost| format!("reference {lost} is in no leaf"))?;
        let said = Counts {
            inner_nodes: header.inner_nodes,
            leaves: header.leaves,
            empty_leaves: header.empty_leaves,
            depth: header.depth,
        };
        if walk.found != said {
            return invalid(format!("{:?}, the header says {said:?}", walk.found));
        }
        Ok(())
    }

    /// Every point of a triangle is in a cell that references it: the triangle is cut at the planes, and what is left of it in
    /// a leaf must be referenced there. What lies in a plane may be on either side.
    fn validate_cover(&self, record: u32) -> Result<()> {
        let Triangle { v0, v1, v2, primitive } = self.records[record as usize];
        let polygon = Polygon::of(&[v0, v1, v2]);
        let magnitude = polygon.corners().iter().flatten().fold(0.0, |m: f64, x| m.max(x.abs()));
        let cover = Cover { tree: self, record, slack: magnitude * 2f64.powi(-44) };
        match cover.lacking(0, polygon).first().map(|(place, _)| place) {
            Some(Lacking::Leaf(node)) => {
                invalid(format!("node {node}: primitive {primitive} is in the cell and is not referenced"))
            }
            Some(Lacking::EmptyChild(node)) => {
                invalid(format!("node {node}: primitive {primitive} is in the child that is said to be empty"))
            }
            None => Ok(()),
        }
    }

    /// As many parts as the header says; primitives in the order of the input; all triangles in the root's cell.
    fn validate_records(&self) -> Result<()> {
        let header = &self.header;
        let there = [self.nodes.len(), self.references.len(), self.records.len()];
        let said = [header.node_count, header.reference_count, header.active].map(|count| count as usize);
        if there != said {
            return invalid(format!("{there:?} nodes, references and records are there, the header says {said:?}"));
        }
        if let Some(i) = self.records.windows(2).position(|pair| pair[0].primitive >= pair[1].primitive) {
            return invalid(format!("record {} is not of a later primitive than record {i}", i + 1));
        }
        if let Some(last) = self.records.last().filter(|last| last.primitive >= header.primitive_count) {
            return invalid(format!("a record is of primitive {} of {}", last.primitive, header.primitive_count));
        }
        let cell = header.cell();
        match self.records.iter().position(|record| !cell.contains(&Aabb::around(&[record.v0, record.v1, record.v2]))) {
            Some(record) => invalid(format!("record {record} is not inside of the root's cell")),
            None => Ok(()),
        }
    }
}

/// What a walk counts and the header says.
#[derive(Debug, Default, PartialEq, Eq)]
struct Counts {
    inner_nodes: u32,
    leaves: u32,
    empty_leaves: u32,
    depth: u32,
}

/// Where a triangle is and is not referenced.
enum Lacking {
    Leaf(u32),
    /// The empty child of this node.
    EmptyChild(u32),
}

/// Where a triangle is looked for.
struct Cover<'a> {
    tree: &'a KdTree,
    record: u32,
    /// Room for the rounding of cuts.
    slack: f64,
}

impl Cover<'_> {
    /// The parts of the triangle that are not referenced below a node, and where they should be.
    fn lacking(&self, node: u32, polygon: Polygon) -> Vec<(Lacking, Polygon)> {
        let inner = match self.tree.nodes[node as usize].content() {
            KdContent::Leaf(range) => {
                let is_there = self.tree.references[range].binary_search(&self.record).is_ok();
                return if is_there { Vec::new() } else { vec![(Lacking::Leaf(node), polygon)] };
            }
            KdContent::Inner(inner) => inner,
        };
        let below = |side: usize, polygon: Polygon| match inner.children[side] {
            Some(child) => self.lacking(child, polygon),
            None => vec![(Lacking::EmptyChild(node), polygon)],
        };
        let (axis, plane) = (inner.axis, f64::from(inner.plane));
        let is_left = polygon.corners().iter().any(|p| p[axis] < plane - self.slack);
        let is_right = polygon.corners().iter().any(|p| p[axis] > plane + self.slack);
        match (is_left, is_right) {
            (true, true) => {
                let mut lacking = below(0, polygon.beyond(axis, plane, -1.0));
                lacking.extend(below(1, polygon.beyond(axis, plane, 1.0)));
                lacking
            }
            (true, false) => below(0, polygon),
            (false, true) => below(1, polygon),
            // What is not on the left must be on the right.
            (false, false) => below(0, polygon).into_iter().flat_map(|(_, left)| below(1, left)).collect(),
        }
    }
}

/// A node that is left to see.
struct NodeVisit {
    node: u32,
    /// The node that names it.
    parent: Option<u32>,
    depth: u32,
    cell: Aabb,
}

struct Walk<'a> {
    tree: &'a KdTree,
    visited: Vec<bool>,
    in_leaf: Vec<bool>,
    found: Counts,
}

impl Walk<'_> {
    fn run(&mut self, cell: Aabb) -> Result<()> {
        let mut stack = vec![NodeVisit { node: 0, parent: None, depth: 0, cell }];
        while let Some(NodeVisit { node, parent, depth, cell }) = stack.pop() {
            let named_by = parent.map_or("the header".to_owned(), |parent| format!("node {parent}"));
            if depth > MAX_DEPTH {
                return invalid(format!("node {node} is at depth {depth}, the most is {MAX_DEPTH}"));
            }
            let Some(content) = self.tree.nodes.get(node as usize).map(|node| node.content()) else {
                return invalid(format!("{named_by}: child {node}, there are {} nodes", self.tree.nodes.len()));
            };
            if std::mem::replace(&mut self.visited[node as usize], true) {
                return invalid(format!("{named_by}: node {node} has two parents"));
            }
            self.found.depth = self.found.depth.max(depth);
            match content {
                KdContent::Leaf(range) => self.leaf(node, range)?,
                KdContent::Inner(inner) => {
                    self.inner(node, &inner, &cell)?;
                    for (child, cell) in inner.children.into_iter().zip(inner.halves(&cell)).rev() {
                        match child {
                            Some(child) => {
                                stack.push(NodeVisit { node: child, parent: Some(node), depth: depth + 1, cell });
                            }
                            None => self.found.empty_leaves += 1,
                        }
                    }
                }
            }
        }
        Ok(())
    }

    fn inner(&mut self, node: u32, inner: &Inner, cell: &Aabb) -> Result<()> {
        let Inner { axis, plane, children } = *inner;
        self.found.inner_nodes += 1;
        // Not the other way round: a NaN must not pass.
        if !(cell.lo[axis] < plane && plane < cell.hi[axis]) {
            let (from, to) = (cell.lo[axis], cell.hi[axis]);
            return invalid(format!("node {node}: plane {plane} is not strictly inside of {from} to {to}"));
        }
        if children == [None; 2] {
            return invalid(format!("node {node} has two empty children"));
        }
        Ok(())
    }

    fn leaf(&mut self, node: u32, range: std::ops::Range<usize>) -> Result<()> {
        self.found.leaves += 1;
        if range.is_empty() {
            return invalid(format!("node {node} is a leaf of nothing"));
        }
        let Some(references) = self.tree.references.get(range.clone()) else {
            let there = self.tree.references.len();
            return invalid(format!("node {node}: a leaf of references {range:?}, there are {there}"));
        };
        if let Some(twice) = range.clone().find(|&at| std::mem::replace(&mut self.in_leaf[at], true)) {
            return invalid(format!("node {node}: reference {twice} is in two leaves"));
        }
        if let Some(wrong) = references.iter().find(|&&record| record as usize >= self.tree.records.len()) {
            return invalid(format!("node {node}: record {wrong}, there are {}", self.tree.records.len()));
        }
        if let Some(pair) = references.windows(2).find(|pair| pair[0] >= pair[1]) {
            return invalid(format!("node {node}: record {} after {}, they must ascend", pair[1], pair[0]));
        }
        Ok(())
    }
}

/// As many are not found as others are in place of.
fn left_over(found: &[bool], replaced: u32, what: impl Fn(usize) -> String) -> Result<()> {
    let left = found.iter().filter(|&&found| !found).count();
    match found.iter().position(|&found| !found) {
        _ if left == replaced as usize => Ok(()),
        Some(first) => invalid(format!("{}; {left} such, the header says that {replaced} are replaced", what(first))),
        None => invalid(format!("nothing is left over, the header says that {replaced} are replaced")),
    }
}

fn invalid<T>(what: String) -> Result<T> {
    Err(Error::InvalidStructure(what))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kdtree::builder::KdOptions;
    use crate::kdtree::layout::KdNode;
    use crate::kdtree::twin::builder::build;

    /// Small triangles along a diagonal, and one all along it.
    fn tree() -> KdTree {
        let mut positions: Vec<[f32; 3]> =
            (0..60).map(|i| [(i / 3) as f32, (i / 3 + i % 3) as f32, (i * 5 % 11) as f32]).collect();
        positions.extend([[0.0; 3], [20.0, 20.0, 10.0], [20.0, 19.0, 10.0]]);
        let triangles: Vec<[u32; 3]> = (0..21).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        build(&positions, &triangles, &KdOptions::DEFAULT).expect("a small tree")
    }

    #[test]
    fn a_built_tree_is_valid_and_round_trips_through_bytes() {
        let tree = tree();
        tree.validate().expect("valid");
        assert!(tree.header.inner_nodes > 3 && tree.header.empty_leaves > 0, "{:?}", tree.header);
        let bytes = tree.to_bytes();
        assert_eq!(KdTree::from_bytes(&bytes).expect("its own bytes").to_bytes(), bytes);
    }

    fn inner_of(tree: &KdTree, node: usize) -> Inner {
        match tree.nodes[node].content() {
            KdContent::Inner(inner) => inner,
            KdContent::Leaf(_) => panic!("node {node} is a leaf"),
        }
    }

    /// A leaf of at least this many references.
    fn leaf_of(tree: &KdTree, count: usize) -> (usize, std::ops::Range<usize>) {
        let leaf = |node: &KdNode| match node.content() {
            KdContent::Leaf(range) if range.len() >= count => Some(range),
            _ => None,
        };
        tree.nodes.iter().enumerate().find_map(|(i, node)| leaf(node).map(|range| (i, range))).expect("a leaf")
    }

    #[test]
    fn every_broken_rule_is_found_and_named() {
        type Break = fn(&mut KdTree);
        let breaks: [(&str, Break); 18] = [
            ("is not strictly inside of", |t| {
                let axis = inner_of(t, 0).axis;
                t.nodes[0].first = t.header.hi[axis].to_bits();
            }),
            ("is not strictly inside of", |t| t.nodes[0].first = f32::NAN.to_bits()),
            ("has two empty children", |t| t.nodes[0].second |= 0b1100),
            ("there are", |t| t.nodes[0].second |= 0xFFFF_FFF0),
            ("has two parents", |t| {
                let Inner { axis, plane, .. } = inner_of(t, 0);
                t.nodes[0] = KdNode::inner(axis, plane, 0, [false, false]);
            }),
            ("is in the child that is said to be empty", |t| {
                let Inner { axis, plane, children } = inner_of(t, 0);
                t.nodes[0] = KdNode::inner(axis, plane, children[0].expect("both") + 1, [true, false]);
            }),
            ("is in the cell and is not referenced", |t| {
                let (leaf, range) = leaf_of(t, 2);
                t.nodes[leaf] = KdNode::leaf(range.start as u32 + 1, range.len() as u32 - 1);
            }),
            ("a leaf of nothing", |t| {
                let (leaf, _) = leaf_of(t, 1);
                t.nodes[leaf].first = 0;
            }),
            ("is in two leaves", |t| {
                // The rightmost leaf is seen last.
                let mut last = 0;
                while let KdContent::Inner(inner) = t.nodes[last].content() {
                    last = inner.children[1].or(inner.children[0]).expect("one is not empty") as usize;
                }
                let other = t.nodes.iter().enumerate().find_map(|(i, node)| match node.content() {
                    KdContent::Leaf(range) if i != last => Some(range),
                    _ => None,
                });
                let range = other.expect("another leaf");
                t.nodes[last] = KdNode::leaf(range.start as u32, range.len() as u32);
            }),
            ("they must ascend", |t| {
                let (_, range) = leaf_of(t, 2);
                t.references[range.start + 1] = t.references[range.start];
            }),
            ("record 21, there are 21", |t| {
                let (_, range) = leaf_of(t, 1);
                t.references[range.end - 1] = 21;
            }),
            ("is in no leaf", |t| {
                t.references.push(0);
                t.header.reference_count += 1;
            }),
            ("is named by none", |t| {
                t.nodes.push(t.nodes[0]);
                t.header.node_count += 1;
            }),
            ("nothing is left over", |t| t.header.replaced_nodes = 1),
            ("1 such, the header says that 2 are replaced", |t| {
                t.references.push(0);
                t.header.reference_count += 1;
                t.header.replaced_references = 2;
            }),
            ("the header says", |t| t.header.empty_leaves += 1),
            ("nodes, references and records are there", |t| t.header.active -= 1),
            ("is not inside of the root's cell", |t| t.header.hi[0] -= 2.0),
        ];
        for (says, break_it) in breaks {
            let mut tree = tree();
            assert_eq!(inner_of(&tree, 0).children, [Some(1), Some(2)]);
            break_it(&mut tree);
            let error = tree.validate().expect_err(says).to_string();
            assert!(error.contains(says), "{says}: {error}");
        }
    }
}
