//! Morton codes and extended Morton codes: where a primitive lies, as one number whose order is a space-filling curve.
//!
//! Lauterbach et al. 2009 for the plain codes; Vinkler, Bittner, Havran 2017 for the extended ones, after Frantál 2019,
//! section 3.7, and Riemersma 2024, section 2.4.3.
//!
//! Every code is the same recipe with other ingredients: a *sequence* of axes, from the top bit down, of which each takes the
//! next bit of that axis' coordinate (`recipe.rs`); and, at regular intervals, one bit of the primitive's size (`size.rs`). What far
//! primitives would cost, others save by a *prefix* that says in which part of the scene a primitive lies, followed by the code
//! within that part: occupied cells (`mipping.rs`), splits of a counted grid (`binning.rs`), or sections around robust bounds
//! (`sections.rs`). [`CodePlan`] is all of it for a given scene; `glsl/bvh/codes.glsl` cooks by the same one and gives the same
//! bits on every device: no division, square root or contraction that a driver may round its own way is trusted.
//!
//! `docs/notes/codes.md` compares them.

mod axis;
mod binning;
mod bounds;
mod for_device;
mod mipping;
mod name;
mod plan;
mod recipe;
mod sections;
mod size;
mod spread;
mod tables;

pub use binning::Binning;
pub use bounds::CodeBounds;
pub use plan::CodePlan;
pub(crate) use sections::{fences_around, is_apart};
#[doc(hidden)]
pub use tables::CodeTables;

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
    /// The same with every fourth bit one of the size.
    Emc64VarSize4,
    /// As [`Code::Emc64VarSize4`], but a bit of the size says whether the primitive is too long for its cell along some axis: what
    /// Riemersma 2024, section 5, names as future work.
    Emc64VarExtents,
    /// As [`Code::Emc64Var`], without the size.
    Emc64VarNoSize,
    /// Mipping (Riemersma 2024, 3.2.2): of the first 6 bits of [`Code::Emc64VarNoSize`], those that tell occupied cells apart, and
    /// as many more behind them.
    Mip6,
    /// The same of 9 bits.
    Mip9,
    /// The same of 12 bits.
    Mip12,
    /// Binning (Riemersma 2024, 3.2.3): splits of a counted grid by the SAH, and [`Code::Emc64VarNoSize`] within each part.
    Bin(Binning),
}

/// A code, the bounds it is normalised by, and how many of its bits are used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Codes {
    /// Which code.
    pub code: Code,
    /// What it is normalised by.
    pub bounds: CodeBounds,
    /// How many bits, from the top: [`Codes::least_bits`] to [`Code::bits`].
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
    /// All codes; of binning the split depth and the counts that the thesis finds balanced.
    pub const ALL: [Code; 11] = [
        Code::Mc30,
        Code::Mc63,
        Code::Emc64Sort,
        Code::Emc64Var,
        Code::Emc64VarSize4,
        Code::Emc64VarExtents,
        Code::Emc64VarNoSize,
        Code::Mip6,
        Code::Mip9,
        Code::Mip12,
        Code::Bin(Binning::Q4_A4),
    ];

    /// The code's full length in bits.
    pub const fn bits(self) -> u32 {
        match self {
            Code::Mc30 => 30,
            Code::Mc63 => 63,
            _ => 64,
        }
    }

    /// The code with all its bits and the bounds of all boxes.
    pub const fn full(self) -> Codes {
        Codes { code: self, bounds: CodeBounds::Full, bits: self.bits() }
    }

    /// Coordinate bits between two bits of the size; 0 for codes without.
    pub(crate) const fn size_group(self) -> u32 {
        match self {
            Code::Emc64Sort | Code::Emc64VarSize4 | Code::Emc64VarExtents => 3,
            Code::Emc64Var => 6,
            _ => 0,
        }
    }

    fn order(self) -> Order {
        match self {
            Code::Mc30 | Code::Mc63 => Order::Regular,
            Code::Emc64Sort => Order::Sorted,
            _ => Order::Variable,
        }
    }

    /// Bits of the occupancy grid of mipping; 0 for other codes.
    pub(crate) const fn grid_bits(self) -> u32 {
        match self {
            Code::Mip6 => 6,
            Code::Mip9 => 9,
            Code::Mip12 => 12,
            _ => 0,
        }
    }
}

impl Codes {
    /// The first `bits` bits of the code: no more than it has, no fewer than its prefix takes.
    pub fn with_bits(self, bits: u32) -> Codes {
        Codes { bits: bits.clamp(self.least_bits(), self.code.bits()), ..self }
    }

    /// The same normalised by other bounds; `None` where the code has no such bounds: those with a grid cannot have
    /// [`CodeBounds::Robust`] or [`CodeBounds::Apart`].
    pub fn with_bounds(self, bounds: CodeBounds) -> Option<Codes> {
        (!bounds.has_sections() || !self.has_grid()).then(|| Codes { bounds, ..self }.with_bits(self.bits))
    }

    /// The bits of the longest prefix, at least 1.
    pub fn least_bits(&self) -> u32 {
        match (self.code, self.bounds) {
            (Code::Bin(binning), _) => binning.depth(),
            (_, bounds) if bounds.has_sections() => sections::PREFIX_BITS,
            (code, _) => code.grid_bits().max(1),
        }
    }

    /// Whether there is a grid of cells that must be counted first.
    pub(crate) fn has_grid(&self) -> bool {
        self.code.grid_bits() > 0 || matches!(self.code, Code::Bin(_))
    }

    /// Of the used bits, those that hold coordinates.
    pub(crate) fn coordinate_bits(&self) -> u32 {
        match self.code.size_group() {
            0 => self.bits,
            group => self.bits - self.bits / (group + 1),
        }
    }
}
