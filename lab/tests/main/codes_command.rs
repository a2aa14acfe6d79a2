//! `hedgerow codes`: its records, tables and page, and what is refused.

use crate::program::{err, program};
use hedgerow_lab::experiments::codes::points::{AddedTime, CodesEntry, Swept};
use hedgerow_lab::report::lines;
use std::path::Path;
use std::process::Output;

const SCENE: &str = "gen:stadium:1";

fn hedgerow(arguments: &[&str], folder: &Path) -> Output {
    program(&[&["codes"], arguments].concat()).arg("-o").arg(folder).output().expect("the binary starts")
}

/// What a run printed, its records, and its page.
fn done(arguments: &[&str], folder: &Path) -> (String, Vec<CodesEntry>, String) {
    let done = hedgerow(arguments, folder);
    assert_eq!(done.status.code(), Some(0), "{arguments:?}: {}", err(&done));
    let page = std::fs::read_to_string(folder.join("codes.html")).expect("written");
    (String::from_utf8(done.stdout).expect("text"), lines::entries(folder).expect("records"), page)
}

fn swept(entries: &[CodesEntry]) -> Vec<&Swept> {
    let swept = entries.iter().map(|entry| if let CodesEntry::Sweep(swept) = entry { Some(swept) } else { None });
    swept.flatten().collect()
}

fn added(entries: &[CodesEntry]) -> Vec<&AddedTime> {
    let added = entries.iter().map(|entry| if let CodesEntry::AddedTime(added) = entry { Some(added) } else { None });
    added.flatten().collect()
}

#[test]
fn the_sweep_has_every_weight_of_the_thesis_beside_the_same_base() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let arguments = [
        "--experiments",
        "sweep",
        SCENE,
        "-b",
        "lbvh-host",
        "--rays",
        "primary,shadow",
        "--size",
        "12x8",
        "--runs",
        "3",
    ];
    let (printed, entries, page) = done(&arguments, folder.path());
    assert!(matches!(&entries[0], CodesEntry::Setting(setting) if setting.command.starts_with("hedgerow codes")));
    let points = swept(&entries);
    assert_eq!(points.len() + 1, entries.len(), "nothing else, and no failure: {entries:?}");
    let stretches: Vec<u32> = points.iter().map(|point| point.stretch).collect();
    assert_eq!(stretches, [1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048]);
    for point in &points {
        let codes = if point.stretch == 8 { "bin4a4".into() } else { format!("bin4a4~{}", point.stretch) };
        assert_eq!((&*point.scene, &*point.builder), (SCENE, &*format!("lbvh-host:codes={codes}")));
        assert_eq!(point.base, "lbvh-host:codes=emc64var-nosize");
        assert!(point.triangles > 500 && point.relative_sah.is_some_and(|sah| sah > 0.5 && sah < 2.0), "{point:?}");
        let kinds: Vec<&str> = point.rays.iter().map(|rays| rays.rays.as_str()).collect();
        assert_eq!(kinds, ["primary", "shadow"]);
        for rays in &point.rays {
            assert!(rays.count > 0 && rays.ms.median > 0.0 && rays.base_ms.median > 0.0, "{rays:?}");
            assert_eq!((rays.change_percent.runs, rays.ms.runs), (3, 3));
            assert!(rays.relative_work.is_some_and(|work| work > 0.5 && work < 2.0), "{rays:?}");
            assert!(rays.change_percent.min > -100.0, "no speed is below none: {rays:?}");
        }
        assert_eq!(point.rays[0].count, 96);
    }
    for text in ["1/2048", "(Cyberpunk)", "(Deathloop)", SCENE, "SAH"] {
        assert!(printed.contains(text), "{text}: {printed}");
    }
    assert!(printed.trim_end().ends_with("codes.html"), "{printed}");
    for text in
        ["SAH cost over λ", "Work of primary rays", "Speed of shadow rays", "Control (Riemersma 2024)", "1/2048"]
    {
        assert!(page.contains(text), "{text}");
    }
    assert!(!page.contains("id=\"added-time\""), "it was not measured");
    for ending in ["svg", "png"] {
        assert!(folder.path().join(format!("charts/codes-sweep-primary.{ending}")).is_file(), "{ending}");
    }
}

