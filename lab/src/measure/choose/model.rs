//! The cost model: build time and time of a ray of every candidate, from the figures of a scene.

use super::features::{COUNT, Features};
use super::prices::{Prices, RayWork};
use super::ridge::{Ridge, Sample};
use crate::measure::total_time::Line;
use serde::{Deserialize, Serialize};

/// What a candidate took on a scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// The scene's name.
    pub scene: String,
    /// The scene's figures.
    pub features: Features,
    /// The candidate, as `-b` takes it.
    pub builder: String,
    /// The layout of its tree: `bvh2`, `wide8q`…
    pub layout: String,
    /// Milliseconds of a build.
    pub build_ms: f64,
    /// Nanoseconds of a ray, over all kinds together.
    pub ray_ns: f64,
    /// What rays did, over all kinds together.
    pub work: RayWork,
}

/// What a candidate is expected to take.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    /// The candidate, as `-b` takes it.
    pub builder: String,
    /// Milliseconds of a build.
    pub build_ms: f64,
    /// Nanoseconds of a ray.
    pub ray_ns: f64,
}

impl Estimate {
    /// Milliseconds of a build and `rays` rays.
    pub fn total_ms(&self, rays: f64) -> f64 {
        Line { build: self.build_ms, ray: self.ray_ns * 1e-6 }.at(rays)
    }
}

/// A model of measured candidates.
///
/// A build takes a + b · triangles, times what the other figures make of it. A ray takes the price of what the best candidate's does,
/// times how much more another's does, times how many times its price a ray of that layout takes: rays side by side go different
/// ways, and trees are larger than caches. Each of these three is what the figures make of it, the exponential of a linear function.
#[derive(Debug, Clone)]
pub struct Model {
    /// What rays' work costs.
    pub prices: Prices,
    /// Standard deviation of the logarithm of times of rays over what the prices make of them, scene and layout aside.
    pub deviation: f64,
    least_work: Ridge,
    /// How many times its price a ray takes, and of each of the prices' layouts how much more.
    pace: Ridge,
    layout_paces: Vec<Ridge>,
    candidates: Vec<Candidate>,
}

/// The logarithm of how many times what the best candidate's ray does another's does, at most: by how much more it is worse would
/// only draw the weights away from where candidates are near each other.
const MOST: f64 = 1.5;

#[derive(Debug, Clone)]
struct Candidate {
    builder: String,
    /// Its place among the prices' layouts.
    layout: usize,
    /// Milliseconds of any build, and of each triangle more.
    build: [f64; 2],
    build_factor: Ridge,
    work_factor: Ridge,
}

impl Model {
    /// A model of what was measured. Scenes that not all candidates were measured on tell of the pace alone.
    pub fn of(measured: &[Measured]) -> Model {
        let mut builders: Vec<&Measured> = Vec::new();
        let mut scenes: Vec<&Measured> = Vec::new();
        for m in measured {
            if !builders.iter().any(|known| known.builder == m.builder) {
                builders.push(m);
            }
            if !scenes.iter().any(|known| known.scene == m.scene) {
                scenes.push(m);
            }
        }
        let of = |scene: &str, builder: &str| measured.iter().find(|m| m.scene == scene && m.builder == builder);
        let is_complete = |scene: &str| {
            builders.iter().all(|m| of(scene, &m.builder).is_some_and(|m| is_positive(m) && m.work.steps > 0.0))
        };
        let complete: Vec<&Measured> = scenes.iter().copied().filter(|m| is_complete(&m.scene)).collect();
        let on_complete: Vec<Measured> =
            measured.iter().filter(|m| complete.iter().any(|scene| scene.scene == m.scene)).cloned().collect();
        let prices = Prices::of(&on_complete);
        let price = |m: &Measured| prices.ray_ns(m).unwrap_or(m.ray_ns).ln();
        let least: Vec<Sample> = complete
            .iter()
            .map(|scene| {
                let of_scene = on_complete.iter().filter(|m| m.scene == scene.scene);
                (scene.features.values, of_scene.map(price).fold(f64::INFINITY, f64::min))
            })
            .collect();
        let candidate = |first: &&Measured| {
            let own: Vec<&Measured> = complete.iter().filter_map(|scene| of(&scene.scene, &first.builder)).collect();
            let build = affine(own.iter().map(|m| (m.features.triangles as f64, m.build_ms)));
            let build_factors: Vec<Sample> =
                own.iter().map(|m| (m.features.values, (m.build_ms / at(build, m.features.triangles)).ln())).collect();
            let work_factors: Vec<Sample> =
                own.iter().zip(&least).map(|(m, (x, least))| (*x, (price(m) - least).min(MOST))).collect();
            Some(Candidate {
                builder: first.builder.clone(),
                layout: prices.layouts().iter().position(|layout| *layout == first.layout)?,
                build,
                build_factor: Ridge::fit(&without_count(&build_factors)),
                work_factor: Ridge::fit(&work_factors),
            })
        };
        let candidates = builders.iter().filter_map(candidate).collect();
        // The pace of a scene, of one layout or of all.
        let pace = |scene: &Measured, layout: Option<&String>| {
            let alike =
                measured.iter().filter(|m| m.scene == scene.scene && layout.is_none_or(|layout| m.layout == *layout));
            Some(prices.factor(alike)?.ln())
        };
        let paces: Vec<Sample> =
            scenes.iter().filter_map(|scene| Some((scene.features.values, pace(scene, None)?))).collect();
        let of_layout = |layout: &String| {
            let sample =
                |scene: &&Measured| Some((scene.features.values, pace(scene, Some(layout))? - pace(scene, None)?));
            Ridge::fit(&scenes.iter().filter_map(sample).collect::<Vec<Sample>>())
        };
        Model {
            deviation: prices.deviation(&on_complete),
            least_work: Ridge::fit(&least),
            pace: Ridge::fit(&paces),
            layout_paces: prices.layouts().iter().map(of_layout).collect(),
            candidates,
            prices,
        }
    }

