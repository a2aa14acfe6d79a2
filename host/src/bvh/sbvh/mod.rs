//! SBVH: top-down, at each node the best split of its primitives by bins, or where its sides overlap the best split of space.
//!
//! Stich, Friedrich, Dietrich 2009, "Spatial Splits in Bounding Volume Hierarchies". A spatial split cuts the triangles that cross
//! its plane: both children then have a *reference* to the triangle, with the box of its part. The spatial split is taken where it
//! costs less than the object split, not wherever it is looked for (which is how van Kralingen 2023, listing 3, has it). A triangle
//! that crosses is left whole on one side where that costs less (the paper's reference unsplitting), in the order of the
//! references. The budget of references is divided among the children of a node by their references, so that the tree is the same
//! for any number of threads.
//!
//! **No ray loses a hit.** `hedgerow::bvh::twin::split` has the proof: it needs halves that both have the cut, wherever the plane is,
//! and boxes of parts that are larger by the slack of its `padded`. The boxes here come from its `halves`, and are padded at the end.
//! In between, lengths may be scaled by a power of two, which moves what is less than 2⁻¹²⁶ then by 2⁻¹⁵⁰ at most. Triangles whose
//! longest side is less than 2⁻⁶⁰ then are not cut, and scenes neither whose extent is not 2⁻⁴⁰ to 2¹²⁰, so that the padding is more.

mod leaves;
mod object;
mod spatial;

pub(super) use leaves::collapse;

use super::ALONE;
use super::bounds::{Bounds, Item};
use super::heuristic::split_cost::{AxisSplits, First, Place, Side, Space, SplitCost, growing, of_planes};
use super::top_down::{self, Candidates, HALVED_FROM, LeafRule};
use super::topology::{LEAF, Topology};
use hedgerow::bvh::twin::split::padded;
use hedgerow::geometry::Aabb;
use hedgerow::{Error, Result};
use object::ObjectSplit;

/// How triangles are split, and how many references there may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SbvhOptions {
    /// Spatial splits are looked for where the boxes of the object split's sides have at least this part of the scene's area in
    /// common: 0 (at every node) to 1 (nowhere).
    pub alpha: f32,
    /// The most references, as a multiple of the triangles: 1 to [`SbvhOptions::MOST_BUDGET`].
    pub budget: f32,
    /// How many bins there are along an axis, for either kind of split: 2 to [`SbvhOptions::MOST_BINS`].
    pub bins: u32,
}

impl SbvhOptions {
    /// The paper's α of 10⁻⁵; twice as many references as triangles at most, and 32 bins.
    pub const PAPER: SbvhOptions = SbvhOptions { alpha: 1e-5, budget: 2.0, bins: 32 };
    /// The greatest budget.
    pub const MOST_BUDGET: f32 = 16.0;
    /// The most bins.
    pub const MOST_BINS: u32 = 128;

    pub(super) fn check(&self) -> Result<()> {
        let SbvhOptions { alpha, budget, bins } = *self;
        let (most_budget, most_bins) = (SbvhOptions::MOST_BUDGET, SbvhOptions::MOST_BINS);
        let wrong = |what: String| Err(Error::Argument(what));
        if !(0.0..=1.0).contains(&alpha) {
            return wrong(format!("an alpha of {alpha} cannot be used; take 0 to 1"));
        }
        if !(1.0..=most_budget).contains(&budget) {
            return wrong(format!(
                "a budget of {budget} references a triangle cannot be used; take 1 to {most_budget}"
            ));
        }
        if !(2..=most_bins).contains(&bins) {
            return wrong(format!("{bins} bins cannot be used; take 2 to {most_bins} bins"));
        }
        Ok(())
    }
}

/// From this depth on no triangle is split.
const WHOLE_FROM: u32 = 48;
/// What is shorter, in the lengths of the items, is not cut.
const SHORTEST_CUT: f32 = 1.0 / (1u64 << 60) as f32;
/// In place of a reference's weight: its box is that of its triangle, or that of a part.
const WHOLE: u32 = 1;
const PART: u32 = 2;

/// What a tree is built over besides its items. Its functions are called through pointers: this method is compiled for every
/// heuristic, and would be for every kind of record besides.
pub(super) struct Scene<'a> {
    /// The corners of a primitive that is a triangle.
    pub corners: &'a (dyn Fn(u32) -> Option<[[f32; 3]; 3]> + Sync),
    /// The box of a primitive.
    pub bounds: &'a (dyn Fn(u32) -> Bounds + Sync),
    /// The box around all primitives.
    pub around: &'a Aabb,
    /// What the lengths of the items were scaled by.
    pub scale: f32,
}

/// A tree over references.
pub(super) struct SplitTree {
    /// The tree, in whose order are numbers of references.
    pub tree: Topology,
    /// Boxes in the lengths of the input, and the primitives that they are of.
    pub references: Vec<Item>,
    /// Whether any triangle was split.
    pub is_split: bool,
}

