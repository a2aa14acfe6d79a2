//! The binary: exit status, what goes where, and the formats of ray and hit files.

use crate::conditional::{Needs, needs};
use crate::files::Folder;
use serde_json::Value;
use std::process::{Command, Output};

crate::conditional::tests! {
    devices_are_listed_and_one_is_marked: needs::nothing(),
    a_device_that_is_not_there_is_told_with_those_that_are: needs::nothing(),
    build_writes_the_record_and_nothing_else: needs::nothing(),
    build_prints_quality_and_writes_the_tree: needs::nothing(),
    the_device_builds_the_tree_and_traces_the_picture_of_the_host: needs::nothing(),
    the_validation_layers_are_silent: needs_layers(),
    trace_measures_the_kinds_that_are_asked_for: needs::nothing(),
    rays_and_hits_have_the_format_of_the_contract: needs::nothing(),
    the_same_seed_gives_the_same_rays_and_another_seed_others: needs::nothing(),
    render_writes_a_png_of_every_view: needs::nothing(),
    render_shows_a_dynamic_scene_at_a_time_or_in_a_frame: needs::nothing(),
    wrong_arguments_end_with_2_and_say_what_is_right: needs::nothing(),
    work_that_fails_ends_with_1_and_one_line: needs::nothing(),
    scenes_are_found_by_name_in_the_folder_that_is_given: needs::nothing(),
    a_device_a_driver_file_and_a_tuning_that_do_not_exist_are_named: needs::nothing(),
    a_variable_that_is_empty_is_as_one_that_is_not_set: needs::nothing(),
    a_reader_that_goes_away_is_no_error: needs::nothing(),
}

const DONE: i32 = 0;
const FAILED: i32 = 1;
const WRONG_ARGUMENTS: i32 = 2;

fn hedgerow(arguments: &[&str]) -> Output {
    // Options of the caller's shell shall not decide what is tested, only the device.
    Command::new(env!("CARGO_BIN_EXE_hedgerow"))
        .args(arguments)
        .env_remove("HEDGEROW_SCENES")
        .env_remove("RUST_LOG")
        .output()
        .expect("the binary starts")
}

/// Stdout of a command that must succeed.
fn done(arguments: &[&str]) -> String {
    let output = hedgerow(arguments);
    let (out, err) = texts(&output);
    assert_eq!(output.status.code(), Some(DONE), "{arguments:?}\n{out}\n{err}");
    out
}

/// The one line on stderr of a command that must fail.
fn fails(status: i32, arguments: &[&str]) -> String {
    let output = hedgerow(arguments);
    let (out, err) = texts(&output);
    assert_eq!(output.status.code(), Some(status), "{arguments:?}\n{out}\n{err}");
    assert_eq!(out, "", "{arguments:?} prints no result");
    if status == FAILED {
        assert_eq!(err.lines().count(), 1, "{arguments:?}: {err}");
        assert!(err.starts_with("hedgerow: "), "{err}");
    }
    err
}

fn texts(output: &Output) -> (String, String) {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (text(&output.stdout), text(&output.stderr))
}

fn floats(bytes: &[u8]) -> Vec<f32> {
    bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().expect("four bytes"))).collect()
}

fn devices_are_listed_and_one_is_marked() {
    let list: Value = serde_json::from_str(&done(&["devices", "--json"])).expect("JSON and nothing else");
    let devices = list.as_array().expect("a list");
    assert_eq!(devices.iter().filter(|d| d["picked"] == true).count(), 1);
    for device in devices {
        assert!(device["name"].is_string() && device["missing"].is_array(), "{device}");
        assert!(done(&["devices"]).contains(device["name"].as_str().expect("a name")));
    }
    let folder = Folder::new();
    let file = folder.path().join("devices.json").display().to_string();
    assert!(done(&["devices", "--json", &file]).contains("lacks"));
    let written: Value = serde_json::from_slice(&std::fs::read(file).expect("written")).expect("JSON");
    assert_eq!(written, list);
}

