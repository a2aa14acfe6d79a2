//! kd-trees built and traced on the device as subjects: `kd-gpu`.

use super::build_memory::{BuildMemory, DeviceMesh, check_memory};
use super::kd_device::KdDevice;
use super::{BuildRun, InPool, KD_TREE, PHASES_BY_KERNEL, Subject};
use crate::device::Device;
use crate::measure::record;
use crate::scene::Mesh;
use crate::{Error, Result};
use hedgerow::bvh::builder::Input;
use hedgerow::bvh::layout::status;
use hedgerow::gpu::{Phase, Recorder, Sizes, Timestamps};
use hedgerow::kdtree::builder::{KdBuilder, KdOptions, KdReport};
use hedgerow::kdtree::layout::{KdTree, MAX_DEPTH};
use hedgerow::trace::kd::Traversal;
use hedgerow::trace::{Hit, Query, Ray, Work};
use std::borrow::Cow;

/// Phases of a build at most: encode, five of each level, place.
const PHASES: u32 = 5 * (MAX_DEPTH + 1) + 2;
/// Builds until there is room for all: each may find that levels need twice as much.
const ATTEMPTS: u32 = 8;

/// A scene in our kd-tree, built and traced on the device.
pub struct KdGpu<'a> {
    device: &'a Device,
    name: String,
    options: KdOptions,
    mesh: DeviceMesh<'a>,
    place: PlacedBuilder<'a>,
    /// Whether the memory is as large as the last build has found that the scene needs.
    fits: bool,
    timestamps: Timestamps,
    tracer: KdDevice<'a>,
}

/// A builder and its memory.
struct PlacedBuilder<'a> {
    builder: KdBuilder,
    memory: BuildMemory<'a>,
}

impl<'a> PlacedBuilder<'a> {
    fn new(device: &'a Device, name: &str, options: &KdOptions, input: &Input) -> Result<PlacedBuilder<'a>> {
        let count = input.primitive_count;
        let builder = KdBuilder::new(device, options, count)?;
        let sizes = builder.sizes();
        check_memory(device, name, count, sizes.structure + sizes.scratch)?;
        let placed = PlacedBuilder { builder, memory: BuildMemory::new(device, sizes)? };
        placed.record(&mut Recorder::warming(device), input)?;
        Ok(placed)
    }

    fn record(&self, recorder: &mut Recorder<'_>, input: &Input) -> hedgerow::Result<()> {
        self.builder.record(recorder, input, self.memory.structure.region(), self.memory.scratch.region())
    }

    fn report(&self) -> KdReport {
        self.memory.scratch.read_at(self.builder.report_range().start, 1)[0]
    }
}

impl<'a> KdGpu<'a> {
    /// Uploads `mesh` and makes room for structure and scratch, as much as a scene of which nothing is known may need.
    ///
    /// # Errors
    /// Too many triangles, or too little memory: the error says how much is needed.
    pub fn new(
        device: &'a Device,
        name: &str,
        mesh: &Mesh,
        options: &KdOptions,
        traversal: Traversal,
    ) -> Result<KdGpu<'a>> {
        let mesh = DeviceMesh::new(device, &mesh.positions, &mesh.triangles)?;
        Ok(KdGpu {
            device,
            name: name.to_owned(),
            options: *options,
            place: PlacedBuilder::new(device, name, options, &mesh.input)?,
            mesh,
            fits: false,
            timestamps: Timestamps::new(device, PHASES)?,
            tracer: KdDevice::new(device, traversal)?,
        })
    }

    /// Moves the vertices, for the next build: as many as there were.
    pub fn set_positions(&self, positions: &[[f32; 3]]) {
        self.mesh.positions.write(positions);
    }

    /// Where the structure is; a build may move it.
    pub fn address(&self) -> u64 {
        self.place.memory.structure.address()
    }

    fn build_once(&mut self) -> Result<BuildRun> {
        self.device.run(Some(&mut self.timestamps), |recorder| self.place.record(recorder, &self.mesh.input))?;
        let run = BuildRun::of(self.timestamps.phases()?);
        // By levels, the pool has all of it.
        let is_pool = |phase: &&Phase| ["pool", "build"].contains(&phase.name);
        let in_pool = run.phases.iter().find(is_pool).map(|phase| phase.milliseconds);
        let report = self.place.report();
        let pool = in_pool.map(|milliseconds| InPool {
            milliseconds,
            retrievals: report.retrievals,
            skipped: report.skipped_retrievals,
        });
        Ok(BuildRun { pool, ..run })
    }
}

impl Subject for KdGpu<'_> {
    fn builder(&self) -> &str {
        &self.name
    }

    fn kind(&self) -> &'static str {
        KD_TREE
    }

    fn device(&self) -> Option<&Device> {
        Some(self.device)
    }

    fn time_kernels(&mut self) -> Result<()> {
        self.timestamps = Timestamps::new(self.device, PHASES_BY_KERNEL)?.by_kernel();
        Ok(())
    }

    fn choice(&self) -> Option<String> {
        self.options.schedule.is_none().then(|| format!("schedule {}", self.place.builder.schedule()))
    }

    /// The first build finds how much memory the scene needs, and is done again with that.
    fn build(&mut self) -> Result<BuildRun> {
        let mut attempts = 0;
        loop {
            let run = self.build_once()?;
            let report = self.place.report();
            let is_short = report.status & status::OUT_OF_ROOM != 0;
            if self.fits && !is_short {
                return Ok(run);
            }
            attempts += 1;
            if attempts == ATTEMPTS {
                let name = &self.name;
                return Err(Error::Argument(format!("{name}: {ATTEMPTS} builds found too little room: {report:?}")));
            }
            let estimate = Some(report.estimate(self.mesh.input.primitive_count));
            // Both at once may be too much.
            self.place.memory = BuildMemory::new(self.device, Sizes { structure: 16, scratch: 16, alignment: 16 })?;
            let options = KdOptions { estimate, ..self.options };
            self.place = PlacedBuilder::new(self.device, &self.name, &options, &self.mesh.input)?;
            self.fits = !is_short;
        }
    }

    fn memory(&self) -> record::MemoryRecord {
        self.place.memory.record()
    }

    fn kd_tree(&mut self) -> Result<Option<Cow<'_, KdTree>>> {
        Ok(Some(Cow::Owned(KdTree::from_bytes(&self.place.memory.bytes())?)))
    }

    fn set_rays(&mut self, rays: &[Ray]) -> Result<()> {
        self.tracer.rays.set(rays)
    }

    fn trace(&mut self, query: Query) -> Result<f64> {
        self.tracer.trace(&[(self.address(), 0)], query)
    }

    fn hits(&mut self) -> Result<Vec<Hit>> {
        Ok(self.tracer.rays.hits())
    }

    fn work(&mut self, query: Query) -> Result<Option<Vec<Work>>> {
        self.tracer.work(&[(self.address(), 0)], query)
    }
}
