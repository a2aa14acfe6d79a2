//! The lines of `accel.jsonl` (CONTRACT, "Records of experiments"). A figure that was not measured is `None`.

use crate::measure::{Failure, Setting, Spread};
use crate::named::named;
use crate::subjects::preference::Preference;
use crate::subjects::queries::MeanWork;
use serde::{Deserialize, Serialize};

/// What a line says, by its `experiment`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "experiment", rename_all = "lowercase")]
pub enum AccelEntry {
    /// The first line: where and how the others were measured.
    Setting(Setting),
    /// Many small structures, built in one way.
    Batch(Batch),
    /// A top level over this many instances.
    Tlas(TopLevel),
    /// A scene of instances, re-braided and not.
    Rebraid(RebraidPoint),
    /// A scene of instances, its children in order for rays that end at any hit, and not.
    #[serde(rename = "any-hit")]
    AnyHit(AnyHitPoint),
    /// A frame of an animation.
    Update(Update),
    /// A bottom level over a scene.
    Memory(MemoryPoint),
    /// An experiment that could not be measured, or not to its end.
    Failure(Failure),
}

/// Whose structures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Implementation {
    /// Ours.
    Ours,
    /// The driver's.
    Driver,
}

named!(Implementation, "maker": Ours = "hedgerow", Driver = "driver");

/// How many structures are built.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Submission {
    /// All in one call.
    OneCall,
    /// The same with the arguments in memory: ours only.
    OneTable,
    /// A call each with a barrier behind it, all in one command buffer.
    OneSubmit,
    /// A call each, submitted and waited for by itself.
    SubmitEach,
    /// As many submits with nothing in them: what of [`Submission::SubmitEach`] is not building.
    EmptySubmits,
}

named!(Submission, "submission":
    OneCall = "one call",
    OneTable = "one call, arguments in memory",
    OneSubmit = "a call each, one submit",
    SubmitEach = "a call and submit each",
    EmptySubmits = "as many empty submits",
);

/// Structures of 12 to 500 triangles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Batch {
    /// How many.
    pub structures: u32,
    /// Triangles of all together.
    pub triangles: u64,
    /// What the builds prefer; a fast build in records of before 27 November 2026.
    #[serde(default = "fast_build")]
    pub prefer: Preference,
    /// Whose; nobody's are [`Submission::EmptySubmits`].
    pub maker: Option<Implementation>,
    /// How they are built.
    pub way: Submission,
    /// By the wall's clock, from before the recording to behind the wait.
    pub wall_ms: Spread,
    /// Its time over that of ours in one call, run by run.
    pub over_our_call: Spread,
}

fn fast_build() -> Preference {
    Preference::FastBuild
}

/// A top level.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TopLevel {
    /// Instances.
    pub instances: u32,
    /// Whose.
    pub maker: Implementation,
    /// By the device's timestamps.
    pub build_ms: Spread,
    /// In place, with every instance moved.
    pub update_ms: Option<Spread>,
    /// The structure.
    pub structure_bytes: u64,
    /// What a build needs beside it.
    pub scratch_bytes: u64,
}

/// A scene of instances under top levels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RebraidPoint {
    /// Scene name.
    pub scene: String,
    /// Instances.
    pub instances: u32,
    /// What they are instances of.
    pub parts: u32,
    /// Triangles, each as often as it is seen.
    pub triangles: u64,
    /// How many other instances' boxes each one's overlaps, in the mean (over some hundred, where there are many).
    pub overlaps: f64,
    /// Ours, with no instance opened.
    pub off: TopLevelPoint,
    /// Ours, re-braided.
    pub on: TopLevelPoint,
    /// The driver's.
    pub driver: Option<TopLevelPoint>,
    /// One entry a kind of ray.
    pub rays: Vec<FlaggedRays>,
}

