//! Perfect splits: at each cell the best of all planes, in O(n log n) (Wald and Havran 2006, "On building fast kd-trees for ray
//! tracing, and on doing that in O(N log N)"; Papay 2025, sections 2.2, 2.3 and 9.2).
//!
//! Between two faces of boxes the cost is linear, so its least value is at a face. Each box begins and ends along each axis: two
//! events, sorted once. A sweep over them in order knows how many boxes are on either side. The events of what lies on one side of
//! the plane go to that side in the order that they have; what straddles it is clipped again, and has new events, which are few,
//! sorted by themselves and merged.
//!
//! At a common position boxes end before others begin, so that all that ends there is on the left alone, and all that begins
//! there on the right. Between the two are the events of boxes that are flat across the axis, one each: they go to the side
//! where they cost less.

use super::Threads;
use hedgerow::bvh::layout::Triangle;
use hedgerow::geometry::Aabb;
use hedgerow::kdtree::layout::halves;
use hedgerow::kdtree::twin::clip::{KdPlane, KdReference, divided};
use hedgerow::kdtree::twin::heuristic::{Heuristic, KdSplit};
use hedgerow::kdtree::twin::{ALONE, Fork, Subtree};
use rayon::prelude::*;
use std::cmp::Ordering;

/// The tree over `references` in `cell`.
pub(super) fn build(
    heuristic: &Heuristic,
    records: (&[Triangle], f32),
    cell: Aabb,
    references: Vec<KdReference>,
) -> Subtree {
    let content = CellContent::sorted(references);
    Exact { heuristic, records }.subtree(cell, content, 0)
}

/// What of a box is in a plane, in the order in which a sweep must meet it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    Ends,
    IsFlat,
    Begins,
}

/// A face of a box, or a flat box.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Event {
    at: f32,
    /// Position among the references of the cell.
    reference: u32,
    kind: Kind,
}

impl Event {
    fn order(&self, other: &Event) -> Ordering {
        let by_position = self.at.partial_cmp(&other.at).expect("boxes are finite");
        by_position.then(self.kind.cmp(&other.kind)).then(self.reference.cmp(&other.reference))
    }
}

/// What is in a cell, and the faces of the boxes along each axis in order.
#[derive(Default)]
struct CellContent {
    references: Vec<KdReference>,
    events: [Vec<Event>; 3],
}

impl CellContent {
    fn sorted(references: Vec<KdReference>) -> CellContent {
        let events = [0, 1, 2].map(|axis| {
            let faces = |(i, reference): (usize, &KdReference)| faces(&reference.bounds, axis, i as u32);
            let mut events: Vec<Event> = references.iter().enumerate().flat_map(faces).collect();
            events.par_sort_unstable_by(Event::order);
            events
        });
        CellContent { references, events }
    }
}

fn faces(b: &Aabb, axis: usize, reference: u32) -> impl Iterator<Item = Event> + use<> {
    let (lo, hi) = (b.lo[axis], b.hi[axis]);
    let first = Event { at: lo, reference, kind: if lo == hi { Kind::IsFlat } else { Kind::Begins } };
    let last = (lo != hi).then_some(Event { at: hi, reference, kind: Kind::Ends });
    std::iter::once(first).chain(last)
}

struct Exact<'a> {
    heuristic: &'a Heuristic,
    /// The records, and what of them has no room.
    records: (&'a [Triangle], f32),
}

impl Exact<'_> {
    fn subtree(&self, cell: Aabb, content: CellContent, depth: u32) -> Subtree {
        let count = content.references.len();
        if self.heuristic.is_leaf(count, depth) {
            return Subtree::leaf(&content.references);
        }
        let best = self.best_split(&cell, &content);
        let Some(KdSplit { plane, .. }) = self.heuristic.paying(best, &cell, count) else {
            return Subtree::leaf(&content.references);
        };
        let halves = halves(&cell, plane.axis, plane.at);
        let [left, right] = self.parts(content, &plane, &halves);
        let [left_cell, right_cell] = halves;
        Subtree::inner(
            &Threads,
            plane,
            count,
            || self.subtree(left_cell, left, depth + 1),
            || self.subtree(right_cell, right, depth + 1),
        )
    }

    /// The cheapest plane of all axes; of equal ones that of the first axis, and there the leftmost.
    fn best_split(&self, cell: &Aabb, content: &CellContent) -> Option<KdSplit> {
        let count = content.references.len();
        let of = |axis: usize| self.best_split_of(cell, axis, &content.events[axis], count as u32);
        let [x, y, z] = if count < ALONE { [0, 1, 2].map(of) } else { Threads.axes(of) };
        KdSplit::better(KdSplit::better(x, y), z)
    }

    fn best_split_of(&self, cell: &Aabb, axis: usize, events: &[Event], count: u32) -> Option<KdSplit> {
        let (mut left, mut right) = (0, count);
        let mut best = None;
        for here in events.chunk_by(|a, b| a.at == b.at) {
            let of = |kind: Kind| here.iter().filter(|event| event.kind == kind).count() as u32;
            let (ends, flat) = (of(Kind::Ends), of(Kind::IsFlat));
            right -= ends + flat;
            best = KdSplit::better(best, self.heuristic.split(cell, (axis, here[0].at), [left, flat, right]));
            left += here.len() as u32 - ends;
        }
        best
    }

    /// What is in the two halves of a cell.
    fn parts(&self, content: CellContent, plane: &KdPlane, halves: &[Aabb; 2]) -> [CellContent; 2] {
        let mut parts = [CellContent::default(), CellContent::default()];
        // Of each reference, where it went on each side; of what straddles the plane, nothing, as its events are new.
        let mut went = vec![[NOWHERE; 2]; content.references.len()];
        let mut straddling: [Vec<u32>; 2] = Default::default();
        for (i, reference) in content.references.iter().enumerate() {
            let divided = divided(reference, self.records, plane, halves);
            let straddles = plane.sides_of(&reference.bounds) == [true; 2];
            for side in 0..2 {
                let Some(reference) = divided[side] else { continue };
                let at = parts[side].references.len() as u32;
                parts[side].references.push(reference);
                if straddles {
                    straddling[side].push(at);
                } else {
                    went[i][side] = at;
                }
            }
        }
        let CellContent { references, events } = content;
        drop(references);
        for (axis, events) in events.into_iter().enumerate() {
            for side in 0..2 {
                let part = &parts[side];
                let kept = events.iter().filter_map(|event| {
                    let reference = went[event.reference as usize][side];
                    (reference != NOWHERE).then_some(Event { reference, ..*event })
                });
                let face = |&i: &u32| faces(&part.references[i as usize].bounds, axis, i);
                let mut new: Vec<Event> = straddling[side].iter().flat_map(face).collect();
                new.sort_unstable_by(Event::order);
                let merged = merged(kept, new, 2 * part.references.len());
                parts[side].events[axis] = merged;
            }
        }
        parts
    }
}

