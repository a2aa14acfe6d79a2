//! What tracing costs on a device by what rays do: nanoseconds of a ray and of a node it visits, for each layout, and of a triangle
//! that it tests.
//!
//! Steps and tests are counted, and are the same on every run and device; only times are disturbed. So a handful of prices, fitted
//! to all times together, tells candidates apart that are nearer to each other than their times are to what they would be on an
//! idle machine.

use super::model::Measured;
use crate::measure::statistics::Spread;
use hedgerow::trace::Work;
use serde::{Deserialize, Serialize};

/// What the rays of a scene did in a tree, a ray in the mean.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct RayWork {
    /// Inner nodes visited.
    pub steps: f64,
    /// Triangles tested.
    pub tests: f64,
}

impl RayWork {
    /// The mean of what each ray did; zeros of none.
    pub fn mean(work: &[Work]) -> RayWork {
        let mean = |of: fn(&Work) -> u32| {
            let sum: u64 = work.iter().map(|w| u64::from(of(w))).sum();
            sum as f64 / work.len().max(1) as f64
        };
        RayWork { steps: mean(|w| w.steps), tests: mean(|w| w.tests) }
    }
}

/// Prices in nanoseconds.
#[derive(Debug, Clone, PartialEq)]
pub struct Prices {
    /// The layouts of trees: `bvh2`, `wide8q`…
    layouts: Vec<String>,
    /// Of a ray and a step for each layout, then of a test.
    nanoseconds: Vec<f64>,
}

/// So often prices and scenes' factors are fitted to each other.
const ROUNDS: usize = 20;
/// So often each price is fitted to the others in a round.
const SWEEPS: usize = 100;
/// A time that is off by this part of itself counts in full, one that is off by more the less.
const NEAR: f64 = 0.03;

impl Prices {
    /// The prices with which candidates on the same scene took what they took. Scenes as a whole may be dearer or cheaper (rays side
    /// by side go different ways, memory is far): by a factor that is 1 in the geometric mean.
    pub fn of(measured: &[Measured]) -> Prices {
        let mut layouts: Vec<String> = Vec::new();
        for m in measured {
            if !layouts.contains(&m.layout) {
                layouts.push(m.layout.clone());
            }
        }
        let count = 2 * layouts.len() + 1;
        let mut prices = Prices { layouts, nanoseconds: vec![0.0; count] };
        for _ in 0..ROUNDS {
            let factors = prices.factors(measured);
            let mean = (factors.iter().map(|(_, f)| f.ln()).sum::<f64>() / factors.len().max(1) as f64).exp();
            // In units of what was measured the right side is 1: errors are relative. Those that are far off count less: something
            // disturbed them.
            let row = |m: &Measured| {
                let unit =
                    factors.iter().find(|(scene, _)| *scene == m.scene).map_or(1.0, |(_, f)| f / mean) / m.ray_ns;
                let mut row: Vec<f64> = prices.amounts(m)?.into_iter().map(|x| x * unit).collect();
                let error = 1.0 - prices.ray_ns(m)? * unit;
                let weight = if prices.is_fitted() { (NEAR / error.abs().max(NEAR)).sqrt() } else { 1.0 };
                row.push(1.0);
                row.iter_mut().for_each(|x| *x *= weight);
                Some(row)
            };
            let rows: Vec<Vec<f64>> = measured.iter().filter_map(row).collect();
            least_squares(&rows, &mut prices.nanoseconds);
        }
        prices
    }

    /// Nanoseconds of a ray at these prices; `None` of a layout without prices.
    pub fn ray_ns(&self, m: &Measured) -> Option<f64> {
        let amounts = self.amounts(m)?;
        Some(amounts.iter().zip(&self.nanoseconds).map(|(amount, price)| amount * price).sum())
    }

    /// The layouts that have prices.
    pub fn layouts(&self) -> &[String] {
        &self.layouts
    }

    /// How many times its price a ray takes: the median over what was measured; `None` where nothing has a price.
    pub fn factor<'a>(&self, measured: impl Iterator<Item = &'a Measured>) -> Option<f64> {
        let factors = measured.filter_map(|m| Some(m.ray_ns / self.ray_ns(m)?));
        let factors: Vec<f64> = factors.filter(|f| f.is_finite() && *f > 0.0).collect();
        Some(Spread::of(&factors)?.median)
    }

    /// The standard deviation of the logarithm of what was measured over what these prices and the factor of the scene and layout
    /// make of it.
    pub fn deviation(&self, measured: &[Measured]) -> f64 {
        let log = |m: &Measured| {
            let alike = measured.iter().filter(|other| other.scene == m.scene && other.layout == m.layout);
            Some((m.ray_ns / (self.factor(alike)? * self.ray_ns(m)?)).ln())
        };
        let logs = measured.iter().filter_map(log);
        let (count, sum) = logs.fold((0u32, 0.0), |(count, sum), log| (count + 1, sum + log * log));
        (sum / f64::from(count.max(1))).sqrt()
    }

    /// The prices for people, a line a layout.
    pub fn lines(&self) -> Vec<String> {
        let test = self.nanoseconds.last().copied().unwrap_or_default();
        let line = |(layout, of): (&String, &[f64])| {
            format!("{layout}: {:.1} ns a ray, {:.1} ns a step, {test:.1} ns a test", of[0], of[1])
        };
        self.layouts.iter().zip(self.nanoseconds.chunks_exact(2)).map(line).collect()
    }

    fn is_fitted(&self) -> bool {
        self.nanoseconds.iter().any(|price| *price > 0.0)
    }

    /// How much of each price a ray takes.
    fn amounts(&self, m: &Measured) -> Option<Vec<f64>> {
        let layout = self.layouts.iter().position(|layout| *layout == m.layout)?;
        let mut amounts = vec![0.0; self.nanoseconds.len()];
        (amounts[2 * layout], amounts[2 * layout + 1]) = (1.0, m.work.steps);
        *amounts.last_mut()? = m.work.tests;
        Some(amounts)
    }

    /// How many times its price a ray takes on each scene; 1 where there are no prices yet.
    fn factors<'a>(&self, measured: &'a [Measured]) -> Vec<(&'a str, f64)> {
        let mut scenes: Vec<&str> = measured.iter().map(|m| m.scene.as_str()).collect();
        scenes.dedup();
        let of = |scene: &str| self.factor(measured.iter().filter(|m| m.scene == scene)).unwrap_or(1.0);
        scenes.into_iter().map(|scene| (scene, of(scene))).collect()
    }
}

