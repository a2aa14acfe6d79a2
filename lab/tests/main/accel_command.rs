//! `hedgerow accel`: the records and the page that it leaves, how `hedgerow bench` finds them, and what is refused.

use crate::program::{err, hedgerow, text};
use hedgerow_lab::experiments::accel::page;
use hedgerow_lab::experiments::accel::points::{AccelEntry, Implementation, Submission};
use std::path::Path;
use std::process::Output;

/// Every experiment, as small as it goes: seconds.
fn tiny(folder: &Path, more: &[&str]) -> Output {
    let output = text(folder);
    let arguments =
        ["accel", "--runs", "2", "--size", "16x12", "--structures", "32", "--instances", "200", "-o", output];
    hedgerow(&[&arguments, more].concat())
}

#[test]
fn a_run_leaves_records_of_every_experiment_and_a_page_of_them() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let done = tiny(folder.path(), &["gen:forest:9", "gen:twist:400:5", "--frames", "3"]);
    assert_eq!(done.status.code(), Some(0), "{}", err(&done));
    let page = folder.path().join("accel.html");
    assert_eq!(String::from_utf8_lossy(&done.stdout).trim(), page.display().to_string());
    let entries = page::read(folder.path()).expect("records");
    assert!(matches!(&entries[0], AccelEntry::Setting(setting) if setting.command.starts_with("hedgerow accel")));
    let is_ours = |maker: Implementation| maker == Implementation::Ours;
    let (mut batches, mut top_levels, mut frames, mut rebraids, mut any_hits) =
        (Vec::new(), Vec::new(), Vec::new(), 0, 0);
    for entry in &entries {
        match entry {
            AccelEntry::Batch(point) if point.maker.is_none_or(is_ours) => batches.push((point.structures, point.way)),
            AccelEntry::Tlas(point) if is_ours(point.maker) => top_levels.push(point.instances),
            AccelEntry::Rebraid(point) => {
                rebraids += 1;
                assert_eq!((point.scene.as_str(), point.instances, point.parts), ("gen:forest:9", 9, 3));
                assert_eq!((point.off.entries, point.on.entries.is_some_and(|n| n > 9)), (Some(9), true), "{point:?}");
                assert!(point.rays.iter().all(|rays| rays.different == 0 && rays.gain.runs == 2), "{point:?}");
                assert!(point.overlaps > 1.0 && point.rays[0].off_work.instances > 0.0, "{point:?}");
            }
            AccelEntry::AnyHit(point) => {
                any_hits += 1;
                assert_eq!((point.scene.as_str(), point.instances), ("gen:forest:9", 9));
                let kinds: Vec<&str> = point.rays.iter().map(|rays| rays.rays.as_str()).collect();
                assert_eq!(kinds, ["shadow", "ao"]);
                assert!(point.rays.iter().all(|rays| rays.different == 0 && rays.gain.runs == 2), "{point:?}");
                assert!(point.rays.iter().any(|rays| rays.on_work != rays.off_work), "nothing was in order: {point:?}");
            }
            AccelEntry::Update(point) if is_ours(point.maker) => {
                assert!(point.built_sah.is_some_and(|sah| sah > 1.0), "{point:?}");
                // Together or not at all.
                assert_eq!(point.growth.is_some(), point.update_ms.is_some(), "{point:?}");
                assert_eq!(point.growth.is_some(), point.rays[0].slowdown.is_some(), "{point:?}");
                frames.push(point.frame);
            }
            AccelEntry::Failure(failure) => panic!("{failure:?}"),
            _ => {}
        }
    }
    let ways = [
        Submission::OneCall,
        Submission::OneTable,
        Submission::OneSubmit,
        Submission::SubmitEach,
        Submission::EmptySubmits,
    ];
    assert_eq!(batches, [2, 32].map(|count| ways.map(|way| (count, way))).concat());
    assert_eq!((top_levels, frames, rebraids, any_hits), (vec![100, 200], vec![0, 2, 4], 1, 1));

    let page = std::fs::read_to_string(page).expect("written");
    for id in ["batches-fast-build", "tlas", "rebraid", "any-hit", "updates", "method"] {
        assert!(page.contains(&format!("<section id=\"{id}\">")), "{id}");
    }
    let of_forest = ["accel-rebraid-gen-forest-9", "accel-any-hit-gen-forest-9"];
    for chart in ["accel-batch-fast-build", "accel-tlas", "accel-update-gen-twist-400-5"].into_iter().chain(of_forest) {
        for ending in ["svg", "png"] {
            assert!(folder.path().join(format!("charts/{chart}.{ending}")).is_file(), "{chart}.{ending}");
        }
    }
    assert!(!page.contains("index.html"), "there is no page of `hedgerow bench`");

    // A benchmark into the same folder finds it, and the pages name each other.
    let output = folder.path().to_str().expect("text");
    let bench =
        ["bench", "gen:icosphere:1", "-b", "lbvh-host", "--runs", "1", "--size", "8x8", "--no-pictures", "-o", output];
    let done = hedgerow(&bench);
    assert_eq!(done.status.code(), Some(0), "{}", err(&done));
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).expect("written");
    assert!(read("index.html").contains("href=\"accel.html\""));
    assert!(read("accel.html").contains("href=\"index.html\""));
}

