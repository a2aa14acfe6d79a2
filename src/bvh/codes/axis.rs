//! Coordinates as 64-bit fractions of an extent, in integers throughout: nothing is lost in the subtraction from a far corner, and
//! what lies in the middle of the scene lies in the middle of the code.

/// One axis of the bounds.
#[derive(Debug, Clone)]
pub(super) struct Axis {
    /// Biased exponent of the larger of |lo| and |hi|: the unit is 2⁻⁶² of what it bounds.
    exponent: i32,
    /// Brings the extent's leading bit to the top.
    shift: u32,
    /// The low corner.
    lo: i64,
    /// The same as it was given.
    corner: f32,
    /// (2⁶⁴ / extent − 1) · 2⁶³, rounded up, for the shifted extent; 0 for a flat axis.
    inverse: u64,
}

impl Axis {
    pub fn new(lo: f32, hi: f32) -> Axis {
        let exponent = biased_exponent(lo).max(biased_exponent(hi));
        let low = fixed_point(lo, exponent);
        // Rounded up: what the units cut off must not put the far corner behind the extent.
        let wide = wide_fixed_point(hi, exponent) - wide_fixed_point(lo, exponent);
        let extent = ((wide + 0xFFFF_FFFF) >> 32) as u64;
        if extent == 0 {
            return Axis { exponent, shift: 0, lo: low, corner: lo, inverse: 0 };
        }
        let shift = extent.leading_zeros();
        let extent = u128::from(extent << shift);
        let inverse = (((1 << 64) - extent) << 63).div_ceil(extent) as u64;
        Axis { exponent, shift, lo: low, corner: lo, inverse }
    }

    /// Where `v` lies between the corners, as a 64-bit fraction; what is outside lies in the corner.
    pub fn fraction(&self, v: f32) -> u64 {
        let distance = (fixed_point(v, self.exponent) - self.lo).max(0) as u64;
        if distance.leading_zeros() < self.shift {
            return u64::MAX;
        }
        let distance = distance << self.shift;
        let more = (u128::from(distance) * u128::from(self.inverse)) >> 63;
        distance.saturating_add(u64::try_from(more).unwrap_or(u64::MAX))
    }

    /// The same with 96 bits: enough to leave 64 bits within a grid's cell.
    pub fn wide_fraction(&self, v: f32) -> u128 {
        let wide = |v: f32| wide_fixed_point(v, self.exponent);
        let distance = (wide(v) - wide(self.corner)).max(0) as u128;
        if distance >> (96 - self.shift) != 0 {
            return WIDE_MAX;
        }
        let distance = distance << self.shift;
        // The product's lowest word is left out: it cannot carry.
        let inverse = u128::from(self.inverse);
        let more = (distance >> 32) * inverse + (((distance & 0xFFFF_FFFF) * inverse) >> 32);
        (distance + (more >> 31)).min(WIDE_MAX)
    }
}

/// The largest fraction of 96 bits.
const WIDE_MAX: u128 = (1 << 96) - 1;

fn biased_exponent(v: f32) -> i32 {
    (v.to_bits() >> 23) as i32 & 0xFF
}

/// A float in units of 2⁻⁶² of what the exponent bounds; what is smaller than a unit is cut off, what is larger than the bound is
/// the bound.
fn fixed_point(v: f32, exponent: i32) -> i64 {
    let own = biased_exponent(v);
    let mantissa = if own == 0 { 0 } else { i64::from(v.to_bits() & 0x7F_FFFF | 0x80_0000) };
    let shift = own - exponent + 38;
    let magnitude = match shift {
        39.. => (1 << 62) - 1,
        0.. => mantissa << shift,
        _ => mantissa >> (-shift).min(63),
    };
    if v.is_sign_negative() { -magnitude } else { magnitude }
}

/// The same in units of 2⁻⁹⁴.
fn wide_fixed_point(v: f32, exponent: i32) -> i128 {
    let own = biased_exponent(v);
    let mantissa = if own == 0 { 0 } else { i128::from(v.to_bits() & 0x7F_FFFF | 0x80_0000) };
    let shift = own - exponent + 70;
    let magnitude = match shift {
        71.. => (1 << 94) - 1,
        0.. => mantissa << shift,
        _ => mantissa >> (-shift).min(63),
    };
    if v.is_sign_negative() { -magnitude } else { magnitude }
}

