//! The recipe of a code for a given scene, and encoding by it.

use super::axis::Axis;
use super::binning::Splits;
use super::mipping::Occupancy;
use super::recipe::{Extents, Recipe};
use super::sections::Sections;
use super::size::Size;
use super::{Code, CodeBounds, Codes};
use crate::geometry::Aabb;

/// The recipe of a code for a given scene.
#[derive(Debug, Clone)]
pub struct CodePlan {
    pub(super) codes: Codes,
    pub(super) axes: [Axis; 3],
    pub(super) recipe: Recipe,
    extents: Extents,
    size: Size,
    pub(super) prefix: Prefix,
}

/// What comes before the bits of the recipe.
#[derive(Debug, Clone)]
pub(super) enum Prefix {
    None,
    Sections(Sections),
    Cells(Occupancy),
    Splits(Splits),
}

impl CodePlan {
    /// The recipe of `codes` for primitives with these boxes; those that are left out have an error instead.
    pub fn new<E>(codes: Codes, boxes: &[Result<Aabb, E>]) -> CodePlan {
        let (bounds, centroids) = boxes.iter().flatten().fold((Aabb::EMPTY, Aabb::EMPTY), |(bounds, centroids), b| {
            (bounds.union(b), centroids.union(&Aabb { lo: b.centroid(), hi: b.centroid() }))
        });
        if boxes.iter().flatten().next().is_none() {
            return CodePlan::within(codes, &Aabb { lo: [0.0; 3], hi: [0.0; 3] });
        }
        if codes.bounds.has_sections()
            && let Some(sections) = Sections::of(boxes, &bounds)
        {
            let plan = CodePlan::within(codes, &sections.core);
            let sections = match codes.bounds {
                CodeBounds::Apart => sections,
                _ => sections.with_head(&plan.recipe.sequence),
            };
            return CodePlan { prefix: Prefix::Sections(sections), ..plan };
        }
        let bounds = codes.bounds.of(&bounds, &centroids);
        let plan = CodePlan::within(codes, &bounds);
        let extents = Extents::of(&bounds);
        let centroids = || boxes.iter().flatten().map(|b| plan.wide_fractions(b.centroid()));
        let prefix = match codes.code {
            Code::Bin(binning) => Prefix::Splits(Splits::new(binning, extents, codes.bits, centroids())),
            code if code.grid_bits() > 0 => {
                Prefix::Cells(Occupancy::new(code.grid_bits(), extents, codes.bits, centroids()))
            }
            _ => Prefix::None,
        };
        CodePlan { prefix, ..plan }
    }

    /// The same from the bounds of boxes and of centroids, where `codes` want nothing else of them.
    #[doc(hidden)]
    pub fn of_bounds(codes: Codes, boxes: &Aabb, centroids: impl FnOnce() -> Aabb) -> Option<CodePlan> {
        let bounds = match codes.bounds {
            CodeBounds::Robust | CodeBounds::Apart => return None,
            _ if codes.has_grid() => return None,
            CodeBounds::Full => *boxes,
            CodeBounds::Centroid | CodeBounds::Concise => codes.bounds.of(boxes, &centroids()),
        };
        Some(CodePlan::within(codes, &bounds))
    }

    /// The recipe within these bounds, without a prefix.
    fn within(codes: Codes, bounds: &Aabb) -> CodePlan {
        let extents = Extents::of(bounds);
        let recipe = extents.recipe(codes.code.order(), codes.coordinate_bits());
        let size = match codes.code {
            Code::Emc64VarExtents => Size::by_extents(bounds, &recipe, codes.code.size_group()),
            _ => Size::by_diagonal(bounds),
        };
        let axes = std::array::from_fn(|i| Axis::new(bounds.lo[i], bounds.hi[i]));
        CodePlan { codes, axes, recipe, extents, size, prefix: Prefix::None }
    }

    fn fractions(&self, at: [f32; 3]) -> [u64; 3] {
        std::array::from_fn(|i| self.axes[i].fraction(at[i]))
    }

    fn wide_fractions(&self, at: [f32; 3]) -> [u128; 3] {
        std::array::from_fn(|i| self.axes[i].wide_fraction(at[i]))
    }

    /// The code of a primitive with this box, in the low [`Codes::bits`] bits. Never all ones: that is [`CodePlan::inactive`].
    pub fn encode(&self, primitive: &Aabb) -> u64 {
        let (bits, group) = (self.codes.bits, self.codes.code.size_group());
        self.encode_with(primitive, |coordinates, size| self.recipe.encode(coordinates, size, group, bits))
    }

    /// Where most of the primitives are, if something is far or huge.
    pub fn core(&self) -> Option<&Aabb> {
        match &self.prefix {
            Prefix::Sections(sections) => Some(&sections.core),
            _ => None,
        }
    }

