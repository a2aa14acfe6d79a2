//! The page of `hedgerow accel` from made-up records: what it says of them, and in a real browser.

use crate::browser::Browser;
use crate::conditional::needs;
use hedgerow_lab::experiments::accel::page::{self, Points};
use hedgerow_lab::experiments::accel::points::{
    AccelEntry, AnyHitPoint, Batch, FlaggedRays, Implementation, RebraidPoint, Submission, TopLevel, TopLevelPoint,
    Update, UpdatedRays,
};
use hedgerow_lab::measure::setting::Failure;
use hedgerow_lab::measure::statistics::Spread;
use hedgerow_lab::subjects::preference::Preference;
use hedgerow_lab::subjects::queries::MeanWork;
use std::path::Path;

crate::conditional::tests! {
    records_are_read_back_as_they_were_written: needs::nothing(),
    the_page_says_plainly_what_is_reached_and_what_is_not: needs::nothing(),
    updates_that_were_not_measured_are_told_as_such: needs::nothing(),
    few_points_and_none_make_a_page_all_the_same: needs::nothing(),
    the_page_holds_together_in_a_browser: needs::browser(),
    a_sample_to_look_at: needs::variable("HEDGEROW_SAMPLE_REPORT"),
}

fn spread(median: f64) -> Spread {
    Spread { median, min: 0.94 * median, max: 1.09 * median, runs: 5 }
}

fn setting() -> AccelEntry {
    AccelEntry::Setting(crate::pages::setting("hedgerow accel -o <folder>", "5 after a warm-up"))
}

/// One call takes 50 ms, calls one by one 12 times that; the driver's call 0.8 times.
fn batches() -> impl Iterator<Item = AccelEntry> {
    let ways = [
        (Some(Implementation::Ours), Submission::OneCall, 1.0),
        (Some(Implementation::Ours), Submission::OneTable, 0.9),
        (Some(Implementation::Ours), Submission::OneSubmit, 12.0),
        (Some(Implementation::Ours), Submission::SubmitEach, 14.0),
        (Some(Implementation::Driver), Submission::OneCall, 0.8),
        (Some(Implementation::Driver), Submission::OneSubmit, 0.82),
        (Some(Implementation::Driver), Submission::SubmitEach, 1.9),
        (None, Submission::EmptySubmits, 1.1),
    ];
    [16, 256, 4096].into_iter().flat_map(move |structures| {
        ways.map(|(maker, way, times)| {
            let wall_ms = spread(50.0 * times * f64::from(structures) / 4096.0);
            let triangles = 245 * u64::from(structures);
            let over_our_call = spread(times);
            AccelEntry::Batch(Batch {
                structures,
                triangles,
                prefer: Preference::FastBuild,
                maker,
                way,
                wall_ms,
                over_our_call,
            })
        })
    })
}

fn top_levels() -> impl Iterator<Item = AccelEntry> {
    [100, 1_000, 10_000, 100_000].into_iter().flat_map(|instances| {
        [(Implementation::Ours, 2e-4, None), (Implementation::Driver, 1e-4, Some(3e-5))].map(
            |(maker, build, update)| {
                let time = |each: f64| spread(each * f64::from(instances).powf(1.1));
                AccelEntry::Tlas(TopLevel {
                    instances,
                    maker,
                    build_ms: time(build),
                    update_ms: update.map(time),
                    structure_bytes: 192 * u64::from(instances),
                    scratch_bytes: 64 * u64::from(instances),
                })
            },
        )
    })
}

fn rebraid(scene: &str, overlaps: f64, gain: f64) -> AccelEntry {
    let side =
        |entries| TopLevelPoint { build_ms: spread(0.5), structure_bytes: 76_800, scratch_bytes: 25_600, entries };
    let work = |nodes| MeanWork { top_nodes: nodes, instances: 3.0, nodes_below: 20.5, tests: 4.0 };
    let rays = ["primary", "shadow", "ao", "diffuse1", "diffuse2", "reflection", "random"].map(|kind| FlaggedRays {
        rays: kind.into(),
        count: 12_288,
        hits: 9_000,
        different: 0,
        off_ms: spread(10.0 * gain),
        on_ms: spread(10.0),
        in_turn_ms: Some(spread(8.0)),
        driver_ms: Some(spread(12.0)),
        gain: spread(gain),
        off_work: work(30.0),
        on_work: work(24.0),
    });
    AccelEntry::Rebraid(RebraidPoint {
        scene: scene.into(),
        instances: 400,
        parts: 3,
        triangles: 400_000,
        overlaps,
        off: side(Some(400)),
        on: side(Some(800)),
        driver: Some(side(None)),
        rays: rays.to_vec(),
    })
}

fn any_hit(scene: &str, gain: f64) -> AccelEntry {
    let AccelEntry::Rebraid(RebraidPoint { rays, .. }) = rebraid(scene, 1.0, gain) else { unreachable!() };
    AccelEntry::AnyHit(AnyHitPoint {
        scene: scene.into(),
        instances: 400,
        parts: 3,
        triangles: 400_000,
        off_build_ms: spread(0.5),
        on_build_ms: spread(0.6),
        rays: rays.into_iter().filter(|rays| ["shadow", "ao"].contains(&rays.rays.as_str())).collect(),
    })
}

