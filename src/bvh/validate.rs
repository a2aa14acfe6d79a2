//! Walks a structure on the host and says what is wrong and where.

use super::cover::SplitParts;
use super::far;
use super::layout::{Bvh2, Child, Header, InstanceRecord, MAX_DEPTH, Record, node_slots};
use super::twin::split::around_parts;
use crate::geometry::Aabb;
use crate::{Error, Result};

impl<R: Record> Bvh2<R> {
    /// Checks every rule of the layout: indices in range, no cycle, every active primitive in exactly one leaf, boxes that are
    /// exactly those around what they hold (as far as records tell, and without what updates have left out), unused slots that
    /// say so, and a depth that tracers can walk.
    ///
    /// Where triangles were split: every record in exactly one leaf, leaves whose boxes lie within those around their triangles
    /// (larger by the slack of parts), and no triangle with a point that is in no box of its leaves.
    ///
    /// # Errors
    /// [`Error::InvalidStructure`] names the first node that breaks a rule, and the rule.
    pub fn validate(&self) -> Result<()> {
        let header = &self.header;
        if header.active > header.primitive_count {
            return invalid(format!("{} active of {} primitives", header.active, header.primitive_count));
        }
        self.validate_primitives()?;
        self.validate_counts()?;
        if header.active == 0 {
            let empty = header.root.bounds() == Aabb::EMPTY && header.root.count == 0 && header.inner_nodes == 0;
            return if empty { Ok(()) } else { invalid("no active primitive, but the root is not empty".into()) };
        }

        let mut in_leaf = vec![false; header.active as usize];
        let mut visited = vec![false; self.nodes.len()];
        let mut parts = SplitParts::default();
        // What is left to see: a child, its depth, and the node that names it.
        let mut stack = vec![(header.root, 0, None::<u32>)];
        while let Some((child, depth, parent)) = stack.pop() {
            let named_by = parent.map_or("the header".to_owned(), |slot| format!("node {slot}"));
            if depth > MAX_DEPTH {
                return invalid(format!("{named_by} is at depth {depth}, the most is {MAX_DEPTH}"));
            }
            if child.is_leaf() {
                let range = child.index as usize..child.index as usize + child.count as usize;
                if range.end > in_leaf.len() {
                    return invalid(format!("{named_by}: a leaf of {range:?}, there are {} records", in_leaf.len()));
                }
                if let Some(twice) = range.clone().find(|&t| std::mem::replace(&mut in_leaf[t], true)) {
                    return invalid(format!("{named_by}: record {twice} is in two leaves"));
                }
                let is_split = header.split_from != 0;
                if is_split {
                    range.clone().for_each(|record| parts.add(record, child.bounds()));
                }
                let met: Vec<_> = self.records[range].iter().filter(|record| !record.is_left_out()).collect();
                let loose = |b: Aabb| if is_split { around_parts(&b) } else { b };
                let boxes: Option<Vec<Aabb>> = met.iter().map(|record| record.bounds().map(loose)).collect();
                // A leaf that updates have left nothing of has the box that it had.
                if let Some(around) = boxes.and_then(|boxes| boxes.into_iter().reduce(|a, b| a.union(&b))) {
                    let within = is_split && around.contains(&child.bounds());
                    if !within {
                        same_box(&child, &around, &named_by)?;
                    }
                }
            } else {
                let Some(node) = self.nodes.get(child.index as usize) else {
                    return invalid(format!("{named_by}: node {}, there are {}", child.index, self.nodes.len()));
                };
                if std::mem::replace(&mut visited[child.index as usize], true) {
                    return invalid(format!("{named_by}: node {} has two parents", child.index));
                }
                let [left, right] = node.children;
                same_box(&child, &left.bounds().union(&right.bounds()), &named_by)?;
                stack.extend(node.children.map(|c| (c, depth + 1, Some(child.index))));
            }
        }
        self.validate_slots(&visited)?;
        let of_root = self.nodes.get(header.root.index as usize).filter(|_| !header.root.is_leaf());
        far::validate(header, &self.far, of_root.iter().flat_map(|node| &node.children))?;
        match in_leaf.iter().position(|&there| !there) {
            Some(lost) => invalid(format!("record {lost} is in no leaf")),
            None => parts.check(&self.records),
        }
    }

    /// As many slots as there are nodes, or more, and no more than the records need at most.
    fn validate_counts(&self) -> Result<()> {
        let header = &self.header;
        if !(header.inner_nodes.max(1)..=node_slots(header.primitive_count)).contains(&header.node_slots) {
            return invalid(format!(
                "{} node slots for {} records, {} of them active, and {} nodes",
                header.node_slots, header.primitive_count, header.active, header.inner_nodes
            ));
        }
        let there = (self.nodes.len(), self.records.len());
        if there != (header.node_slots as usize, header.primitive_count as usize) {
            return invalid(format!(
                "{} node slots and {} records are there, the header says {} and {}",
                there.0, there.1, header.node_slots, header.primitive_count
            ));
        }
        Ok(())
    }

    /// The slots of the tree (`visited`) are as many as the header says, and the others say that they are unused.
    fn validate_slots(&self, visited: &[bool]) -> Result<()> {
        let used = visited.iter().filter(|&&visited| visited).count();
        if used != self.header.inner_nodes as usize {
            return invalid(format!("{used} nodes, the header says {}", self.header.inner_nodes));
        }
        if let Some(slot) =
            visited.iter().rposition(|&visited| visited).filter(|&slot| slot + 1 >= self.header.active as usize)
        {
            return invalid(format!(
                "node {slot} of {} primitives; slots from there on are unused",
                self.header.active
            ));
        }
        match self.nodes.iter().zip(visited).position(|(node, &visited)| node.is_used() != visited) {
            Some(slot) if visited[slot] => invalid(format!("node {slot} is marked as unused")),
            Some(slot) => invalid(format!("node {slot} is named by none and not marked as unused")),
            None => Ok(()),
        }
    }

