//! A top level over what stands still and each object, by the calls of `VK_KHR_acceleration_structure`.

use super::{Contender, Frame};
use crate::device::{Buffer, Device};
use crate::measure::record::Memory;
use crate::scene::Mesh;
use crate::subjects::structures::{BuildInfo, Geometry, Placed, Range, Structures, address, triangles_of};
use crate::{Error, Result};
use ash::vk;
use hedgerow::accel::{self, Instance};
use hedgerow::gpu::Timestamps;
use hedgerow::trace::{Hit, Query, Ray, Work};

type Type = vk::AccelerationStructureTypeKHR;
type Flags = vk::BuildAccelerationStructureFlagsKHR;

/// Instances are numbered by their first primitives, in 24 bits.
const MOST_PRIMITIVES: u64 = 1 << 24;
const BUILDER: &str = "accel";

/// The two levels on the device.
pub struct TwoLevel<'a> {
    structures: Structures<'a>,
    parts: Vec<Part<'a>>,
    instances: Buffer<'a>,
    top: Level<'a>,
    timestamps: Timestamps,
    rays: Option<(Buffer<'a>, Buffer<'a>, u32)>,
}

/// What is placed by one instance.
struct Part<'a> {
    /// Which of the objects; `None` stands still.
    object: Option<usize>,
    morphs: bool,
    first: u32,
    positions: Buffer<'a>,
    _indices: Buffer<'a>,
    level: Level<'a>,
}

/// A structure, and what it is built over.
struct Level<'a> {
    ty: Type,
    flags: Flags,
    geometry: [Geometry; 1],
    count: u32,
    placed: Placed<'a>,
}

impl<'a> Level<'a> {
    fn new(structures: &Structures<'a>, ty: Type, flags: Flags, geometry: Geometry, count: u32) -> Result<Level<'a>> {
        let geometry = [geometry];
        let info = BuildInfo::default().ty(ty).flags(flags).geometries(&geometry);
        let placed = structures.place("level", &info, &[count])?;
        Ok(Level { ty, flags, geometry, count, placed })
    }

    fn info(&self) -> BuildInfo<'_> {
        BuildInfo::default()
            .ty(self.ty)
            .flags(self.flags)
            .geometries(&self.geometry)
            .dst_acceleration_structure(self.placed.structure)
            .scratch_data(self.placed.scratch())
    }

    fn range(&self) -> [Range; 1] {
        [Range::default().primitive_count(self.count)]
    }

    fn bytes(&self) -> [u64; 2] {
        [self.placed.sizes.acceleration_structure_size, self.placed.sizes.build_scratch_size]
    }
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
        let structures = Structures::ours(device, accel::Options::DEFAULT);
        let mut parts = Vec::new();
        let part = |object: Option<usize>, morphs: bool, first: u32, mesh: &Mesh| {
            let positions = device.upload("positions", &mesh.positions)?;
            let indices = device.upload("indices", &mesh.triangles)?;
            let flags = if morphs { Flags::empty() } else { Flags::PREFER_FAST_TRACE };
            let (geometry, count) = (triangles_of(mesh, &positions, &indices), mesh.triangles.len() as u32);
            let level = Level::new(&structures, Type::BOTTOM_LEVEL, flags, geometry, count)?;
            Ok::<_, Error>(Part { object, morphs, first, positions, _indices: indices, level })
        };
        if !scene.static_mesh.triangles.is_empty() {
            parts.push(part(None, false, 0, &scene.static_mesh)?);
        }
        for (k, (object, primitives)) in scene.objects.iter().zip(scene.primitives()).enumerate() {
            let mesh = Mesh { positions: object.mesh_at(first.time).into_owned(), triangles: object.triangles.clone() };
            parts.push(part(Some(k), object.morphs(), primitives.start as u32, &mesh)?);
        }
        for part in &parts {
            let (infos, range) = ([part.level.info()], part.level.range());
            device.run(None, |recorder| structures.build(recorder, &infos, &[&range]))?;
        }
        let all = instances(&structures, &parts, first);
        let buffer = device.upload("instances", &all)?;
        let data = vk::AccelerationStructureGeometryInstancesDataKHR::default().data(address(&buffer));
        let geometry = vk::AccelerationStructureGeometryKHR::default()
            .geometry_type(vk::GeometryTypeKHR::INSTANCES)
            .geometry(vk::AccelerationStructureGeometryDataKHR { instances: data });
        let top = Level::new(&structures, Type::TOP_LEVEL, Flags::empty(), geometry, all.len() as u32)?;
        let timestamps = Timestamps::new(device, 1)?;
        Ok(TwoLevel { structures, parts, instances: buffer, top, timestamps, rays: None })
    }
}

