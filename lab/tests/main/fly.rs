//! `hedgerow fly`: the records and the page that it leaves, which frames teach, and what is refused.

use crate::program::{err, hedgerow, out, text};
use hedgerow_lab::experiments::fly::cadence::Cadence;
use hedgerow_lab::experiments::fly::page;
use hedgerow_lab::experiments::fly::points::{FlownFrame, FlownPath, FlownTree, FlyEntry, FlySetting};
use std::path::Path;
use std::process::Output;

const PLAIN: &str = "binned:axes=all:bins=4";
const RDH: &str = "binned:axes=all:bins=4:heuristic=rdh:sample=2000";

/// One run a frame of a few rays.
fn tiny(folder: &Path, more: &[&str]) -> Output {
    hedgerow(&[&["fly", "--runs", "1", "--size", "16x12", "--frame-size", "64x48", "-o", text(folder)], more].concat())
}

#[derive(Default)]
struct Records {
    setting: Option<FlySetting>,
    paths: Vec<FlownPath>,
    trees: Vec<FlownTree>,
    frames: Vec<FlownFrame>,
    failures: usize,
}

fn records(folder: &Path) -> Records {
    let mut all = Records::default();
    for entry in page::read(folder).expect("records") {
        match entry {
            FlyEntry::Setting(setting) => all.setting = Some(setting),
            FlyEntry::Path(path) => all.paths.push(path),
            FlyEntry::Tree(tree) => all.trees.push(tree),
            FlyEntry::Fly(frame) => all.frames.push(frame),
            FlyEntry::Failure(_) => all.failures += 1,
        }
    }
    all
}

impl Records {
    fn of(&self, builder: &str, cadence: &str) -> Vec<&FlownFrame> {
        let cadence: Cadence = cadence.parse().expect("a cadence");
        self.frames.iter().filter(|frame| frame.builder == builder && frame.cadence == cadence).collect()
    }
}

#[test]
fn trees_are_built_at_their_cadence_and_taught_by_the_frame_before() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let builders = format!("{PLAIN},{RDH},binned:axes=all:bins=4:heuristic=osah:rays=primary");
    let done = tiny(
        folder.path(),
        &["gen:clutter:40:1", "-b", &builders, "--frames", "10..15", "--cadence", "never,2,1,gain"],
    );
    assert_eq!(done.status.code(), Some(0), "{}", err(&done));
    let page = folder.path().join("fly.html");
    let stdout = out(&done);
    assert_eq!(stdout.lines().last(), Some(text(&page)), "{stdout}");

    let all = records(folder.path());
    let setting = all.setting.as_ref().expect("the first line");
    assert_eq!((setting.size, &setting.frame_sizes[..], all.failures), ([16, 12], &[[64, 48]][..], 0));
    assert_eq!((all.paths.len(), &all.paths[0].frames[..]), (1, &[10, 11, 12, 13, 14][..]));
    assert_eq!(all.trees.len(), 3);
    assert!(all.trees.iter().all(|tree| tree.frame == 10 && tree.sah > Some(1.0)));

    let plan = |builder: &str, cadence: &str| -> Vec<(u32, u32, Option<u32>)> {
        all.of(builder, cadence).iter().map(|f| (f.frame, f.built_at, f.taught_by)).collect()
    };
    let by = |frame: u32, built: u32, taught: u32| (frame, built, Some(taught));
    // The first is taught by its own view, the others by the frame before they are built.
    assert_eq!(plan(RDH, "never"), (10..15).map(|frame| by(frame, 10, 10)).collect::<Vec<_>>());
    assert_eq!(plan(RDH, "2"), [by(10, 10, 10), by(11, 10, 10), by(12, 12, 11), by(13, 12, 11), by(14, 14, 13)]);
    assert_eq!(plan(RDH, "1"), [by(10, 10, 10), by(11, 11, 10), by(12, 12, 11), by(13, 13, 12), by(14, 14, 13)]);
    // Nothing teaches a tree by areas: it is kept, and flown once.
    assert_eq!(plan(PLAIN, "never"), (10..15).map(|frame| (frame, 10, None)).collect::<Vec<_>>());
    assert!(plan(PLAIN, "1").is_empty() && plan(PLAIN, "gain").is_empty());

    for frame in &all.frames {
        let is_built = frame.built_at == frame.frame;
        assert_eq!(frame.build_ms > 0.0, is_built, "only where it is built: {frame:?}");
        let kinds: Vec<&str> = frame.trace.iter().map(|rays| rays.rays.as_str()).collect();
        assert_eq!(kinds, ["primary", "shadow", "ao", "diffuse1", "diffuse2"]);
        assert!(frame.trace.iter().all(|rays| rays.count > 0 && rays.steps > Some(0.0)), "{frame:?}");
        let is_gain = frame.cadence == Cadence::Gain;
        assert_eq!(
            (frame.probe_ms > 0.0, frame.ratio.is_some(), frame.frame_size.is_some()),
            (is_gain, is_gain, is_gain)
        );
        assert_eq!(frame.sample_rays.is_some(), frame.builder == RDH);
        assert_eq!(frame.seen_triangles.is_some(), frame.builder.contains("osah"));
    }
    // Cadences that build in a frame share the tree, and what it took.
    for (a, b) in all.of(RDH, "1").iter().zip(all.of(RDH, "2")).filter(|(a, b)| a.built_at == b.built_at) {
        assert_eq!((&a.trace, a.build_ms), (&b.trace, b.build_ms));
    }
    let page = std::fs::read_to_string(page).expect("written");
    for table in ["Table 2", "Table 3", "Table 4", "Table 6", "Table A.1", "Table A.8", "Errata"] {
        assert!(page.contains(table), "{table}");
    }
    assert!(!page.contains("Table 5"), "no cadence of three was flown");
    assert!(folder.path().join("charts/fly-total-gen-clutter-40-1-64x48.svg").is_file());
}

