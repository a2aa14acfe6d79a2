//! What the defaults were chosen from, on this device: the schedules of the build, the ways to load nodes, what compaction is
//! worth, builds in batches.
//!
//! ```text
//! scripts/cargo.sh bench --features peer-obvhs --bench passes
//! ```
//!
//! Wall time of a submit and its wait; `hedgerow bench` has the timestamps of the phases. The scene is `pine_hill` of
//! scenes/, or what `HEDGEROW_BENCH_SCENE` names; the device that of `HEDGEROW_DEVICE`, or the first that fits.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use hedgerow::accel;
use hedgerow::bvh::builder::{BuildOptions, Builder, Input, Schedule};
use hedgerow::bvh::compact;
use hedgerow::bvh::layout::{Header, Triangle};
use hedgerow::trace::tracer::{self, Loads, TraceBuffers, TraceShape};
use hedgerow::trace::{Hit, Query, Ray};
use hedgerow_lab::Result;
use hedgerow_lab::device::{Buffer, Device, DeviceOptions, DriverTracing};
use hedgerow_lab::experiments::accel::batch::{Batch, Workload};
use hedgerow_lab::experiments::accel::points::Submission;
use hedgerow_lab::rays::kinds::{self, RayKind, RayOptions};
use hedgerow_lab::scene::{self, LoadOptions, Scene};
use hedgerow_lab::subjects::preference::Preference;
use hedgerow_lab::subjects::structures::Structures;

const SIZE: [u32; 2] = [256, 192];

fn device() -> Device {
    let wanted = std::env::var("HEDGEROW_DEVICE").ok();
    Device::new(&DeviceOptions { wanted, ..DeviceOptions::default() }).expect("a device that fits")
}

fn scene() -> Scene {
    let name = std::env::var("HEDGEROW_BENCH_SCENE").unwrap_or_else(|_| "pine_hill".into());
    scene::load(&name, &LoadOptions { folders: scene::own_folders(), ..LoadOptions::default() })
        .expect("the scene loads")
}

/// A scene on the device, and room for its structure.
struct Built<'a> {
    device: &'a Device,
    bvh: Builder,
    input: Input,
    structure: Buffer<'a>,
    scratch: Buffer<'a>,
    _vertices: [Buffer<'a>; 2],
}

impl<'a> Built<'a> {
    fn new(device: &'a Device, scene: &Scene, options: &BuildOptions) -> Result<Built<'a>> {
        let mesh = &scene.mesh;
        let vertices = [device.upload("positions", &mesh.positions)?, device.upload("indices", &mesh.triangles)?];
        let input = Input::mesh(
            vertices[0].address(),
            mesh.positions.len() as u32,
            vertices[1].address(),
            mesh.triangles.len() as u32,
        );
        let bvh = Builder::new(device, options, input.primitive_count)?;
        let sizes = bvh.sizes();
        let structure = device.buffer("structure", sizes.structure)?;
        let scratch = device.buffer("scratch", sizes.scratch)?;
        let built = Built { device, bvh, input, structure, scratch, _vertices: vertices };
        built.build()?;
        Ok(built)
    }

    fn build(&self) -> Result<()> {
        let (structure, scratch) = (self.structure.region(), self.scratch.region());
        self.device.run(None, |recorder| self.bvh.record(recorder, &self.input, structure, scratch))
    }

    /// Through its structure, or a copy of it.
    fn trace(&self, structure: &Buffer<'_>, shape: &TraceShape, query: Query, rays: &Rays<'_>) -> Result<()> {
        let buffers = TraceBuffers {
            structure: structure.address(),
            rays: rays.rays.region(),
            hits: rays.hits.region(),
            work: None,
            count: rays.count,
        };
        self.device.run(None, |recorder| tracer::record(recorder, shape, query, &buffers))
    }

    /// A compacted copy.
    fn compacted(&self) -> Result<Buffer<'a>> {
        let header: Header = self.structure.read(1)[0];
        let bytes = header.compacted().offsets(size_of::<Triangle>() as u64).bytes;
        let compacted = self.device.buffer("compacted", bytes)?;
        self.compact(&compacted)?;
        Ok(compacted)
    }

    fn compact(&self, target: &Buffer<'_>) -> Result<()> {
        self.device.run(None, |recorder| compact::record(recorder, self.structure.address(), target.region()))
    }
}

/// Rays on the device, and room for their hits.
struct Rays<'a> {
    rays: Buffer<'a>,
    hits: Buffer<'a>,
    count: u32,
}

