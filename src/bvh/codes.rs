//! Morton codes and extended Morton codes: where a primitive lies, as one number whose order is a space-filling curve.
//!
//! Lauterbach et al. 2009 for the plain codes; Vinkler, Bittner, Havran 2017 for the extended ones, after Frantál 2019,
//! section 3.7, and Riemersma 2024, section 2.4.3. Concise bounds: Riemersma 2024, equation 15.
//!
//! Every code is the same recipe with other ingredients: a *sequence* of axes, from the top bit down, of which each takes the
//! next bit of that axis' coordinate; and, every so many bits, one bit of the primitive's size. [`Plan`] is the recipe for
//! given bounds; `glsl/bvh/codes.glsl` cooks by the same one and gives the same bits on every device: no division, square
//! root or contraction that a driver may round its own way is trusted.

use super::layout::Aabb;
use crate::{Error, Result};
use std::fmt;
use std::str::FromStr;

/// Which code.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Code {
    /// 10 bits an axis, x y z in turn.
    Mc30,
    /// 21 bits an axis, x y z in turn.
    Mc63,
    /// Axes in order of their extent, every fourth bit one of the size: 16 bits each.
    Emc64Sort,
    /// Each bit halves the axis that is longest then; every seventh bit is one of the size.
    Emc64Var,
    /// As [`Code::Emc64Var`], without the size.
    Emc64VarNoSize,
}

/// A code, the bounds it is normalised by, and how many of its bits are used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Codes {
    /// Which code.
    pub code: Code,
    /// Normalise by the concise bounds instead of the bounds of all boxes.
    pub concise: bool,
    /// How many bits, from the top: 1 to [`Code::bits`].
    pub bits: u32,
}

/// How the axes follow each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Order {
    /// x y z x y z …
    Regular,
    /// The same in the order of the extents, longest first.
    Sorted,
    /// Whichever is longest at the time.
    Variable,
}

impl Code {
    /// All codes.
    pub const ALL: [Code; 5] = [Code::Mc30, Code::Mc63, Code::Emc64Sort, Code::Emc64Var, Code::Emc64VarNoSize];

    /// The code's full length in bits.
    pub const fn bits(self) -> u32 {
        match self {
            Code::Mc30 => 30,
            Code::Mc63 => 63,
            Code::Emc64Sort | Code::Emc64Var | Code::Emc64VarNoSize => 64,
        }
    }

    /// The code with all its bits and the bounds of all boxes.
    pub const fn full(self) -> Codes {
        Codes { code: self, concise: false, bits: self.bits() }
    }

    /// Coordinate bits between two bits of the size; 0 for codes without.
    pub(crate) const fn size_group(self) -> u32 {
        match self {
            Code::Emc64Sort => 3,
            Code::Emc64Var => 6,
            Code::Mc30 | Code::Mc63 | Code::Emc64VarNoSize => 0,
        }
    }

    fn order(self) -> Order {
        match self {
            Code::Mc30 | Code::Mc63 => Order::Regular,
            Code::Emc64Sort => Order::Sorted,
            Code::Emc64Var | Code::Emc64VarNoSize => Order::Variable,
        }
    }

    /// The number by which shaders know the order: `ORDER_…` in codes.glsl.
    pub(crate) fn order_number(self) -> u32 {
        self.order() as u32
    }

    fn name(self) -> &'static str {
        match self {
            Code::Mc30 => "mc30",
            Code::Mc63 => "mc63",
            Code::Emc64Sort => "emc64sort",
            Code::Emc64Var => "emc64var",
            Code::Emc64VarNoSize => "emc64var-nosize",
        }
    }
}

impl Codes {
    /// The first `bits` bits of the code (no more than it has).
    pub fn with_bits(self, bits: u32) -> Codes {
        Codes { bits: bits.clamp(1, self.code.bits()), ..self }
    }

    /// Of the used bits, those that hold coordinates.
    pub(crate) fn coordinate_bits(&self) -> u32 {
        match self.code.size_group() {
            0 => self.bits,
            group => self.bits - self.bits / (group + 1),
        }
    }
}

impl fmt::Display for Codes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.code.name())?;
        if self.concise {
            f.write_str("+concise")?;
        }
        if self.bits != self.code.bits() { write!(f, "/{}", self.bits) } else { Ok(()) }
    }
}

impl FromStr for Codes {
    type Err = Error;

