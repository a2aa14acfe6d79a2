//! The same codes faster, for builders on the host: a bit of a coordinate always lands on the same bit of the code, so what the
//! bytes of coordinates make of a code is looked up.

use super::axis::Cells;
use super::plan::{CodePlan, Prefix};
use super::recipe::Recipe;
use crate::geometry::Aabb;

/// What each value of a byte makes of the code.
type OfByte = [u64; 256];

/// Encodes as [`CodePlan::encode`] does, in less time where the code has no grid.
#[doc(hidden)]
#[derive(Debug)]
pub struct CodeTables<'a> {
    plan: &'a CodePlan,
    /// Of each coordinate's bytes from the top, those that the code has bits of.
    coordinates: [Vec<OfByte>; 3],
    /// Of the upper and the lower byte of the size.
    size: [OfByte; 2],
    /// Whether the code takes any of it.
    has_recipe: bool,
    /// The bits of coordinates that the code takes, where that is all and doubles tell them.
    cells: Option<[Cells; 3]>,
}

/// What a byte makes of the code whose bits make `of_bit` of it.
fn of_byte(of_bit: impl Fn(u32) -> u64) -> OfByte {
    let mut table = [0; 256];
    for bit in 0..8 {
        let code = of_bit(bit);
        let (known, next) = table[..2 << bit].split_at_mut(1 << bit);
        next.iter_mut().zip(known).for_each(|(next, known)| *next = *known | code);
    }
    table
}

