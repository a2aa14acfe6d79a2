//! What van Kralingen 2023 has published of static scenes, as samples beside ours: tables 2, 3 and A.1 to A.8.

use super::samples::{EPO, FIGURES, SAH, STEPS, Sample, TESTS};
use crate::experiments::published::{FIGURES as PUBLISHED, of};
use crate::report::distinct;
use crate::subjects::retraced::TreeTracer;

/// Where the figures are from.
pub const SOURCE: &str = "van Kralingen 2023, \"Evaluating Alternatives to the Surface Area Heuristic\"";
/// What all kinds of rays together are called.
pub const ALL_RAYS: &str = "all";
/// The heuristic that the others are held against there.
const REFERENCE: &str = "SAH";
/// The heuristic whose trees took up to 29 times as long: one such point makes a correlation whatever the others do.
pub const OUTLIER: &str = "P-SAH";
/// Names of kinds of rays there, and ours.
const KINDS: [(&str, &str); 6] = [
    ("total", ALL_RAYS),
    ("primary", "primary"),
    ("shadow", "shadow"),
    ("ao", "ao"),
    ("diffuse 1 st", "diffuse1"),
    ("diffuse 2 nd", "diffuse2"),
];

/// The trees of the thesis with each kind of rays, as if traced by the host; without those of [`OUTLIER`].
pub fn samples() -> Vec<Sample> {
    let scenes = distinct(PUBLISHED.iter().map(|figure| figure.scene.as_str()));
    let heuristics = distinct(PUBLISHED.iter().map(|figure| figure.heuristic.as_str()));
    let mut all = Vec::new();
    for scene in scenes {
        for heuristic in heuristics.iter().filter(|name| **name != OUTLIER) {
            let of = |metric: &str, what: &str| of(metric, scene, what, heuristic);
            for (there, kind) in KINDS {
                let Some(ns) = of("ns_per_ray_static", there) else { continue };
                let mut figures = [None; FIGURES];
                (figures[SAH], figures[EPO]) = (of("cost_static", "SAH"), of("cost_static", "EPO"));
                (figures[STEPS], figures[TESTS]) = (of("steps_static", there), of("tests_static", there));
                all.push(Sample {
                    scene: scene.to_owned(),
                    builder: (*heuristic).to_owned(),
                    kind: kind.to_owned(),
                    tracer: TreeTracer::Host,
                    ns,
                    figures,
                    is_reference: *heuristic == REFERENCE,
                });
            }
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::super::predictor::{ALL, Source};
    use super::super::samples::{Scope, Weights};
    use super::*;
    use crate::measure::correlation::pearson;

    fn weights(name: &str) -> Weights {
        let predictor = ALL.iter().find(|predictor| predictor.name == name).expect(name);
        match predictor.weights {
            Source::Known(weights) => weights,
            Source::Found(..) => panic!("{name} has no weights of its own"),
        }
    }

    /// Pearson's correlation of plain ratios to the SAH tree's, as the study of the thesis has them.
    fn of_ratios(name: &str, scene: Option<&str>) -> f64 {
        let all = samples();
        let points = Scope { scene, ..Scope::pooled(TreeTracer::Host) }.points(&all);
        assert_eq!(points.len(), if scene.is_none() { 32 } else { 5 });
        let ratio = |log: Option<f64>| log.expect("published").exp();
        let predicted: Vec<f64> = points.iter().map(|point| ratio(point.prediction(&weights(name)))).collect();
        let times: Vec<f64> = points.iter().map(|point| ratio(point.time())).collect();
        pearson(&predicted, &times).expect("they vary")
    }

    #[test]
    fn correlations_of_the_thesis_are_those_of_a_computation_by_another_program() {
        for (name, r) in [("SAH", 0.268), ("EPO", 0.418), ("work", 0.946)] {
            assert!((of_ratios(name, None) - r).abs() < 5e-4, "{name}");
        }
        let by_scene = [
            ("Bunny", [0.54, 0.65, 0.46]),
            ("Dragon", [0.93, 0.93, 0.96]),
            ("Sponza", [-0.63, -0.49, 0.95]),
            ("Sibenik", [-0.32, -0.37, 0.53]),
            ("Conference", [0.66, 0.72, 0.83]),
            ("Soda Hall", [0.52, 0.87, 0.99]),
            ("San Miguel", [-0.54, -0.60, 0.71]),
            ("Bistro", [0.64, 0.69, 0.97]),
        ];
        for (scene, expected) in by_scene {
            for (name, r) in ["SAH", "SAH–EPO", "work"].into_iter().zip(expected) {
                let found = of_ratios(name, Some(scene));
                assert!((found - r).abs() < 0.005 + 1e-9, "{scene}, {name}: {found}, {r}");
            }
        }
    }

    #[test]
    fn every_scene_has_every_kind_and_a_tree_to_be_held_against() {
        let all = samples();
        assert_eq!(all.len(), 8 * 5 * KINDS.len());
        assert_eq!(all.iter().filter(|sample| sample.is_reference).count(), 8 * KINDS.len());
    }
}
