//! Weights that points tell: the blend of static figures that correlates best, and the prices of steps and tests.

use super::samples::{EPO, FIGURES, LCV, Point, SAH, STEPS, TESTS, Weights};
use crate::measure::correlation::pearson;

/// Steps of α, where it is sought alone.
const FINE: u32 = 100;
/// Steps of α and of β, where both are sought.
const COARSE: u32 = 50;
/// Correlations that differ by less differ by rounding.
const SAME: f64 = 1e-9;

/// (1 − α) SAH + α EPO with the α, in hundredths, whose logarithms correlate best with those of the times; of equals the least.
pub fn alpha(points: &[Point<'_>]) -> Option<Weights> {
    best(points, &[SAH, EPO], (0..=FINE).map(|alpha| blend(f64::from(alpha) / f64::from(FINE), 0.0)))
}

/// The same with LCV: (1 − α − β) SAH + α EPO + β LCV, both in fiftieths.
pub fn alpha_and_beta(points: &[Point<'_>]) -> Option<Weights> {
    let part = |steps: u32| f64::from(steps) / f64::from(COARSE);
    let all = (0..=COARSE).flat_map(|alpha| (0..=COARSE - alpha).map(move |beta| blend(part(alpha), part(beta))));
    best(points, &[SAH, EPO, LCV], all)
}

fn blend(alpha: f64, beta: f64) -> Weights {
    let mut weights = [0.0; FIGURES];
    (weights[EPO], weights[LCV]) = (alpha, beta);
    // What is left of 1 is 0 where it is but rounding.
    weights[SAH] = Some(1.0 - alpha - beta).filter(|rest| *rest > 1e-9).unwrap_or(0.0);
    weights
}

/// The weights that correlate best over the points that have all of these figures. Where a sum is 0 the weights are no candidate:
/// they would be judged by fewer points.
fn best(points: &[Point<'_>], needed: &[usize], candidates: impl Iterator<Item = Weights>) -> Option<Weights> {
    let has_all = |point: &&Point<'_>| {
        let has = |figure: &usize| point.tree.figures[*figure].is_some() && point.reference.figures[*figure].is_some();
        needed.iter().all(has) && point.time().is_some()
    };
    let points: Vec<&Point<'_>> = points.iter().filter(has_all).collect();
    let times: Vec<f64> = points.iter().filter_map(|point| point.time()).collect();
    let mut best: Option<(f64, Weights)> = None;
    for weights in candidates {
        let predictions: Option<Vec<f64>> = points.iter().map(|point| point.prediction(&weights)).collect();
        let Some(r) = predictions.and_then(|predictions| pearson(&predictions, &times)) else { continue };
        if best.is_none_or(|(most, _)| r > most + SAME) {
            best = Some((r, weights));
        }
    }
    best.map(|(_, weights)| weights)
}

/// Nanoseconds a step and a test, none below 0, with the least sum of squares of (time told / time − 1).
pub fn prices(points: &[Point<'_>]) -> Option<Weights> {
    let [mut ss, mut st, mut tt, mut s, mut t] = [0.0; 5];
    for sample in points.iter().map(|point| point.tree) {
        let (steps, tests) = (sample.figures[STEPS]? / sample.ns, sample.figures[TESTS]? / sample.ns);
        ss += steps * steps;
        st += steps * tests;
        tt += tests * tests;
        s += steps;
        t += tests;
    }
    let determinant = ss * tt - st * st;
    let both = [(s * tt - t * st) / determinant, (t * ss - s * st) / determinant];
    let [step, test] = match both {
        [step, test] if determinant > 1e-12 * ss * tt && step >= 0.0 && test >= 0.0 => [step, test],
        // One of them is worth nothing, or they go together: the better one alone. Of it the squares fall by s² / ss.
        _ if s * s * tt >= t * t * ss => [s / ss, 0.0],
        _ => [0.0, t / tt],
    };
    let mut weights = [0.0; FIGURES];
    (weights[STEPS], weights[TESTS]) = (step, test);
    (step.is_finite() && test.is_finite()).then_some(weights)
}

#[cfg(test)]
mod tests {
    use super::super::samples::Sample;
    use super::super::samples::tests::sample;
    use super::*;

    fn points(samples: &[Sample]) -> Vec<Point<'_>> {
        samples.iter().map(|tree| Point { tree, reference: &samples[0] }).collect()
    }

    /// Trees whose time is a sum of their figures: SAH, EPO, LCV, steps, tests.
    fn trees(time: impl Fn([f64; 5]) -> f64) -> Vec<Sample> {
        let figures = |i: u32| {
            let wave = |k: f64| (f64::from(i) * k).sin();
            [
                100.0 + 20.0 * wave(1.0),
                30.0 + 9.0 * wave(2.3),
                8.0 + 3.0 * wave(4.1),
                50.0 + 9.0 * wave(5.7),
                9.0 + 4.0 * wave(7.9),
            ]
        };
        (0..12).map(|i| (i, figures(i))).map(|(i, f)| sample("a", &format!("tree {i}"), time(f), &f)).collect()
    }

    #[test]
    fn the_alpha_that_times_are_made_of_is_found() {
        let of = |alpha: f64| trees(move |[sah, epo, ..]| (1.0 - alpha) * sah + alpha * epo);
        for alpha in [0.0, 0.42, 0.71, 1.0] {
            let trees = of(alpha);
            let found = super::alpha(&points(&trees)).expect("they vary");
            assert!((found[EPO] - alpha).abs() < 1e-9, "{alpha}: {found:?}");
        }
        // All overlaps 0: α = 1 tells nothing, and every other one is the SAH.
        let mut flat = of(0.0);
        flat.iter_mut().for_each(|tree| tree.figures[EPO] = Some(0.0));
        assert_eq!(super::alpha(&points(&flat)).expect("SAH varies")[EPO], 0.0);
        flat.iter_mut().for_each(|tree| tree.figures[EPO] = None);
        assert_eq!(super::alpha(&points(&flat)), None);
    }

    #[test]
    fn alpha_and_beta_are_found_together() {
        let trees = trees(|[sah, epo, lcv, ..]| 0.2 * sah + 0.3 * epo + 0.5 * lcv);
        let found = alpha_and_beta(&points(&trees)).expect("they vary");
        assert!((found[EPO] - 0.3).abs() < 1e-9 && (found[LCV] - 0.5).abs() < 1e-9, "{found:?}");
        assert!((found[SAH] - 0.2).abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn prices_are_those_that_times_are_made_of_and_none_is_below_nothing() {
        let made = trees(|[.., steps, tests]| 7.0 * steps + 11.0 * tests);
        let found = prices(&points(&made)).expect("they vary");
        assert!((found[STEPS] - 7.0).abs() < 1e-9 && (found[TESTS] - 11.0).abs() < 1e-9, "{found:?}");
        // More tests, less time: only steps have a price.
        let made = trees(|[.., steps, tests]| 7.0 * steps - 3.0 * tests);
        let found = prices(&points(&made)).expect("they vary");
        assert!(found[STEPS] > 5.0 && found[TESTS] == 0.0, "{found:?}");
        assert_eq!(prices(&[]), None);
    }
}
