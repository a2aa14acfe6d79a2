//! `hedgerow animate`: the records, pictures and page that it leaves, that all ways find the same, and what is refused.

use crate::program::{err, hedgerow, text};
use hedgerow_lab::experiments::animate::AnimationMethod;
use hedgerow_lab::experiments::animate::page;
use hedgerow_lab::experiments::animate::points::{AnimateEntry, Animated, SceneSetting};
use std::path::Path;
use std::process::Output;

/// A ball that hops through clutter, and a mesh that changes its shape where it turns.
const SCENE: &str = "
frames 6
seconds 2
static gen:clutter:60:1
object ball gen:icosphere:2
  at 0  move -0.5 0.1 0  scale 0.2
  at 1  move  0   0.5 0
  at 2  move  0.5 0.1 0
object twist gen:twist:300:4
  cycle 1
  at 0  move 0.2 0.3 0  turn 0 1 0 0  scale 0.2
  at 2  turn 0 1 0 360
camera
  at 0  eye 2 1.5 2  look 0 0.2 0
";

/// Two runs a frame of a few rays: seconds.
fn tiny(scene: &str, folder: &Path, more: &[&str]) -> Output {
    let arguments = ["animate", scene, "--runs", "2", "--size", "24x18", "-o", text(folder)];
    hedgerow(&[&arguments, more].concat())
}

fn scene_in(folder: &Path, content: &str) -> String {
    let path = folder.join("hop.dyn");
    std::fs::write(&path, content).expect("written");
    text(&path).to_owned()
}

/// The setting and the frames; there are no failures.
fn measured(folder: &Path) -> (SceneSetting, Vec<Animated>) {
    let mut entries = page::read(folder).expect("records").into_iter();
    let Some(AnimateEntry::Setting(setting)) = entries.next() else { panic!("the first line is the setting") };
    let frame = |entry| match entry {
        AnimateEntry::Animate(frame) => frame,
        other => panic!("{other:?}"),
    };
    (setting, entries.map(frame).collect())
}

#[test]
fn every_way_finds_the_same_in_every_frame_and_leaves_records_pictures_and_a_page() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (scene, out) = (scene_in(folder.path(), SCENE), folder.path().join("out"));
    let done = tiny(&scene, &out, &["--frames", "3", "--rays", "primary,shadow,diffuse1,random"]);
    assert_eq!(done.status.code(), Some(0), "{}", err(&done));
    let page = out.join("animate.html");
    let stdout = String::from_utf8_lossy(&done.stdout).into_owned();
    assert_eq!(stdout.lines().last(), Some(text(&page)), "{stdout}");
    assert!(AnimationMethod::ALL.iter().all(|way| stdout.contains(way.name())), "{stdout}");

    let (setting, frames) = measured(&out);
    assert_eq!((setting.scene.as_str(), setting.objects.len(), setting.pictures.len()), ("hop", 2, 3));
    assert_eq!(setting.objects.iter().map(|object| object.morphs).collect::<Vec<_>>(), [false, true]);
    let order: Vec<(u32, AnimationMethod)> = frames.iter().map(|frame| (frame.frame, frame.way)).collect();
    assert_eq!(order, [0, 2, 4].map(|frame| AnimationMethod::ALL.map(|way| (frame, way))).concat());
    for frame in &frames {
        let kinds: Vec<&str> = frame.trace.iter().map(|rays| rays.rays.as_str()).collect();
        assert_eq!(kinds, ["primary", "shadow", "diffuse1", "random"]);
        assert!(frame.build_ms.median > 0.0 && frame.build_ms.runs == 2, "{frame:?}");
        assert_eq!(frame.dynamic_triangles, setting.objects.iter().map(|object| object.triangles).sum::<u64>());
        assert!(frame.trace.iter().all(|rays| rays.different == 0 && rays.count > 0 && rays.steps > Some(0.0)));
        assert_eq!(
            frame.sah.is_some(),
            matches!(frame.way, AnimationMethod::Rebuild | AnimationMethod::Merge),
            "{frame:?}"
        );
        assert!(frame.memory.structure_bytes > Some(0), "{frame:?}");
        let kd_gpu = ["kd-gpu", "accel"].contains(&frame.builder.as_str());
        assert!(kd_gpu && frame.timer == "device", "{frame:?}");
        // Bit for bit: so is the sum.
        let first = frames.iter().find(|other| other.frame == frame.frame).expect("itself");
        if frame.way != AnimationMethod::TwoLevel {
            for (a, b) in frame.trace.iter().zip(&first.trace) {
                assert_eq!((&a.checksum, a.hits), (&b.checksum, b.hits), "{}", frame.way);
            }
        }
    }
    let moved = |frame: u32| frames.iter().find(|f| f.frame == frame).map(|f| f.trace[0].checksum.clone());
    assert_ne!(moved(0), moved(2), "something moves");
    for file in ["frame-0000.png", "frame-0002.png", "frame-0004.png"] {
        let picture = image::open(out.join(file)).expect("a picture");
        assert_eq!((picture.width(), picture.height()), (24, 18));
    }
    let page = std::fs::read_to_string(page).expect("written");
    assert!(page.contains("frame-0002.png"));
    for chart in ["animate-frame", "animate-frames", "animate-builds"] {
        assert!(out.join(format!("charts/{chart}.svg")).is_file(), "{chart}");
    }
}

