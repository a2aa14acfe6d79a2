//! What the device tests share: one device a test binary, with the validation layers on where they are installed.
#![allow(dead_code, unused_imports, reason = "each test binary uses its part")]

pub mod backends;
pub mod geometries;
pub mod probe;
pub mod twins;

pub use hedgerow::measure::check::{agree, corpus, matrices, mixture, shapes, world};

use hedgerow::gpu::{Device, DeviceOptions, TuningChoice};
use std::sync::OnceLock;

/// The tuning that `HEDGEROW_TUNING` asks for, as for the binary.
pub fn tuning() -> TuningChoice {
    std::env::var("HEDGEROW_TUNING").unwrap_or_default().parse().expect("HEDGEROW_TUNING is auto, cpu or gpu")
}

/// The device of this test binary. Any validation message fails the test that caused it.
///
/// Without the layers (`make test` installs them) the tests still run, and say so.
pub fn device() -> &'static Device {
    static DEVICE: OnceLock<Device> = OnceLock::new();
    DEVICE.get_or_init(|| {
        let wanted = std::env::var("HEDGEROW_DEVICE").ok();
        let options = DeviceOptions { wanted, validation: true, ray_query: true, tuning: tuning() };
        Device::new(&options)
            .or_else(|error| {
                eprintln!("without validation layers: {error}");
                Device::new(&DeviceOptions { validation: false, ..options })
            })
            .expect("a Vulkan device that has what hedgerow needs")
    })
}
