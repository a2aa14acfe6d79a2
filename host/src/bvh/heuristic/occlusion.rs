//! The occlusion heuristic (Vinkler, Havran, Sochor 2012, "Visibility driven BVH build up algorithm for ray tracing"; van Kralingen
//! 2023, section 3.2.3).
//!
//! A primitive is seen if a ray of the last frame ended on it. In a node with some seen primitives and some that are not, a side
//! counts by its part of the seen ones: P(L) = w N(L) / (N(L) + N(R)) + (1 − w) SA(L) / SA(node) (equation 16). The best split by
//! it is taken where it hides more primitives than the best one by surface area (equation 17): those on its side with fewer seen
//! ones are more than there are on either side of the other. Elsewhere, and where all primitives or none are seen, the surface area
//! decides.
//!
//! What the authors' builder has besides is in `occlusion_complete`.

use super::checked_weight;
use super::split_cost::{Area, First, Members, Side, SplitCost};
use crate::bvh::bounds::{Bounds, Item};
use hedgerow::{Error, Result};

/// Which primitives were seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Occlusion<'a> {
    /// Of each primitive, whether a ray ended on it.
    pub seen: &'a [bool],
    /// Their weight beside the surface area, from 0 to 1.
    pub weight: f32,
}

impl<'a> Occlusion<'a> {
    /// With the weight that the authors take, 0.9.
    pub const fn of(seen: &'a [bool]) -> Occlusion<'a> {
        Occlusion { seen, weight: 0.9 }
    }

    /// Whether a tree over `count` primitives can be built for them.
    ///
    /// # Errors
    /// [`Error::Argument`] names the weight or the number that cannot be used, and what can.
    pub fn check(&self, count: usize) -> Result<()> {
        checked_weight(self.weight)?;
        let known = self.seen.len();
        let error = || {
            let text = format!("of {known} primitives it is known whether they are seen, the scene has {count}");
            Error::Argument(format!("{text}; take one value for each primitive"))
        };
        (known == count).then_some(()).ok_or_else(error)
    }
}

/// The seen primitives of a scene in which there are others too.
pub(crate) struct Seen<'a> {
    pub(super) seen: &'a [bool],
    pub(super) weight: f32,
}

/// What of a node is seen.
pub(crate) struct SeenHere {
    pub seen: u32,
    pub count: u32,
    /// The node's half area.
    area: f32,
}

impl SeenHere {
    pub fn of(side: &Side) -> SeenHere {
        SeenHere { seen: side.seen, count: side.count, area: side.bounds.half_area() }
    }

    /// Whether some primitives are seen and some are not.
    pub fn is_mixed(&self) -> bool {
        0 < self.seen && self.seen < self.count
    }

    /// Equation 16 with this w; the area of a side where all primitives or none are seen.
    pub fn weight_of(&self, side: &Side, w: f32) -> f32 {
        let area = side.bounds.half_area();
        if !self.is_mixed() {
            return area;
        }
        let by_area = if self.area > 0.0 { area / self.area } else { 0.0 };
        w * side.seen as f32 / self.seen as f32 + (1.0 - w) * by_area
    }
}

impl<'a> Seen<'a> {
    /// Among `items`; `None` if all or none of them are seen.
    pub fn new(occlusion: &Occlusion<'a>, items: &[Item]) -> Option<Seen<'a>> {
        let Occlusion { seen, weight } = *occlusion;
        let is_seen = |item: &Item| seen[item.primitive() as usize];
        let is_mixed = items.iter().any(is_seen) && !items.iter().all(is_seen);
        is_mixed.then_some(Seen { seen, weight })
    }
}

impl SplitCost for Seen<'_> {
    type Here = SeenHere;
    type Rival = Area;

    fn root(&self, whole: impl FnOnce() -> Side) -> SeenHere {
        SeenHere::of(&whole())
    }

    fn is_seen(&self, item: &Item) -> bool {
        self.seen[item.primitive() as usize]
    }

    fn of_node(&self, here: &SeenHere, bounds: &Bounds) -> f32 {
        if here.is_mixed() { 1.0 } else { bounds.half_area() }
    }

