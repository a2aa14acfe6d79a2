//! A top level over what stands still and each object, by the calls of `VK_KHR_acceleration_structure`.

use crate::device::Device;
use crate::measure::MemoryRecord;
use crate::scene::{Frame, Group, Mesh};
use crate::subjects::device_rays::RayBuffers;
use crate::subjects::level::Level;
use crate::subjects::queries::Queries;
use crate::subjects::structures::{BuildInfo, Range, Structures};
use crate::subjects::{BuildRun, Subject};
use crate::{Error, Result};
use ash::vk;
use hedgerow::accel::{self, Instance};
use hedgerow::gpu::Timestamps;
use hedgerow::trace::{Hit, Query, Ray, Work};

type Flags = vk::BuildAccelerationStructureFlagsKHR;
type Mode = vk::BuildAccelerationStructureModeKHR;

/// Instances are numbered by their first primitives, in 24 bits.
const MOST_PRIMITIVES: u64 = 1 << 24;

/// The two levels on the device.
pub struct TwoLevel<'a> {
    structures: Structures<'a>,
    parts: Vec<Part<'a>>,
    top: Level<'a>,
    timestamps: Timestamps,
    rays: Option<RayBuffers<'a>>,
}

/// What is placed by one instance.
struct Part<'a> {
    /// Which of the objects; `None` stands still.
    object: Option<usize>,
    morphs: bool,
    first: u32,
    level: Level<'a>,
}

impl<'a> TwoLevel<'a> {
    /// Builds what is built once: all that does not morph.
    ///
    /// # Errors
    /// Too little memory; more primitives than instances can be numbered by; the device failed.
    pub fn new(device: &'a Device, first: &Frame<'_>) -> Result<TwoLevel<'a>> {
        let scene = first.dynamic;
        if scene.triangle_count() > MOST_PRIMITIVES {
            let (name, count) = (&scene.name, scene.triangle_count());
            let what = format!("{name}: {count} triangles; two-level numbers at most {MOST_PRIMITIVES}, leave it out");
            return Err(Error::Argument(what));
        }
        let structures = Structures::ours(device, accel::AccelOptions::DEFAULT);
        let part = |(object, mesh): (Option<usize>, Mesh)| {
            let morphs = object.is_some_and(|k| scene.objects[k].morphs());
            let flags = if morphs { Flags::empty() } else { Flags::PREFER_FAST_TRACE };
            let level = Level::bottom(&structures, &mesh, flags)?;
            Ok(Part { object, morphs, first: object.map_or(0, |k| first.first(Group::Object(k))), level })
        };
        let still = (!scene.static_mesh.triangles.is_empty()).then_some(None);
        let objects = still.into_iter().chain((0..scene.objects.len()).map(Some));
        let parts: Vec<Part<'_>> = objects.zip(scene.instances(first.time).parts).map(part).collect::<Result<_>>()?;
        for part in &parts {
            device.run(None, |recorder| part.level.record(&structures, recorder, Mode::BUILD))?;
        }
        let top = Level::top(&structures, &instances(&structures, &parts, first), Flags::empty())?;
        let timestamps = Timestamps::new(device, 1)?;
        Ok(TwoLevel { structures, parts, top, timestamps, rays: None })
    }
}

fn instances(structures: &Structures<'_>, parts: &[Part<'_>], frame: &Frame<'_>) -> Vec<Instance> {
    let instance = |part: &Part<'_>| {
        let transform = part.object.map_or(Instance::IDENTITY, |k| frame.dynamic.objects[k].transform(frame.time));
        part.level.instance(structures, transform).with_index_and_mask(part.first, 0xff)
    };
    parts.iter().map(instance).collect()
}

impl Subject for TwoLevel<'_> {
    fn builder(&self) -> &str {
        "accel"
    }

    fn kind(&self) -> &'static str {
        "accel"
    }

    fn timer(&self) -> &'static str {
        self.structures.device.timer()
    }

    fn traces_on_device(&self) -> bool {
        true
    }

    fn place(&mut self, frame: &Frame<'_>) -> Result<()> {
        for part in &self.parts {
            if let Some(k) = part.object.filter(|_| part.morphs) {
                part.level.input().write(&frame.dynamic.objects[k].mesh_at(frame.time));
            }
        }
        self.top.input().write(&instances(&self.structures, &self.parts, frame));
        Ok(())
    }

    fn build(&mut self) -> Result<BuildRun> {
        let (structures, top) = (&self.structures, &self.top);
        let morphing: Vec<&Level<'_>> = self.parts.iter().filter(|part| part.morphs).map(|part| &part.level).collect();
        let infos: Vec<BuildInfo<'_>> = morphing.iter().map(|level| level.info(Mode::BUILD)).collect();
        let ranges: Vec<[Range; 1]> = morphing.iter().map(|level| level.range()).collect();
        let ranges: Vec<&[Range]> = ranges.iter().map(|range| &range[..]).collect();
        structures.device.run(Some(&mut self.timestamps), |recorder| {
            recorder.phase("build");
            if !infos.is_empty() {
                structures.build(recorder, &infos, &ranges)?;
            }
            top.record(structures, recorder, Mode::BUILD)
        })?;
        Ok(BuildRun::of(self.timestamps.phases()?))
    }

    fn memory(&self) -> MemoryRecord {
        let all = self.parts.iter().map(|part| &part.level).chain([&self.top]).map(Level::bytes);
        let [structure, scratch] = all.fold([0, 0], |sum, bytes| [sum[0] + bytes[0], sum[1] + bytes[1]]);
        MemoryRecord { structure_bytes: Some(structure), scratch_bytes: Some(scratch), peak_bytes: None }
    }

    fn set_rays(&mut self, rays: &[Ray]) -> Result<()> {
        // Both at once may be too much.
        self.rays = None;
        self.rays = Some(RayBuffers::new(self.structures.device, rays)?);
        Ok(())
    }

    fn trace(&mut self, query: Query) -> Result<f64> {
        let Some(rays) = &self.rays else { return Ok(0.0) };
        self.structures.trace(&mut self.timestamps, self.top.structure(), rays, query, Queries::OneEach)
    }

    fn hits(&mut self) -> Result<Vec<Hit>> {
        Ok(self.rays.as_ref().map_or_else(Vec::new, RayBuffers::read_hits))
    }

    fn work(&mut self, query: Query) -> Result<Option<Vec<Work>>> {
        let Some(rays) = &self.rays else { return Ok(None) };
        let work = self.structures.work(self.top.structure(), rays, query)?;
        let one = |[top, instances, below, tests]: [u32; 4]| Work { steps: top + below, tests, leaves: instances };
        Ok(Some(work.into_iter().map(one).collect()))
    }
}
