//! One rule for every pass: the shader, the file that records it and its plain form on the host have the same name, in the same order
//! of folders: `glsl/ROOM/PASS`, `src/ROOM/PASS`, `src/ROOM/twin/PASS`.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Passes whose plain form has another name, and why.
const WITHOUT_TWIN: [(&str, &str); 8] = [
    ("accel/build", "writes down what the host gives it"),
    ("accel/copy", "copies bytes"),
    ("accel/instances", "the twin of whole top levels begins with it: src/accel/twin/mod.rs"),
    ("accel/properties", "reads the header, as `bvh::layout::Header` does"),
    ("bvh/encode", "bvh::twin::lbvh begins with it"),
    ("bvh/lbvh_workgroup", "gives the bytes of bvh::twin::lbvh"),
    ("gpu/fill", "writes one word everywhere"),
    ("kdtree/across", "gives the bytes of kdtree::twin::builder"),
];

/// What twins share, or a part of one, and is the plain form of no pass of its own.
const SHARED_BY_TWINS: [&str; 14] = [
    "accel/parts",
    "accel/world_box",
    "bvh/build",
    "bvh/clusters",
    "bvh/costs",
    "bvh/far",
    "bvh/geometry",
    "bvh/over",
    "bvh/pairs",
    "kdtree/assemble",
    "kdtree/binned",
    "kdtree/clip",
    "kdtree/heuristic",
    "kdtree/small",
];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn files_below(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let paths = entries.map(|entry| entry.expect("the folder can be listed").path());
    paths.flat_map(|path| if path.is_dir() { files_below(&path) } else { vec![path] }).collect()
}

/// `ROOM/PASS` of every compute shader.
fn passes() -> BTreeSet<String> {
    let glsl = root().join("glsl");
    let shaders = files_below(&glsl).into_iter().filter(|path| path.extension().is_some_and(|e| e == "comp"));
    let pass = |path: PathBuf| {
        let below = path.strip_prefix(&glsl).expect("found there").with_extension("");
        below.iter().take(2).map(|part| part.to_string_lossy()).collect::<Vec<_>>().join("/")
    };
    shaders.map(pass).collect()
}

fn is_there(path: &str) -> bool {
    root().join(format!("{path}.rs")).exists() || root().join(path).join("mod.rs").exists()
}

#[test]
fn a_pass_is_recorded_by_the_file_of_its_name_and_has_a_twin_of_its_name() {
    let passes = passes();
    assert!(passes.len() > 20, "{passes:?}");
    for pass in passes {
        let (room, name) = pass.split_once('/').expect("rooms have folders");
        assert!(is_there(&format!("src/{pass}")), "glsl/{pass}: no src/{pass}.rs records it");
        let twin = is_there(&format!("src/{room}/twin/{name}"));
        let is_exception = WITHOUT_TWIN.iter().any(|(known, _)| *known == pass);
        assert!(
            twin != is_exception,
            "glsl/{pass}: write src/{room}/twin/{name}.rs, or say in this test why there is none"
        );
    }
}

#[test]
fn a_twin_has_the_name_of_a_pass() {
    let mut twins = 0;
    for room in ["gpu", "bvh", "kdtree", "accel", "trace"] {
        for path in files_below(&root().join("src").join(room).join("twin")) {
            let name = path.file_stem().expect("a file").to_string_lossy().into_owned();
            let pass = format!("{room}/{name}");
            let is_shared = name == "mod" || SHARED_BY_TWINS.contains(&pass.as_str());
            assert!(is_shared || passes().contains(&pass), "{}: glsl/{pass} is not there", path.display());
            twins += 1;
        }
    }
    assert!(twins > 20, "{twins} twins");
}
