//! One line of `results.jsonl` (CONTRACT, "One record of results.jsonl"). A figure that was not measured is `None`.

use super::statistics::Spread;
use serde::{Deserialize, Serialize};

/// Version of the record; a change of names or meanings bumps it.
pub const SCHEMA: u32 = 1;

/// One builder on one scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// [`SCHEMA`].
    pub schema: u32,
    /// Scene name.
    pub scene: String,
    /// Triangles in the scene.
    pub triangles: u64,
    /// Builder with its options, as `-b` takes it.
    pub builder: String,
    /// Layout: `bvh2`, `wide4`, `wide8`, `wide8q`, `kdtree`, `driver`, `host`.
    pub kind: String,
    /// Device name.
    pub device: String,
    /// Driver version.
    pub driver: String,
    /// Subgroup size; 0 for builders on the host.
    pub subgroup: u32,
    /// Commit of the program, with `+` behind it if the tree was dirty; `unknown` outside a checkout.
    pub commit: String,
    /// When, RFC 3339 UTC.
    pub when: String,
    /// Build time.
    pub build: BuildRecord,
    /// Bytes.
    pub memory: MemoryRecord,
    /// Tree quality.
    pub quality: QualityRecord,
    /// One entry a ray kind.
    pub trace: Vec<TraceRecord>,
    /// Whether the structure was validated and a sample of rays agreed with brute force; `None` if not checked.
    pub valid: Option<bool>,
}

/// Build time over `runs` runs after a warm-up.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct BuildRecord {
    /// Counted runs.
    pub runs: u32,
    /// Median milliseconds.
    pub median_ms: f64,
    /// Fastest run.
    pub min_ms: f64,
    /// Slowest run.
    pub max_ms: f64,
    /// Clock: `device` (timestamps) or `wall`.
    pub timer: String,
    /// Medians a phase, in order.
    pub phases: Vec<PhaseRecord>,
    /// Threads that built, of builders on the CPU. Not in the contract, as all below: where it is not known, the record has no
    /// such name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub threads: Option<u32>,
    /// Median milliseconds of CPU time that the process took, on all its threads.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cpu_median_ms: Option<f64>,
    /// Least CPU time of a run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cpu_min_ms: Option<f64>,
    /// Greatest CPU time of a run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cpu_max_ms: Option<f64>,
    /// Of builds by a task pool, median milliseconds in it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pool_ms: Option<f64>,
    /// Times that a worker took a task, or chunks of one, out of the pool: the median.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub retrievals: Option<u64>,
    /// Steps of tasks that a worker went on with by itself: the median.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub skipped_retrievals: Option<u64>,
}

impl From<&BuildRecord> for Spread {
    fn from(build: &BuildRecord) -> Spread {
        Spread { median: build.median_ms, min: build.min_ms, max: build.max_ms, runs: build.runs }
    }
}

/// One phase of a build.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PhaseRecord {
    /// Its name.
    pub name: String,
    /// Median milliseconds.
    pub median_ms: f64,
}

/// Memory in bytes.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct MemoryRecord {
    /// The finished structure.
    pub structure_bytes: Option<u64>,
    /// What the build needs beside it.
    pub scratch_bytes: Option<u64>,
    /// The most that was held at once, without the input.
    pub peak_bytes: Option<u64>,
}

/// Quality of a tree.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct QualityRecord {
    /// SAH cost: (c_t · Σ SA(inner) + c_i · Σ SA(leaf)·n_leaf) / SA(root).
    pub sah: Option<f64>,
    /// Cost of a traversal step: of visiting a node, whatever its width.
    pub c_t: f64,
    /// Cost of a triangle test.
    pub c_i: f64,
    /// End-point overlap (Aila, Karras, Laine 2013).
    pub epo: Option<f64>,
    /// Leaf count variability.
    pub lcv: Option<f64>,
    /// Inner nodes.
    pub inner: Option<u64>,
    /// Leaves, with those without a primitive.
    pub leaves: Option<u64>,
    /// Leaves without a primitive.
    pub empty_leaves: Option<u64>,
    /// Primitive references in all leaves.
    pub refs: Option<u64>,
    /// Mean depth of a leaf (the root has depth 0).
    pub depth_avg: Option<f64>,
    /// Depth of the deepest leaf.
    pub depth_max: Option<u64>,
    /// Mean primitives a leaf that has any.
    pub prims_per_leaf: Option<f64>,
    /// Most primitives in a leaf. Not in the contract: where it was not measured, the record has no such name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prims_per_leaf_max: Option<u64>,
    /// The first sum of the SAH cost, Σ SA(inner) / SA(root). Not in the contract either, nor is the second.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sah_inner: Option<f64>,
    /// The second sum, Σ SA(leaf)·n_leaf / SA(root).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sah_leaf: Option<f64>,
}

