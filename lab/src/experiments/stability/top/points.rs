//! The lines of `growth-top.jsonl`: a top level with something far away, over itself with the same at e = 0.

use crate::experiments::stability::points::Experiment;
use crate::measure::{Spread, geometric_mean};
use crate::named::named;
use crate::subjects::preference::Preference;
use crate::subjects::queries::MeanWork;
use crate::{Error, Result};
use ash::vk;
use hedgerow::accel::{AccelOptions, REBRAID, Wide};
use hedgerow::bvh::codes::Codes;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;

/// Where the far instances are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum FarSides {
    /// All behind the greatest corner.
    #[serde(rename = "+")]
    Positive,
    /// All before the least.
    #[serde(rename = "-")]
    Negative,
    /// Each on a side that is drawn for it.
    #[serde(rename = "drawn")]
    Drawn,
}

named!(FarSides, "sides": Positive = "+", Negative = "-", Drawn = "drawn");

/// Far instances that make the bounds of a top level grow.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct FarInstances {
    /// How many.
    pub far: u32,
    /// In how many axes the bounds grow: 1 (x alone) or 3.
    pub axes: u32,
    /// Where they are.
    pub sides: FarSides,
}

impl fmt::Display for FarInstances {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let axes = if self.axes == 1 { "in one axis" } else { "in three axes" };
        write!(f, "{} far {axes}, side {}", self.far, self.sides)
    }
}

/// How a top level is built.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TopBuilder {
    /// The preference among the flags.
    pub prefer: Preference,
    /// Whether instances may be opened.
    pub rebraid: bool,
    /// Whether structures have nodes of eight where there can be, or of two; those of fast builds have none of eight.
    #[serde(default)]
    pub of_eight: bool,
    /// The codes of the top level; `None`: what accel chooses.
    #[serde(with = "codes_by_name")]
    pub codes: Option<Codes>,
}

/// What codes are called that nobody has chosen.
const DEFAULT: &str = "default";

impl TopBuilder {
    /// The flags of its builds.
    pub fn flags(&self) -> vk::BuildAccelerationStructureFlagsKHR {
        let prefer = self.prefer.flags();
        if self.rebraid { prefer | REBRAID } else { prefer }
    }

    /// The device's choices.
    pub fn options(&self) -> AccelOptions {
        let default = AccelOptions::DEFAULT;
        let rebraid_budget = if self.rebraid { default.rebraid_budget } else { 1.0 };
        let wide = if self.of_eight { Wide::Always } else { Wide::Never };
        AccelOptions { rebraid_budget, top_codes: self.codes, wide, ..default }
    }

    /// Whether its top levels are of nodes of eight.
    pub fn has_nodes_of_eight(&self) -> bool {
        self.of_eight && self.prefer != Preference::FastBuild
    }

    /// What its codes are called.
    pub fn codes_name(&self) -> String {
        self.codes.map_or_else(|| DEFAULT.to_owned(), |codes| codes.to_string())
    }
}

impl fmt::Display for TopBuilder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let opened = if self.rebraid { ", re-braided" } else { "" };
        let of_eight = if self.has_nodes_of_eight() { ", in nodes of eight" } else { "" };
        write!(f, "{}{opened}{of_eight}, {}", self.prefer, self.codes_name())
    }
}

/// Codes by their name, or `default`.
///
/// # Errors
/// There are no such codes.
pub fn codes_of(name: &str) -> Result<Option<Codes>> {
    if name == DEFAULT {
        return Ok(None);
    }
    name.parse().map(Some).map_err(|error: hedgerow::Error| Error::Argument(format!("{error}; or {DEFAULT}")))
}

mod codes_by_name {
    use super::{Codes, DEFAULT, codes_of};
    use serde::{Deserialize, Deserializer, Serializer, de};