    fn of_sides(&self, here: &SeenHere, sides: impl Iterator<Item = Side>) -> impl Iterator<Item = (f32, Side)> {
        sides.map(|side| (here.weight_of(&side, self.weight), side))
    }

    fn divide(
        &self,
        _here: SeenHere,
        sides: impl FnOnce() -> [Side; 2],
        _members: &Members<'_>,
    ) -> (First, [SeenHere; 2]) {
        (First::Left, sides().each_ref().map(SeenHere::of))
    }

    fn rival(&self, here: &SeenHere) -> Option<Area> {
        here.is_mixed().then_some(Area)
    }

    fn prefers(&self, own: &[Side; 2], by_area: &[Side; 2]) -> bool {
        hides_more(own, by_area)
    }
}

/// Equation 17: whether a split hides more primitives than there are on either side of the one by area.
pub(super) fn hides_more([left, right]: &[Side; 2], by_area: &[Side; 2]) -> bool {
    let hidden = if left.seen < right.seen { left.count } else { right.count };
    hidden > by_area[0].count.max(by_area[1].count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::bounds::tests::boxes;
    use glam::Vec3A;

    fn side(count: u32, seen: u32, length: f32) -> Side {
        Side { bounds: Bounds { lo: Vec3A::ZERO, hi: Vec3A::new(length, 1.0, 1.0) }, count, seen }
    }

    fn seen_of(seen: &[bool]) -> Option<Seen<'_>> {
        Seen::new(&Occlusion::of(seen), &boxes(seen.len() as u32))
    }

    #[test]
    fn a_split_is_taken_where_it_hides_more_than_the_one_by_area() {
        let seen = seen_of(&[true, false]).expect("one of both");
        let by_area = [side(5, 2, 1.0), side(5, 2, 1.0)];
        // Six are hidden behind four of which all are seen; four behind six; five are not more than five.
        assert!(seen.prefers(&[side(6, 0, 1.0), side(4, 4, 1.0)], &by_area));
        assert!(seen.prefers(&[side(4, 4, 1.0), side(6, 0, 1.0)], &by_area));
        assert!(!seen.prefers(&[side(6, 4, 1.0), side(4, 0, 1.0)], &by_area));
        assert!(!seen.prefers(&[side(5, 4, 1.0), side(5, 0, 1.0)], &by_area));
        // As many on both sides: the right one counts.
        assert!(seen.prefers(&[side(4, 2, 1.0), side(6, 2, 1.0)], &by_area));
        assert!(!seen.prefers(&[side(6, 2, 1.0), side(4, 2, 1.0)], &by_area));
    }

    #[test]
    fn a_side_counts_by_its_seen_primitives_and_its_area() {
        let seen = seen_of(&[true, false]).expect("one of both");
        let of = |node: Side, side: Side| {
            let here = SeenHere::of(&node);
            let weight = seen.of_sides(&here, std::iter::once(side)).next().expect("one side").0;
            (weight, seen.of_node(&here, &node.bounds))
        };
        // Half areas are 5 of the node and 3 of the side.
        let (weight, whole) = of(side(10, 4, 2.0), side(3, 1, 1.0));
        assert!((weight - (0.9 * 0.25 + 0.1 * 0.6)).abs() < 1e-6, "{weight}");
        assert_eq!(whole, 1.0);
        for all_or_none in [0, 10] {
            assert_eq!(of(side(10, all_or_none, 2.0), side(3, 0, 1.0)), (3.0, 5.0));
        }
    }

    #[test]
    fn all_or_none_seen_is_no_occlusion() {
        assert!(seen_of(&[true; 5]).is_none() && seen_of(&[false; 5]).is_none() && seen_of(&[]).is_none());
        assert!(seen_of(&[true, true, false]).is_some());
        let error = Occlusion::of(&[true; 5]).check(7).expect_err("two are missing").to_string();
        assert!(error.contains("of 5 primitives") && error.contains("has 7"), "{error}");
    }
}
