//! Spatial splits: references are cut at a plane, or left whole on one side of it.

use super::object::of_axes;
use super::{Build, PART, SHORTEST_CUT, Search, aabb};
use crate::bvh::bounds::{Bounds, Item};
use crate::bvh::heuristic::split_cost::{Place, Side, SplitCost};
use glam::Vec3A;
use hedgerow::bvh::twin::split::halves;

/// A split of space: what it costs if all that crosses its plane is cut.
pub(super) struct SpatialSplit {
    pub cost: f32,
    axis: usize,
    at: f32,
    sides: [Side; 2],
    /// Whether what crosses may be left whole on a side.
    takes_whole: [bool; 2],
}

/// A bin of space: around the parts of references in it, how many references begin in it, and how many end.
#[derive(Clone, Copy)]
struct Bin {
    parts: Bounds,
    begin: Count,
    end: Count,
}

impl Bin {
    const EMPTY: Bin = Bin { parts: Bounds::EMPTY, begin: Count { all: 0, seen: 0 }, end: Count { all: 0, seen: 0 } };

    fn add(&mut self, part: Bounds) {
        self.parts = self.parts.union(part);
    }

    /// The parts, and the references that begin here: each is on the left of a plane that is behind its beginning.
    fn of_left(&self) -> Side {
        Side { bounds: self.parts, count: self.begin.all, seen: self.begin.seen }
    }

    /// The parts, and the references that end here: each is on the right of a plane that is before its end.
    fn of_right(&self) -> Side {
        Side { bounds: self.parts, count: self.end.all, seen: self.end.seen }
    }
}

/// How many references, and how many of them are seen.
#[derive(Clone, Copy)]
struct Count {
    all: u32,
    seen: u32,
}

impl Count {
    fn add_one(&mut self, seen: u32) {
        self.all += 1;
        self.seen += seen;
    }
}

/// Equal bins of a node's box along an axis.
struct Slabs {
    axis: usize,
    /// Where bins begin, and where the last one ends.
    borders: Vec<f32>,
    per_length: f32,
}

impl Slabs {
    fn new(node: &Bounds, axis: usize, bins: usize) -> Option<Slabs> {
        let (lo, hi) = (node.lo[axis], node.hi[axis]);
        let extent = hi - lo;
        (extent > SHORTEST_CUT).then(|| {
            let border = |i: usize| if i == bins { hi } else { lo + extent * (i as f32 / bins as f32) };
            Slabs { axis, borders: (0..=bins).map(border).collect(), per_length: bins as f32 / extent }
        })
    }

    /// The first bin that a box is in, and the last one: exactly as its sides are before or behind borders, however the place was
    /// rounded. What is flat and in a border is behind it.
    fn bins_of(&self, bounds: &Bounds) -> (usize, usize) {
        let (lo, hi) = (bounds.lo[self.axis], bounds.hi[self.axis]);
        let most = self.borders.len() - 2;
        let near = |x: f32| (((x - self.borders[0]) * self.per_length) as usize).min(most);
        let (mut first, mut last) = (near(lo), near(hi));
        while first > 0 && lo < self.borders[first] {
            first -= 1;
        }
        while first < most && lo >= self.borders[first + 1] {
            first += 1;
        }
        while last < most && hi > self.borders[last + 1] {
            last += 1;
        }
        while last > first && hi <= self.borders[last] {
            last -= 1;
        }
        (first, last.max(first))
    }
}

