//! A device may be tuned as a CPU or as a GPU: every builder gives the same bytes either way.

use crate::conditional::needs;
use hedgerow::gpu::TuningChoice;
use hedgerow_lab::device::{Device, DeviceOptions};
use hedgerow_lab::scene::{self, LoadOptions, Scene};
use hedgerow_lab::subjects::builders::Spec;

crate::conditional::tests! {
    linear_builds_give_the_same_bytes_by_either_tuning: needs::no_tuning(),
    clustered_builds_give_the_same_bytes_by_either_tuning: needs::no_tuning(),
    hploc_gives_the_same_bytes_by_either_tuning: needs::no_tuning(),
    wide_trees_have_the_same_bytes_by_either_tuning: needs::no_tuning(),
    kd_trees_have_the_same_bytes_by_either_tuning: needs::no_tuning(),
    ten_real_scenes_have_the_same_bytes_by_either_tuning: needs::time("minutes, over the scenes of HEDGEROW_SCENES"),
    a_tuning_that_is_not_there_is_named_with_those_that_are: needs::nothing(),
}

/// What is built on the device in ways that differ in kind.
const LINEAR: [&str; 8] = [
    "lbvh",
    "lbvh:schedule=persistent",
    "lbvh:codes=mc30:collapse=off",
    "lbvh:codes=mip9",
    "lbvh:codes=bin4a4",
    "lbvh:codes=emc64var+robust",
    "lbvh:split=0.3",
    "lbvh:optimise=fast",
];
const CLUSTERED: [&str; 2] = ["hlbvh", "ploc:radius=10"];
const HPLOC: [&str; 3] = ["hploc", "hploc:window=32", "hploc:schedule=persistent"];
const WIDE: [&str; 3] = ["lbvh:width=4", "lbvh:width=8", "lbvh:width=8q"];
/// The pools' kernels take minutes to compile by a second tuning; `make test-gpu` has them.
const KD: [&str; 1] = ["kd-gpu:schedule=chain"];

/// Of all that, what a large scene is built by.
const QUICK: [&str; 11] = [
    "lbvh",
    "lbvh:codes=mip9",
    "lbvh:codes=bin4a4",
    "lbvh:codes=emc64var+robust",
    "lbvh:split=0.3",
    "lbvh:optimise=fast",
    "hlbvh",
    "ploc:radius=10",
    "hploc",
    "hploc:width=8q",
    "kd-gpu",
];

fn device(tuning: TuningChoice) -> Device {
    let wanted = std::env::var("HEDGEROW_DEVICE").ok();
    Device::new(&DeviceOptions { wanted, tuning, ..DeviceOptions::default() }).expect("a device that fits")
}

/// The bytes that a builder makes of a scene.
fn bytes(device: &Device, builder: &str, scene: &Scene) -> Vec<u8> {
    let spec: Spec = builder.parse().expect("a builder");
    let mut subject = spec.make(Some(device), &scene.mesh).expect("the scene fits");
    subject.build().expect("it builds");
    subject.validate().unwrap_or_else(|error| panic!("{}: {builder}: {error}", scene.name));
    subject.bytes().expect("it is read").expect("a tree of ours")
}

fn compare(scene: &Scene, builders: &[&str], [as_cpu, as_gpu]: [&Device; 2]) {
    for builder in builders {
        let [cpu, gpu] = [as_cpu, as_gpu].map(|device| bytes(device, builder, scene));
        assert!(cpu.len() > scene.mesh.triangles.len(), "{}: {builder}: too few bytes for a tree", scene.name);
        assert!(cpu == gpu, "{}: {builder}: other bytes by the tuning of GPUs", scene.name);
    }
}

fn compare_on_generated(builders: &[&str]) {
    let (as_cpu, as_gpu) = (device(TuningChoice::Cpu), device(TuningChoice::Gpu));
    assert_ne!(as_cpu.tuning, as_gpu.tuning);
    for scene in ["gen:stadium:3", "gen:soup:6000:3"] {
        let scene = scene::load(scene, &LoadOptions::default()).expect("a generator");
        compare(&scene, builders, [&as_cpu, &as_gpu]);
    }
}

fn linear_builds_give_the_same_bytes_by_either_tuning() {
    compare_on_generated(&LINEAR);
}

fn clustered_builds_give_the_same_bytes_by_either_tuning() {
    compare_on_generated(&CLUSTERED);
}

fn hploc_gives_the_same_bytes_by_either_tuning() {
    compare_on_generated(&HPLOC);
}

fn wide_trees_have_the_same_bytes_by_either_tuning() {
    compare_on_generated(&WIDE);
}

fn kd_trees_have_the_same_bytes_by_either_tuning() {
    compare_on_generated(&KD);
}

/// Of the folder of shared scenes, each as a whole.
fn ten_real_scenes_have_the_same_bytes_by_either_tuning() {
    const SCENES: [&str; 10] = [
        "teapot",
        "sponza",
        "bunny",
        "armadillo",
        "classroom",
        "samurai_monastery",
        "san_francisco",
        "terrain_jacksboro",
        "motorbike",
        "bunny_in_city",
    ];
    let (as_cpu, as_gpu) = (device(TuningChoice::Cpu), device(TuningChoice::Gpu));
    let options = LoadOptions { folders: vec![crate::conditional::scenes_folder()], progress: None };
    for name in SCENES {
        let scene = scene::load(name, &options).expect(name);
        compare(&scene, &QUICK, [&as_cpu, &as_gpu]);
        println!("{name}: {} triangles, {} builders", scene.mesh.triangles.len(), QUICK.len());
    }
}

fn a_tuning_that_is_not_there_is_named_with_those_that_are() {
    let error = "fast".parse::<TuningChoice>().expect_err("there is none");
    assert_eq!(error, "unknown tuning \"fast\"; use one of auto, cpu, gpu");
    for choice in [TuningChoice::Auto, TuningChoice::Cpu, TuningChoice::Gpu] {
        assert_eq!(choice.to_string().parse(), Ok(choice));
    }
}
