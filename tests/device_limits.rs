//! A device that has less than it could: without what is optional, with inexact subgroups, with small limits, without timestamps.

use crate::common::twins::{assert_same, on_host};
use crate::common::{OPTIONS, corpus, open};
use hedgerow::accel::{AccelOptions, Wide};
use hedgerow::ash::vk;
use hedgerow::bvh::builder::{BuildOptions, Method, Window};
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::reinsertion::ReinsertionOptions;
use hedgerow::gpu::scan::{Scan, ScanBuffers};
use hedgerow::gpu::{Recorder, Timestamps, TuningChoice};
use hedgerow::trace::{Hit, Query, Ray};
use hedgerow_lab::device::{Device, DeviceOptions, Validation};
use hedgerow_lab::experiments::check::twins;
use hedgerow_lab::random::SplitMix64;
use hedgerow_lab::scene::{Instances, LoadOptions, load_instances};
use hedgerow_lab::subjects::device_rays::RayBuffers;
use hedgerow_lab::subjects::levels::Levels;
use hedgerow_lab::subjects::queries::{Forms, Queries};
use hedgerow_lab::subjects::structures::Structures;

type Flags = vk::BuildAccelerationStructureFlagsKHR;

fn restricted(text: &str) -> Device {
    open(DeviceOptions { restrict: text.parse().expect("a list of restrictions"), ..OPTIONS })
}

/// A device with all that is optional, without the validation layers, which refuse extensions that are younger than they are.
fn with_everything() -> Device {
    let options = DeviceOptions { validation: Validation::Off, maximal_reconvergence: true, ..OPTIONS };
    Device::new(&options).expect("a device")
}

const COUNT: u32 = 100_000;

fn numbers() -> Vec<u32> {
    (0..COUNT).map(|i| i % 7).collect()
}

/// Sums of the numbers before each, by the device.
fn sums(device: &Device, timestamps: Option<&mut Timestamps>) -> Vec<u32> {
    let scan = Scan::new(device, COUNT);
    let values = device.upload("values", &numbers()).expect("memory");
    let sums = device.buffer("sums", 4 * u64::from(scan.sums_words())).expect("memory");
    let buffers = ScanBuffers { values: values.address(), results: values.address(), sums: sums.address() };
    device
        .run(timestamps, |recorder| {
            recorder.phase("scan");
            scan.record(recorder, &buffers)
        })
        .expect("it scans");
    values.read(COUNT as usize)
}

#[test]
fn limits_can_only_be_lowered() {
    let all = &crate::common::open(OPTIONS).limits;
    let less = restricted("shared=16384,invocations=128,groups=64,timestamps=0").limits.clone();
    assert_eq!((less.shared_memory, less.workgroup_invocations, less.workgroup_count), (16384, 128, 64));
    assert_eq!((less.timestamp_bits, less.subgroup_size), (0, all.subgroup_size));
    assert_eq!(less.subgroup_is_exact, all.subgroup_is_exact);
    assert_eq!(restricted("shared=1000000000").limits.shared_memory, all.shared_memory);
    let larger = restricted(&format!("subgroup={}", 4 * all.subgroup_size)).limits.clone();
    assert_eq!((larger.subgroup_size, larger.subgroup_is_exact), (4 * all.subgroup_size, false));
    assert!(!restricted("inexact").limits.subgroup_is_exact);
}

#[test]
fn results_are_the_same_with_and_without_what_is_optional() {
    let (expected, _) = hedgerow::gpu::twin::scan::exclusive(&numbers());
    let all = with_everything();
    assert!(sums(&all, None) == expected, "with what is optional");
    for tuning in [TuningChoice::Cpu, TuningChoice::Gpu] {
        for restrict in ["", "inexact", "shared=16384,invocations=128,groups=64"] {
            let restrict = restrict.parse().expect("restrictions");
            let device = open(DeviceOptions { restrict, tuning, ..OPTIONS });
            assert!(sums(&device, None) == expected, "{tuning}, {restrict:?}");
        }
    }
}