impl<S: SplitCost> Search<'_, S> {
    /// The plane between bins of space that costs least and adds no more references than there is room for.
    pub(super) fn spatial_split(&self, references: &[Item], node: &Bounds, room: usize) -> Option<SpatialSplit> {
        let of_axis = |axis| self.spatial_split_by(references, &Slabs::new(node, axis, self.build.bins)?, room);
        let splits = of_axes(references.len(), of_axis);
        splits.into_iter().flatten().reduce(|a, b| if b.cost < a.cost { b } else { a })
    }

    fn spatial_split_by(&self, references: &[Item], slabs: &Slabs, room: usize) -> Option<SpatialSplit> {
        let bins = self.filled(references, slabs);
        let places = references.iter().map(|reference| {
            let (first, last) = slabs.bins_of(&reference.bounds());
            Place { primitive: reference.primitive(), first, last }
        });
        let costs = self.costs(&bins, [Bin::of_left, Bin::of_right], places);
        let most = references.len() + room;
        let mut best: Option<(f32, usize)> = None;
        let [mut left, mut right] = [0, references.len()];
        for ((bin, cost), at) in bins.iter().zip(costs).zip(1..) {
            left += bin.begin.all as usize;
            right -= bin.end.all as usize;
            let is_possible = left > 0 && right > 0 && left + right <= most;
            if is_possible && best.is_none_or(|best| cost < best.0) {
                best = Some((cost, at));
            }
        }
        let (cost, at) = best?;
        let around = |bins: &[Bin], of: fn(&Bin) -> Side| bins.iter().map(of).fold(Side::EMPTY, Side::union);
        let sides = [around(&bins[..at], Bin::of_left), around(&bins[at..], Bin::of_right)];
        let takes_whole = sides.map(|side| self.by.takes_whole(self.here, &side));
        Some(SpatialSplit { cost, axis: slabs.axis, at: slabs.borders[at], sides, takes_whole })
    }

    /// The bins, with the references chopped at their borders.
    fn filled(&self, references: &[Item], slabs: &Slabs) -> Vec<Bin> {
        let mut bins = vec![Bin::EMPTY; slabs.borders.len() - 1];
        for reference in references {
            let bounds = reference.bounds();
            let (first, last) = slabs.bins_of(&bounds);
            let seen = u32::from(self.by.is_seen(reference));
            bins[first].begin.add_one(seen);
            bins[last].end.add_one(seen);
            if first == last {
                bins[first].add(bounds);
            } else {
                let outline = Outline::new((self.build.corners)(reference.primitive()), slabs.axis);
                outline.chop(&bounds, &slabs.borders[first..=last + 1], &mut bins[first..=last]);
            }
        }
        bins
    }
}

impl Build<'_> {
    /// The references of the parts below and above a plane.
    fn parts(&self, reference: &Item, axis: usize, at: f32) -> [Option<Item>; 2] {
        let primitive = reference.primitive();
        let halves = halves(&(self.corners)(primitive), &aabb(reference.bounds()), axis, at);
        halves.map(|half| {
            let is_there = (0..3).all(|axis| half.lo[axis] <= half.hi[axis]);
            is_there.then(|| Item::new(Bounds::of(&half), primitive, PART))
        })
    }

    /// The references on both sides of a plane; `None` if one of them has none in the end.
    pub(super) fn cut(&self, references: &[Item], split: &SpatialSplit) -> Option<[Vec<Item>; 2]> {
        let SpatialSplit { axis, at, sides, takes_whole, .. } = *split;
        let room = |side: Side| Vec::with_capacity(side.count as usize);
        let mut cut = Cut { sides, takes_whole, references: sides.map(room) };
        for reference in references {
            let Bounds { lo, hi } = reference.bounds();
            if lo[axis] >= at {
                cut.references[1].push(*reference);
            } else if hi[axis] <= at {
                cut.references[0].push(*reference);
            } else if reference.bounds().longest_edge().1 < SHORTEST_CUT {
                cut.whole(reference, usize::from(cut.cost_whole(reference, 1) < cut.cost_whole(reference, 0)));
            } else {
                cut.crossing(reference, self.parts(reference, axis, at));
            }
        }
        cut.references.iter().all(|side| !side.is_empty()).then_some(cut.references)
    }
}

/// A triangle whose parts between planes across an axis are measured. Not so carefully that rays could do with them: what is cut in
/// the end is cut by `halves`, which takes several times as long.
struct Outline {
    axis: usize,
    corners: [Vec3A; 3],
    /// From each corner to the next one, and how much of that a unit along the axis is.
    edges: [(Vec3A, f32); 3],
}

impl Outline {
    fn new(corners: [[f32; 3]; 3], axis: usize) -> Outline {
        let corners = corners.map(Vec3A::from_array);
        let edges = [0, 1, 2].map(|i| {
            let edge = corners[(i + 1) % 3] - corners[i];
            (edge, 1.0 / edge[axis])
        });
        Outline { axis, corners, edges }
    }

    /// Around where a plane crosses the edges.
    #[inline]
    fn crossings(&self, at: f32) -> Bounds {
        let mut around = Bounds::EMPTY;
        for (i, (corner, (edge, per_length))) in self.corners.iter().zip(&self.edges).enumerate() {
            let (from, to) = (corner[self.axis], self.corners[(i + 1) % 3][self.axis]);
            if from.min(to) < at && at < from.max(to) {
                let mut point = *corner + *edge * ((at - from) * per_length);
                point[self.axis] = at;
                around = around.union(Bounds::point(point));
            }
        }
        around
    }