fn a_device_that_is_not_there_is_told_with_those_that_are() {
    for arguments in [&["devices", "--device", "nope"][..], &["--device", "nope", "devices"]] {
        let message = fails(FAILED, arguments);
        assert!(message.contains("unknown device \"nope\"; there are: 0: "), "{message}");
    }
}

fn build_writes_the_record_and_nothing_else() {
    let text =
        done(&["build", "gen:icosphere:3", "-b", "lbvh-host,lbvh-host:collapse=off", "--runs", "1", "--json", "-"]);
    let records: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).expect("one record a line")).collect();
    assert_eq!(records.len(), 2);
    for record in &records {
        assert_eq!(
            (&record["schema"], &record["triangles"], &record["valid"]),
            (&1.into(), &1280.into(), &true.into())
        );
        assert_eq!(record["scene"], "gen:icosphere:3");
        assert!(record["quality"]["sah"].as_f64().expect("measured") > 1.0);
        assert_eq!(record["trace"], Value::Array(vec![]));
    }
    assert_eq!(records[1]["builder"], "lbvh-host:collapse=off");
    assert_eq!(records[1]["quality"]["leaves"], 1280);
}

fn build_prints_quality_and_writes_the_tree() {
    let folder = Folder::new();
    let tree = folder.path().join("ico.tree").display().to_string();
    let text = done(&["build", "gen:icosphere:2", "-b", "lbvh-host", "--runs", "1", "-o", &tree]);
    for word in ["SAH cost (c_T 3, c_I 2)", "inner nodes", "structure", "valid"] {
        assert!(text.contains(word), "{word}: {text}");
    }
    let bytes = std::fs::read(&tree).expect("written");
    let tree = hedgerow::bvh::layout::Bvh2::<hedgerow::bvh::layout::Triangle>::from_bytes(&bytes).expect("a tree");
    assert_eq!(tree.header.primitive_count, 320);
    assert!(tree.validate().is_ok());
    let message = fails(WRONG_ARGUMENTS, &["build", "gen:grid:2", "-b", "lbvh-host,lbvh-host:collapse=off", "-o", "x"]);
    assert!(message.contains("-o takes the structure of one builder"), "{message}");
}

fn the_device_builds_the_tree_and_traces_the_picture_of_the_host() {
    let folder = Folder::new();
    let written = |builder: &str| {
        let path = |name: &str| folder.path().join(format!("{builder}{name}")).display().to_string();
        done(&["build", "gen:stadium:3", "-b", builder, "--runs", "1", "-o", &path(".tree")]);
        done(&["render", "gen:stadium:3", "-b", builder, "--size", "32x24", "-o", &path(".png")]);
        [".tree", ".png"].map(|name| std::fs::read(path(name)).expect("written"))
    };
    assert!(written("lbvh") == written("lbvh-host"), "the same bytes");
}

/// The Khronos validation layers.
fn needs_layers() -> Needs {
    let output = hedgerow(&["trace", "gen:icosphere:0", "-b", "lbvh", "--size", "1x1", "--runs", "1", "--validation"]);
    texts(&output).1.contains("validation layers are not installed").then(|| "no Vulkan validation layers".to_owned())
}

fn the_validation_layers_are_silent() {
    let output =
        hedgerow(&["trace", "gen:icosphere:3", "-b", "lbvh", "--size", "16x16", "--runs", "1", "--validation"]);
    let (out, err) = texts(&output);
    assert_eq!((output.status.code(), err.as_str()), (Some(DONE), ""), "{out}");
}

