//! Mipping: of the first bits of a code, only those that tell occupied cells apart (Riemersma 2024, section 3.2.2 and appendix
//! 8.1).
//!
//! The first bits of the code of a centroid are its cell in an *occupancy grid*, a bit a cell. Its mip layers merge eight cells
//! into one; from the top layer down, the byte of the eight cells around a primitive says which of the three next bits are
//! needed: those that have something on both sides. What follows is the same code continued below the cell.

use super::Order;
use super::plan::prefixed;
use super::recipe::{Extents, Recipe};

/// Which of the splits of eight cells have something on both sides, for each of the 256 ways to occupy them: bit 0 for the split in
/// the middle, bits 1 and 2 for those of the halves, bits 3 to 6 for those of the quarters.
const NEEDED: [u8; 256] = {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        let mut node = 0;
        while node < 7 {
            // The cells below the node, and how many of them are to its left.
            let (first, half) = match node {
                0 => (0, 4),
                1 | 2 => (4 * (node - 1), 2),
                _ => (2 * (node - 3), 1),
            };
            let side = (1 << half) - 1;
            if byte >> first & side != 0 && byte >> (first + half) & side != 0 {
                table[byte] |= 1 << node;
            }
            node += 1;
        }
        byte += 1;
    }
    table
};

/// The occupancy grid with its mip layers, and the recipes of cells and of what follows.
#[derive(Debug, Clone)]
pub(super) struct Occupancy {
    grid_bits: u32,
    cell: Recipe,
    rest: Recipe,
    /// Bits of each coordinate that the cell has.
    skipped: [u32; 3],
    /// From the top: the first has 8 cells, each other 8 times as many as the one before.
    layers: Vec<Vec<bool>>,
}

impl Occupancy {
    /// The grid of this many bits over bounds of these extents, occupied by `centroids`, and codes of `bits` bits.
    pub fn new(
        grid_bits: u32,
        mut extents: Extents,
        bits: u32,
        centroids: impl Iterator<Item = [u128; 3]>,
    ) -> Occupancy {
        let cell = extents.recipe(Order::Variable, grid_bits);
        let mut skipped = [0; 3];
        for _ in 0..grid_bits {
            skipped[extents.halve()] += 1;
        }
        let rest = extents.recipe(Order::Variable, bits);
        let mut base = vec![false; 1 << grid_bits];
        for coordinates in centroids {
            base[cell.encode(coordinates.map(top), 0, 0, grid_bits) as usize] = true;
        }
        let mut layers = vec![base];
        while layers[0].len() > 8 {
            let merged = layers[0].chunks(8).map(|cells| cells.contains(&true)).collect();
            layers.insert(0, merged);
        }
        Occupancy { grid_bits, cell, rest, skipped, layers }
    }

    /// The concise index of a cell: its needed bits, and how many they are.
    fn concise(&self, cell: u32) -> (u32, u32) {
        let (mut index, mut length) = (0, 0);
        for (layer, cells) in self.layers.iter().enumerate() {
            let below = self.grid_bits - 3 * (layer as u32 + 1);
            let byte = (cell >> below >> 3) as usize;
            let occupied = (0..8).fold(0, |bits, i| bits | usize::from(cells[8 * byte + i]) << i);
            let three = cell >> below & 7;
            for (bit, node) in [(2, 0), (1, 1 + (three >> 2)), (0, 3 + (three >> 1))] {
                if NEEDED[occupied] >> node & 1 != 0 {
                    index = index << 1 | three >> bit & 1;
                    length += 1;
                }
            }
        }
        (index, length)
    }

    /// The code of a place, given as fractions of 96 bits.
    pub fn encode(&self, coordinates: [u128; 3], bits: u32) -> u64 {
        let cell = self.cell.encode(coordinates.map(top), 0, 0, self.grid_bits) as u32;
        let (prefix, length) = self.concise(cell);
        let within = std::array::from_fn(|axis| top(coordinates[axis] << self.skipped[axis]));
        prefixed(prefix, length, self.rest.encode(within, 0, 0, bits), bits)
    }
}

/// The first 64 of 96 bits.
pub(super) fn top(fraction: u128) -> u64 {
    (fraction >> 32) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A line of 2^bits cells along x of which these are occupied.
    fn line(bits: u32, cells: &[u64]) -> Occupancy {
        let extents = Extents::new([1.0, 0.0, 0.0]);
        Occupancy::new(bits, extents, 64, cells.iter().map(|&c| [u128::from(c) << (96 - bits), 0, 0]))
    }

    #[test]
    fn the_table_of_needed_splits() {
        assert_eq!(NEEDED[0], 0);
        assert_eq!(NEEDED[255], 0b111_1111);
        assert_eq!(NEEDED[0b0001_0001], 1, "only the split in the middle");
        assert_eq!(NEEDED[0b0000_1001], 0b10, "only that of the lower half");
        assert_eq!(NEEDED[0b1100_0000], 0b100_0000, "only that of the last quarter");
    }

    #[test]
    fn a_concise_index_has_the_bits_that_tell_occupied_cells_apart() {
        let grid = line(6, &[0b000_000, 0b111_001, 0b111_011]);
        assert_eq!(grid.concise(0b000_000), (0, 1));
        assert_eq!(grid.concise(0b111_001), (0b10, 2));
        assert_eq!(grid.concise(0b111_011), (0b11, 2));
        let full = line(9, &(0..512).collect::<Vec<_>>());
        assert!((0..512).all(|cell| full.concise(cell) == (cell, 9)));
    }

    #[test]
    fn the_code_goes_on_below_the_cell() {
        let grid = line(9, &[0, 511]);
        // Of the code's 64 bits 1 is for the cell; the others are of the coordinate's 96 those behind the first 9.
        let near = |i: u128| grid.encode([i << (96 - 9 - 63), 0, 0], 64);
        assert_eq!([0, 1, 2, 77].map(near), [0, 1, 2, 77]);
        assert_eq!(grid.encode([511 << 87, 0, 0], 64) >> 63, 1);
    }
}