    /// Adds the parts between borders to the bins between them; of a reference whose box ends in the first and the last of them.
    fn chop(&self, reference: &Bounds, borders: &[f32], bins: &mut [Bin]) {
        let (axis, last) = (self.axis, bins.len() - 1);
        let mut at_begin = (reference.lo[axis], self.crossings(reference.lo[axis]));
        for (i, bin) in bins.iter_mut().enumerate() {
            let end = if i == last { reference.hi[axis] } else { borders[i + 1] };
            let at_end = (end, self.crossings(end));
            let corners = self.corners.iter().filter(|corner| at_begin.0 <= corner[axis] && corner[axis] <= end);
            let around =
                corners.fold(at_begin.1.union(at_end.1), |around, &corner| around.union(Bounds::point(corner)));
            let part = Bounds { lo: around.lo.max(reference.lo), hi: around.hi.min(reference.hi) };
            if part.lo.cmple(part.hi).all() {
                bin.add(part);
            }
            at_begin = at_end;
        }
    }
}

/// A node while it is cut: both sides, as if all that crosses and was not seen yet were cut.
struct Cut {
    sides: [Side; 2],
    takes_whole: [bool; 2],
    references: [Vec<Item>; 2],
}

impl Cut {
    fn crossing(&mut self, reference: &Item, parts: [Option<Item>; 2]) {
        match parts {
            [Some(below), Some(above)] => {
                let [left, right] = self.sides.map(|side| side.bounds.half_area() * side.count as f32);
                let whole = [0, 1].map(|side| self.cost_whole(reference, side));
                if left + right <= whole[0].min(whole[1]) {
                    self.references[0].push(below);
                    self.references[1].push(above);
                } else {
                    self.whole(reference, usize::from(whole[1] < whole[0]));
                }
            }
            [None, None] => self.whole(reference, 0),
            [Some(part), None] => self.whole(&part, 0),
            [None, Some(part)] => self.whole(&part, 1),
        }
    }

    /// What both sides cost by area with a reference that crosses on one side alone.
    fn cost_whole(&self, reference: &Item, on: usize) -> f32 {
        if !self.takes_whole[on] {
            return f32::INFINITY;
        }
        let (own, other) = (&self.sides[on], &self.sides[1 - on]);
        let area = own.bounds.union(reference.bounds()).half_area();
        area * own.count as f32 + other.bounds.half_area() * (other.count as f32 - 1.0)
    }

    /// Puts a reference that crosses on one side alone.
    fn whole(&mut self, reference: &Item, on: usize) {
        self.sides[on].bounds = self.sides[on].bounds.union(reference.bounds());
        self.sides[1 - on].count -= 1;
        self.references[on].push(*reference);
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::top_down::LeafRule;
    use super::*;
    use hedgerow::bvh::sah::Collapse;

    /// Five references on either side of a plane, of which one reaches a hundredth beyond it.
    #[test]
    fn what_crosses_is_left_whole_where_that_is_cheaper_and_allowed() {
        let corners = [[0.4, 0.0, 0.0], [0.51, 0.0, 0.1], [0.51, 0.1, 0.0]];
        let rule = LeafRule { costs: &Collapse::SAH, single: true };
        let build = Build { corners: &|_| corners, rule, bins: 2, least_overlap: Some(0.0) };
        let item = |lo: [f32; 3], hi: [f32; 3], primitive: u32| {
            Item::new(Bounds { lo: Vec3A::from_array(lo), hi: Vec3A::from_array(hi) }, primitive, 1)
        };
        let mut references = vec![item([0.4, 0.0, 0.0], [0.51, 0.1, 0.1], 0)];
        references.extend((1..5).map(|i| item([0.0; 3], [0.5, 1.0, 1.0], i)));
        references.extend((5..9).map(|i| item([0.5, 0.0, 0.0], [1.0; 3], i)));
        let side = |lo: f32, hi: f32| {
            let bounds = Bounds { lo: Vec3A::new(lo, 0.0, 0.0), hi: Vec3A::new(hi, 1.0, 1.0) };
            Side { bounds, count: 5, seen: 0 }
        };
        // Half areas are 2 of a side, 2.02 of the left one with all of it and 2.2 of the right one: 18.1, 19 and, cut, 20.
        for (takes_whole, expected) in
            [([true, true], [5, 4]), ([false, true], [4, 5]), ([true, false], [5, 4]), ([false, false], [5, 5])]
        {
            let split =
                SpatialSplit { cost: 0.0, axis: 0, at: 0.5, sides: [side(0.0, 0.5), side(0.5, 1.0)], takes_whole };
            let found = build.cut(&references, &split).expect("both sides have some");
            assert_eq!(found.each_ref().map(Vec::len), expected, "{takes_whole:?}");
            let parts = found.concat().iter().filter(|reference| reference.weight() == PART).count();
            assert_eq!(parts, if takes_whole == [false; 2] { 2 } else { 0 });
        }
    }
}
