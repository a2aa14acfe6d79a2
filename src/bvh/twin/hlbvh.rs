//! HLBVH, plainly: treelets of the radix tree, and over them a top that the surface area heuristic splits.
//!
//! Pantaleoni and Luebke 2010, "HLBVH: Hierarchical LBVH Construction for Real-Time Ray Tracing of Dynamic Geometry"; Garanzha,
//! Pantaleoni, McAllister 2011, "Simpler and Faster HLBVH with Work Queues". A treelet is what shares the first bits of the
//! code; here, where that would have too many primitives, it is the largest subtree that has not, so that a small object in a
//! large scene is not one treelet. What else the papers leave open:
//!
//! - Of at most `SWEPT` treelets every centroid is a plane that is tried; of more, the planes between `BINS` slabs of the box
//!   around the centroids, on every axis. The cost of a plane is the area of the box around the treelets on either side times
//!   the primitives in them, in `f32`; of planes of equal cost the first wins, x before y before z.
//! - Where no plane has treelets on both sides, of two treelets, and from level `SAH_LEVELS` on, half of them go to either side.
//! - Each side keeps its order. The node that splits the last order before its place p has the slot before the first position of
//!   the p-th treelet in the order of codes, which no other node can have.

use crate::bvh::codes::{CodePlan, Codes};
use crate::bvh::hlbvh::Treelets;
use crate::bvh::layout::{Bvh2, Child, Node, Record};
use crate::geometry::Aabb;

/// Slabs on an axis.
const BINS: usize = 16;
/// Treelets of which all planes are tried, at most.
const SWEPT: usize = 16;
/// Levels that are split by area.
const SAH_LEVELS: usize = 40;
/// 2^-100: of a scene whose boxes are scaled to about 1, what is less is nothing.
const LEAST_EXTENT: f32 = f32::from_bits((127 - 100) << 23);

#[derive(Clone, Copy)]
struct Treelet {
    child: Child,
    first: u32,
    primitives: u32,
}

/// What is on one side of a plane.
#[derive(Clone, Copy)]
struct Side {
    bounds: Aabb,
    primitives: u32,
}

impl Side {
    const EMPTY: Side = Side { bounds: Aabb::EMPTY, primitives: 0 };

    fn cost(&self, scale: f32) -> f32 {
        self.bounds.scaled_half_area(scale) * self.primitives as f32
    }
}

/// The tree over the records of `radix`, the LBVH of these codes that is not collapsed. [`Bvh2::collapsed`] finishes it: the
/// header's costs are zero, and the tree may be deeper than tracers can walk.
pub fn build<R: Record>(radix: &Bvh2<R>, codes: Codes, limits: Treelets) -> Bvh2<R> {
    let mut tree = radix.without_nodes();
    if radix.header.active > 0 {
        let mut counts = vec![1; radix.nodes.len()];
        count(radix, radix.header.root, &mut counts);
        let shared = codes.bits - limits.bits(codes, radix.header.primitive_count);
        let prefixes: Vec<u64> =
            codes_of(radix, codes).iter().map(|code| code.checked_shr(shared).unwrap_or(0)).collect();
        let is_treelet = |slot: u32| {
            let slot = slot as usize;
            counts[slot] <= limits.primitives && prefixes[slot] == prefixes[slot + 1]
        };
        let mut treelets = Vec::new();
        cut(radix, radix.header.root, &counts, &is_treelet, &mut treelets);
        for treelet in &treelets {
            copy(radix, treelet.child, &mut tree.nodes);
        }
        let mut order: Vec<usize> = (0..treelets.len()).collect();
        let mut top = Top { treelets: &treelets, scale: tree.header.area_scale, nodes: &mut tree.nodes };
        tree.header.root = top.node(&mut order, 0, 0);
    }
    tree.header.inner_nodes = tree.header.active.saturating_sub(1);
    tree
}

/// The codes in the order of the records. Bounds may be those of a sample, which is taken in the order of the input; of split
/// triangles that order is not known any more, and codes of such bounds may be others than the device's.
fn codes_of<R: Record>(radix: &Bvh2<R>, codes: Codes) -> Vec<u64> {
    let leaves = radix.leaf_children();
    let mut boxes = vec![Err(()); radix.records.len()];
    for leaf in &leaves {
        let is_split = radix.header.split_from != 0;
        let place = if is_split { leaf.index } else { radix.records[leaf.index as usize].primitive() };
        boxes[place as usize] = Ok(leaf.bounds());
    }
    let plan = CodePlan::new(codes, &boxes);
    leaves.iter().map(|leaf| plan.encode(&leaf.bounds())).collect()
}

/// Primitives below a child; of the nodes, in `counts`.
fn count<R: Record>(radix: &Bvh2<R>, child: Child, counts: &mut [u32]) -> u32 {
    if child.is_leaf() {
        return 1;
    }
    let [left, right] = radix.nodes[child.index as usize].children;
    counts[child.index as usize] = count(radix, left, counts) + count(radix, right, counts);
    counts[child.index as usize]
}