    /// The primitive order names every primitive once; of a top level, an instance may have several entries. Where triangles were
    /// split, every primitive at least once, as long as all records are there.
    fn validate_primitives(&self) -> Result<()> {
        let Header { kind, split_from, active, .. } = self.header;
        if kind == InstanceRecord::KIND {
            return Ok(());
        }
        if split_from != 0 {
            return validate_split_primitives(&self.records, split_from, active as usize);
        }
        let mut named = std::collections::HashSet::with_capacity(self.records.len());
        match self.records.iter().position(|record| !named.insert(record.primitive())) {
            Some(twice) => invalid(format!("primitive {} is there twice", self.records[twice].primitive())),
            None => Ok(()),
        }
    }
}

/// Primitives of records of which the first `active` are in leaves.
pub(super) fn validate_split_primitives<R: Record>(records: &[R], split_from: u32, active: usize) -> Result<()> {
    let mut named = vec![false; split_from as usize];
    for (i, primitive) in records.iter().map(Record::primitive).enumerate() {
        match named.get_mut(primitive as usize) {
            Some(named) => *named = true,
            None if i < active => return invalid(format!("record {i} is of primitive {primitive} of {split_from}")),
            // Room that no part has needed.
            None => {}
        }
    }
    match named.iter().position(|&named| !named) {
        Some(lost) if records.len() > active => invalid(format!("primitive {lost} is not there")),
        _ => Ok(()),
    }
}

fn same_box(child: &Child, around: &Aabb, named_by: &str) -> Result<()> {
    if child.bounds() == *around {
        return Ok(());
    }
    let what = if child.is_leaf() { "leaf from" } else { "node" };
    invalid(format!(
        "{named_by}: {what} {} has box {:?}, around its content is {around:?}",
        child.index,
        child.bounds()
    ))
}

pub(crate) fn invalid<T>(what: String) -> Result<T> {
    Err(Error::InvalidStructure(what))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::codes::Code;
    use crate::bvh::layout::{Node, Triangle};
    use crate::bvh::sah::Collapse;
    use crate::bvh::twin::lbvh;

    fn tree(collapse: Collapse) -> Bvh2 {
        let positions: Vec<[f32; 3]> =
            (0..60).map(|i| [(i * 7 % 13) as f32, (i * 5 % 11) as f32, (i % 3) as f32]).collect();
        let triangles: Vec<[u32; 3]> = (0..20).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        lbvh::build(&positions, &triangles, Code::Mc30.full(), collapse)
    }

    #[test]
    fn a_built_tree_is_valid_and_round_trips_through_bytes() {
        for collapse in [Collapse::OFF, Collapse::SAH] {
            let tree = tree(collapse);
            tree.validate().expect("valid");
            let again = Bvh2::<Triangle>::from_bytes(&tree.to_bytes()).expect("its own bytes");
            assert_eq!(again.to_bytes(), tree.to_bytes());
        }
    }

    #[test]
    fn every_broken_rule_is_found_and_named() {
        type Break = fn(&mut Bvh2);
        let breaks: [(&str, Break); 11] = [
            ("has box", |t| t.nodes[t.header.root.index as usize].children[0].hi[1] += 1.0),
            ("two leaves", |t| first_leaf(t).index = 3),
            ("there are 20 records", |t| first_leaf(t).count = 21),
            ("there twice", |t| t.records[0].primitive = t.records[1].primitive),
            ("active", |t| t.header.active = 21),
            ("the header says 7", |t| t.header.inner_nodes = 7),
            ("18 node slots for 20 records", |t| t.header.node_slots = 18),
            ("20 node slots for 20 records", |t| t.header.node_slots = 20),
            ("node 0 is near, sides 0b1 far, and 0 boxes", |t| t.header.far_sides = 1),
            ("is no child of the root", |t| {
                (t.header.near_node, t.header.far_sides) = (0xFFFF, 1);
                t.far = [vec![t.header.root.bounds()], vec![Aabb::EMPTY; 5]].concat();
            }),
            ("slots from there on are unused", |t| {
                // The root moves behind the slots that its twenty triangles need.
                t.records.push(Triangle { primitive: 20, ..t.records[0] });
                t.header.primitive_count = 21;
                t.header.node_slots = 20;
                let root = std::mem::replace(&mut t.nodes[t.header.root.index as usize], Node::UNUSED);
                t.nodes.push(root);
                t.header.root.index = 19;
            }),
        ];
        for (says, break_it) in breaks {
            let mut tree = tree(Collapse::OFF);
            // Position 3 belongs to another leaf than the first one found, or the break would be none.
            assert_ne!(first_leaf(&mut tree).index, 3);
            break_it(&mut tree);
            let error = tree.validate().expect_err(says).to_string();
            assert!(error.contains(says), "{says}: {error}");
        }
        fn first_leaf(tree: &mut Bvh2) -> &mut Child {
            let leaves = tree.nodes.iter_mut().flat_map(|n| &mut n.children);
            leaves.into_iter().find(|c| c.count == 1 && c.index != 3).expect("a leaf")
        }
    }
}