#[test]
fn one_experiment_is_measured_alone() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let done = tiny(folder.path(), &["--experiments", "tlas"]);
    assert_eq!(done.status.code(), Some(0), "{}", err(&done));
    let entries = page::read(folder.path()).expect("records");
    assert!(entries[1..].iter().all(|entry| matches!(entry, AccelEntry::Tlas(_))) && entries.len() > 2, "{entries:?}");
}

#[test]
fn memory_is_measured_in_both_forms_of_nodes() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let done = tiny(folder.path(), &["gen:icosphere:5", "--experiments", "memory"]);
    assert_eq!(done.status.code(), Some(0), "{}", err(&done));
    let entries = page::read(folder.path()).expect("records");
    let points: Vec<_> =
        entries.iter().filter_map(|e| if let AccelEntry::Memory(p) = e { Some(p) } else { None }).collect();
    let ours: Vec<_> = points.iter().filter(|point| point.maker == Implementation::Ours).collect();
    let of_eight: Vec<_> = ours.iter().filter(|point| point.of_eight).collect();
    assert_eq!((ours.len(), of_eight.len(), ours[0].triangles), (5, 3, 20_480));
    // Nearly all triangles of a closed mesh find a partner: 56 bytes for two, and the nodes.
    assert!(of_eight.iter().all(|p| p.compacted().is_some_and(|bytes| (28.0..40.0).contains(&bytes))), "{points:?}");
    assert!(of_eight.iter().all(|point| point.with_scratch() <= 180.0), "{points:?}");
    let page = std::fs::read_to_string(folder.path().join("accel.html")).expect("written");
    assert!(page.contains("<section id=\"memory\">") && page.contains("1 have at most 40 bytes a triangle compacted"));
}

#[test]
fn nodes_of_eight_are_measured_and_a_mesh_is_one_instance() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let done =
        tiny(folder.path(), &["gen:forest:9", "gen:icosphere:3", "--experiments", "rebraid", "--wide", "always"]);
    assert_eq!(done.status.code(), Some(0), "{}", err(&done));
    let entries = page::read(folder.path()).expect("records");
    let points: Vec<_> =
        entries.iter().filter_map(|e| if let AccelEntry::Rebraid(p) = e { Some(p) } else { None }).collect();
    let [forest, sphere] = points[..] else { panic!("{entries:?}") };
    assert_eq!((forest.instances, sphere.instances, sphere.parts), (9, 1, 1));
    for point in [forest, sphere] {
        assert!(point.rays.iter().all(|rays| rays.different == 0) && point.rays[0].hits > 0, "{point:?}");
        // Nine instances fit into two nodes of eight; nodes of two are eight.
        assert!(point.rays.iter().all(|rays| rays.off_work.top_nodes <= 2.0), "{point:?}");
    }
    assert!(
        sphere.rays.iter().all(|rays| rays.off_work == rays.on_work && rays.off_work.instances <= 1.0),
        "{sphere:?}"
    );
}

#[test]
fn wrong_arguments_are_told_apart_from_failed_work() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (wrong, says) in [
        (
            &["--experiments", "hedge"][..],
            "unknown experiment \"hedge\"; use one of batch, tlas, rebraid, any-hit, update",
        ),
        (&["--rays", "light"], "unknown kind of ray \"light\""),
        (&["--runs", "0"], "--runs"),
        (&["--structures", "0"], "--structures"),
        (&["--size", "640"], "write WxH"),
        (&["gen:forest:x"], "not the arguments of this generator"),
    ] {
        let output = folder.path().to_str().expect("text");
        let done = hedgerow(&[&["accel", "-o", output], wrong].concat());
        assert_eq!(done.status.code(), Some(2), "{wrong:?}: {}", err(&done));
        assert!(err(&done).contains(says), "{wrong:?}: {}", err(&done));
    }
    assert_eq!(hedgerow(&["accel"]).status.code(), Some(2), "-o is missing");
    let done = tiny(folder.path(), &["no-such-scene"]);
    assert_eq!(done.status.code(), Some(1));
    assert!(err(&done).contains("no-such-scene"), "{}", err(&done));
    let file = folder.path().join("file");
    std::fs::write(&file, "in the way").expect("written");
    let done = tiny(&file.join("below"), &["--experiments", "tlas"]);
    assert_eq!(done.status.code(), Some(1));
    assert!(err(&done).contains("below") && err(&done).contains("check the path"), "{}", err(&done));
}
