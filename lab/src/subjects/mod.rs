//! What is measured: a builder on a scene, behind one interface, ours and the peers' alike.

pub mod any_hit;
pub mod auto;
pub mod build_memory;
pub mod builders;
pub mod counted;
pub mod device_bvh;
pub mod device_rays;
pub mod host;
pub mod host_build;
pub mod host_rays;
pub mod kd_device;
pub mod kd_gpu;
pub mod kd_host;
pub mod level;
pub mod levels;
pub mod peers;
pub mod preference;
pub mod queries;
pub mod retraced;
pub mod structures;
pub mod taught;
pub mod taught_rounds;
pub mod wide;

use crate::Result;
use crate::device::Device;
use crate::measure::overlap::Epo;
use crate::measure::record;
use crate::scene::Frame;
use hedgerow::bvh::layout::Bvh2;
use hedgerow::gpu;
use hedgerow::kdtree::{self, layout::KdTree};
use hedgerow::trace::{Hit, Query, Ray, Work};
use std::borrow::Cow;

/// [`Subject::kind`] of kd-trees.
pub const KD_TREE: &str = "kdtree";

/// One build under the clock.
#[derive(Debug, Clone, PartialEq)]
pub struct BuildRun {
    /// Milliseconds in all.
    pub milliseconds: f64,
    /// The phases, where the builder knows them; they sum to `milliseconds` or a little less.
    pub phases: Vec<gpu::Phase>,
    /// What it took beside time, where it ran on the CPU.
    pub on_cpu: Option<OnCpu>,
    /// What its task pool did, where it has one.
    pub pool: Option<InPool>,
}

/// What a task pool did in a build.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InPool {
    /// Milliseconds in the pool.
    pub milliseconds: f64,
    /// Times that a worker took something out of it.
    pub retrievals: u32,
    /// Steps that a worker went on with by itself.
    pub skipped: u32,
}

/// What a build on the CPU took beside wall-clock time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OnCpu {
    /// Threads that built.
    pub threads: u32,
    /// Milliseconds of CPU time of the process, on all its threads.
    pub milliseconds: f64,
}

impl BuildRun {
    /// One whose phases are not known.
    pub fn whole(milliseconds: f64) -> BuildRun {
        BuildRun { milliseconds, phases: Vec::new(), on_cpu: None, pool: None }
    }

    /// One of these phases, of which those of the same name are one.
    pub fn of(all: Vec<gpu::Phase>) -> BuildRun {
        let milliseconds = all.iter().map(|phase| phase.milliseconds).sum();
        let mut phases: Vec<gpu::Phase> = Vec::new();
        for phase in all {
            match phases.iter_mut().find(|p| p.name == phase.name) {
                Some(same) => same.milliseconds += phase.milliseconds,
                None => phases.push(phase),
            }
        }
        BuildRun { milliseconds, phases, on_cpu: None, pool: None }
    }
}

/// Several choices in one, if there are any.
fn joined_choices(choices: impl IntoIterator<Item = Option<String>>) -> Option<String> {
    let all: Vec<String> = choices.into_iter().flatten().collect();
    (!all.is_empty()).then(|| all.join(", "))
}

/// What a structure of ours says of how it was built.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Outcome {
    /// Primitives that are in it.
    pub active: u32,
    /// Bits of [`hedgerow::bvh::layout::status`].
    pub status: u32,
}

/// Dispatches of a build that are phases of their own where each is one; what is behind them is one more.
const PHASES_BY_KERNEL: u32 = 8192;