impl<'a> CodeTables<'a> {
    /// The tables of a plan.
    pub fn new(plan: &'a CodePlan) -> CodeTables<'a> {
        let recipe: &Recipe = &plan.recipe;
        let (group, bits) = (plan.codes.code.size_group(), plan.codes.bits);
        let has_recipe = matches!(plan.prefix, Prefix::None | Prefix::Sections(_));
        let coordinates: [Vec<OfByte>; 3] = std::array::from_fn(|axis| {
            let taken = recipe.sequence.iter().filter(|&&of| of == axis).count() as u32;
            let of = |coordinate| {
                let mut coordinates = [0; 3];
                coordinates[axis] = coordinate;
                recipe.encode(coordinates, 0, group, bits)
            };
            let bytes = if has_recipe { taken.div_ceil(8) } else { 0 };
            (0..bytes).map(|byte| of_byte(|bit| of(1 << (56 - 8 * byte + bit)))).collect()
        });
        let size = [8, 0].map(|shift| of_byte(|bit| recipe.encode([0; 3], 1 << (shift + bit), group, bits)));
        let cells = |axis: usize| Cells::new(&plan.axes[axis], 8 * coordinates[axis].len().max(1) as u32);
        let cells = match (&plan.prefix, cells(0), cells(1), cells(2)) {
            (Prefix::None, Some(x), Some(y), Some(z)) => Some([x, y, z]),
            _ => None,
        };
        CodeTables { plan, coordinates, size, has_recipe, cells }
    }

    /// [`CodePlan::encode`].
    #[inline]
    pub fn encode(&self, primitive: &Aabb) -> u64 {
        if let Some(coordinates) = self.coordinates_of(primitive) {
            return self.code(coordinates, self.plan.size_of(primitive)).min(self.plan.inactive() - 1);
        }
        match self.has_recipe {
            true => self.plan.encode_with(primitive, |coordinates, size| self.code(coordinates, size)),
            false => self.plan.encode(primitive),
        }
    }

    /// The coordinates as far as the code takes them, where they are told fast.
    #[inline]
    fn coordinates_of(&self, primitive: &Aabb) -> Option<[u64; 3]> {
        let [x, y, z] = self.cells.as_ref()?;
        let [at_x, at_y, at_z] = primitive.centroid();
        Some([x.fraction(at_x)?, y.fraction(at_y)?, z.fraction(at_z)?])
    }

    /// What the recipe makes of coordinates and a size.
    #[inline]
    fn code(&self, coordinates: [u64; 3], size: u32) -> u64 {
        let mut code = self.size[0][(size >> 8) as usize & 0xFF] | self.size[1][size as usize & 0xFF];
        for (tables, coordinate) in self.coordinates.iter().zip(coordinates) {
            for (table, byte) in tables.iter().zip(coordinate.to_be_bytes()) {
                code |= table[byte as usize];
            }
        }
        code
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Binning, Code, CodeBounds};
    use super::*;

    /// Scenes of boxes of all sizes: a cube, a line, a plate, far and huge boxes, one point, tiny and huge coordinates.
    fn scenes() -> Vec<Vec<Aabb>> {
        let mut state = 1u64;
        let mut random = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1 << 24) as f32
        };
        let mut scene = |extent: [f32; 3], at: f32| -> Vec<Aabb> {
            (0..300)
                .map(|i| {
                    let lo = extent.map(|e| at + e * (random() - 0.5));
                    let size = if i % 7 == 0 { 0.5 } else { 0.01 * random() };
                    Aabb { lo, hi: std::array::from_fn(|axis| lo[axis] + size * extent[axis]) }
                })
                .collect()
        };
        let mut scenes: Vec<_> = [
            ([1.0; 3], 0.0),
            ([1.0, 1e-3, 40.0], -17.0),
            ([100.0, 0.0, 3.0], 1e6),
            ([0.0; 3], 5.0),
            ([1e30; 3], 0.0),
            ([1e-30, 3e-30, 1e-31], 0.0),
            ([3e38, 1.0, 3e38], 0.0),
        ]
        .map(|(extent, at)| scene(extent, at))
        .into();
        let mut far = scene([1.0; 3], 0.0);
        far.push(Aabb { lo: [1e9; 3], hi: [1.1e9; 3] });
        far.push(Aabb { lo: [-0.1, -2e10, 0.0], hi: [0.1, 2e10, 0.1] });
        scenes.push(far);
        scenes
    }

    #[test]
    fn tables_give_the_codes_of_the_plan() {
        let binnings = [Binning::new(2, 0, 1), Binning::new(6, 9, 2048)].map(|b| Code::Bin(b.expect("known")));
        for boxes in scenes() {
            let boxes: Vec<Result<Aabb, u32>> = boxes.into_iter().map(Ok).collect();
            for code in Code::ALL.into_iter().chain(binnings) {
                for bounds in CodeBounds::ALL {
                    for bits in [1, 7, 8, 13, 29, 30, 32, 40, 56, 63, 64] {
                        let Some(codes) = code.full().with_bounds(bounds) else { continue };
                        let plan = CodePlan::new(codes.with_bits(bits), &boxes);
                        let tables = CodeTables::new(&plan);
                        for b in boxes.iter().flatten() {
                            assert_eq!(tables.encode(b), plan.encode(b), "{codes}/{bits} {b:?}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn a_plan_of_known_bounds_is_that_of_the_boxes() {
        for boxes in scenes() {
            let boxes: Vec<Result<Aabb, u32>> = boxes.into_iter().map(Ok).collect();
            let all = boxes.iter().flatten().fold(Aabb::EMPTY, |all, b| all.union(b));
            let point = |b: &Aabb| Aabb { lo: b.centroid(), hi: b.centroid() };
            let centroids = boxes.iter().flatten().fold(Aabb::EMPTY, |all, b| all.union(&point(b)));
            for code in Code::ALL {
                for bounds in CodeBounds::ALL {
                    let Some(codes) = code.full().with_bounds(bounds) else { continue };
                    let needs_boxes = codes.has_grid() || bounds.has_sections();
                    let Some(plan) = CodePlan::of_bounds(codes, &all, || centroids) else {
                        assert!(needs_boxes);
                        continue;
                    };
                    assert!(!needs_boxes);
                    let of_boxes = CodePlan::new(codes, &boxes);
                    assert!(boxes.iter().flatten().all(|b| plan.encode(b) == of_boxes.encode(b)));
                }
            }
        }
    }
}
