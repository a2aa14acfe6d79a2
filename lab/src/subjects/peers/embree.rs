//! `embree-low`, `embree-medium`, `embree-high`: Intel's ray tracing kernels on the CPU, single rays on every core.
//!
//! Embree does not show its tree: quality is not known, and bytes are what its memory monitor saw.

use crate::measure::record;
use crate::scene::Mesh;
use crate::subjects::host_build::on_cpu;
use crate::subjects::host_rays::timed;
use crate::subjects::{BuildRun, Subject};
use crate::{Error, Result};
use embree3::{
    BufferUsage, BuildQuality, Config, Device, Format, IntersectContext, RayHit, Scene, TriangleMeshBuilder,
};
use hedgerow::trace::{Hit, Query, Ray};
use rayon::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};

/// Embree's build quality of a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Preset {
    /// Morton codes.
    Low,
    /// Binned SAH.
    Medium,
    /// Binned SAH with spatial splits.
    High,
}

impl Preset {
    /// The builder's name.
    fn name(self) -> &'static str {
        match self {
            Preset::Low => "embree-low",
            Preset::Medium => "embree-medium",
            Preset::High => "embree-high",
        }
    }

    /// What Embree takes for it.
    pub(super) fn quality(self) -> BuildQuality {
        match self {
            Preset::Low => BuildQuality::LOW,
            Preset::Medium => BuildQuality::MEDIUM,
            Preset::High => BuildQuality::HIGH,
        }
    }
}

/// Bytes that Embree holds, and the most that it has held.
#[derive(Debug, Default)]
struct Bytes {
    now: AtomicI64,
    peak: AtomicI64,
}

/// A scene in Embree.
pub struct Embree {
    name: &'static str,
    threads: u32,
    device: Device,
    scene: Scene<'static>,
    geometry: u32,
    bytes: Arc<Bytes>,
    /// Bytes of the vertices and indices, which are there before anything is built.
    input_bytes: i64,
    rays: Vec<Ray>,
    hits: Vec<Hit>,
}

pub(super) fn failed(call: &'static str) -> impl Fn(embree3::Error) -> Error {
    move |error| {
        Error::Argument(format!("{call} failed: {error:?}; Embree cannot build this scene, leave embree-* out"))
    }
}

impl Embree {
    /// Copies `mesh` into Embree's own buffers.
    ///
    /// # Errors
    /// Embree refuses the scene or has too little memory.
    pub fn new(mesh: &Mesh, preset: Preset) -> Result<Embree> {
        let threads = rayon::current_num_threads() as u32;
        let config = Config { threads, start_threads: true, ..Config::default() };
        let device = Device::with_config(config).map_err(failed("rtcNewDevice"))?;
        let bytes = Arc::new(Bytes::default());
        let seen = Arc::clone(&bytes);
        device.set_memory_monitor_function(move |change, _| {
            let now = seen.now.fetch_add(change as i64, Ordering::Relaxed) + change as i64;
            seen.peak.fetch_max(now, Ordering::Relaxed);
            true
        });
        let mut scene = device.create_scene().map_err(failed("rtcNewScene"))?;
        let (name, quality) = (preset.name(), preset.quality());
        scene.set_build_quality(quality);
        let mut geometry = TriangleMeshBuilder::new(&device).map_err(failed("rtcNewGeometry"))?;
        geometry.set_build_quality(quality);
        geometry
            .set_new_buffer::<[f32; 3]>(BufferUsage::VERTEX, 0, Format::FLOAT3, 12, mesh.positions.len())
            .map_err(failed("rtcSetNewGeometryBuffer"))?
            .copy_from_slice(&mesh.positions);
        geometry
            .set_new_buffer::<[u32; 3]>(BufferUsage::INDEX, 0, Format::UINT3, 12, mesh.triangles.len())
            .map_err(failed("rtcSetNewGeometryBuffer"))?
            .copy_from_slice(&mesh.triangles);
        let geometry = scene.attach_geometry(&geometry.commit());
        let input_bytes = bytes.now.load(Ordering::Relaxed);
        Ok(Embree { name, threads, device, scene, geometry, bytes, input_bytes, rays: Vec::new(), hits: Vec::new() })
    }

    fn trace_one(&self, context: &mut IntersectContext, ray: &Ray, query: Query) -> Hit {
        let mut walked = embree3::Ray::segment(ray.origin, ray.direction, ray.t_min, ray.t_max);
        match query {
            Query::ClosestHit => {
                let mut met = RayHit::from_ray(walked);
                self.scene.intersect(context, &mut met);
                if !met.hit.is_valid() {
                    return Hit::NONE;
                }
                Hit { t: met.ray.tfar, primitive: met.hit.primID, u: met.hit.u, v: met.hit.v }
            }
            // Embree says only whether: triangle and weights are not known.
            Query::AnyHit if self.scene.occluded(context, &mut walked) => {
                Hit { t: 0.0, primitive: 0, u: f32::NAN, v: f32::NAN }
            }
            Query::AnyHit => Hit::NONE,
        }
    }
}

impl Subject for Embree {
    fn builder(&self) -> &str {
        self.name
    }

    fn kind(&self) -> &'static str {
        "host"
    }

    fn build(&mut self) -> Result<BuildRun> {
        // Marked as changed, or Embree would see that nothing has changed.
        self.scene.update_geometry_buffer(self.geometry, BufferUsage::VERTEX, 0);
        self.scene.update_geometry_buffer(self.geometry, BufferUsage::INDEX, 0);
        self.bytes.peak.store(0, Ordering::Relaxed);
        let ((), run) = on_cpu(self.threads, || {
            let (milliseconds, ()) = timed(|| {
                self.scene.commit_geometry(self.geometry);
                self.scene.commit();
            });
            ((), BuildRun::whole(milliseconds))
        });
        match self.device.get_error() {
            embree3::Error::NONE => Ok(run),
            error => Err(failed("rtcCommitScene")(error)),
        }
    }

    fn memory(&self) -> record::MemoryRecord {
        let held = |bytes: &AtomicI64| (bytes.load(Ordering::Relaxed) - self.input_bytes).max(0) as u64;
        let (structure, peak) = (held(&self.bytes.now), held(&self.bytes.peak));
        record::MemoryRecord {
            structure_bytes: Some(structure),
            scratch_bytes: Some(peak.saturating_sub(structure)),
            peak_bytes: Some(peak),
        }
    }

    fn set_rays(&mut self, rays: &[Ray]) -> Result<()> {
        self.rays = rays.to_vec();
        Ok(())
    }

    fn trace(&mut self, query: Query) -> Result<f64> {
        let mut hits = std::mem::take(&mut self.hits);
        let context = || IntersectContext::incoherent();
        let (milliseconds, ()) = timed(|| {
            let rays = self.rays.par_iter().map_init(context, |context, ray| self.trace_one(context, ray, query));
            rays.collect_into_vec(&mut hits);
        });
        self.hits = hits;
        Ok(milliseconds)
    }

    fn hits(&mut self) -> Result<Vec<Hit>> {
        Ok(self.hits.clone())
    }
}
