//! The sort, plainly.

/// Keys and their values, stable by the low `bits` bits of the keys.
pub fn sort(keys: &[u64], values: &[u32], bits: u32) -> (Vec<u64>, Vec<u32>) {
    let mask = if bits == 64 { u64::MAX } else { (1 << bits) - 1 };
    let mut pairs: Vec<_> = keys.iter().copied().zip(values.iter().copied()).collect();
    pairs.sort_by_key(|&(key, _)| key & mask);
    pairs.into_iter().unzip()
}
