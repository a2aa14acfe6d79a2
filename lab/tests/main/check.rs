//! `hedgerow check`: what is right passes, and whatever happens to a group is reported while the rest goes on.

use crate::program::{err, out, program};
use hedgerow_lab::device::{Device, DeviceOptions, Validation};
use hedgerow_lab::experiments::check::{CheckRecord, GROUPS};
use std::process::{Command, Output};

fn check(arguments: &[&str], faults: &str) -> Output {
    program(&["check"]).args(arguments).env("HEDGEROW_CHECK_FAULTS", faults).output().expect("the binary starts")
}

#[test]
fn a_quick_check_passes_and_its_record_says_on_what() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("check.json");
    // Where the validation layers are installed, they look at the shaders of every pass here: other tests leave them out.
    let layers = Device::new(&DeviceOptions { validation: Validation::All, ..DeviceOptions::default() });
    let arguments = ["--quick", "--json", file.to_str().expect("text"), "--validation"];
    let done = check(if layers.is_ok() { &arguments } else { &arguments[..3] }, "");
    let text = out(&done);
    assert_eq!(done.status.code(), Some(0), "{text}{}", err(&done));
    assert_eq!(text.lines().last(), Some(&*format!("{} passed, 0 failed", GROUPS.len())), "{text}");
    for word in ["commit", "device", "driver", "limits", "tuning"] {
        assert!(text.contains(word), "{word}: {text}");
    }
    let record: CheckRecord =
        serde_json::from_str(&std::fs::read_to_string(file).expect("a record")).expect("a record of a check");
    assert_eq!((record.passed, record.failed, record.quick), (GROUPS.len(), 0, true));
    assert!(record.groups.iter().all(|group| group.cases > 0 || !group.left_out.is_empty()), "{record:?}");
    assert!(record.ground.is_some_and(|ground| ground.limits.subgroup_size > 0));
}

#[test]
fn groups_that_crash_hang_differ_or_panic_fail_and_the_rest_goes_on() {
    let groups = "fault-crash,fault-hang,fault-differ,fault-panic,pool";
    let done = check(&["--quick", "--groups", groups, "--limit", "20"], "crash,hang,differ,panic");
    let text = out(&done);
    assert_eq!(done.status.code(), Some(1), "{text}{}", err(&done));
    assert_eq!(text.lines().last(), Some("1 passed, 4 failed"), "{text}");
    for says in [
        "in: it aborts",
        "no end after 20 s, in: it waits",
        "two words: word 1: 7, expected 2",
        "it panics: no device is like this (lab/src/experiments/check/groups/faults.rs:",
    ] {
        assert!(text.contains(says), "{says}: {text}");
    }
    #[cfg(unix)]
    assert!(text.contains("killed by signal 6 (SIGABRT)"), "{text}");
    assert!(text.lines().any(|line| line.starts_with("passed   pool")), "{text}");
}

/// As scripts/with-lavapipe.sh starts programs.
#[test]
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn groups_run_where_a_loader_was_given_the_program() {
    let mut command = Command::new("/lib64/ld-linux-x86-64.so.2");
    command.args(["--inhibit-rpath", "none", env!("CARGO_BIN_EXE_hedgerow")]);
    let done = command
        .args(["check", "--quick", "--groups", "scan,sort"])
        .output()
        .expect("the loader's place is part of the ABI");
    assert_eq!(out(&done).lines().last(), Some("2 passed, 0 failed"), "{}{}", out(&done), err(&done));
}

#[test]
fn what_is_not_there_is_named() {
    let done = check(&["--groups", "lbvh,nonsense"], "");
    assert_eq!(done.status.code(), Some(2));
    assert!(err(&done).contains("unknown group \"nonsense\"") && err(&done).contains("kd-merge"), "{}", err(&done));
    let done = check(&["--device", "no such device"], "");
    assert_eq!(done.status.code(), Some(1));
    assert!(err(&done).contains("unknown device \"no such device\""), "{}", err(&done));
}
