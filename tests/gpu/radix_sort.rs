//! The device's radix sort equals its twin.

use crate::common::device;
use hedgerow::gpu::Limits;
use hedgerow::gpu::radix_sort::{self, Sort, SortBuffers, SortShape};
use proptest::prelude::*;

fn sorted_on_device(shape: &SortShape, keys: &[u64], values: &[u32], bits: u32) -> (Vec<u64>, Vec<u32>) {
    let device = device();
    let count = keys.len() as u32;
    let wide = bits > 32;
    let narrow: Vec<u32> = keys.iter().map(|&k| k as u32).collect();
    let first = if wide { device.upload("keys", keys) } else { device.upload("keys", &narrow) }.unwrap();
    let second = device.buffer("keys", 8 * u64::from(count)).unwrap();
    let values = [device.upload("values", values).unwrap(), device.buffer("values", 4 * u64::from(count)).unwrap()];
    let table = device.buffer("table", 4 * shape.table_words(count)).unwrap();
    let buffers = SortBuffers {
        keys: [first.address(), second.address()],
        values: [values[0].address(), values[1].address()],
        table: table.address(),
    };
    let mut result = 0;
    device
        .run(None, |recorder| {
            result = radix_sort::record(recorder, shape, &buffers, &Sort { count, bits, identity: false })?;
            Ok(())
        })
        .unwrap();
    let keys = [&first, &second][result];
    let keys = if wide {
        keys.read::<u64>(count as usize)
    } else {
        keys.read::<u32>(count as usize).into_iter().map(u64::from).collect()
    };
    (keys, values[result].read(count as usize))
}

/// All cuts: strips of CPUs with few and many cores, tiles of GPUs, those of a small GPU, and strips where nobody knows how large
/// subgroups are.
fn shapes() -> Vec<SortShape> {
    let limits = &device().limits;
    let few_cores = Limits { cores: Some(1), ..limits.clone() };
    let many_cores = Limits { cores: None, ..limits.clone() };
    let strips = [SortShape::strips(&few_cores), SortShape::strips(&many_cores), SortShape::many_strips(limits)];
    if !limits.subgroup_is_exact {
        return strips.into();
    }
    let small = Limits { shared_memory: 16 << 10, workgroup_invocations: 128, ..limits.clone() };
    let tiles = SortShape::tiles(limits);
    [&strips[..], &[tiles, tiles.with_digit_bits(5), SortShape::tiles(&small)]].concat()
}

fn equals_its_twin(keys: &[u64], bits: u32) {
    let mask = if bits == 64 { u64::MAX } else { (1 << bits) - 1 };
    let keys: Vec<u64> = keys.iter().map(|k| k & mask).collect();
    let values: Vec<u32> = (0..keys.len() as u32).rev().collect();
    for shape in shapes() {
        let got = sorted_on_device(&shape, &keys, &values, bits);
        assert!(
            got == hedgerow::gpu::twin::radix_sort::sort(&keys, &values, bits),
            "{} keys of {bits} bits, {shape:?}",
            keys.len()
        );
    }
}

/// A small generator of our own: tests must not change when a crate does.
fn pseudo_random(count: usize) -> Vec<u64> {
    let mut state = 0x9E37_79B9_7F4A_7C15u64;
    std::iter::repeat_with(|| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state
    })
    .take(count)
    .collect()
}

#[test]
fn sizes_around_powers_of_two_and_workgroups_sort_stably() {
    let keys = pseudo_random(40_000);
    for count in [0, 1, 2, 3, 7, 8, 9, 63, 64, 65, 255, 256, 257, 1023, 1024, 1025, 2047, 2049, 8191, 8193, 40_000] {
        equals_its_twin(&keys[..count], 30);
    }
}

#[test]
fn only_the_passes_that_the_bits_need_are_done() {
    let keys = pseudo_random(3000);
    for bits in [1, 7, 8, 9, 16, 24, 30, 31, 32, 33, 40, 63, 64] {
        equals_its_twin(&keys, bits);
    }
    let shape = shapes()[0];
    assert_eq!([1, 8, 9, 30, 63, 64].map(|bits| shape.passes(bits)), [1, 1, 2, 4, 8, 8]);
}

#[test]
fn equal_sorted_and_reversed_keys_sort() {
    equals_its_twin(&[7; 5000], 32);
    equals_its_twin(&(0..5000).collect::<Vec<_>>(), 32);
    equals_its_twin(&(0..5000).rev().collect::<Vec<_>>(), 64);
    equals_its_twin(&(0..5000).map(|i| if i % 2 == 0 { u64::MAX } else { 0 }).collect::<Vec<_>>(), 64);
}

#[test]
fn two_million_keys_sort() {
    equals_its_twin(&pseudo_random(2_000_003), 32);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn any_keys_sort(keys in prop::collection::vec(any::<u64>(), 0..3000), bits in 1u32..=64) {
        equals_its_twin(&keys, bits);
    }
}
