//! Choices against what was measured: was the chosen builder the best, and if not, how much slower is it?

use super::model::{Estimate, Measured, Model};
use super::{Features, candidates};
use crate::measure::record::Record;
use crate::measure::total_time::Line;
use crate::scene::Scene;

/// Rays a build for which choices are looked at: powers of ten, as a frame of a game and as an animation's still may trace.
pub const RAYS: [f64; 6] = [1e4, 1e5, 1e6, 1e7, 1e8, 1e9];
/// A choice is good if it takes at most this part more than the best.
pub const GOOD: f64 = 0.1;

/// What was chosen for a scene and so many rays a build, before it was measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// The scene.
    pub scene: String,
    /// Rays a build.
    pub rays: f64,
    /// The candidate, as `-b` takes it.
    pub builder: String,
}

/// A choice beside the best.
#[derive(Debug, Clone, PartialEq)]
pub struct Pair {
    /// The choice.
    pub choice: Choice,
    /// Milliseconds of its build and rays.
    pub chosen_ms: f64,
    /// The candidate that took least.
    pub best: String,
    /// Its milliseconds.
    pub best_ms: f64,
}

impl Pair {
    /// How many times the best's time the choice takes.
    pub fn ratio(&self) -> f64 {
        self.chosen_ms / self.best_ms
    }
}

/// What a builder took on a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Taken {
    /// The scene.
    pub scene: String,
    /// The builder, as `-b` takes it.
    pub builder: String,
    /// Milliseconds of a build and of a ray.
    pub line: Line,
}

impl Taken {
    /// By the medians of a record; `None` where nothing was traced.
    pub fn of(record: &Record) -> Option<Taken> {
        let line = Line::new(record.build.median_ms, record.mrays_s()?);
        Some(Taken { scene: record.scene.clone(), builder: record.builder.clone(), line })
    }
}

impl From<&Measured> for Taken {
    fn from(measured: &Measured) -> Taken {
        let line = Line { build: measured.build_ms, ray: measured.ray_ns * 1e-6 };
        Taken { scene: measured.scene.clone(), builder: measured.builder.clone(), line }
    }
}

impl Taken {
    /// What a candidate is expected to take on a scene.
    pub fn expected(scene: &str, estimate: &Estimate) -> Taken {
        let line = Line { build: estimate.build_ms, ray: estimate.ray_ns * 1e-6 };
        Taken { scene: scene.to_owned(), builder: estimate.builder.clone(), line }
    }
}

/// How many times what was expected of it a candidate took.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Miss {
    /// For a build.
    pub build: f64,
    /// For a ray.
    pub ray: f64,
}

/// Why a choice is not the best: what was expected wrongly of it and of the best; `None` where either was not expected or measured.
pub fn misses(pair: &Pair, expected: &[Taken], taken: &[Taken]) -> Option<[Miss; 2]> {
    let miss = |builder: &str| {
        let line = |all: &[Taken]| {
            let mut of_scene = all.iter().filter(|t| t.scene == pair.choice.scene);
            Some(of_scene.find(|t| t.builder == builder)?.line)
        };
        let (expected, took) = (line(expected)?, line(taken)?);
        Some(Miss { build: took.build / expected.build, ray: took.ray / expected.ray })
    };
    Some([miss(&pair.choice.builder)?, miss(&pair.best)?])
}

/// The choices for a scene, for all of [`RAYS`].
pub fn choices(model: &Model, scene: &Scene) -> Vec<Choice> {
    let features = Features::of(&scene.mesh);
    let choice = |&rays: &f64| {
        let builder = model.choose(&features, rays)?.builder;
        Some(Choice { scene: scene.name.clone(), rays, builder })
    };
    RAYS.iter().filter_map(choice).collect()
}

/// Each choice beside the best of the candidates that were measured on its scene. A choice that was not measured itself is left
/// out.
pub fn pairs(choices: &[Choice], taken: &[Taken]) -> Vec<Pair> {
    let is_candidate = |t: &&Taken| candidates::CANDIDATES.contains(&t.builder.as_str());
    let pair = |choice: &Choice| {
        let here = || taken.iter().filter(is_candidate).filter(|t| t.scene == choice.scene);
        let chosen_ms = here().find(|t| t.builder == choice.builder)?.line.at(choice.rays);
        let best = here().min_by(|a, b| a.line.at(choice.rays).total_cmp(&b.line.at(choice.rays)))?;
        let (best_ms, best) = (best.line.at(choice.rays), best.builder.clone());
        Some(Pair { choice: choice.clone(), chosen_ms, best, best_ms })
    };
    choices.iter().filter_map(pair).collect()
}

/// The part of the choices that take at most [`GOOD`] more than the best; `None` of nothing.
pub fn good_part(pairs: &[Pair]) -> Option<f64> {
    let good = pairs.iter().filter(|pair| pair.ratio() <= 1.0 + GOOD).count();
    (!pairs.is_empty()).then(|| good as f64 / pairs.len() as f64)
}

/// For each candidate, the part of all (scene, rays) for which it would have been good had it been taken always: what a choice has
/// to be better than.
pub fn good_parts_of_each(pairs: &[Pair], taken: &[Taken]) -> Vec<(String, f64)> {
    let part = |builder: &&str| {
        let always: Vec<Choice> =
            pairs.iter().map(|pair| Choice { builder: (*builder).to_owned(), ..pair.choice.clone() }).collect();
        Some(((*builder).to_owned(), good_part(&self::pairs(&always, taken))?))
    };
    candidates::CANDIDATES.iter().filter_map(part).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_miss_is_what_was_taken_over_what_was_expected() {
        let of = |scene: &str, builder: &str, build, ray| Taken {
            scene: scene.into(),
            builder: builder.into(),
            line: Line { build, ray },
        };
        let expected = [of("b", "lbvh", 9.0, 9.0), of("a", "lbvh", 1.0, 2.0), of("a", "lbvh:width=8q", 4.0, 1.0)];
        let taken = [of("a", "lbvh", 2.0, 0.5), of("a", "lbvh:width=8q", 2.0, 1.0)];
        let choice = Choice { scene: "a".into(), rays: 10.0, builder: "lbvh:width=8q".into() };
        let [pair] = &pairs(&[choice], &taken)[..] else { panic!("one choice") };
        let [chosen, best] = misses(pair, &expected, &taken).expect("both are there");
        assert_eq!((chosen, best), (Miss { build: 0.5, ray: 1.0 }, Miss { build: 2.0, ray: 0.25 }));
        assert_eq!(misses(pair, &expected[..1], &taken), None);
    }
}
