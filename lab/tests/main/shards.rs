//! `hedgerow bench --shard I/N` and `hedgerow report`: shares joined are the whole, and devices stay apart.

use crate::program::{err, out, program, text};
use hedgerow_lab::experiments::bench::results;
use hedgerow_lab::experiments::fly;
use hedgerow_lab::measure::record::Record;
use std::path::{Path, PathBuf};
use std::process::{Child, Output, Stdio};

const SCENES: [&str; 6] =
    ["gen:icosphere:1", "gen:soup:700:1", "gen:stadium:2", "gen:grid:9", "gen:needles:300:2", "gen:icosphere:2"];

fn started(arguments: &[&str]) -> Child {
    program(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the binary starts")
}

fn ended(child: Child) -> Output {
    child.wait_with_output().expect("the binary ends")
}

/// Builders of the host: seconds, and no device.
fn bench(output: &Path, more: &[&str]) -> Child {
    let output = text(output);
    let fixed = ["-b", "lbvh-host,sweep", "--size", "24x16", "--runs", "1", "--rays", "primary,ao", "--no-pictures"];
    started(&[&["bench", "-o", output], &fixed[..], &SCENES[..], more].concat())
}

#[track_caller]
fn succeeded(output: Output) -> String {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    out(&output)
}

/// What is the same in every run.
fn contents(records: &[Record]) -> Vec<(String, String, Option<u64>, Vec<String>)> {
    let of = |r: &Record| {
        let checksums = r.trace.iter().map(|trace| trace.checksum.clone()).collect();
        (r.scene.clone(), r.builder.clone(), r.quality.sah.map(f64::to_bits), checksums)
    };
    let mut all: Vec<_> = records.iter().map(of).collect();
    all.sort();
    all
}

fn report(folders: &[PathBuf], output: &Path) -> Output {
    let mut arguments = vec!["report", "-o", text(output)];
    arguments.extend(folders.iter().map(|folder| text(folder)));
    ended(started(&arguments))
}

#[test]
fn shares_by_processes_joined_are_the_whole_matrix() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let whole = folder.path().join("whole");
    let whole_run = bench(&whole, &[]);
    let shares: Vec<PathBuf> = (1..=3).map(|i| folder.path().join(format!("share {i}"))).collect();
    let runs: Vec<Child> =
        shares.iter().zip(1..).map(|(share, i)| bench(share, &["--shard", &format!("{i}/3")])).collect();
    succeeded(ended(whole_run));
    runs.into_iter().for_each(|run| drop(succeeded(ended(run))));
    let counts: Vec<usize> = shares.iter().map(|share| results::read(share).expect("records").len()).collect();
    assert!(counts.iter().sum::<usize>() == 12 && counts.iter().all(|&n| n >= 2 && n % 2 == 0), "{counts:?}");

    let joined = folder.path().join("joined");
    let page = succeeded(report(&shares, &joined));
    assert_eq!(page.trim(), joined.join("index.html").to_str().expect("text"));
    let [whole, joined] = [whole, joined].map(|folder| results::read(&folder).expect("records"));
    assert_eq!(contents(&joined), contents(&whole));
}

#[test]
fn devices_stay_apart_and_what_is_measured_twice_is_told_once() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let one = folder.path().join("one");
    succeeded(ended(bench(&one, &["--shard", "1/3"])));
    let text = std::fs::read_to_string(one.join("results.jsonl")).expect("records");
    let line = text.lines().next().expect("a record");
    let mut record: Record = serde_json::from_str(line).expect("a record");
    (record.device, record.driver, record.subgroup) = ("Some GPU".into(), "its driver 1.2".into(), 32);
    record.valid = Some(false);
    let other = folder.path().join("other");
    std::fs::create_dir(&other).expect("a folder");
    std::fs::write(other.join("results.jsonl"), serde_json::to_string(&record).expect("JSON") + "\n").expect("a file");

    let joined = folder.path().join("joined");
    succeeded(report(&[one.clone(), other.clone(), one.clone()], &joined));
    let page = std::fs::read_to_string(joined.join("index.html")).expect("a page");
    assert!(page.contains("2 devices") && page.contains("Some GPU"), "{page}");
    let gpu = results::read(&joined.join("some-gpu-its-driver-1-2")).expect("records of the GPU alone");
    assert_eq!(gpu, [record.clone()]);
    let mut folders = std::fs::read_dir(&joined).expect("a folder").map(|entry| entry.expect("an entry").path());
    let own =
        folders.find(|path| path.is_dir() && !path.ends_with("some-gpu-its-driver-1-2")).expect("the other device");
    assert_eq!(contents(&results::read(&own).expect("records")), contents(&results::read(&one).expect("records")));

    let markdown = folder.path().join("results.md");
    let paths = [&one, &other, &markdown].map(|path| path.to_str().expect("text"));
    succeeded(ended(started(&["report", paths[0], paths[1], "--markdown", paths[2]])));
    let page = std::fs::read_to_string(&markdown).expect("a page");
    let rows = page.lines().filter(|line| line.contains(&format!("`{}`", record.builder))).count();
    let measured = results::read(&one).expect("records").iter().filter(|r| r.builder == record.builder).count();
    assert_eq!(rows, measured + 1, "{page}");
    assert!(page.contains("## Some GPU\n\nits driver 1.2, commit ") && page.contains("| primary"), "{page}");
    // The one that was wrong, and what that means.
    assert_eq!(page.matches('†').count(), 2, "{page}");
    assert!(page.contains(&format!("| `{}` †", record.builder)), "{page}");
}

#[test]
fn camera_paths_of_several_folders_are_on_one_page() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let fixed = ["--frames", "0..2", "--cadence", "never", "-b", "sweep", "--size", "16x12", "--frame-size", "16x12"];
    let flown = |scene: &str, output: &Path| {
        let arguments = [&["fly", scene, "--runs", "1", "-o", text(output)], &fixed[..]].concat();
        succeeded(ended(started(&arguments)));
        fly::page::read(output).expect("records")
    };
    let folders = ["one", "other"].map(|name| folder.path().join(name));
    let scenes = ["gen:clutter:20:1", "gen:clutter:30:1"];
    let all = [0, 1].map(|i| flown(scenes[i], &folders[i])).concat();
    let joined = folder.path().join("joined");
    succeeded(report(&folders, &joined));
    assert_eq!(fly::page::read(&joined).expect("records"), all);
    let page = std::fs::read_to_string(joined.join("fly.html")).expect("a page");
    assert!(scenes.iter().all(|scene| page.contains(scene)), "{page}");
}

#[test]
fn wrong_folders_and_lines_are_named() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let says = |output: Output, status: i32, words: &str| {
        let text = err(&output);
        assert!(output.status.code() == Some(status) && text.contains(words), "{words}: {text}");
    };
    let empty = folder.path().join("empty");
    std::fs::create_dir(&empty).expect("a folder");
    says(report(std::slice::from_ref(&empty), &folder.path().join("a")), 2, "holds none of results.jsonl");
    std::fs::write(empty.join("results.jsonl"), "\n{\"schema\":1}\n").expect("a file");
    says(report(&[empty], &folder.path().join("a")), 1, "results.jsonl:2: not a record");
    says(ended(bench(&folder.path().join("b"), &["--shard", "4/3"])), 2, "\"4/3\" is not a share; write I/N");
}
