//! What the bits between those of the coordinates say of a primitive's size, as a word of 16 bits, the first of them on top.
//!
//! The *diagonal* of its box over that of the scene as a fraction (Vinkler, Bittner, Havran 2017). Or its *extents*:
//! what Riemersma 2024, section 5, leaves to the future, "the distance a primitive extends into a direction (and might leave its
//! cell) instead of a fixed one-dimensional value". A bit is set if along some axis the box is at least [`BEYOND`] times as long
//! as the cell is that the coordinate bits before it name. Once set, all later ones are, so that the word is a number: how far
//! down the tree the primitive goes before it is too large for its cell.

use super::recipe::Recipe;
use crate::geometry::Aabb;

/// How many times as long as its cell a primitive is from which on it is large. Over seven scenes, interiors
/// most of them, the cost of trees was 0.963, 0.953 and 0.961 of that by diagonals every seventh bit for 1, 3/2 and 2.
const BEYOND: f32 = 1.5;
/// Bits of the word.
const BITS: u32 = 16;

/// How the sizes of a scene become words.
#[derive(Debug, Clone)]
pub(super) struct Size {
    /// The power of two for lengths along any axis.
    prescale: f32,
    measure: Measure,
}

#[derive(Debug, Clone)]
enum Measure {
    Diagonal {
        /// 1 / diagonal².
        reciprocal: f32,
    },
    Extents {
        /// Along each axis the length from which on a primitive is too large for all of the bounds, as a float's bits: halving it is
        /// taking one from its exponent. 0 of a flat axis, which says nothing.
        least: [i32; 3],
        /// Along each axis, by how often it was halved, the first bit behind that.
        first: [Vec<u32>; 3],
    },
}

/// The power of two that brings `magnitude` into [1/4, 1/2): exact to multiply by, and a difference of two such stays below 1.
fn prescale_of(magnitude: f32) -> f32 {
    let exponent = (magnitude.to_bits() >> 23) as i32 & 0xFF;
    // Denormals and zero take the largest scale; 2^(127 − e − 2) as a float, kept normal.
    f32::from_bits(((127 + 127 - 2 - exponent).clamp(1, 254) as u32) << 23)
}

/// 1 / x for x > 0; 0 for anything else, so that a flat axis gives coordinate 0.
fn reciprocal_or_zero(x: f32) -> f32 {
    if x >= f32::MIN_POSITIVE { 1.0 / x } else { 0.0 }
}

/// Along each axis, by how often the coordinate bits halve it, which bit of the size is the first behind that, with `group` of them
/// before each.
fn first_bits(recipe: &Recipe, group: u32) -> [Vec<u32>; 3] {
    let mut first = [vec![0], vec![0], vec![0]];
    for (bit, &axis) in recipe.sequence.iter().enumerate() {
        first[axis].push(bit as u32 / group);
    }
    first
}

impl Size {
    /// Of scenes with these bounds: diagonals.
    pub fn by_diagonal(bounds: &Aabb) -> Size {
        let size = Size { prescale: prescale_in(bounds), measure: Measure::Diagonal { reciprocal: 0.0 } };
        let extent = size.extent(bounds);
        let diagonal2 = extent[0] * extent[0] + extent[1] * extent[1] + extent[2] * extent[2];
        Size { measure: Measure::Diagonal { reciprocal: reciprocal_or_zero(diagonal2) }, ..size }
    }

    /// The same by extents, where a bit stands behind each `group` bits of the recipe.
    pub fn by_extents(bounds: &Aabb, recipe: &Recipe, group: u32) -> Size {
        let size = Size::by_diagonal(bounds);
        let least = size.extent(bounds).map(|e| (BEYOND * e).to_bits() as i32);
        let least = least.map(|bits| if bits < MIN_NORMAL { 0 } else { bits });
        Size { measure: Measure::Extents { least, first: first_bits(recipe, group) }, ..size }
    }

    fn extent(&self, b: &Aabb) -> [f32; 3] {
        std::array::from_fn(|i| b.hi[i] * self.prescale - b.lo[i] * self.prescale)
    }

