//! What a driver is asked because no property says it: that started workgroups go on, and that long loops end where they should
//! (Mesa 22.3's lavapipe ends them after 65,535 rounds and says nothing).

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
