//! Our trees built on the device as subjects: timestamps around each phase, our tracer.

use super::any_hit::{AnyHit, ChildrenBy, TaughtOrder};
use super::build_memory::{BuildMemory, DeviceMesh, check_memory};
use super::device_rays::DeviceRays;
use super::queries::{self, Forms, Queried, Queries, QueryWork};
use super::taught_rounds::TaughtRounds;
use super::wide::{WidePlan, WideTree};
use super::{BuildRun, PHASES_BY_KERNEL, Subject, joined_choices};
use crate::Result;
use crate::device::Device;
use crate::measure::overlap::{self, Epo};
use crate::measure::record;
use crate::rays::sample::TeachingRays;
use crate::scene::Mesh;
use hedgerow::bvh::builder::{BuildOptions, Builder, Input};
use hedgerow::bvh::layout::Bvh2;
use hedgerow::bvh::quality::{self, QualityFigures};
use hedgerow::bvh::reinsertion::ReinsertionOptions;
use hedgerow::gpu::{Recorder, Timestamps};
use hedgerow::trace::tracer::{self, TraceBuffers, TraceShape};
use hedgerow::trace::{Hit, Query, Ray, Work};

/// Phases of a build at most: split, reset and bounds, encode, sort, hierarchy, those of collapsing, rays, flux, optimise, order, wide.
const PHASES: u32 = 18;

/// How rays go through a tree that is built on the device.
#[derive(Debug, Clone, Default)]
pub struct Walk {
    /// By queries in a shader, not by a tracer.
    pub by_query: Option<Queries>,
    /// Through a wide tree that is made of the binary one.
    pub wide: Option<WidePlan>,
}

/// What rays go through: the wide tree, where there is one, or the `Bvh2`.
struct TracedTree<'a> {
    wide: Option<WideTree<'a>>,
    by_query: Option<Queries>,
    /// Whether the children have an order.
    is_ordered: bool,
}

impl TracedTree<'_> {
    /// Records the tracing of rays.
    fn record(&self, recorder: &mut Recorder<'_>, query: Query, buffers: &TraceBuffers) -> hedgerow::Result<()> {
        match (self.by_query, &self.wide) {
            (Some(queries), wide) => {
                let queried = Queried { one_level: true, forms: Forms::default().with(wide.is_some()) };
                queries::record(recorder, query, buffers, queried, queries)
            }
            (None, Some(tree)) => tree.record_trace(recorder, query, buffers),
            (None, None) => record_binary(recorder, self.is_ordered, query, buffers),
        }
    }
}

/// What rays teach a finished tree, behind a build.
struct Behind<'a> {
    rounds: Option<TaughtRounds<'a>>,
    /// Puts the children in an order.
    order: Option<TaughtOrder<'a>>,
}

impl Behind<'_> {
    fn scratch_bytes(&self) -> u64 {
        let of_rounds = self.rounds.as_ref().map_or(0, TaughtRounds::scratch_bytes);
        of_rounds.max(self.order.as_ref().map_or(0, TaughtOrder::scratch_bytes))
    }
}

/// How a tree is traced, and what rays teach it.
pub struct Teaching<'t> {
    /// How rays go through it.
    pub walk: &'t Walk,
    /// How rays go that end at any hit.
    pub any_hit: &'t AnyHit,
    /// Rays that teach rounds of reinsertion, which are not in the options of the build then.
    pub rounds: Option<(&'t TeachingRays, ReinsertionOptions)>,
}

/// A scene in our `Bvh2`, or in a wide tree made of it, built and traced on the device.
pub struct DeviceBvh<'a> {
    device: &'a Device,
    /// Its name.
    pub(super) builder: String,
    /// What was left to choose.
    pub(super) choice: Option<String>,
    bvh: Builder,
    mesh: DeviceMesh<'a>,
    memory: BuildMemory<'a>,
    traced: TracedTree<'a>,
    taught: Behind<'a>,
    timestamps: Timestamps,
    rays: DeviceRays<'a>,
}

