//! `hedgerow choose` and the builder `auto`, by a table of costs that a test lays into the cache.

use crate::common::device;
use hedgerow_lab::experiments::choose::{Cost, CostRow, CostTable, SceneClass, cache};
use serde_json::Value;
use std::path::Path;
use std::process::Command;

/// A folder with a table: on plain scenes, one candidate that builds fast and one that traces fast; on crowded ones a third.
fn kept() -> tempfile::TempDir {
    let row = |triangles, is_crowded, costs: &[(&str, f64, f64)]| CostRow {
        class: SceneClass { triangles, is_crowded },
        costs: costs
            .iter()
            .map(|&(builder, build_ms, ray_ns)| Cost { builder: builder.into(), build_ms, ray_ns })
            .collect(),
    };
    let plain = [("lbvh", 1.0, 1000.0), ("lbvh:width=8q", 9.0, 200.0)];
    let crowded = [("lbvh:codes=emc64var+robust", 2.0, 1000.0)];
    let table = CostTable { rows: vec![row(1000, false, &plain), row(1000, true, &crowded)] };
    let folder = tempfile::tempdir().expect("a temporary folder");
    cache::keep(folder.path(), device(), &table).expect("the folder can be written");
    folder
}

/// Stdout of a command that must succeed, with the cache in `folder`.
fn done(folder: &Path, arguments: &[&str]) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_hedgerow"));
    command.args(arguments).env("HEDGEROW_CACHE", folder).env_remove("HEDGEROW_SCENES");
    let output = command.output().expect("the binary starts");
    let [out, err] = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    assert!(output.status.success(), "{arguments:?}\n{out}\n{err}");
    out
}

/// The words of the line that the arrow marks.
fn chosen(out: &str) -> Vec<&str> {
    let line = out.lines().find(|line| line.contains('→')).expect("one is marked");
    line.split_whitespace().skip(1).collect()
}

#[test]
fn the_table_names_builders_from_so_many_rays_on() {
    let folder = kept();
    let out = done(folder.path(), &["choose", "-q"]);
    let words: Vec<Vec<&str>> = out.lines().map(|line| line.split_whitespace().collect()).collect();
    // 8 ms of building over 800 ns of a ray: the two meet at 10,000 rays.
    let expected: [&[&str]; 3] = [
        &["1", "000", "triangles", "0", "lbvh", "1.00", "ms", "1000", "ns"],
        &["10", "k", "lbvh:width=8q", "9.00", "ms", "200", "ns"],
        &["1", "000", "triangles,", "crowded", "0", "lbvh:codes=emc64var+robust", "2.00", "ms", "1000", "ns"],
    ];
    for line in expected {
        assert!(words.iter().any(|words| words == line), "{line:?}\n{out}");
    }
}

#[test]
fn a_scene_has_the_costs_of_its_size_and_the_least_total_is_marked() {
    let folder = kept();
    // 3,200 triangles: a build takes 3.2 times as long as in the table's last row, a ray as long.
    let few = done(folder.path(), &["choose", "-q", "gen:grid:40", "--rays-per-build", "1e4"]);
    assert_eq!(chosen(&few)[0], "lbvh", "{few}");
    let words: Vec<&str> = few.split_whitespace().collect();
    assert!(words.join(" ").contains("3 200 triangles, 10 k rays a build"), "{few}");
    let many = done(folder.path(), &["choose", "-q", "gen:grid:40", "--rays-per-build", "1e6"]);
    assert_eq!(chosen(&many), ["lbvh:width=8q", "28.8", "ms", "200", "ns", "229", "ms"], "{many}");
}

#[test]
fn auto_builds_what_was_chosen() {
    let folder = kept();
    let kind = |builder: &str| {
        let out = done(folder.path(), &["build", "gen:icosphere:3", "-b", builder, "-q", "--json", "-"]);
        let record: Value = serde_json::from_str(&out).expect("JSON and nothing else");
        assert_eq!(record["builder"], builder);
        record["kind"].as_str().expect("a layout").to_owned()
    };
    assert_eq!(kind("auto:rays=100"), "bvh2");
    assert_eq!(kind("auto:rays=1000000"), "wide8q");
}

#[test]
fn choices_are_held_against_what_was_measured() {
    let folder = kept();
    let json = folder.path().join("costs.jsonl");
    let file = json.to_str().expect("a temporary folder's name is text");
    let out = done(
        folder.path(),
        &["choose", "-q", "gen:icosphere:2", "--hindsight", "--size", "8x6", "--runs", "1", "--json", file],
    );
    assert!(out.contains("of 6 choices") && out.contains("lbvh:width=8q always: "), "{out}");
    let records = std::fs::read_to_string(&json).expect("it was written");
    for record in records.lines().map(|line| serde_json::from_str::<Value>(line).expect("a record a line")) {
        assert_eq!(record["scene"], "gen:icosphere:2");
        assert!(record["build_ms"].as_f64() > Some(0.0) && record["ray_ns"].as_f64() > Some(0.0), "{record}");
    }
    assert!(records.lines().count() >= 2, "{records}");
}
