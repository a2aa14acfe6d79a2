//! Robust bounds: codes for which far and huge primitives cost (almost) nothing. The scheme is our own; it follows what Riemersma
//! 2024, section 5, leaves to the future: a heuristic that filters primitives into sections while they are encoded, with the split
//! between the sections at the start of the code.
//!
//! *Fences* around a sample of the centroids, as Tukey draws them (1977, "Exploratory Data Analysis", section 2C), tell what is far: what
//! lies beyond the quartiles by more than twice the distance between them, so that up to a quarter of all primitives may be far to one
//! side, and as many to the other. (Tukey's inner fences are at 1.5 and his outer ones at 3 distances. At two, primitives that are spread
//! evenly have them at 7/4 of their extent, so that what doubles their bounds is far.) Many that are far move the quartiles outwards. So a
//! fence stands nearer where the sample has a *gap* before it, as long as the quartiles are apart, with something behind: in the middle of
//! the first part of the gap that is so long. Where nothing lies beyond, codes are those of the
//! full bounds. Otherwise there are three sections: the *core*, all boxes inside the fences, encoded within their own bounds, and those that
//! touch these and are no longer than they are; what is *far*; and what touches the core and is longer, *huge*. So the codes of the core are
//! the same as without the others, but for their last two bits.
//!
//! A code begins with a bit for what is huge, which otherwise would lie over every node above it. The bit that sets apart what
//! is far stands behind the first bit of each axis: only one octant of the core has the far primitives of one side in its node,
//! and those of different sides meet in no node of their own. Or it is the second bit of all ([`CodeBounds::Apart`](super::CodeBounds::Apart)):
//! then no node but the root holds what is far and what is near, but each ray visits a node more. Coordinates of what is far or huge are linear in the core and the
//! logarithm of the distance beyond it, so that a hundred far primitives at different distances are told apart, however far
//! they are.

use super::axis::{from_ordered, octaves, ordered};
use super::recipe::Extents;
use crate::geometry::Aabb;

/// Bits for what is huge, what is far, and one of each axis between them.
pub(super) const PREFIX_BITS: u32 = 5;
/// The bits for what is huge and what is far.
pub(super) const SECTION_BITS: u32 = 2;
/// Primitives that are looked at.
const SAMPLE: u64 = 256;
/// One in this many sampled centroids lies below the low quartile, and one above the high one.
const QUARTILE: usize = 4;
/// Distances between the quartiles from there to the fences.
const TO_FENCES: f32 = 2.0;
/// Parts of the way there, of which each has a centroid or none.
const STEPS: u32 = 32;
/// So many steps without a centroid are a gap: as long as the quartiles are apart.
const GAP: u32 = 16;

/// The sections of a scene that has something far or huge.
#[derive(Debug, Clone)]
pub(super) struct Sections {
    /// What is inside is of the core.
    fences: Aabb,
    /// The bounds of what is inside: the core's, but for what touches them.
    pub core: Aabb,
    /// [`octaves`] of their longest edge.
    longest: u32,
    /// Coordinate bits before the one of what is far: none where that stands apart.
    head: u32,
    tails: [Option<Tail>; 3],
}

/// Along one axis, what is beyond the core.
#[derive(Debug, Clone, Copy)]
struct Tail {
    /// [`octaves`] of the core's extent.
    reference: u32,
    /// Brings the leading bit of the farthest distance to the second bit from the top: tails are a quarter of the coordinate.
    shift: u32,
}

/// Where a primitive belongs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Section {
    Core,
    Far,
    Huge,
}

impl Section {
    pub fn is_core(self) -> bool {
        self == Section::Core
    }
}

/// Float comparison by [`ordered`] bits, as the device does: denormals are what they are.
fn below(a: f32, b: f32) -> bool {
    ordered(a) < ordered(b)
}

/// The box whose corners are given in [`ordered`] bits.
fn from_ordered_box(lo: [u32; 3], hi: [u32; 3]) -> Aabb {
    Aabb { lo: lo.map(from_ordered), hi: hi.map(from_ordered) }
}

fn is_inside(b: &Aabb, fences: &Aabb) -> bool {
    (0..3).all(|i| !below(b.lo[i], fences.lo[i]) && !below(fences.hi[i], b.hi[i]))
}

