//! A line of `predict.jsonl`: a tree on a scene, its static figures, and what rays took through it.

use super::choice::REFERENCE;
use super::published;
use crate::Result;
use crate::measure::Spread;
use crate::report::{beside, lines};
use crate::subjects::retraced::TreeTracer;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// A tree on a scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TreeRecord {
    /// [`crate::measure::record::SCHEMA`].
    pub schema: u32,
    /// Scene name.
    pub scene: String,
    /// Triangles of the scene.
    pub triangles: u64,
    /// Builder with its options, as `-b` takes it.
    pub builder: String,
    /// The builder whose tree it is held against.
    pub reference: String,
    /// Milliseconds of a build.
    pub build_ms: Spread,
    /// Their clock: `device` or `wall`.
    pub timer: String,
    /// SAH cost, 3 a step and 2 a test.
    pub sah: f64,
    /// End-point overlap with the same costs, from some of the surfaces; `None` where it was given up.
    pub epo: Option<f64>,
    /// Leaf count variability over `diffuse1` rays.
    pub lcv: Option<f64>,
    /// C_F by heuristic, with the same costs; those are missing that know nothing of the scene.
    pub own: BTreeMap<String, f64>,
    /// Rays through it on the host.
    pub host: Vec<RaysRecord>,
    /// Rays through it on the device.
    pub device: Vec<RaysRecord>,
}

/// Rays of a kind through a tree.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RaysRecord {
    /// Their kind.
    pub rays: String,
    /// How many.
    pub count: u64,
    /// Nanoseconds a ray.
    pub ns: Spread,
    /// Inner nodes visited a ray.
    pub steps: f64,
    /// Triangles tested a ray.
    pub tests: f64,
}

impl TreeRecord {
    /// The rays of a tracer.
    pub fn rays(&self, tracer: TreeTracer) -> &[RaysRecord] {
        match tracer {
            TreeTracer::Host => &self.host,
            TreeTracer::Device => &self.device,
        }
    }

    /// All kinds of rays together, each by its number; `None` without any.
    pub fn all_rays(&self, tracer: TreeTracer) -> Option<RaysRecord> {
        let all = self.rays(tracer);
        let count: u64 = all.iter().map(|rays| rays.count).sum();
        let mean = |of: fn(&RaysRecord) -> f64| {
            all.iter().map(|rays| rays.count as f64 * of(rays)).sum::<f64>() / count as f64
        };
        let ns = Spread {
            median: mean(|rays| rays.ns.median),
            min: mean(|rays| rays.ns.min),
            max: mean(|rays| rays.ns.max),
            runs: all.first()?.ns.runs,
        };
        let (steps, tests) = (mean(|rays| rays.steps), mean(|rays| rays.tests));
        (count > 0).then(|| RaysRecord { rays: published::ALL_RAYS.into(), count, ns, steps, tests })
    }

    /// Whether the others of its scene are held against it.
    pub fn is_reference(&self) -> bool {
        self.builder == self.reference
    }
}

/// The records of a `predict.jsonl`, or of the one in a folder.
///
/// # Errors
/// The file cannot be read; a line is not a record of this schema.
pub fn read(path: &Path) -> Result<Vec<TreeRecord>> {
    lines::read(path, (beside::PREDICT.records, "hedgerow predict"), |record: &TreeRecord| record.schema, |_| None)
}

/// A name for people: options that all trees by heuristics share are left out.
pub fn short(builder: &str) -> String {
    match builder {
        REFERENCE => "binned by area".into(),
        _ => crate::report::short(builder).replace("binned axes all, bins 10, heuristic", "binned"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_rays_together_count_by_their_number() {
        let rays = |rays: &str, count, ns| RaysRecord {
            rays: rays.into(),
            count,
            ns: Spread { median: ns, min: 0.5 * ns, max: 2.0 * ns, runs: 3 },
            steps: 0.1 * ns,
            tests: 1.0,
        };
        let record = TreeRecord {
            schema: 1,
            scene: "s".into(),
            triangles: 2,
            builder: "b".into(),
            reference: "b".into(),
            build_ms: Spread::once(1.0),
            timer: "wall".into(),
            sah: 9.0,
            epo: None,
            lcv: None,
            own: BTreeMap::new(),
            host: vec![rays("primary", 100, 100.0), rays("ao", 300, 500.0)],
            device: Vec::new(),
        };
        let all = record.all_rays(TreeTracer::Host).expect("two kinds");
        assert_eq!((all.count, all.ns.median, all.ns.min, all.steps), (400, 400.0, 200.0, 40.0));
        assert_eq!(record.all_rays(TreeTracer::Device), None);
        let line = serde_json::to_string(&record).expect("JSON");
        assert_eq!(serde_json::from_str::<TreeRecord>(&line).expect("a record"), record);
    }

    #[test]
    fn names_are_short() {
        assert_eq!(short(REFERENCE), "binned by area");
        assert_eq!(short("binned:axes=all:bins=10:heuristic=rdh"), "binned rdh");
        assert_eq!(short("hploc:optimise=high"), "hploc optimise high");
    }
}