impl<'a> DeviceBvh<'a> {
    /// Uploads `mesh` and makes room for structure and scratch, and for the wide tree if there shall be one.
    ///
    /// # Errors
    /// Too many triangles, or too little memory: the error says how much is needed.
    pub fn new(
        device: &'a Device,
        builder: &str,
        mesh: &Mesh,
        options: &BuildOptions,
        Teaching { walk, any_hit, rounds }: Teaching<'_>,
    ) -> Result<DeviceBvh<'a>> {
        let count = u32::try_from(mesh.triangles.len()).unwrap_or(u32::MAX);
        let (child_order, teaching) = match &any_hit.order {
            None | Some(ChildrenBy::Built) => (options.child_order, None),
            Some(ChildrenBy::Rule(order)) => (Some(*order), None),
            Some(ChildrenBy::Rays(rays)) => (None, Some(rays)),
        };
        let options = &BuildOptions { child_order, ..*options };
        let bvh = Builder::new(device, options, count)?;
        let taught = |rays| TaughtOrder::new(device, rays, options.collapse, bvh.record_count());
        let of_rounds = |(rays, options): (_, _)| TaughtRounds::new(device, rays, &options, bvh.record_count());
        let taught = Behind {
            rounds: rounds.map(of_rounds).transpose()?,
            order: teaching.map(|rays| taught(rays)).transpose()?,
        };
        let mut sizes = bvh.sizes();
        // The build is done with its scratch memory by then.
        sizes.scratch = sizes.scratch.max(taught.scratch_bytes());
        let mesh_bytes = size_of_val(&mesh.positions[..]) + size_of_val(&mesh.triangles[..]);
        check_memory(device, builder, count, mesh_bytes as u64 + sizes.structure + sizes.scratch)?;
        let mesh = DeviceMesh::new(device, &mesh.positions, &mesh.triangles)?;
        let memory = BuildMemory::new(device, sizes)?;
        let wide = walk.wide.as_ref().map(|plan| WideTree::new(device, plan, bvh.record_count())).transpose()?;
        let mut warming = Recorder::warming(device);
        record_build(&mut warming, &bvh, (&taught, wide.as_ref()), &mesh.input, &memory)?;
        Ok(DeviceBvh {
            device,
            builder: builder.to_owned(),
            choice: joined_choices([choice_of(options, &bvh), any_hit.choice.clone()]),
            traced: TracedTree { wide, by_query: walk.by_query, is_ordered: any_hit.order.is_some() },
            taught,
            timestamps: Timestamps::new(device, PHASES)?,
            bvh,
            mesh,
            memory,
            rays: DeviceRays::new(device)?,
        })
    }

    /// Address of what is traced.
    fn traced_address(&self) -> u64 {
        self.traced.wide.as_ref().map_or(self.memory.structure.address(), WideTree::address)
    }
}

/// Records the build of the `Bvh2`, what rays teach it, and the wide tree if there shall be one.
fn record_build(
    recorder: &mut Recorder<'_>,
    bvh: &Builder,
    (taught, wide): (&Behind<'_>, Option<&WideTree<'_>>),
    input: &Input,
    BuildMemory { structure, scratch, .. }: &BuildMemory<'_>,
) -> hedgerow::Result<()> {
    bvh.record(recorder, input, structure.region(), scratch.region())?;
    if let Some(rounds) = &taught.rounds {
        recorder.barrier();
        rounds.record(recorder, structure.region(), scratch.region())?;
    }
    if let Some(order) = &taught.order {
        recorder.barrier();
        order.record(recorder, structure.region(), scratch.region())?;
    }
    let counts = taught.order.as_ref().map(TaughtOrder::counts);
    wide.map_or(Ok(()), |tree| tree.record(recorder, structure.region(), counts))
}

/// Records the tracing of a `Bvh2`.
pub(super) fn record_binary(
    recorder: &mut Recorder<'_>,
    is_ordered: bool,
    query: Query,
    buffers: &TraceBuffers,
) -> hedgerow::Result<()> {
    let shape = TraceShape::of(recorder.context());
    match query {
        Query::AnyHit if is_ordered => tracer::record_left_first(recorder, &shape, buffers),
        _ => tracer::record(recorder, &shape, query, buffers),
    }
}

/// What was left to the builder: codes and schedule.
fn choice_of(options: &BuildOptions, bvh: &Builder) -> Option<String> {
    let codes = options.codes.is_none().then(|| format!("codes {}", bvh.codes()));
    let schedule = options.schedule.is_none().then(|| format!("schedule {}", bvh.schedule()));
    joined_choices([codes, schedule])
}