fn trace_measures_the_kinds_that_are_asked_for() {
    let arguments = ["trace", "gen:icosphere:3", "-b", "lbvh-host", "--size", "32x24", "--runs", "1"];
    let text = done(&[&arguments[..], &["--rays", "random,primary"]].concat());
    assert!(text.contains("Mrays/s") && text.contains("random") && !text.contains("diffuse1"), "{text}");
    let record: Value = serde_json::from_str(&done(&[&arguments[..], &["--rays", "primary", "--json", "-"]].concat()))
        .expect("a record");
    let trace = &record["trace"][0];
    assert_eq!((&trace["rays"], &trace["count"]), (&"primary".into(), &768.into()));
    let hits = trace["hits"].as_u64().expect("a count");
    assert!((100..768).contains(&hits), "the sphere fills a part of the picture: {hits}");
}

fn rays_and_hits_have_the_format_of_the_contract() {
    let folder = Folder::new();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (rays, hits) = (path("a.rays"), path("a.hits"));
    let camera = ["--eye", "0,0,-5", "--look", "0,0,0", "--fov", "40"];
    done(&[&["rays", "gen:icosphere:4", "--kind", "primary", "-o", &rays, "--size", "9x9"][..], &camera].concat());
    let bytes = std::fs::read(&rays).expect("written");
    assert_eq!(bytes.len(), 81 * 32);
    // The middle of an odd picture looks straight ahead: along +z, from the eye.
    let middle = floats(&bytes[40 * 32..][..32]);
    assert_eq!(middle[..4], [0.0, 0.0, -5.0, 0.0]);
    assert!((middle[6] - 1.0).abs() < 1e-6 && middle[7] > 10.0, "{middle:?}");

    let trace = ["trace", "gen:icosphere:4", "-b", "lbvh-host", "--rays-file", &rays, "--hits-file", &hits];
    let text = done(&trace);
    assert!(text.contains("81 rays"), "{text}");
    let bytes = std::fs::read(&hits).expect("written");
    assert_eq!(bytes.len(), 81 * 16);
    let hit = |i: usize| {
        (floats(&bytes[i * 16..][..16]), u32::from_le_bytes(bytes[i * 16 + 4..][..4].try_into().expect("four")))
    };
    let (corner, none) = hit(0);
    assert_eq!((corner[0], none), (f32::INFINITY, u32::MAX), "the corner misses the sphere");
    let (met, primitive) = hit(40);
    assert!((met[0] - 4.0).abs() < 0.01 && primitive < 5120, "the sphere's front is 4 away: {met:?}");
    assert!(met[2] >= 0.0 && met[3] >= 0.0 && met[2] + met[3] <= 1.0);

    done(&[&trace[..], &["--any-hit"]].concat());
    let bytes = std::fs::read(&hits).expect("written");
    assert_eq!(floats(&bytes[40 * 16..][..4]), [0.0]);
    assert_eq!(floats(&bytes[..4]), [f32::INFINITY]);

    std::fs::write(&rays, [0; 33]).expect("a file");
    assert!(fails(FAILED, &trace).contains("a.rays: 33 bytes"));
    std::fs::write(&rays, []).expect("a file");
    done(&trace);
    assert!(std::fs::read(&hits).expect("written").is_empty());
}

fn the_same_seed_gives_the_same_rays_and_another_seed_others() {
    let folder = Folder::new();
    let written = |seed: &str| {
        let path = folder.path().join(seed).display().to_string();
        done(&["rays", "gen:icosphere:2", "--kind", "random", "-o", &path, "--size", "8x8", "--seed", seed]);
        std::fs::read(path).expect("written")
    };
    let (first, second) = (written("1"), written("2"));
    assert_eq!(first, written("1"));
    assert_ne!(first, second);
}

fn render_writes_a_png_of_every_view() {
    let folder = Folder::new();
    for view in ["shaded", "normals", "steps", "tests", "depth", "leaf-size", "planes"] {
        let path = folder.path().join(format!("{view}.png")).display().to_string();
        done(&["render", "gen:stadium:2", "-b", "kd-exact", "-o", &path, "--view", view, "--size", "40x30"]);
        let image = image::open(&path).expect("a picture").to_rgb8();
        assert_eq!(image.width(), 40);
        assert!(image.pixels().any(|p| p != image.get_pixel(0, 0)), "{view} shows something");
    }
    let picture = |path: &str| fails(FAILED, &["render", "gen:grid:2", "-b", "lbvh-host", "--size", "4x4", "-o", path]);
    assert!(picture("/no/such/folder/a.png").contains("/no/such/folder/a.png"));
}

