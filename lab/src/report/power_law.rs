//! How build time grows with the number of triangles: time = c · triangles^e, fitted on logarithms.

/// A power law through measured points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PowerLaw {
    /// The exponent: 1 is proportional.
    pub exponent: f64,
    /// The time of one triangle, by the law.
    pub factor: f64,
}

impl PowerLaw {
    /// Least squares through the logarithms of `points` (triangles, time), both greater than zero.
    ///
    /// `None` with fewer than two different triangle counts: there is no slope to tell.
    pub fn fit(points: &[(f64, f64)]) -> Option<PowerLaw> {
        let logs: Vec<(f64, f64)> =
            points.iter().filter(|(n, t)| *n > 0.0 && *t > 0.0).map(|(n, t)| (n.ln(), t.ln())).collect();
        let count = logs.len() as f64;
        let mean_x = logs.iter().map(|p| p.0).sum::<f64>() / count;
        let mean_y = logs.iter().map(|p| p.1).sum::<f64>() / count;
        let covariance: f64 = logs.iter().map(|(x, y)| (x - mean_x) * (y - mean_y)).sum();
        let variance: f64 = logs.iter().map(|(x, _)| (x - mean_x) * (x - mean_x)).sum();
        if logs.len() < 2 || variance < 1e-12 {
            return None;
        }
        let exponent = covariance / variance;
        Some(PowerLaw { exponent, factor: (mean_y - exponent * mean_x).exp() })
    }

    /// The law's time for `triangles`.
    pub fn at(&self, triangles: f64) -> f64 {
        self.factor * triangles.powf(self.exponent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_law_is_found_again() {
        let points: Vec<_> = [1e4, 3e4, 1e5, 1e6, 6.5e6].iter().map(|&n: &f64| (n, 2.5e-6 * n.powf(1.07))).collect();
        let law = PowerLaw::fit(&points).expect("five sizes");
        assert!((law.exponent - 1.07).abs() < 1e-9, "{law:?}");
        assert!((law.at(5e5) / (2.5e-6 * 5e5_f64.powf(1.07)) - 1.0).abs() < 1e-9, "{law:?}");
    }

    #[test]
    fn noise_that_cancels_leaves_the_slope() {
        // Time alternates between 2 times and half of proportional, symmetric around the middle of the logarithms.
        let law = PowerLaw::fit(&[(1.0, 2.0), (10.0, 5.0), (100.0, 50.0), (1000.0, 2000.0)]).expect("four sizes");
        assert!((law.exponent - 1.0).abs() < 1e-9, "{law:?}");
    }

    #[test]
    fn one_size_has_no_slope() {
        assert_eq!(PowerLaw::fit(&[]), None);
        assert_eq!(PowerLaw::fit(&[(1e5, 3.0)]), None);
        assert_eq!(PowerLaw::fit(&[(1e5, 3.0), (1e5, 4.0)]), None);
    }
}