#[test]
fn work_is_the_same_in_every_run() {
    let works = |_| {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let done = tiny(folder.path(), &["gen:clutter:30:1", "-b", RDH, "--frames", "3", "--cadence", "never,1"]);
        assert_eq!(done.status.code(), Some(0), "{}", err(&done));
        records(folder.path()).frames.iter().map(|frame| frame.work()).collect::<Vec<_>>()
    };
    let [first, second] = [1, 2].map(works);
    assert!(first == second && first.len() == 6 && first.iter().all(Option::is_some), "{first:?} {second:?}");
}

#[test]
fn several_scenes_by_their_own_paths_and_by_a_file_are_on_one_page() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let dynamic = folder.path().join("way.dyn");
    let camera = "frames 6\nseconds 1\ncamera smooth\n at 0 eye 0 0 4 look 0 0 0\n at 1 eye 1 0 4 look 0 0 0\n";
    std::fs::write(&dynamic, format!("static gen:icosphere:2\n{camera}")).expect("written");
    let scenes = [text(&dynamic), "gen:icosphere:2"];
    let done = tiny(folder.path(), &[&scenes[..], &["-b", PLAIN, "--cadence", "never", "--frames", "2"]].concat());
    assert_eq!(done.status.code(), Some(0), "{}", err(&done));
    let paths = records(folder.path()).paths;
    assert_eq!(paths.iter().map(|path| path.scene.as_str()).collect::<Vec<_>>(), ["way", "gen:icosphere:2"]);
    assert_eq!((paths[0].path_frames, &paths[0].frames[..]), (6, &[0, 3][..]));
    assert!(paths[1].path.contains("none is known; once round the scene"), "{:?}", paths[1]);

    let file = folder.path().join("own.path");
    std::fs::write(&file, camera).expect("written");
    let out = folder.path().join("own");
    let done =
        tiny(&out, &["gen:icosphere:2", "--path", text(&file), "-b", PLAIN, "--cadence", "never", "--frames", "2"]);
    assert_eq!(done.status.code(), Some(0), "{}", err(&done));
    assert!(records(&out).paths[0].path.contains("own.path"));
}

#[test]
fn builders_of_the_device_fly_too() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let builders = format!("hploc,{RDH}:trace=device");
    let done = tiny(folder.path(), &["gen:clutter:20:1", "-b", &builders, "--frames", "2", "--cadence", "1,gain"]);
    assert_eq!(done.status.code(), Some(0), "{}", err(&done));
    let all = records(folder.path());
    assert_eq!((all.of("hploc", "never").len(), all.of(&format!("{RDH}:trace=device"), "1").len()), (2, 2));
    assert!(all.of("hploc", "never").iter().all(|frame| frame.timer == "device" && frame.work().is_some()));
}

#[test]
fn what_cannot_be_flown_is_refused_with_the_remedy() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("wrong.path");
    std::fs::write(&file, "frames 2\nseconds 1\nstatic hall\ncamera\n at 0 eye 0 0 1 look 0 0 0\n").expect("written");
    let both = format!("{PLAIN},sweep:heuristic=interior-fast");
    for (wrong, status, says) in [
        (&["gen:twist:400:5", "-b", RDH][..], 2, "its triangles move and no camera does; take hedgerow animate"),
        (&["gen:icosphere:1", "-b", RDH, "--cadence", "0"], 2, "--cadence 0 is unknown; use never, gain, or a number"),
        (&["gen:icosphere:1", "-b", RDH, "--cadence", "growth"], 2, "--cadence growth is unknown"),
        (
            &["gen:icosphere:1", "-b", &both, "--cadence", "3"],
            2,
            "learns nothing from a camera, so that a rebuild gives the same tree",
        ),
        (&["gen:icosphere:1", "-b", RDH, "--frames", "40..60"], 2, "--frames 40..60: gen:icosphere:1 has 48"),
        (&["gen:icosphere:1", "-b", RDH, "--frame-size", "0x4"], 2, "is not a size"),
        (&["gen:icosphere:1", "-b", RDH, "--path", "nowhere.path"], 1, "nowhere.path"),
        (
            &["gen:icosphere:1", "-b", RDH, "--path", text(&file)],
            1,
            "wrong.path:3: a path has a camera and nothing else",
        ),
        (
            &["gen:icosphere:1", "gen:icosphere:2", "-b", RDH, "--path", text(&file)],
            2,
            "it is a path through one scene",
        ),
        (&["no-such-scene", "-b", RDH], 1, "there is no scene \"no-such-scene\""),
        (&["-b", RDH], 2, "SCENE"),
    ] {
        let out = folder.path().join("out");
        let done = tiny(&out, wrong);
        assert_eq!(done.status.code(), Some(status), "{wrong:?}: {}", err(&done));
        assert!(err(&done).contains(says), "{wrong:?}: {}", err(&done));
        assert!(!out.exists(), "{wrong:?} leaves nothing");
    }
}
