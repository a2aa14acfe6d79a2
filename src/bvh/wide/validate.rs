//! Walks a wide tree on the host and says what is wrong and where.

use super::layout::{Wide, WideNode, leaf_max};
use crate::Result;
use crate::bvh::cover::SplitParts;
use crate::bvh::far;
use crate::bvh::layout::{InstanceRecord, Record};
use crate::bvh::twin::split::around_parts;
use crate::bvh::validate::{invalid, validate_split_primitives};
use crate::geometry::Aabb;

impl<N: WideNode, R: Record> Wide<N, R> {
    /// Checks every rule of the layout: indices in range, no cycle, every record in exactly one leaf and every node named by
    /// exactly one other, nodes that one names side by side, records within the boxes that lead to them (as far as records tell,
    /// and without what updates have left out), and as many levels as tracers can walk.
    ///
    /// Boxes of floats are exactly those around what they hold; quantised ones hold it. Where triangles were split, leaves cover
    /// them as in [`Bvh2::validate`](crate::bvh::layout::Bvh2::validate).
    ///
    /// # Errors
    /// [`Error::InvalidStructure`](crate::Error::InvalidStructure) names the first node that breaks a rule, and the rule.
    pub fn validate(&self) -> Result<()> {
        self.validate_counts()?;
        if self.header.active == 0 {
            let empty =
                self.header.root.bounds() == Aabb::EMPTY && self.nodes[0].children().iter().all(Option::is_none);
            return if empty { Ok(()) } else { invalid("no active primitive, but the root is not empty".into()) };
        }
        let mut in_leaf = vec![false; self.records.len()];
        let mut visited = vec![false; self.nodes.len()];
        visited[0] = true;
        let mut parts = SplitParts::default();
        let seen = (&mut in_leaf[..], &mut visited[..], &mut parts);
        let around = self.validate_node(0, &self.header.root.bounds(), 0, seen)?;
        if around.is_some_and(|around| around != self.header.root.bounds()) {
            return invalid(format!("the root has box {:?}, its content {around:?}", self.header.root.bounds()));
        }
        if let Some(node) = visited.iter().position(|&visited| !visited) {
            return invalid(format!("node {node} is named by none"));
        }
        far::validate(&self.header, &self.far, self.nodes[0].children().iter().flatten())?;
        match in_leaf.iter().position(|&named| !named) {
            Some(record) => invalid(format!("record {record} is in no leaf")),
            None => parts.check(&self.records),
        }
    }

    fn validate_counts(&self) -> Result<()> {
        let header = &self.header;
        if header.active != header.primitive_count || self.records.len() != header.active as usize {
            return invalid(format!(
                "{} active of {} primitives, {} records; a wide tree holds those in leaves",
                header.active,
                header.primitive_count,
                self.records.len()
            ));
        }
        let inner = if header.active == 0 { 0 } else { header.node_slots };
        if header.node_slots == 0 || header.inner_nodes != inner || self.nodes.len() != header.node_slots as usize {
            return invalid(format!(
                "{} node slots, {} nodes of the tree, and {} are there",
                header.node_slots,
                header.inner_nodes,
                self.nodes.len()
            ));
        }
        if (header.root.index, header.root.count) != (0, 0) {
            return invalid(format!(
                "the root is node {} of count {}, not node 0",
                header.root.index, header.root.count
            ));
        }
        if header.kind != Self::KIND {
            return invalid(format!("kind {:#x}, not {:#x}", header.kind, Self::KIND));
        }
        let pairs = self.places.pairs();
        if header.pairs != pairs {
            return invalid(format!("{} pairs of records, and {pairs} are there", header.pairs));
        }
        self.validate_primitives()
    }

    /// The primitive order names every primitive once; of a top level, an instance may have several entries.
    fn validate_primitives(&self) -> Result<()> {
        if R::KIND == InstanceRecord::KIND {
            return Ok(());
        }
        if self.header.split_from != 0 {
            return validate_split_primitives(&self.records, self.header.split_from, self.records.len());
        }
        let mut named = std::collections::HashSet::with_capacity(self.records.len());
        match self.records.iter().position(|record| !named.insert(record.primitive())) {
            Some(twice) => invalid(format!("primitive {} is there twice", self.records[twice].primitive())),
            None => Ok(()),
        }
    }

