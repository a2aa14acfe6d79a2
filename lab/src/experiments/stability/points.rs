//! The lines of `growth.jsonl`, `large.jsonl`, `degenerate.jsonl` and `greedy.jsonl` (CONTRACT, "Records of experiments"), and where and how
//! they were measured, in a file beside each. A figure that was not measured is `None`.

use super::far::FarTriangle;
use super::large::HugeTriangles;
use crate::measure::{Failure, Setting, Spread};
use serde::{Deserialize, Deserializer, Serialize};
use std::collections::BTreeMap;

/// What a line is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Experiment {
    /// The bounds grow by a far triangle.
    Growth,
    /// The bounds of a top level grow by far instances.
    #[serde(rename = "growth-top")]
    GrowthTop,
    /// Huge triangles at the scene's edge.
    Large,
    /// Scenes that hurt.
    Degenerate,
    /// Greedy trees beside the cheapest ones.
    Greedy,
}

/// A builder on a scene with something beside it that stretches the bounds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Stretched<S> {
    /// What it is of.
    pub experiment: Experiment,
    /// Scene name.
    pub scene: String,
    /// Builder with its options, as `-b` takes it.
    pub builder: String,
    /// What stands beside the scene.
    #[serde(flatten)]
    pub by: S,
    /// How far it reaches: 2^e times the scene.
    pub e: u32,
    /// [`super::clipped::cost`], if the experiment has it.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "told")]
    pub cost: Option<Option<f64>>,
    /// The same over that at e = 0.
    pub relative_cost: Option<f64>,
    /// For each kind of ray, speed over that at e = 0: the median of ratios run by run. A kind that has fallen below a twentieth
    /// is missing at the e that follow.
    pub relative_mrays: BTreeMap<String, f64>,
}

/// A figure that is there, be it `null`.
fn told<'de, D: Deserializer<'de>>(value: D) -> Result<Option<Option<f64>>, D::Error> {
    Option::deserialize(value).map(Some)
}

/// A builder on a scene with one far triangle.
pub type Growth = Stretched<FarTriangle>;
/// A builder on a scene with huge triangles at its edge.
pub type Large = Stretched<HugeTriangles>;

/// A builder on a degenerate scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Degenerate {
    /// What it is of.
    pub experiment: Experiment,
    /// Name in [`crate::scene::degenerate`].
    pub scene: String,
    /// Triangles of the input.
    pub triangles: u64,
    /// Builder with its options, as `-b` takes it.
    pub builder: String,
    /// Whether it is one of ours: a peer's faults are reported but do not fail the run.
    pub is_ours: bool,
    /// Triangles that the tree holds.
    pub active: Option<u64>,
    /// Depth of the deepest leaf.
    pub depth_max: Option<u64>,
    /// SAH cost.
    pub sah: Option<f64>,
    /// Names of the bits of the structure's status.
    pub status: Option<Vec<String>>,
    /// Milliseconds of a build by the builder's own clock.
    pub build_ms: Option<Spread>,
    /// Whether all builds gave the same bytes.
    pub same_bytes: Option<bool>,
    /// Whether the tree keeps every rule of its layout.
    pub valid: Option<bool>,
    /// Rays of the sample.
    pub rays: u64,
    /// Those that meet something, by brute force.
    pub hits: u64,
    /// Those whose hit is another than by brute force.
    pub wrong: Option<u64>,
    /// What went wrong, where something did.
    pub faults: Vec<String>,
}

impl Degenerate {
    /// Whether one of ours did what it must not: an invalid tree, other bytes, a wrong hit, or none at all.
    pub fn has_failed(&self) -> bool {
        self.is_ours && !self.faults.is_empty()
    }
}

/// A greedy full sweep over a few triangles, and the cheapest tree by sorted planes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Greedy {
    /// What it is of.
    pub experiment: Experiment,
    /// How the triangles were made or chosen.
    pub kind: GreedyKind,
    /// The scene that they are a part of, if they are.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scene: Option<String>,
    /// How many there are.
    pub triangles: u32,
    /// What made or chose them.
    pub seed: u64,
    /// SAH cost of the sweep.
    pub greedy: f64,
    /// The same of the cheapest tree.
    pub optimum: f64,
    /// How many sets of triangles the search has split.
    pub sets: u64,
}

impl Greedy {
    /// The sweep's cost over the optimum; 1 where both are 0.
    pub fn ratio(&self) -> f64 {
        if self.optimum > 0.0 { self.greedy / self.optimum } else { 1.0 }
    }
}

/// Kinds of scenes of a few triangles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum GreedyKind {
    /// Corners anywhere in a cube.
    Random,
    /// One shape, turned and moved in cells of a grid.
    Displaced,
    /// The faces of tetrahedra, likewise.
    Tetrahedra,
    /// Triangles of a scene, drawn by their areas.
    Sampled,
    /// Neighbours in a scene.
    Near,
}

impl GreedyKind {
    /// All of them.
    pub const ALL: [GreedyKind; 5] =
        [GreedyKind::Random, GreedyKind::Displaced, GreedyKind::Tetrahedra, GreedyKind::Sampled, GreedyKind::Near];

    /// Its name, as records have it.
    pub fn name(self) -> &'static str {
        match self {
            GreedyKind::Random => "random",
            GreedyKind::Displaced => "displaced",
            GreedyKind::Tetrahedra => "tetrahedra",
            GreedyKind::Sampled => "sampled",
            GreedyKind::Near => "near",
        }
    }
}

/// Where and how the points of a file were measured, and what could not be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// As in every experiment.
    #[serde(flatten)]
    pub setting: Setting,
    /// What could not be measured, or was wrong.
    pub failures: Vec<Failure>,
}

#[cfg(test)]
mod tests {
    use super::super::far::Side;
    use super::*;

    #[test]
    fn a_point_of_growth_is_the_line_of_the_contract() {
        let line = r#"{"experiment":"growth","scene":"bunny","builder":"lbvh:codes=emc64var-nosize:collapse=off","axes":1,"side":"+","e":42,"relative_cost":1.03,"relative_mrays":{"primary":0.98}}"#;
        let point: Growth = serde_json::from_str(line).expect("the contract's example, but for its schema");
        assert_eq!((point.experiment, point.by.side), (Experiment::Growth, Side::Positive));
        assert_eq!(serde_json::to_string(&point).expect("JSON"), line);
    }

    #[test]
    fn a_point_of_the_greedy_experiment_is_a_line_that_names_its_scene_where_it_has_one() {
        let line = r#"{"experiment":"greedy","kind":"random","triangles":15,"seed":3,"greedy":21.5,"optimum":20.0,"sets":2067}"#;
        let point: Greedy = serde_json::from_str(line).expect("a point");
        assert_eq!((point.scene.as_deref(), point.ratio()), (None, 1.075));
        assert_eq!(serde_json::to_string(&point).expect("JSON"), line);
        for kind in GreedyKind::ALL {
            assert_eq!(serde_json::to_string(&kind).expect("JSON"), format!("\"{}\"", kind.name()));
        }
    }

    #[test]
    fn a_cost_of_a_large_scene_is_told_though_it_was_not_measured() {
        let line = r#"{"experiment":"large","scene":"s","builder":"b","placement":"wall","count":1,"e":2,"cost":null,"relative_cost":null,"relative_mrays":{}}"#;
        let point: Large = serde_json::from_str(line).expect("a point");
        assert_eq!(serde_json::to_string(&point).expect("JSON"), line);
    }
}