    #[expect(clippy::ref_option, reason = "what serde calls it with")]
    pub fn serialize<S: Serializer>(codes: &Option<Codes>, serializer: S) -> Result<S::Ok, S::Error> {
        match codes {
            Some(codes) => serializer.collect_str(codes),
            None => serializer.serialize_str(DEFAULT),
        }
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(value: D) -> Result<Option<Codes>, D::Error> {
        codes_of(&String::deserialize(value)?).map_err(de::Error::custom)
    }
}

/// A top level over a scene of instances and far ones.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TopGrowth {
    /// What it is of.
    pub experiment: Experiment,
    /// Scene name.
    pub scene: String,
    /// Instances that stay.
    pub instances: u32,
    /// How it is built.
    #[serde(flatten)]
    pub builder: TopBuilder,
    /// What is far.
    #[serde(flatten)]
    pub by: FarInstances,
    /// The bounds are 2^e times as long.
    pub e: u32,
    /// Bits of the codes that it was built by.
    pub code_bits: u32,
    /// Entries of the tree: instances, those that were opened as their parts.
    pub entries: u32,
    /// SAH cost of the tree clipped to what stays: a step 3, whatever a node's width, an instance 2.
    #[serde(default)]
    pub cost: Option<f64>,
    /// That over the one at e = 0.
    pub relative_cost: Option<f64>,
    /// Milliseconds of a build.
    pub build_ms: Spread,
    /// Those over builds at e = 0 in turn.
    pub relative_build: Spread,
    /// For each kind of ray, speed over that at e = 0, run by run in turn.
    pub relative_mrays: BTreeMap<String, Spread>,
    /// For each kind of ray, what one of them meets; nothing in records of before 27 November 2026.
    #[serde(default)]
    pub work: BTreeMap<String, MeanWork>,
    /// All of that over the same at e = 0: what the tree makes of the speed, free of noise.
    #[serde(default)]
    pub relative_work: BTreeMap<String, f64>,
    /// Milliseconds of a build and one trace of every kind of ray.
    pub frame_ms: Option<f64>,
    /// Those over a frame at e = 0.
    pub relative_frame: Option<f64>,
}

/// Issue 20's goals: cost at most, speed at least, build time at most, over those of e = 0.
pub const GOALS: [f64; 3] = [1.05, 0.95, 1.05];

impl TopGrowth {
    /// The geometric mean of the relative speeds; `None` without rays.
    pub fn speed(&self) -> Option<f64> {
        geometric_mean(self.relative_mrays.values().map(|spread| spread.median))
    }

    /// The geometric mean of the relative work; `None` without rays.
    pub fn relative_work(&self) -> Option<f64> {
        geometric_mean(self.relative_work.values().copied())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_is_a_line_that_names_its_codes() {
        let line = r#"{"experiment":"growth-top","scene":"gen:city:9","instances":9,"prefer":"fast-trace","rebraid":true,"of_eight":false,"codes":"default","far":100,"axes":3,"sides":"drawn","e":42,"code_bits":32,"entries":40,"cost":20.5,"relative_cost":1.01,"build_ms":{"median":1.0,"min":1.0,"max":1.0,"runs":1},"relative_build":{"median":1.0,"min":1.0,"max":1.0,"runs":1},"relative_mrays":{},"work":{},"relative_work":{},"frame_ms":null,"relative_frame":null}"#;
        let point: TopGrowth = serde_json::from_str(line).expect("a point");
        assert_eq!((point.builder.codes, point.by.sides, point.speed()), (None, FarSides::Drawn, None));
        assert_eq!(serde_json::to_string(&point).expect("JSON"), line);
        let named = line.replace("default", "emc64var+robust/32");
        let point: TopGrowth = serde_json::from_str(&named).expect("a point");
        assert_eq!(point.builder.codes_name(), "emc64var+robust/32");
        assert_eq!(serde_json::to_string(&point).expect("JSON"), named);
        assert!(codes_of("emc65").is_err());
    }
}
