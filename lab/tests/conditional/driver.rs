//! The driver's own acceleration structure as a peer: its hits are those of plain arithmetic, so that comparing with it
//! means something.

use crate::common::corpus;
use crate::conditional::Needs;
use hedgerow::ash::vk;
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::lbvh;
use hedgerow::trace::{Hit, Query, Ray};
use hedgerow_lab::device::{Device, DeviceOptions, DriverTracing, Restrict};
use hedgerow_lab::measure::agreement::wrong_where_different;
use hedgerow_lab::scene::{self, Mesh};
use hedgerow_lab::subjects::Subject;
use hedgerow_lab::subjects::builders::Spec;
use hedgerow_lab::subjects::device_rays::RayBuffers;
use hedgerow_lab::subjects::levels::Levels;
use hedgerow_lab::subjects::peers::driver::{Driver, DriverPreference};
use hedgerow_lab::subjects::queries::Queries;
use hedgerow_lab::subjects::structures::Structures;
use std::sync::OnceLock;

crate::conditional::tests! {
    the_driver_reports_primitive_distance_and_weights_as_we_do: needs_driver(),
    building_twice_into_the_same_memory_gives_the_same_hits: needs_driver(),
    the_driver_and_we_find_the_same_hits: needs_driver(),
    a_pipeline_finds_the_hits_of_queries: needs_both(),
    two_levels_are_traced_by_a_pipeline_as_by_queries: needs_both(),
}

const PREFERENCES: [DriverPreference; 2] = [DriverPreference::FastBuild, DriverPreference::FastTrace];

/// A driver that builds and traces acceleration structures itself.
fn needs_driver() -> Needs {
    let device = crate::common::device();
    device.driver_tracing().is_none().then(|| format!("{} has no VK_KHR_acceleration_structure", device.found().name))
}

/// Queries and pipelines.
fn needs_both() -> Needs {
    let found = crate::common::device().found();
    let both = [DriverTracing::Query, DriverTracing::Pipeline];
    (found.driver_tracing != both).then(|| format!("{} has no VK_KHR_ray_tracing_pipeline beside queries", found.name))
}

/// The device with the driver's structures traced by a pipeline.
fn by_pipeline() -> &'static Device {
    static DEVICE: OnceLock<Device> = OnceLock::new();
    DEVICE.get_or_init(|| {
        let wanted = std::env::var("HEDGEROW_DEVICE").ok();
        // Staged too, as it is on the GPUs that have no queries.
        let restrict = Restrict { staged: true, ..crate::common::restrict() };
        crate::common::open(DeviceOptions {
            wanted,
            driver_tracing: Some(DriverTracing::Pipeline),
            restrict,
            ..crate::common::OPTIONS
        })
    })
}

fn traced(mesh: &Mesh, preference: DriverPreference, rays: &[Ray], query: Query) -> Vec<Hit> {
    traced_on(crate::common::device(), mesh, preference, rays, query)
}

fn traced_on(device: &Device, mesh: &Mesh, preference: DriverPreference, rays: &[Ray], query: Query) -> Vec<Hit> {
    let mut driver = Driver::new(device, mesh, preference).expect("the mesh fits");
    driver.build().expect("the driver builds");
    driver.set_rays(rays).expect("the rays fit");
    driver.trace(query).expect("the driver traces");
    driver.hits().expect("one hit a ray")
}

/// Two squares of two triangles each, at z = 1 (primitives 0, 1) and z = 2 (primitives 2, 3), over 0..1 in x and y.
fn two_squares() -> Mesh {
    let square = |z: f32| [[0., 0., z], [1., 0., z], [1., 1., z], [0., 1., z]];
    Mesh { positions: [square(1.0), square(2.0)].concat(), triangles: vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]] }
}

fn upwards(x: f32, y: f32, t_min: f32, t_max: f32) -> Ray {
    Ray { origin: [x, y, 0.0], t_min, direction: [0.0, 0.0, 0.5], t_max }
}