/// A builder on a scene, which may move. Whatever is uploaded once is uploaded when the subject is made, not under the clock.
///
/// Order of calls: `build` first, any number of times, `place` before it for what moves; then the others.
pub trait Subject {
    /// Builder with its options, as `-b` takes it.
    fn builder(&self) -> &str;
    /// `bvh2`, `wide4`, `wide8`, `wide8q`, `kdtree`, `driver` (two levels, by Vulkan's calls) or `host`.
    fn kind(&self) -> &'static str;
    /// The device, where it builds and traces there.
    fn device(&self) -> Option<&Device> {
        None
    }
    /// `device` where build times are timestamps, otherwise `wall`.
    fn timer(&self) -> &'static str {
        self.device().map_or("wall", Device::timer)
    }
    /// Whether rays are traced on the device.
    fn traces_on_device(&self) -> bool {
        self.device().is_some() || self.timer() == "device"
    }
    /// From now on phases of builds are the device's kernels, where it has several.
    ///
    /// # Errors
    /// Too little memory.
    fn time_kernels(&mut self) -> Result<()> {
        Ok(())
    }
    /// Brings what moves to where it stands in a frame, for the next build; not under the clock. What does not move stays.
    ///
    /// # Errors
    /// Too little memory.
    fn place(&mut self, _frame: &Frame<'_>) -> Result<()> {
        Ok(())
    }
    /// Builds once, from the triangles, into the same memory as before.
    ///
    /// # Errors
    /// The device failed.
    fn build(&mut self) -> Result<BuildRun>;
    /// Bytes of structure and scratch.
    fn memory(&self) -> record::MemoryRecord;
    /// Quality of the built tree with the costs of a step and of a test; figures that the builder cannot tell are `None`, as they
    /// are where rays go through several trees.
    ///
    /// # Errors
    /// The device failed.
    fn quality(&mut self, c_t: f64, c_i: f64) -> Result<record::QualityRecord> {
        Ok(match self.kd_tree()? {
            Some(tree) => record::QualityRecord::of(&kdtree::quality::on_host(&tree, c_t, c_i), c_t, c_i),
            None => record::QualityRecord { c_t, c_i, ..Default::default() },
        })
    }
    /// End-point overlap of the built tree with the costs of a step and of a test, if `epo` asks for it; `None` where it was not
    /// measured.
    ///
    /// # Errors
    /// The device failed.
    fn epo(&mut self, _c_t: f64, _c_i: f64, _epo: Epo) -> Result<Option<f64>> {
        Ok(None)
    }
    /// The BVH on the host, where it is one and its layout is ours.
    ///
    /// # Errors
    /// The device failed.
    fn tree(&mut self) -> Result<Option<Bvh2>> {
        Ok(None)
    }
    /// The kd-tree on the host, where it is one.
    ///
    /// # Errors
    /// The device failed.
    fn kd_tree(&mut self) -> Result<Option<Cow<'_, KdTree>>> {
        Ok(None)
    }
    /// What the built structure's header says, where its layout is ours.
    ///
    /// # Errors
    /// The device failed.
    fn outcome(&mut self) -> Result<Option<Outcome>> {
        if let Some(tree) = self.kd_tree()? {
            return Ok(Some(Outcome { active: tree.header.active, status: tree.header.status }));
        }
        Ok(self.tree()?.map(|tree| Outcome { active: tree.header.active, status: tree.header.status }))
    }
    /// The bytes of what is traced, where they are ours to read: the same input gives the same.
    ///
    /// # Errors
    /// The device failed.
    fn bytes(&mut self) -> Result<Option<Vec<u8>>> {
        match self.kd_tree()? {
            Some(tree) => Ok(Some(tree.to_bytes())),
            None => Ok(self.tree()?.map(|tree| tree.to_bytes())),
        }
    }
    /// Walks the parts of the build that have our layout.
    ///
    /// # Errors
    /// [`hedgerow::Error::InvalidStructure`] says what is wrong; the device failed.
    fn validate(&mut self) -> Result<()> {
        match self.kd_tree()? {
            Some(tree) => Ok(tree.validate()?),
            None => Ok(self.tree()?.map_or(Ok(()), |tree| tree.validate())?),
        }
    }
    /// What the builder chose where it was left the choice, in a few words (`emc64var/32, chain`); `None` if nothing.
    fn choice(&self) -> Option<String> {
        None
    }
    /// Bytes that a phase must move: each of its inputs read once, each of its outputs written once; `None` if not known.
    fn traffic(&self, _phase: &str) -> Option<u64> {
        None
    }
    /// Brings rays to where they are traced; not under the clock.
    ///
    /// # Errors
    /// Too little memory.
    fn set_rays(&mut self, rays: &[Ray]) -> Result<()>;
    /// Traces the rays once; milliseconds by timestamps where that is on the device, otherwise of wall-clock time.
    ///
    /// # Errors
    /// The device failed.
    fn trace(&mut self, query: Query) -> Result<f64>;
    /// The hits of the last `trace`, one a ray.
    ///
    /// # Errors
    /// The device failed.
    fn hits(&mut self) -> Result<Vec<Hit>>;
    /// Traces these rays once, and gives their hits.
    ///
    /// # Errors
    /// Too little memory; the device failed.
    fn hits_of(&mut self, rays: &[Ray], query: Query) -> Result<Vec<Hit>> {
        self.set_rays(rays)?;
        self.trace(query)?;
        self.hits()
    }
    /// Steps and tests of every ray, through all trees, where the tracer counts them; not under the clock.
    ///
    /// # Errors
    /// The device failed.
    fn work(&mut self, _query: Query) -> Result<Option<Vec<Work>>> {
        Ok(None)
    }
}