    /// What every candidate is expected to take on a scene.
    pub fn estimates(&self, features: &Features) -> Vec<Estimate> {
        let x = &features.values;
        let common = self.least_work.at_any_size(x) + self.pace.at_any_size(x);
        let estimate = |candidate: &Candidate| {
            let own = candidate.work_factor.at(x) + self.layout_paces[candidate.layout].at(x);
            Estimate {
                builder: candidate.builder.clone(),
                build_ms: at(candidate.build, features.triangles) * candidate.build_factor.at(&shape(x)).exp(),
                ray_ns: (common + own).exp(),
            }
        };
        self.candidates.iter().map(estimate).collect()
    }

    /// The candidate whose build and `rays` rays are expected to take least; of equals, that which is listed first. `None` where
    /// there is none.
    pub fn choose(&self, features: &Features, rays: f64) -> Option<Estimate> {
        let estimates = self.estimates(features);
        estimates.into_iter().min_by(|a, b| a.total_ms(rays).total_cmp(&b.total_ms(rays)))
    }
}

fn is_positive(m: &Measured) -> bool {
    [m.build_ms, m.ray_ns].iter().all(|t| *t > 0.0 && t.is_finite())
}

fn at([any, each]: [f64; 2], triangles: u64) -> f64 {
    any + each * triangles as f64
}

/// The figures without the size, of which the build time is an affine function by itself.
fn shape(x: &[f64; COUNT]) -> [f64; COUNT] {
    std::array::from_fn(|k| if k == 0 { 0.0 } else { x[k] })
}

fn without_count(samples: &[Sample]) -> Vec<Sample> {
    samples.iter().map(|(x, y)| (shape(x), *y)).collect()
}

