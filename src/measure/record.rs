//! One line of `results.jsonl` (CONTRACT, "One record of results.jsonl"). A figure that was not measured is `None`.

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
    /// Layout: `bvh2`, `driver`, `host`.
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
    pub build: Build,
    /// Bytes.
    pub memory: Memory,
    /// Tree quality.
    pub quality: Quality,
    /// One entry a ray kind.
    pub trace: Vec<Trace>,
    /// Whether the structure was validated and a sample of rays agreed with brute force; `None` if not checked.
    pub valid: Option<bool>,
}

/// Build time over `runs` runs after a warm-up.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Build {
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
    pub phases: Vec<Phase>,
}

/// One phase of a build.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Phase {
    /// Its name.
    pub name: String,
    /// Median milliseconds.
    pub median_ms: f64,
}

/// Memory in bytes.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Memory {
    /// The finished structure.
    pub structure_bytes: Option<u64>,
    /// What the build needs beside it.
    pub scratch_bytes: Option<u64>,
    /// The most that was held at once.
    pub peak_bytes: Option<u64>,
}

/// Quality of a tree.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    /// SAH cost: (c_t · Σ SA(inner) + c_i · Σ SA(leaf)·n_leaf) / SA(root).
    pub sah: Option<f64>,
    /// Cost of a traversal step.
    pub c_t: f64,
    /// Cost of a triangle test.
    pub c_i: f64,
    /// End-point overlap (Aila, Karras, Laine 2013).
    pub epo: Option<f64>,
    /// Leaf count variability.
    pub lcv: Option<f64>,
    /// Inner nodes.
    pub inner: Option<u64>,
    /// Leaves.
    pub leaves: Option<u64>,
    /// Leaves without a primitive.
    pub empty_leaves: Option<u64>,
    /// Primitive references in all leaves.
    pub refs: Option<u64>,
    /// Mean depth of a leaf (the root has depth 0).
    pub depth_avg: Option<f64>,
    /// Depth of the deepest leaf.
    pub depth_max: Option<u64>,
    /// Mean primitives a leaf.
    pub prims_per_leaf: Option<f64>,
}

/// Tracing of one kind of ray.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Trace {
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