/// Whether any triangle of a tree over `items` may be split.
pub(super) fn can_split(items: &[Item], scene: &Scene<'_>, options: &SbvhOptions) -> bool {
    let is_triangle = |item: &Item| (scene.corners)(item.primitive()).is_some();
    options.alpha < 1.0 && is_in_reach(scene.around) && items.first().is_some_and(is_triangle)
}

/// The tree over `items`.
pub(super) fn build(
    by: &impl SplitCost,
    items: Vec<Item>,
    scene: &Scene<'_>,
    rule: LeafRule<'_>,
    options: &SbvhOptions,
) -> SplitTree {
    let room = ((f64::from(options.budget) - 1.0) * items.len() as f64) as usize;
    let corners = |primitive: u32| {
        let corners = (scene.corners)(primitive).expect("only triangles are split");
        corners.map(|corner| corner.map(|x| x * scene.scale))
    };
    let area = super::bounds::around(&items).half_area();
    let least_overlap = can_split(&items, scene, options).then_some(options.alpha * area);
    let build = Build { corners: &corners, rule, bins: options.bins as usize, least_overlap };
    let mut out = Written::default();
    if !items.is_empty() {
        let mut root = Subtree::default();
        top_down::build(&build, by, Part { references: items, room, place: &mut root });
        out.write(root);
    }
    let is_split = out.references.iter().any(|reference| reference.weight() == PART);
    out.references.iter_mut().for_each(|reference| *reference = scene.finished(reference));
    let order = (0..out.references.len() as u32).collect();
    SplitTree { tree: Topology { order, splits: out.splits }, references: out.references, is_split }
}

/// Whether a scene is of a size that its triangles can be split at.
fn is_in_reach(scene: &Aabb) -> bool {
    let power_of_two = |exponent: i32| f32::from_bits(((127 + exponent) as u32) << 23);
    let longest = scene.extent().into_iter().fold(0.0, f32::max);
    let farthest = scene.lo.iter().chain(&scene.hi).fold(0.0, |m: f32, x| m.max(x.abs()));
    longest >= power_of_two(-40) && farthest <= power_of_two(120)
}

impl Scene<'_> {
    /// A reference with its box in the lengths of the input, larger by the slack of parts if it is one.
    fn finished(&self, reference: &Item) -> Item {
        let primitive = reference.primitive();
        let whole = (self.bounds)(primitive);
        if reference.weight() == WHOLE {
            return Item::new(whole, primitive, 1);
        }
        let bounds = reference.scaled(1.0 / self.scale).bounds();
        Item::new(Bounds::of(&padded(&aabb(bounds), &aabb(whole))), primitive, 1)
    }
}

fn aabb(bounds: Bounds) -> Aabb {
    Aabb { lo: bounds.lo.to_array(), hi: bounds.hi.to_array() }
}

/// A node before it is split: the box around its references, and that around their centroids (twice them).
struct Unsplit {
    bounds: Bounds,
    centroids: Bounds,
}

impl Unsplit {
    fn of(references: &[Item]) -> Unsplit {
        let empty = Unsplit { bounds: Bounds::EMPTY, centroids: Bounds::EMPTY };
        references.iter().fold(empty, |all, reference| Unsplit {
            bounds: all.bounds.union(reference.bounds()),
            centroids: all.centroids.union(Bounds::point(reference.centroid())),
        })
    }
}

/// A subtree that is built: how many references it has is known at its end alone.
enum Subtree {
    Leaf(Vec<Item>),
    Node(Box<[Subtree; 2]>),
}

impl Default for Subtree {
    fn default() -> Subtree {
        Subtree::Leaf(Vec::new())
    }
}

/// A tree that is written, from left to right.
#[derive(Default)]
struct Written {
    references: Vec<Item>,
    splits: Vec<u32>,
}

impl Written {
    fn write(&mut self, subtree: Subtree) {
        match subtree {
            Subtree::Leaf(references) => {
                self.splits.resize(self.splits.len() + references.len() - 1, LEAF);
                self.references.extend(references);
            }
            Subtree::Node(children) => {
                let [left, right] = *children;
                let (slot, first) = (self.splits.len(), self.references.len());
                self.splits.push(LEAF);
                self.write(left);
                self.splits[slot] = (self.references.len() - first) as u32;
                self.write(right);
            }
        }
    }
}

/// The references of a node, how many more there may be, and where its subtree is put.
struct Part<'a> {
    references: Vec<Item>,
    room: usize,
    place: &'a mut Subtree,
}

/// What nodes are split by.
struct Build<'a> {
    /// Of a primitive, in the lengths of the items.
    corners: &'a (dyn Fn(u32) -> [[f32; 3]; 3] + Sync),
    rule: LeafRule<'a>,
    bins: usize,
    /// Sides of an object split with less area in common are not looked at any further; none if nothing may be split.
    least_overlap: Option<f32>,
}