/// The primitives that are looked at, evenly over all but those at the end that are left out: re-braiding has as many entries as there may
/// be, and uses the first.
fn sample_of<E>(boxes: &[Result<Aabb, E>]) -> Vec<&Aabb> {
    let places = |count: u64| {
        let taken = count.min(SAMPLE);
        (0..taken).map(move |i| (i * count / taken) as usize)
    };
    let all = boxes.len() as u64;
    let behind = places(all).rev().take_while(|&at| boxes[at].is_err()).last();
    let count = behind.map_or(all, |at| at as u64);
    places(count).filter_map(|at| boxes[at].as_ref().ok()).collect()
}

/// Along each axis an eighth of the quartiles of the sample's centroids; of a sample that there is.
fn quartiles_of(sample: &[&Aabb]) -> [[f32; 2]; 3] {
    std::array::from_fn(|axis| {
        let mut keys: Vec<u32> = sample.iter().map(|b| ordered(b.centroid()[axis])).collect();
        keys.sort_unstable();
        let rank = keys.len() / QUARTILE;
        [keys[rank], keys[keys.len() - 1 - rank]].map(|key| from_ordered(key) * 0.125)
    })
}

/// Half of the extents that primitives would have whose centroids lie evenly between bounds, and have the quartiles of the sample's;
/// `None` without a sample.
pub(super) fn typical_extents<E>(boxes: &[Result<Aabb, E>]) -> Option<Extents> {
    let sample = sample_of(boxes);
    (!sample.is_empty()).then(|| {
        let eighths = quartiles_of(&sample).map(|[low, high]| high - low);
        // Half of twice the distance between the quartiles.
        let Extents(keys) = Extents::new(eighths);
        Extents(std::array::from_fn(|axis| if eighths[axis] > 0.0 { keys[axis] + (3 << 23) } else { keys[axis] }))
    })
}

/// How many steps beyond a quartile the fence stands, of the distances from the quartile outwards to each centroid.
fn steps_to_fence(step: f32, distances: impl Iterator<Item = f32>) -> u32 {
    if step < f32::MIN_POSITIVE {
        // Devices may take such numbers for zero.
        return STEPS;
    }
    // A bit for each step that has a centroid.
    let mut taken = 0_u32;
    for distance in distances.filter(|&d| 0.0 <= d && d < STEPS as f32 * step) {
        // The last step that begins before it, by products: a device's quotients may be inexact.
        let mut at = 0;
        for more in [16, 8, 4, 2, 1] {
            if (at + more) as f32 * step <= distance {
                at += more;
            }
        }
        taken |= 1 << at;
    }
    // The steps with which a gap begins.
    let mut gaps = !taken;
    for _ in 1..GAP {
        gaps &= gaps >> 1;
    }
    let gap = gaps.trailing_zeros();
    let has_more = gap + GAP < STEPS && taken >> (gap + GAP) != 0;
    if has_more { gap + GAP / 2 } else { STEPS }
}

/// Fences around a sample of these boxes' centroids; `None` without a sample.
pub(crate) fn fences_around<E>(boxes: &[Result<Aabb, E>]) -> Option<Aabb> {
    let sample = sample_of(boxes);
    if sample.is_empty() {
        return None;
    }
    let quartiles = quartiles_of(&sample);
    let widths = quartiles.map(|[low, high]| high - low);
    // What is thin is not therefore outlying: no axis is taken to be thinner than a quarter of the widest.
    let least = 0.25 * widths.into_iter().fold(0.0, f32::max);
    let mut fences = Aabb { lo: [f32::MIN; 3], hi: [f32::MAX; 3] };
    for axis in 0..3 {
        let step = widths[axis].max(least) * (TO_FENCES / STEPS as f32);
        let [low, high] = quartiles[axis];
        let eighths = || sample.iter().map(|b| b.centroid()[axis] * 0.125);
        let lo = low - steps_to_fence(step, eighths().map(|at| low - at)) as f32 * step;
        let hi = high + steps_to_fence(step, eighths().map(|at| at - high)) as f32 * step;
        // As far as floats go.
        if lo > f32::MIN * 0.125 {
            fences.lo[axis] = lo * 8.0;
        }
        if hi < f32::MAX * 0.125 {
            fences.hi[axis] = hi * 8.0;
        }
    }
    Some(fences)
}

/// Whether two boxes share no point.
pub(crate) fn is_apart(a: &Aabb, b: &Aabb) -> bool {
    (0..3).any(|i| below(a.hi[i], b.lo[i]) || below(b.hi[i], a.lo[i]))
}