    /// A node in this box and all below it; the box around what they hold, if records tell.
    fn validate_node(
        &self,
        index: u32,
        bounds: &Aabb,
        level: u32,
        seen: (&mut [bool], &mut [bool], &mut SplitParts),
    ) -> Result<Option<Aabb>> {
        let (in_leaf, visited, parts) = seen;
        if level >= N::FORM.levels() {
            return invalid(format!("node {index} is on level {level}, the last is {}", N::FORM.levels() - 1));
        }
        let node = &self.nodes[index as usize];
        if let Some((first, count)) = node.long_leaf() {
            let records = self.places.records(first, count).len();
            if records <= leaf_max::<N, R>() as usize {
                return invalid(format!("node {index} is a long leaf of {records} records"));
            }
            return self.validate_leaf(index, (first, count), bounds, (in_leaf, parts));
        }
        let children = node.children();
        if children.iter().all(Option::is_none) {
            return invalid(format!("node {index} has no children"));
        }
        let first_child = children.iter().flatten().find(|child| !child.is_leaf()).map_or(0, |child| child.index);
        let mut nodes = first_child..self.nodes.len() as u32;
        let mut around: Option<Aabb> = None;
        for child in children.iter().flatten() {
            // A part lies in all boxes that lead to it.
            let is_split = self.header.split_from != 0;
            let box_of_child = if is_split { child.bounds().intersection(bounds) } else { child.bounds() };
            let content = if child.is_leaf() {
                self.validate_leaf(index, (child.index, child.count), &box_of_child, (in_leaf, parts))?
            } else {
                if nodes.next() != Some(child.index) {
                    return invalid(format!("node {index}: its child {} does not lie beside the others", child.index));
                }
                if std::mem::replace(&mut visited[child.index as usize], true) {
                    return invalid(format!("node {index}: node {} has two parents", child.index));
                }
                self.validate_node(child.index, &box_of_child, level + 1, (in_leaf, visited, parts))?
            };
            let content = match content {
                Some(content) => content,
                // A box of its own grid need not lie within that of the node above.
                None if N::FORM.is_quantised() => continue,
                // A leaf that updates have left nothing of has the box that it had.
                None => box_of_child,
            };
            if !N::FORM.is_quantised() && content != box_of_child {
                return invalid(format!(
                    "node {index}: child {} has box {box_of_child:?}, around its content is {content:?}",
                    child.index
                ));
            }
            around = Some(around.map_or(content, |a| a.union(&content)));
        }
        if around.is_some_and(|around| !bounds.contains(&around)) {
            return invalid(format!("node {index} has box {bounds:?}, around its content is {around:?}"));
        }
        Ok(around)
    }

