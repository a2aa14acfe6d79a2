//! The lines of `fly.jsonl`. A figure that was not measured is `None`.

use super::cadence::Cadence;
use crate::measure::{Failure, Setting};
use serde::{Deserialize, Serialize};
use std::fmt;

/// What a line says, by its `experiment`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "experiment", rename_all = "lowercase")]
pub enum FlyEntry {
    /// The first line: where and how the others were measured.
    Setting(FlySetting),
    /// A scene, before its figures.
    Path(FlownPath),
    /// The first tree of a builder.
    Tree(FlownTree),
    /// A frame, with a builder at a cadence.
    Fly(FlownFrame),
    /// A builder that could not be measured, or not to its end.
    Failure(Failure<BuilderInFrame>),
}

/// Where and how it was measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FlySetting {
    /// As in every experiment.
    #[serde(flatten)]
    pub setting: Setting,
    /// Pixels of the pictures that were traced.
    pub size: [u32; 2],
    /// Pixels of the pictures that totals are for: tracing goes with their number. `gain` was flown for each of them.
    pub frame_sizes: Vec<[u32; 2]>,
}

/// A scene, and the way of its camera.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FlownPath {
    /// The scene.
    pub scene: String,
    /// Its triangles.
    pub triangles: u64,
    /// Where the path is from.
    pub path: String,
    /// Frames of the path.
    pub path_frames: u32,
    /// Seconds that it takes.
    pub seconds: f32,
    /// The frames that were measured, in this order.
    pub frames: Vec<u32>,
}

/// The quality of the first tree of a builder.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FlownTree {
    /// The scene.
    pub scene: String,
    /// The builder with its options.
    pub builder: String,
    /// The frame in which it was built.
    pub frame: u32,
    /// SAH cost, c_T = 3 and c_I = 2.
    pub sah: Option<f64>,
    /// End-point overlap, by the same costs.
    pub epo: Option<f64>,
}

/// A frame, with a builder at a cadence.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FlownFrame {
    /// The scene.
    pub scene: String,
    /// The builder with its options.
    pub builder: String,
    /// `never`, a number of frames, or `gain`.
    pub cadence: Cadence,
    /// Of `gain`, the picture for which it weighs builds against rays; `None` of others, which do not ask.
    pub frame_size: Option<[u32; 2]>,
    /// Which frame of the path, from 0.
    pub frame: u32,
    /// The frame in which the tree that is traced was built.
    pub built_at: u32,
    /// The frame whose camera and rays taught it: the one before it was built, with rays of another seed; `None` of builders that nothing
    /// teaches.
    pub taught_by: Option<u32>,
    /// Milliseconds of the build in this frame; 0 where the tree is kept. Trees of one builder and frame are built once, for all
    /// cadences. Rays that teach are those of a frame that was traced before, and are not in it.
    pub build_ms: f64,
    /// What the build was timed by: `device` (timestamps) or `wall`.
    pub timer: String,
    /// Milliseconds that `gain` takes to look, for its picture: a sample of rays through two trees; in the first frame also the build of
    /// the plain one.
    pub probe_ms: f64,
    /// Work of the sample over that through the plain tree; of `gain` alone.
    pub ratio: Option<f64>,
    /// The rays by kind, those of the small picture.
    pub trace: Vec<FlownRays>,
    /// Rays that taught the tree, where it learns from rays one by one.
    pub sample_rays: Option<u64>,
    /// Triangles that rays have seen, where it learns from these.
    pub seen_triangles: Option<u64>,
}

/// Rays of one kind.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FlownRays {
    /// The kind.
    pub rays: String,
    /// How many.
    pub count: u64,
    /// Tracing all of them once, in the median of the runs.
    pub trace_ms: f64,
    /// Inner nodes visited a ray.
    pub steps: Option<f64>,
    /// Triangles tested a ray.
    pub tests: Option<f64>,
}

/// A builder, and the frame in which it failed; `None` before the first.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BuilderInFrame {
    /// The scene.
    pub scene: String,
    /// The builder.
    pub builder: String,
    /// The frame.
    pub frame: Option<u32>,
}

impl fmt::Display for BuilderInFrame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.scene, self.builder)?;
        self.frame.map_or(Ok(()), |frame| write!(f, ", frame {frame}"))
    }
}

impl FlownRays {
    /// Work of all of them: 3 a step and 2 a test.
    pub fn work(&self) -> Option<f64> {
        Some(self.count as f64 * (3.0 * self.steps? + 2.0 * self.tests?))
    }
}

impl FlownFrame {
    /// Rays of all kinds.
    pub fn ray_count(&self) -> u64 {
        self.trace.iter().map(|rays| rays.count).sum()
    }

    /// Milliseconds of tracing all rays of the small picture.
    pub fn trace_ms(&self) -> f64 {
        self.trace.iter().map(|rays| rays.trace_ms).sum()
    }

    /// Work a ray, over all kinds: 3 a step and 2 a test.
    pub fn work(&self) -> Option<f64> {
        let all: Option<f64> = self.trace.iter().map(FlownRays::work).sum();
        Some(all? / self.ray_count() as f64)
    }
}
