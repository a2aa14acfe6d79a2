//! What is merged, and the tree of a leaf that parts of objects are in: `PartitionTrees` of algorithm 12.

use super::descent::TargetLeaf;
use super::fragment::Fragment;
use super::partition::{Partition, Source};
use super::tree::Forest;
use hedgerow::bvh::layout::Triangle;
use hedgerow::geometry::Aabb;
use hedgerow::kdtree::layout::{KdContent, KdHeader, KdTree};
use hedgerow::kdtree::termination::Costs;
use hedgerow::kdtree::twin::heuristic::Heuristic;
use std::ops::Range;

/// Something that is merged into the tree.
#[derive(Debug)]
pub(super) struct MarkedObject {
    pub name: String,
    pub primitives: Range<u32>,
    /// Numbered as the scene has it.
    pub records: Vec<Triangle>,
    /// Of its tree.
    pub header: KdHeader,
    /// Its tree and the parts of it.
    pub forest: Forest<'static>,
    /// The leaves that it has a part in.
    pub places: Vec<TargetLeaf>,
}

impl MarkedObject {
    fn source(&self) -> Source<'_> {
        let records = (&self.records[..], self.header.reach);
        Source { forest: Forest::over(&self.forest), records, first: self.primitives.start }
    }
}

/// A leaf of the static tree that objects have parts in.
#[derive(Debug)]
pub(super) struct Marked {
    pub region: Aabb,
    pub depth: u32,
    /// The first primitive of each one's object, ascending, and its number in that one's forest.
    pub parts: Vec<(u32, u32)>,
    /// The tree of all parts and the leaf; `None` where something has changed.
    pub made: Option<Fragment>,
}

/// What is needed to make a marked leaf's tree.
pub(super) struct Make<'a> {
    /// The static tree.
    pub tree: &'a KdTree,
    pub objects: &'a [MarkedObject],
    pub costs: Costs,
    pub cell: Aabb,
    /// Those that objects are beyond.
    pub faces: &'a [u8],
}

impl Make<'_> {
    pub fn of(&self, place: TargetLeaf, marked: &Marked) -> Fragment {
        let cell = marked.region.intersection(&self.cell);
        let heuristic = Heuristic::of_leaf(self.costs, &cell, self.tree.header.active);
        let mut partition = Partition { heuristic, sources: Vec::new(), made: Fragment::default() };
        let mut parts = Vec::with_capacity(marked.parts.len() + 1);
        if let TargetLeaf::Leaf(node) = place
            && let KdContent::Leaf(range) = self.tree.nodes[node as usize].content()
        {
            let records = (&self.tree.records[..], self.tree.header.reach);
            let (forest, leaf) =
                Forest::of_leaf(&self.tree.references[range], records, &cell, Heuristic::step(self.costs));
            partition.sources.push(Source { forest, records, first: 0 });
            parts.extend(leaf.map(|leaf| partition.part(0, leaf)));
        }
        for &(first, number) in &marked.parts {
            // The last one that begins there: others that do are empty.
            let object = self.objects.partition_point(|object| object.primitives.start <= first) - 1;
            partition.sources.push(self.objects[object].source());
            parts.push(partition.part(partition.sources.len() - 1, number));
        }
        let depth = match place {
            TargetLeaf::Beyond(face) => self.faces.partition_point(|&other| other <= face) as u32,
            _ => marked.depth + self.faces.len() as u32,
        };
        partition.made.root = partition.partition_trees(parts, cell, depth);
        partition.made
    }
}