/// One of the top levels that are compared.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TopLevelPoint {
    /// Building the top level, by the device's timestamps.
    pub build_ms: Spread,
    /// The top level.
    pub structure_bytes: u64,
    /// What its build needs beside it.
    pub scratch_bytes: u64,
    /// What its leaves hold: instances, those that were opened as their parts; `None` if the implementation does not report it.
    pub entries: Option<u32>,
}

/// A bottom level over a scene, built so that it can be compacted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MemoryPoint {
    /// Scene name.
    pub scene: String,
    /// Triangles.
    pub triangles: u64,
    /// Whose.
    pub maker: Implementation,
    /// Whether its nodes are quantised and have eight children.
    pub of_eight: bool,
    /// Preferences that it was built by.
    pub flags: String,
    /// Building it, by the device's timestamps.
    pub build_ms: Spread,
    /// The structure, as it is asked for.
    pub structure_bytes: u64,
    /// What a build needs beside it.
    pub scratch_bytes: u64,
    /// A compacted copy.
    pub compacted_bytes: Option<u64>,
}

impl MemoryPoint {
    /// So many bytes, for each triangle.
    pub fn each(&self, bytes: u64) -> f64 {
        bytes as f64 / self.triangles.max(1) as f64
    }

    /// Structure and scratch memory, bytes a triangle.
    pub fn with_scratch(&self) -> f64 {
        self.each(self.structure_bytes + self.scratch_bytes)
    }

    /// The compacted copy, bytes a triangle.
    pub fn compacted(&self) -> Option<f64> {
        self.compacted_bytes.map(|bytes| self.each(bytes))
    }
}

/// A scene of instances whose structures of both levels have their children in order, or not.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AnyHitPoint {
    /// Scene name.
    pub scene: String,
    /// Instances.
    pub instances: u32,
    /// What they are instances of.
    pub parts: u32,
    /// Triangles, each as often as it is seen.
    pub triangles: u64,
    /// Building our top level, plain.
    pub off_build_ms: Spread,
    /// Building our top level with the flag `ANY_HIT_ORDER`.
    pub on_build_ms: Spread,
    /// One entry a kind of ray that ends at any hit.
    pub rays: Vec<FlaggedRays>,
}

/// Rays of a kind through structures that were built without a flag, and with it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FlaggedRays {
    /// Ray kind.
    pub rays: String,
    /// How many.
    pub count: u64,
    /// How many hit.
    pub hits: u64,
    /// Of how many those of ours say different hits; there should be none.
    pub different: u64,
    /// Without the flag, by the device's timestamps.
    pub off_ms: Spread,
    /// With it.
    pub on_ms: Spread,
    /// With it, many rays for each invocation in turn (`glsl/trace/query_turns.glsl`); records of before have none.
    #[serde(default)]
    pub in_turn_ms: Option<Spread>,
    /// Through the driver's.
    pub driver_ms: Option<Spread>,
    /// Time without over time with it, run by run: above 1, rays are faster with the flag.
    pub gain: Spread,
    /// Work a ray without it.
    pub off_work: MeanWork,
    /// Work a ray with it.
    pub on_work: MeanWork,
}

/// A frame of an animation, with the structure of the first frame updated, and built again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Update {
    /// Scene name.
    pub scene: String,
    /// Triangles.
    pub triangles: u64,
    /// The frame; the first is 0.
    pub frame: u32,
    /// Whose.
    pub maker: Implementation,
    /// Building again, by the device's timestamps.
    pub build_ms: Spread,
    /// Updating in place.
    pub update_ms: Option<Spread>,
    /// How many times the SAH cost of the updated structure is what it was when built, as the structure itself reports.
    pub growth: Option<f64>,
    /// SAH cost of the updated structure.
    pub updated_sah: Option<f64>,
    /// SAH cost of that which was built again.
    pub built_sah: Option<f64>,
    /// One entry a kind of ray.
    pub rays: Vec<UpdatedRays>,
}

