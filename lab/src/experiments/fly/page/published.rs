//! What van Kralingen 2023 has measured, to be printed beside ours: context, never a result.

use crate::measure::geometric_mean;
use serde::Deserialize;

/// Its tables 2 to 6 and A.1 to A.8, and of table 6 the rows of Soda Hall, which stand in the slides at the end alone: the slide with
/// Conference's figures of table 6 has them.
const FIGURES: &str = include_str!("../vankralingen2023.csv");

/// A figure of the thesis.
#[derive(Debug, Clone, Deserialize)]
pub(super) struct Figure {
    metric: String,
    scene: String,
    #[serde(rename = "rays_or_cost")]
    row: String,
    heuristic: String,
    value: f64,
}

/// All of them.
pub(super) struct Published(Vec<Figure>);

/// What of the thesis stands beside a scene of ours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Beside {
    /// The same mesh.
    Same(&'static str),
    /// A scene of that name or kind, but another mesh: as ratios.
    Other(&'static str),
    /// None: the mean of all its scenes, as ratios.
    Mean,
}

impl Beside {
    /// What stands beside a scene.
    pub fn of(scene: &str) -> Beside {
        match scene {
            "dragon" => Beside::Same("Dragon"),
            "bunny" => Beside::Other("Bunny"),
            "sponza" => Beside::Other("Sponza"),
            "classroom" => Beside::Other("Conference"),
            _ => Beside::Mean,
        }
    }
}

/// The builds of a column that nothing is rebuilt for.
const KEPT: &str = "animated_no_rebuild";

impl Published {
    pub fn read() -> Published {
        let lines = csv::Reader::from_reader(FIGURES.as_bytes()).into_deserialize();
        Published(lines.collect::<Result<_, _>>().expect("a file of our own"))
    }

    /// A figure of a scene there.
    pub fn of(&self, metric: &str, scene: &str, row: &str, heuristic: &str) -> Option<f64> {
        let is_it = |f: &&Figure| f.metric == metric && f.scene == scene && f.row == row && f.heuristic == heuristic;
        self.0.iter().find(is_it).map(|figure| figure.value)
    }

    /// A figure over that of the surface area heuristic, whose tree is always kept; in the geometric mean of all scenes there that have
    /// both, where none is beside ours.
    pub fn ratio(&self, metric: &str, beside: Beside, row: &str, heuristic: &str) -> Option<f64> {
        let kept = metric.replace("animated_rebuild3", KEPT).replace("animated_rebuild1", KEPT);
        let of = |scene: &str| Some(self.of(metric, scene, row, heuristic)? / self.of(&kept, scene, row, "SAH")?);
        match beside {
            Beside::Same(scene) | Beside::Other(scene) => of(scene),
            Beside::Mean => geometric_mean(SCENES.iter().filter_map(|scene| of(scene))),
        }
    }
}

const SCENES: [&str; 8] = ["Bunny", "Dragon", "Sponza", "Sibenik", "Conference", "Soda Hall", "San Miguel", "Bistro"];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_of_the_thesis_are_found_and_put_over_those_by_surface_area() {
        let all = Published::read();
        assert_eq!(all.of("ns_per_ray_static", "Dragon", "total", "OSAH"), Some(896.0));
        // 447 of 466 would be the same scene's; here Dragon, static: 896 of 911.
        let ratio = all.ratio("ns_per_ray_static", Beside::Same("Dragon"), "total", "OSAH").expect("both are there");
        assert!((ratio - 896.0 / 911.0).abs() < 1e-12);
        // The study's geometric mean of eight scenes: 0.967 for ray distribution.
        let mean = all.ratio("ns_per_ray_static", Beside::Mean, "total", "RDH").expect("all are there");
        assert!((mean - 0.967).abs() < 0.001, "{mean}");
        // Rebuilt in every frame over the tree by surface area that was kept: 23615 of 684 in table 5 is the thesis' worst.
        let worst = all.ratio("ns_per_ray_animated_rebuild3", Beside::Same("Dragon"), "total", "RDH").expect("both");
        assert!((34.0..35.0).contains(&worst), "{worst}");
    }

    #[test]
    fn the_rows_that_the_thesis_left_out_are_there() {
        let all = Published::read();
        assert_eq!(all.of("ns_per_ray_animated_rebuild1", "Soda Hall", "total", "RDH"), Some(823.0));
        // Conference's columns on that slide are those of table 6, which is how the others are known.
        assert_eq!(all.of("ns_per_ray_animated_rebuild1", "Conference", "total", "RDH"), Some(1038.0));
    }
}