fn render_shows_a_dynamic_scene_at_a_time_or_in_a_frame() {
    let folder = Folder::new();
    let moving = "frames 4\nseconds 2\nobject ball gen:icosphere:2\nat 0 move 0 0 0\nat 2 move 4 0 0\n\
                  camera\nat 0 eye 2 0 9 look 2 0 0\n";
    let scene = folder.file("ball.dyn", moving);
    let picture = |options: &[&str]| {
        let path = folder.path().join("ball.png").display().to_string();
        done(&[&["render", &scene, "-b", "lbvh-host", "-o", &path, "--size", "40x30"], options].concat());
        std::fs::read(path).expect("written")
    };
    let first = picture(&[]);
    assert_eq!(first, picture(&["--time", "0"]));
    assert_eq!(first, picture(&["--time", "-4"]));
    assert_eq!(picture(&["--frame", "2"]), picture(&["--time", "1"]));
    assert_ne!(first, picture(&["--frame", "2"]));
    let refused = |status, options: &[&str]| {
        fails(status, &[&["render", &scene, "-b", "lbvh-host", "-o", "a.png"], options].concat())
    };
    assert!(refused(WRONG_ARGUMENTS, &["--frame", "4"]).contains("--frame 4: ball has 4, counted from 0"));
    assert!(refused(WRONG_ARGUMENTS, &["--time", "inf"]).contains("is not a time"));
    refused(WRONG_ARGUMENTS, &["--time", "1", "--frame", "1"]);
    let still = fails(FAILED, &["render", "gen:grid:2", "-b", "lbvh-host", "-o", "a.png", "--frame", "0"]);
    assert!(still.contains("gen:grid:2: nothing in it moves"), "{still}");
}

fn wrong_arguments_end_with_2_and_say_what_is_right() {
    for (arguments, says) in [
        (&["build", "gen:grid:2"][..], "--builder"),
        (&["build", "gen:grid:2", "-b", "lvbh"], "unknown builder \"lvbh\"; use one of"),
        (&["build", "gen:grid:2", "-b", "lbvh-host:radius=2"], "has no option \"radius\""),
        (&["build", "gen:cube:2", "-b", "lbvh-host"], "unknown generator; use one of gen:icosphere:N"),
        (&["build", "gen:grid:2", "-b", "lbvh-host", "--runs", "0"], "--runs"),
        (&["build", "gen:grid:2", "-b", "lbvh-host", "--costs", "3"], "write C_T,C_I"),
        (
            &["trace", "gen:grid:2", "-b", "lbvh-host", "--rays", "light"],
            "unknown kind of ray \"light\"; use one of primary",
        ),
        (&["trace", "gen:grid:2", "-b", "lbvh-host", "--size", "640"], "write WxH"),
        (&["trace", "gen:grid:2", "-b", "lbvh-host", "--rays-file", "x"], "--hits-file"),
        (&["trace", "gen:grid:2", "-b", "lbvh-host", "--any-hit"], "--rays-file"),
        (&["rays", "gen:grid:2", "--kind", "primary"], "--output"),
        (&["render", "gen:grid:2", "-b", "lbvh-host", "-o", "a.jpg"], "a.jpg: pictures are PNG files"),
        (&["render", "gen:grid:2", "-b", "lbvh-host", "-o", "a.png", "--view", "colour"], "use one of shaded, normals"),
        (
            &["render", "gen:grid:2", "-b", "lbvh-host", "-o", "a.png", "--view", "planes"],
            "lbvh-host builds no kd-tree, so there are no planes to see; choose kd-exact or kd-binned",
        ),
        (&["render", "gen:grid:2", "-b", "lbvh-host", "-o", "a.png", "--eye", "1,2"], "write three numbers"),
        (&["render", "gen:grid:2", "-b", "lbvh-host", "-o", "a.png", "--fov", "180"], "between 0 and 180"),
        (&["devices", "--threads", "0"], "--threads"),
        (&["plant"], "plant"),
    ] {
        let message = fails(WRONG_ARGUMENTS, arguments);
        assert!(message.contains(says), "{arguments:?}: {message}");
    }
}

