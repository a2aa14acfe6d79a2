//! The task pool finishes what it is given, with any number of workers.

use crate::common::device;
use hedgerow_lab::device::probe::{self, Findings};

#[test]
fn a_growing_tree_of_tasks_comes_out_complete_with_any_number_of_workers() {
    for phases in [1, 2, 7, 12] {
        for workers in [1, 2, 3, 16, 200] {
            let (state, visits, _) = probe::tree(device(), phases, workers, 0).unwrap();
            assert_eq!(visits, probe::tree_on_host(phases), "{phases} phases, {workers} workers");
            assert_eq!((state.status, state.done), (0, (1 << phases) - 1), "{phases} phases, {workers} workers");
        }
    }
}

#[test]
fn the_probe_finds_this_driver_fit() {
    assert_eq!(probe::probe(device()).unwrap(), Findings { long_loops: true, task_pool: true });
}
