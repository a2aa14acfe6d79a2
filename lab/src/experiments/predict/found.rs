//! How well a predictor tells times, over the points of a scope.

use super::predictor::{Predictor, Source};
use super::samples::{Point, Weights};
use crate::measure::correlation::Correlation;
use crate::report::distinct;

/// What was found of a predictor.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// Between the logarithms of its ratios and of those of the times, over the points that have both.
    pub correlation: Correlation,
    /// Each point's ratios, prediction and time.
    pub ratios: Vec<[f64; 2]>,
    /// The points, in the order of `ratios`, by their numbers in the scope.
    pub numbers: Vec<usize>,
    /// Where weights are sought: those of all points, in words.
    pub fitted: Option<String>,
}

/// Correlates a predictor over points. Weights that are sought are those of the other scenes' points, so that no scene is told by
/// itself; where there is one scene they are its own.
pub fn found(predictor: &Predictor, points: &[Point<'_>]) -> Found {
    let (predictions, fitted) = match predictor.weights {
        Source::Known(weights) => (predictions(points, |_| Some(weights)), None),
        Source::Found(fit, in_words) => {
            let scenes = distinct(points.iter().map(|point| point.tree.scene.as_str()));
            let without = |scene: &str| -> Option<Weights> {
                let is_other = |point: &&Point<'_>| point.tree.scene != scene;
                fit(&points.iter().filter(is_other).copied().collect::<Vec<_>>())
            };
            let of_all = fit(points);
            let weights: Vec<(&str, Option<Weights>)> = match &scenes[..] {
                [scene] => vec![(*scene, of_all)],
                scenes => scenes.iter().map(|scene| (*scene, without(scene))).collect(),
            };
            let of_scene = |scene: &str| weights.iter().find(|(other, _)| *other == scene)?.1;
            (predictions(points, of_scene), of_all.map(|weights| in_words(&weights)))
        }
    };
    let both = predictions.iter().zip(points).map(|(prediction, point)| Some([(*prediction)?, point.time()?]));
    let (numbers, logs): (Vec<usize>, Vec<[f64; 2]>) =
        both.enumerate().filter_map(|(number, both)| Some((number, both?))).unzip();
    let [predicted, times] = [0, 1].map(|k| logs.iter().map(|log| log[k]).collect::<Vec<f64>>());
    let ratios = logs.iter().map(|log| log.map(f64::exp)).collect();
    Found { correlation: Correlation::of(&predicted, &times), ratios, numbers, fitted }
}

fn predictions(points: &[Point<'_>], weights: impl Fn(&str) -> Option<Weights>) -> Vec<Option<f64>> {
    points.iter().map(|point| point.prediction(&weights(&point.tree.scene)?)).collect()
}

#[cfg(test)]
mod tests {
    use super::super::predictor::ALL;
    use super::super::samples::Scope;
    use super::super::samples::tests::sample;
    use super::*;
    use crate::subjects::retraced::TreeTracer;

    fn predictor(name: &str) -> &'static Predictor {
        ALL.iter().find(|predictor| predictor.name == name).expect(name)
    }

    #[test]
    fn a_predictor_that_times_follow_correlates_fully_whatever_the_scene() {
        let mut all = Vec::new();
        for (scene, scale) in [("a", 1.0), ("b", 30.0)] {
            all.push(sample(scene, "reference", 7.0 * scale, &[7.0, 1.0]));
            all.extend([3.0, 5.0, 9.0].map(|sah| sample(scene, "x", sah * scale, &[sah, 0.0])));
        }
        let points = Scope::pooled(TreeTracer::Host).points(&all);
        let sah = found(predictor("SAH"), &points);
        assert_eq!(sah.correlation.n, 6);
        assert!((sah.correlation.pearson.expect("it varies") - 1.0).abs() < 1e-12);
        assert!((sah.ratios[0][0] - 3.0 / 7.0).abs() < 1e-12 && sah.numbers == [0, 1, 2, 3, 4, 5]);
        let epo = found(predictor("EPO"), &points);
        assert_eq!((epo.correlation.n, epo.correlation.pearson), (0, None), "an overlap of 0 has no ratio");
    }

    #[test]
    fn weights_that_are_sought_come_from_other_scenes() {
        // On a times follow SAH, on b EPO.
        let mut all = Vec::new();
        for scene in ["a", "b"] {
            all.push(sample(scene, "reference", 10.0, &[10.0, 10.0]));
            for (sah, epo) in [(5.0, 20.0), (8.0, 9.0), (12.0, 4.0), (20.0, 11.0)] {
                all.push(sample(scene, "x", if scene == "a" { sah } else { epo }, &[sah, epo]));
            }
        }
        let best = predictor("SAH–EPO, best α");
        let of = |scene: Option<&str>| found(best, &Scope { scene, ..Scope::pooled(TreeTracer::Host) }.points(&all));
        assert_eq!(of(Some("a")).fitted.as_deref(), Some("α 0.00"));
        assert_eq!(of(Some("b")).fitted.as_deref(), Some("α 1.00"));
        assert!((of(Some("b")).correlation.pearson.expect("varies") - 1.0).abs() < 1e-12);
        // Pooled, each is told by the other's α: a by EPO alone, b by SAH alone.
        let pooled = of(None);
        let expected: Vec<f64> = [2.0, 0.9, 0.4, 1.1, 0.5, 0.8, 1.2, 2.0].to_vec();
        assert!(pooled.ratios.iter().zip(expected).all(|(ratio, x)| (ratio[0] - x).abs() < 1e-12), "{pooled:?}");
    }
}
