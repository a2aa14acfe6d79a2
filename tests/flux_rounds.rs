//! The example of an engine whose rays teach a copy of its tree, run as it stands.

#[path = "../examples/flux_rounds.rs"]
#[allow(dead_code)]
mod example;

use crate::common::device;

#[test]
fn a_copy_that_rays_taught_is_taken_and_frames_take_less_work_behind_it() {
    let mut frames = Vec::new();
    example::fly(device(), 5, |_, work, trial| frames.push((work, trial))).expect("flown");
    let trials: Vec<_> = frames.iter().filter_map(|(_, trial)| *trial).collect();
    assert_eq!(trials.iter().map(|trial| trial.is_taken).collect::<Vec<_>>(), [1], "{trials:?}");
    assert!(frames[4].0 < 0.95 * frames[3].0, "{frames:?}");
}
