//! `hedgerow bench` and `hedgerow compare`: what is written, what is refused, and what goes on when something fails.

use crate::program::{err, hedgerow, out, text};
use hedgerow_lab::experiments::bench::results;
use hedgerow_lab::measure::record::Record;
use std::path::Path;
use std::process::Output;

/// Two builders of the host on small scenes: seconds, and no device.
fn bench(folder: &Path, more: &[&str]) -> Output {
    let output = text(folder);
    let mut arguments =
        vec!["bench", "-b", "lbvh-host,lbvh-host:collapse=off", "--size", "24x16", "--runs", "3", "-o", output];
    arguments.extend(more);
    hedgerow(&arguments)
}

fn status(output: &Output) -> Option<i32> {
    output.status.code()
}

fn records(folder: &Path) -> Vec<Record> {
    results::read(folder).expect("bench wrote records")
}

#[test]
fn a_run_leaves_records_a_table_charts_pictures_and_a_page() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let done = bench(folder.path(), &["gen:icosphere:2", "gen:stadium:3"]);
    assert_eq!(status(&done), Some(0), "{}", err(&done));
    let records = records(folder.path());
    let names: Vec<_> = records.iter().map(|r| (r.scene.as_str(), r.builder.as_str())).collect();
    let [collapsed, flat] = ["lbvh-host", "lbvh-host:collapse=off"];
    let (sphere, soup) = ("gen:icosphere:2", "gen:stadium:3");
    assert_eq!(names, [(sphere, collapsed), (sphere, flat), (soup, collapsed), (soup, flat)]);
    for record in &records {
        // No ray that leaves a sphere meets it again: there is no second bounce.
        let kinds = if record.scene == sphere { 6 } else { 7 };
        assert_eq!((record.valid, record.trace.len(), record.build.runs), (Some(true), kinds, 3), "{record:?}");
        assert!(record.trace.iter().all(|trace| !trace.checksum.starts_with('-')), "{record:?}");
    }
    for file in ["results.csv", "index.html", "charts/gen-stadium-3-trace-speed.svg", "charts/growth.png"] {
        assert!(folder.path().join(file).is_file(), "{file} is missing");
    }
    let page = std::fs::read_to_string(folder.path().join("index.html")).expect("just written");
    for picture in ["pictures/gen-icosphere-2.png", "pictures/gen-icosphere-2-steps-lbvh-host.png"] {
        assert!(folder.path().join(picture).is_file() && page.contains(picture), "{picture} is missing");
    }
    let table = out(&done);
    assert!(table.contains("lbvh-host uncollapsed") && table.contains("index.html"), "{table}");
}

#[test]
fn rays_by_queries_hit_what_the_tracer_hits() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let output = text(folder.path());
    let builders = "lbvh,lbvh:walk=query,lbvh:walk=turns,lbvh:width=8q:walk=query,lbvh:width=8q:walk=turns";
    let rays = "primary,ao,diffuse1,random";
    let done = hedgerow(&[
        "bench",
        "gen:clutter:40:1",
        "-b",
        builders,
        "--rays",
        rays,
        "--size",
        "48x32",
        "--runs",
        "1",
        "--no-pictures",
        "-o",
        output,
    ]);
    assert_eq!(status(&done), Some(0), "{}", err(&done));
    let records = records(folder.path());
    let [tracer, by_queries @ ..] = &records[..] else { panic!("{records:?}") };
    assert_eq!(by_queries.len(), 4);
    assert_eq!(tracer.trace.len(), 4, "{tracer:?}");
    for other in by_queries {
        let checksums = |record: &Record| record.trace.iter().map(|t| (t.hits, t.checksum.clone())).collect::<Vec<_>>();
        assert_eq!(checksums(other), checksums(tracer), "{}", other.builder);
        assert!(tracer.trace.iter().all(|trace| trace.hits > 0), "{tracer:?}");
    }
}

#[test]
fn kd_trees_are_told_in_the_tables_of_the_thesis_beside_its_own_figures() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let output = folder.path().to_str().expect("text");
    let arguments = [
        "bench",
        "gen:soup:2000:1",
        "-b",
        "kd-exact,lbvh-host",
        "--size",
        "24x16",
        "--runs",
        "1",
        "--no-pictures",
        "-o",
        output,
    ];
    let done = hedgerow(&arguments);
    assert_eq!(status(&done), Some(0), "{}", err(&done));
    let record = &records(folder.path())[0];
    let quality = &record.quality;
    let most = quality.prims_per_leaf_max.expect("a kd-tree tells it");
    assert!(most as f64 >= quality.prims_per_leaf.expect("told"), "{quality:?}");
    let page = || std::fs::read_to_string(folder.path().join("index.html")).expect("written");
    let section = |page: &str| page.split_once("<section id=\"kd-trees\">").map(|(_, rest)| rest.to_owned());
    let text = section(&page()).expect("there is a kd-tree");
    // Thirty rows of the thesis, in each of both tables.
    for (says, times) in [("CPU approx", 20), ("Its scenes are not ours", 1), ("170.45<", 1)] {
        assert_eq!(text.matches(says).count(), times, "{says}");
    }
    let table = out(&done);
    assert!(table.contains("full / empty") && table.contains("(Sibenik)"), "{table}");

    let file = folder.path().join("others.csv");
    std::fs::write(&file, "table,kind,scene,config,metric,value\nx,static,attic,theirs,nodes,77\n").expect("written");
    let others = [&arguments[..], &["--published", file.to_str().expect("text")]].concat();
    assert_eq!(status(&hedgerow(&others)), Some(0));
    let text = section(&page()).expect("there is a kd-tree");
    assert!(text.contains("attic") && !text.contains("Sibenik"));
    let missing = hedgerow(&[&arguments[..], &["--published", "/no/such.csv"]].concat());
    assert!(status(&missing) == Some(1) && err(&missing).contains("/no/such.csv"), "{}", err(&missing));

    let done = bench(folder.path(), &["gen:icosphere:1", "--no-pictures"]);
    assert_eq!(status(&done), Some(0), "{}", err(&done));
    assert_eq!(section(&page()), None, "no kd-tree, no table");
}

