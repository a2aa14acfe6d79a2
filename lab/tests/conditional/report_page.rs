//! The page in a real browser: headless Chromium opens it from the disk. Skipped, with a message, where there is none.

use crate::browser::Browser;
use crate::conditional::needs;
use hedgerow_lab::experiments::bench::matrix::{OnScene, Outcome};
use hedgerow_lab::experiments::bench::page::{Picture, Report};
use hedgerow_lab::experiments::bench::{kd_trees, results};
use hedgerow_lab::experiments::choose::hindsight::Choice;
use hedgerow_lab::measure::record::{
    BuildRecord, MemoryRecord, PhaseRecord, QualityRecord, Record, SCHEMA, TraceRecord,
};
use hedgerow_lab::measure::setting::{Failure, Setting};
use std::path::{Path, PathBuf};

crate::conditional::tests! {
    the_page_holds_together_in_a_browser: needs::browser(),
    every_chart_is_an_svg_and_a_png_of_twice_its_size: needs::nothing(),
    the_csv_has_a_row_a_record_and_columns_for_every_kind_of_ray: needs::nothing(),
    records_are_read_back_as_they_were_written: needs::nothing(),
    a_line_that_is_no_record_is_named: needs::nothing(),
    a_sample_to_look_at: needs::variable("HEDGEROW_SAMPLE_REPORT"),
}

/// Builders with how fast they build and trace, in Mtri/s and Mrays/s, and their SAH cost on a scene where it is 100.
const BUILDERS: [(&str, &str, f64, f64, Option<f64>); 8] = [
    ("lbvh", "bvh2", 7.0, 2.6, Some(104.0)),
    ("lbvh:codes=mc30", "bvh2", 8.3, 2.4, Some(109.0)),
    ("lbvh:codes=emc64var", "bvh2", 5.2, 2.7, Some(103.0)),
    ("lbvh:collapse=off", "bvh2", 7.4, 2.1, Some(118.0)),
    ("driver-fast-build", "driver", 3.1, 1.7, None),
    ("driver-fast-trace", "driver", 1.1, 2.2, None),
    ("lbvh-host", "bvh2", 2.9, 1.2, Some(104.0)),
    ("kd-binned", "kdtree", 0.3, 1.5, Some(217.8)),
];
const SCENES: [(&str, u64); 3] = [("sponza", 66_450), ("san_francisco", 268_041), ("dragon", 871_414)];
const KINDS: [&str; 7] = ["primary", "shadow", "ao", "diffuse1", "diffuse2", "reflection", "random"];

/// A number in −1..1 that depends on both names alone.
fn jitter(a: &str, b: &str) -> f64 {
    let hash = a.bytes().chain(b.bytes()).fold(2_166_136_261_u32, |h, c| (h ^ u32::from(c)).wrapping_mul(16_777_619));
    f64::from(hash) / f64::from(u32::MAX) * 2.0 - 1.0
}

fn outcome(scene: &str, triangles: u64, builder: &(&str, &str, f64, f64, Option<f64>)) -> Outcome {
    let &(name, kind, mtris_s, mrays_s, sah) = builder;
    let wobble = 1.0 + 0.12 * jitter(scene, name);
    let median_ms = (triangles as f64).powf(1.04) / 66_450_f64.powf(0.04) / (mtris_s * wobble * 1e3);
    let host = name.ends_with("host") || kind == "kdtree";
    let shares: &[(&str, f64)] = match (kind, host) {
        ("bvh2", false) => &[("bounds", 0.07), ("encode", 0.16), ("sort", 0.43), ("hierarchy", 0.34)],
        ("driver", _) => &[("blas", 1.0), ("tlas", 0.02)],
        _ => &[],
    };
    let phases = shares.iter().map(|(p, share)| PhaseRecord { name: (*p).into(), median_ms: share * median_ms });
    let trace = KINDS.iter().map(|kind| TraceRecord {
        rays: (*kind).into(),
        count: if *kind == "ao" { 307_200 } else { 76_800 },
        hits: 61_000,
        mrays_s: mrays_s * wobble * (1.0 + 0.4 * jitter(kind, "")),
        steps: sah.map(|sah| 0.3 * sah),
        tests: sah.map(|sah| 0.1 * sah),
        runs: 5,
        checksum: "12345.678".into(),
    });
    let record = Record {
        schema: SCHEMA,
        scene: scene.into(),
        triangles,
        builder: name.into(),
        kind: kind.into(),
        device: "llvmpipe (LLVM 19.1.7, 256 bits)".into(),
        driver: "Mesa 26.1.6".into(),
        subgroup: 8,
        commit: "abc1234".into(),
        when: "2026-11-21T10:00:00Z".into(),
        build: BuildRecord {
            runs: 5,
            median_ms,
            min_ms: 0.96 * median_ms,
            max_ms: 1.09 * median_ms,
            timer: if host { "wall" } else { "device" }.into(),
            phases: phases.collect(),
            ..BuildRecord::default()
        },
        memory: MemoryRecord {
            structure_bytes: Some(112 * triangles),
            scratch_bytes: Some(28 * triangles),
            peak_bytes: None,
        },
        quality: QualityRecord {
            sah: sah.map(|sah| sah * (1.0 + 0.05 * jitter(name, scene))),
            c_t: 3.0,
            c_i: 2.0,
            inner: sah.map(|_| triangles),
            leaves: sah.map(|_| triangles + 1),
            empty_leaves: sah.map(|_| if kind == "kdtree" { triangles / 3 } else { 0 }),
            prims_per_leaf_max: sah.map(|_| 31),
            depth_max: sah.map(|_| 31),
            prims_per_leaf: sah.map(|_| 2.4),
            ..QualityRecord::default()
        },
        trace: trace.collect(),
        valid: Some(true),
    };
    let traffic = record.build.phases.iter().map(|p| (p.name != "tlas").then_some(44 * triangles)).collect();
    let choice = (name == "lbvh").then(|| "codes emc64var-nosize/32, chain".into());
    Outcome { record, choice, traffic, faults: Vec::new() }
}

