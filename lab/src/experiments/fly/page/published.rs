//! Which figures of van Kralingen 2023 stand beside those of a scene.

use crate::experiments::published::of;
use crate::measure::geometric_mean;

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

/// A figure over that of the surface area heuristic, whose tree is always kept; in the geometric mean of all scenes there that have
/// both, where none is beside ours.
pub(super) fn ratio(metric: &str, beside: Beside, row: &str, heuristic: &str) -> Option<f64> {
    let kept = metric.replace("animated_rebuild3", KEPT).replace("animated_rebuild1", KEPT);
    let over_kept = |scene: &str| Some(of(metric, scene, row, heuristic)? / of(&kept, scene, row, "SAH")?);
    match beside {
        Beside::Same(scene) | Beside::Other(scene) => over_kept(scene),
        Beside::Mean => geometric_mean(SCENES.iter().filter_map(|scene| over_kept(scene))),
    }
}

const SCENES: [&str; 8] = ["Bunny", "Dragon", "Sponza", "Sibenik", "Conference", "Soda Hall", "San Miguel", "Bistro"];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_of_the_thesis_are_found_and_put_over_those_by_surface_area() {
        assert_eq!(of("ns_per_ray_static", "Dragon", "total", "OSAH"), Some(896.0));
        // 447 of 466 would be the same scene's; here Dragon, static: 896 of 911.
        let of_osah = ratio("ns_per_ray_static", Beside::Same("Dragon"), "total", "OSAH").expect("both are there");
        assert!((of_osah - 896.0 / 911.0).abs() < 1e-12);
        // The study's geometric mean of eight scenes: 0.967 for ray distribution.
        let mean = ratio("ns_per_ray_static", Beside::Mean, "total", "RDH").expect("all are there");
        assert!((mean - 0.967).abs() < 0.001, "{mean}");
        // Rebuilt in every frame over the tree by surface area that was kept: 23615 of 684 in table 5 is the thesis' worst.
        let worst = ratio("ns_per_ray_animated_rebuild3", Beside::Same("Dragon"), "total", "RDH").expect("both");
        assert!((34.0..35.0).contains(&worst), "{worst}");
    }
}
