//! When a cell is split no further (Papay 2025, section 9.2, after Vinkler, Havran and Bittner 2016).

/// The depth below which no cell lies: 2 + 1.2·log₂(`primitives`), rounded up, which gives every D_MAX of the thesis' appendix D;
/// the root has depth 0.
pub fn depth_limit(primitives: u32) -> u32 {
    (2.0 + 1.2 * f64::from(primitives.max(1)).log2()).ceil() as u32
}

/// Cells of fewer references than this are leaves: 2 in small scenes, 8 in those of around a million primitives, 12 in large
/// ones. The thesis draws the lines at 700 thousand and at 3 million, and says nothing of what lies between: 8 holds there.
pub fn leaf_size(primitives: u32) -> u32 {
    match primitives {
        0..700_000 => 2,
        700_000..=3_000_000 => 8,
        _ => 12,
    }
}

/// The costs of the surface area heuristic (Papay 2025, section 2.2): K_T and K_I.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Costs {
    /// Of a traversal step.
    pub c_t: f32,
    /// Of a triangle test.
    pub c_i: f32,
}

impl Costs {
    /// 3 and 2, those of records unless asked otherwise (CONTRACT) and of Frantál 2019. The thesis' own are not in the text that is
    /// left of it.
    pub const DEFAULT: Costs = Costs { c_t: 3.0, c_i: 2.0 };

    /// Whether it can be a cost: 0.001 to 1000.
    pub fn check(cost: f32) -> bool {
        (1e-3..=1e3).contains(&cost)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kdtree::layout::MAX_DEPTH;

    #[test]
    fn limits_follow_the_thesis() {
        assert_eq!([0, 1, 2, 1024].map(depth_limit), [2, 2, 4, 14]);
        // Appendix D: Sibenik, Conference, Fairy Forest, Sponza, Street, Buddha, Field, Bistro, San Miguel, Power Plant.
        let primitives =
            [75_284, 124_619, 174_117, 262_267, 961_430, 1_087_474, 3_669_924, 3_878_729, 9_963_191, 12_701_147];
        assert_eq!(primitives.map(depth_limit), [22, 23, 23, 24, 26, 27, 29, 29, 30, 31]);
        assert_eq!([0, 699_999, 700_000, 3_000_000, 3_000_001].map(leaf_size), [2, 2, 8, 8, 12]);
        assert!(depth_limit(u32::MAX) <= MAX_DEPTH);
    }
}
