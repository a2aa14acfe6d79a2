//! How many clusters a node leaves for its parent: f(x) = δ^(1/2 + ε) / 2 · x^(1/2 − ε), rounded down, at least 1.
//!
//! In integers: with e tenths for ε, k ≤ f(x) if (2k)^10 ≤ δ^(5 + e) · x^(5 − e). That f(δ) is δ/2 to the last bit, which powers
//! of floats miss on one machine and hit on another.

use super::AacOptions;

/// Nodes of fewer primitives than this are looked up.
const KNOWN: usize = 1024;
/// Words of a product of ten factors of 33 bits.
const WORDS: usize = 6;

pub(super) struct LeftOver {
    options: AacOptions,
    /// Of nodes of so many primitives.
    known: Vec<u32>,
}

impl LeftOver {
    /// For nodes of up to `most` primitives, and of δ.
    pub fn new(options: &AacOptions, most: usize) -> LeftOver {
        let mut left_over = LeftOver { options: *options, known: Vec::new() };
        let mut count = 1;
        left_over.known = (0..KNOWN.min(most.max(options.delta as usize) + 1) as u64)
            .map(|primitives| {
                while left_over.leaves(primitives, count + 1) {
                    count += 1;
                }
                count as u32
            })
            .collect();
        left_over
    }

    /// f of a number of primitives.
    #[inline]
    pub fn of(&self, primitives: usize) -> usize {
        match self.known.get(primitives) {
            Some(&count) => count as usize,
            None => self.found(primitives as u64) as usize,
        }
    }

    fn found(&self, primitives: u64) -> u64 {
        // It leaves `least`, and not `most`: no node leaves all that it has.
        let (mut least, mut most) = (1, primitives.max(2));
        while most - least > 1 {
            let middle = least.midpoint(most);
            *if self.leaves(primitives, middle) { &mut least } else { &mut most } = middle;
        }
        least
    }

    /// Whether `count` clusters are no more than f of so many primitives.
    fn leaves(&self, primitives: u64, count: u64) -> bool {
        let AacOptions { delta, epsilon } = self.options;
        let of_delta = std::iter::repeat_n(u64::from(delta), 5 + epsilon as usize);
        let of_primitives = std::iter::repeat_n(primitives, 5 - epsilon as usize);
        product(std::iter::repeat_n(2 * count, 10)) <= product(of_delta.chain(of_primitives))
    }
}

/// The product of at most ten factors of 33 bits, its highest word first.
fn product(factors: impl Iterator<Item = u64>) -> [u64; WORDS] {
    let mut words = [0; WORDS];
    words[WORDS - 1] = 1;
    for factor in factors {
        let mut carry = 0;
        for word in words.iter_mut().rev() {
            let next = u128::from(*word) * u128::from(factor) + carry;
            *word = next as u64;
            carry = next >> 64;
        }
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_are_left_and_exactly_half_of_delta() {
        let high = LeftOver::new(&AacOptions::HIGH_QUALITY, 1_443_517);
        let fast = LeftOver::new(&AacOptions::FAST, 1_443_517);
        assert_eq!(
            [1, 20, 40, 100, 1000, 66_450, 871_414, 1_443_517].map(|x| high.of(x)),
            [3, 10, 13, 19, 47, 256, 717, 877]
        );
        assert_eq!(
            [1, 4, 8, 40, 100, 1000, 66_450, 871_414, 1_443_517].map(|x| fast.of(x)),
            [1, 2, 2, 3, 5, 10, 36, 79, 92]
        );
        for delta in [2, 6, 64, 1000] {
            for epsilon in 0..=AacOptions::MAX_EPSILON {
                let left_over = LeftOver::new(&AacOptions { delta, epsilon }, 10);
                assert_eq!(left_over.of(delta as usize), delta as usize / 2);
            }
        }
    }

    #[test]
    fn what_is_looked_up_is_what_is_found() {
        for options in [AacOptions::HIGH_QUALITY, AacOptions::FAST, AacOptions { delta: 1000, epsilon: 0 }] {
            let left_over = LeftOver::new(&options, 1 << 20);
            assert!((options.delta as usize..KNOWN).all(|x| left_over.of(x) as u64 == left_over.found(x as u64)));
            assert!(left_over.of(KNOWN) >= left_over.of(KNOWN - 1));
            assert!(left_over.of(u32::MAX as usize) >= left_over.of(1 << 31));
        }
    }
}
