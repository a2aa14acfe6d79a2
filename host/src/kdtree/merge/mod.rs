//! Merging: the trees of objects that move are merged into the tree of what stands still, and taken out again (Papay 2025,
//! chapter 10, algorithms 9 to 12, after Eleftheriades 2010, "Accelerating ray tracing for dynamic scenes using kd-tree
//! merging").
//!
//! 1. `descent`: an object's tree is pushed down the planes of the static tree (algorithm 11) by cutting it in two along each
//!    (algorithm 9, `tree`);
//! 2. `partition`: in each leaf that has a part of it, one tree is made of all parts and of the leaf (algorithm 10);
//! 3. `write`: that tree is put in the leaf's place, and what it overwrites is kept, to be written back.
//!
//! The static tree is never rebuilt and never copied: the cost goes with the objects and the leaves that they are in.

mod descent;
mod fragment;
mod marked;
mod partition;
mod tree;
mod write;

use descent::{Association, TargetLeaf, partition_tree_with_tree};
use hedgerow::bvh::sah::area_scale;
use hedgerow::geometry::Aabb;
use hedgerow::kdtree::layout::{KdHeader, KdNode, KdTree, MAX_DEPTH};
use hedgerow::kdtree::termination::Costs;
use hedgerow::kdtree::twin::heuristic::Heuristic;
use hedgerow::{Error, Result};
use marked::{Make, Marked, MarkedObject};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::ops::Range;
use tree::Forest;

/// A static tree, and the objects that are in it.
///
/// What is merged depends on the static tree and on which objects are in it, not on the order in which they came. An object's
/// primitives are numbered from where the caller says, so that hits tell whose they are. Objects may be outside of the static
/// tree's cell; a tree that is deeper than tracers can walk has leaves there, and the status says so
/// ([`hedgerow::bvh::layout::status::DEPTH_LIMITED`]).
///
/// ```
/// use hedgerow_host::kdtree::{HostKdOptions, build, merge::Merged};
/// use hedgerow::kdtree::{layout::SpareRoom, termination::Costs};
///
/// let corners = |x: f32| [[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, 0.0]];
/// let room = SpareRoom { nodes: 64, references: 64, records: 8 };
/// let still = build(&corners(0.0), &[[0, 1, 2]], &HostKdOptions::EXACT)?.with_room(room)?;
/// let bytes = still.to_bytes();
/// let mut merged = Merged::new(still, Costs::DEFAULT);
/// merged.insert("ball", 1, build(&corners(0.5), &[[0, 1, 2]], &HostKdOptions::BINNED)?)?;
/// assert_eq!(merged.tree()?.header.active, 2);
/// merged.take_out("ball")?;
/// assert_eq!(merged.tree()?.to_bytes(), bytes);
/// # Ok::<(), hedgerow::Error>(())
/// ```
#[derive(Debug)]
pub struct Merged {
    tree: KdTree,
    /// The static tree's header.
    still: KdHeader,
    costs: Costs,
    /// By their first primitives.
    objects: Vec<MarkedObject>,
    /// The static leaves that objects have parts in: the associations of algorithm 11.
    marked: BTreeMap<TargetLeaf, Marked>,
    /// What the trees of marked leaves were last made for: the root's cell, and the faces of the static one that objects are
    /// beyond.
    around: (Aabb, Vec<u8>),
    /// What the static tree's nodes were where others are in their place.
    kept: Vec<(u32, KdNode)>,
    /// Whether all objects are in the structure, and no others.
    is_merged: bool,
}

impl Merged {
    /// The static tree alone. It must be valid, and have room for what is to be merged into it ([`KdTree::with_room`]). `costs`
    /// are those by which planes are chosen where there are several trees.
    pub fn new(tree: KdTree, costs: Costs) -> Merged {
        Merged {
            still: tree.header,
            around: (tree.header.cell(), Vec::new()),
            tree,
            costs,
            objects: Vec::new(),
            marked: BTreeMap::new(),
            kept: Vec::new(),
            is_merged: true,
        }
    }

