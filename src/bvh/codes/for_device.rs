//! Codes as the shaders take them: `CodeKind` and `CODE_PREFIX` in codes.glsl.

use super::{Code, CodeBounds, Codes};

/// Words of a grid: 2¹² bits or 2⁷ counts.
const CELL_WORDS: u64 = 128;
/// Words of `CodePart` in code_binning.glsl, of which there are at most 64.
const PART_WORDS: u64 = 26;
/// Of `Sample` in codes/quartiles.glsl: 256 centroids.
const SAMPLE_WORDS: u64 = 256 * 3;

impl Codes {
    /// `CODE_PREFIX_WORD` in codes.glsl, which kernels are specialised by, so that codes do not pay for what others have.
    pub(crate) fn prefix_constant(&self) -> u32 {
        self.prefix_number() | u32::from(self.code == Code::Emc64VarExtents) << 2
    }

    /// `PREFIX_…` in codes.glsl.
    fn prefix_number(&self) -> u32 {
        match (self.code, self.bounds) {
            (Code::Bin(_), _) => 3,
            (code, _) if code.grid_bits() > 0 => 2,
            (_, bounds) if bounds.has_sections() => 1,
            _ => 0,
        }
    }

    /// Words of memory between the bounds and the sort.
    pub(crate) fn prefix_words(&self) -> u64 {
        match self.prefix_number() {
            0 => 0,
            1 => SAMPLE_WORDS,
            // The layers above the cells have a seventh of them.
            2 => CELL_WORDS + CELL_WORDS / 4,
            _ => CELL_WORDS + 64 * PART_WORDS,
        }
    }

    /// In the word of [`Codes::kind_word`], that the device takes as many bits as the primitives' spread needs.
    pub(crate) const BY_SPREAD: u32 = 1 << 23;

    /// What `kind_of_codes` in build_state.glsl takes apart.
    pub(crate) fn kind_word(&self) -> u32 {
        let apart = self.bounds == CodeBounds::Apart;
        let (depth, count_bits, stretch) = match self.code {
            Code::Bin(binning) => (binning.depth() / 2, binning.count_bits(), binning.stretch()),
            // Two bits: layers but one.
            code => ((code.grid_bits() / 3).saturating_sub(1), 0, 1),
        };
        self.code.order() as u32
            | (if apart { CodeBounds::Robust } else { self.bounds } as u32) << 2
            | u32::from(apart) << 24
            | depth << 4
            | (self.code.size_group() / 3) << 6
            | self.bits << 8
            | count_bits << 15
            | stretch.ilog2() << 19
    }
}