impl QualityRecord {
    /// The figures of a walk over a tree.
    pub fn of(quality: &hedgerow::bvh::quality::Quality, c_t: f64, c_i: f64) -> QualityRecord {
        QualityRecord {
            sah: Some(quality.sah),
            c_t,
            c_i,
            inner: Some(quality.inner),
            leaves: Some(quality.leaves),
            empty_leaves: Some(quality.empty_leaves),
            refs: Some(quality.refs),
            depth_avg: Some(quality.depth_avg),
            depth_max: Some(u64::from(quality.depth_max)),
            prims_per_leaf: Some(quality.prims_per_leaf()),
            prims_per_leaf_max: Some(quality.leaf_max.into()),
            sah_inner: Some(quality.sah_inner),
            sah_leaf: Some(quality.sah_leaf),
            ..QualityRecord::default()
        }
    }
}

/// Tracing of one kind of ray.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TraceRecord {
    /// Ray kind.
    pub rays: String,
    /// How many.
    pub count: u64,
    /// How many hit.
    pub hits: u64,
    /// Millions of rays a second, median.
    pub mrays_s: f64,
    /// Inner nodes visited a ray.
    pub steps: Option<f64>,
    /// Triangles tested a ray.
    pub tests: Option<f64>,
    /// Counted runs.
    pub runs: u32,
    /// Sum of t over the hits (of hits, for any-hit), as decimal.
    pub checksum: String,
}

impl Record {
    /// Millions of triangles built a second, by the median.
    pub fn mtris_s(&self) -> f64 {
        self.triangles as f64 / (self.build.median_ms * 1e3)
    }

    /// Seconds that all rays of all kinds take. `None` without tracing.
    pub fn rays_s(&self) -> Option<f64> {
        let time: f64 = self.trace.iter().map(|t| t.count as f64 / (t.mrays_s * 1e6)).sum();
        (!self.trace.is_empty() && time.is_finite()).then_some(time)
    }

    /// Millions of rays traced a second over all kinds together: all rays over the time of all. `None` without tracing.
    pub fn mrays_s(&self) -> Option<f64> {
        let rays: f64 = self.trace.iter().map(|t| t.count as f64).sum();
        self.rays_s().filter(|_| rays > 0.0).map(|time| rays * 1e-6 / time)
    }

    /// Tracing of one kind of ray, where it was measured.
    pub fn rays(&self, kind: &str) -> Option<&TraceRecord> {
        self.trace.iter().find(|t| t.rays == kind)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of the contract, word for word.
    const EXAMPLE: &str = r#"{"schema":1,"scene":"sponza","triangles":262267,"builder":"lbvh:codes=emc64var","kind":"bvh2",
 "device":"llvmpipe (LLVM 15.0.6, 256 bits)","driver":"Mesa 25.0.7","subgroup":8,"commit":"abc1234","when":"2026-11-21T10:00:00Z",
 "build":{"runs":5,"median_ms":1.0,"min_ms":1.0,"max_ms":1.1,"timer":"device","phases":[{"name":"encode","median_ms":0.1}]},
 "memory":{"structure_bytes":1,"scratch_bytes":1,"peak_bytes":1},
 "quality":{"sah":1.0,"c_t":3.0,"c_i":2.0,"epo":null,"lcv":null,"inner":1,"leaves":1,"empty_leaves":0,"refs":1,"depth_avg":1.0,"depth_max":1,"prims_per_leaf":1.0},
 "trace":[{"rays":"primary","count":1,"hits":1,"mrays_s":1.0,"steps":1.0,"tests":1.0,"runs":5,"checksum":"sum of t over hits, as decimal"}],
 "valid":true}"#;

    fn example() -> Record {
        serde_json::from_str(EXAMPLE).expect("the contract's example is a record")
    }

    #[test]
    fn a_record_has_the_names_of_the_contract_and_no_others() {
        let contract: serde_json::Value = serde_json::from_str(EXAMPLE).expect("JSON");
        assert_eq!(serde_json::to_value(example()).expect("a record is JSON"), contract);
    }

    #[test]
    fn the_order_of_the_names_is_that_of_the_contract() {
        let packed = EXAMPLE.replace("\n ", "");
        assert_eq!(serde_json::to_string(&example()).expect("a record is JSON"), packed);
    }

    #[test]
    fn a_figure_that_was_not_measured_is_null() {
        let mut record = example();
        record.quality = QualityRecord { c_t: 3.0, c_i: 2.0, ..QualityRecord::default() };
        record.valid = None;
        let value = serde_json::to_value(&record).expect("a record is JSON");
        assert!(value["quality"]["sah"].is_null() && value["valid"].is_null(), "{value}");
        assert_eq!(serde_json::from_value::<Record>(value).expect("round trip"), record);
    }

    #[test]
    fn speeds_follow_from_times() {
        let mut record = example();
        record.triangles = 1_000_000;
        record.build.median_ms = 250.0;
        assert_eq!(record.mtris_s(), 4.0);
        // 2 million rays at 1 Mray/s and 2 million at 4 Mrays/s: 4 million in 2.5 s.
        let trace = |mrays_s| TraceRecord { count: 2_000_000, mrays_s, ..record.trace[0].clone() };
        record.trace = vec![trace(1.0), trace(4.0)];
        assert_eq!(record.mrays_s(), Some(1.6));
        record.trace.clear();
        assert_eq!(record.mrays_s(), None);
    }
}