impl Subject for DeviceBvh<'_> {
    fn builder(&self) -> &str {
        &self.builder
    }

    fn kind(&self) -> &'static str {
        self.traced.wide.as_ref().map_or("bvh2", |tree| tree.tracer.form.name())
    }

    fn device(&self) -> Option<&Device> {
        Some(self.device)
    }

    fn time_kernels(&mut self) -> Result<()> {
        self.timestamps = Timestamps::new(self.device, PHASES_BY_KERNEL)?.by_kernel();
        Ok(())
    }

    fn choice(&self) -> Option<String> {
        self.choice.clone()
    }

    fn traffic(&self, phase: &str) -> Option<u64> {
        self.bvh.traffic(phase, &self.mesh.input)
    }

    fn build(&mut self) -> Result<BuildRun> {
        self.device.run(Some(&mut self.timestamps), |recorder| {
            let behind = (&self.taught, self.traced.wide.as_ref());
            record_build(recorder, &self.bvh, behind, &self.mesh.input, &self.memory)
        })?;
        Ok(BuildRun::of(self.timestamps.phases()?))
    }

    fn memory(&self) -> record::MemoryRecord {
        self.traced.wide.as_ref().map_or_else(|| self.memory.record(), |tree| tree.memory(&self.memory.sizes))
    }

    fn quality(&mut self, c_t: f64, c_i: f64) -> Result<record::QualityRecord> {
        if let Some(tree) = &self.traced.wide {
            return tree.quality(c_t, c_i);
        }
        let measure = quality::QualityPass::new(self.device, self.bvh.record_count());
        let scratch = self.device.buffer("quality: scratch", measure.scratch_bytes())?;
        let result = self.device.buffer("quality: figures", size_of::<QualityFigures>() as u64)?;
        self.device
            .run(None, |r| measure.record(r, self.memory.structure.address(), scratch.region(), result.region()))?;
        Ok(record::QualityRecord::of(&result.read::<QualityFigures>(1)[0].quality(c_t, c_i), c_t, c_i))
    }

    fn epo(&mut self, c_t: f64, c_i: f64, epo: Epo) -> Result<Option<f64>> {
        if self.bvh.record_count() != self.bvh.count() {
            // The device takes each record for a triangle of its own.
            return Ok(self.tree()?.and_then(|tree| overlap::on_host(&tree, c_t, c_i, epo)));
        }
        let count = self.mesh.input.primitive_count;
        overlap::on_device(self.device, self.memory.structure.address(), count, (c_t, c_i), epo)
    }

    fn tree(&mut self) -> Result<Option<Bvh2>> {
        Ok(Some(Bvh2::from_bytes(&self.memory.bytes())?))
    }

    fn bytes(&mut self) -> Result<Option<Vec<u8>>> {
        Ok(Some(self.traced.wide.as_ref().map_or_else(|| self.memory.bytes(), WideTree::bytes)))
    }

    fn validate(&mut self) -> Result<()> {
        self.tree()?.map_or(Ok(()), |tree| tree.validate())?;
        self.traced.wide.as_ref().map_or(Ok(()), WideTree::validate)
    }

    fn set_rays(&mut self, rays: &[Ray]) -> Result<()> {
        self.rays.set(rays)
    }

    fn trace(&mut self, query: Query) -> Result<f64> {
        let (structure, traced) = (self.traced_address(), &self.traced);
        self.rays.trace(structure, |recorder, buffers| traced.record(recorder, query, buffers))
    }

    fn hits(&mut self) -> Result<Vec<Hit>> {
        Ok(self.rays.hits())
    }

    /// Queries do not count their leaves.
    fn work(&mut self, query: Query) -> Result<Option<Vec<Work>>> {
        let (structure, traced) = (self.traced_address(), &self.traced);
        let record = |recorder: &mut Recorder<'_>, buffers: &TraceBuffers| traced.record(recorder, query, buffers);
        if traced.by_query.is_none() {
            return self.rays.work(structure, record);
        }
        let of_ray = |[_, _, steps, tests]: QueryWork| Work { steps, tests, leaves: 0 };
        let work: Option<Vec<QueryWork>> = self.rays.work(structure, record)?;
        Ok(work.map(|all| all.into_iter().map(of_ray).collect()))
    }
}