    /// Inserts an object by its tree, which must be valid. Its primitives are numbered from `first_primitive` on.
    ///
    /// # Errors
    /// [`Error::Argument`] if an object has this name, or some of these primitives are those of the static tree or of another
    /// object.
    pub fn insert(&mut self, name: &str, first_primitive: u32, object: KdTree) -> Result<()> {
        let primitives = self.check(name, first_primitive, object.header.primitive_count)?;
        self.unmerge();
        let (mut forest, root) = Forest::of(&object, Heuristic::step(self.costs));
        let records = (&object.records[..], object.header.reach);
        let associations = root
            .map(|root| partition_tree_with_tree(&mut forest, root, records, (&self.tree.nodes, &self.still.cell())));
        let mut places = Vec::new();
        for Association { place, region, depth, part } in associations.into_iter().flatten() {
            places.push(place);
            let new = || Marked { region, depth, parts: Vec::new(), made: None };
            let marked = self.marked.entry(place).or_insert_with(new);
            let at = marked.parts.partition_point(|&(first, _)| first < primitives.start);
            marked.parts.insert(at, (primitives.start, part));
            marked.made = None;
        }
        let KdTree { header, mut records, .. } = object;
        records.iter_mut().for_each(|record| record.primitive += primitives.start);
        let ends = |primitives: &Range<u32>| (primitives.start, primitives.end);
        let at = self.objects.partition_point(|other| ends(&other.primitives) < ends(&primitives));
        self.objects.insert(at, MarkedObject { name: name.to_owned(), primitives, records, header, forest, places });
        Ok(())
    }

    /// Takes an object out.
    ///
    /// # Errors
    /// [`Error::Argument`] if no object has this name.
    pub fn take_out(&mut self, name: &str) -> Result<()> {
        let Some(at) = self.objects.iter().position(|object| object.name == name) else {
            let names: Vec<&str> = self.objects.iter().map(|object| object.name.as_str()).collect();
            return Err(Error::Argument(format!(
                "{name:?} cannot be taken out, it is not in the tree; what is: {}",
                if names.is_empty() { "nothing".to_owned() } else { names.join(", ") }
            )));
        };
        self.unmerge();
        let object = self.objects.remove(at);
        for place in object.places {
            let Some(marked) = self.marked.get_mut(&place) else { continue };
            marked.parts.retain(|&(first, _)| first != object.primitives.start);
            marked.made = None;
            if marked.parts.is_empty() {
                self.marked.remove(&place);
            }
        }
        Ok(())
    }

    /// Takes all objects out: the static tree is left, byte for byte.
    pub fn restore(&mut self) -> &KdTree {
        self.unmerge();
        self.objects.clear();
        self.marked.clear();
        self.is_merged = true;
        &self.tree
    }

    /// The static tree with all objects merged into it. Only what has changed since the last call is made again.
    ///
    /// # Errors
    /// [`Error::Argument`] if there is no room for it, and says how much is needed; or if the static tree cannot have planes
    /// around it for objects beside it, as it would be too deep (no builder's is). The objects stay inserted; some of them
    /// taken out, there may be room for the others.
    pub fn tree(&mut self) -> Result<&KdTree> {
        if !self.is_merged {
            self.merge()?;
        }
        Ok(&self.tree)
    }

    /// Which primitives an object would have.
    fn check(&self, name: &str, first: u32, count: u32) -> Result<Range<u32>> {
        if self.objects.iter().any(|object| object.name == name) {
            return Err(Error::Argument(format!(
                "{name:?} is in the tree already; take it out first, or name it otherwise"
            )));
        }
        let end = first.checked_add(count).ok_or_else(|| {
            Error::Argument(format!("{name:?}: {count} primitives from {first} on are more than 32 bits can number"))
        })?;
        let all = self.objects.iter().map(|object| (object.name.as_str(), object.primitives.clone()));
        let overlap = |(_, other): &(&str, Range<u32>)| first < other.end && other.start < end;
        match all.chain([("the static tree", 0..self.still.primitive_count)]).find(overlap) {
            Some((other, Range { start, end: other_end })) => Err(Error::Argument(format!(
                "{name:?}: primitives {first}..{end} overlap {start}..{other_end} of {other}; number them apart"
            ))),
            None => Ok(first..end),
        }
    }

