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
    /// The same as it was given, and the high corner.
    corner: f32,
    far: f32,
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
            return Axis { exponent, shift: 0, lo: low, corner: lo, far: lo, inverse: 0 };
        }
        let shift = extent.leading_zeros();
        let extent = u128::from(extent << shift);
        let inverse = (((1 << 64) - extent) << 63).div_ceil(extent) as u64;
        Axis { exponent, shift, lo: low, corner: lo, far: hi, inverse }
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

/// The first bits of an axis' fractions, in double precision: fast, and only where rounding cannot change them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cells {
    corner: f64,
    per_length: f64,
    /// How near to a border of cells a place is that may be on either side.
    margin: f64,
    /// How many cells there are.
    count: f64,
    bits: u32,
}

impl Cells {
    /// Adding this rounds to an integer, which is in the low bits then, a negative one as well.
    const ROUNDING: f64 = (3u64 << 51) as f64;

    /// The first `bits` bits; `None` where doubles tell too little.
    pub fn new(axis: &Axis, bits: u32) -> Option<Cells> {
        let corner = f64::from(axis.corner);
        let extent = f64::from(axis.far) - corner;
        let count = (1u64 << bits.min(32)) as f64;
        let per_length = count / extent;
        let largest = f64::from(axis.corner.abs().max(axis.far.abs()));
        // Differences of doubles, units of 2⁻⁶², and denormals that are 0 there.
        let lost = largest / (1u64 << 50) as f64 + 2.0 * f64::from(f32::MIN_POSITIVE);
        let margin = lost * per_length + 1.0 / (1u64 << 20) as f64;
        (axis.inverse != 0 && bits <= 32 && margin < 0.25).then_some(Cells { corner, per_length, margin, count, bits })
    }

    /// Those bits of the fraction, at the top; `None` near a border.
    #[inline]
    pub fn fraction(&self, v: f32) -> Option<u64> {
        let place = (f64::from(v) - self.corner) * self.per_length;
        let rounded = place - 0.5 + Cells::ROUNDING;
        let within = place - (rounded - Cells::ROUNDING);
        let is_sure = place > self.margin
            && place < self.count - self.margin
            && within > self.margin
            && within < 1.0 - self.margin;
        is_sure.then(|| rounded.to_bits() << (64 - self.bits))
    }
}

/// The largest fraction of 96 bits.
const WIDE_MAX: u128 = (1 << 96) - 1;

fn biased_exponent(v: f32) -> i32 {
    (v.to_bits() >> 23) as i32 & 0xFF
}

/// A float in units of 2⁻⁶² of what the exponent bounds; what is smaller than a unit is cut off, what is larger than the bound is
/// the bound. Denormals are 0.
fn fixed_point(v: f32, exponent: i32) -> i64 {
    const BOUND: i64 = (1 << 62) - 1;
    // 2^(188 − exponent), and exact: any float and any unit are far from the ends of doubles.
    let units = f64::from_bits(((1023 + 188 - exponent) as u64) << 52);
    let normal = if biased_exponent(v) == 0 { 0.0 } else { v };
    ((f64::from(normal) * units) as i64).clamp(-BOUND, BOUND)
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
    fn units_are_what_shifting_the_mantissa_gives() {
        let shifted = |v: f32, exponent: i32| {
            let own = biased_exponent(v);
            let mantissa = if own == 0 { 0 } else { i128::from(v.to_bits() & 0x7F_FFFF | 0x80_0000) };
            let magnitude = match own - exponent + 38 {
                39.. => (1 << 62) - 1,
                shift @ 0.. => (mantissa << shift) as i64,
                shift => (mantissa >> (-shift).min(63)) as i64,
            };
            if v < 0.0 { -magnitude } else { magnitude }
        };
        for exponent in [0, 1, 40, 63, 64, 100, 127, 150, 190, 254] {
            for own in 0..=254u32 {
                for mantissa in [0, 1, 0x40_0000, 0x55_5555, 0x7F_FFFF] {
                    let v = f32::from_bits(own << 23 | mantissa);
                    for v in [v, -v] {
                        assert_eq!(fixed_point(v, exponent), shifted(v, exponent), "{v:e} by {exponent}");
                    }
                }
            }
        }
    }

    #[test]
    fn cells_are_the_first_bits_of_fractions_wherever_they_are_told() {
        for (lo, hi) in [(0.0, 1.0), (-3.0, 5.5), (1e6, 1e6 + 10.0), (-1e30, 1e30), (1e-30, 3e-30), (-1e-38, 2e-38)] {
            let axis = Axis::new(lo, hi);
            for bits in [1, 8, 16] {
                let Some(cells) = Cells::new(&axis, bits) else { continue };
                let told = (0..=4096).filter_map(|i| {
                    let v = lo + (hi - lo) * (i as f32 / 4096.0) * 1.01;
                    let told = cells.fraction(v)?;
                    assert_eq!(told >> (64 - bits), axis.fraction(v) >> (64 - bits), "{v:e} of {lo:e} to {hi:e}");
                    Some(told)
                });
                // What lies on a border is not told.
                assert!(told.count() > 2000, "{lo:e} to {hi:e}, {bits} bits");
            }
        }
        assert!(Cells::new(&Axis::new(1e30, 1e30), 8).is_none());
    }

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