fn the_driver_reports_primitive_distance_and_weights_as_we_do() {
    // Below the diagonal lies the first triangle of a square: (0.75, 0.25) = v0 + 0.5 (v1 - v0) + 0.25 (v2 - v0).
    let rays = [
        upwards(0.75, 0.25, 0.0, f32::INFINITY),
        upwards(0.25, 0.75, 0.0, f32::INFINITY),
        upwards(0.75, 0.25, 2.5, f32::INFINITY),
        upwards(0.75, 0.25, 2.5, 3.5),
        upwards(1.5, 0.5, 0.0, f32::INFINITY),
    ];
    let expected = [
        Hit { t: 2.0, primitive: 0, u: 0.5, v: 0.25 },
        Hit { t: 2.0, primitive: 1, u: 0.25, v: 0.5 },
        Hit { t: 4.0, primitive: 2, u: 0.5, v: 0.25 },
        Hit::NONE,
        Hit::NONE,
    ];
    for preference in PREFERENCES {
        let hits = traced(&two_squares(), preference, &rays, Query::ClosestHit);
        for (hit, expected) in hits.iter().zip(&expected) {
            assert_eq!(hit.primitive, expected.primitive, "{preference:?}: {hits:?}");
            let close = |a: f32, b: f32| a == b || (a - b).abs() <= 1e-5;
            assert!(close(hit.t, expected.t) && close(hit.u, expected.u) && close(hit.v, expected.v), "{hit:?}");
        }
        let any = traced(&two_squares(), preference, &rays, Query::AnyHit);
        let met: Vec<_> = any.iter().map(|h| (h.t, h.is_some())).collect();
        assert_eq!(met, expected.map(|h| if h.is_some() { (0.0, true) } else { (f32::INFINITY, false) }));
    }
}

fn building_twice_into_the_same_memory_gives_the_same_hits() {
    let device = crate::common::device();
    let mut driver = Driver::new(device, &two_squares(), DriverPreference::FastTrace).expect("the mesh fits");
    driver.set_rays(&[upwards(0.75, 0.25, 0.0, 9.0)]).expect("the rays fit");
    let hits: Vec<_> = (0..2)
        .map(|_| {
            let run = driver.build().expect("the driver builds");
            let names: Vec<_> = run.phases.iter().map(|p| p.name).collect();
            assert_eq!(names, ["build", "tlas"]);
            assert_eq!(run.milliseconds, run.phases[0].milliseconds, "the bottom level alone is compared");
            driver.trace(Query::ClosestHit).expect("the driver traces");
            driver.hits().expect("one hit a ray")
        })
        .collect();
    assert_eq!(hits[0], hits[1]);
    assert_eq!(hits[0][0].primitive, 0);
}

/// Rays from a sphere around the mesh to points of its triangles, each of about unit length.
fn rays_at(mesh: &Mesh) -> Vec<Ray> {
    let is_finite = |t: &&[u32; 3]| t.iter().all(|&v| mesh.positions[v as usize].iter().all(|x| x.is_finite()));
    let finite: Vec<[u32; 3]> = mesh.triangles.iter().filter(is_finite).copied().collect();
    let bounds = Mesh { positions: mesh.positions.clone(), triangles: finite.clone() }.bounds();
    let (lo, hi) = (bounds.lo.map(f64::from), bounds.hi.map(f64::from));
    let radius = (0..3).map(|i| 0.5 * (hi[i] - lo[i])).fold(0.0, f64::max);
    let mut unit = corpus::unit_floats(5);
    let mut ray = |_| {
        let (z, angle) = (f64::from(2.0 * unit() - 1.0), std::f64::consts::TAU * f64::from(unit()));
        let across = (1.0 - z * z).sqrt();
        let p = [across * angle.cos(), across * angle.sin(), z];
        let origin: [f64; 3] = std::array::from_fn(|i| 0.5 * (lo[i] + hi[i]) + 2.0 * radius * p[i]);
        let triangle = finite[(unit() * finite.len() as f32) as usize];
        let [a, b, c] = triangle.map(|v| mesh.positions[v as usize].map(f64::from));
        let (u, v) = (f64::from(0.5 * unit()), f64::from(0.5 * unit()));
        let towards: [f64; 3] = std::array::from_fn(|i| a[i] + u * (b[i] - a[i]) + v * (c[i] - a[i]) - origin[i]);
        let length = towards.iter().map(|x| x.abs()).fold(f64::MIN_POSITIVE, f64::max);
        let direction = towards.map(|x| (x / length) as f32);
        Ray { origin: origin.map(|x| x as f32), t_min: 0.0, direction, t_max: f32::INFINITY }
    };
    if finite.is_empty() { vec![upwards(0.25, 0.25, 0.0, f32::INFINITY)] } else { (0..1000).map(&mut ray).collect() }
}

