//! Binning: the first splits by the SAH of a coarse counted grid (Riemersma 2024, section 3.2.3 and appendix 8.2).
//!
//! A grid of 2⁷ cells counts the centroids. Its cells are numbered by the bits of the shortest axis, then the middle, then the
//! longest (the layout s-m-l): a box of cells is then a mask of four words with runs of bits, which the device counts by. A
//! count becomes a weight: 1, for the cell is occupied, plus its place between the least and the largest count as a fraction of
//! A bits. Q times, every box of cells is split by the plane with the least score: the SAH over cells (equation 10) and the
//! stretch factor (9), weighted by λ (11).
//!
//! The thesis prints (λ − 1) · SAH' + λ · SF for the score, here and in appendix 8.2.2, and takes the minimum of scores (8.2.1: an
//! atomic minimum). With λ below 1 that would look for the *largest* SAH cost; it must be (1 − λ), which is what is done here.
//!
//! A primitive's code is the path to its part, only the splits that there are, followed by a code within the cells of that
//! part: a part that is one cell is not split, and costs no bits.

use super::Order;
use super::mipping::top;
use super::plan::prefixed;
use super::recipe::{Extents, Recipe};

/// Bits of the grid.
const GRID_BITS: u32 = 7;

/// The parameters of binning.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Binning {
    depth: u8,
    count_bits: u8,
    stretch: u16,
}

impl Binning {
    /// 1/λ by default.
    pub const STRETCH: u32 = 8;
    /// 1/λ at most: as far as the thesis' tables 8 to 11 go.
    pub const STRETCH_MAX: u32 = 2048;
    /// Splits of depth 4, counts of 4 bits: the thesis' balance of time and quality.
    pub const Q4_A4: Binning = Binning { depth: 4, count_bits: 4, stretch: 8 };

    /// Splits of depth 2, 4 or 6, counts of 0 to 9 bits, and the stretch factor weighted by λ = 1/`stretch`, a power of two to
    /// [`Binning::STRETCH_MAX`]; `None` for anything else.
    pub const fn new(depth: u32, count_bits: u32, stretch: u32) -> Option<Binning> {
        let is_known = matches!(depth, 2 | 4 | 6)
            && count_bits <= 9
            && stretch.is_power_of_two()
            && stretch <= Binning::STRETCH_MAX;
        if is_known {
            Some(Binning { depth: depth as u8, count_bits: count_bits as u8, stretch: stretch as u16 })
        } else {
            None
        }
    }

    /// How often parts are split, at most.
    pub const fn depth(self) -> u32 {
        self.depth as u32
    }

    /// Bits of a cell's count.
    pub const fn count_bits(self) -> u32 {
        self.count_bits as u32
    }

    /// 1/λ, of the stretch factor's weight λ.
    pub const fn stretch(self) -> u32 {
        self.stretch as u32
    }
}

/// A box of cells, both corners included.
type Cells = [[u32; 3]; 2];

/// A part of the grid and the code within it.
#[derive(Debug, Clone)]
struct BinPart {
    cells: Cells,
    /// The splits on the way to it.
    path: u32,
    length: u32,
    recipe: Recipe,
}

/// The splits of a scene.
#[derive(Debug, Clone)]
pub(super) struct Splits {
    grid: Grid,
    parts: Vec<BinPart>,
    /// Part of each cell.
    part_of: Vec<usize>,
}

#[derive(Debug, Clone)]
struct Grid {
    /// Bits of each axis.
    bits: [u32; 3],
    /// Bit of the cell number at which each axis begins.
    shift: [u32; 3],
    /// Edge of a cell along each axis, of 255.
    edge: [u32; 3],
    weight: Vec<u32>,
}

impl Grid {
    fn cell_of(&self, coordinates: [u128; 3]) -> [u32; 3] {
        std::array::from_fn(|i| (coordinates[i] >> (96 - self.bits[i])) as u32)
    }

    fn number(&self, cell: [u32; 3]) -> usize {
        (0..3).map(|i| cell[i] << self.shift[i]).sum::<u32>() as usize
    }

    fn cell(&self, number: usize) -> [u32; 3] {
        std::array::from_fn(|i| number as u32 >> self.shift[i] & ((1 << self.bits[i]) - 1))
    }

