//! The persistent task pool: phases of tasks in one dispatch (`glsl/gpu/task_pool.glsl`).
//!
//! The pool is for passes whose phases wait for each other often, or whose task counts only the device knows. It needs that
//! workgroups which have started go on (the laboratory's `device::probe` tries it); a chain of dispatches needs nothing.

use bytemuck::{Pod, Zeroable};

/// Phases a pool has at most: `POOL_PHASES_AT_MOST` in task_pool.glsl.
pub const PHASES_AT_MOST: usize = 188;

/// The pool's state in device memory, 1,008 bytes: `PoolState` in task_pool.glsl, which says what the room is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct State {
    /// The next ticket.
    pub next: u32,
    /// 1 if a worker waited longer than the bound and gave up: the results are not to be used.
    pub status: u32,
    /// Phases.
    pub phases: u32,
    room_before: [u32; 29],
    /// Tasks finished.
    pub done: u32,
    room_behind: [u32; 31],
    /// Tasks of each phase; may be written by the device while an earlier phase runs.
    pub tasks: [u32; PHASES_AT_MOST],
}

impl State {
    /// A pool that has not begun, with the task counts that are known up front; the rest are 0 until a task writes them.
    ///
    /// # Panics
    /// More phases than [`PHASES_AT_MOST`], or more counts than phases.
    pub fn new(phases: usize, tasks: &[u32]) -> State {
        assert!(tasks.len() <= phases && phases <= PHASES_AT_MOST, "{} counts, {phases} phases", tasks.len());
        let mut state = State { phases: phases as u32, ..Zeroable::zeroed() };
        state.tasks[..tasks.len()].copy_from_slice(tasks);
        state
    }
}
