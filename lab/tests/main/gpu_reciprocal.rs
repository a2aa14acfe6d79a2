//! Reciprocals have the bits of the host, however inexactly a device divides (`glsl/gpu/reciprocal.glsl`): the hits of rays, the matrices of
//! instance records and the splits of kd-trees depend on it.

use crate::common::device;
use hedgerow::gpu::Kernel;
use hedgerow_lab::random::SplitMix64;
use hedgerow_lab::{arguments, shaders};

/// By how many units in the last place a quotient may be off, rounded up: Vulkan, "Precision of Individual Operations".
const MOST_OFF: i32 = 3;

/// What has a normal reciprocal: every exponent and sign; mantissas at both ends and drawn.
fn values() -> Vec<f32> {
    let mut random = SplitMix64::new(3);
    let mut mantissas: Vec<u32> = (0..16).chain((1 << 23) - 16..1 << 23).collect();
    mantissas.extend((0..200).map(|_| random.bits() as u32 & 0x7f_ffff));
    let of_mantissa =
        |m: u32| (1..=252).flat_map(move |e: u32| [0, 1 << 31].map(|sign| f32::from_bits(sign | e << 23 | m)));
    mantissas.into_iter().flat_map(of_mantissa).collect()
}

/// The reciprocal of a value's mantissa, off by some units.
fn estimate(x: f32, units: i32) -> f32 {
    let mantissa = f32::from_bits(x.to_bits() & 0x7f_ffff | 0x3f80_0000);
    f32::from_bits((1.0 / mantissa).to_bits().wrapping_add_signed(units))
}

#[test]
fn reciprocals_are_those_of_the_host_by_any_division_that_vulkan_allows() {
    let values = values();
    let bytes = size_of_val(&values[..]) as u64;
    let given = device().upload("values", &values).unwrap();
    let [by_estimate, by_device] = ["by estimate", "by device"].map(|name| device().buffer(name, bytes).unwrap());
    let group = device().tuning.small_group;
    for units in -MOST_OFF..=MOST_OFF {
        let estimates: Vec<f32> = values.iter().map(|&x| estimate(x, units)).collect();
        let estimates = device().upload("estimates", &estimates).unwrap();
        let arguments = arguments::Reciprocal {
            values: given.address(),
            estimates: estimates.address(),
            by_estimate: by_estimate.address(),
            by_device: by_device.address(),
            count: values.len() as u32,
        };
        let kernel = Kernel::new(&shaders::MEASURE_RECIPROCAL, group, &[]);
        let groups = arguments.count.div_ceil(group);
        device().run(None, |recorder| recorder.dispatch(&kernel, &arguments, groups)).unwrap();
        let found = [&by_estimate, &by_device].map(|buffer| buffer.read::<f32>(values.len()));
        for (i, x) in values.iter().enumerate() {
            let bits = found.each_ref().map(|found| found[i].to_bits());
            assert_eq!(bits, [(1.0 / x).to_bits(); 2], "1 / {x:e}, {units} units off");
        }
    }
}
