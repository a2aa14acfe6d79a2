//! How a code is put together: which axis each bit is of, and where bits of the size stand between.

use super::Order;
use crate::geometry::Aabb;

/// The axis of each coordinate bit, from the top.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Recipe {
    pub sequence: Vec<usize>,
}

impl Recipe {
    /// `coordinates` and `size` (16 bits) as a code of `bits` bits, with a bit of the size behind each `group` coordinate bits
    /// (0: none).
    pub fn encode(&self, coordinates: [u64; 3], size: u32, group: u32, bits: u32) -> u64 {
        let (mut code, mut taken, mut size_taken) = (0u64, [0u32; 3], 0);
        let mut axes = self.sequence.iter();
        for bit in 1..=bits {
            code <<= 1;
            if group > 0 && bit.is_multiple_of(group + 1) {
                code |= u64::from(size >> (15 - size_taken) & 1);
                size_taken += 1;
            } else {
                let axis = *axes.next().expect("the sequence has every coordinate bit");
                code |= coordinates[axis] >> (63 - taken[axis]) & 1;
                taken[axis] += 1;
            }
        }
        code
    }
}

/// Extents as integers that compare and halve exactly, with no underflow: halving a float is taking one from its exponent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Extents(pub [i32; 3]);

impl Extents {
    pub fn new(extent: [f32; 3]) -> Extents {
        // What is flat stays below what was halved as often as a code has bits, and has as many halvings left itself.
        Extents(extent.map(|e| if e > 0.0 { e.to_bits() as i32 } else { -0x4000_0000 }))
    }

    pub fn of(bounds: &Aabb) -> Extents {
        // Half of each is taken first, which is exact and finite.
        Extents::new(std::array::from_fn(|i| 0.5 * bounds.hi[i] - 0.5 * bounds.lo[i]))
    }

    /// x before y before z where equal.
    fn longest(&self) -> usize {
        (0..3).rev().max_by_key(|&axis| self.0[axis]).expect("three axes")
    }

    /// The axes, longest first.
    pub fn sorted(&self) -> [usize; 3] {
        let mut axes = [0, 1, 2];
        axes.sort_by_key(|&axis| std::cmp::Reverse(self.0[axis]));
        axes
    }

    /// Halves the longest axis.
    pub fn halve(&mut self) -> usize {
        let axis = self.longest();
        // Where every axis is flat it goes round, as on the device: all coordinates are 0 there.
        self.0[axis] = self.0[axis].wrapping_sub(1 << 23);
        axis
    }

    /// The extents of a box of these numbers of cells, cut off to 24 bits.
    pub fn times(&self, cells: [u32; 3]) -> Extents {
        Extents(std::array::from_fn(|axis| {
            let product = (self.0[axis] as u32 & 0x7F_FFFF | 0x80_0000) * cells[axis];
            let more = 8 - product.leading_zeros();
            ((self.0[axis] >> 23) + more as i32) << 23 | (product >> more & 0x7F_FFFF) as i32
        }))
    }

    /// Each relative to the longest, of which it is 128 to 255.
    pub fn relative(&self) -> [u32; 3] {
        let top = self.0[self.longest()] >> 23;
        self.0.map(|e| (e as u32 & 0x7F_FFFF | 0x80_0000) >> (16 + top - (e >> 23)).min(31))
    }

    /// The recipe of `bits` coordinate bits.
    pub fn recipe(mut self, order: Order, bits: u32) -> Recipe {
        let sorted = self.sorted();
        let sequence = (0..bits as usize).map(|bit| match order {
            Order::Regular => bit % 3,
            Order::Sorted => sorted[bit % 3],
            Order::Variable => self.halve(),
        });
        Recipe { sequence: sequence.collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sequence(extent: [f32; 3], order: Order, bits: u32) -> Vec<usize> {
        Extents::new(extent).recipe(order, bits).sequence
    }

    #[test]
    fn a_variable_code_halves_the_longest_axis_first() {
        assert_eq!(sequence([8.0, 1.0, 3.0], Order::Variable, 9), [0, 0, 2, 0, 2, 0, 1, 2, 0]);
        assert_eq!(sequence([1.0, 1.0, 1.0], Order::Variable, 4), [0, 1, 2, 0]);
        assert_eq!(sequence([0.0, 0.0, 2.0], Order::Variable, 3), [2, 2, 2]);
    }

    #[test]
    fn sorted_axes_follow_their_extent() {
        assert_eq!(sequence([1.0, 4.0, 2.0], Order::Sorted, 6), [1, 2, 0, 1, 2, 0]);
    }

    #[test]
    fn extents_multiply_and_compare() {
        let cell = Extents::new([1.0, 0.75, 0.0]);
        assert_eq!(cell.times([6, 4, 1]), Extents::new([6.0, 3.0, 0.0]));
        assert_eq!(cell.relative(), [128, 96, 0]);
    }
}