    /// The weight in a box and the smallest box around what is occupied there.
    fn tight(&self, cells: Cells) -> (u32, Cells) {
        let mut tight = [[u32::MAX; 3], [0; 3]];
        let mut weight = 0;
        for (number, &of_cell) in self.weight.iter().enumerate().filter(|(_, w)| **w > 0) {
            let cell = self.cell(number);
            if (0..3).all(|i| (cells[0][i]..=cells[1][i]).contains(&cell[i])) {
                weight += of_cell;
                tight = [
                    std::array::from_fn(|i| tight[0][i].min(cell[i])),
                    std::array::from_fn(|i| tight[1][i].max(cell[i])),
                ];
            }
        }
        (weight, tight)
    }

    fn lengths(&self, cells: Cells) -> [u32; 3] {
        std::array::from_fn(|i| (cells[1][i] - cells[0][i] + 1) * self.edge[i])
    }

    fn half_area(&self, cells: Cells) -> u32 {
        let [x, y, z] = self.lengths(cells);
        x * y + y * z + z * x
    }

    /// Equation 9, of 256.
    fn stretch_factor(&self, cells: Cells) -> u32 {
        let lengths = self.lengths(cells);
        let (least, most) = lengths.iter().fold((u32::MAX, 1), |(least, most), &l| (least.min(l), most.max(l)));
        ((most - least.min(most)) << 8) / most
    }

    /// Equation 11 for two boxes out of one, times 1/λ, the weight and the area of the one: integers, which compare the same
    /// everywhere.
    fn score(&self, parent: Cells, children: [Cells; 2], stretch: u32) -> u64 {
        let (weight, parent) = self.tight(parent);
        let (mut sah, mut factors) = (0, 0);
        for child in children {
            let (weight, child) = self.tight(child);
            sah += u64::from(weight) * u64::from(self.half_area(child));
            factors += u64::from(self.stretch_factor(child));
        }
        u64::from(stretch - 1) * sah + ((factors * u64::from(weight) * u64::from(self.half_area(parent))) >> 8)
    }

    /// The boxes below the plane with the least score, of x before y before z and from the low side where scores are equal;
    /// `None` for a single cell.
    fn split(&self, cells: Cells, stretch: u32) -> Option<[Cells; 2]> {
        let planes = (0..3).flat_map(|axis| (cells[0][axis] + 1..=cells[1][axis]).map(move |plane| (axis, plane)));
        let halves = planes.map(|(axis, plane)| {
            let mut halves = [cells; 2];
            halves[0][1][axis] = plane - 1;
            halves[1][0][axis] = plane;
            halves
        });
        let best = halves.min_by_key(|&halves| self.score(cells, halves, stretch))?;
        Some(best.map(|half| self.tight(half).1))
    }
}

/// A count between the least and the largest as a fraction of `bits` bits.
fn fraction(count: u32, least: u32, most: u32, bits: u32) -> u32 {
    (u64::from(count - least) << bits).div_euclid(u64::from(most - least + 1)) as u32
}

impl Splits {
    /// The splits of a grid over bounds of these extents that counts `centroids`, and codes of `bits` bits.
    pub fn new(
        binning: Binning,
        mut extents: Extents,
        bits: u32,
        centroids: impl Iterator<Item = [u128; 3]>,
    ) -> Splits {
        let axes = extents.sorted();
        let mut of_axis = [0; 3];
        for _ in 0..GRID_BITS {
            of_axis[extents.halve()] += 1;
        }
        let mut shift = [0; 3];
        [shift[axes[0]], shift[axes[1]], shift[axes[2]]] = [0, of_axis[axes[0]], of_axis[axes[0]] + of_axis[axes[1]]];
        let mut grid = Grid { bits: of_axis, shift, edge: extents.relative(), weight: vec![0; 1 << GRID_BITS] };
        for coordinates in centroids {
            let number = grid.number(grid.cell_of(coordinates));
            grid.weight[number] += 1;
        }
        let occupied = || grid.weight.iter().copied().filter(|&count| count > 0);
        let (least, most) = (occupied().min().unwrap_or(1), occupied().max().unwrap_or(1));
        for count in &mut grid.weight {
            *count = if *count == 0 { 0 } else { 1 + fraction(*count, least, most, binning.count_bits()) };
        }

        let (_, all) = grid.tight([[0; 3], of_axis.map(|bits| (1 << bits) - 1)]);
        let mut parts = vec![(all, 0u32, 0u32)];
        for _ in 0..binning.depth() {
            let split = |(cells, path, length): (Cells, u32, u32)| match grid.split(cells, binning.stretch()) {
                Some([left, right]) => vec![(left, path << 1, length + 1), (right, path << 1 | 1, length + 1)],
                None => vec![(cells, path, length)],
            };
            parts = parts.into_iter().flat_map(split).collect();
        }
        let parts: Vec<BinPart> = parts
            .into_iter()
            .map(|(cells, path, length)| {
                let within = extents.times(std::array::from_fn(|i| cells[1][i] - cells[0][i] + 1));
                BinPart { cells, path, length, recipe: within.recipe(Order::Variable, bits) }
            })
            .collect();
        let holds =
            |part: &BinPart, cell: [u32; 3]| (0..3).all(|i| (part.cells[0][i]..=part.cells[1][i]).contains(&cell[i]));
        let part_of = (0..1 << GRID_BITS)
            .map(|number| parts.iter().position(|part| holds(part, grid.cell(number))).unwrap_or(0))
            .collect();
        Splits { grid, parts, part_of }
    }