#[test]
fn the_host_builds_merges_and_traces_the_same_without_a_device() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (scene, out) = (scene_in(folder.path(), SCENE), folder.path().join("out"));
    let ways = ["--ways", "merge,rebuild,two-trees,tree-per-object", "-b", "kd-binned:bins=16"];
    let done = tiny(&scene, &out, &[&ways[..], &["--frames", "1..4", "--png", "off"]].concat());
    assert_eq!(done.status.code(), Some(0), "{}", err(&done));
    let (setting, frames) = measured(&out);
    assert!(setting.setting.device.is_none() && setting.pictures.is_empty());
    assert!(!out.join("frame-0001.png").exists());
    assert_eq!(frames.len(), 3 * 4);
    assert!(frames.iter().all(|f| f.timer == "wall" && f.builder == "kd-binned:bins=16" && f.trace.len() == 3));
    assert!(frames.iter().flat_map(|frame| &frame.trace).all(|rays| rays.different == 0));
}

#[test]
fn trees_of_the_host_are_traced_on_the_device_where_that_is_asked_for() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (scene, out) = (scene_in(folder.path(), SCENE), folder.path().join("out"));
    let done = tiny(&scene, &out, &["-b", "kd-binned:trace=device", "--frames", "1", "--png", "off"]);
    assert_eq!(done.status.code(), Some(0), "{}", err(&done));
    let (setting, frames) = measured(&out);
    assert!(setting.setting.device.is_some());
    assert_eq!(frames.iter().map(|frame| frame.way).collect::<Vec<_>>(), AnimationMethod::ALL);
}

#[test]
fn an_animation_of_which_nothing_stands_still_is_measured_but_for_merging() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let done = tiny("gen:twist:400:5", folder.path(), &["--frames", "2", "--png", "off"]);
    assert_eq!(done.status.code(), Some(1), "{}", err(&done));
    assert!(err(&done).contains("merge: gen:twist:400:5: nothing in it stands still"), "{}", err(&done));
    let entries = page::read(folder.path()).expect("records");
    let frames =
        entries.iter().filter(|entry| matches!(entry, AnimateEntry::Animate(frame) if frame.trace[0].different == 0));
    assert_eq!(frames.count(), 2 * 4);
    let page = std::fs::read_to_string(folder.path().join("animate.html")).expect("written");
    assert!(page.contains("id=\"failures\""));
}

#[test]
fn what_cannot_be_animated_is_refused_with_the_remedy() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let scene = scene_in(folder.path(), SCENE);
    for (wrong, status, says) in [
        (&["gen:icosphere:1"][..], 1, "nothing in it moves; take a .dyn or .anim file"),
        (&[&scene, "--ways", "rebuild,fly"], 2, "unknown way \"fly\"; use one of rebuild, two-trees"),
        (&[&scene, "--ways", "merge,merge"], 2, "--ways names merge twice"),
        (&[&scene, "--frames", "4..9"], 2, "--frames 4..9: hop has 6, counted from 0"),
        (&[&scene, "--frames", "9..4"], 2, "\"9..4\" are no frames"),
        (&[&scene, "--builder", "lbvh"], 2, "lbvh builds no kd-trees; take kd-exact, kd-binned, kd-gpu"),
        (
            &[&scene, "--static-builder", "kd-gpu"],
            2,
            "--static-builder kd-gpu: what stands still is built once, on the host",
        ),
        (&[&scene, "--png", "maybe"], 2, "neither on nor off"),
    ] {
        let out = folder.path().join("out");
        let done = hedgerow(&[&["animate"], wrong, &["-o", text(&out)]].concat());
        assert_eq!(done.status.code(), Some(status), "{wrong:?}: {}", err(&done));
        assert!(err(&done).contains(says), "{wrong:?}: {}", err(&done));
        assert!(!out.exists(), "{wrong:?} leaves nothing");
    }
}

#[test]
fn a_scene_of_which_only_the_camera_moves_is_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let still = "
frames 4
seconds 1
static gen:icosphere:1
camera
  at 0  eye 0 0 3  look 0 0 0
  at 1  eye 0 1 3  look 0 0 0
";
    let done = tiny(&scene_in(folder.path(), still), &folder.path().join("out"), &[]);
    assert_eq!(done.status.code(), Some(1), "{}", err(&done));
    assert!(err(&done).contains("only its camera moves"), "{}", err(&done));
}
