//! Whether two figures go together: Pearson's and Spearman's correlation, and how sure the former is.

/// Half the width of a 95% interval of the normal distribution, in standard deviations.
const NORMAL_95: f64 = 1.959_963_985;
/// With so few points a correlation below [`CLEAR`] says nothing: chance gives one as large in more than one of twenty draws.
pub const FEW: usize = 6;
/// See [`FEW`].
pub const CLEAR: f64 = 0.8;

/// How two figures go together over some points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Correlation {
    /// Points.
    pub n: usize,
    /// Pearson's correlation; `None` where a figure does not vary.
    pub pearson: Option<f64>,
    /// Spearman's, of their orders.
    pub spearman: Option<f64>,
}

impl Correlation {
    /// Of two figures a point; both have one for each.
    pub fn of(a: &[f64], b: &[f64]) -> Correlation {
        Correlation { n: a.len(), pearson: pearson(a, b), spearman: pearson(&ranks(a), &ranks(b)) }
    }

    /// The 95% interval of Pearson's correlation, by Fisher's z: as if points were drawn one by one. `None` of fewer than four.
    pub fn interval(&self) -> Option<[f64; 2]> {
        let r = self.pearson.filter(|_| self.n > 3)?;
        let half = NORMAL_95 / ((self.n - 3) as f64).sqrt();
        Some([-half, half].map(|off| (r.atanh() + off).tanh()))
    }

    /// Whether there are too few points for a correlation like this to say anything.
    pub fn says_nothing(&self) -> bool {
        self.n <= FEW && self.pearson.is_none_or(|r| r.abs() < CLEAR)
    }
}

/// Pearson's correlation; `None` where one of them does not vary.
pub fn pearson(a: &[f64], b: &[f64]) -> Option<f64> {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let (mean_a, mean_b) = (mean(a), mean(b));
    let [mut ab, mut aa, mut bb] = [0.0; 3];
    for (a, b) in a.iter().zip(b) {
        ab += (a - mean_a) * (b - mean_b);
        aa += (a - mean_a).powi(2);
        bb += (b - mean_b).powi(2);
    }
    (aa > 0.0 && bb > 0.0).then(|| (ab / (aa * bb).sqrt()).clamp(-1.0, 1.0))
}

/// The place of each value in their order from 1 on; equal ones share the mean of their places.
pub fn ranks(values: &[f64]) -> Vec<f64> {
    let rank = |value: &f64| {
        let below = values.iter().filter(|other| *other < value).count() as f64;
        let equal = values.iter().filter(|other| *other == value).count() as f64;
        below + 0.5 * (equal + 1.0)
    };
    values.iter().map(rank).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first of Anscombe's quartet (1973), whose correlation is known.
    const X: [f64; 11] = [10.0, 8.0, 13.0, 9.0, 11.0, 14.0, 6.0, 4.0, 12.0, 7.0, 5.0];
    const Y: [f64; 11] = [8.04, 6.95, 7.58, 8.81, 8.33, 9.96, 7.24, 4.26, 10.84, 4.82, 5.68];

    #[test]
    fn correlations_are_those_that_are_known() {
        let found = Correlation::of(&X, &Y);
        assert_eq!(found.n, 11);
        assert!((found.pearson.expect("both vary") - 0.816_42).abs() < 5e-6, "{found:?}");
        // By hand: the differences of the ranks are 0, 1, 4, 3, 0, 1, 2, 0, 2, 2, 1, their squares' sum 40.
        let spearman = 1.0 - 6.0 * 40.0 / (11.0 * 120.0);
        assert!((found.spearman.expect("both vary") - spearman).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn what_does_not_vary_has_no_correlation_and_a_line_has_one() {
        assert_eq!(pearson(&[1.0; 3], &[1.0, 2.0, 3.0]), None);
        assert_eq!(pearson(&[], &[]), None);
        let line = Correlation::of(&[1.0, 2.0, 3.0, 4.0], &[9.0, 7.0, 5.0, 3.0]);
        assert_eq!((line.pearson, line.spearman), (Some(-1.0), Some(-1.0)));
        assert_eq!(line.interval(), Some([-1.0; 2]));
    }

    #[test]
    fn the_interval_is_fishers() {
        // z = 0.5493, half the width 1.96 / 5 = 0.392.
        let [low, high] = Correlation { n: 28, pearson: Some(0.5), spearman: None }.interval().expect("enough");
        assert!((low - 0.1560).abs() < 1e-4 && (high - 0.7358).abs() < 1e-4, "{low} {high}");
        assert_eq!(Correlation { n: 3, pearson: Some(0.5), spearman: None }.interval(), None);
    }

    #[test]
    fn few_points_say_nothing_unless_they_are_clear() {
        let of = |n, r| Correlation { n, pearson: r, spearman: None }.says_nothing();
        assert!(of(6, Some(0.79)) && of(5, Some(-0.5)) && of(4, None));
        assert!(!of(6, Some(-0.8)) && !of(7, Some(0.1)));
    }

    #[test]
    fn equal_values_share_their_places() {
        assert_eq!(ranks(&[5.0, 1.0, 5.0, 9.0]), [2.5, 1.0, 2.5, 4.0]);
    }
}