/// The non-negative a and b for which Σ ((a + b·n − t) / t)² is least.
fn affine(samples: impl Iterator<Item = (f64, f64)>) -> [f64; 2] {
    let (mut one, mut n1, mut n2, mut y, mut ny) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (n, t) in samples {
        // In units of t the right side is 1, and the two columns are 1/t and n/t.
        let (u, v) = (1.0 / t, n / t);
        one += u * u;
        n1 += u * v;
        n2 += v * v;
        y += u;
        ny += v;
    }
    let determinant = one * n2 - n1 * n1;
    let [a, b] = [(y * n2 - ny * n1) / determinant, (ny * one - y * n1) / determinant];
    if a >= 0.0 && b >= 0.0 {
        [a, b]
    } else if n2 > 0.0 && (a < 0.0 || one == 0.0) {
        [0.0, ny / n2]
    } else {
        [if one > 0.0 { y / one } else { 0.0 }, 0.0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn features(triangles: u64, crossing: f64) -> Features {
        Features { triangles, values: [(triangles as f64).log2(), 0.0, 0.0, crossing, 0.0] }
    }

    /// One that builds fast and traces slowly, all the more where rays cross many boxes, and one that does the opposite.
    fn measured(scenes: &[(u64, f64)]) -> Vec<Measured> {
        let of = |&(n, crossing): &(u64, f64)| {
            let scene = format!("{n} {crossing}");
            let ray = 100.0 * (n as f64).powf(0.1) * (0.2 * crossing).exp2();
            let m = |builder: &str, build_ms, ray_ns| Measured {
                scene: scene.clone(),
                features: features(n, crossing),
                builder: builder.into(),
                layout: "bvh2".into(),
                build_ms,
                ray_ns,
                // At 20 ns a step.
                work: RayWork { steps: 0.05 * ray_ns, tests: 0.0 },
            };
            let n = n as f64;
            [m("fast", 0.5 + 1e-4 * n, ray * (0.1 * crossing).exp2()), m("good", 2.0 + 3e-4 * n, 0.8 * ray)]
        };
        scenes.iter().flat_map(of).collect()
    }

    const SCENES: [(u64, f64); 9] = [
        (1_000, 0.0),
        (1_000, 3.0),
        (5_000, 1.0),
        (10_000, 2.0),
        (20_000, 0.5),
        (30_000, 3.0),
        (60_000, 1.0),
        (100_000, 2.0),
        (200_000, 0.0),
    ];

    #[test]
    fn times_of_scenes_that_were_not_measured_are_predicted() {
        let model = Model::of(&measured(&SCENES));
        for scene in [(3_000, 1.5), (50_000, 2.5), (2_000_000, 1.0)] {
            let expected = measured(&[scene]);
            for (estimate, m) in model.estimates(&features(scene.0, scene.1)).iter().zip(expected) {
                assert_eq!(estimate.builder, m.builder);
                let (build, ray) = (estimate.build_ms / m.build_ms, estimate.ray_ns / m.ray_ns);
                assert!((0.97..1.03).contains(&build), "{scene:?} {}: build × {build}", m.builder);
                assert!((0.93..1.07).contains(&ray), "{scene:?} {}: ray × {ray}", m.builder);
            }
        }
    }

    #[test]
    fn few_rays_take_the_fast_builder_and_many_the_good_tree() {
        let model = Model::of(&measured(&SCENES));
        let at = |rays| model.choose(&features(50_000, 1.0), rays).expect("two candidates").builder;
        assert_eq!((at(1e3), at(1e9)), ("fast".into(), "good".into()));
        // Where they cross by the formulas above: 11.5 ms of building over the difference of two rays.
        let [fast, good] = &measured(&[(50_000, 1.0)])[..] else { panic!("two") };
        let crossing = (good.build_ms - fast.build_ms) * 1e6 / (fast.ray_ns - good.ray_ns);
        assert_eq!((at(0.7 * crossing), at(1.4 * crossing)), ("fast".into(), "good".into()));
    }

    #[test]
    fn scenes_that_not_all_were_measured_on_tell_of_the_pace_alone() {
        let mut some = measured(&SCENES);
        some.push(Measured { scene: "alone".into(), build_ms: 1e9, ..some[0].clone() });
        let (all, without) = (Model::of(&some), Model::of(&measured(&SCENES)));
        let x = features(7_000, 1.0);
        for (all, without) in all.estimates(&x).iter().zip(without.estimates(&x)) {
            assert_eq!(all.build_ms, without.build_ms);
            assert!((all.ray_ns / without.ray_ns - 1.0).abs() < 0.01, "{all:?} {without:?}");
        }
        assert_eq!(Model::of(&[]).choose(&x, 1e6), None);
    }

    #[test]
    fn where_large_scenes_are_slower_than_their_work_all_candidates_are() {
        // Of scenes from 300,000 triangles on, one candidate alone: as many steps as ever, at twice their price.
        let mut all = measured(&SCENES);
        for n in [300_000, 500_000, 1_000_000] {
            for crossing in [0.0, 1.0, 2.0, 3.0] {
                let [fast, _] = &measured(&[(n, crossing)])[..] else { panic!("two") };
                all.push(Measured { ray_ns: 2.0 * fast.ray_ns, ..fast.clone() });
            }
        }
        let (slower, before) = (Model::of(&all), Model::of(&measured(&SCENES)));
        let of =
            |model: &Model, n| model.estimates(&features(n, 1.5)).into_iter().map(|e| e.ray_ns).collect::<Vec<_>>();
        for (n, least, most) in [(700_000, 1.6, 2.4), (5_000, 0.7, 1.2)] {
            for (slower, before) in of(&slower, n).iter().zip(of(&before, n)) {
                assert!((least..most).contains(&(slower / before)), "{n}: {slower} {before}");
            }
        }
    }

    #[test]
    fn affine_functions_are_found_and_never_negative() {
        let close = |[a, b]: [f64; 2], [c, d]: [f64; 2]| (a - c).abs() < 1e-9 && (b - d).abs() < 1e-12;
        assert!(close(affine([(10.0, 3.2), (100.0, 5.0), (1000.0, 23.0)].into_iter()), [3.0, 0.02]));
        assert!(close(affine([(10.0, 1.0), (100.0, 10.0)].into_iter()), [0.0, 0.1]));
        // Faster than in proportion, and falling.
        assert_eq!(affine([(10.0, 1.0), (100.0, 100.0)].into_iter())[0], 0.0);
        assert_eq!(affine([(10.0, 5.0), (100.0, 1.0)].into_iter())[1], 0.0);
    }
}
