//! kd-trees built and traced on the device as subjects: `kd-gpu`.

use super::kd_device::KdDevice;
use super::{BuildRun, KD_TREE, Subject};
use crate::device::{Buffer, Device};
use crate::measure::record;
use crate::scene::Mesh;
use crate::{Error, Result};
use hedgerow::bvh::builder::Input;
use hedgerow::bvh::layout::status;
use hedgerow::gpu::{Phase, Recorder, Timestamps};
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
    input: Input,
    vertices: [Buffer<'a>; 2],
    place: PlacedBuilder<'a>,
    /// Whether the memory is as large as the last build has found that the scene needs.
    fits: bool,
    timestamps: Timestamps,
    tracer: KdDevice<'a>,
}

/// A builder and its memory.
struct PlacedBuilder<'a> {
    builder: KdBuilder,
    structure: Buffer<'a>,
    scratch: Buffer<'a>,
}

impl<'a> PlacedBuilder<'a> {
    fn new(device: &'a Device, name: &str, options: &KdOptions, input: &Input) -> Result<PlacedBuilder<'a>> {
        let count = input.primitive_count;
        let builder = KdBuilder::new(device, options, count)?;
        let sizes = builder.sizes();
        let (needed, available) = (sizes.structure + sizes.scratch, device.found().memory);
        if needed > available {
            return Err(Error::OutOfMemory { what: format!("{name} of {count} triangles"), needed, available });
        }
        let structure = device.buffer("structure", sizes.structure)?;
        let scratch = device.buffer("scratch", sizes.scratch)?;
        builder.record(&mut Recorder::warming(device), input, structure.region(), scratch.region())?;
        Ok(PlacedBuilder { structure, scratch, builder })
    }

    fn report(&self) -> KdReport {
        let range = self.builder.report_range();
        bytemuck::pod_read_unaligned(&self.scratch.read::<u8>(range.end as usize)[range.start as usize..])
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
        let count = u32::try_from(mesh.triangles.len()).unwrap_or(u32::MAX);
        let vertices = [device.upload("positions", &mesh.positions)?, device.upload("indices", &mesh.triangles)?];
        let input = Input::mesh(vertices[0].address(), mesh.positions.len() as u32, vertices[1].address(), count);
        Ok(KdGpu {
            device,
            name: name.to_owned(),
            options: *options,
            input,
            vertices,
            place: PlacedBuilder::new(device, name, options, &input)?,
            fits: false,
            timestamps: Timestamps::new(device, PHASES)?,
            tracer: KdDevice::new(device, traversal)?,
        })
    }

    /// Moves the vertices, for the next build: as many as there were.
    pub fn set_positions(&self, positions: &[[f32; 3]]) {
        self.vertices[0].write(positions);
    }

    /// Where the structure is; a build may move it.
    pub fn address(&self) -> u64 {
        self.place.structure.address()
    }

    fn build_once(&mut self) -> Result<BuildRun> {
        let PlacedBuilder { builder, structure, scratch } = &self.place;
        self.device.run(Some(&mut self.timestamps), |recorder| {
            builder.record(recorder, &self.input, structure.region(), scratch.region())
        })?;
        // Those of the same name, of all levels, are one.
        let mut phases: Vec<Phase> = Vec::new();
        for phase in self.timestamps.phases()? {
            match phases.iter_mut().find(|p| p.name == phase.name) {
                Some(same) => same.milliseconds += phase.milliseconds,
                None => phases.push(phase),
            }
        }
        Ok(BuildRun::of(phases))
    }

    fn read(&self) -> Result<KdTree> {
        Ok(KdTree::from_bytes(&self.place.structure.read::<u8>(self.place.builder.sizes().structure as usize))?)
    }
}

impl Subject for KdGpu<'_> {
    fn builder(&self) -> &str {
        &self.name
    }

    fn kind(&self) -> &'static str {
        KD_TREE
    }

    fn timer(&self) -> &'static str {
        self.device.timer()
    }

    fn traces_on_device(&self) -> bool {
        true
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
            let estimate = Some(report.estimate(self.input.primitive_count));
            // Both at once may be too much.
            self.place.structure = self.device.buffer("structure", 16)?;
            self.place.scratch = self.device.buffer("scratch", 16)?;
            self.place =
                PlacedBuilder::new(self.device, &self.name, &KdOptions { estimate, ..self.options }, &self.input)?;
            self.fits = !is_short;
        }
    }

    fn memory(&self) -> record::MemoryRecord {
        let sizes = self.place.builder.sizes();
        record::MemoryRecord {
            structure_bytes: Some(sizes.structure),
            scratch_bytes: Some(sizes.scratch),
            peak_bytes: Some(sizes.structure + sizes.scratch),
        }
    }

    fn kd_tree(&mut self) -> Result<Option<Cow<'_, KdTree>>> {
        self.read().map(|tree| Some(Cow::Owned(tree)))
    }

    fn set_rays(&mut self, rays: &[Ray]) -> Result<()> {
        self.tracer.set_rays(rays)
    }

    fn trace(&mut self, query: Query) -> Result<f64> {
        self.tracer.trace(self.place.structure.address(), query)
    }

    fn hits(&mut self) -> Result<Vec<Hit>> {
        Ok(self.tracer.hits())
    }

    fn work(&mut self, query: Query) -> Result<Option<Vec<Work>>> {
        self.tracer.work(self.place.structure.address(), query)
    }
}
