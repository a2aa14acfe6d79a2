//! Everything that runs on a device, once by each tuning, on whichever driver the loader finds: `make test-drivers` runs it on
//! SwiftShader, a driver with another compiler than lavapipe's.
//!
//! A test for each tuning, and no more: SwiftShader compiles every pipeline anew in each process, when it is made. So the time that
//! [`Context::pipelines`](hedgerow::gpu::Context::pipelines) tells of is the compiler's, and it is bounded here. It is that of the wall
//! clock, to which other programs add, and other threads, as SwiftShader compiles one at a time: what seems to take too long is made
//! again, alone, and what counts is the time that the process has on cores.

mod builders;
mod kd_trees;
mod structures;
mod tracers;

use crate::common::corpus::{self, Mesh};
use crate::common::{device, open, with_tuning};
use cpu_time::ProcessTime;
use hedgerow::gpu::{Kernel, TuningChoice};
use hedgerow_lab::device::DeviceOptions;
use std::time::{Duration, Instant};

/// What a pipeline may take of a core, and one whose kernel does everything.
const BOUNDS: [Duration; 2] = [Duration::from_secs(3), Duration::from_secs(8)];
/// How often one that seemed to take longer is made alone, until it does not: cores share memory and caches.
const TRIES: u32 = 3;

#[test]
#[ignore = "takes minutes, as SwiftShader compiles all pipelines in each process: make test-drivers runs it there"]
fn every_pass_cut_for_cpus_gives_the_bytes_of_the_host() {
    run(TuningChoice::Cpu);
}

#[test]
#[ignore = "takes minutes, as SwiftShader compiles all pipelines in each process: make test-drivers runs it there"]
fn every_pass_cut_for_gpus_gives_the_bytes_of_the_host() {
    run(TuningChoice::Gpu);
}

fn run(tuning: TuningChoice) {
    let slow = with_tuning(tuning, || run_parts(tuning));
    // All of them, so that one run tells of all.
    let late = slow.iter().filter(|kernel| !is_soon_made_alone(tuning, kernel));
    let late: Vec<String> = late.map(|kernel| format!("{}, {:?}", kernel.name(), bound(kernel))).collect();
    assert!(late.is_empty(), "{tuning}: take longer than they may, each of {TRIES} times: {}", late.join("; "));
}

/// On devices of their own, which have no pipelines yet.
fn is_soon_made_alone(tuning: TuningChoice, kernel: &Kernel) -> bool {
    let bound = bound(kernel);
    (0..TRIES).any(|_| time_alone(tuning, kernel) <= bound)
}

fn time_alone(tuning: TuningChoice, kernel: &Kernel) -> Duration {
    let device = open(DeviceOptions { tuning, ..crate::common::OPTIONS });
    let (begin, on_core) = (Instant::now(), ProcessTime::now());
    device.warm(std::slice::from_ref(kernel)).expect("the kernel compiles");
    let (time, on_core) = (begin.elapsed(), on_core.elapsed());
    println!(
        "{tuning}: {:6.2} s, {:.2} s of cores  {}, alone",
        time.as_secs_f32(),
        on_core.as_secs_f32(),
        kernel.name()
    );
    on_core
}

/// Every part; the kernels that took longer than they may.
fn run_parts(tuning: TuningChoice) -> Vec<Kernel> {
    let parts: [(&str, fn()); 8] = [
        ("builders", builders::all_give_the_bytes_of_the_host),
        ("splits and optimised trees", builders::splits_and_optimised_trees_too),
        ("tracers", tracers::hits_and_work_are_those_of_the_host),
        ("children in order", tracers::children_in_order_are_those_of_the_host),
        ("wide trees", tracers::wide_trees_are_those_of_the_host),
        ("accel", structures::all),
        ("kd-trees", kd_trees::builds_and_hits_are_those_of_the_host),
        ("merging", kd_trees::merges_and_restores_are_those_of_the_host),
    ];
    for (name, part) in parts {
        let begin = Instant::now();
        part();
        println!("{} {tuning}: {name} in {:.1} s", device().found().name, begin.elapsed().as_secs_f32());
    }
    let mut pipelines = device().pipelines();
    pipelines.sort_by_key(|(_, time)| std::cmp::Reverse(*time));
    let all: Duration = pipelines.iter().map(|(_, time)| time).sum();
    println!("{tuning}: {} pipelines in {:.0} s, the slowest ten:", pipelines.len(), all.as_secs_f32());
    for (kernel, time) in pipelines.iter().take(10) {
        println!("{tuning}: {:6.2} s  {}", time.as_secs_f32(), kernel.name());
    }
    pipelines.into_iter().filter(|(kernel, time)| *time > bound(kernel)).map(|(kernel, _)| kernel).collect()
}

fn bound(kernel: &Kernel) -> Duration {
    // The last is the pool in which all levels of a kd-tree run at once.
    let everything = ["persistent", "workgroup", "across/build"];
    let does_everything = everything.iter().any(|end| kernel.name().ends_with(end));
    BOUNDS[usize::from(does_everything)]
}

/// Meshes that hurt and are quickly built, none with coordinates whose areas are subnormal: a device may take those for zero.
fn meshes() -> Vec<Mesh> {
    let is_usual = |x: &f32| !x.is_finite() || *x == 0.0 || (1e-8..1e8).contains(&x.abs());
    let hard = hedgerow_lab::scene::degenerate(40).into_iter();
    let hard = hard.map(|hard| (hard.name.to_owned(), hard.mesh.positions, hard.mesh.triangles));
    let usual = hard.filter(|(_, positions, _)| positions.iter().flatten().all(is_usual));
    let random = [3, 129, 1025].map(|count| corpus::random(&format!("random {count}"), count, [-0.5; 3], [1.0; 3]));
    random.into_iter().chain(usual).collect()
}
