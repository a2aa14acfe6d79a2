//! The page of `hedgerow animate` from made-up records: what it says of them, and in a real browser.

use crate::browser::Browser;
use crate::conditional::needs;
use hedgerow_lab::experiments::animate::AnimationMethod;
use hedgerow_lab::experiments::animate::page::{self, Points};
use hedgerow_lab::experiments::animate::points::{AnimateEntry, Animated, Object, Rays, SceneSetting, WayInFrame};
use hedgerow_lab::measure::record::MemoryRecord;
use hedgerow_lab::measure::setting::Failure;
use hedgerow_lab::measure::statistics::Spread;
use std::path::Path;

crate::conditional::tests! {
    records_are_read_back_as_they_were_written: needs::nothing(),
    the_page_says_plainly_which_way_takes_least: needs::nothing(),
    few_records_and_none_make_a_page_all_the_same: needs::nothing(),
    the_page_holds_together_in_a_browser: needs::browser(),
}

fn spread(median: f64) -> Spread {
    Spread { median, min: 0.94 * median, max: 1.09 * median, runs: 3 }
}

fn setting() -> AnimateEntry {
    AnimateEntry::Setting(SceneSetting {
        setting: crate::pages::setting(
            "hedgerow animate atrium_run -o <folder>",
            "3 of every build and trace, in turn",
        ),
        scene: "atrium_run".into(),
        static_triangles: 66_450,
        objects: vec![
            Object { name: "soldier".into(), triangles: 11_376, morphs: true },
            Object { name: "urn".into(), triangles: 500, morphs: false },
        ],
        static_builder: "kd-exact".into(),
        pictures: vec![(0, "frame-0000.png".into())],
    })
}

/// Of each way, what a build takes and what rays take.
const TIMES: [(AnimationMethod, f64, f64); 5] = [
    (AnimationMethod::Rebuild, 640.0, 40.0),
    (AnimationMethod::TwoTrees, 90.0, 52.0),
    (AnimationMethod::TreePerObject, 96.0, 55.0),
    (AnimationMethod::TwoLevel, 20.0, 80.0),
    (AnimationMethod::Merge, 40.0, 40.0),
];

fn frames(count: u32) -> impl Iterator<Item = AnimateEntry> {
    (0..count).flat_map(|frame| {
        TIMES.map(|(way, build, trace)| {
            let rays = [("primary", 0.25), ("shadow", 0.25), ("diffuse1", 0.5)].map(|(kind, share)| Rays {
                rays: kind.into(),
                count: 76_800,
                hits: 60_000,
                trace_ms: spread(share * trace),
                steps: Some(40.5),
                tests: Some(8.25),
                checksum: "1".into(),
                different: 0,
            });
            let on_host = way == AnimationMethod::Merge;
            AnimateEntry::Animate(Animated {
                scene: "atrium_run".into(),
                frame,
                time: 0.125 * frame as f32,
                way,
                builder: if on_host { "kd-binned" } else { "kd-gpu" }.into(),
                timer: if on_host { "wall" } else { "device" }.into(),
                static_triangles: 66_450,
                dynamic_triangles: 11_876,
                build_ms: spread(build * (1.0 + 0.05 * f64::from(frame))),
                trace: rays.to_vec(),
                memory: MemoryRecord { structure_bytes: Some(5 << 20), ..MemoryRecord::default() },
                sah: matches!(way, AnimationMethod::Rebuild | AnimationMethod::Merge).then_some(202.3),
            })
        })
    })
}

fn entries() -> Vec<AnimateEntry> {
    let failure = Failure {
        at: WayInFrame { way: AnimationMethod::TreePerObject, frame: Some(3) },
        what: "7 of 76800 <primary> rays".into(),
    };
    [setting()].into_iter().chain(frames(4)).chain([AnimateEntry::Failure(failure)]).collect()
}

/// The page of these records.
fn page_of(folder: &Path, entries: &[AnimateEntry]) -> String {
    let mut points = Points::create(folder).expect("a folder of our own");
    for entry in entries {
        points.append(entry.clone()).expect("written");
    }
    image::RgbImage::new(4, 3).save(folder.join("frame-0000.png")).expect("a picture");
    std::fs::read_to_string(page::write(folder).expect("the page is written")).expect("just written")
}

fn records_are_read_back_as_they_were_written() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let entries = entries();
    page_of(folder.path(), &entries);
    assert_eq!(page::read(folder.path()).expect("written"), entries);
    let path = folder.path().join("animate.jsonl");
    let lines = std::fs::read_to_string(&path).expect("written");
    let first = lines.lines().nth(1).expect("a frame");
    let value: serde_json::Value = serde_json::from_str(first).expect("JSON");
    assert_eq!(
        (&value["schema"], &value["experiment"], &value["way"]),
        (&1.into(), &"animate".into(), &"rebuild".into())
    );
    std::fs::write(&path, first.replace("\"schema\":1", "\"schema\":2")).expect("written");
    let error = page::read(&path).expect_err("another schema").to_string();
    assert!(
        error.contains("animate.jsonl:1: schema 2, this program reads 1") && error.contains("hedgerow animate"),
        "{error}"
    );
}

fn the_page_says_plainly_which_way_takes_least() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let text = crate::pages::text(&page_of(folder.path(), &entries()), "");
    for words in [
        "66450 triangles stand still; 11876 move, in 2 objects, 1 of them changing shape.",
        "A frame takes least by merge: 83.0 ms in the mean",
        "Some of the builds were timed on the host and some on the device",
        "tree-per-object, frame 3: 7 of 76800 &lt;primary&gt; rays",
        "a note &amp; more",
        "GPU double",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
}

fn few_records_and_none_make_a_page_all_the_same() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    assert!(crate::pages::text(&page_of(folder.path(), &[]), "").contains("Nothing was measured to its end"));
    for entry in entries().into_iter().take(4) {
        let page = page_of(folder.path(), std::slice::from_ref(&entry));
        assert!(!crate::pages::text(&page, "").contains("NaN"), "{entry:?}");
    }
}

fn the_page_holds_together_in_a_browser() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    page_of(folder.path(), &entries());
    let browser = Browser::find();
    let look = r##"return { ways: all("#ways tbody th").map((cell) => cell.textContent) };"##;
    let found = browser.look(&folder.path().join("animate.html"), look);
    let sections = ["failures", "summary", "pictures", "frames", "published", "method"];
    assert_eq!(found["sections"], serde_json::json!(sections));
    assert_eq!(found["charts"], 3);
    assert_eq!(found["ways"], serde_json::json!(AnimationMethod::ALL.map(AnimationMethod::name)));
}