fn the_driver_and_we_find_the_same_hits() {
    let device = crate::common::device();
    let mut met = 0;
    for (name, positions, mut triangles) in corpus::meshes() {
        // Vulkan leaves to chance what an index out of range does.
        triangles.retain(|t| t.iter().all(|&v| (v as usize) < positions.len()));
        let mesh = Mesh { positions, triangles };
        let rays = rays_at(&mesh);
        let tree = lbvh::build(&mesh.positions, &mesh.triangles, Code::Mc30.full(), Collapse::OFF);
        let mut ours = "lbvh".parse::<Spec>().expect("a builder").make(Some(device), &mesh).expect("the mesh fits");
        ours.build().expect("it builds");
        ours.set_rays(&rays).expect("the rays fit");
        for query in [Query::ClosestHit, Query::AnyHit] {
            ours.trace(query).expect("it traces");
            let ours = ours.hits().expect("one hit a ray");
            met += ours.iter().filter(|hit| hit.is_some()).count();
            for preference in PREFERENCES {
                let theirs = traced(&mesh, preference, &rays, query);
                let wrong = |hits, reference| wrong_where_different(&tree, &rays, query, (hits, reference), rays.len());
                assert_eq!(wrong(&ours, &theirs), 0, "ours: {name}, {query:?}, {preference:?}");
                assert_eq!(wrong(&theirs, &ours), 0, "theirs: {name}, {query:?}, {preference:?}");
            }
        }
    }
    // Most meshes are hit by all of the rays aimed at them: points, lines and what is lost in rounding are not.
    assert!(met > 30_000, "{met} hits are no test");
}

/// NaN is among the weights of triangles that are lost in rounding.
fn bits(hits: &[Hit]) -> &[u32] {
    bytemuck::cast_slice(hits)
}

fn a_pipeline_finds_the_hits_of_queries() {
    let device = by_pipeline();
    assert_eq!(device.driver_tracing(), Some(DriverTracing::Pipeline));
    let mut met = 0;
    for (name, positions, mut triangles) in corpus::meshes() {
        triangles.retain(|t| t.iter().all(|&v| (v as usize) < positions.len()));
        let mesh = Mesh { positions, triangles };
        let rays = rays_at(&mesh);
        for query in [Query::ClosestHit, Query::AnyHit] {
            let of_queries = traced(&mesh, DriverPreference::FastTrace, &rays, query);
            let of_pipeline = traced_on(device, &mesh, DriverPreference::FastTrace, &rays, query);
            met += of_queries.iter().filter(|hit| hit.is_some()).count();
            match query {
                Query::ClosestHit => assert!(bits(&of_pipeline) == bits(&of_queries), "{name}"),
                // Which of several it is, is the driver's choice.
                Query::AnyHit => {
                    let there = |hits: &[Hit]| hits.iter().map(|hit| (hit.t, hit.is_some())).collect::<Vec<_>>();
                    assert_eq!(there(&of_pipeline), there(&of_queries), "{name}");
                }
            }
        }
    }
    assert!(met > 30_000, "{met} hits are no test");
}

/// As `hedgerow accel` measures them.
fn two_levels_are_traced_by_a_pipeline_as_by_queries() {
    let options = scene::LoadOptions { folders: Vec::new(), progress: None };
    let city = scene::load_instances("gen:city:100", &options).expect("a generator");
    let mut unit = corpus::unit_floats(9);
    // Down on each instance, aslant.
    let ray = |i: usize| {
        let target = city.instances[i % city.instances.len()].transform.map(|row| row[3]);
        let away = [unit() - 0.5, unit() - 0.5, unit() - 0.5].map(|x| 40.0 * x);
        let origin = std::array::from_fn(|k| target[k] + away[k]);
        Ray { origin, t_min: 0.0, direction: away.map(|x| -x), t_max: f32::INFINITY }
    };
    let rays: Vec<Ray> = (0..2000).map(ray).collect();
    let hits = [crate::common::device(), by_pipeline()].map(|device| {
        let structures = Structures::drivers(device).expect("the driver has structures");
        let flags = vk::BuildAccelerationStructureFlagsKHR::PREFER_FAST_TRACE;
        let mut levels = Levels::new(structures, &city, flags).expect("memory");
        levels.build().expect("it builds");
        let buffers = RayBuffers::new(device, &rays).expect("memory");
        levels.trace(&buffers, Query::ClosestHit, Queries::OneEach).expect("it traces");
        buffers.read_hits()
    });
    let met = hits[0].iter().filter(|hit| hit.is_some()).count();
    assert!(met > 100, "{met} hits are no test");
    assert_eq!(bits(&hits[0]), bits(&hits[1]));
}