    /// Of its coordinate bits those up to the one by which `needed` have counted: that have made cells smaller than these extents.
    pub(super) fn coordinate_bits_for(&self, typical: Extents, needed: u32) -> u32 {
        let Extents(mut cells) = self.extents;
        let mut counted = 0;
        for (taken, &axis) in self.recipe.sequence.iter().enumerate() {
            if counted == needed {
                return taken as u32;
            }
            cells[axis] = cells[axis].wrapping_sub(1 << 23);
            counted += u32::from(cells[axis] < typical.0[axis]);
        }
        self.recipe.sequence.len() as u32
    }

    /// The size of a primitive as a word of 16 bits, where the code has bits of it.
    #[inline]
    pub(super) fn size_of(&self, primitive: &Aabb) -> u32 {
        if self.codes.code.size_group() == 0 { 0 } else { self.size.of(primitive) }
    }

    /// [`CodePlan::encode`] by a recipe that gives what the plan's own would of coordinates and a size.
    pub(super) fn encode_with(&self, primitive: &Aabb, recipe: impl Fn([u64; 3], u32) -> u64) -> u64 {
        let bits = self.codes.bits;
        let size = || self.size_of(primitive);
        let coordinates = || self.fractions(primitive.centroid());
        let code = match &self.prefix {
            Prefix::None => recipe(coordinates(), size()),
            Prefix::Sections(sections) => {
                let section = sections.section_of(primitive);
                let (coordinates, size) = if section.is_core() {
                    (coordinates(), size())
                } else {
                    (sections.coordinates(primitive.centroid(), coordinates()), 0xFFFF)
                };
                sections.insert(section, recipe(coordinates, size), bits)
            }
            Prefix::Cells(cells) => cells.encode(self.wide_fractions(primitive.centroid()), bits),
            Prefix::Splits(splits) => splits.encode(self.wide_fractions(primitive.centroid()), bits),
        };
        code.min(self.inactive() - 1)
    }

    /// The code of primitives that are left out: it sorts behind all others.
    #[inline]
    pub fn inactive(&self) -> u64 {
        u64::MAX >> (64 - self.codes.bits)
    }
}

/// A prefix of `length` bits before the top of a code of `bits` bits.
pub(super) fn prefixed(prefix: u32, length: u32, code: u64, bits: u32) -> u64 {
    if length == 0 { code } else { u64::from(prefix) << (bits - length) | code >> length }
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
        let plan = CodePlan::within(Code::Mc30.full().with_bits(9), &bounds);
        // x = 5 = 101, y = 3 = 011, z = 6 = 110 of 8 cells.
        assert_eq!(plan.encode(&box_at([5.0, 3.0, 6.0])), 0b101_011_110);
    }

    #[test]
    fn every_seventh_bit_is_of_the_size() {
        let bounds = Aabb { lo: [0.0; 3], hi: [1.0; 3] };
        let plan = CodePlan::within(Code::Emc64Var.full().with_bits(14), &bounds);
        // The whole scene as one primitive: size 1 (all ones), centroid in the middle (first bits 1, then 0).
        assert_eq!(plan.encode(&bounds), 0b11_1000_1000_0001);
        // The same centroid with no size.
        assert_eq!(plan.encode(&box_at([0.5; 3])), 0b11_1000_0000_0000);
    }

    #[test]
    fn a_far_primitive_costs_the_long_axis_no_precision_below_42_doublings() {
        let grown = Aabb { lo: [0.0; 3], hi: [2.0_f32.powi(42), 1.0, 1.0] };
        let plan = CodePlan::within(Code::Emc64VarNoSize.full(), &grown);
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
            let plan = CodePlan::within(Code::Mc63.full(), &bounds);
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
        let plan = CodePlan::within(Code::Emc64VarNoSize.full(), &grown);
        let codes: Vec<_> = (0..64).map(|i| plan.encode(&box_at([(i as f32 + 0.5) / 64.0, 0.1, 0.1]))).collect();
        assert!(codes.windows(2).all(|w| w[0] < w[1]), "64 cells along x are told apart");
    }

    #[test]
    fn huge_and_tiny_and_flat_bounds_encode_in_order() {
        for (lo, hi) in [(-3.0e38, 3.0e38), (1.0e-30, 3.0e-30), (-1.0e30, 1.0e30), (1.0e6, 1.000_01e6)] {
            let corners = [box_at([lo, 0.0, lo]), box_at([hi, 0.0, hi])];
            for code in Code::ALL {
                for bounds in CodeBounds::ALL {
                    let Some(codes) = code.full().with_bounds(bounds) else { continue };
                    let plan = CodePlan::new(codes, &corners.map(Ok::<_, u32>));
                    let [low, high] = corners.map(|b| plan.encode(&b));
                    assert!(low < high && high < plan.inactive(), "{codes} in {lo:e}..{hi:e}: {low:x} {high:x}");
                }
            }
        }
    }
}
