//! The occlusion heuristic as its authors build by it (Vinkler, Havran, Sochor 2012; their builder of NTrace, which the paper does
//! not tell all of).
//!
//! Besides what [`super::occlusion`] has:
//!
//! - the heuristic is asked above the depth ⌊½ log₂ n⌋ of n primitives alone;
//! - it chooses among planes between bins of space, and what crosses one is divided. Where it does not win, planes of space by
//!   surface area compete with splits of whole primitives whether their sides overlap or not;
//! - a primitive that crosses such a plane is not left whole on a side without seen ones;
//! - below that depth primitives are divided by surface area in nodes with seen ones alone, and above it in no node that has not both;
//! - the child with more seen primitives is the left one;
//! - where no primitive can be divided, w is multiplied by 1 − N(seen) / N.
//!
//! The authors add the cost of the node, which grows with its area, to a sum of probabilities. That is not here: it is the same for
//! all splits of a node.

use super::occlusion::{Seen, SeenHere, hides_more};
use super::split_cost::{Area, First, Members, Side, Space, SplitCost};
use crate::bvh::bounds::{Bounds, Item};

/// What the heuristic chooses among.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Planes {
    /// Planes of space.
    Space,
    /// Splits of whole primitives.
    Objects,
}

/// The seen primitives of a scene in which there are others too, with the authors' rules.
pub(crate) struct Complete<'a> {
    seen: &'a Seen<'a>,
    planes: Planes,
    /// The heuristic is asked above this depth.
    depth: u32,
}

/// What of a node is seen, and how deep it is.
pub(crate) struct CompleteHere {
    of: SeenHere,
    depth: u32,
}

impl<'a> Complete<'a> {
    /// In a scene of `count` primitives.
    pub fn new(seen: &'a Seen<'a>, planes: Planes, count: usize) -> Complete<'a> {
        Complete { seen, planes, depth: count.max(1).ilog2() / 2 }
    }

    /// Whether the heuristic is asked in a node.
    fn decides(&self, here: &CompleteHere) -> bool {
        here.depth < self.depth && here.of.is_mixed()
    }
}

impl SplitCost for Complete<'_> {
    type Here = CompleteHere;
    type Rival = AreaAnywhere;

    fn root(&self, whole: impl FnOnce() -> Side) -> CompleteHere {
        CompleteHere { of: SeenHere::of(&whole()), depth: 0 }
    }

    fn is_seen(&self, item: &Item) -> bool {
        self.seen.is_seen(item)
    }

    fn of_node(&self, here: &CompleteHere, bounds: &Bounds) -> f32 {
        if self.decides(here) { 1.0 } else { bounds.half_area() }
    }

    fn of_sides(&self, here: &CompleteHere, sides: impl Iterator<Item = Side>) -> impl Iterator<Item = (f32, Side)> {
        let decides = self.decides(here);
        let w = match self.planes {
            Planes::Space => self.seen.weight,
            Planes::Objects => self.seen.weight * (1.0 - here.of.seen as f32 / here.of.count as f32),
        };
        let weight = move |side: &Side| if decides { here.of.weight_of(side, w) } else { side.bounds.half_area() };
        sides.map(move |side| (weight(&side), side))
    }

    fn divide(
        &self,
        here: CompleteHere,
        sides: impl FnOnce() -> [Side; 2],
        _members: &Members<'_>,
    ) -> (First, [CompleteHere; 2]) {
        let sides = sides();
        let first = if sides[1].seen > sides[0].seen { First::Right } else { First::Left };
        (first, sides.each_ref().map(|side| CompleteHere { of: SeenHere::of(side), depth: here.depth + 1 }))
    }

    fn space(&self, here: &CompleteHere) -> Space {
        if self.decides(here) {
            Space::Alone
        } else if here.depth < self.depth || here.of.seen == 0 {
            Space::Nowhere
        } else {
            Space::Overlaps
        }
    }

    fn takes_whole(&self, here: &CompleteHere, side: &Side) -> bool {
        !self.decides(here) || side.seen > 0
    }

    fn rival(&self, here: &CompleteHere) -> Option<AreaAnywhere> {
        self.decides(here).then_some(AreaAnywhere)
    }

    fn prefers(&self, own: &[Side; 2], by_area: &[Side; 2]) -> bool {
        hides_more(own, by_area)
    }
}

/// The surface area, and planes of space whether sides overlap or not.
pub(crate) struct AreaAnywhere;

impl SplitCost for AreaAnywhere {
    type Here = ();
    type Rival = Area;
    const GROWS: bool = true;

    fn root(&self, _whole: impl FnOnce() -> Side) {}

    fn of_node(&self, here: &(), bounds: &Bounds) -> f32 {
        Area.of_node(here, bounds)
    }

