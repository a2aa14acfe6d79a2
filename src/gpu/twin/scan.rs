//! The scan, plainly.

/// The sums of all words before, and the total.
pub fn exclusive(values: &[u32]) -> (Vec<u32>, u32) {
    let mut sum = 0u32;
    let before = |&value: &u32| {
        let before = sum;
        sum = sum.wrapping_add(value);
        before
    };
    let scanned = values.iter().map(before).collect();
    (scanned, sum)
}
