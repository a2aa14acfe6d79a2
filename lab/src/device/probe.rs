//! What a driver is asked because no property tells it: that started workgroups go on, that long loops end where they should
//! (Mesa 22.3's lavapipe ends them after 65,535 rounds and says nothing), and whether it divides exactly.

use super::Device;
use crate::Result;
use crate::arguments;
use crate::shaders;
use hedgerow::gpu::Kernel;
use hedgerow::gpu::task_pool::State;

/// What the probe found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Findings {
    /// A loop of 100,000 rounds counted to 100,000.
    pub long_loops: bool,
    /// A growing tree of tasks came out of the task pool complete and in order.
    pub task_pool: bool,
}

/// Runs a pool of `phases` phases, 1, 2, 4, … tasks each, with `workgroups` workers. Returns the pool's state and what each
/// task left behind; [`tree_on_host`] says what that should be.
///
/// # Errors
/// Too little memory; the submit failed or did not end.
pub fn tree(device: &Device, phases: usize, workgroups: u32, loop_length: u32) -> Result<(State, Vec<u32>, u32)> {
    let tasks = (1usize << phases) - 1;
    let pool = device.upload("probe: pool", &[State::new(phases, &[1])])?;
    let visits = device.upload("probe: visits", &vec![0u32; tasks])?;
    let loops = device.upload("probe: loop", &[0u32])?;
    let arguments =
        arguments::PoolTree { pool: pool.address(), visits: visits.address(), loops: loops.address(), loop_length };
    let kernel = Kernel::new(&shaders::MEASURE_POOL_TREE, device.limits.subgroup_size, &[]);
    device.run(None, |recorder| recorder.dispatch(&kernel, &arguments, workgroups))?;
    Ok((pool.read(1)[0], visits.read(tasks), loops.read(1)[0]))
}

/// What the tasks of [`tree`] should leave behind: one more than their parent.
pub fn tree_on_host(phases: usize) -> Vec<u32> {
    (0..phases).flat_map(|phase| std::iter::repeat_n(phase as u32 + 2, 1 << phase)).collect()
}

/// Asks the driver of `device`. Milliseconds, and the time to compile one small shader.
///
/// # Errors
/// As [`tree`].
pub fn probe(device: &Device) -> Result<Findings> {
    const PHASES: usize = 8;
    const LOOP: u32 = 100_000;
    let (state, visits, counted) = tree(device, PHASES, 16, LOOP)?;
    Ok(Findings { long_loops: counted == LOOP, task_pool: state.status == 0 && visits == tree_on_host(PHASES) })
}

/// Whether `device` divides as the host does, correctly rounded, where quotients are normal. Vulkan allows an error of 2.5 ulp.
///
/// BVHs and kd-trees do not depend on it. The t, u and v of hits and the matrices of instance records do: they have the bits of the
/// host where this is true, and are compared within [`QUOTIENT_ULPS`] a division elsewhere.
///
/// # Errors
/// As [`tree`].
pub fn divides_exactly(device: &Device) -> Result<bool> {
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

/// By how many units in the last place a quotient may be off, rounded up: Vulkan, "Precision of Individual Operations".
pub const QUOTIENT_ULPS: f32 = 3.0;

/// Whether `got` is `expected`, or as near as `divisions` inexact divisions one after the other leave it.
pub fn is_near(got: f32, expected: f32, divisions: u32) -> bool {
    let bound = divisions as f32 * QUOTIENT_ULPS * f32::EPSILON * expected.abs();
    got.to_bits() == expected.to_bits() || bound.is_finite() && (got - expected).abs() <= bound
}