/// What rays hit in a scene of instances, by queries of a shader for such nodes.
fn hits(device: &Device, wide: Wide, forms: Forms, scene: &Instances, rays: &[Ray]) -> Vec<Hit> {
    let structures = Structures::ours(device, AccelOptions { wide, ..AccelOptions::DEFAULT });
    let mut levels = Levels::new(structures, scene, Flags::PREFER_FAST_TRACE).expect("memory");
    levels.build().expect("it builds");
    let mut levels = levels.traced_as(forms);
    let buffers = RayBuffers::new(device, rays).expect("memory");
    levels.trace(&buffers, Query::ClosestHit, Queries::OneEach).expect("it traces");
    buffers.read_hits()
}

#[test]
fn rays_hit_the_same_by_loads_of_64_bits_and_without_them() {
    let scene = load_instances("gen:forest:20", &LoadOptions::default()).expect("a generator");
    let mut random = SplitMix64::new(3);
    let centre = scene.camera.look;
    let mut rays = Vec::new();
    for _ in 0..5000 {
        let (from, to) = (random.around(8.0), random.around(3.0));
        let origin = std::array::from_fn(|k| centre[k] + from[k]);
        rays.push(Ray {
            origin,
            t_min: 0.0,
            direction: std::array::from_fn(|k| to[k] - from[k]),
            t_max: f32::INFINITY,
        });
    }
    let cpu = DeviceOptions { tuning: TuningChoice::Cpu, ..OPTIONS };
    let with = open(cpu.clone());
    let other = open(DeviceOptions { restrict: "gathers".parse().expect("a restriction"), ..cpu.clone() });
    let without = open(DeviceOptions { restrict: "inexact".parse().expect("a restriction"), ..cpu });
    assert_eq!((with.limits.int64, without.limits.int64), (with.tuning.trace.in_longs, false));
    // Nodes of eight are loaded so by one of the two, and member by member by the other.
    let [nodes, others] = [&with, &other].map(|device| device.tuning.trace.nodes_in_longs);
    assert_eq!(nodes ^ others, with.limits.int64);
    let (never, always) = (Wide::Never, Wide::Always);
    let expected = hits(&without, never, Forms::OF_TWO, &scene, &rays);
    assert!(expected.iter().filter(|hit| hit.is_some()).count() > 500);
    for device in [&with, &other, &without] {
        let met = [Forms::OF_TWO, Forms::ALL].map(|forms| (never, forms));
        for (wide, forms) in met.into_iter().chain([Forms::OF_EIGHT, Forms::ALL].map(|forms| (always, forms))) {
            assert!(hits(device, wide, forms, &scene, &rays) == expected, "{wide:?} {forms:?}");
        }
        // Nodes that the shader leaves out: no ray meets them, and none ends badly.
        for (wide, forms) in [(always, Forms::OF_TWO), (never, Forms::OF_EIGHT)] {
            assert!(hits(device, wide, forms, &scene, &rays).iter().all(|hit| !hit.is_some()), "{wide:?} {forms:?}");
        }
    }
}

/// Small trees by one workgroup and larger ones by many, optimised. Wide nodes and top levels are built for the rays above.
#[test]
fn trees_have_the_same_bytes_in_elements_of_64_bits_and_without_them() {
    let cpu = DeviceOptions { tuning: TuningChoice::Cpu, ..OPTIONS };
    let devices = ["", "gathers", "inexact"]
        .map(|restrict| open(DeviceOptions { restrict: restrict.parse().expect("a restriction"), ..cpu.clone() }));
    let [with, other, without] = devices.each_ref().map(|device| device.tuning.build.in_longs);
    let is_cpu = devices[0].limits.kind == vk::PhysicalDeviceType::CPU;
    assert_eq!((with ^ other, without), (is_cpu && devices[0].limits.int64, false));
    for count in [300, 5000] {
        let mesh = corpus::random("random", count, [-0.5; 3], [1.0; 3]);
        for method in [Method::Lbvh, Method::Ploc { radius: 8 }, Method::Hploc(Window::DEFAULT)] {
            let (codes, optimise) = (Some(Code::Emc64Var.full()), Some(ReinsertionOptions { rounds: 2, stride: 1 }));
            let options = BuildOptions { method, codes, optimise, ..BuildOptions::DEFAULT };
            let expected = on_host(&mesh, &options);
            for device in &devices {
                let what = format!("{count} {method:?}, in longs: {}", device.tuning.build.in_longs);
                assert_same(&twins::on_device(device, &mesh, &options), &expected, &what);
            }
        }
    }
}

