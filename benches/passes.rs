//! What the defaults were chosen from: the schedules of the build and the ways to load nodes, on this device.
//!
//! ```text
//! scripts/cargo.sh bench --features peer-obvhs --bench passes
//! ```
//!
//! Wall time of a submit and its wait; `hedgerow bench` has the timestamps of the phases. The scene is `pine_hill` of
//! scenes/, or what `HEDGEROW_BENCH_SCENE` names; the device that of `HEDGEROW_DEVICE`, or the first that fits.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use hedgerow::Result;
use hedgerow::bvh::lbvh::{Input, Lbvh, Options, Schedule};
use hedgerow::gpu::{Buffer, Device, DeviceOptions};
use hedgerow::scene::{self, LoadOptions, Scene};
use hedgerow::trace::kinds::{self, RayKind, RayOptions};
use hedgerow::trace::tracer::{self, Buffers, Loads, Shape};
use hedgerow::trace::{Hit, Query, Ray};

const SIZE: [u32; 2] = [256, 192];

fn device() -> Device {
    let wanted = std::env::var("HEDGEROW_DEVICE").ok();
    Device::new(&DeviceOptions { wanted, validation: false, ray_query: false }).expect("a device that fits")
}

fn scene() -> Scene {
    let name = std::env::var("HEDGEROW_BENCH_SCENE").unwrap_or_else(|_| "pine_hill".into());
    scene::load(&name, &LoadOptions { folders: scene::own_folders(), ..LoadOptions::default() })
        .expect("the scene loads")
}

/// A scene on the device, and room for its structure.
struct Built<'a> {
    device: &'a Device,
    lbvh: Lbvh,
    input: Input,
    structure: Buffer<'a>,
    scratch: Buffer<'a>,
    _vertices: [Buffer<'a>; 2],
}

impl<'a> Built<'a> {
    fn new(device: &'a Device, scene: &Scene, options: &Options) -> Result<Built<'a>> {
        let mesh = &scene.mesh;
        let vertices = [device.upload("positions", &mesh.positions)?, device.upload("indices", &mesh.triangles)?];
        let input = Input::mesh(
            vertices[0].address(),
            mesh.positions.len() as u32,
            vertices[1].address(),
            mesh.triangles.len() as u32,
        );
        let lbvh = Lbvh::new(device, options, input.primitive_count)?;
        let sizes = lbvh.sizes();
        let structure = device.buffer("structure", sizes.structure)?;
        let scratch = device.buffer("scratch", sizes.scratch)?;
        let built = Built { device, lbvh, input, structure, scratch, _vertices: vertices };
        built.build()?;
        Ok(built)
    }

    fn build(&self) -> Result<()> {
        let (structure, scratch) = (self.structure.address(), self.scratch.address());
        self.device.run(None, |recorder| self.lbvh.record(recorder, &self.input, structure, scratch))
    }

    fn trace(&self, shape: &Shape, query: Query, rays: &Buffer<'_>, hits: &Buffer<'_>, count: u32) -> Result<()> {
        let structure = self.structure.address();
        let buffers = Buffers { structure, rays: rays.address(), hits: hits.address(), work: None, count };
        self.device.run(None, |recorder| tracer::record(recorder, shape, query, &buffers))
    }
}

fn build(c: &mut Criterion) {
    let (device, scene) = (device(), scene());
    let mut group = c.benchmark_group("build");
    group.sample_size(10).throughput(Throughput::Elements(scene.mesh.triangles.len() as u64));
    for schedule in [Schedule::Chain, Schedule::Persistent] {
        let options = Options { schedule: Some(schedule), ..Options::DEFAULT };
        let built = Built::new(&device, &scene, &options).expect("it builds");
        group.bench_function(BenchmarkId::new("lbvh", schedule), |b| b.iter(|| built.build().expect("it builds")));
    }
}

fn trace(c: &mut Criterion) {
    let (device, scene) = (device(), scene());
    let built = Built::new(&device, &scene, &Options::DEFAULT).expect("it builds");
    let mut shapes = vec![
        ("gathered", Shape { rays_each: 1, ..Shape::subgroups(&device.limits) }),
        ("gathered, ray after ray", Shape::subgroups(&device.limits)),
    ];
    if device.limits.subgroup_size <= Loads::MAX_LANES {
        shapes.push(("lane by lane", Shape::lanes(&device.limits)));
    }
    let shape = Shape::of(&device.limits);
    for kind in [RayKind::Primary, RayKind::Diffuse1, RayKind::Random] {
        let rays = kinds::generate(kind, &scene, &RayOptions { size: SIZE, seed: 1 }, &mut |rays| {
            let hits = device.buffer("hits", size_of::<Hit>() as u64 * rays.len() as u64)?;
            built.trace(&shape, Query::ClosestHit, &device.upload("rays", rays)?, &hits, rays.len() as u32)?;
            Ok(hits.read(rays.len()))
        });
        let rays: Vec<Ray> = rays.expect("rays");
        let count = rays.len() as u32;
        let hits = device.buffer("hits", size_of::<Hit>() as u64 * u64::from(count)).expect("memory");
        let rays = device.upload("rays", &rays).expect("memory");
        let mut group = c.benchmark_group(kind.name());
        group.sample_size(10).throughput(Throughput::Elements(count.into()));
        for (name, shape) in &shapes {
            group.bench_function(*name, |b| {
                b.iter(|| built.trace(shape, kind.query(), &rays, &hits, count).expect("it traces"));
            });
        }
    }
}

criterion_group!(benches, build, trace);
criterion_main!(benches);
