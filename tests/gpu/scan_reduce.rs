//! The device's scan and reduction equal their twins.

use crate::common::{corpus::unit_floats, device};
use hedgerow::gpu::fill;
use hedgerow::gpu::reduce::{Bounds, Reduction};
use hedgerow::gpu::scan::{Scan, ScanBuffers};
use proptest::prelude::*;

const SIZES: [usize; 20] =
    [0, 1, 2, 3, 7, 8, 9, 31, 32, 33, 255, 256, 257, 511, 513, 2047, 2048, 2049, 70_001, 1_000_003];

fn scan_equals_its_twin(values: &[u32]) {
    let device = device();
    let scan = Scan::new(device, values.len() as u32);
    let from = device.upload("values", values).unwrap();
    let to = device.buffer("results", 4 * values.len() as u64).unwrap();
    let sums = device.buffer("sums", 4 * u64::from(scan.sums_words())).unwrap();
    for results in [&to, &from] {
        let buffers = ScanBuffers { values: from.address(), results: results.address(), sums: sums.address() };
        device.run(None, |r| scan.record(r, &buffers)).unwrap();
        let total = sums.read_at::<u32>(4 * u64::from(scan.sums_words() - 1), 1)[0];
        let got = (results.read::<u32>(values.len()), total);
        assert!(got == hedgerow::gpu::twin::scan::exclusive(values), "{} words", values.len());
    }
}

fn reduction_equals_its_twin(boxes: &[Bounds]) {
    let device = device();
    let reduction = Reduction::new(device, boxes.len() as u32);
    let from = device.upload("boxes", boxes).unwrap();
    let to = device.buffer("result", 24).unwrap();
    let scratch = device.buffer("scratch", 24 * u64::from(reduction.scratch_boxes())).unwrap();
    device.run(None, |r| reduction.record(r, from.address(), to.address(), scratch.address())).unwrap();
    assert_eq!(to.read::<Bounds>(1)[0], hedgerow::gpu::twin::reduce::bounds(boxes), "{} boxes", boxes.len());
}

#[test]
fn scans_of_all_sizes_equal_their_twin() {
    let values: Vec<u32> = (0..1_000_003u32).map(|i| i.wrapping_mul(2_654_435_761) >> 20).collect();
    SIZES.iter().for_each(|&size| scan_equals_its_twin(&values[..size]));
}

#[test]
fn reductions_of_all_sizes_equal_their_twin() {
    let mut next = unit_floats(1);
    let boxes: Vec<Bounds> = (0..1_000_003).map(|_| [[next(); 3], [next() + 1.0, next(), 2.0 * next()]]).collect();
    SIZES.iter().for_each(|&size| reduction_equals_its_twin(&boxes[..size]));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn any_words_scan(values in prop::collection::vec(any::<u32>(), 0..3000)) {
        scan_equals_its_twin(&values);
    }
}

/// Of a device that takes few workgroups along x, rows of them and what is left behind.
#[test]
fn a_dispatch_may_have_more_workgroups_than_the_device_takes_along_x() {
    let device = device();
    let row = device.limits.workgroup_count;
    if row > 1 << 16 {
        return eprintln!("{} takes {row} workgroups along x: no dispatch of ours has more", device.limits.name);
    }
    // Two rows and three workgroups of 1,024 words, the last not full.
    let count = 1024 * (2 * row + 3) - 5;
    let words = device.buffer("words", 4 * u64::from(count + 1)).unwrap();
    words.write(&[0u32; 1]);
    device
        .run(None, |recorder| {
            fill::record(recorder, words.address() + 4 * u64::from(count), 1, 3)?;
            fill::record(recorder, words.address(), count, 7)
        })
        .unwrap();
    let got = words.read::<u32>(count as usize + 1);
    assert_eq!(got.iter().position(|&word| word != 7), Some(count as usize), "the fill ends where it shall");
    assert_eq!(got[count as usize], 3, "nothing behind it is written");
}
