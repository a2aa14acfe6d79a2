//! Division on the device.

use crate::common::device;
use hedgerow::gpu::Kernel;
use hedgerow_lab::device::{Device, probe};
use hedgerow_lab::{Result, arguments, shaders};

/// Whether `device` divides as the host does, correctly rounded, where quotients are normal. Vulkan allows an error of 2.5 ulp.
///
/// BVHs and kd-trees do not depend on it. The t, u and v of hits and the matrices of instance records do: they have the bits of the
/// host where this is true, and [`probe::is_near`] compares them elsewhere.
fn divides_exactly(device: &Device) -> Result<bool> {
    const COUNT: u32 = 1 << 16;
    let mut state = 1u32;
    // Mantissas are drawn, exponents are at most 2^±30: quotients are normal.
    let mut draw = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let sign_and_mantissa = state & 0x807F_FFFF;
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f32::from_bits(sign_and_mantissa | (97 + (state >> 8) % 61) << 23)
    };
    let (mut numerators, denominators): (Vec<f32>, Vec<f32>) = (0..COUNT).map(|_| (draw(), draw())).unzip();
    // Reciprocals have instructions of their own.
    numerators[..COUNT as usize / 2].fill(1.0);
    let upload = |name: &str, values: &[f32]| device.upload(name, values);
    let (above, below) = (upload("probe: numerators", &numerators)?, upload("probe: denominators", &denominators)?);
    let quotients = upload("probe: quotients", &vec![0.0; COUNT as usize])?;
    let arguments = arguments::Divide {
        numerators: above.address(),
        denominators: below.address(),
        quotients: quotients.address(),
        count: COUNT,
    };
    let group = device.tuning.small_group;
    let kernel = Kernel::new(&shaders::MEASURE_DIVIDE, group, &[]);
    device.run(None, |recorder| recorder.dispatch(&kernel, &arguments, COUNT.div_ceil(group)))?;
    let quotients: Vec<f32> = quotients.read(COUNT as usize);
    let mut of_both = numerators.iter().zip(&denominators).zip(&quotients);
    Ok(of_both.all(|((a, b), quotient)| (a / b).to_bits() == quotient.to_bits()))
}

/// lavapipe and SwiftShader do, so the other tests compare t, u and v bit by bit.
#[test]
fn this_driver_divides_exactly() {
    assert!(divides_exactly(device()).unwrap());
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
