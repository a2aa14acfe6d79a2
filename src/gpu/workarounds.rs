//! What a driver's faults need, each from the driver's id and version, with the test that shows it.
//!
//! A fault that costs nothing to live with has no flag: the code does what suits every driver, and a comment there says why.
//! These are five. lavapipe of Mesa 26 loads what is at one address for all lanes even where no lane is active (`bvh::encode`,
//! `glsl/bvh/clusters.glsl`, `glsl/bvh/ploc.glsl`, `glsl/kdtree/small.glsl` keep such addresses in range); Mesa takes each
//! access to shared memory that makes itself visible for a fence (`build/memory_model.rs`); lavapipe before Mesa 25 ends long
//! loops early, which [`super::probe`] finds out by running one; SwiftShader writes elsewhere, and crashes,
//! where a shader loads its arguments from a table in its middle (`build/by_table.rs` has them loaded at the start; tests/accel/arguments.rs);
//! and it optimises by SPIR-V Tools, whose constant propagation (`CCPPass`) never gives a value to a `min` of two constants that it does
//! not fold, and takes what meets that at a phi for the other side (`glsl/bvh/wide/children.glsl`; tests/drivers).

use super::Limits;
use ash::vk;

/// Faults of the driver at hand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Workarounds {
    /// The driver halves the triangles of its own structures in the order of the input: they are no peer. lavapipe before Mesa 26.
    /// Shown by: `measure::peers::driver::note`, and the traces of `make bench` beside `make bench-peers`.
    pub driver_halves_in_order: bool,
    /// A transform multiplies the fourth component of 16-bit vertices, `firstVertex` leads to other vertices, and many a ray
    /// passes by a flat box or ends where it enters one, in the driver's own structures. lavapipe before Mesa 26 (25.0.7).
    /// Shown by: tests/accel/blas.rs, tests/accel/boxes.rs.
    pub driver_misreads_geometry: bool,
    /// A ray query through a top level with an inactive instance, or one of mask 0, crashes the process. lavapipe from Mesa 26 on
    /// (26.1.6). Shown by: tests/accel/empty.rs, tests/accel/tlas.rs, tests/accel/facing.rs.
    pub driver_crashes_on_inactive_instances: bool,
    /// Active boxes beside inactive ones are lost in the driver's own structures. Every lavapipe so far (25.0.7, 26.1.6).
    /// Shown by: tests/accel/boxes.rs.
    pub driver_loses_boxes: bool,
}

impl Workarounds {
    /// For a driver without faults that are known.
    pub const NONE: Workarounds = Workarounds {
        driver_halves_in_order: false,
        driver_misreads_geometry: false,
        driver_crashes_on_inactive_instances: false,
        driver_loses_boxes: false,
    };

    /// What the driver of a device needs.
    pub fn of(limits: &Limits) -> Workarounds {
        Workarounds::of_driver(limits.driver, limits.driver_version)
    }

    #[doc(hidden)]
    pub fn of_driver(driver: vk::DriverId, version: u32) -> Workarounds {
        if driver != vk::DriverId::MESA_LLVMPIPE {
            return Workarounds::NONE;
        }
        let is_old = vk::api_version_major(version) < 26;
        Workarounds {
            driver_halves_in_order: is_old,
            driver_misreads_geometry: is_old,
            driver_crashes_on_inactive_instances: !is_old,
            driver_loses_boxes: true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_follow_from_driver_and_version() {
        let of = |driver, major| Workarounds::of_driver(driver, vk::make_api_version(0, major, 0, 7));
        assert_eq!(of(vk::DriverId::NVIDIA_PROPRIETARY, 25), Workarounds::NONE);
        assert_eq!(of(vk::DriverId::GOOGLE_SWIFTSHADER, 5), Workarounds::NONE);
        let (old, new) = (of(vk::DriverId::MESA_LLVMPIPE, 25), of(vk::DriverId::MESA_LLVMPIPE, 26));
        assert!(old.driver_halves_in_order && old.driver_misreads_geometry);
        assert!(!old.driver_crashes_on_inactive_instances && new.driver_crashes_on_inactive_instances);
        assert!(!new.driver_misreads_geometry && new.driver_loses_boxes && old.driver_loses_boxes);
    }
}
