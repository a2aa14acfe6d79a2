//! What the device tests share: one device a test binary, with the validation layers on where they are installed.
#![allow(dead_code, unused_imports, reason = "each test binary uses its part")]

pub mod backends;
pub mod geometries;
pub mod probe;
pub mod twins;

pub use hedgerow_lab::experiments::check::traced::traced;
pub use hedgerow_lab::experiments::check::{agree, corpus, matrices, mixture, shapes, world};

use hedgerow::gpu::TuningChoice;
use hedgerow_lab::device::{Device, DeviceOptions, DriverTracing, Restrict, Validation};
use std::cell::Cell;
use std::sync::OnceLock;

/// The tuning that `HEDGEROW_TUNING` asks for, as for the binary.
pub fn tuning() -> TuningChoice {
    std::env::var("HEDGEROW_TUNING").unwrap_or_default().parse().expect("HEDGEROW_TUNING is auto, cpu or gpu")
}

/// What `HEDGEROW_PRETEND` takes away from the device, such as `subgroup=32,inexact,shared=16384,invocations=128`: the tests run
/// as on a device that has less.
pub fn restrict() -> Restrict {
    std::env::var("HEDGEROW_PRETEND").unwrap_or_default().parse().expect("HEDGEROW_PRETEND is a list of restrictions")
}

/// Runs `body`, for which [`device`] is one of this tuning.
pub fn with_tuning<T>(tuning: TuningChoice, body: impl FnOnce() -> T) -> T {
    TUNING.set(Some(tuning));
    let result = body();
    TUNING.set(None);
    result
}

thread_local! {
    static TUNING: Cell<Option<TuningChoice>> = const { Cell::new(None) };
}

/// The device of this test binary, one for each tuning that is asked for. Any validation message fails the test that caused it.
///
/// Without the layers (`make test` installs them) the tests still run, and say so.
pub fn device() -> &'static Device {
    static DEVICES: [OnceLock<Device>; 3] = [const { OnceLock::new() }; 3];
    let tuning = TUNING.get().unwrap_or_else(tuning);
    DEVICES[tuning as usize].get_or_init(|| {
        let wanted = std::env::var("HEDGEROW_DEVICE").ok();
        open(DeviceOptions { wanted, restrict: restrict(), tuning, ..OPTIONS })
    })
}

/// The device of tests: with everything on, but that the validation layers leave shaders out. A quick check of all passes asks them
/// (lab/tests/main/check.rs).
pub const OPTIONS: DeviceOptions = DeviceOptions {
    wanted: None,
    validation: Validation::Calls,
    driver_tracing: Some(DriverTracing::Query),
    tuning: TuningChoice::Auto,
    maximal_reconvergence: false,
    restrict: Restrict::NONE,
};

/// A device of its own, as these options ask for it.
pub fn open(options: DeviceOptions) -> Device {
    Device::new(&options)
        .or_else(|error| {
            eprintln!("without validation layers: {error}");
            Device::new(&DeviceOptions { validation: Validation::Off, ..options })
        })
        .expect("a Vulkan device that has what hedgerow needs")
}

/// The corners of the triangles that builders take: finite, and of vertices that there are.
pub fn corners_of((_, positions, triangles): &corpus::Mesh) -> Vec<[[f32; 3]; 3]> {
    let corner = |v: u32| positions.get(v as usize).copied().filter(|p| p.iter().all(|x| x.is_finite()));
    let corners = |t: &[u32; 3]| Some([corner(t[0])?, corner(t[1])?, corner(t[2])?]);
    triangles.iter().filter_map(corners).collect()
}
