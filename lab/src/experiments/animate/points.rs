//! The lines of `animate.jsonl`. A figure that was not measured is `None`.

use super::AnimationMethod;
use crate::measure::{Failure, MemoryRecord, Setting, Spread};
use serde::{Deserialize, Serialize};
use std::fmt;

/// What a line says, by its `experiment`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "experiment", rename_all = "lowercase")]
pub enum AnimateEntry {
    /// The first line: where and how the others were measured.
    Setting(SceneSetting),
    /// A frame in one of the ways.
    Animate(Animated),
    /// A way that could not be measured, or not to its end, or found something else than the first.
    Failure(Failure<WayInFrame>),
}

/// Where, how and of what it was measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SceneSetting {
    /// As in every experiment.
    #[serde(flatten)]
    pub setting: Setting,
    /// The scene's name.
    pub scene: String,
    /// Triangles that stand still.
    pub static_triangles: u64,
    /// What moves.
    pub objects: Vec<Object>,
    /// The builder of the tree of what stands still.
    pub static_builder: String,
    /// Pictures of frames, in files beside the records: the frame and the file.
    pub pictures: Vec<(u32, String)>,
}

/// Something that moves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Object {
    /// What the scene calls it.
    pub name: String,
    /// Its triangles.
    pub triangles: u64,
    /// Whether it changes its shape.
    pub morphs: bool,
}

/// A frame in one of the ways.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Animated {
    /// The scene.
    pub scene: String,
    /// Which frame, from 0.
    pub frame: u32,
    /// When it is, in seconds.
    pub time: f32,
    /// The way.
    pub way: AnimationMethod,
    /// The builder of what is built each frame; `accel` for two levels.
    pub builder: String,
    /// What the builds were timed by: `device` (timestamps) or `wall`.
    pub timer: String,
    /// Triangles that stand still.
    pub static_triangles: u64,
    /// Triangles that move.
    pub dynamic_triangles: u64,
    /// All that is done a frame to have something that can be traced.
    pub build_ms: Spread,
    /// The rays, by kind.
    pub trace: Vec<Rays>,
    /// Memory of all structures together.
    pub memory: MemoryRecord,
    /// SAH cost, where rays go through one tree.
    pub sah: Option<f64>,
}

/// Rays of one kind.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Rays {
    /// The kind.
    pub rays: String,
    /// How many.
    pub count: u64,
    /// How many hit something.
    pub hits: u64,
    /// Tracing all of them once.
    pub trace_ms: Spread,
    /// Inner nodes visited a ray, in all trees.
    pub steps: Option<f64>,
    /// Triangles tested a ray.
    pub tests: Option<f64>,
    /// The sum of t over the hits, as decimal.
    pub checksum: String,
    /// Rays whose hits are not those of the first way: bit for bit between kd-trees, otherwise but for what rounding decides.
    pub different: u64,
}

/// A way, and the frame in which it failed; `None` before the first.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WayInFrame {
    /// The way.
    pub way: AnimationMethod,
    /// The frame.
    pub frame: Option<u32>,
}

impl fmt::Display for WayInFrame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.way.fmt(f)?;
        self.frame.map_or(Ok(()), |frame| write!(f, ", frame {frame}"))
    }
}

impl Animated {
    /// Tracing all rays of the frame, in the median of the runs: milliseconds.
    pub fn trace_ms(&self) -> f64 {
        self.trace.iter().map(|rays| rays.trace_ms.median).sum()
    }

    /// Building and tracing: milliseconds.
    pub fn frame_ms(&self) -> f64 {
        self.build_ms.median + self.trace_ms()
    }
}