/// Bits of a fraction of an octave in [`octaves`].
const OCTAVE_BITS: u32 = 22;

/// The distance from `v` to `corner` as a piecewise linear logarithm: octaves from some far-off unit on, and [`OCTAVE_BITS`]
/// bits of a fraction.
pub(super) fn octaves(v: f32, corner: f32) -> u32 {
    let exponent = biased_exponent(v).max(biased_exponent(corner));
    let distance = fixed_point(v, exponent).abs_diff(fixed_point(corner, exponent)).max(1);
    let top = 63 - distance.leading_zeros();
    let mantissa = (distance << (63 - top) >> (63 - OCTAVE_BITS)) as u32 & ((1 << OCTAVE_BITS) - 1);
    ((exponent as u32 + top) << OCTAVE_BITS) | mantissa
}

/// A float's bits in an order that is the floats' own; `ordered` in geometry.glsl.
pub(super) fn ordered(v: f32) -> u32 {
    let bits = v.to_bits();
    if bits >> 31 != 0 { !bits } else { bits | 1 << 31 }
}

/// The float that [`ordered`] gave.
pub(super) fn from_ordered(bits: u32) -> f32 {
    f32::from_bits(if bits >> 31 != 0 { bits & !(1 << 31) } else { !bits })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn octaves_grow_with_the_distance_and_by_one_for_a_doubling() {
        let distances = [1.0e-30_f32, 1.0e-3, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0e4, 1.0e20, 3.0e38];
        let logs = distances.map(|d| octaves(d, 0.0));
        assert!(logs.windows(2).all(|w| w[0] < w[1]), "{logs:?}");
        for v in [1.0_f32, 3.7, 1.0e25] {
            assert_eq!(octaves(2.0 * v, 0.0) - octaves(v, 0.0), 1 << OCTAVE_BITS);
            assert_eq!(octaves(-v, v), octaves(2.0 * v, 0.0));
        }
    }

    #[test]
    fn what_is_outside_lies_in_the_corner() {
        let axis = Axis::new(-1.0, 3.0);
        assert_eq!(axis.fraction(-1.0e38), 0);
        for v in [3.0, 3.1, 4.0, 1.0e38] {
            assert_eq!(axis.fraction(v), u64::MAX);
        }
        assert_eq!(axis.fraction(1.0), 1 << 63);
    }

    #[test]
    fn wide_fractions_begin_as_the_others_and_tell_more_apart() {
        for (lo, hi) in [(-1.0_f32, 3.0), (0.3, 0.7), (-1.0e18, 1.0), (0.0, 1.0e18), (5.0e-20, 6.0e-20)] {
            let axis = Axis::new(lo, hi);
            for i in 0..=32 {
                let v = lo + (hi - lo) * (i as f32 / 32.0);
                // What is cut off of a distance weighs as much more as the extent is below half the unit's power of two.
                let difference = (axis.wide_fraction(v) >> 32).abs_diff(u128::from(axis.fraction(v)));
                assert!(difference <= 1 << (axis.shift + 1), "{v} in {lo}..{hi}: {difference}");
            }
        }
        for axis in [Axis::new(-1.0e20, 1.0), Axis::new(0.0, 1.0e20)] {
            let fractions: Vec<u128> = (0..64).map(|i| axis.wide_fraction(i as f32 / 64.0)).collect();
            assert!(fractions.windows(2).all(|w| w[0] < w[1]));
        }
    }

    #[test]
    fn ordered_bits_are_ordered_as_the_floats() {
        let floats = [f32::MIN, -1.0, -1.0e-40, -0.0, 0.0, 1.0e-40, 1.0, f32::MAX];
        assert!(floats.map(ordered).windows(2).all(|w| w[0] < w[1]));
        assert_eq!(floats.map(|v| from_ordered(ordered(v)).to_bits()), floats.map(f32::to_bits));
    }
}