fn report(folder: &Path) -> Report {
    let outcomes = SCENES.iter().flat_map(|(scene, n)| BUILDERS.iter().map(move |b| outcome(scene, *n, b))).collect();
    let mut pictures = Vec::new();
    std::fs::create_dir_all(folder.join("pictures")).expect("a folder of our own");
    for (scene, _) in SCENES {
        for (view, shade) in [("shaded", [190u8, 200, 210]), ("steps", [60, 30, 110])] {
            let file = format!("pictures/{scene}-{view}.png");
            let picture = image::RgbImage::from_fn(64, 36, |x, y| {
                image::Rgb(shade.map(|s| s.saturating_add((x as u8).wrapping_mul(2) / 2 + y as u8)))
            });
            picture.save(folder.join(&file)).expect("a folder of our own");
            let caption = format!("{view} <not markup> & more");
            pictures.push(Picture { scene: scene.into(), file, caption, alt: format!("{scene}, {view}") });
        }
    }
    let setting = Setting {
        options: vec![("Runs".into(), "5 after a warm-up".into()), ("Image".into(), "320x240".into())],
        notes: Vec::new(),
        ..crate::pages::setting("hedgerow bench -b all", "")
    };
    Report {
        setting,
        outcomes,
        failures: vec![Failure {
            at: OnScene { scene: "hair".into(), builder: Some("driver-fast-trace".into()) },
            what: "hair needs 3 GiB of device memory, 2 GiB are there".into(),
        }],
        baseline: Some("driver-fast-build".into()),
        pictures,
        choices: SCENES
            .iter()
            .map(|(scene, _)| Choice { scene: (*scene).into(), rays: 1e6, builder: "lbvh".into() })
            .collect(),
        published: kd_trees::published::papay(),
    }
}

/// Looks at the table of all figures as a reader does: sorts it either way, and filters it.
const LOOK: &str = r#"
  const rows = () => [...document.getElementById("results-table").tBodies[0].rows];
  const column = (index) => rows().map((row) => row.cells[index].dataset.value);
  const press = (index) => document.getElementById("results-table").tHead.rows[0].cells[index].querySelector("button").click();
  press(5);
  const falling = column(5).map(Number);
  press(5);
  const rising = column(5).map(Number);
  const filter = document.getElementById("filter");
  filter.value = "dragon lbvh";
  filter.dispatchEvent(new Event("input"));
  const shown = rows().filter((row) => !row.hidden).length;
  filter.value = "";
  filter.dispatchEvent(new Event("input"));
  return {
    images: all("img").length,
    broken: all("img").filter((image) => !image.complete || image.naturalWidth === 0).length,
    nameless: all("img").filter((image) => !image.alt).length,
    rows: rows().length,
    falls: falling.every((v, i) => i === 0 || falling[i - 1] >= v),
    rises: rising.every((v, i) => i === 0 || rising[i - 1] <= v),
    shown,
  };"#;