#[test]
fn added_time_has_a_point_for_every_code_and_the_thesis_beside_it() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let codes = "emc64var-extents,mip9,bin4a0,bin4a4,bin6a4";
    let (printed, entries, page) =
        done(&["--experiments", "added-time", "knot", "--codes", codes, "--runs", "2"], folder.path());
    let points = added(&entries);
    assert_eq!(points.len() + 1, entries.len(), "nothing else, and no failure: {entries:?}");
    assert_eq!(points.iter().map(|point| point.codes.as_str()).collect::<Vec<_>>().join(","), codes);
    for point in &points {
        assert_eq!(point.builder, format!("lbvh:codes={}", point.codes));
        assert_eq!(point.base, "lbvh:codes=emc64var-nosize");
        assert_eq!((point.added_percent.runs, point.base_ms.runs, point.build_ms.runs), (2, 2, 2));
        assert!(point.base_ms.min > 0.0 && point.build_ms.min > 0.0 && point.added_percent.min > -100.0, "{point:?}");
        // Of two runs the median is their mean, and so is that of the ratios.
        let [least, most] = [point.added_percent.min, point.added_percent.max];
        assert!((point.added_percent.median - 0.5 * (least + most)).abs() < 1e-6, "{point:?}");
    }
    // The mean over the thesis' scenes of its row.
    assert!(printed.contains("bin4a4") && printed.contains("(63)"), "{printed}");
    assert!(page.contains("id=\"added-time-table\"") && page.contains("<small>(63)</small>"), "{page}");
    assert!(folder.path().join("charts/codes-added-time.svg").is_file(), "two bits of counts at depth 4");
}

#[test]
fn pages_name_each_other() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let small = ["--experiments", "added-time", "gen:icosphere:1", "-b", "lbvh-host", "--codes", "mc30", "--runs", "1"];
    let (_, _, alone) = done(&small, folder.path());
    assert!(!alone.contains("growth.html"));
    let growth = ["stability", "growth", "gen:icosphere:1", "-b", "lbvh-host", "--steps", "1", "--no-rays"];
    let growth = program(&growth).arg("-o").arg(folder.path()).output().expect("the binary starts");
    assert_eq!(growth.status.code(), Some(0), "{}", err(&growth));
    let read = |name| std::fs::read_to_string(folder.path().join(name)).expect("written");
    assert!(read("codes.html").contains("href=\"growth.html\"") && read("growth.html").contains("href=\"codes.html\""));
}

#[test]
fn wrong_arguments_are_refused_before_any_work_and_a_missing_scene_is_a_failure() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (wrong, says) in [
        (&["-b", "lbvh:codes=mc30"][..], "leave codes= out"),
        (&["-b", "kd-gpu"], "no option \"codes\""),
        (&["--codes", "bin4a4~4096"], "N a power of two to 2048"),
        (&["--experiments", "growth"], "sweep, added-time"),
        (&["--runs", "0"], "--runs"),
    ] {
        let done = hedgerow(wrong, folder.path());
        assert_eq!(done.status.code(), Some(2), "{wrong:?}: {}", err(&done));
        assert!(err(&done).contains(says), "{wrong:?}: {}", err(&done));
    }
    assert!(!folder.path().join("codes.jsonl").exists(), "refused before any work");
    let done = hedgerow(
        &["no-such-scene", "gen:icosphere:1", "-b", "lbvh-host", "--codes", "mc30", "--runs", "1"],
        folder.path(),
    );
    assert_eq!(done.status.code(), Some(1), "{}", err(&done));
    let entries: Vec<CodesEntry> = lines::entries(folder.path()).expect("records");
    assert!(
        entries.iter().any(
            |entry| matches!(entry, CodesEntry::Failure(failure) if failure.to_string().contains("no-such-scene"))
        )
    );
    assert_eq!((swept(&entries).len(), added(&entries).len()), (12, 1), "the rest is measured");
}
