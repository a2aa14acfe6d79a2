//! What the device tests share: one device a test binary, with the validation layers on where they are installed.
#![allow(dead_code, unused_imports, reason = "each test binary uses its part")]

pub mod backends;
pub mod geometries;
pub mod probe;
pub mod twins;

pub use hedgerow::measure::check::{agree, corpus, matrices, mixture, shapes, world};

use hedgerow::gpu::{Device, DeviceOptions, DriverTracing, Restrict, TuningChoice};
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

/// The device of this test binary. Any validation message fails the test that caused it.
///
/// Without the layers (`make test` installs them) the tests still run, and say so.
pub fn device() -> &'static Device {
    static DEVICE: OnceLock<Device> = OnceLock::new();
    DEVICE.get_or_init(|| {
        let wanted = std::env::var("HEDGEROW_DEVICE").ok();
        open(DeviceOptions { wanted, restrict: restrict(), tuning: tuning(), ..OPTIONS })
    })
}

/// The device of tests: with everything on.
pub const OPTIONS: DeviceOptions = DeviceOptions {
    wanted: None,
    validation: true,
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
            Device::new(&DeviceOptions { validation: false, ..options })
        })
        .expect("a Vulkan device that has what hedgerow needs")
}