impl<'a> Rays<'a> {
    fn new(device: &'a Device, rays: &[Ray]) -> Result<Rays<'a>> {
        let hits = device.buffer("hits", (rays.len() * size_of::<Hit>()) as u64)?;
        Ok(Rays { rays: device.upload("rays", rays)?, hits, count: rays.len() as u32 })
    }

    /// The rays of a kind, through what was built.
    fn of(kind: RayKind, built: &Built<'a>, scene: &Scene) -> Result<Rays<'a>> {
        let shape = TraceShape::of(built.device);
        let rays = kinds::generate(kind, scene, &RayOptions { size: SIZE, seed: 1 }, &mut |rays| {
            let rays = Rays::new(built.device, rays)?;
            built.trace(&built.structure, &shape, Query::ClosestHit, &rays)?;
            Ok(rays.hits.read(rays.count as usize))
        })?;
        Rays::new(built.device, &rays)
    }
}

const KINDS: [RayKind; 3] = [RayKind::Primary, RayKind::Diffuse1, RayKind::Random];

fn build(c: &mut Criterion) {
    let (device, scene) = (device(), scene());
    let mut group = c.benchmark_group("build");
    group.sample_size(10).throughput(Throughput::Elements(scene.mesh.triangles.len() as u64));
    for schedule in [Schedule::Chain, Schedule::PERSISTENT] {
        let options = BuildOptions { schedule: Some(schedule), ..BuildOptions::DEFAULT };
        let built = Built::new(&device, &scene, &options).expect("it builds");
        group.bench_function(BenchmarkId::new("lbvh", schedule), |b| b.iter(|| built.build().expect("it builds")));
    }
}

fn trace(c: &mut Criterion) {
    let (device, scene) = (device(), scene());
    let built = Built::new(&device, &scene, &BuildOptions::DEFAULT).expect("it builds");
    let mut shapes = vec![
        ("gathered", TraceShape { rays_each: 1, ..TraceShape::subgroups(&device.limits) }),
        ("gathered, ray after ray", TraceShape::subgroups(&device.limits)),
    ];
    if device.limits.subgroup_is_exact && device.limits.subgroup_size <= Loads::MAX_LANES {
        shapes.push(("lane by lane", TraceShape::lanes(&device.limits)));
    }
    for kind in KINDS {
        let rays = Rays::of(kind, &built, &scene).expect("rays");
        let mut group = c.benchmark_group(kind.name());
        group.sample_size(10).throughput(Throughput::Elements(rays.count.into()));
        for (name, shape) in &shapes {
            group.bench_function(*name, |b| {
                b.iter(|| built.trace(&built.structure, shape, kind.query(), &rays).expect("it traces"));
            });
        }
    }
}

/// What a compacted copy costs, and the rays through it beside those through what was built.
fn compaction(c: &mut Criterion) {
    let (device, scene) = (device(), scene());
    let built = Built::new(&device, &scene, &BuildOptions::DEFAULT).expect("it builds");
    let compacted = built.compacted().expect("memory");
    let mut group = c.benchmark_group("compact");
    group.sample_size(10).throughput(Throughput::Elements(scene.mesh.triangles.len() as u64));
    group.bench_function("compact", |b| b.iter(|| built.compact(&compacted).expect("it compacts")));
    let shape = TraceShape::of(&device);
    for kind in KINDS {
        let rays = Rays::of(kind, &built, &scene).expect("rays");
        group.throughput(Throughput::Elements(rays.count.into()));
        for (name, structure) in [("as built", &built.structure), ("compacted", &compacted)] {
            group.bench_function(BenchmarkId::new(kind.name(), name), |b| {
                b.iter(|| built.trace(structure, &shape, kind.query(), &rays).expect("it traces"));
            });
        }
    }
    group.finish();
}

/// Thousands of small structures: in one call, in a call each, and the same of the driver's.
fn batch(c: &mut Criterion) {
    const COUNT: u32 = 4096;
    let wanted = std::env::var("HEDGEROW_DEVICE").ok();
    let options = DeviceOptions { wanted, driver_tracing: Some(DriverTracing::Query), ..DeviceOptions::default() };
    let device = Device::new(&options).expect("a device that fits");
    let workload = Workload::new(&device, COUNT).expect("memory");
    let mut makers = vec![("", Structures::ours(&device, accel::AccelOptions::DEFAULT))];
    makers.extend(Structures::drivers(&device).map(|drivers| (", the driver's", drivers)));
    let mut group = c.benchmark_group("batch");
    group.sample_size(10).throughput(Throughput::Elements(COUNT.into()));
    for (whose, structures) in makers {
        let batch = Batch::new(structures, &workload, Preference::FastBuild).expect("memory");
        for way in [Submission::OneCall, Submission::OneSubmit, Submission::SubmitEach] {
            let name = format!("{}{whose}", way.name());
            group.bench_function(name, |b| b.iter(|| batch.build(way, workload.count()).expect("it builds")));
        }
    }
}

criterion_group!(benches, build, trace, compaction, batch);
criterion_main!(benches);