    fn of_sides(&self, here: &(), sides: impl Iterator<Item = Side>) -> impl Iterator<Item = (f32, Side)> {
        Area.of_sides(here, sides)
    }

    fn divide(&self, here: (), sides: impl FnOnce() -> [Side; 2], members: &Members<'_>) -> (First, [(); 2]) {
        Area.divide(here, sides, members)
    }

    fn space(&self, _here: &()) -> Space {
        Space::Here
    }
}

#[cfg(test)]
mod tests {
    use super::super::Occlusion;
    use super::*;
    use crate::bvh::bounds::tests::boxes;
    use glam::Vec3A;

    fn side(count: u32, seen: u32, length: f32) -> Side {
        Side { bounds: Bounds { lo: Vec3A::ZERO, hi: Vec3A::new(length, 1.0, 1.0) }, count, seen }
    }

    fn at(depth: u32, count: u32, seen: u32) -> CompleteHere {
        CompleteHere { of: SeenHere::of(&side(count, seen, 2.0)), depth }
    }

    fn with<T>(planes: Planes, count: usize, test: impl FnOnce(&Complete<'_>) -> T) -> T {
        let seen = [true, false];
        let seen = Seen::new(&Occlusion::of(&seen), &boxes(2)).expect("one of both");
        test(&Complete::new(&seen, planes, count))
    }

    #[test]
    fn the_heuristic_is_asked_above_half_the_depth_of_a_balanced_tree() {
        for (count, depth) in [(1, 0), (3, 0), (4, 1), (1023, 4), (1024, 5), (4095, 5), (4096, 6)] {
            with(Planes::Space, count, |complete| {
                assert_eq!(complete.depth, depth, "{count}");
                assert!(!complete.decides(&at(depth, 10, 4)));
                assert!(depth == 0 || complete.decides(&at(depth - 1, 10, 4)));
                // Below, a side counts by its area, and nothing is compared.
                let below = complete.of_sides(&at(depth, 10, 4), std::iter::once(side(3, 1, 1.0))).next();
                assert_eq!(below.expect("a side").0, 3.0);
                assert!(complete.rival(&at(depth, 10, 4)).is_none());
            });
        }
    }

    #[test]
    fn space_is_divided_where_something_is_seen() {
        with(Planes::Space, 1024, |complete| {
            for (depth, seen, space) in [
                (4, 3, Space::Alone),
                (4, 0, Space::Nowhere),
                (4, 10, Space::Nowhere),
                (5, 3, Space::Overlaps),
                (5, 10, Space::Overlaps),
                (5, 0, Space::Nowhere),
            ] {
                assert_eq!(complete.space(&at(depth, 10, seen)), space, "{depth}, {seen}");
            }
            let rival = complete.rival(&at(4, 10, 3)).expect("compared");
            assert_eq!(rival.space(&()), Space::Here);
        });
    }

    #[test]
    fn nothing_is_left_whole_on_a_side_without_seen_primitives() {
        with(Planes::Space, 1024, |complete| {
            let here = at(0, 10, 4);
            assert!(complete.takes_whole(&here, &side(3, 1, 1.0)) && !complete.takes_whole(&here, &side(3, 0, 1.0)));
            assert!(complete.takes_whole(&at(5, 10, 4), &side(3, 0, 1.0)));
        });
        assert!(AreaAnywhere.takes_whole(&(), &side(3, 0, 1.0)));
    }

    #[test]
    fn the_child_with_more_seen_primitives_is_the_left_one() {
        with(Planes::Space, 1024, |complete| {
            for (seen, first) in [([1, 3], First::Right), ([3, 1], First::Left), ([2, 2], First::Left)] {
                // Whatever else they have, and however deep.
                for depth in [0, 9] {
                    let sides = || [side(9, seen[0], 1.0), side(5, seen[1], 1.0)];
                    let (found, heres) = complete.divide(at(depth, 14, 4), sides, &|_| {});
                    assert_eq!(found, first);
                    assert_eq!(heres.map(|here| (here.of.seen, here.depth)), [0, 1].map(|i| (seen[i], depth + 1)));
                }
            }
        });
    }

    #[test]
    fn what_is_seen_weighs_less_among_whole_primitives() {
        // Half areas are 5 of the node and 3 of the side: 0.9 × 1/4 + 0.1 × 3/5, and with 0.9 × (1 − 4/10) in place of 0.9.
        for (planes, expected) in [(Planes::Space, 0.285), (Planes::Objects, 0.54 * 0.25 + 0.46 * 0.6)] {
            let weight = with(planes, 1024, |complete| {
                complete.of_sides(&at(0, 10, 4), std::iter::once(side(3, 1, 1.0))).next().expect("a side").0
            });
            assert!((weight - expected).abs() < 1e-6, "{planes:?}: {weight}");
        }
    }
}
