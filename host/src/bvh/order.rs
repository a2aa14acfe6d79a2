//! The order of codes: what builders that go bottom-up begin with.
//!
//! Codes are those of `hedgerow::bvh::codes`, equal ones are in the order of the input. So the order is that of the LBVH's twin,
//! whatever the number of threads.

use super::ALONE;
use super::bounds::{Bounds, Item};
use super::input::Input;
use glam::Vec3A;
use hedgerow::bvh::codes::{CodePlan, CodeTables, Codes};
use hedgerow::geometry::Aabb;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

/// Bits that a pass of the radix sort looks at, at most: its counters then stay in the first cache.
const DIGIT_BITS: u32 = 11;

/// Sorts the items of `input` by their codes, and gives the codes.
pub(super) fn sort(input: &mut Input, codes: Codes) -> Vec<u64> {
    input.code_bits = codes.bits;
    let count = input.items.len();
    let unscaled = 1.0 / input.item_scale;
    let plan = plan(input, codes, unscaled);
    let tables = CodeTables::new(&plan);
    let items = &input.items;
    let code_of = |i: usize| tables.encode(&aabb_of(&items[i], unscaled));
    // The index goes below the code where both fit into a word.
    let index_bits = usize::BITS - count.leading_zeros();
    let (sorted, order): (Vec<u64>, Vec<Item>) = if codes.bits + index_bits <= u64::BITS && count >= ALONE {
        let keys = radix_sorted(count, |i| code_of(i) << index_bits | i as u64, [index_bits, index_bits + codes.bits]);
        let of_key = |key: &AtomicU64| {
            let key = key.load(Ordering::Relaxed);
            (key >> index_bits, items[(key & ((1 << index_bits) - 1)) as usize])
        };
        keys.par_iter().with_min_len(ALONE).map(of_key).unzip()
    } else {
        let mut keys: Vec<(u64, u32)> =
            (0..count).into_par_iter().with_min_len(ALONE).map(|i| (code_of(i), i as u32)).collect();
        keys.par_sort_unstable();
        keys.par_iter().with_min_len(ALONE).map(|&(code, i)| (code, items[i as usize])).unzip()
    };
    input.items = order;
    sorted
}

/// The box of an item as it was before lengths were scaled. Only what is nothing beside the scene was lost by that, and codes
/// do not tell it from 0.
fn aabb_of(item: &Item, unscaled: f32) -> Aabb {
    let Bounds { lo, hi } = item.bounds();
    Aabb { lo: (lo * unscaled).to_array(), hi: (hi * unscaled).to_array() }
}

/// The plan of the codes of all boxes.
fn plan(input: &Input, codes: Codes, unscaled: f32) -> CodePlan {
    if input.items.is_empty() {
        return CodePlan::new::<u32>(codes, &[]);
    }
    let centroids = || {
        let of_piece = |items: &[Item]| {
            let point = |item| Bounds::point(Vec3A::from_array(aabb_of(item, unscaled).centroid()));
            items.iter().fold(Bounds::EMPTY, |bounds, item| bounds.union(point(item)))
        };
        let Bounds { lo, hi } = input.items.par_chunks(ALONE).map(of_piece).reduce(|| Bounds::EMPTY, |a, b| a.union(b));
        Aabb { lo: lo.to_array(), hi: hi.to_array() }
    };
    CodePlan::of_bounds(codes, &input.bounds, centroids).unwrap_or_else(|| {
        let mut boxes = vec![Err(()); input.count];
        for item in &input.items {
            boxes[item.primitive() as usize] = Ok(aabb_of(item, unscaled));
        }
        CodePlan::new(codes, &boxes)
    })
}