/// Frames of an animation whose tree grows worse by a tenth a frame; from the sixth on, building anew pays.
fn updates(update_ms: Option<f64>) -> impl Iterator<Item = AccelEntry> {
    (0..8).map(move |frame| {
        let growth = 1.0 + 0.1 * f64::from(frame);
        let rays = UpdatedRays {
            rays: "primary".into(),
            count: 12_288,
            built_ms: spread(6.0),
            updated_ms: update_ms.map(|_| spread(6.0 * growth)),
            slowdown: update_ms.map(|_| spread(growth)),
        };
        AccelEntry::Update(Update {
            scene: "gen:twist:20000:8".into(),
            triangles: 19_964,
            frame,
            maker: Implementation::Ours,
            build_ms: spread(4.0),
            update_ms: update_ms.map(spread),
            growth: update_ms.map(|_| growth),
            updated_sah: update_ms.map(|_| 90.0 * growth),
            built_sah: Some(90.0),
            rays: vec![rays],
        })
    })
}

fn entries() -> Vec<AccelEntry> {
    let failure = Failure::named("update <knot>", "3 GiB of device memory are needed, 2 GiB are there");
    let rebraids = [rebraid("gen:forest:400", 8.2, 1.31), rebraid("gen:cells:1000", 0.0, 0.99)];
    let all = [setting()]
        .into_iter()
        .chain(batches())
        .chain(top_levels())
        .chain(rebraids)
        .chain([any_hit("gen:forest:400", 1.2)]);
    let all = all.chain(updates(Some(1.0)));
    all.chain([AccelEntry::Failure(failure)]).collect()
}

/// The page of these records.
fn page_of(folder: &Path, entries: &[AccelEntry]) -> String {
    let mut points = Points::create(folder).expect("a folder of our own");
    for entry in entries {
        points.append(entry.clone()).expect("written");
    }
    std::fs::read_to_string(page::write(folder).expect("the page is written")).expect("just written")
}

fn records_are_read_back_as_they_were_written() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let entries = entries();
    page_of(folder.path(), &entries);
    assert_eq!(page::read(folder.path()).expect("written"), entries);
    let path = folder.path().join("accel.jsonl");
    let first = std::fs::read_to_string(&path).expect("written");
    let first = first.lines().nth(1).expect("a point");
    std::fs::write(&path, format!("{first}\n{}\n", first.replace("\"batch\"", "\"hedge\""))).expect("written");
    let error = page::read(&path).expect_err("no such experiment").to_string();
    assert!(error.contains("accel.jsonl:2: not a record") && error.contains("hedgerow accel"), "{error}");
    std::fs::write(&path, first.replace("\"schema\":1", "\"schema\":2")).expect("written");
    let error = page::read(&path).expect_err("another schema").to_string();
    assert!(error.contains("accel.jsonl:1: schema 2, this program reads 1"), "{error}");
}

fn the_page_says_plainly_what_is_reached_and_what_is_not() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let text = crate::pages::text(&page_of(folder.path(), &entries()), "");
    for words in [
        "Goals met: 9 of 11",
        "Ours is slower than the driver's batch: 1.25 times its time",
        "Over 100000 instances our build is slower than the driver's, 2.00 times its time",
        "building from scratch pays from frame 5 on, where the SAH cost has grown to 1.50 times what it was",
        "update &lt;knot&gt;: 3 GiB of device memory",
        "a note &amp; more",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
}

fn updates_that_were_not_measured_are_told_as_such() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let entries: Vec<AccelEntry> = [setting()].into_iter().chain(updates(None)).collect();
    let text = crate::pages::text(&page_of(folder.path(), &entries), "");
    assert!(text.contains("our updates were not measured") && !text.contains("NaN"), "{text}");
    assert!(folder.path().join("charts/accel-update-gen-twist-20000-8.svg").is_file());
}

fn few_points_and_none_make_a_page_all_the_same() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    assert!(crate::pages::text(&page_of(folder.path(), &[]), "").contains("Nothing that has a goal was measured"));
    for entry in entries() {
        let page = page_of(folder.path(), std::slice::from_ref(&entry));
        assert!(!crate::pages::text(&page, "").contains("NaN"), "{entry:?}");
    }
}

fn the_page_holds_together_in_a_browser() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    page_of(folder.path(), &entries());
    let browser = Browser::find();
    let look = r##"return {
      goals: document.getElementById("goals").tBodies[0].rows.length,
      verdicts: all("#goals tbody td:last-child").map((cell) => cell.textContent),
    };"##;
    let found = browser.look(&folder.path().join("accel.html"), look);
    let sections = ["failures", "summary", "batches-fast-build", "tlas", "rebraid", "any-hit", "updates", "method"];
    assert_eq!(found["sections"], serde_json::json!(sections));
    assert_eq!(found["charts"], 2 + 1 + 2 + 1 + 2);
    assert_eq!(found["goals"], 11);
    assert_eq!(
        found["verdicts"],
        serde_json::json!([
            "met",
            "met",
            "missed",
            "met",
            "met",
            // Rays against the driver's, 1.2 of 1.4, and the slowest; in turn, 1.5 of 1.4; both builds, as long as the driver's.
            "missed",
            "met",
            "met",
            "met",
            "met, within the spread",
            "met, within the spread"
        ])
    );
}

/// Writes the page of the made-up records where `HEDGEROW_SAMPLE_REPORT` says, to look at.
fn a_sample_to_look_at() {
    let folder = std::env::var_os("HEDGEROW_SAMPLE_REPORT").expect("it names a folder");
    page_of(Path::new(&folder), &entries());
}
