//! Linear regression for few samples: weights are held small as far as that predicts samples that were left out (ridge regression,
//! Hoerl and Kennard 1970).

use super::features::COUNT;

/// How strongly weights are held small, for figures in units of their standard deviation and per sample. The last is: no weights.
const STRENGTHS: [f64; 6] = [0.01, 0.03, 0.1, 0.3, 1.0, f64::INFINITY];

/// y ≈ mean + Σ weight · (x − mean of x).
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Ridge {
    x_mean: [f64; COUNT],
    weights: [f64; COUNT],
    y_mean: f64,
    least: [f64; COUNT],
    most: [f64; COUNT],
}

/// A sample: the figures and what is to be predicted.
pub(super) type Sample = ([f64; COUNT], f64);

impl Ridge {
    /// The regression with the strength that predicts each sample best from all others.
    pub fn fit(samples: &[Sample]) -> Ridge {
        let error_left_out = |strength: f64| -> f64 {
            (0..samples.len())
                .map(|i| {
                    let others: Vec<Sample> = [&samples[..i], &samples[i + 1..]].concat();
                    (Ridge::with(&others, strength).at(&samples[i].0) - samples[i].1).powi(2)
                })
                .sum()
        };
        let errors = STRENGTHS.map(|strength| (error_left_out(strength), strength));
        let best =
            errors.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).map_or(f64::INFINITY, |(_, strength)| strength);
        Ridge::with(samples, best)
    }

    fn with(samples: &[Sample], strength: f64) -> Ridge {
        let count = samples.len().max(1) as f64;
        let mean = |of: &dyn Fn(&Sample) -> f64| samples.iter().map(of).sum::<f64>() / count;
        let x_mean: [f64; COUNT] = std::array::from_fn(|k| mean(&|s| s.0[k]));
        let y_mean = mean(&|s| s.1);
        let deviation: [f64; COUNT] = std::array::from_fn(|k| mean(&|s| (s.0[k] - x_mean[k]).powi(2)).sqrt());
        let extreme = |start: f64, of: fn(f64, f64) -> f64| -> [f64; COUNT] {
            std::array::from_fn(|k| samples.iter().map(|s| s.0[k]).fold(start, of))
        };
        let (least, most) = (extreme(f64::INFINITY, f64::min), extreme(f64::NEG_INFINITY, f64::max));
        let mut weights = [0.0; COUNT];
        if strength.is_finite() && samples.len() > 1 {
            let unit =
                |s: &Sample, k: usize| if deviation[k] > 0.0 { (s.0[k] - x_mean[k]) / deviation[k] } else { 0.0 };
            let mut matrix = [[0.0; COUNT + 1]; COUNT];
            for (j, row) in matrix.iter_mut().enumerate() {
                *row = std::array::from_fn(|k| match k {
                    COUNT => mean(&|s| unit(s, j) * (s.1 - y_mean)),
                    _ => mean(&|s| unit(s, j) * unit(s, k)) + if j == k { strength } else { 0.0 },
                });
            }
            let solved = solve(matrix);
            weights = std::array::from_fn(|k| if deviation[k] > 0.0 { solved[k] / deviation[k] } else { 0.0 });
        }
        Ridge { x_mean, weights, y_mean, least, most }
    }

    /// The prediction. Figures outside of those of the samples count as the nearest that was seen.
    pub fn at(&self, x: &[f64; COUNT]) -> f64 {
        self.at_seen(std::array::from_fn(|k| x[k].max(self.least[k]).min(self.most[k])))
    }

    /// The same, but that the first figure, the size of the scene, may go on.
    pub fn at_any_size(&self, x: &[f64; COUNT]) -> f64 {
        self.at_seen(std::array::from_fn(|k| if k == 0 { x[0] } else { x[k].max(self.least[k]).min(self.most[k]) }))
    }

    fn at_seen(&self, x: [f64; COUNT]) -> f64 {
        (0..COUNT).fold(self.y_mean, |y, k| y + self.weights[k] * (x[k] - self.x_mean[k]))
    }
}

/// Solves a symmetric positive definite system, the right side in the last column (Gaussian elimination without exchanges).
fn solve(mut rows: [[f64; COUNT + 1]; COUNT]) -> [f64; COUNT] {
    for pivot in 0..COUNT {
        for row in pivot + 1..COUNT {
            let factor = rows[row][pivot] / rows[pivot][pivot];
            let subtrahend = rows[pivot];
            rows[row].iter_mut().zip(subtrahend).for_each(|(value, s)| *value -= factor * s);
        }
    }
    let mut solution = [0.0; COUNT];
    for row in (0..COUNT).rev() {
        let known: f64 = (row + 1..COUNT).map(|k| rows[row][k] * solution[k]).sum();
        solution[row] = (rows[row][COUNT] - known) / rows[row][row];
    }
    solution
}

#[cfg(test)]
mod tests {
    use super::*;

    fn x(i: u32) -> [f64; COUNT] {
        std::array::from_fn(|k| f64::from((i * 7919 + k as u32 * 104_729) % 101) / 10.0)
    }

    #[test]
    fn what_is_linear_is_found() {
        let y = |x: &[f64; COUNT]| 3.0 + 2.0 * x[0] - 0.5 * x[3];
        let samples: Vec<Sample> = (0..40).map(|i| (x(i), y(&x(i)))).collect();
        let ridge = Ridge::fit(&samples);
        // Weights are held a little small: by a hundredth of their part.
        for i in 0..40 {
            assert!((ridge.at(&x(i)) - y(&x(i))).abs() < 0.4, "{} {}", ridge.at(&x(i)), y(&x(i)));
        }
    }

    #[test]
    fn what_follows_no_figure_is_predicted_by_its_mean() {
        let samples: Vec<Sample> = (0..12).map(|i| (x(i), if i % 2 == 0 { 1.0 } else { 3.0 })).collect();
        let ridge = Ridge::fit(&samples);
        assert!((ridge.at(&x(50)) - 2.0).abs() < 0.7, "{}", ridge.at(&x(50)));
    }

    #[test]
    fn figures_that_were_not_seen_count_as_the_nearest() {
        let samples: Vec<Sample> = (0..20).map(|i| (x(i), x(i)[1])).collect();
        let ridge = Ridge::fit(&samples);
        let beyond = |value: f64| {
            let mut at = x(3);
            at[1] = value;
            ridge.at(&at)
        };
        assert_eq!(beyond(1e6), beyond(1e3));
    }

    #[test]
    fn few_samples_have_a_prediction() {
        assert_eq!(Ridge::fit(&[]).y_mean, 0.0);
        assert_eq!(Ridge::fit(&[(x(1), 5.0)]).at(&x(2)), 5.0);
        let same = [(x(1), 5.0), (x(1), 6.0), (x(1), 7.0)];
        assert_eq!(Ridge::fit(&same).at(&x(1)), 6.0);
    }
}