/// The keys of 0..`count` in the order of their bits from `from` to `to`, equal ones as they were.
///
/// Words that several threads write are atomic ones: the places of a pass are known beforehand, and no two have the same.
fn radix_sorted(count: usize, key_of: impl Fn(usize) -> u64 + Sync, [from, to]: [u32; 2]) -> Vec<AtomicU64> {
    let piece = count.div_ceil(rayon::current_num_threads()).max(ALONE);
    let passes = (to - from).div_ceil(DIGIT_BITS);
    let width = (to - from).div_ceil(passes);
    let mask = (1 << width) - 1;
    let mut keys: Vec<AtomicU64> =
        (0..count).into_par_iter().with_min_len(ALONE).map(|i| AtomicU64::new(key_of(i))).collect();
    let mut spare: Vec<AtomicU64> = Vec::new();
    spare.resize_with(count, AtomicU64::default);
    for shift in (0..passes).map(|pass| from + pass * width) {
        let digit = |key: u64| (key >> shift & mask) as usize;
        let mut counts: Vec<Vec<u32>> = keys
            .par_chunks(piece)
            .map(|keys| {
                let mut counts = vec![0; 1 << width];
                keys.iter().for_each(|key| counts[digit(key.load(Ordering::Relaxed))] += 1);
                counts
            })
            .collect();
        let mut place = 0;
        for digit in 0..1 << width {
            for counts in &mut counts {
                place += std::mem::replace(&mut counts[digit], place);
            }
        }
        keys.par_chunks(piece).zip(counts).for_each(|(keys, mut places)| {
            for key in keys {
                let key = key.load(Ordering::Relaxed);
                let place = &mut places[digit(key)];
                spare[*place as usize].store(key, Ordering::Relaxed);
                *place += 1;
            }
        });
        std::mem::swap(&mut keys, &mut spare);
    }
    keys
}

/// Of a subtree of the radix tree over `first..first + count`, how many are on its left: those without the highest bit in which
/// their codes differ. Equal codes are told apart by their places.
#[inline]
pub(super) fn left_count(codes: &[u64], first: usize, count: usize) -> usize {
    let last = first + count - 1;
    let differing = codes[first] ^ codes[last];
    if differing == 0 {
        return (last >> (first ^ last).ilog2() << (first ^ last).ilog2()) - first;
    }
    // All of these agree in the bits above, so that the first with the bit is the first that is not below this.
    let bit = differing.ilog2();
    let least = codes[last] >> bit << bit;
    codes[first..=last].partition_point(|&code| code < least)
}

#[cfg(test)]
mod tests {
    use super::*;
    use hedgerow::bvh::codes::{Code, CodeBounds};

    fn boxes(count: u32) -> Vec<Result<Aabb, u32>> {
        let at = |i: u32, step: u32| (i.wrapping_mul(step) >> 8) as f32 / (1 << 24) as f32;
        let of = |i: u32| {
            if i % 97 == 5 {
                return Err(1);
            }
            // Every eleventh is where another is.
            let i = if i.is_multiple_of(11) { i / 2 } else { i };
            let lo = [at(i, 2_654_435_761) * 30.0 - 7.0, at(i, 805_459_861) * 2.0, at(i, 3_674_653_429) * 1e-3];
            Ok(Aabb { lo, hi: lo.map(|x| x + at(i, 97_654_321)) })
        };
        (0..count).map(of).collect()
    }

    #[test]
    fn items_are_in_the_order_of_their_codes_and_then_of_the_input() {
        for (count, bits) in [(0, 30), (1, 30), (2, 30), (3000, 40), (20_000, 12), (20_000, 32), (20_000, 64)] {
            let boxes = boxes(count);
            for (code, bounds) in [(Code::Emc64Var, CodeBounds::Full), (Code::Mip9, CodeBounds::Concise)]
                .into_iter()
                .chain([(Code::Mc63, CodeBounds::Robust), (Code::Emc64Sort, CodeBounds::Centroid)])
            {
                let codes = code.full().with_bounds(bounds).expect("known").with_bits(bits);
                let plan = CodePlan::new(codes, &boxes);
                let mut expected: Vec<(u64, u32)> =
                    (0..count).filter_map(|i| boxes[i as usize].ok().map(|b| (plan.encode(&b), i))).collect();
                expected.sort_unstable();
                for threads in [1, 3] {
                    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
                    let mut input = Input::new(count as usize, |i| boxes[i as usize].map(|b| Bounds::of(&b)));
                    let sorted = pool.install(|| sort(&mut input, codes));
                    let found: Vec<(u64, u32)> =
                        sorted.into_iter().zip(input.items.iter().map(Item::primitive)).collect();
                    assert!(found == expected, "{codes}, {count} boxes, {threads} threads");
                    assert_eq!(input.code_bits, codes.bits);
                }
            }
        }
    }

    #[test]
    fn the_radix_tree_splits_at_the_highest_differing_bit() {
        let codes = [0b0001, 0b0010, 0b0011, 0b1000, 0b1100, 0b1100, 0b1100];
        assert_eq!(left_count(&codes, 0, 7), 3);
        assert_eq!(left_count(&codes, 0, 3), 1);
        assert_eq!(left_count(&codes, 3, 4), 1);
        // 4, 5 and 6 are equal: 5 and 6 differ from 4 in no bit above that of 2.
        assert_eq!(left_count(&codes, 4, 3), 2);
        assert_eq!(left_count(&codes, 1, 2), 1);
    }
}
