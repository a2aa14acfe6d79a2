//! The exact sign of a·b − c·d, and its leading 24 bits, from integers alone (glsl/trace/determinant.glsl).
//!
//! The watertight test (Woop, Benthin, Wald 2013, section 3) needs the sign of its edge functions to be right where they
//! cancel, and takes doubles there. A device need not have doubles, and the products may also leave the range of a float;
//! 24-bit mantissas and their 48-bit products need neither, whatever the device does to rounding and subnormals.

/// `mantissa · 2^exponent`; zero is `{0, 0}`, otherwise the mantissa's magnitude has 24 bits, its lower ones cut off.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Scaled {
    /// Signed, 2²³ ≤ |mantissa| < 2²⁴ or 0.
    pub mantissa: i32,
    /// Power of two.
    pub exponent: i32,
}

impl Scaled {
    const ZERO: Scaled = Scaled { mantissa: 0, exponent: 0 };

    /// The value divided by 2^`exponent`, which must not be less than its own; below 2⁻⁶⁰ of that it is zero.
    pub fn relative_to(self, exponent: i32) -> f32 {
        let shift = exponent - self.exponent;
        if self.mantissa == 0 || shift > 60 {
            return 0.0;
        }
        self.mantissa as f32 * f32::from_bits(((127 - shift) as u32) << 23)
    }
}

/// Room above the 48 bits of a product, for the alignment of the other. Two of 62 bits add up without overflow.
const ROOM: u32 = 14;

/// a·b − c·d of finite floats, subnormal ones taken as zero: its sign, and its value cut to 24 bits.
pub fn difference_of_products([a, b]: [f32; 2], [c, d]: [f32; 2]) -> Scaled {
    let (p, q) = (Product::of(a, b), Product::of(c, d).negated());
    let (large, small) = if q.exponent > p.exponent { (q, p) } else { (p, q) };
    // Both have their highest bit at 46 or 47 or are zero, so what the shift cuts off of the smaller one cannot be
    // missed in the first 24 bits: either less than 15 bits are shifted, and nothing is lost, or nothing cancels.
    let apart = (large.exponent - small.exponent).clamp(0, 63) as u32;
    let high = (large.magnitude << ROOM) as i64;
    let low = ((small.magnitude << ROOM) >> apart) as i64;
    let difference = if large.negative == small.negative { high + low } else { high - low };
    if difference == 0 {
        return Scaled::ZERO;
    }
    let magnitude = difference.unsigned_abs();
    let cut = 40 - magnitude.leading_zeros() as i32;
    let mantissa = if cut >= 0 { magnitude >> cut } else { magnitude << -cut } as i32;
    let negative = large.negative != (difference < 0);
    Scaled { mantissa: if negative { -mantissa } else { mantissa }, exponent: large.exponent - ROOM as i32 + cut }
}

/// Below the exponent of every other product: a zero never outweighs one by what it is multiplied with.
const ZERO_EXPONENT: i32 = -1000;

/// ±magnitude · 2^exponent, the exact product of two floats.
#[derive(Clone, Copy)]
struct Product {
    magnitude: u64,
    exponent: i32,
    negative: bool,
}

impl Product {
    fn of(a: f32, b: f32) -> Product {
        let (ma, ea) = parts(a);
        let (mb, eb) = parts(b);
        let magnitude = u64::from(ma) * u64::from(mb);
        Product {
            magnitude,
            exponent: if magnitude == 0 { ZERO_EXPONENT } else { ea + eb },
            negative: (a.to_bits() ^ b.to_bits()) >> 31 == 1,
        }
    }

    fn negated(self) -> Product {
        Product { negative: !self.negative, ..self }
    }
}

fn parts(x: f32) -> (u32, i32) {
    let bits = x.to_bits();
    let exponent = bits >> 23 & 0xff;
    if exponent == 0 { (0, -150) } else { (bits & 0x7f_ffff | 0x80_0000, exponent as i32 - 150) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn finite() -> impl Strategy<Value = f32> {
        prop_oneof![
            (-16i32..16).prop_map(|i| i as f32),
            any::<f32>().prop_filter("normal", |x| x.is_normal() || *x == 0.0),
            (0x3f80_0000u32..0x3f80_0004).prop_map(f32::from_bits),
        ]
    }

    proptest! {
        /// A product of two floats fits a double's mantissa, so a double's difference has the right sign and 53 right bits
        /// as long as no exponent leaves its range, which those of floats cannot.
        #[test]
        fn sign_and_leading_bits_are_those_of_doubles(a in finite(), b in finite(), c in finite(), d in finite()) {
            let exact = f64::from(a) * f64::from(b) - f64::from(c) * f64::from(d);
            let got = difference_of_products([a, b], [c, d]);
            let value = f64::from(got.mantissa) * 2f64.powi(got.exponent / 2) * 2f64.powi(got.exponent - got.exponent / 2);
            prop_assert_eq!(got.mantissa.signum() as f64, if exact == 0.0 { 0.0 } else { exact.signum() });
            prop_assert!((value - exact).abs() <= exact.abs() * 2f64.powi(-23), "{value:e} for {exact:e}");
        }
    }

    #[test]
    fn products_that_differ_in_their_last_bit_have_the_right_sign() {
        let next = f32::from_bits(1f32.to_bits() + 1);
        // (1+e)² − (1+2e) = e²: both products round to the same float.
        assert_eq!(
            difference_of_products([next, next], [f32::from_bits(1f32.to_bits() + 2), 1.0]).mantissa.signum(),
            1
        );
        assert_eq!(difference_of_products([1e-30, 1e-30], [1e-30, 1.5e-30]).mantissa.signum(), -1);
        assert_eq!(difference_of_products([1e30, 1e30], [1e30, 1e30]), Scaled::ZERO);
        // A zero does not outweigh a small product.
        assert_eq!(difference_of_products([1.0, 2e-32], [2e37, 0.0]).mantissa.signum(), 1);
        assert_eq!(difference_of_products([2e37, 0.0], [1.0, 2e-32]).mantissa.signum(), -1);
    }
}