    /// The code of a place, given as fractions of 96 bits.
    pub fn encode(&self, coordinates: [u128; 3], bits: u32) -> u64 {
        let cell = self.grid.cell_of(coordinates);
        let part = &self.parts[self.part_of[self.grid.number(cell)]];
        // Where it lies in the part, as a fraction of it.
        let within = std::array::from_fn(|i| {
            let [first, last] = part.cells.map(|corner| u128::from(corner[i]));
            let from_first = coordinates[i] - (first << (96 - self.grid.bits[i]));
            top((from_first / (last - first + 1)) << self.grid.bits[i])
        });
        prefixed(part.path, part.length, part.recipe.encode(within, 0, 0, bits), bits)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Splits of a thin line of 128 cells along x of which these are occupied.
    fn line(binning: Binning, cells: &[u64]) -> Splits {
        Splits::new(binning, Extents::new([1.0, 0.004, 0.004]), 64, cells.iter().map(|&c| [u128::from(c) << 89, 0, 0]))
    }

    #[test]
    fn counts_become_fractions() {
        assert_eq!([0, 1, 500, 1000].map(|c| fraction(1 + c, 1, 1001, 2)), [0, 0, 1, 3]);
        assert_eq!(fraction(7, 7, 7, 9), 0);
    }

    #[test]
    fn the_first_split_is_where_the_emptiness_is() {
        let splits = line(Binning::Q4_A4, &[0, 1, 2, 3, 90, 91]);
        let first = [0, 1, 2, 3, 90, 91].map(|cell: u128| splits.encode([cell << 89, 0, 0], 64) >> 63);
        assert_eq!(first, [0, 0, 0, 0, 1, 1]);
    }

    #[test]
    fn a_part_that_is_one_cell_costs_no_more_bits() {
        let splits = line(Binning::new(6, 0, 8).expect("known"), &[0, 127]);
        assert!(splits.parts.iter().all(|part| part.length == 1));
        // In the cell of 2 by 1 by 1, x has the first bit; 1 bit is for the split.
        let near = |i: u128| splits.encode([i << 88, 0, 0], 64) >> 62;
        assert_eq!([near(0), near(1)], [0b00, 0b01]);
    }

    #[test]
    fn cells_are_numbered_shortest_axis_first() {
        let splits = Splits::new(Binning::Q4_A4, Extents::new([2.0, 4.0, 1.0]), 64, [[0; 3]].into_iter());
        assert_eq!((splits.grid.bits, splits.grid.shift), ([3, 3, 1], [3, 0, 6]));
    }

    #[test]
    fn parts_are_disjoint_and_hold_all_cells() {
        let cells: Vec<[u128; 3]> = (0..60).map(|i| [7919, 104_729, 31].map(|step| (i * step % 64) << 90)).collect();
        for depth in [2, 4, 6] {
            let binning = Binning::new(depth, 3, 8).expect("known");
            let splits = Splits::new(binning, Extents::new([1.0, 1.5, 1.2]), 64, cells.iter().copied());
            for &coordinates in &cells {
                let cell = splits.grid.cell_of(coordinates);
                let holding = splits
                    .parts
                    .iter()
                    .filter(|part| (0..3).all(|i| (part.cells[0][i]..=part.cells[1][i]).contains(&cell[i])));
                assert_eq!(holding.count(), 1);
            }
        }
    }
}