/// Rays of a kind through both.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct UpdatedRays {
    /// Ray kind.
    pub rays: String,
    /// How many.
    pub count: u64,
    /// Through the structure that was built again, by the device's timestamps.
    pub built_ms: Spread,
    /// Through the updated one.
    pub updated_ms: Option<Spread>,
    /// Time through the updated one over that through the other, run by run: above 1, updating has cost speed.
    pub slowdown: Option<Spread>,
}

impl Update {
    /// Time of all rays through the updated structure over that through the one built again.
    pub fn slowdown(&self) -> Option<f64> {
        let [updated, built] = self.tracing()?;
        Some(updated / built)
    }

    /// From how many rays a frame on, in the mix that was traced, building again takes less time than updating: what a build
    /// takes longer, over what a ray does. `None` if never, or if it was not measured.
    pub fn pays_from(&self) -> Option<f64> {
        let rays: f64 = self.rays.iter().map(|rays| rays.count as f64).sum();
        let [updated, built] = self.tracing()?;
        let longer = (self.build_ms.median - self.update_ms?.median).max(0.0);
        (updated > built).then(|| longer / ((updated - built) / rays))
    }

    /// Milliseconds of all rays: through the updated structure, and through the other. The first follow from the ratios, which
    /// are taken run by run: what slowed down all runs of one of them is not told from a worse tree otherwise.
    fn tracing(&self) -> Option<[f64; 2]> {
        let built: f64 = self.rays.iter().map(|rays| rays.built_ms.median).sum();
        let updated: Option<f64> =
            self.rays.iter().map(|rays| Some(rays.built_ms.median * rays.slowdown?.median)).sum();
        Some([updated?, built]).filter(|_| built > 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spread(median: f64) -> Spread {
        Spread { median, min: 0.9 * median, max: 1.1 * median, runs: 3 }
    }

    fn frame(build: f64, update: f64, [built, updated]: [f64; 2]) -> Update {
        let rays = UpdatedRays {
            rays: "primary".into(),
            count: 1000,
            built_ms: spread(built),
            updated_ms: Some(spread(updated)),
            slowdown: Some(spread(updated / built)),
        };
        Update {
            scene: "twist".into(),
            triangles: 12,
            frame: 1,
            maker: Implementation::Ours,
            build_ms: spread(build),
            update_ms: Some(spread(update)),
            growth: Some(1.5),
            updated_sah: None,
            built_sah: None,
            rays: vec![rays],
        }
    }

    #[test]
    fn an_entry_names_its_experiment_and_what_was_not_measured_is_null() {
        let line = AccelEntry::Update(frame(4.0, 1.0, [2.0, 3.0]));
        let value = serde_json::to_value(&line).expect("JSON");
        assert_eq!(value["experiment"], "update");
        assert_eq!((&value["maker"], &value["growth"]), (&"ours".into(), &1.5.into()));
        assert!(value["built_sah"].is_null(), "{value}");
        assert_eq!(serde_json::from_value::<AccelEntry>(value).expect("round trip"), line);
        let text = serde_json::to_string(&line).expect("JSON");
        assert_eq!(serde_json::from_str::<AccelEntry>(&text).expect("round trip"), line);
    }

    #[test]
    fn building_anew_pays_when_the_rays_save_what_it_takes_longer() {
        // 3 ms longer to build, 1 µs a ray saved.
        assert_eq!(frame(4.0, 1.0, [2.0, 3.0]).pays_from().map(f64::round), Some(3000.0));
        assert_eq!(frame(4.0, 1.0, [3.0, 3.0]).pays_from(), None, "no ray is faster");
        assert_eq!(frame(1.0, 4.0, [2.0, 3.0]).pays_from(), Some(0.0), "nothing is longer");
        let mut unmeasured = frame(4.0, 1.0, [2.0, 3.0]);
        unmeasured.rays[0].slowdown = None;
        assert_eq!((unmeasured.pays_from(), unmeasured.slowdown()), (None, None));
        assert_eq!(frame(4.0, 1.0, [2.0, 3.0]).slowdown(), Some(1.5));
    }
}