fn work_that_fails_ends_with_1_and_one_line() {
    let folder = Folder::new();
    let broken = folder.file("broken.obj", "v 0 0 0\nf 1 2 3\n");
    let build = |scene: &str| fails(FAILED, &["build", scene, "-b", "lbvh-host"]);
    assert!(build(&broken).contains("broken.obj:2: face names vertex 2, the file has 1"));
    assert!(build("no_such_scene").contains("--scenes-dir"));
    assert!(build("gen:grid:0").contains("no triangles"));
    let tree = ["build", "gen:grid:2", "-b", "lbvh-host", "-o", "/no/such/folder/tree"];
    assert!(fails(FAILED, &tree).contains("/no/such/folder/tree"));
    let rays = ["rays", "gen:grid:2", "--kind", "random", "-o", "/no/such/folder/rays"];
    assert!(fails(FAILED, &rays).contains("/no/such/folder/rays"));
    let json = ["build", "gen:grid:2", "-b", "lbvh-host", "--json", "/no/such/folder/json"];
    assert!(fails(FAILED, &json).contains("/no/such/folder/json"));
}

fn scenes_are_found_by_name_in_the_folder_that_is_given() {
    let folder = Folder::new();
    folder.file("corner.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let here = folder.path().display().to_string();
    let text = done(&["build", "corner", "-b", "lbvh-host", "--runs", "1", "--json", "-", "--scenes-dir", &here]);
    let record: Value = serde_json::from_str(&text).expect("a record");
    assert_eq!((&record["scene"], &record["triangles"]), (&"corner".into(), &1.into()));
}

fn a_device_a_driver_file_and_a_tuning_that_do_not_exist_are_named() {
    for (variable, value, message) in [
        ("HEDGEROW_DEVICE", "nonsense", "unknown device \"nonsense\"; there are: 0: "),
        ("HEDGEROW_TUNING", "nonsense", "unknown tuning \"nonsense\"; use one of auto, cpu, gpu"),
        ("VK_DRIVER_FILES", "/nonexistent/icd.json", "VK_DRIVER_FILES names /nonexistent/icd.json, which is not there"),
    ] {
        let output = Command::new(env!("CARGO_BIN_EXE_hedgerow"))
            .args(["devices"])
            .env_remove("VK_ICD_FILENAMES")
            .env(variable, value)
            .output()
            .expect("the binary starts");
        let (_, err) = texts(&output);
        assert!(!output.status.success() && err.contains(message), "{variable}={value}: {err}");
    }
}

fn a_variable_that_is_empty_is_as_one_that_is_not_set() {
    let output = Command::new(env!("CARGO_BIN_EXE_hedgerow"))
        .args(["build", "there_is_none", "-b", "lbvh-host"])
        .envs(["HEDGEROW_SCENES", "HEDGEROW_DEVICE", "HEDGEROW_PUBLISHED"].map(|name| (name, "")))
        .output()
        .expect("the binary starts");
    let (_, err) = texts(&output);
    assert_eq!(err, fails(FAILED, &["build", "there_is_none", "-b", "lbvh-host"]));
}

fn a_reader_that_goes_away_is_no_error() {
    use std::process::Stdio;
    let mut child = Command::new(env!("CARGO_BIN_EXE_hedgerow"))
        .args(["build", "gen:grid:2", "-b", "lbvh-host", "--runs", "1"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the binary starts");
    drop(child.stdout.take());
    let output = child.wait_with_output().expect("it ends");
    assert_eq!((output.status.code(), texts(&output).1.as_str()), (Some(DONE), ""));
}
