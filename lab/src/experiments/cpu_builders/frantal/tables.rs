//! The tables of Frantál 2019, line by line: what of each can be had here.

/// How far figures compare.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Comparable {
    /// On the same mesh as they are; elsewhere as ratios.
    Absolute,
    /// As ratios over the full sweep.
    Ratios,
    /// Not here.
    No,
}

impl Comparable {
    /// In a word.
    pub fn name(self) -> &'static str {
        match self {
            Comparable::Absolute => "figures",
            Comparable::Ratios => "ratios",
            Comparable::No => "not here",
        }
    }
}

/// A table.
pub struct Line {
    /// Its number.
    pub table: u32,
    /// What it holds.
    pub holds: &'static str,
    /// How far it compares.
    pub compares: Comparable,
    /// Where it stands here, or why it does not.
    pub here: &'static str,
}

const fn line(table: u32, holds: &'static str, compares: Comparable, here: &'static str) -> Line {
    Line { table, holds, compares, here }
}

const ON_DRAGON: &str = "The dragon is the same mesh.";
const OTHER_MACHINE: &str = "The machine is another: times as ratios over sweep.";
const OTHER_CAMERA: &str = "Cameras differ: ratios over sweep.";
const USER: &str = "User times of serial programs are their real times: see the table before.";
const DERIVED: &str = "Follows from other tables: see 38 to 41.";

/// All tables of figures, in order.
#[rustfmt::skip]
pub const TABLES: [Line; 37] = [
    line(9, "SAH cost, to verify against the papers", Comparable::Absolute, "Two of its figures are the dragon's: full sweep with one triangle a leaf (sweep:collapse=off), and after optimisation, which is table 38. BIN and BP0 to BP2 have other costs there."),
    line(10, "SAH cost", Comparable::Absolute, ON_DRAGON),
    line(11, "build, real time", Comparable::Ratios, "The machine is another, and its full sweep sorts in every node: ratios over a slower base than ours."),
    line(12, "build, user time", Comparable::No, USER),
    line(13, "rendering, primary rays, real time", Comparable::Ratios, OTHER_MACHINE),
    line(14, "rendering, primary rays, user time", Comparable::No, USER),
    line(15, "steps a primary ray", Comparable::Ratios, OTHER_CAMERA),
    line(16, "tests a primary ray", Comparable::Ratios, OTHER_CAMERA),
    line(17, "references a leaf", Comparable::Absolute, ON_DRAGON),
    line(18, "Σ area of inner nodes", Comparable::Absolute, ON_DRAGON),
    line(19, "Σ area of leaves × triangles", Comparable::Absolute, ON_DRAGON),
    line(20, "insertion-based optimisation, relative", Comparable::No, DERIVED),
    line(21, "SAH cost after it, summary", Comparable::No, DERIVED),
    line(22, "rendering after it, summary", Comparable::No, DERIVED),
    line(23, "Σ area of inner nodes after it, summary", Comparable::No, DERIVED),
    line(24, "parallel binning", Comparable::Ratios, "All threads over one: the section above."),
    line(25, "EMC64VAR: SAH cost and build, percent", Comparable::Ratios, "As ratios over sweep, in the rows +EMC; the dragon's two sums stand in table 45."),
    line(26, "EMC64VAR: rendering, percent", Comparable::No, "Follows from table 43."),
    line(27, "EMC64VAR: SAH cost, summary", Comparable::No, "Follows from table 25."),
    line(28, "EMC64VAR: build, summary", Comparable::No, "Follows from table 25."),
    line(29, "EMC64VAR: rendering, summary", Comparable::No, "Follows from table 43."),
    line(30, "rendering, primary and shadow rays, real time", Comparable::Ratios, "The machine and the lights are others: ratios over sweep."),
    line(31, "rendering, primary and shadow rays, user time", Comparable::No, USER),
    line(32, "steps a primary or shadow ray", Comparable::No, "The dragon's equal those of table 15: its light makes no shadow rays. Our lights are others."),
    line(33, "tests a primary or shadow ray", Comparable::No, "As table 32, with table 16."),
    line(34, "rendering, random rays, real time", Comparable::Ratios, "The machine is another, and the sphere of the rays may be: ratios over sweep."),
    line(35, "rendering, random rays, user time", Comparable::No, USER),
    line(36, "steps a random ray", Comparable::No, "The sphere there does not follow the scene's size: 41 steps for the dragon, 0.8 for the Happy Buddha."),
    line(37, "tests a random ray", Comparable::No, "As table 36."),
    line(38, "SAH cost and time of insertion-based optimisation", Comparable::Absolute, "Costs on the dragon. Times as ratios: a build with optimisation over sweep."),
    line(39, "both sums and references a leaf after it", Comparable::Absolute, ON_DRAGON),
    line(40, "steps and tests a primary ray after it", Comparable::Ratios, OTHER_CAMERA),
    line(41, "rendering after it", Comparable::Ratios, OTHER_MACHINE),
    line(42, "EMC64VAR: build, and references a leaf", Comparable::Absolute, "References on the dragon; times as table 25 has them."),
    line(43, "EMC64VAR: rendering", Comparable::Ratios, OTHER_MACHINE),
    line(44, "EMC64VAR: steps and tests", Comparable::Ratios, OTHER_CAMERA),
    line(45, "EMC64VAR: both sums", Comparable::Absolute, ON_DRAGON),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_table_from_9_to_45_has_one_line() {
        let numbers: Vec<u32> = TABLES.iter().map(|line| line.table).collect();
        assert_eq!(numbers, (9..=45).collect::<Vec<_>>());
    }
}