    fn unmerge(&mut self) {
        write::restore(&mut self.tree, &self.still, &mut self.kept);
        self.is_merged = false;
    }

    /// Algorithm 12.
    fn merge(&mut self) -> Result<()> {
        let cell = self.objects.iter().fold(self.still.cell(), |cell, object| cell.union(&object.header.cell()));
        let beyond = |(&place, _): (&TargetLeaf, &Marked)| match place {
            TargetLeaf::Beyond(face) => Some(face),
            _ => None,
        };
        let around = (cell, self.marked.iter().filter_map(beyond).collect::<Vec<u8>>());
        let depth = self.still.depth + around.1.len() as u32;
        if depth > MAX_DEPTH {
            return Err(Error::Argument(format!(
                "with planes around it, for objects are outside of its box, the static tree would be {depth} deep, the most is \
                 {MAX_DEPTH}; build one that is not as deep, or over a larger box"
            )));
        }
        if around != self.around {
            // Cells beside the static tree are others, or all is at another depth.
            self.marked.values_mut().for_each(|marked| marked.made = None);
            self.around = around;
        }
        let (tree, objects) = (&self.tree, &self.objects[..]);
        let make = Make { tree, objects, costs: self.costs, cell, faces: &self.around.1 };
        let mut changed: Vec<(&TargetLeaf, &mut Marked)> =
            self.marked.iter_mut().filter(|(_, m)| m.made.is_none()).collect();
        changed.par_iter_mut().for_each(|(place, marked)| marked.made = Some(make.of(**place, marked)));

        let mut names = vec![(0, 0)];
        let mut header = self.header(cell);
        for object in self.objects.iter().filter(|object| !object.records.is_empty()) {
            names.push((object.primitives.start, self.tree.records.len() as u32));
            self.tree.records.extend_from_slice(&object.records);
        }
        header.active = self.tree.records.len() as u32;
        let mut writer = write::Writer::new(&mut self.tree, header, &mut self.kept, &names);
        let is_empty = |marked: &Marked| marked.made.as_ref().is_none_or(|made| made.root.is_none());
        let faces = self.marked.iter().filter_map(|marked| Some((beyond(marked)?, is_empty(marked.1))));
        writer.surround(&faces.collect::<Vec<_>>());
        for (&place, marked) in &self.marked {
            if let Some(made) = &marked.made {
                writer.swap_leaf(place, made);
            }
        }
        writer.finish();
        self.check_room().inspect_err(|_| write::restore(&mut self.tree, &self.still, &mut self.kept))?;
        self.is_merged = true;
        Ok(())
    }

    /// The merged tree's, but for what is counted.
    fn header(&self, cell: Aabb) -> KdHeader {
        let mut header = KdHeader { lo: cell.lo, hi: cell.hi, ..self.still };
        for object in &self.objects {
            header.primitive_count = header.primitive_count.max(object.primitives.end);
            header.reach = header.reach.max(object.header.reach);
            header.status |= object.header.status;
            if !object.records.is_empty() {
                header.area_scale = area_scale(&cell);
            }
        }
        header
    }

    fn check_room(&self) -> Result<()> {
        let header = &self.tree.header;
        let parts = [
            ("nodes", header.node_count, header.node_room),
            ("references", header.reference_count, header.reference_room),
            ("records", header.active, header.record_room),
        ];
        let Some((what, count, room)) = parts.into_iter().find(|(_, count, room)| count > room) else { return Ok(()) };
        Err(Error::Argument(format!(
            "the merged tree has {count} {what}, there is room for {room}; build the static tree with_room for more"
        )))
    }
}
