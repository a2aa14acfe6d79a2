//! How much better than the LBVH other methods are on a sample of a scene's boxes, and how much its codes leave open there: statistics
//! of the boxes that take milliseconds, however large the scene.
//!
//! What the methods gain differs more between scenes than between a scene and a sample of it: it comes from how boxes of all
//! sizes lie among each other. Over eighteen generated and eleven real scenes, the gain of PLOC in rays correlates by 0.84 with
//! that of its cost on the sample, and by 0.77 at most with any other figure of [`super::features`].

use crate::bvh::codes::{Codes, Plan};
use crate::bvh::host::{lbvh, ploc};
use crate::bvh::layout::{Aabb, BoxRecord, Bvh2};
use crate::bvh::sah::Collapse;
use crate::bvh::{quality, reinsertion};
use crate::scene::SplitMix64;

/// Boxes of a sample, at most.
const SIZE: usize = 4096;
/// Neighbours on either side that PLOC looks at.
const RADIUS: usize = 16;

/// What a sample says. Costs are over that of the LBVH by the codes of so many primitives, as logarithms to base 2: gains are
/// negative.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Gains {
    /// Levels of the tree that these codes leave open: the logarithm of how many of the scene have the same code as a primitive, in
    /// the mean.
    pub open_levels: f64,
    /// Of PLOC.
    pub clustering: f64,
    /// Of the LBVH after a pass of reinsertion.
    pub reinsertion: f64,
    /// Of the LBVH by codes that far and huge primitives cost nothing.
    pub robust: f64,
}

impl Gains {
    /// The gains on a sample of `boxes`, the same every time. Not a number where boxes have no area.
    pub fn of(boxes: &[Aabb]) -> Gains {
        let sample = sample(boxes);
        let robust = "emc64var+robust".parse().expect("a unit test parses it");
        let codes = Codes::for_count(boxes.len() as u32);
        let lbvh = lbvh::build_aabbs(&sample, codes, Collapse::OFF);
        let own = cost(&lbvh);
        let gain = |tree: &Bvh2<BoxRecord>| (cost(tree) / own).log2();
        Gains {
            open_levels: open_levels(&sample, codes, boxes.len()),
            clustering: gain(&ploc::build(&lbvh, RADIUS)),
            reinsertion: gain(&lbvh.reinserted(&reinsertion::Options::FAST)),
            robust: gain(&lbvh::build_aabbs(&sample, robust, Collapse::OFF)),
        }
    }
}

/// The sum of the areas of inner nodes over that of the root.
fn cost(tree: &Bvh2<BoxRecord>) -> f64 {
    quality::on_host(tree, 1.0, 0.0).sah
}

/// Of a code that some of the sample share, as many times more of the scene have it as the scene is larger. One that nobody else of
/// the sample has is taken to be alone.
fn open_levels(sample: &[Aabb], codes: Codes, count: usize) -> f64 {
    let is_finite = |b: &Aabb| b.lo.iter().chain(&b.hi).all(|x| x.is_finite());
    let boxes: Vec<Result<Aabb, ()>> = sample.iter().map(|b| is_finite(b).then_some(*b).ok_or(())).collect();
    let plan = Plan::new(codes, &boxes);
    let mut found: Vec<u64> = boxes.iter().flatten().map(|b| plan.encode(b)).collect();
    found.sort_unstable();
    let scale = count as f64 / sample.len() as f64;
    let shared = found.chunk_by(|a, b| a == b).map(<[u64]>::len).filter(|&of| of > 1);
    shared.map(|of| of as f64 * (of as f64 * scale).log2()).sum::<f64>() / found.len() as f64
}

/// Boxes drawn without putting back, in their order, and those that reach the scene's bounds: these are few, and codes depend on
/// them. All where there are few.
fn sample(boxes: &[Aabb]) -> Vec<Aabb> {
    let mut random = SplitMix64::new(boxes.len() as u64);
    // Of each stretch of the list one: neighbours in a file are neighbours in space more often than not.
    let size = boxes.len().min(SIZE);
    let place = |i: usize| i * boxes.len() / size;
    let mut drawn: Vec<usize> =
        (0..size).map(|i| place(i) + (random.bits() % (place(i + 1) - place(i)) as u64) as usize).collect();
    for axis in 0..3 {
        let by = |key: fn(&Aabb, usize) -> f32| {
            move |a: &usize, b: &usize| key(&boxes[*a], axis).total_cmp(&key(&boxes[*b], axis))
        };
        drawn.extend((0..boxes.len()).min_by(by(|b, axis| b.lo[axis])));
        drawn.extend((0..boxes.len()).max_by(by(|b, axis| b.hi[axis])));
    }
    drawn.sort_unstable();
    drawn.dedup();
    drawn.into_iter().map(|i| boxes[i]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn boxes(count: usize, size: impl Fn(usize) -> f32) -> Vec<Aabb> {
        let mut random = SplitMix64::new(7);
        let mut at = || (random.bits() >> 40) as f32 / (1u32 << 24) as f32;
        (0..count)
            .map(|i| {
                let lo = [at(), at(), at()];
                Aabb { lo, hi: lo.map(|x| x + size(i)) }
            })
            .collect()
    }

    #[test]
    fn a_sample_is_some_of_the_boxes_each_once_and_reaches_their_bounds() {
        let all = boxes(3 * SIZE + 5, |_| 0.01);
        let drawn = sample(&all);
        assert!((SIZE..=SIZE + 6).contains(&drawn.len()), "{}", drawn.len());
        let mut places: Vec<_> = drawn.iter().map(|b| all.iter().position(|a| a == b).expect("one of them")).collect();
        places.dedup();
        assert_eq!(places.len(), drawn.len());
        let bounds = |boxes: &[Aabb]| boxes.iter().fold(Aabb::EMPTY, |a, b| a.union(b));
        assert_eq!(bounds(&drawn), bounds(&all));
        assert_eq!(sample(&all[..10]), all[..10]);
        assert!(sample(&[]).is_empty());
    }

    #[test]
    fn levels_are_open_where_codes_are_too_short() {
        let near = boxes(10_000, |_| 0.001);
        let one = Aabb { lo: [1e9; 3], hi: [1.1e9; 3] };
        let far: Vec<Aabb> = near.iter().copied().chain([one]).collect();
        // All but the far one have one code: as many levels as they would fill, but for what is not of the sample.
        let all = (near.len() as f64).log2();
        let open = Gains::of(&far).open_levels;
        assert!((open - all).abs() < 0.01, "{open} {all}");
        assert!(Gains::of(&near).open_levels < 0.1, "{:?}", Gains::of(&near));
    }

    #[test]
    fn a_few_large_boxes_among_small_ones_are_what_others_gain_by() {
        let same = Gains::of(&boxes(2000, |_| 0.01));
        let mixed = Gains::of(&boxes(2000, |i| if i % 20 == 0 { 0.4 } else { 0.001 }));
        assert!(mixed.clustering < same.clustering - 0.1, "{mixed:?} {same:?}");
        assert!(mixed.reinsertion < same.reinsertion - 0.1, "{mixed:?} {same:?}");
        assert!(same.reinsertion <= 0.0 && mixed.reinsertion <= 0.0, "{mixed:?} {same:?}");
    }

    #[test]
    fn equal_trees_gain_nothing() {
        let two = boxes(2, |_| 0.5);
        assert_eq!(Gains::of(&two), Gains { open_levels: 0.0, clustering: 0.0, reinsertion: 0.0, robust: 0.0 });
        assert!(!Gains::of(&[]).clustering.is_finite());
    }
}
