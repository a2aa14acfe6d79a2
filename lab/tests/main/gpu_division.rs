//! Division on the device.

use crate::common::device;
use hedgerow_lab::device::probe;

/// lavapipe and SwiftShader do, so the other tests compare t, u and v bit by bit.
#[test]
fn this_driver_divides_exactly() {
    assert!(probe::divides_exactly(device()).unwrap());
}

#[test]
fn what_is_near_is_told_from_what_is_not() {
    let next = |x: f32, ulps: u32| f32::from_bits(x.to_bits() + ulps);
    for x in [1.0f32, 1.5, 1e-30, -7e20] {
        assert!(probe::is_near(x, x, 0) && probe::is_near(next(x, 3), x, 2), "{x}");
        assert!(!probe::is_near(next(x, 20), x, 1) && !probe::is_near(-x, x, 5), "{x}");
    }
    assert!(probe::is_near(f32::INFINITY, f32::INFINITY, 1) && !probe::is_near(1.0, f32::INFINITY, 0));
}