    /// `NAME[+concise][/BITS]`.
    fn from_str(text: &str) -> Result<Codes> {
        let known = || Code::ALL.map(Code::name).join(", ");
        let (rest, bits) = match text.split_once('/') {
            Some((rest, bits)) => (rest, Some(bits)),
            None => (text, None),
        };
        let (name, concise) = match rest.split_once('+') {
            None => (rest, false),
            Some((name, "concise")) => (name, true),
            Some((_, other)) => {
                return Err(Error::Argument(format!("codes {text:?}: +{other} is not known; there is +concise")));
            }
        };
        let code = Code::ALL
            .into_iter()
            .find(|c| c.name() == name)
            .ok_or_else(|| Error::Argument(format!("codes {text:?}: {name:?} is not known; there are {}", known())))?;
        let mut codes = Codes { concise, ..code.full() };
        if let Some(bits) = bits {
            codes.bits =
                bits.parse().ok().filter(|b| (1..=code.bits()).contains(b)).ok_or_else(|| {
                    Error::Argument(format!("codes {text:?}: the bits after / are 1 to {}", code.bits()))
                })?;
        }
        Ok(codes)
    }
}

/// The bounds that codes are normalised by: those of the boxes, or the concise ones (Riemersma 2024, equation 15), which cut
/// the same from both sides so that the first split stays in the middle.
pub fn code_bounds(boxes: &Aabb, centroids: &Aabb, concise: bool) -> Aabb {
    if !concise {
        return *boxes;
    }
    let difference: [f32; 3] =
        std::array::from_fn(|i| (centroids.lo[i] - boxes.lo[i]).min(boxes.hi[i] - centroids.hi[i]).max(0.0));
    Aabb {
        lo: std::array::from_fn(|i| boxes.lo[i] + difference[i]),
        hi: std::array::from_fn(|i| boxes.hi[i] - difference[i]),
    }
}

/// One axis of the bounds, for [`Axis::fraction`]. All integers: nothing is lost in the subtraction from a far corner, and what
/// lies in the middle of the scene lies in the middle of the code.
#[derive(Debug, Clone)]
struct Axis {
    /// Biased exponent of the larger of |lo| and |hi|: the unit is 2⁻⁶² of what it bounds.
    exponent: i32,
    /// Brings the extent's leading bit to the top.
    shift: u32,
    /// The low corner.
    lo: i64,
    /// (2⁶⁴ / extent − 1) · 2⁶³, rounded up, for the shifted extent; 0 for a flat axis.
    inverse: u64,
}

impl Axis {
    fn new(lo: f32, hi: f32) -> Axis {
        let exponent = biased_exponent(lo).max(biased_exponent(hi));
        let low = fixed_point(lo, exponent);
        let extent = (fixed_point(hi, exponent) - low) as u64;
        if extent == 0 {
            return Axis { exponent, shift: 0, lo: low, inverse: 0 };
        }
        let shift = extent.leading_zeros();
        let extent = u128::from(extent << shift);
        let inverse = (((1 << 64) - extent) << 63).div_ceil(extent) as u64;
        Axis { exponent, shift, lo: low, inverse }
    }

    /// Where `v` lies between the corners, as a 64-bit fraction.
    fn fraction(&self, v: f32) -> u64 {
        let distance = ((fixed_point(v, self.exponent) - self.lo).max(0) as u64) << self.shift;
        let more = (u128::from(distance) * u128::from(self.inverse)) >> 63;
        distance.saturating_add(u64::try_from(more).unwrap_or(u64::MAX))
    }
}

fn biased_exponent(v: f32) -> i32 {
    (v.to_bits() >> 23) as i32 & 0xFF
}

/// A float in units of 2⁻⁶² of what the exponent bounds; what is smaller than a unit is cut off.
fn fixed_point(v: f32, exponent: i32) -> i64 {
    let own = biased_exponent(v);
    let mantissa = if own == 0 { 0 } else { i64::from(v.to_bits() & 0x7F_FFFF | 0x80_0000) };
    let shift = own - exponent + 38;
    let magnitude = if shift >= 0 { mantissa << shift } else { mantissa >> (-shift).min(63) };
    if v.is_sign_negative() { -magnitude } else { magnitude }
}

