//! Medians and spreads of repeated runs, and the order in which several subjects are run: in turn, A B A B.

use crate::{Error, Result};
use hedgerow::trace::Work;

/// What repeated measurements of one thing say.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Spread {
    /// The middle value (mean of the two middle ones for an even number).
    pub median: f64,
    /// The least.
    pub min: f64,
    /// The greatest.
    pub max: f64,
    /// How many there were.
    pub runs: u32,
}

impl Spread {
    /// The spread of `samples`; `None` if there are none.
    pub fn of(samples: &[f64]) -> Option<Spread> {
        let mut sorted = samples.to_vec();
        sorted.sort_by(f64::total_cmp);
        let (&min, &max) = (sorted.first()?, sorted.last()?);
        let middle = sorted.len() / 2;
        let median = if sorted.len() % 2 == 1 { sorted[middle] } else { 0.5 * (sorted[middle - 1] + sorted[middle]) };
        Some(Spread { median, min, max, runs: sorted.len() as u32 })
    }

    /// The spread of `samples`, of which there must be some.
    ///
    /// # Errors
    /// There are none.
    pub fn of_some(samples: &[f64]) -> Result<Spread> {
        Spread::of(samples).ok_or_else(|| Error::Argument("nothing was run; take at least one run".into()))
    }

    /// A figure that was taken once.
    pub fn once(value: f64) -> Spread {
        Spread { median: value, min: value, max: value, runs: 1 }
    }

    /// Whether the two could be the same thing measured twice: their ranges from `min` to `max` meet.
    pub fn overlaps(&self, other: &Spread) -> bool {
        self.min <= other.max && other.min <= self.max
    }
}

/// The mean of a figure of the work of rays; `None` without any.
pub fn mean_work(work: &[Work], of: fn(&Work) -> u32) -> Option<f64> {
    (!work.is_empty()).then(|| work.iter().map(|w| f64::from(of(w))).sum::<f64>() / work.len() as f64)
}

/// The ratios of two subjects that ran in turn, round by round: what slows down a round slows both.
pub fn ratios(samples: &[f64], base: &[f64]) -> Vec<f64> {
    samples.iter().zip(base).map(|(sample, base)| sample / base).collect()
}

/// Runs every subject once per round, one after the other, `warm_ups` rounds that do not count and `runs` that do.
///
/// In turn, so that a machine that slows down meanwhile slows all of them. A subject that fails is left out of later
/// rounds and gives its error; the others go on.
pub fn in_turn<S, T>(
    subjects: &mut [S],
    warm_ups: u32,
    runs: u32,
    mut run: impl FnMut(&mut S) -> Result<T>,
) -> Vec<Result<Vec<T>>> {
    let mut samples: Vec<Result<Vec<T>>> = subjects.iter().map(|_| Ok(Vec::new())).collect();
    for round in 0..warm_ups + runs {
        for (subject, samples) in subjects.iter_mut().zip(&mut samples) {
            let Ok(collected) = samples else { continue };
            match run(subject) {
                Ok(_) if round < warm_ups => {}
                Ok(sample) => collected.push(sample),
                Err(error) => *samples = Err(error),
            }
        }
    }
    samples
}

/// The mean that suits ratios: a doubling and a halving cancel. `None` of nothing.
pub fn geometric_mean(ratios: impl Iterator<Item = f64>) -> Option<f64> {
    let logs: Vec<f64> = ratios.filter(|r| r.is_finite() && *r > 0.0).map(f64::ln).collect();
    (!logs.is_empty()).then(|| (logs.iter().sum::<f64>() / logs.len() as f64).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_doubling_and_a_halving_cancel() {
        assert!((geometric_mean([2.0, 0.5].into_iter()).expect("two") - 1.0).abs() < 1e-12);
        assert!((geometric_mean([2.0, 8.0].into_iter()).expect("two") - 4.0).abs() < 1e-12);
        assert_eq!(geometric_mean([f64::NAN, 0.0].into_iter()), None);
    }

    #[test]
    fn the_median_is_the_middle_of_the_sorted_values() {
        let odd = Spread::of(&[9.0, 1.0, 5.0]).expect("three samples");
        assert_eq!(odd, Spread { median: 5.0, min: 1.0, max: 9.0, runs: 3 });
        let even = Spread::of(&[4.0, 1.0, 2.0, 9.0]).expect("four samples");
        assert_eq!(even, Spread { median: 3.0, min: 1.0, max: 9.0, runs: 4 });
        assert_eq!(Spread::of(&[]), None);
    }

    #[test]
    fn ratios_are_taken_round_by_round() {
        assert_eq!(ratios(&[2.0, 9.0], &[1.0, 3.0]), [2.0, 3.0]);
        assert!(Spread::of_some(&[]).is_err());
    }

    #[test]
    fn ranges_that_touch_overlap_and_others_do_not() {
        let spread = |min, max| Spread { median: 0.5 * (min + max), min, max, runs: 2 };
        assert!(spread(1.0, 2.0).overlaps(&spread(2.0, 3.0)));
        assert!(spread(1.0, 9.0).overlaps(&spread(4.0, 5.0)));
        assert!(!spread(1.0, 2.0).overlaps(&spread(2.1, 3.0)));
        assert!(!spread(2.1, 3.0).overlaps(&spread(1.0, 2.0)));
    }

    #[test]
    fn subjects_run_in_turn_and_warm_ups_do_not_count() {
        let mut order = Vec::new();
        let samples = in_turn(&mut ["a", "b"], 1, 2, |&mut name| {
            order.push(name);
            Ok(order.len())
        });
        assert_eq!(order, ["a", "b", "a", "b", "a", "b"]);
        let samples: Vec<_> = samples.into_iter().map(|s| s.expect("nothing fails")).collect();
        assert_eq!(samples, [vec![3, 5], vec![4, 6]]);
    }

    #[test]
    fn a_subject_that_fails_gives_its_error_and_the_others_go_on() {
        let mut calls = 0;
        let samples = in_turn(&mut ["good", "bad"], 0, 3, |&mut name| {
            calls += 1;
            if name == "bad" { Err(Error::Argument("broken".into())) } else { Ok(1) }
        });
        assert_eq!(samples[0].as_ref().ok(), Some(&vec![1, 1, 1]));
        assert!(samples[1].as_ref().unwrap_err().to_string().contains("broken"));
        assert_eq!(calls, 4, "the broken one is called once");
    }
}