#[test]
fn what_fails_is_reported_and_the_rest_is_measured() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let done = bench(folder.path(), &["no-such-scene", "gen:icosphere:1", "--no-pictures"]);
    assert_eq!(status(&done), Some(1));
    assert!(err(&done).contains("no-such-scene"), "{}", err(&done));
    assert_eq!(records(folder.path()).len(), 2, "the other scene is there");
    let page = std::fs::read_to_string(folder.path().join("index.html")).expect("the report is there");
    assert!(page.contains("What went wrong") && page.contains("no-such-scene"));
}

#[test]
fn a_folder_that_cannot_be_written_is_refused_before_any_work() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("file");
    std::fs::write(&file, "in the way").expect("written");
    let start = std::time::Instant::now();
    // Loading and building this scene would take far longer.
    let done = bench(&file.join("below"), &["gen:icosphere:9"]);
    assert_eq!(status(&done), Some(1));
    assert!(err(&done).contains("below") && err(&done).contains("check the path"), "{}", err(&done));
    assert!(start.elapsed().as_secs() < 5);
}

#[test]
fn wrong_arguments_are_told_apart_from_failed_work() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for wrong in
        [&["-b", "lvbh"][..], &["-b", "lbvh-host:collapse=maybe"], &["--rays", "light"], &["--runs", "0"], &["--all"]]
    {
        let output = folder.path().to_str().expect("text");
        let done = hedgerow(&[&["bench", "gen:icosphere:1", "-o", output], wrong].concat());
        assert_eq!(status(&done), Some(2), "{wrong:?}: {}", err(&done));
    }
}

#[test]
fn a_folder_of_scenes_stands_for_the_files_in_it() {
    let scenes = tempfile::tempdir().expect("a temporary folder");
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    for name in ["b.obj", "a.obj"] {
        std::fs::write(scenes.path().join(name), triangle).expect("written");
    }
    std::fs::write(scenes.path().join("README.md"), "no scene").expect("written");
    let folder = tempfile::tempdir().expect("a temporary folder");
    let scenes = scenes.path().to_str().expect("text");
    for how in [&[scenes][..], &["--all", "--scenes-dir", scenes]] {
        let done = bench(folder.path(), &[how, &["--no-pictures"]].concat());
        assert_eq!(status(&done), Some(0), "{}", err(&done));
        let mut found: Vec<_> = records(folder.path()).into_iter().map(|r| r.scene).collect();
        found.dedup();
        assert_eq!(found, ["a", "b"], "{how:?}");
    }
}

#[test]
fn two_runs_of_the_same_program_compare_with_equal_costs() {
    let runs = [(); 2].map(|()| tempfile::tempdir().expect("a temporary folder"));
    for run in &runs {
        let done = bench(run.path(), &["gen:soup:2000:1", "--no-pictures"]);
        assert_eq!(status(&done), Some(0), "{}", err(&done));
    }
    let [old, new] = runs.each_ref().map(|run| run.path().to_str().expect("text"));
    let done = hedgerow(&["compare", old, new]);
    assert_eq!(status(&done), Some(0), "{}", err(&done));
    let table = out(&done);
    assert_eq!(table.matches(" 1.0000 ").count(), 2, "the same trees have the same SAH cost: {table}");
    assert!(table.contains("mean over 2"), "{table}");
    let done = hedgerow(&["compare", old, "/no/such/results.jsonl"]);
    assert_eq!(status(&done), Some(1));
    assert!(err(&done).contains("/no/such/results.jsonl"), "{}", err(&done));
}

#[test]
fn the_device_is_benched_like_the_host() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let output = folder.path().to_str().expect("text");
    let list = "lbvh,lbvh-host";
    let done = hedgerow(&["bench", "gen:icosphere:3", "-b", list, "--size", "24x16", "--runs", "1", "-o", output]);
    assert_eq!(status(&done), Some(0), "{}", err(&done));
    let [device, host] = &records(folder.path())[..] else { panic!("two builders") };
    assert_eq!((device.build.timer.as_str(), host.build.timer.as_str()), ("device", "wall"));
    assert!(!device.build.phases.is_empty() && device.subgroup >= 4 && host.subgroup == 0);
    let (ours, theirs) = (device.quality.sah.expect("told"), host.quality.sah.expect("told"));
    assert!((ours / theirs - 1.0).abs() < 1e-3, "the same tree: {ours} and {theirs}");
    for (ours, theirs) in device.trace.iter().zip(&host.trace) {
        assert_eq!((ours.hits, &ours.checksum), (theirs.hits, &theirs.checksum), "{} rays", ours.rays);
    }
}
