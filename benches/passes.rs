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
use hedgerow::Result;
use hedgerow::accel;
use hedgerow::ash::{self, vk};
use hedgerow::bvh::compact;
use hedgerow::bvh::layout::{Header, Triangle};
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

    /// Through its structure, or a copy of it.
    fn trace(&self, structure: &Buffer<'_>, shape: &Shape, query: Query, rays: &Rays<'_>) -> Result<()> {
        let buffers = Buffers {
            structure: structure.address(),
            rays: rays.rays.address(),
            hits: rays.hits.address(),
            work: None,
            count: rays.count,
        };
        self.device.run(None, |recorder| tracer::record(recorder, shape, query, &buffers))
    }

    /// A compacted copy.
    fn compacted(&self) -> Result<Buffer<'a>> {
        let header: Header = self.structure.read(1)[0];
        let bytes = header.compacted().sizes(size_of::<Triangle>() as u64).bytes;
        let compacted = self.device.buffer("compacted", bytes)?;
        self.compact(&compacted)?;
        Ok(compacted)
    }

    fn compact(&self, target: &Buffer<'_>) -> Result<()> {
        self.device.run(None, |recorder| compact::record(recorder, self.structure.address(), target.address()))
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
        let shape = Shape::of(&built.device.limits);
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
    let built = Built::new(&device, &scene, &Options::DEFAULT).expect("it builds");
    let compacted = built.compacted().expect("memory");
    let mut group = c.benchmark_group("compact");
    group.sample_size(10).throughput(Throughput::Elements(scene.mesh.triangles.len() as u64));
    group.bench_function("compact", |b| b.iter(|| built.compact(&compacted).expect("it compacts")));
    let shape = Shape::of(&device.limits);
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

/// Structures of 12 to 500 triangles out of one pair of buffers.
struct Batch<'a> {
    geometries: Vec<vk::AccelerationStructureGeometryKHR<'static>>,
    ranges: Vec<vk::AccelerationStructureBuildRangeInfoKHR>,
    _buffers: [Buffer<'a>; 2],
}

impl<'a> Batch<'a> {
    const COUNT: u32 = 4096;

    fn new(device: &'a Device) -> Result<Batch<'a>> {
        let soup = scene::load("gen:soup:1100000:1", &LoadOptions::default())?;
        let positions = device.upload("positions", &soup.mesh.positions)?;
        let indices = device.upload("indices", &soup.mesh.triangles)?;
        let address = |device_address| vk::DeviceOrHostAddressConstKHR { device_address };
        let triangles = vk::AccelerationStructureGeometryTrianglesDataKHR::default()
            .vertex_format(vk::Format::R32G32B32_SFLOAT)
            .vertex_data(address(positions.address()))
            .vertex_stride(12)
            .max_vertex(soup.mesh.positions.len() as u32 - 1)
            .index_type(vk::IndexType::UINT32)
            .index_data(address(indices.address()));
        let geometry = vk::AccelerationStructureGeometryKHR::default()
            .geometry_type(vk::GeometryTypeKHR::TRIANGLES)
            .geometry(vk::AccelerationStructureGeometryDataKHR { triangles });
        let mut first = 0;
        let ranges = (0..Batch::COUNT).map(|i| {
            let count = 12 + i * 7919 % 467;
            let range = vk::AccelerationStructureBuildRangeInfoKHR::default().primitive_count(count);
            let range = range.primitive_offset(12 * first);
            first += count;
            range
        });
        let ranges: Vec<_> = ranges.collect();
        assert!(first as usize <= soup.mesh.triangles.len());
        Ok(Batch { geometries: vec![geometry; Batch::COUNT as usize], ranges, _buffers: [positions, indices] })
    }

    fn info(&self, i: usize) -> vk::AccelerationStructureBuildGeometryInfoKHR<'_> {
        vk::AccelerationStructureBuildGeometryInfoKHR::default()
            .ty(vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL)
            .flags(vk::BuildAccelerationStructureFlagsKHR::PREFER_FAST_BUILD)
            .geometries(&self.geometries[i..=i])
    }
}

/// Thousands of small structures: in one call, in a call each, and in one call of the driver's.
fn batch(c: &mut Criterion) {
    let wanted = std::env::var("HEDGEROW_DEVICE").ok();
    let options = DeviceOptions { wanted, validation: false, ray_query: true };
    let device = Device::new(&options).expect("a device that fits");
    let batch = Batch::new(&device).expect("memory");
    let mut group = c.benchmark_group("batch");
    group.sample_size(10).throughput(Throughput::Elements(Batch::COUNT.into()));
    let place = vk::AccelerationStructureBuildTypeKHR::DEVICE;
    type Info<'a> = vk::AccelerationStructureBuildGeometryInfoKHR<'a>;
    // Places each structure and its scratch memory in two large buffers.
    let placed =
        |size: &dyn Fn(&Info<'_>, u32) -> vk::AccelerationStructureBuildSizesInfoKHR<'static>,
         create: &dyn Fn(&vk::AccelerationStructureCreateInfoKHR<'_>) -> vk::AccelerationStructureKHR| {
            let mut at = [0u64; 2];
            let sizes: Vec<_> = (0..Batch::COUNT as usize)
                .map(|i| {
                    let sizes = size(&batch.info(i), batch.ranges[i].primitive_count);
                    let begin = at;
                    at[0] += sizes.acceleration_structure_size.next_multiple_of(256);
                    at[1] += sizes.build_scratch_size.next_multiple_of(256);
                    (begin, sizes.acceleration_structure_size)
                })
                .collect();
            let structures = device.buffer("structures", at[0]).expect("memory");
            let scratch = device.buffer("scratch", at[1] + 256).expect("memory");
            let scratch_address = scratch.address().next_multiple_of(256);
            let infos: Vec<Info<'_>> = sizes
                .iter()
                .enumerate()
                .map(|(i, &(begin, bytes))| {
                    let create_info = vk::AccelerationStructureCreateInfoKHR::default()
                        .buffer(structures.raw())
                        .offset(begin[0])
                        .size(bytes)
                        .ty(vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL);
                    let scratch = vk::DeviceOrHostAddressKHR { device_address: scratch_address + begin[1] };
                    batch.info(i).dst_acceleration_structure(create(&create_info)).scratch_data(scratch)
                })
                .collect();
            (infos, structures, scratch)
        };
    let ranges: Vec<&[_]> = batch.ranges.iter().map(std::slice::from_ref).collect();

    let ours = accel::Device::new(&device);
    let (infos, _structures, _scratch) = placed(
        &|info, count| {
            let mut sizes = vk::AccelerationStructureBuildSizesInfoKHR::default();
            // SAFETY: the pointers are those of live slices.
            unsafe { ours.get_acceleration_structure_build_sizes(place, info, &[count], &mut sizes) }.expect("sizes");
            sizes
        },
        // SAFETY: the buffer is live and large enough.
        &|info| unsafe { ours.create_acceleration_structure(info, None) }.expect("a multiple of 256"),
    );
    let build = |from: usize, to: usize| {
        device
            // SAFETY: all memory is live and each build's own.
            .run(None, |r| unsafe {
                ours.cmd_build_acceleration_structures(r.commands(), &infos[from..to], &ranges[from..to])
            })
            .expect("it builds");
    };
    group.bench_function("one call", |b| b.iter(|| build(0, infos.len())));
    group.bench_function("a call each", |b| b.iter(|| (0..infos.len()).for_each(|i| build(i, i + 1))));
    if !device.has_ray_query() {
        return;
    }
    let driver = ash::khr::acceleration_structure::Device::new(device.ash_instance(), device.ash_device());
    let (infos, _structures, _scratch) = placed(
        &|info, count| {
            let mut sizes = vk::AccelerationStructureBuildSizesInfoKHR::default();
            // SAFETY: the pointers are those of live slices.
            unsafe { driver.get_acceleration_structure_build_sizes(place, info, &[count], &mut sizes) };
            sizes
        },
        // SAFETY: the buffer is live and large enough.
        &|info| unsafe { driver.create_acceleration_structure(info, None) }.expect("a multiple of 256"),
    );
    group.bench_function("one call of the driver's", |b| {
        b.iter(|| {
            let built = device.run(None, |r| {
                // SAFETY: all memory is live and each build's own.
                unsafe { driver.cmd_build_acceleration_structures(r.commands(), &infos, &ranges) };
                Ok(())
            });
            built.expect("it builds");
        });
    });
    for info in &infos {
        // SAFETY: made above; every submit has been waited for.
        unsafe { driver.destroy_acceleration_structure(info.dst_acceleration_structure, None) };
    }
}

criterion_group!(benches, build, trace, compaction, batch);
criterion_main!(benches);