/// The recipe of a code for given bounds.
#[derive(Debug, Clone)]
pub struct Plan {
    codes: Codes,
    /// Axis of each coordinate bit, from the top.
    sequence: Vec<usize>,
    axes: [Axis; 3],
    /// The power of two for lengths along any axis.
    size_prescale: f32,
    /// 1 / diagonal².
    size_reciprocal: f32,
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

/// The axis of each of `bits` coordinate bits, from the top.
fn sequence(extent: [f32; 3], order: Order, bits: u32) -> Vec<usize> {
    // Halving a float is taking one from its exponent: as integers, extents compare and halve exactly, with no underflow.
    let mut keys = extent.map(|e| if e > 0.0 { e.to_bits() as i32 } else { -0x7F00_0000 });
    let longest = |keys: &[i32; 3]| (0..3).rev().max_by_key(|&axis| keys[axis]).expect("three axes");
    let mut sorted = [0, 1, 2];
    sorted.sort_by_key(|&axis| std::cmp::Reverse(keys[axis]));
    (0..bits as usize)
        .map(|bit| match order {
            Order::Regular => bit % 3,
            Order::Sorted => sorted[bit % 3],
            Order::Variable => {
                let axis = longest(&keys);
                // Those of flat axes wrap around, as on the device.
                keys[axis] = keys[axis].wrapping_sub(1 << 23);
                axis
            }
        })
        .collect()
}

impl Plan {
    /// The recipe of `codes` for primitives whose [`code_bounds`] are `bounds`.
    pub fn new(codes: Codes, bounds: &Aabb) -> Plan {
        let magnitude: [f32; 3] = std::array::from_fn(|i| bounds.lo[i].abs().max(bounds.hi[i].abs()));
        let size_prescale = prescale_of(magnitude.into_iter().fold(0.0, f32::max));
        let extent: [f32; 3] = std::array::from_fn(|i| bounds.hi[i] * size_prescale - bounds.lo[i] * size_prescale);
        let diagonal2 = extent[0] * extent[0] + extent[1] * extent[1] + extent[2] * extent[2];
        // The axes are compared by the unscaled extents' exponents: half of each is taken first, which is exact and finite.
        let half_extent = std::array::from_fn(|i| 0.5 * bounds.hi[i] - 0.5 * bounds.lo[i]);
        Plan {
            codes,
            sequence: sequence(half_extent, codes.code.order(), codes.coordinate_bits()),
            axes: std::array::from_fn(|i| Axis::new(bounds.lo[i], bounds.hi[i])),
            size_prescale,
            size_reciprocal: reciprocal_or_zero(diagonal2),
        }
    }

    /// The code of a primitive with this box, in the low [`Codes::bits`] bits. Never all ones: that is [`Plan::inactive`].
    pub fn encode(&self, primitive: &Aabb) -> u64 {
        let centroid = primitive.centroid();
        let coordinate: [u64; 3] = std::array::from_fn(|i| self.axes[i].fraction(centroid[i]));
        let size = self.size(primitive);
        let group = self.codes.code.size_group();
        let (mut code, mut taken, mut size_taken) = (0u64, [0u32; 3], 0);
        let mut axes = self.sequence.iter();
        for bit in 1..=self.codes.bits {
            code <<= 1;
            if group > 0 && bit.is_multiple_of(group + 1) {
                code |= u64::from(size >> (15 - size_taken) & 1);
                size_taken += 1;
            } else {
                let axis = *axes.next().expect("the sequence has every coordinate bit");
                code |= coordinate[axis] >> (63 - taken[axis]) & 1;
                taken[axis] += 1;
            }
        }
        code.min(self.inactive() - 1)
    }

    /// The code of primitives that are left out: it sorts behind all others.
    pub fn inactive(&self) -> u64 {
        u64::MAX >> (64 - self.codes.bits)
    }