/// The search for the split of a node.
struct Search<'a, S: SplitCost> {
    by: &'a S,
    here: &'a S::Here,
    build: &'a Build<'a>,
}

impl Candidates for Build<'_> {
    type Part<'a> = Part<'a>;
    /// The references on both sides.
    type Split = [Vec<Item>; 2];

    fn count(&self, part: &Part<'_>) -> usize {
        part.references.len()
    }

    fn best<S: SplitCost>(&self, by: &S, here: &S::Here, part: &mut Part<'_>, depth: u32) -> Option<[Vec<Item>; 2]> {
        Search { by, here, build: self }.divided(&part.references, depth, part.room)
    }

    fn sides(&self, by: &impl SplitCost, part: &Part<'_>, split: Option<&[Vec<Item>; 2]>) -> [Side; 2] {
        let search = |references: &[Item]| {
            let side = |reference: &Item| Side::of_one(reference.bounds(), by.is_seen(reference));
            references.iter().map(side).fold(Side::EMPTY, Side::union)
        };
        match split {
            None => [search(&part.references), Side::EMPTY],
            Some(sides) => sides.each_ref().map(|side| search(side)),
        }
    }

    fn members(&self, _part: &Part<'_>, split: &[Vec<Item>; 2], each: &mut dyn FnMut(usize, u32)) {
        for (side, references) in split.iter().enumerate() {
            references.iter().for_each(|reference| each(side, reference.primitive()));
        }
    }

    fn divide<'a>(&self, part: Self::Part<'a>, split: [Vec<Item>; 2], first: First) -> [Self::Part<'a>; 2] {
        let [left, right] = first.in_order(split);
        let both = left.len() + right.len();
        let room = part.room - (both - part.references.len());
        let left_room = (room as u128 * left.len() as u128 / both as u128) as usize;
        *part.place = Subtree::Node(Box::default());
        let Subtree::Node(children) = part.place else { unreachable!("it was just made") };
        let [left_place, right_place] = &mut **children;
        [
            Part { references: left, room: left_room, place: left_place },
            Part { references: right, room: room - left_room, place: right_place },
        ]
    }

    fn end(&self, part: Part<'_>) {
        *part.place = Subtree::Leaf(part.references);
    }
}

impl<S: SplitCost> Search<'_, S> {
    /// The references on both sides of the best split; `None` if the node is a leaf.
    fn divided(&self, references: &[Item], depth: u32, room: usize) -> Option<[Vec<Item>; 2]> {
        let node = Unsplit::of(references);
        let objects = || -> ObjectSplit {
            if depth >= HALVED_FROM { self.halved(references) } else { self.object_split(references, &node) }
        };
        let may_split = if depth < WHOLE_FROM { self.build.least_overlap } else { None };
        let space = || self.spatial_split(references, &node.bounds, room);
        let (object, spatial) = match (may_split, self.by.space(self.here)) {
            (None, _) | (_, Space::Nowhere) => (Some(objects()), None),
            (Some(least), Space::Overlaps) => {
                let object = objects();
                let spatial = if object.overlap() >= least { space() } else { None };
                (Some(object), spatial)
            }
            (Some(_), Space::Here) => (Some(objects()), space()),
            (Some(_), Space::Alone) => match space() {
                None => (Some(objects()), None),
                spatial => (None, spatial),
            },
        };
        let of_object = object.as_ref().map_or(f32::INFINITY, |object| object.cost);
        let spatial = spatial.filter(|spatial| spatial.cost < of_object || object.is_none());
        let cost = spatial.as_ref().map_or(of_object, |spatial| spatial.cost);
        let (weight, count) = (self.by.of_node(self.here, &node.bounds), references.len() as u32);
        if self.build.rule.is_leaf(weight, count, cost) {
            return None;
        }
        // More references are not worth it where a leaf is cheaper.
        let is_leaf = LeafRule { single: false, ..self.build.rule }.is_leaf(weight, count, cost);
        let by_space = spatial.filter(|_| !is_leaf).and_then(|spatial| self.build.cut(references, &spatial));
        Some(by_space.unwrap_or_else(|| object.unwrap_or_else(objects).divide(references)))
    }

    /// What the planes between bins cost, of whose items each is in one place; of a bin, what is on the left of a plane behind it, and
    /// on the right of one before it.
    #[inline(always)]
    fn costs<B>(&self, bins: &[B], of: [fn(&B) -> Side; 2], places: impl Iterator<Item = Place>) -> Vec<f32> {
        let costs = self.build.rule.costs;
        if !S::BY_BOTH {
            return of_planes((self.by, self.here), bins, of, costs);
        }
        let lefts: Vec<Side> = growing(bins[..bins.len() - 1].iter().map(of[0])).collect();
        let mut rights: Vec<Side> = growing(bins[1..].iter().rev().map(of[1])).collect();
        rights.reverse();
        self.by.of_splits(self.here, &AxisSplits { lefts: &lefts, rights: &rights }, places, costs)
    }
}

#[cfg(test)]
mod tests;
