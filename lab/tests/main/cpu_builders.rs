//! `hedgerow cpu-builders`: what is written, what adds up, and what is refused.

use crate::program::{err, hedgerow, text};
use hedgerow_lab::experiments::cpu_builders::page;
use hedgerow_lab::measure::record::Record;
use std::path::Path;
use std::process::Output;

/// Two builders on a scene of the repository: seconds.
fn run(folder: &Path, more: &[&str]) -> Output {
    let folder = text(folder);
    let arguments = ["cpu-builders", "--quick", "--size", "16x12", "--epo", "off", "-o", folder];
    hedgerow(&[&arguments, more].concat())
}

fn names(records: &[Record]) -> Vec<(&str, &str)> {
    records.iter().map(|record| (record.scene.as_str(), record.builder.as_str())).collect()
}

#[test]
fn a_run_leaves_records_and_a_page_and_the_next_adds_to_them() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let done = run(folder.path(), &["grass", "-b", "sweep,binned", "--no-device"]);
    assert_eq!(done.status.code(), Some(0), "{}", err(&done));
    let records = page::read(folder.path()).expect("records");
    let traced: Vec<Record> = records.iter().filter(|record| !record.trace.is_empty()).cloned().collect();
    assert_eq!(names(&traced), [("grass", "sweep"), ("grass", "binned")]);
    for record in &traced {
        assert_eq!((record.valid, record.triangles), (Some(true), 28_000));
        let quality = &record.quality;
        let sum = 3.0 * quality.sah_inner.expect("measured") + 2.0 * quality.sah_leaf.expect("measured");
        assert!((sum - quality.sah.expect("measured")).abs() < 1e-9 * sum, "{quality:?}");
    }
    // A tree is the same whoever many threads build it.
    for record in records.iter().filter(|record| record.builder.ends_with(":threads=1")) {
        let of_all = records.iter().find(|other| record.builder.starts_with(&other.builder)).expect("both");
        assert_eq!(record.quality.sah, of_all.quality.sah);
    }
    let html = || std::fs::read_to_string(folder.path().join("cpu-builders.html")).expect("a page");
    assert!(html().contains("Trees of grass") && html().contains("Traced on the host alone"));
    for file in ["charts/cpu-grass-sah.svg", "charts/cpu-grass-all-rays-host.png", "cpu-builders.json"] {
        assert!(folder.path().join(file).is_file(), "{file} is missing");
    }

    let lines = folder.path().join("more.jsonl");
    let text = lines.to_str().expect("text");
    let done = run(folder.path(), &["gen:icosphere:3", "-b", "sweep", "--no-device", "--add", "--json", text]);
    assert_eq!(done.status.code(), Some(0), "{}", err(&done));
    let all = page::read(folder.path()).expect("records");
    assert_eq!(all[..records.len()], records[..], "what was there stays");
    assert_eq!(all[records.len()..], page::read(&lines).expect("records"), "--json has the records of this run alone");
    assert!(html().contains("Trees of grass") && html().contains("Trees of gen:icosphere:3"));

    let done = run(folder.path(), &["gen:icosphere:3", "-b", "sweep", "--no-device"]);
    assert_eq!(done.status.code(), Some(0), "{}", err(&done));
    assert!(!html().contains("Trees of grass"), "without --add a run begins anew");
}

#[test]
fn the_device_traces_the_same_tree() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let done = run(folder.path(), &["gen:stadium:3", "-b", "sweep"]);
    assert_eq!(done.status.code(), Some(0), "{}", err(&done));
    let records = page::read(folder.path()).expect("records");
    let of = |name: &str| records.iter().find(|record| record.builder == name);
    let host = of("sweep").expect("measured");
    let Some(device) = of("sweep:trace=device") else {
        let page = std::fs::read_to_string(folder.path().join("cpu-builders.html")).expect("a page");
        assert!(page.contains("there is no device"), "{page}");
        return;
    };
    assert_eq!((device.valid, &device.build, &device.quality.sah), (Some(true), &host.build, &host.quality.sah));
    assert!(device.subgroup > 0 && host.subgroup == 0);
    for (host, device) in host.trace.iter().zip(&device.trace) {
        assert_eq!((&host.rays, host.count, host.hits), (&device.rays, device.count, device.hits));
        let close = |a: Option<f64>, b: Option<f64>| (a.expect("counted") / b.expect("counted") - 1.0).abs() < 0.05;
        assert!(close(host.steps, device.steps) && close(host.tests, device.tests), "{host:?} {device:?}");
    }
}

#[test]
fn what_cannot_be_measured_is_refused_before_any_work() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (wrong, says) in [
        (&["-b", "lbvh"][..], "take hedgerow bench for this one"),
        (&["-b", "sweep:trace=host"], "leave trace= out"),
        (&["-b", "sweeep"], "unknown builder"),
    ] {
        let done = run(folder.path(), &[&["grass"], wrong].concat());
        assert_eq!(done.status.code(), Some(2), "{}", err(&done));
        assert!(err(&done).contains(says), "{}", err(&done));
    }
    let file = folder.path().join("file");
    std::fs::write(&file, "").expect("a folder of our own");
    let done = run(&file, &["grass", "-b", "sweep", "--no-device"]);
    assert!(done.status.code() == Some(1) && err(&done).contains("file"), "{}", err(&done));
    let done = run(folder.path(), &["no-such-scene", "gen:icosphere:1", "-b", "sweep", "--no-device"]);
    assert!(done.status.code() == Some(1) && err(&done).contains("no-such-scene"), "{}", err(&done));
    assert!(page::read(folder.path()).expect("the other scene").iter().any(|record| record.scene == "gen:icosphere:1"));
}