    /// Diagonal of the box over that of the scene, as a 16-bit fraction.
    fn size(&self, primitive: &Aabb) -> u32 {
        let extent: [f32; 3] =
            std::array::from_fn(|i| primitive.hi[i] * self.size_prescale - primitive.lo[i] * self.size_prescale);
        let squared = (extent[0] * extent[0] + extent[1] * extent[1] + extent[2] * extent[2]) * self.size_reciprocal;
        // The square root is taken of the fraction as an integer: the same on every device.
        let fixed = if squared >= 1.0 { u32::MAX } else { (squared * 4_294_967_296.0) as u32 };
        fixed.isqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn box_at(p: [f32; 3]) -> Aabb {
        Aabb { lo: p, hi: p }
    }

    #[test]
    fn a_plain_code_interleaves_x_y_z_from_the_top() {
        let bounds = Aabb { lo: [0.0; 3], hi: [8.0; 3] };
        let plan = Plan::new(Code::Mc30.full().with_bits(9), &bounds);
        // x = 5 = 101, y = 3 = 011, z = 6 = 110 of 8 cells.
        assert_eq!(plan.encode(&box_at([5.0, 3.0, 6.0])), 0b101_011_110);
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
    fn every_seventh_bit_is_of_the_size() {
        let bounds = Aabb { lo: [0.0; 3], hi: [1.0; 3] };
        let plan = Plan::new(Code::Emc64Var.full().with_bits(14), &bounds);
        // The whole scene as one primitive: size 1 (all ones), centroid in the middle (first bits 1, then 0).
        assert_eq!(plan.encode(&bounds), 0b11_1000_1000_0001);
        // The same centroid with no size.
        assert_eq!(plan.encode(&box_at([0.5; 3])), 0b11_1000_0000_0000);
    }

    #[test]
    fn a_far_primitive_costs_the_long_axis_no_precision_below_42_doublings() {
        let grown = Aabb { lo: [0.0; 3], hi: [2.0_f32.powi(42), 1.0, 1.0] };
        let plan = Plan::new(Code::Emc64VarNoSize.full(), &grown);
        // 42 bits go to x before y and z have any; 22 are left for three axes: 7 or 8 each.
        let codes: Vec<_> = (0..64).map(|i| plan.encode(&box_at([(i as f32 + 0.5) / 64.0, 0.1, 0.1]))).collect();
        assert!(codes.windows(2).all(|w| w[0] < w[1]), "64 cells along x are told apart");
    }

    #[test]
    fn what_lies_in_the_middle_has_the_middle_code_wherever_the_scene_is() {
        for (lo, hi) in [(-1.0, 1.0), (0.0, 3.0), (-17.402_76, 17.417_24), (1e6, 1e6 + 7.0), (-5e-20, 11e-20)] {
            let bounds = Aabb { lo: [lo; 3], hi: [hi; 3] };
            let middle = bounds.centroid()[0];
            let below =
                f32::from_bits(if middle > 0.0 { middle.to_bits() - 1 } else { (-f32::MIN_POSITIVE).to_bits() });
            let plan = Plan::new(Code::Mc63.full(), &bounds);
            // By exact arithmetic: twice the distance from the low corner against the extent.
            let exact = |v: f32| 2.0 * (f64::from(v) - f64::from(lo)) >= f64::from(hi) - f64::from(lo);
            for v in [middle, below] {
                assert_eq!(plan.encode(&box_at([v; 3])) >> 62 == 1, exact(v), "{v} in {lo}..{hi}");
            }
        }
    }

    #[test]
    fn a_scene_far_on_the_negative_side_keeps_its_precision() {
        let grown = Aabb { lo: [-2.0_f32.powi(40), 0.0, 0.0], hi: [1.0, 1.0, 1.0] };
        let plan = Plan::new(Code::Emc64VarNoSize.full(), &grown);
        let codes: Vec<_> = (0..64).map(|i| plan.encode(&box_at([(i as f32 + 0.5) / 64.0, 0.1, 0.1]))).collect();
        assert!(codes.windows(2).all(|w| w[0] < w[1]), "64 cells along x are told apart");
    }

    #[test]
    fn concise_bounds_cut_the_same_from_both_sides() {
        let boxes = Aabb { lo: [0.0, 0.0, 0.0], hi: [10.0, 10.0, 10.0] };
        let centroids = Aabb { lo: [1.0, 3.0, 0.0], hi: [8.0, 9.0, 10.0] };
        let concise = code_bounds(&boxes, &centroids, true);
        assert_eq!(concise, Aabb { lo: [1.0, 1.0, 0.0], hi: [9.0, 9.0, 10.0] });
    }

    #[test]
    fn huge_and_tiny_and_flat_bounds_encode_in_order() {
        for (lo, hi) in [(-3.0e38, 3.0e38), (1.0e-30, 3.0e-30), (-1.0e30, 1.0e30), (1.0e6, 1.000_01e6)] {
            let bounds = Aabb { lo: [lo, 0.0, lo], hi: [hi, 0.0, hi] };
            for code in Code::ALL {
                let plan = Plan::new(code.full(), &bounds);
                let low = plan.encode(&box_at([lo, 0.0, lo]));
                let high = plan.encode(&box_at([hi, 0.0, hi]));
                assert!(low < high && high < plan.inactive(), "{code:?} in {lo:e}..{hi:e}: {low:x} {high:x}");
            }
        }
    }

    #[test]
    fn names_round_trip_and_bad_ones_say_what_there_is() {
        for text in ["mc30", "mc63", "emc64sort", "emc64var", "emc64var-nosize", "mc63+concise", "emc64var+concise/32"]
        {
            assert_eq!(text.parse::<Codes>().expect(text).to_string(), text);
        }
        assert!("mc31".parse::<Codes>().unwrap_err().to_string().contains("emc64var-nosize"));
        assert!("mc30+tight".parse::<Codes>().unwrap_err().to_string().contains("+concise"));
        assert!("mc30/31".parse::<Codes>().unwrap_err().to_string().contains("1 to 30"));
    }
}