fn the_page_holds_together_in_a_browser() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let report = report(folder.path());
    report.write(folder.path()).expect("the report is written");
    let browser = Browser::find();
    let found = browser.look(&folder.path().join("index.html"), LOOK);

    assert_eq!(found["images"], 2 * SCENES.len());
    assert_eq!(found["broken"], 0, "{found}");
    assert_eq!(found["nameless"], 0, "{found}");
    let scenes = ["scene-sponza", "scene-san-francisco", "scene-dragon"];
    let sections =
        [&["failures", "summary"][..], &scenes, &["kd-trees", "choosing", "growth", "results", "method"]].concat();
    assert_eq!(found["sections"], serde_json::json!(sections));
    assert_eq!(found["rows"], report.outcomes.len());
    assert_eq!(found["charts"], 4 * SCENES.len() + 1);
    assert_eq!((&found["falls"], &found["rises"]), (&true.into(), &true.into()), "pressing a heading sorts");
    let lbvhs = BUILDERS.iter().filter(|b| b.0.contains("lbvh")).count();
    assert_eq!(found["shown"], lbvhs, "the filter shows the builders of that name on that scene");
}

fn every_chart_is_an_svg_and_a_png_of_twice_its_size() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    report(folder.path()).write(folder.path()).expect("the report is written");
    let files = |extension: &str| {
        let mut files: Vec<_> = std::fs::read_dir(folder.path().join("charts"))
            .expect("the report has charts")
            .map(|entry| entry.expect("readable").path())
            .filter(|path| path.extension().is_some_and(|e| e == extension))
            .collect();
        files.sort();
        files
    };
    let (svgs, pngs) = (files("svg"), files("png"));
    assert_eq!((svgs.len(), pngs.len()), (4 * SCENES.len() + 1, 4 * SCENES.len() + 1));
    for (svg, png) in svgs.iter().zip(&pngs) {
        assert_eq!(svg.file_stem(), png.file_stem());
        let picture = image::open(png).expect("a PNG").to_rgb8();
        assert_eq!(picture.dimensions(), (2 * 760, 2 * 460), "{}", png.display());
        // The title stands in the upper left corner: dark pixels on white, whether or not the system has fonts.
        let dark =
            (0..900).flat_map(|x| (30..70).map(move |y| (x, y))).filter(|&(x, y)| picture.get_pixel(x, y)[0] < 80);
        assert!(dark.count() > 500, "{} has no title", png.display());
    }
}

fn the_csv_has_a_row_a_record_and_columns_for_every_kind_of_ray() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let report = report(folder.path());
    report.write(folder.path()).expect("the report is written");
    let mut table = csv::Reader::from_path(folder.path().join("results.csv")).expect("written");
    let names = table.headers().expect("a heading").clone();
    for kind in KINDS {
        assert!(names.iter().any(|name| name == format!("{kind}_mrays_s")), "{names:?}");
    }
    let at = |name: &str| names.iter().position(|n| n == name).expect("a column");
    let rows: Vec<_> = table.records().map(|row| row.expect("well-formed")).collect();
    assert_eq!(rows.len(), report.outcomes.len());
    for (row, outcome) in rows.iter().zip(&report.outcomes) {
        let record = &outcome.record;
        assert_eq!(row[at("builder")], record.builder);
        assert_eq!(row[at("build_ms")].parse(), Ok(record.build.median_ms));
        let sah = record.quality.sah.map_or(String::new(), |sah| sah.to_string());
        assert_eq!(row[at("sah")], sah, "not measured is empty, not 0");
    }
}

fn records_are_read_back_as_they_were_written() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let report = report(folder.path());
    let mut file = results::create(folder.path()).expect("a folder of our own");
    for record in report.records() {
        file.append(record).expect("written");
        let so_far = results::read(folder.path()).expect("what was appended is there at once");
        assert_eq!(so_far.last(), Some(record));
    }
    let read = results::read(&folder.path().join("results.jsonl")).expect("written");
    assert_eq!(read.iter().collect::<Vec<_>>(), report.records());
}

fn a_line_that_is_no_record_is_named() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("results.jsonl");
    let good = serde_json::to_string(&outcome("sponza", 10, &BUILDERS[0]).record).expect("JSON");
    std::fs::write(&path, format!("{good}\n{{\"schema\":1}}\n")).expect("written");
    let error = results::read(&path).expect_err("the second line is no record").to_string();
    assert!(error.contains("results.jsonl:2: not a record"), "{error}");
    std::fs::write(&path, good.replace("\"schema\":1", "\"schema\":2")).expect("written");
    let error = results::read(&path).expect_err("another schema").to_string();
    assert!(error.contains("results.jsonl:1: schema 2, this program reads 1"), "{error}");
}

/// Writes the page of the made-up records where `HEDGEROW_SAMPLE_REPORT` says, to look at.
fn a_sample_to_look_at() {
    let folder = std::env::var_os("HEDGEROW_SAMPLE_REPORT").expect("it names a folder");
    let folder = PathBuf::from(folder);
    std::fs::create_dir_all(&folder).expect("the folder can be made");
    report(&folder).write(&folder).expect("the report is written");
}
