//! What a build on the CPU takes: the threads that it runs on, wall-clock and CPU time, and memory of the heap.

use super::{BuildRun, OnCpu};
use crate::measure::heap;
use crate::measure::record::MemoryRecord;
use crate::{Error, Result};
use cpu_time::ProcessTime;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::num::NonZeroU32;

/// The threads of a builder: its own, or those that all builders share.
#[derive(Debug, Default)]
pub struct BuildThreads {
    own: Option<ThreadPool>,
}

impl BuildThreads {
    /// As many threads of its own as it asks for, started at once, so that no build waits for that; `None` shares those of all.
    ///
    /// # Errors
    /// The system does not start as many.
    pub fn new(count: Option<NonZeroU32>) -> Result<BuildThreads> {
        let start = |count: NonZeroU32| {
            let pool = ThreadPoolBuilder::new().num_threads(count.get() as usize).build();
            pool.map_err(|error| Error::Argument(format!("{count} threads cannot be started ({error}); ask for fewer")))
        };
        Ok(BuildThreads { own: count.map(start).transpose()? })
    }

    /// How many there are.
    pub fn count(&self) -> u32 {
        self.own.as_ref().map_or_else(rayon::current_num_threads, ThreadPool::current_num_threads) as u32
    }

    /// Does `work` on them.
    pub fn run<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        match &self.own {
            Some(pool) => pool.install(work),
            None => work(),
        }
    }
}

/// Builds by `threads` threads: what `build` gives, and its run with the CPU time that it took.
pub fn on_cpu<T>(threads: u32, build: impl FnOnce() -> (T, BuildRun)) -> (T, BuildRun) {
    let start = ProcessTime::now();
    let (built, run) = build();
    let milliseconds = start.elapsed().as_secs_f64() * 1e3;
    (built, BuildRun { on_cpu: Some(OnCpu { threads, milliseconds }), ..run })
}

/// The most bytes of the heap that the builds of a subject have held at once.
#[derive(Debug, Clone, Copy, Default)]
pub struct HeapPeak(Option<u64>);

impl HeapPeak {
    /// Builds by `threads` threads: what `build` gives, and its run with CPU time. `build` must have nothing left of an earlier
    /// build to free.
    pub fn measured<T>(&mut self, threads: u32, build: impl FnOnce() -> (T, BuildRun)) -> (T, BuildRun) {
        let (built, peak) = heap::most_held(|| on_cpu(threads, build));
        self.0 = self.0.max(peak);
        built
    }

    /// The memory of a structure that is this large.
    pub fn memory(&self, structure_bytes: Option<u64>) -> MemoryRecord {
        let scratch_bytes = self.0.zip(structure_bytes).map(|(peak, structure)| peak.saturating_sub(structure));
        MemoryRecord { structure_bytes, scratch_bytes, peak_bytes: self.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_runs_on_the_threads_of_the_builder() {
        let own = BuildThreads::new(NonZeroU32::new(3)).expect("three threads");
        assert_eq!((own.count(), own.run(rayon::current_num_threads)), (3, 3));
        let shared = BuildThreads::new(None).expect("none of its own");
        assert_eq!(shared.run(rayon::current_num_threads), shared.count() as usize);
    }

    #[test]
    fn cpu_time_is_that_of_all_threads() {
        let spin = || (0..20_000_000u64).fold(0, |sum, i| std::hint::black_box(sum ^ i));
        let (_, run) = on_cpu(2, || (rayon::join(spin, spin), BuildRun::whole(1.0)));
        let on_cpu = run.on_cpu.expect("measured");
        assert!(on_cpu.threads == 2 && on_cpu.milliseconds > 1.0, "{on_cpu:?}");
    }
}