impl Sections {
    /// The sections of primitives with these boxes, whose bounds are `bounds`; `None` where nothing is beyond the fences.
    pub fn of<E>(boxes: &[Result<Aabb, E>], bounds: &Aabb) -> Option<Sections> {
        let fences = fences_around(boxes)?;
        if is_inside(bounds, &fences) {
            return None;
        }
        let inside = boxes.iter().flatten().filter(|b| is_inside(b, &fences));
        let [mut lo, mut hi] = inside.fold([[u32::MAX; 3], [0; 3]], |[lo, hi], b| {
            [
                std::array::from_fn(|axis| lo[axis].min(ordered(b.lo[axis]))),
                std::array::from_fn(|axis| hi[axis].max(ordered(b.hi[axis]))),
            ]
        });
        if lo[0] > hi[0] {
            // Nothing is inside: as far as the bounds reach.
            lo = std::array::from_fn(|axis| ordered(fences.lo[axis]).max(ordered(bounds.lo[axis])));
            hi = std::array::from_fn(|axis| ordered(fences.hi[axis]).min(ordered(bounds.hi[axis])));
        }
        let core = from_ordered_box(lo, hi);
        let tails = std::array::from_fn(|axis| {
            let (lo, hi) = (core.lo[axis], core.hi[axis]);
            let is_beyond = below(bounds.lo[axis], lo) || below(hi, bounds.hi[axis]);
            let reference = octaves(hi, lo);
            let farthest = octaves(bounds.hi[axis], lo).max(octaves(bounds.lo[axis], hi)).saturating_sub(reference);
            is_beyond.then(|| Tail { reference, shift: 30 + farthest.max(1).leading_zeros() })
        });
        let longest = (0..3).map(|i| octaves(core.hi[i], core.lo[i])).max()?;
        Some(Sections { fences, core, longest, head: 0, tails })
    }

    /// The same with its far bit behind the first bit of each axis in this sequence.
    pub fn with_head(self, sequence: &[usize]) -> Sections {
        let again = (1..3).find(|&bit| sequence[..bit].contains(&sequence[bit])).unwrap_or(3);
        Sections { head: again as u32, ..self }
    }

    pub fn section_of(&self, primitive: &Aabb) -> Section {
        let touches = |i: usize| !below(self.core.hi[i], primitive.lo[i]) && !below(primitive.hi[i], self.core.lo[i]);
        // A tree whose crown reaches over the fences is no dome over everything.
        let is_longer = |i: usize| octaves(primitive.hi[i], primitive.lo[i]) > self.longest;
        match is_inside(primitive, &self.fences) {
            true => Section::Core,
            false if !(0..3).all(touches) => Section::Far,
            false if (0..3).any(is_longer) => Section::Huge,
            false => Section::Core,
        }
    }

    /// The coordinates of what is not of the core, from those within the core: the lower and the upper quarter are for what is
    /// beyond.
    pub fn coordinates(&self, at: [f32; 3], within: [u64; 3]) -> [u64; 3] {
        std::array::from_fn(|axis| {
            let Some(tail) = self.tails[axis] else { return within[axis] };
            let (lo, hi) = (self.core.lo[axis], self.core.hi[axis]);
            let beyond = |corner| u64::from(octaves(at[axis], corner).saturating_sub(tail.reference)) << tail.shift;
            if below(at[axis], lo) {
                (1 << 62) - 1 - beyond(hi)
            } else if below(hi, at[axis]) {
                (3 << 62) + beyond(lo)
            } else {
                (1 << 62) + (within[axis] >> 1)
            }
        })
    }

    /// The bits of the section put into a code of `bits` bits.
    pub fn insert(&self, section: Section, code: u64, bits: u32) -> u64 {
        let behind = bits - self.head;
        let head = code.checked_shr(behind).unwrap_or(0);
        let rest = (code & (u64::MAX >> (64 - behind))) >> 2;
        let huge = u64::from(section == Section::Huge);
        let beyond = u64::from(section != Section::Core);
        huge << (bits - 1) | head << (behind - 1) | beyond << (behind - 2) | rest
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Code, CodeBounds, CodePlan, Codes};
    use super::*;

    fn robust() -> Codes {
        Code::Emc64Var.full().with_bounds(CodeBounds::Robust).expect("it has no grid")
    }

