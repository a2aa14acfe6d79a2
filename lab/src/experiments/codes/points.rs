//! The lines of `codes.jsonl`.

use crate::measure::{Failure, Setting, Spread};
use crate::report::{beside, lines};
use serde::{Deserialize, Serialize};

/// What a line says, by its `experiment`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "experiment", rename_all = "kebab-case")]
pub enum CodesEntry {
    /// The first line: where and how the others were measured.
    Setting(Setting),
    /// A scene's trees by binning with one weight of the stretch factor.
    Sweep(Swept),
    /// What a code adds to the time of a scene's build.
    AddedTime(AddedTime),
    /// What could not be measured, or was wrong.
    Failure(Failure),
}

/// Trees by binning with one weight of the stretch factor, beside those of the base.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Swept {
    /// Scene name.
    pub scene: String,
    /// Its triangles.
    pub triangles: u64,
    /// Builder with its codes, as `-b` takes it.
    pub builder: String,
    /// The builder that it is held against.
    pub base: String,
    /// 1/λ.
    pub stretch: u32,
    /// SAH cost, 3 a step and 2 a test, over that of the base; `None` where the builder does not show its tree.
    pub relative_sah: Option<f64>,
    /// Rays through both.
    pub rays: Vec<SweptRays>,
}

/// Rays of a kind through both trees.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SweptRays {
    /// Their kind.
    pub rays: String,
    /// How many.
    pub count: u64,
    /// Milliseconds of all, through the base's tree.
    pub base_ms: Spread,
    /// The same through the other.
    pub ms: Spread,
    /// Speed over that through the base's tree, in percent, run by run: above 0 the other is faster.
    pub change_percent: Spread,
    /// 3 · steps + 2 · tests a ray over the same through the base's tree, which has no noise; `None` where the tracer counts neither.
    pub relative_work: Option<f64>,
}

/// What a code adds to the time of a build.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AddedTime {
    /// Scene name.
    pub scene: String,
    /// Its triangles.
    pub triangles: u64,
    /// The codes.
    pub codes: String,
    /// Builder with its codes, as `-b` takes it.
    pub builder: String,
    /// The builder that it is held against.
    pub base: String,
    /// Milliseconds of a build with the base's codes.
    pub base_ms: Spread,
    /// Milliseconds of a build with these.
    pub build_ms: Spread,
    /// What it takes longer, in percent, run by run.
    pub added_percent: Spread,
}

impl lines::Entry for CodesEntry {
    const FILE: &'static str = beside::CODES.records;
    const COMMAND: &'static str = "hedgerow codes";
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_entry_names_its_experiment() {
        let entry = CodesEntry::AddedTime(AddedTime {
            scene: "s".into(),
            triangles: 12,
            codes: "mip9".into(),
            builder: "lbvh:codes=mip9".into(),
            base: "lbvh:codes=emc64var-nosize".into(),
            base_ms: Spread::once(2.0),
            build_ms: Spread::once(3.0),
            added_percent: Spread::once(50.0),
        });
        let value = serde_json::to_value(&entry).expect("JSON");
        assert_eq!((&value["experiment"], &value["codes"]), (&"added-time".into(), &"mip9".into()));
        assert_eq!(serde_json::from_value::<CodesEntry>(value).expect("round trip"), entry);
    }
}