    fn validate_leaf(
        &self,
        named_by: u32,
        (first, count): (u32, u32),
        bounds: &Aabb,
        (in_leaf, parts): (&mut [bool], &mut SplitParts),
    ) -> Result<Option<Aabb>> {
        let range = self.places.records(first, count);
        if range.end > in_leaf.len() {
            return invalid(format!("node {named_by}: a leaf of {range:?}, there are {} records", in_leaf.len()));
        }
        if let Some(twice) = range.clone().find(|&record| std::mem::replace(&mut in_leaf[record], true)) {
            return invalid(format!("node {named_by}: record {twice} is in two leaves"));
        }
        if self.header.split_from != 0 {
            range.clone().for_each(|record| parts.add(record, *bounds));
        }
        let met = self.records[range].iter().filter(|record| !record.is_left_out());
        let is_split = self.header.split_from != 0;
        let loose = |b: Aabb| if is_split { around_parts(&b) } else { b };
        let boxes: Option<Vec<Aabb>> = met.map(|record| record.bounds().map(loose)).collect();
        let around = boxes.and_then(|boxes| boxes.into_iter().reduce(|a, b| a.union(&b)));
        match around {
            Some(around) if is_split => Ok(Some(around.intersection(bounds))),
            Some(around) if !bounds.contains(&around) => invalid(format!(
                "node {named_by}: leaf from {first} has box {bounds:?}, around its content is {around:?}"
            )),
            around => Ok(around),
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::bvh::codes::Code;
    use crate::bvh::layout::{Child, UNUSED};
    use crate::bvh::sah::Collapse;
    use crate::bvh::twin::lbvh;
    use crate::bvh::wide::layout::{Wide4, Wide8q};
    use crate::geometry::Aabb;

    fn tree() -> crate::bvh::layout::Bvh2 {
        let positions: Vec<[f32; 3]> =
            (0..180).map(|i| [(i * 7 % 13) as f32, (i * 5 % 11) as f32, (i % 3) as f32]).collect();
        let triangles: Vec<[u32; 3]> = (0..60).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        lbvh::build(&positions, &triangles, Code::Mc30.full(), Collapse::OFF)
    }

    #[test]
    fn a_collapsed_tree_is_valid_and_round_trips_through_bytes() {
        let wide = Wide4::of(&tree());
        wide.validate().expect("valid");
        assert_eq!(
            Wide4::<crate::bvh::layout::Triangle>::from_bytes(&wide.to_bytes()).unwrap().to_bytes(),
            wide.to_bytes()
        );
        let quantised = Wide8q::of(&tree());
        quantised.validate().expect("valid");
        assert!(quantised.to_bytes().len() < wide.to_bytes().len());
    }

    #[test]
    fn every_broken_rule_of_float_nodes_is_found_and_named() {
        type Break = fn(&mut Wide4);
        let breaks: [(&str, Break); 8] = [
            ("around its content", |t| child_of(t, |c| c.is_leaf()).hi[1] += 1.0),
            ("around its content", |t| child_of(t, |c| !c.is_leaf()).lo[0] -= 1.0),
            ("two leaves", |t| child_of(t, |c| c.is_leaf() && c.index != 9).index = 9),
            ("there are 60 records", |t| child_of(t, |c| c.is_leaf()).count = 61),
            ("there twice", |t| t.records[0].primitive = t.records[1].primitive),
            ("does not lie beside", |t| t.nodes[0][1].index = 1),
            ("node slots", |t| t.header.node_slots += 1),
            ("is in no leaf", |t| {
                *child_of(t, |c| c.is_leaf() && c.count == 1) = Child { count: UNUSED, ..Child::UNUSED }
            }),
        ];
        for (says, break_it) in breaks {
            let mut tree = Wide4::of(&tree());
            break_it(&mut tree);
            let error = tree.validate().expect_err(says).to_string();
            let boxes_first = says == "is in no leaf" || says == "two leaves";
            assert!(error.contains(says) || boxes_first && error.contains("box"), "{says}: {error}");
        }
        fn child_of(tree: &mut Wide4, which: fn(&Child) -> bool) -> &mut Child {
            let children = tree.nodes.iter_mut().skip(1).flatten();
            children.into_iter().find(|c| c.count != UNUSED && which(c)).expect("there is one")
        }
    }

    #[test]
    fn every_broken_rule_of_quantised_nodes_is_found_and_named() {
        type Break = fn(&mut Wide8q);
        let breaks: [(&str, Break); 6] = [
            ("around its content", |t| t.nodes[1].hi = [[0; 2]; 3]),
            ("around its content", |t| t.nodes[0].exponents_and_nodes -= 1),
            ("two parents", |t| t.nodes[0].first_child = 0),
            ("there are 60 records", |t| t.nodes[2].first_record = 300),
            ("is there twice", |t| t.records[3] = t.records[4]),
            ("pairs of records, and 0", |t| t.header.pairs = 1),
        ];
        for (says, break_it) in breaks {
            let mut tree = Wide8q::of(&tree());
            break_it(&mut tree);
            let error = tree.validate().expect_err(says).to_string();
            assert!(error.contains(says), "{says}: {error}");
        }
    }

    /// As if all on the positive side of the x axis were far from the first node below the root.
    fn with_something_far() -> Wide8q {
        let mut tree = Wide8q::of(&tree());
        (tree.header.near_node, tree.header.far_sides) = (tree.nodes[0].first_child, 0b10);
        tree.far = vec![Aabb::EMPTY; 6];
        tree.far[1] = tree.header.root.bounds();
        tree
    }

    #[test]
    fn every_broken_rule_of_what_is_far_is_found_and_named() {
        with_something_far().validate().expect("valid");
        type Break = fn(&mut Wide8q);
        let breaks: [(&str, Break); 7] = [
            ("is near, sides 0b10 far, and 0 boxes", |t| t.far.clear()),
            ("is near, sides 0b11 far, and 6 boxes on 0b10", |t| t.header.far_sides = 0b11),
            ("is near, sides 0b10 far, and 6 boxes on 0b0", |t| t.far[1] = Aabb::EMPTY),
            ("node 0 is near", |t| t.header.near_node = 0),
            ("is no child of the root", |t| t.header.near_node = 0xFFFF),
            ("outside of the root's", |t| t.far[1].hi[2] += 1.0),
            ("node 1 is near, sides 0b0 far, and 6 boxes on 0b0", |t| {
                t.header.far_sides = 0;
                t.far[1] = Aabb::EMPTY;
            }),
        ];
        for (says, break_it) in breaks {
            let mut tree = with_something_far();
            break_it(&mut tree);
            let error = tree.validate().expect_err(says).to_string();
            assert!(error.contains(says), "{says}: {error}");
        }
    }
}
