//! The lines of `growth.jsonl`, `large.jsonl` and `degenerate.jsonl` (CONTRACT, "Records of experiments"), and where and how
//! they were measured, in a file beside each. A figure that was not measured is `None`.

use super::far::Side;
use super::large::Placement;
pub use crate::experiments::accel::points::Failure;
use crate::measure::provenance::{DeviceFacts, Machine};
use crate::measure::record::SCHEMA;
use crate::measure::statistics::Spread;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A line of one of the files.
pub trait Point: Serialize + DeserializeOwned {
    /// The experiment that it is of.
    const EXPERIMENT: &'static str;
    /// The version and the experiment that the line names.
    fn head(&self) -> &Head;
}

/// How every line begins.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Head {
    /// [`SCHEMA`].
    pub schema: u32,
    /// [`Point::EXPERIMENT`].
    pub experiment: String,
}

impl Head {
    /// Of a line of `P`.
    pub fn of<P: Point>() -> Head {
        Head { schema: SCHEMA, experiment: P::EXPERIMENT.into() }
    }
}

/// A builder on a scene with one far triangle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Growth {
    /// Schema and experiment.
    #[serde(flatten)]
    pub head: Head,
    /// Scene name.
    pub scene: String,
    /// Builder with its options, as `-b` takes it.
    pub builder: String,
    /// In how many axes the bounds grow: 1 or 3.
    pub axes: u32,
    /// Where the far triangle is.
    pub side: Side,
    /// The bounds are 2^e times as long.
    pub e: u32,
    /// [`super::clipped::cost`] over that at e = 0.
    pub relative_cost: Option<f64>,
    /// For each kind of ray, speed over that at e = 0: the median of ratios run by run. A kind that has fallen below a twentieth
    /// is missing at the e that follow.
    pub relative_mrays: BTreeMap<String, f64>,
}

impl Point for Growth {
    const EXPERIMENT: &'static str = "growth";
    fn head(&self) -> &Head {
        &self.head
    }
}

/// A builder on a scene with huge triangles at its edge.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Large {
    /// Schema and experiment.
    #[serde(flatten)]
    pub head: Head,
    /// Scene name.
    pub scene: String,
    /// Builder with its options, as `-b` takes it.
    pub builder: String,
    /// Where the huge triangles are.
    pub placement: Placement,
    /// How many a side.
    pub count: u32,
    /// Each is 2^e times as long as the scene.
    pub e: u32,
    /// [`super::clipped::cost`].
    pub cost: Option<f64>,
    /// The same over that at e = 0.
    pub relative_cost: Option<f64>,
    /// For each kind of ray, speed over that at e = 0: the median of ratios run by run. A kind that has fallen below a twentieth
    /// is missing at the e that follow.
    pub relative_mrays: BTreeMap<String, f64>,
}

impl Point for Large {
    const EXPERIMENT: &'static str = "large";
    fn head(&self) -> &Head {
        &self.head
    }
}

/// A builder on a degenerate scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Degenerate {
    /// Schema and experiment.
    #[serde(flatten)]
    pub head: Head,
    /// Name in [`crate::scene::degenerate`].
    pub scene: String,
    /// Triangles of the input.
    pub triangles: u64,
    /// Builder with its options, as `-b` takes it.
    pub builder: String,
    /// Whether it is one of ours: a peer's faults are shown and are no failures.
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

impl Point for Degenerate {
    const EXPERIMENT: &'static str = "degenerate";
    fn head(&self) -> &Head {
        &self.head
    }
}

impl Degenerate {
    /// Whether one of ours did what it must not: an invalid tree, other bytes, a wrong hit, or none at all.
    pub fn has_failed(&self) -> bool {
        self.is_ours && !self.faults.is_empty()
    }
}

/// Where and how the points of a file were measured, and what could not be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// [`SCHEMA`].
    pub schema: u32,
    /// The machine.
    pub machine: Machine,
    /// The device, if one was used.
    pub device: Option<DeviceFacts>,
    /// Commit of the program.
    pub commit: String,
    /// When, RFC 3339 UTC.
    pub when: String,
    /// The command line that measures it again.
    pub command: String,
    /// Options with their values, for people.
    pub options: Vec<(String, String)>,
    /// What a reader must know to judge the figures: points that were left out, a peer that is none.
    pub notes: Vec<String>,
    /// What could not be measured, or was wrong.
    pub failures: Vec<Failure>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_of_growth_is_the_line_of_the_contract() {
        let line = r#"{"schema":1,"experiment":"growth","scene":"bunny","builder":"lbvh:codes=emc64var-nosize:collapse=off","axes":1,"side":"+","e":42,"relative_cost":1.03,"relative_mrays":{"primary":0.98}}"#;
        let point: Growth = serde_json::from_str(line).expect("the contract's example");
        assert_eq!((point.head.clone(), point.side), (Head::of::<Growth>(), Side::Positive));
        assert_eq!(serde_json::to_string(&point).expect("JSON"), line);
    }
}
