//! Compaction, plainly: a walk that writes nodes in the order in which it meets them.

use crate::bvh::layout::{Bvh2, Child, Header, Node, Record, status};
use crate::geometry::Aabb;

impl Header {
    /// The header of the compacted structure: node slots for the nodes, and no records but those in leaves. Of a structure that
    /// cannot be traced nothing is left but its status.
    pub fn compacted(&self) -> Header {
        let mut header = *self;
        if header.active == 0 || header.status & status::UNUSABLE != 0 {
            header.root = Child { lo: Aabb::EMPTY.lo, index: 0, hi: Aabb::EMPTY.hi, count: 0 };
            header.active = 0;
            header.inner_nodes = 0;
            (header.near_node, header.far_sides) = (0, 0);
        }
        header.primitive_count = header.active;
        header.node_slots = header.inner_nodes.max(1);
        if !header.root.is_leaf() {
            header.root.index = 0;
        }
        // What is near is the root's left child.
        header.near_node = header.near_node.min(1);
        header
    }
}

impl<R: Record> Bvh2<R> {
    /// The same tree with its nodes depth first, left child first, without unused slots and without the records that are in no
    /// leaf: the bytes of [`crate::bvh::compact`].
    pub fn compacted(&self) -> Bvh2<R> {
        let header = self.header.compacted();
        let mut nodes = Vec::with_capacity(header.node_slots as usize);
        if header.active > 0 {
            self.append(self.header.root, &mut nodes);
        }
        nodes.resize(header.node_slots as usize, Node::UNUSED);
        let records = self.records[..header.active as usize].to_vec();
        let far = if header.near_node == 0 { Vec::new() } else { self.far.clone() };
        Bvh2 { header, nodes, records, geometries: self.geometries.clone(), far }
    }

    /// Appends the subtree; what names it now.
    fn append(&self, child: Child, nodes: &mut Vec<Node>) -> Child {
        if child.is_leaf() {
            return child;
        }
        let index = nodes.len();
        nodes.push(Node::UNUSED);
        let [left, right] = self.nodes[child.index as usize].children;
        nodes[index] = Node { children: [self.append(left, nodes), self.append(right, nodes)] };
        Child { index: index as u32, ..child }
    }
}