    fn grid() -> Vec<Aabb> {
        let at = |i: u32| i as f32 / 10.0;
        let cells = (0..1000).map(|i| [at(i % 10), at(i / 10 % 10), at(i / 100)]);
        cells.map(|lo| Aabb { lo, hi: lo.map(|v| v + 0.05) }).collect()
    }

    fn plan(boxes: &[Aabb]) -> CodePlan {
        CodePlan::new(robust(), &boxes.iter().map(|&b| Ok::<_, u32>(b)).collect::<Vec<_>>())
    }

    #[test]
    fn a_scene_without_anything_far_has_the_codes_of_its_full_bounds() {
        let boxes = grid();
        let full = CodePlan::new(Code::Emc64Var.full(), &boxes.iter().map(|&b| Ok::<_, u32>(b)).collect::<Vec<_>>());
        let robust = plan(&boxes);
        assert!(boxes.iter().all(|b| full.encode(b) == robust.encode(b)));
    }

    #[test]
    fn codes_of_the_core_do_not_depend_on_how_far_the_others_are() {
        let codes = |distance: f32| {
            let mut boxes = grid();
            boxes.push(Aabb { lo: [-distance; 3], hi: [-0.999 * distance; 3] });
            boxes.push(Aabb { lo: [0.5; 3], hi: [0.5, 0.5, distance] });
            let plan = plan(&boxes);
            let [far, huge] = [plan.encode(&boxes[1000]), plan.encode(&boxes[1001])];
            assert_eq!(huge >> 63, 1, "what is huge comes last");
            assert!(boxes[..1000].iter().all(|b| plan.encode(b) != far));
            boxes[..1000].iter().map(|b| plan.encode(b)).collect::<Vec<_>>()
        };
        let near = codes(100.0);
        assert!(near.iter().collect::<std::collections::HashSet<_>>().len() == 1000, "every cell has its own code");
        for distance in [1.0e6, 1.0e18, 1.0e37, 3.0e38] {
            assert_eq!(codes(distance), near, "{distance:e}");
        }
    }

    #[test]
    fn what_is_far_leaves_the_order_of_the_core_as_it_is() {
        let mut boxes = grid();
        let alone = plan(&boxes);
        boxes.sort_by_key(|b| alone.encode(b));
        for distance in [1.9, 100.0, 1.0e30] {
            for side in [1.0, -1.0] {
                let lo = [side * distance, 0.5, 0.5];
                let plan = plan(&[&boxes[..], &[Aabb { lo, hi: lo }]].concat());
                let codes: Vec<u64> = boxes.iter().map(|b| plan.encode(b)).collect();
                assert!(codes.windows(2).all(|w| w[0] < w[1]), "{distance:e} to side {side}");
            }
        }
    }

    #[test]
    fn a_sample_is_of_all_but_those_at_the_end_that_are_left_out() {
        let spots = |count: usize, of: usize| {
            let ok = |i: usize| if i < count { Ok(Aabb { lo: [i as f32; 3], hi: [i as f32; 3] }) } else { Err(()) };
            let boxes: Vec<Result<Aabb, ()>> = (0..of).map(ok).collect();
            sample_of(&boxes).iter().map(|b| b.lo[0] as usize).collect::<Vec<_>>()
        };
        assert_eq!(spots(200, 200), (0..200).collect::<Vec<_>>());
        assert_eq!(spots(200, 512), (0..200).collect::<Vec<_>>());
        assert_eq!(spots(512, 512), (0..512).step_by(2).collect::<Vec<_>>());
        // Where they end is known to a step of the first look, of eight here.
        assert_eq!(spots(509, 2048), (0..512).step_by(2).filter(|&i| i < 509).collect::<Vec<_>>());
        assert_eq!(spots(0, 512), []);
    }

    /// Without the gap the fences would be beyond what doubles the bounds: two fifths of all move the quartiles to the core's ends.
    #[test]
    fn many_next_to_the_core_are_as_far_as_those_far_away() {
        for axes in [1, 3] {
            let codes = |times: f32| {
                let beside = (0..600).map(|i| {
                    let to_low = i % 2 == 0;
                    let along = if to_low { 1.0 - times } else { times };
                    let lo = [0, 1, 2].map(|axis| if axis < axes { along } else { 0.5 });
                    Aabb { lo, hi: lo }
                });
                let boxes: Vec<Aabb> = grid().into_iter().chain(beside).collect();
                let plan = plan(&boxes);
                boxes[..1000].iter().map(|b| plan.encode(b)).collect::<Vec<_>>()
            };
            assert_eq!(codes(2.0), codes(1.0e6), "{axes} axes");
        }
    }