/// The x from 0 on for which Σ (row · x − the row's last)² is least, from the given one on: each in turn to the others.
fn least_squares(rows: &[Vec<f64>], x: &mut [f64]) {
    let left =
        |row: &Vec<f64>| row.last().copied().unwrap_or_default() - row.iter().zip(&*x).map(|(a, x)| a * x).sum::<f64>();
    let mut left: Vec<f64> = rows.iter().map(left).collect();
    let squares: Vec<f64> = (0..x.len()).map(|k| rows.iter().map(|row| row[k] * row[k]).sum()).collect();
    for _ in 0..SWEEPS {
        for k in (0..x.len()).filter(|&k| squares[k] > 0.0) {
            let gradient: f64 = rows.iter().zip(&left).map(|(row, left)| row[k] * left).sum();
            let change = (gradient / squares[k]).max(-x[k]);
            x[k] += change;
            rows.iter().zip(&mut left).for_each(|(row, left)| *left -= change * row[k]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::choose::Features;

    /// Rays at 50 ns, steps at 20 in one layout and 60 in the other, tests at 30.
    fn measured(scene: &str, layout: &str, (steps, tests): (f64, f64), factor: f64) -> Measured {
        let step = if layout == "bvh2" { 20.0 } else { 60.0 };
        Measured {
            scene: scene.into(),
            features: Features { triangles: 1, values: [0.0; crate::measure::choose::features::COUNT] },
            builder: format!("{layout} {steps}"),
            layout: layout.into(),
            build_ms: 1.0,
            ray_ns: factor * (50.0 + step * steps + 30.0 * tests),
            work: RayWork { steps, tests },
        }
    }

    fn all() -> Vec<Measured> {
        let mut all = Vec::new();
        for (scene, factor, size) in [("a", 1.0, 1.0), ("b", 2.0, 1.7), ("c", 0.5, 3.0)] {
            for (steps, tests) in [(10.0, 2.0), (14.0, 2.5), (20.0, 5.0), (31.0, 3.0)] {
                all.push(measured(scene, "bvh2", (size * steps, tests), factor));
                all.push(measured(scene, "wide8q", (size * steps / 3.0, 1.2 * tests), factor));
            }
        }
        all
    }

    #[test]
    fn prices_are_found_whatever_the_factors_of_scenes() {
        let all = all();
        let prices = Prices::of(&all);
        assert!(prices.deviation(&all) < 0.02, "{:?} {}", prices, prices.deviation(&all));
        for m in &all {
            let factor = prices.factor(all.iter().filter(|other| other.scene == m.scene)).expect("prices");
            let priced = factor * prices.ray_ns(m).expect("a price");
            assert!((priced / m.ray_ns - 1.0).abs() < 0.05, "{m:?} {priced}");
        }
        assert_eq!(prices.lines().len(), 2);
    }

    #[test]
    fn a_disturbed_time_hardly_moves_its_price() {
        let (calm, mut disturbed) = (all(), all());
        disturbed[4].ray_ns *= 1.3;
        let prices = Prices::of(&disturbed);
        let factor = prices.factor(disturbed.iter().filter(|m| m.scene == calm[4].scene)).expect("prices");
        let priced = factor * prices.ray_ns(&disturbed[4]).expect("a price");
        assert!((priced / calm[4].ray_ns - 1.0).abs() < 0.1, "{priced} {:?}", calm[4]);
    }

    #[test]
    fn no_price_is_below_zero_and_nothing_has_none() {
        // Fewer tests take longer: a test is free.
        let mut odd = vec![measured("a", "bvh2", (10.0, 1.0), 2.0), measured("a", "bvh2", (10.0, 9.0), 1.0)];
        let prices = Prices::of(&odd);
        assert!(prices.nanoseconds.iter().all(|price| *price >= 0.0), "{prices:?}");
        odd[0].layout = "wide4".into();
        assert_eq!(prices.ray_ns(&odd[0]), None);
        assert_eq!(prices.factor(odd[..1].iter()), None);
        assert_eq!(Prices::of(&[]).lines().len(), 0);
    }

    #[test]
    fn the_mean_of_work_is_over_the_rays() {
        let work = [Work { steps: 3, tests: 1, leaves: 1 }, Work { steps: 5, tests: 0, leaves: 0 }];
        assert_eq!(RayWork::mean(&work), RayWork { steps: 4.0, tests: 0.5 });
        assert_eq!(RayWork::mean(&[]), RayWork::default());
    }
}