#[test]
fn without_timestamps_a_submit_is_one_phase_by_the_hosts_clock() {
    let device = restricted("timestamps=0");
    let mut timestamps = Timestamps::new(&device, 2).expect("a query pool");
    assert!(timestamps.phases().expect("nothing ran").is_empty());
    sums(&device, Some(&mut timestamps));
    let phases = timestamps.phases().expect("phases");
    assert_eq!(phases.iter().map(|phase| phase.name).collect::<Vec<_>>(), ["submit"]);
    assert!(phases[0].milliseconds > 0.0);
    assert_eq!(device.timer(), "wall");
}

#[test]
fn phases_that_there_is_no_room_for_are_one() {
    let device = crate::common::device();
    let mut timestamps = Timestamps::new(device, 2).expect("a query pool");
    for (recorded, told) in [(1, vec!["a"]), (2, vec!["a", "b"]), (4, vec!["a", Timestamps::REST])] {
        let record = |recorder: &mut Recorder| {
            ["a", "b", "c", "d"][..recorded].iter().for_each(|name| recorder.phase(name));
            Ok(())
        };
        device.run(Some(&mut timestamps), record).expect("it runs");
        let phases = timestamps.phases().expect("phases");
        assert_eq!(phases.iter().map(|phase| phase.name).collect::<Vec<_>>(), told);
    }
}

/// As on a GPU with memory of its own.
#[test]
fn staged_buffers_hold_what_was_written() {
    let device = restricted("staged");
    assert!(!device.maps_memory());
    // More than is staged at once, and no multiple of it.
    let numbers: Vec<u32> = (0..5_000_003u32).map(|i| i.wrapping_mul(2_654_435_769)).collect();
    let buffer = device.upload("numbers", &numbers).expect("memory");
    assert!(buffer.read::<u32>(numbers.len()) == numbers);
    assert_eq!(buffer.read_at::<u32>(4 * 4_999_999, 4), numbers[4_999_999..]);
    assert_eq!(buffer.read_at::<u8>(5, 3), bytemuck::cast_slice::<u32, u8>(&numbers[1..2])[1..]);
    assert!(buffer.read::<u32>(0).is_empty());
    buffer.write(&[7u32]);
    assert_eq!(buffer.read::<u32>(2), [7, numbers[1]]);
    assert!(sums(&device, None) == hedgerow::gpu::twin::scan::exclusive(&self::numbers()).0);
    // What is uploaded while a command buffer is recorded is there when it runs.
    let scan = Scan::new(&device, COUNT);
    let sums = device.buffer("sums", 4 * u64::from(scan.sums_words())).expect("memory");
    let mut values = None;
    device
        .run(None, |recorder| {
            let buffer = values.insert(device.upload("values", &self::numbers())?);
            let buffers = ScanBuffers { values: buffer.address(), results: buffer.address(), sums: sums.address() };
            scan.record(recorder, &buffers)
        })
        .expect("it scans");
    assert!(
        values.expect("uploaded").read::<u32>(COUNT as usize)
            == hedgerow::gpu::twin::scan::exclusive(&self::numbers()).0
    );
}

#[test]
fn too_little_memory_is_an_error_that_says_how_much_there_is() {
    let device = crate::common::device();
    let Err(error) = device.buffer("a mountain", 1 << 50) else { panic!("there is no such memory") };
    let text = error.to_string();
    assert!(text.starts_with("a mountain needs 1125899906842624 bytes of device memory"), "{text}");
}
