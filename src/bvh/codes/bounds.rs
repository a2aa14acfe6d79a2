//! The bounds that codes are normalised by.

use crate::geometry::Aabb;

/// What codes are normalised by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum CodeBounds {
    /// The bounds of all boxes.
    Full,
    /// Those cut by the same from both sides as far as no centroid is lost, so that the first split stays in the middle
    /// (Riemersma 2024, equation 15).
    Concise,
    /// The bounds of all centroids.
    Centroid,
    /// Where there are far or huge primitives, bounds that leave them out, and sections of their own for them. Otherwise the bounds
    /// of all boxes.
    Robust,
    /// The same, but what is far stands apart from all others, right below the root, where robust bounds put it into a corner of the core. For
    /// trees in which rays begin at the rest ([`crate::bvh::far`]): a node around both would be met by nearly all of them.
    Apart,
}

impl CodeBounds {
    /// All bounds.
    pub const ALL: [CodeBounds; 5] =
        [CodeBounds::Full, CodeBounds::Concise, CodeBounds::Centroid, CodeBounds::Robust, CodeBounds::Apart];
    /// What stands behind the name of a code, for people.
    pub const NAMES: &str = "+concise, +centroid, +robust and +apart";

    pub(super) const fn name(self) -> &'static str {
        match self {
            CodeBounds::Full => "full",
            CodeBounds::Concise => "concise",
            CodeBounds::Centroid => "centroid",
            CodeBounds::Robust => "robust",
            CodeBounds::Apart => "apart",
        }
    }

    /// Whether there are sections for what is far and what is huge.
    pub(crate) const fn has_sections(self) -> bool {
        matches!(self, CodeBounds::Robust | CodeBounds::Apart)
    }

    /// These bounds of primitives with such bounds of boxes and centroids; those with sections begin with the boxes'.
    pub fn of(self, boxes: &Aabb, centroids: &Aabb) -> Aabb {
        match self {
            CodeBounds::Full | CodeBounds::Robust | CodeBounds::Apart => *boxes,
            CodeBounds::Centroid => *centroids,
            CodeBounds::Concise => {
                let difference: [f32; 3] = std::array::from_fn(|i| {
                    (centroids.lo[i] - boxes.lo[i]).min(boxes.hi[i] - centroids.hi[i]).max(0.0)
                });
                Aabb {
                    lo: std::array::from_fn(|i| boxes.lo[i] + difference[i]),
                    hi: std::array::from_fn(|i| boxes.hi[i] - difference[i]),
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn concise_bounds_cut_the_same_from_both_sides() {
        let boxes = Aabb { lo: [0.0, 0.0, 0.0], hi: [10.0, 10.0, 10.0] };
        let centroids = Aabb { lo: [1.0, 3.0, 0.0], hi: [8.0, 9.0, 10.0] };
        let concise = CodeBounds::Concise.of(&boxes, &centroids);
        assert_eq!(concise, Aabb { lo: [1.0, 1.0, 0.0], hi: [9.0, 9.0, 10.0] });
        assert_eq!(CodeBounds::Centroid.of(&boxes, &centroids), centroids);
        assert_eq!(CodeBounds::Full.of(&boxes, &centroids), boxes);
    }
}
