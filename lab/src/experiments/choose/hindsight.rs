//! Choices against what was measured: was the chosen builder the best, and if not, how much slower is it?

use super::{CostTable, SceneClass, SceneCost, candidates};
use crate::scene::Scene;

/// Rays a build for which choices are looked at: powers of ten, as a frame of a game and as an animation's still may trace.
pub const RAYS: [f64; 6] = [1e4, 1e5, 1e6, 1e7, 1e8, 1e9];
/// A choice is good if it takes at most this part more than the best.
pub const GOOD: f64 = 0.1;

/// What was chosen for a scene and a number of rays per build, before it was measured.
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

/// The choices for a scene, for all of [`RAYS`].
pub fn choices(table: &CostTable, scene: &Scene) -> Vec<Choice> {
    let class = SceneClass::of(&scene.mesh);
    let choice = |&rays: &f64| {
        let builder = table.choose(&class, rays)?.builder;
        Some(Choice { scene: scene.name.clone(), rays, builder })
    };
    RAYS.iter().filter_map(choice).collect()
}

/// Each choice beside the best of the candidates that were measured on its scene. A choice that was not measured itself is left
/// out.
pub fn pairs(choices: &[Choice], taken: &[SceneCost]) -> Vec<Pair> {
    let is_candidate = |t: &&SceneCost| candidates::names().any(|name| name == t.cost.builder);
    let pair = |choice: &Choice| {
        let here = || taken.iter().filter(is_candidate).filter(|t| t.scene == choice.scene).map(|t| &t.cost);
        let chosen_ms = here().find(|cost| cost.builder == choice.builder)?.total_ms(choice.rays);
        let best = here().min_by(|a, b| a.total_ms(choice.rays).total_cmp(&b.total_ms(choice.rays)))?;
        let (best_ms, best) = (best.total_ms(choice.rays), best.builder.clone());
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
pub fn good_parts_of_each(pairs: &[Pair], taken: &[SceneCost]) -> Vec<(String, f64)> {
    let part = |builder: &str| {
        let always: Vec<Choice> =
            pairs.iter().map(|pair| Choice { builder: builder.to_owned(), ..pair.choice.clone() }).collect();
        Some((builder.to_owned(), good_part(&self::pairs(&always, taken))?))
    };
    candidates::names().filter_map(part).collect()
}