fn instances(structures: &Structures<'_>, parts: &[Part<'_>], frame: &Frame<'_>) -> Vec<Instance> {
    let instance = |part: &Part<'_>| {
        let transform = part.object.map_or(Instance::IDENTITY, |k| frame.dynamic.objects[k].transform(frame.time));
        Instance::new(structures.address(part.level.placed.structure), transform)
            .with_index_and_mask(part.first, 0xff)
            .with_offset_and_flags(0, vk::GeometryInstanceFlagsKHR::TRIANGLE_FACING_CULL_DISABLE)
    };
    parts.iter().map(instance).collect()
}

impl Contender for TwoLevel<'_> {
    fn builder(&self) -> &str {
        BUILDER
    }

    fn timer(&self) -> &'static str {
        self.structures.device.timer()
    }

    fn place(&mut self, frame: &Frame<'_>) -> Result<()> {
        for part in self.parts.iter().filter(|part| part.morphs) {
            if let Some(k) = part.object {
                part.positions.write(&frame.dynamic.objects[k].mesh_at(frame.time));
            }
        }
        self.instances.write(&instances(&self.structures, &self.parts, frame));
        Ok(())
    }

    fn build(&mut self) -> Result<f64> {
        let (structures, top) = (&self.structures, &self.top);
        let morphing = || self.parts.iter().filter(|part| part.morphs);
        let infos: Vec<BuildInfo<'_>> = morphing().map(|part| part.level.info()).collect();
        let ranges: Vec<[Range; 1]> = morphing().map(|part| part.level.range()).collect();
        let ranges: Vec<&[Range]> = ranges.iter().map(|range| &range[..]).collect();
        structures.device.run(Some(&mut self.timestamps), |recorder| {
            recorder.phase("build");
            if !infos.is_empty() {
                structures.build(recorder, &infos, &ranges)?;
            }
            structures.build(recorder, &[top.info()], &[&top.range()])
        })?;
        Ok(self.timestamps.phases()?.iter().map(|phase| phase.milliseconds).sum())
    }

    fn memory(&mut self) -> Result<Memory> {
        let all = self.parts.iter().map(|part| &part.level).chain([&self.top]);
        let [structure, scratch] = all.fold([0, 0], |sum, level| {
            let [structure, scratch] = level.bytes();
            [sum[0] + structure, sum[1] + scratch]
        });
        Ok(Memory { structure_bytes: Some(structure), scratch_bytes: Some(scratch), peak_bytes: None })
    }

    fn sah(&mut self, _c_t: f64, _c_i: f64) -> Result<Option<f64>> {
        Ok(None)
    }

    fn set_rays(&mut self, rays: &[Ray]) -> Result<()> {
        self.rays = None;
        let device = self.structures.device;
        let hits = device.buffer("hits", size_of::<Hit>() as u64 * rays.len() as u64)?;
        self.rays = Some((device.upload("rays", rays)?, hits, rays.len() as u32));
        Ok(())
    }

    fn trace(&mut self, query: Query) -> Result<f64> {
        let Some((rays, hits, count)) = &self.rays else { return Ok(0.0) };
        self.structures.trace(&mut self.timestamps, self.top.placed.structure, (rays, hits, *count), query)
    }

    fn hits(&mut self) -> Result<Vec<Hit>> {
        Ok(self.rays.as_ref().map_or_else(Vec::new, |(_, hits, count)| hits.read(*count as usize)))
    }

    fn work(&mut self, query: Query) -> Result<Option<Vec<Work>>> {
        let Some((rays, hits, count)) = &self.rays else { return Ok(None) };
        let work = self.structures.work(self.top.placed.structure, (rays, hits, *count), query)?;
        let one = |[top, instances, below, tests]: [u32; 4]| Work { steps: top + below, tests, leaves: instances };
        Ok(Some(work.into_iter().map(one).collect()))
    }
}