/// The treelets of a subtree in the order of codes.
fn cut<R: Record>(
    radix: &Bvh2<R>,
    child: Child,
    counts: &[u32],
    is_treelet: &impl Fn(u32) -> bool,
    treelets: &mut Vec<Treelet>,
) {
    let primitives = if child.is_leaf() { 1 } else { counts[child.index as usize] };
    if child.is_leaf() || is_treelet(child.index) {
        let first = treelets.last().map_or(0, |last: &Treelet| last.first + last.primitives);
        treelets.push(Treelet { child, first, primitives });
    } else {
        for child in radix.nodes[child.index as usize].children {
            cut(radix, child, counts, is_treelet, treelets);
        }
    }
}

fn copy<R: Record>(radix: &Bvh2<R>, child: Child, nodes: &mut [Node]) {
    if !child.is_leaf() {
        let node = radix.nodes[child.index as usize];
        nodes[child.index as usize] = node;
        node.children.into_iter().for_each(|child| copy(radix, child, nodes));
    }
}

/// The nodes above treelets.
struct Top<'a> {
    treelets: &'a [Treelet],
    scale: f32,
    nodes: &'a mut [Node],
}

impl Top<'_> {
    /// The subtree over some treelets, which begin at a place of the whole order.
    fn node(&mut self, order: &mut [usize], place: usize, level: usize) -> Child {
        if let [treelet] = order {
            return self.treelets[*treelet].child;
        }
        let goes_left = if order.len() > 2 && level < SAH_LEVELS { self.best_plane(order) } else { None };
        let middle = goes_left.map_or(order.len() / 2, |goes_left| partition(order, &goes_left));
        let (left, right) = order.split_at_mut(middle);
        let left = self.node(left, place, level + 1);
        let right = self.node(right, place + middle, level + 1);
        let slot = self.treelets[place + middle].first - 1;
        self.nodes[slot as usize] = Node { children: [left, right] };
        let bounds = left.bounds().union(&right.bounds());
        Child { lo: bounds.lo, index: slot, hi: bounds.hi, count: 0 }
    }

    /// Which treelets are left of the best plane, if there is one.
    fn best_plane(&self, order: &[usize]) -> Option<Vec<bool>> {
        let keys = if order.len() <= SWEPT { self.ranks(order) } else { self.slabs(order) };
        let mut best = (f32::INFINITY, None);
        for keys in keys {
            // The planes in the order of their numbers: in a sweep the treelets', otherwise the slabs'.
            let planes = if order.len() <= SWEPT { keys.clone() } else { (0..BINS as u32).collect() };
            for plane in planes {
                let goes_left = |key: u32| key <= plane;
                let sides = [true, false].map(|left| self.side(order, &keys, |key| goes_left(key) == left));
                let cost = sides[0].cost(self.scale) + sides[1].cost(self.scale);
                if sides.iter().all(|side| side.primitives > 0) && cost < best.0 {
                    best = (cost, Some(keys.iter().map(|&key| goes_left(key)).collect()));
                }
            }
        }
        best.1
    }

    fn side(&self, order: &[usize], keys: &[u32], is_in: impl Fn(u32) -> bool) -> Side {
        let within = order.iter().zip(keys).filter(|&(_, &key)| is_in(key)).map(|(&i, _)| &self.treelets[i]);
        within.fold(Side::EMPTY, |side, treelet| Side {
            bounds: side.bounds.union(&treelet.child.bounds()),
            primitives: side.primitives + treelet.primitives,
        })
    }

    fn centroid(&self, treelet: usize) -> [f32; 3] {
        self.treelets[treelet].child.bounds().centroid()
    }

    /// On each axis, how many treelets have a lesser centroid than each.
    fn ranks(&self, order: &[usize]) -> [Vec<u32>; 3] {
        std::array::from_fn(|axis| {
            let at: Vec<f32> = order.iter().map(|&i| self.centroid(i)[axis]).collect();
            at.iter().map(|own| at.iter().filter(|&other| other < own).count() as u32).collect()
        })
    }

    /// On each axis, in which slab each treelet's centroid lies.
    fn slabs(&self, order: &[usize]) -> [Vec<u32>; 3] {
        let centroids: Vec<[f32; 3]> = order.iter().map(|&i| self.centroid(i)).collect();
        let around = Aabb::around(&centroids);
        std::array::from_fn(|axis| {
            let lo = around.lo[axis] * self.scale;
            let extent = around.hi[axis] * self.scale - lo;
            let factor = if extent < LEAST_EXTENT { 0.0 } else { 1.0 / extent };
            let slab = |c: &[f32; 3]| ((c[axis] * self.scale - lo) * factor * BINS as f32) as u32;
            centroids.iter().map(|c| slab(c).min(BINS as u32 - 1)).collect()
        })
    }
}

/// Moves what goes left before the others; how many these are.
fn partition(order: &mut [usize], goes_left: &[bool]) -> usize {
    let of = |left| order.iter().zip(goes_left).filter(move |&(_, &is)| is == left).map(|(&i, _)| i);
    let (left, right): (Vec<usize>, Vec<usize>) = (of(true).collect(), of(false).collect());
    order.copy_from_slice(&[&left[..], &right].concat());
    left.len()
}