    #[test]
    fn a_fence_stands_in_a_gap_that_is_long_enough_and_has_something_behind() {
        let steps = |distances: &[f32]| steps_to_fence(0.25, distances.iter().map(|d| d * 0.25));
        assert_eq!(steps(&[]), STEPS, "nothing beyond the quartile");
        assert_eq!(steps(&[-40.0, 0.0]), STEPS, "nothing behind the gap");
        assert_eq!(steps(&[0.0, 16.9]), STEPS, "a gap of fifteen steps");
        assert_eq!(steps(&[0.0, 17.0]), 1 + GAP / 2);
        assert_eq!(steps(&[0.0, 31.9]), 1 + GAP / 2, "in the middle of its first sixteen steps");
        assert_eq!(steps(&[0.0, 32.0]), STEPS, "behind the fence as it is");
        assert_eq!(steps(&[31.0, 14.5, 2.0]), 15 + GAP / 2, "the first that is long enough");
        assert_eq!(steps_to_fence(1e-38, [0.0, 30e-38].into_iter()), STEPS, "where products may be zero");
    }

    /// And in their order, but behind all of the core.
    #[test]
    fn far_primitives_stand_apart_where_they_are_asked_to() {
        let apart = Code::Emc64Var.full().with_bounds(CodeBounds::Apart).expect("it has no grid");
        for bits in [64, 33, 32, 5] {
            let mut boxes = grid();
            for distance in [-1.0e30, -50.0, 50.0, 1.0e30] {
                boxes.push(Aabb { lo: [distance; 3], hi: [distance; 3] });
            }
            let all: Vec<Result<Aabb, u32>> = boxes.iter().map(|&b| Ok(b)).collect();
            let plan = CodePlan::new(apart.with_bits(bits), &all);
            let codes: Vec<u64> = boxes.iter().map(|b| plan.encode(b) >> (bits - 2)).collect();
            // Not huge, and far or not.
            assert!(codes[..1000].iter().all(|&head| head == 0b00), "{bits}");
            assert!(codes[1000..].iter().all(|&head| head == 0b01), "{bits}");
        }
    }

    /// The grid reaches from 0 to 0.95 and the fences to 1.7; of the core is what lies before them, too.
    #[test]
    fn what_touches_the_core_and_reaches_over_the_fences_is_huge_if_it_is_longer_than_the_core() {
        let at_the_fence = Aabb { lo: [1.5, 0.5, 0.5], hi: [1.69, 0.6, 0.6] };
        for (edge, head) in [(0.1, 0b00), (1.6, 0b00), (1.75, 0b11), (3.0, 0b11), (1.0e30, 0b11)] {
            for along in 0..3 {
                let mut over = Aabb { lo: [1.65, 0.5, 0.5], hi: [1.75, 0.6, 0.6] };
                over.hi[along] = over.lo[along] + edge;
                over.hi[0] = over.hi[0].max(1.75);
                let apart = Code::Emc64Var.full().with_bounds(CodeBounds::Apart).expect("it has no grid");
                let far = Aabb { lo: [50.0; 3], hi: [50.1; 3] };
                let all = [&grid()[..], &[at_the_fence, far, over]].concat();
                let plan = CodePlan::new(apart, &all.iter().map(|&b| Ok::<_, u32>(b)).collect::<Vec<_>>());
                assert_eq!(plan.encode(&far) >> 62, 0b01);
                assert_eq!(plan.encode(&over) >> 62, head, "{edge} along {along}");
            }
        }
    }

    #[test]
    fn a_hundred_far_primitives_are_told_apart() {
        let mut boxes = grid();
        let distances = (1..=100).map(|i| 10.0_f32.powf(1.0 + 0.37 * i as f32));
        boxes.extend(distances.map(|d| Aabb { lo: [d, 0.5, 0.5], hi: [d * 1.001, 0.5, 0.5] }));
        let plan = plan(&boxes);
        let codes: Vec<u64> = boxes[1000..].iter().map(|b| plan.encode(b)).collect();
        assert!(codes.windows(2).all(|w| w[0] < w[1]), "{codes:x?}");
    }
}
