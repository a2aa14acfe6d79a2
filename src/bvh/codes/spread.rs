//! How many bits a code needs, by how its primitives are spread.
//!
//! [`Codes::for_count`](super::Codes::for_count) takes primitives to fill their bounds: of about a thousand times as many cells as there
//! are primitives, each lies in its own. Where most of them are in a small part of the bounds, bits that halve the rest tell none of them
//! apart. The rule: a bit counts if it makes a cell smaller than the extents that evenly spread primitives would have with the *quartiles*
//! of these (twice the distance between the quartiles); bits are added until as many count as the code has where primitives fill the bounds.
//! Beside them stand the two bits of the section, where something is far ([`super::sections`]).
//!
//! Never more than 16 bits are added. The fences let what is encoded be at most five times as long as the distance between the quartiles,
//! 2.5 times the typical extents: 1.3 bits an axis. They are wider for an axis along which half of all lie close together: with a
//! twentieth of the widest it has 3.4 bits. Where two axes are so, that is ten with those of the section, and twelve with one in seven
//! of the size. Only where half of all lie in one plane would there be more, and no bit tells these apart along that axis.
//!
//! Quartiles are those of the sample that tells what is far. Bits come in eights, a pass of the sort each. `bits_by_spread` in
//! `glsl/bvh/codes.glsl` is the device's side.

use super::Codes;
use super::plan::CodePlan;
use super::sections::{SECTION_BITS, typical_extents};
use crate::geometry::Aabb;

/// Bits come in so many at a time.
const STEP: u32 = 8;
/// The most that are added.
const MOST_MORE: u32 = 16;

impl Codes {
    /// The most bits that [`Codes::by_spread`] may take, which are at most `most`.
    pub(crate) fn most_by_spread(&self, most: u32) -> u32 {
        most.min(self.bits + MOST_MORE)
    }

    /// These codes with as many bits, at least their own and at most `most`, as tell primitives with these boxes apart as well as
    /// their own would if the primitives filled the bounds. Only codes with sections know their primitives' spread.
    pub fn by_spread<E: Copy>(self, boxes: &[Result<Aabb, E>], most: u32) -> Codes {
        if !self.bounds.has_sections() {
            return self;
        }
        let Some(typical) = typical_extents(boxes) else { return self };
        let most = self.most_by_spread(most);
        let longest = Codes { bits: most, ..self };
        let plan = CodePlan::new(longest, boxes);
        let taken = plan.coordinate_bits_for(typical, self.coordinate_bits());
        let lost = if plan.core().is_some() { SECTION_BITS } else { 0 };
        let enough = |bits: &u32| Codes { bits: *bits, ..self }.coordinate_bits() >= taken + lost;
        let bits = (self.bits..most).step_by(STEP as usize).find(enough);
        Codes { bits: bits.unwrap_or(most).max(self.bits), ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Code, CodeBounds};
    use super::*;

    fn robust(bits: u32) -> Codes {
        Code::Emc64Var.full().with_bounds(CodeBounds::Robust).expect("it has no grid").with_bits(bits)
    }

    /// A thousand points in a cube of this length, evenly, and others.
    fn bits(extent: f32, others: &[[f32; 3]], base: u32, most: u32) -> u32 {
        bits_in([extent; 3], others, base, most)
    }

    /// The same in a box.
    fn bits_in(extents: [f32; 3], others: &[[f32; 3]], base: u32, most: u32) -> u32 {
        let at = |axis: usize, i: u32| extents[axis] * (i as f32 + 0.5) / 10.0;
        let cells = (0..1000).map(|i| [at(0, i % 10), at(1, i / 10 % 10), at(2, i / 100)]);
        let points: Vec<[f32; 3]> = cells.chain(others.iter().copied()).collect();
        let boxes: Vec<Result<Aabb, u32>> = points.into_iter().map(|p| Ok(Aabb { lo: p, hi: p })).collect();
        robust(base).by_spread(&boxes, most).bits
    }

    #[test]
    fn what_fills_its_bounds_keeps_its_bits() {
        for extent in [1e-20, 1.0, 1e20] {
            assert_eq!(bits(extent, &[], 24, 64), 24, "{extent}");
            assert_eq!(bits(extent, &[], 16, 64), 16, "{extent}");
        }
        assert_eq!(bits(0.0, &[], 24, 64), 24, "at one place nothing is told apart");
    }

    #[test]
    fn a_section_costs_a_few_bits_however_far_it_is() {
        for far in [20.0, 1e6, 1e30] {
            assert_eq!(bits(1.0, &[[far; 3]], 24, 64), 32, "{far}");
            assert_eq!(bits(1.0, &[[far, 0.5, 0.5]], 24, 64), 32, "{far}");
        }
    }

    #[test]
    fn more_are_taken_the_less_of_the_bounds_is_filled_and_no_more_than_there_are() {
        // Two thirds in the cube, the others evenly around it, and not beyond the fences.
        let around = |extent: f32| -> Vec<[f32; 3]> {
            let at = |k: u32| extent * ((k as f32 + 0.5) / 8.0 - 0.5) + 0.5;
            (0..512).map(|i| [at(i % 8), at(i / 8 % 8), at(i / 64)]).collect()
        };
        assert_eq!(bits(1.0, &around(1.0), 24, 64), 24);
        assert_eq!(bits(1.0, &around(3.9), 24, 64), 32);
        // A bit an axis and two of the section, of which 24 bits have none to spare.
        let mut far = around(3.9);
        far.push([1e9; 3]);
        assert_eq!((bits(1.0, &far, 24, 64), bits(1.0, &far, 24, 24)), (32, 24));
    }

    #[test]
    fn an_axis_along_which_most_lie_close_together_takes_more() {
        // A thousand have quartiles 0.0012 apart along z, where two hundred others reach 0.23: six halvings come before cells are
        // smaller than twice that. Of 24 bits 21 are of coordinates, of 32 bits 28; and two are of the section.
        let around = |i: u32| [i % 6, i / 6 % 6, i / 36].map(|k| (k as f32 + 0.5) / 6.0);
        let mut others: Vec<[f32; 3]> = (0..216).map(around).map(|[x, y, z]| [x, y, 0.25 * z]).collect();
        assert_eq!(bits_in([1.0, 1.0, 0.002], &others, 24, 64), 32);
        others.push([1e9; 3]);
        assert_eq!(bits_in([1.0, 1.0, 0.002], &others, 24, 64), 40);
    }

    #[test]
    fn so_many_far_ones_that_they_count_as_the_scene_are_what_is_told_apart() {
        let half = |far: f32| [vec![[far; 3]; 600], vec![[-far; 3]; 600]].concat();
        assert_eq!([0.5, 1e3, 1e9].map(|far| bits(1.0, &half(far), 24, 64)), [24; 3]);
    }

    #[test]
    fn nothing_at_all_keeps_its_bits_and_so_do_codes_by_other_bounds() {
        let none: [Result<Aabb, u32>; 2] = [Err(1), Err(2)];
        assert_eq!(robust(24).by_spread(&none, 64), robust(24));
        let full = Code::Emc64Var.full().with_bits(24);
        let far = [Ok::<_, u32>(Aabb { lo: [0.0; 3], hi: [0.0; 3] }), Ok(Aabb { lo: [1e9; 3], hi: [1e9; 3] })];
        assert_eq!(full.by_spread(&far, 64), full);
    }
}