    /// The word of a primitive.
    #[inline]
    pub fn of(&self, primitive: &Aabb) -> u32 {
        let extent = self.extent(primitive);
        match &self.measure {
            Measure::Diagonal { reciprocal } => {
                let squared = (extent[0] * extent[0] + extent[1] * extent[1] + extent[2] * extent[2]) * reciprocal;
                // The square root is taken of the fraction as an integer: the same on every device.
                let fixed = if squared >= 1.0 { u32::MAX } else { (squared * 4_294_967_296.0) as u32 };
                // Of 32 bits the root in double precision, cut off, is the integer's.
                f64::from(fixed).sqrt() as u32
            }
            Measure::Extents { least, first } => {
                let first_of = |axis: usize| {
                    let bits = extent[axis].to_bits() as i32;
                    if bits < MIN_NORMAL || least[axis] == 0 {
                        return BITS;
                    }
                    // How often the bounds must be halved until the primitive is too large.
                    let halvings = ((least[axis] - bits + 0x7F_FFFF) >> 23).max(0) as usize;
                    first[axis].get(halvings).copied().unwrap_or(BITS)
                };
                let first = (0..3).map(first_of).fold(BITS, u32::min);
                0xFFFF >> first
            }
        }
    }
}

/// The bits of the least float that is not denormal.
const MIN_NORMAL: i32 = 1 << 23;

fn prescale_in(bounds: &Aabb) -> f32 {
    let magnitude: [f32; 3] = std::array::from_fn(|i| bounds.lo[i].abs().max(bounds.hi[i].abs()));
    prescale_of(magnitude.into_iter().fold(0.0, f32::max))
}

#[cfg(test)]
mod tests {
    use super::super::Order;
    use super::super::recipe::Extents;
    use super::*;

    /// By extents within a scene of these extents, from the origin, with a bit behind each third of 48.
    fn by_extents(scene: [f32; 3]) -> Size {
        let bounds = Aabb { lo: [0.0; 3], hi: scene };
        Size::by_extents(&bounds, &Extents::of(&bounds).recipe(Order::Variable, 48), 3)
    }

    fn word(size: &Size, extent: [f32; 3]) -> u32 {
        size.of(&Aabb { lo: [0.0; 3], hi: extent })
    }

    #[test]
    fn the_diagonal_is_a_fraction_of_the_scenes() {
        let size = Size::by_diagonal(&Aabb { lo: [0.0; 3], hi: [2.0; 3] });
        assert_eq!([[2.0; 3], [1.0; 3], [0.5; 3], [0.0; 3]].map(|e| word(&size, e)), [0xFFFF, 0x8000, 0x4000, 0]);
    }

    #[test]
    fn a_bit_tells_that_a_primitive_is_too_long_for_its_cell_along_some_axis() {
        // A cube: every bit's cell has half the length of the one before, in all axes.
        let size = by_extents([1.0; 3]);
        for axis in 0..3 {
            let long = |length| {
                let mut extent = [0.0; 3];
                extent[axis] = length;
                word(&size, extent)
            };
            // 3/2 of the first cell's length is 3/4, of the next's 3/8.
            assert_eq!(
                [1.0, 0.75, 0.7, 0.375, 0.37].map(long),
                [0xFFFF, 0xFFFF, 0x7FFF, 0x7FFF, 0x3FFF],
                "axis {axis}"
            );
            assert_eq!([1.5 * 2.0_f32.powi(-16), 1.4 * 2.0_f32.powi(-16), 0.0].map(long), [1, 0, 0], "axis {axis}");
        }
        assert_eq!(word(&size, [0.01, 0.4, 0.001]), 0x7FFF, "the longest decides");
    }

    #[test]
    fn what_leaves_its_cell_is_told_by_the_axis_and_not_by_the_length() {
        // All three bits before the first of the size halve x: an eighth of 8, beside all of 1.
        let size = by_extents([8.0, 1.0, 1.0]);
        assert_eq!(word(&size, [1.5, 0.0, 0.0]), 0xFFFF);
        assert_eq!(word(&size, [0.0, 1.0, 0.0]), 0x7FFF, "as long as its cell, and not half as long again");
        assert_eq!(word(&size, [1.0, 0.0, 0.0]), 0x7FFF);
    }

    #[test]
    fn a_flat_axis_of_the_bounds_says_nothing() {
        let size = by_extents([1.0, 1.0, 0.0]);
        assert_eq!(word(&size, [0.0, 0.0, 1.0]), 0);
        assert_eq!(word(&by_extents([0.0; 3]), [1.0; 3]), 0);
        let huge = by_extents([3.0e38; 3]);
        assert_eq!(word(&huge, [3.0e38, 0.0, 0.0]), 0xFFFF);
    }
}