const NOWHERE: u32 = u32::MAX;

/// Two ordered sequences as one.
fn merged(kept: impl Iterator<Item = Event>, new: Vec<Event>, count: usize) -> Vec<Event> {
    let mut all = Vec::with_capacity(count);
    let mut new = new.into_iter().peekable();
    for event in kept {
        while let Some(first) = new.next_if(|new| new.order(&event) == Ordering::Less) {
            all.push(first);
        }
        all.push(event);
    }
    all.extend(new);
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use hedgerow::kdtree::termination::Costs;
    use hedgerow::kdtree::twin::clip::{bounds_of, cell_around};

    /// Triangles in the cube, some of them along its axes and with common coordinates.
    fn triangles(count: usize, seed: u64) -> Vec<Triangle> {
        let mut state = seed;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 * 2f32.powi(-24)
        };
        let corner = |round: bool, at: [f32; 3], random: &mut dyn FnMut() -> f32| {
            at.map(|x| x + 0.3 * random()).map(|x| if round { (8.0 * x).round() / 8.0 } else { x })
        };
        (0..count)
            .map(|i| {
                let at = [(); 3].map(|()| random());
                let [v0, v1, v2] = [(); 3].map(|()| corner(i % 2 == 0, at, &mut random));
                Triangle { v0, v1, v2, primitive: i as u32 }
            })
            .collect()
    }

    fn content_of(records: &[Triangle]) -> (Aabb, CellContent) {
        let reference =
            |(i, t): (usize, &Triangle)| KdReference { bounds: bounds_of(&[t.v0, t.v1, t.v2], 9.0), record: i as u32 };
        let references: Vec<KdReference> = records.iter().enumerate().map(reference).collect();
        let cell = records.iter().fold(Aabb::EMPTY, |b, t| b.union(&cell_around(&[t.v0, t.v1, t.v2], 9.0)));
        (cell, CellContent::sorted(references))
    }

    /// All faces of all boxes, each with all boxes counted.
    fn best_by_brute_force(heuristic: &Heuristic, cell: &Aabb, references: &[KdReference]) -> Option<KdSplit> {
        let mut best: Option<KdSplit> = None;
        for axis in 0..3 {
            for plane in references.iter().flat_map(|r| [r.bounds.lo[axis], r.bounds.hi[axis]]) {
                let left = references.iter().filter(|r| r.bounds.lo[axis] < plane).count() as u32;
                let right = references.iter().filter(|r| r.bounds.hi[axis] > plane).count() as u32;
                let is_flat = |r: &&KdReference| r.bounds.lo[axis] == plane && r.bounds.hi[axis] == plane;
                let planar = references.iter().filter(is_flat).count() as u32;
                let Some(split) = heuristic.split(cell, (axis, plane), [left, planar, right]) else { continue };
                let is_better = best.is_none_or(|b| {
                    let key = |s: &KdSplit| (s.cost, s.plane.axis as f32, s.plane.at);
                    key(&split) < key(&b)
                });
                if is_better {
                    best = Some(split);
                }
            }
        }
        best
    }

    /// In the root and in the cells below it.
    #[test]
    fn a_sweep_over_events_finds_what_looking_at_every_plane_does() {
        for (count, seed) in [(1, 1), (2, 2), (3, 3), (10, 4), (60, 5), (200, 6)] {
            let records = triangles(count, seed);
            let (cell, content) = content_of(&records);
            let heuristic = Heuristic::new(Costs::DEFAULT, &cell, count as u32);
            let exact = Exact { heuristic: &heuristic, records: (&records, 9.0) };
            let mut cells = vec![(cell, content)];
            let mut splits = 0;
            while let Some((cell, content)) = cells.pop().filter(|_| splits < 40) {
                let split = exact.best_split(&cell, &content);
                assert_eq!(split, best_by_brute_force(&heuristic, &cell, &content.references), "{count} {cell:?}");
                let Some(KdSplit { plane, .. }) = split.filter(|_| content.references.len() > 1) else { continue };
                splits += 1;
                let halves = halves(&cell, plane.axis, plane.at);
                for (half, part) in halves.into_iter().zip(exact.parts(content, &plane, &halves)) {
                    assert_eq!(part.events, CellContent::sorted(part.references.clone()).events, "merged as sorted");
                    assert!(part.references.iter().all(|r| half.contains(&r.bounds)), "boxes in their cell");
                    cells.push((half, part));
                }
            }
        }
    }
}
