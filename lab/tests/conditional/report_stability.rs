//! The pages of `hedgerow stability` from made-up records: what they say of them, and in a real browser.

use crate::browser::Browser;
use crate::conditional::needs;
use hedgerow_lab::experiments::stability::far::{FarTriangle, Side};
use hedgerow_lab::experiments::stability::large::{HugeTriangles, LargePlacement};
use hedgerow_lab::experiments::stability::page::{self, Paged};
use hedgerow_lab::experiments::stability::points::{Degenerate, Experiment, Growth, Large, Run};
use hedgerow_lab::measure::setting::Failure;
use hedgerow_lab::measure::statistics::Spread;
use hedgerow_lab::report::lines::{self, Points};
use std::collections::BTreeMap;
use std::path::Path;

crate::conditional::tests! {
    records_are_read_back_as_they_were_written: needs::nothing(),
    the_pages_say_where_a_tenth_is_lost_and_what_was_wrong: needs::nothing(),
    few_points_and_none_make_a_page_all_the_same: needs::nothing(),
    the_pages_hold_together_in_a_browser: needs::browser(),
    a_sample_to_look_at: needs::variable("HEDGEROW_SAMPLE_REPORT"),
}

const KINDS: [&str; 4] = ["primary", "diffuse1", "ao", "shadow"];

fn run(command: &str) -> Run {
    Run {
        setting: crate::pages::setting(&format!("hedgerow stability {command} -o <folder>"), "5 after a warm-up"),
        failures: vec![Failure::named("bunny, lbvh", "3 GiB of <memory> are needed")],
    }
}

/// A cost that is flat up to `drop` and then grows by a half with every e, and speeds that fall as it rises.
fn figures(e: u32, drop: u32) -> (f64, BTreeMap<String, f64>) {
    let cost = if e < drop { 1.03 } else { 1.12 * 1.5_f64.powi((e - drop) as i32) };
    let cost = if e == 0 { 1.0 } else { cost.min(500.0) };
    let speed = |k: usize| 0.5_f64.powf((cost.ln() / 2.0 - 0.02 * k as f64).max(0.0));
    (cost, KINDS.iter().enumerate().map(|(k, kind)| ((*kind).to_owned(), speed(k))).collect())
}

/// Codes, and the e at which they lose a tenth in one axis.
const CODES: [(&str, u32); 4] = [("mc63", 4), ("emc64var-nosize", 48), ("mip9", 57), ("bin4a5", 54)];

fn growth() -> Vec<Growth> {
    let mut points = Vec::new();
    for (axes, side) in [(1, Side::Positive), (1, Side::Negative), (3, Side::Positive), (3, Side::Negative)] {
        for (codes, drop) in CODES {
            for e in (0..=60).step_by(2) {
                let (cost, speeds) = figures(e, drop.div_ceil(axes));
                points.push(Growth {
                    experiment: Experiment::Growth,
                    scene: "bunny".into(),
                    builder: format!("lbvh:codes={codes}:collapse=off"),
                    by: FarTriangle { axes, side },
                    e,
                    cost: None,
                    relative_cost: Some(cost),
                    relative_mrays: speeds,
                });
            }
        }
    }
    points
}

fn large() -> Vec<Large> {
    let mut points = Vec::new();
    for placement in LargePlacement::ALL {
        for (codes, drop) in [("mc63", 8), ("mc63+concise", 14)] {
            for e in (0..=20).step_by(2) {
                let (cost, speeds) = figures(e, drop);
                points.push(Large {
                    experiment: Experiment::Large,
                    scene: "bunny".into(),
                    builder: format!("lbvh:codes={codes}:collapse=off"),
                    by: HugeTriangles { placement, count: 16 },
                    e,
                    cost: Some(Some(110.0 * cost)),
                    relative_cost: Some(cost),
                    relative_mrays: speeds,
                });
            }
        }
    }
    points
}

fn degenerate() -> Vec<Degenerate> {
    let good = |scene: &str, builder: &str| Degenerate {
        experiment: Experiment::Degenerate,
        scene: scene.into(),
        triangles: 2000,
        builder: builder.into(),
        is_ours: !builder.starts_with("driver"),
        active: Some(1980),
        depth_max: Some(34),
        sah: Some(56.7),
        status: Some(vec!["not finite".into()]),
        build_ms: Some(Spread { median: 0.5, min: 0.4, max: 0.9, runs: 19 }),
        same_bytes: Some(true),
        valid: Some(true),
        rays: 256,
        hits: 200,
        wrong: Some(0),
        faults: Vec::new(),
    };
    let mut points: Vec<Degenerate> = ["needles", "nested", "identical"]
        .into_iter()
        .flat_map(|scene| ["lbvh", "lbvh:codes=mc30", "driver-fast-build"].map(|builder| good(scene, builder)))
        .collect();
    points[1].valid = Some(false);
    points[1].faults = vec!["the header: node 3 has two parents".into()];
    points[3].same_bytes = Some(false);
    points[3].faults = vec!["build 7 gave other bytes than the first".into()];
    points[5].wrong = Some(3);
    points[5].faults = vec!["3 of 256 rays hit something else than by brute force".into()];
    points[8] = Degenerate {
        active: None,
        depth_max: None,
        sah: None,
        status: None,
        build_ms: None,
        same_bytes: None,
        valid: None,
        wrong: None,
        faults: vec!["it panicked".into()],
        ..good("identical", "driver-fast-build")
    };
    points
}

/// The page of these points.
fn page_of<P: Paged + Clone>(folder: &Path, points: &[P]) -> String {
    let mut file = Points::<P>::create(folder).expect("a folder of our own");
    for point in points {
        file.append(point.clone()).expect("written");
    }
    let page = page::finish::<P>(folder, &run(P::PAGE.stem())).expect("the page is written");
    std::fs::read_to_string(page).expect("just written")
}

fn records_are_read_back_as_they_were_written() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    page_of(folder.path(), &growth());
    page_of(folder.path(), &large());
    page_of(folder.path(), &degenerate());
    assert_eq!(lines::entries::<Growth>(folder.path()).expect("written"), growth());
    assert_eq!(lines::entries::<Large>(folder.path()).expect("written"), large());
    assert_eq!(lines::entries::<Degenerate>(folder.path()).expect("written"), degenerate());
    let path = folder.path().join("growth.jsonl");
    let first = std::fs::read_to_string(&path).expect("written").lines().next().expect("a point").to_owned();
    std::fs::write(&path, format!("{first}\n{}\n", first.replace("\"growth\"", "\"large\""))).expect("written");
    let error = lines::entries::<Growth>(&path).expect_err("another experiment").to_string();
    assert!(error.contains("growth.jsonl:2: experiment \"large\""), "{error}");
    std::fs::write(&path, first.replace("\"schema\":1", "\"schema\":2")).expect("written");
    let error = lines::entries::<Growth>(&path).expect_err("another schema").to_string();
    assert!(error.contains("growth.jsonl:1: schema 2, this program reads 1"), "{error}");
}

fn the_pages_say_where_a_tenth_is_lost_and_what_was_wrong() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let page = page_of(folder.path(), &growth());
    // Cost from 57 on, of which 58 is measured; expected at 48 + 9.
    let row = ">mip9</td><td class=\"number\" data-value=\"1\">1</td><td data-value=\"+\">+</td><td class=\"number\" \
               data-value=\"58\">58</td><td class=\"number\" data-value=\"57\">57</td><td class=\"number\" \
               data-value=\"1\">+1.0</td>";
    assert!(page.replace("lbvh ", "").contains(row), "{page}");
    for words in ["bunny, lbvh : 3 GiB of &lt;memory&gt;", "a note &amp; more", "in three axes to the negative side"] {
        assert!(crate::pages::text(&page, " ").contains(words), "{words}: {}", crate::pages::text(&page, " "));
    }
    let degenerate = crate::pages::text(&page_of(folder.path(), &degenerate()), " ");
    for words in
        ["4 of 6", "needles, lbvh:codes=mc30 : the header: node 3 has two parents", "other bytes", "wrong hits"]
    {
        assert!(degenerate.contains(words), "{words}: {degenerate}");
    }
    assert!(!degenerate.contains("identical, driver-fast-build"), "a peer's fault is no failure");
}

fn few_points_and_none_make_a_page_all_the_same() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    assert!(crate::pages::text(&page_of::<Growth>(folder.path(), &[]), " ").contains("Nothing was measured"));
    assert!(crate::pages::text(&page_of::<Large>(folder.path(), &[]), " ").contains("Nothing was measured"));
    assert!(crate::pages::text(&page_of::<Degenerate>(folder.path(), &[]), " ").contains("Nothing was measured"));
    let bare = Growth { relative_cost: None, relative_mrays: BTreeMap::new(), ..growth()[0].clone() };
    for page in [page_of(folder.path(), &[bare]), page_of(folder.path(), &large()[..1])] {
        assert!(
            !crate::pages::text(&page, " ").contains("NaN") && !crate::pages::text(&page, " ").contains("inf"),
            "{}",
            crate::pages::text(&page, " ")
        );
    }
    // A run that was ended before its end.
    std::fs::remove_file(folder.path().join("large.run.json")).expect("just written");
    page::write_all(folder.path()).expect("written");
    let page = std::fs::read_to_string(folder.path().join("large.html")).expect("written");
    assert!(crate::pages::text(&page, " ").contains("ended before its end"));
}

fn the_pages_hold_together_in_a_browser() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    page_of(folder.path(), &growth());
    page_of(folder.path(), &large());
    page_of(folder.path(), &degenerate());
    let browser = Browser::find();
    let look = r##"all("details").forEach((details) => { details.open = true; });
    return {
      rows: (document.getElementById("losses") ?? document.getElementById("matrix")).tBodies[0].rows.length,
      wrong: all("#matrix td.wrong").map((cell) => cell.textContent),
      dashes: all("line[stroke-dasharray]").length,
      links: all("nav .page").map((a) => a.getAttribute("href")),
    };"##;
    let found = browser.look(&folder.path().join("growth.html"), look);
    assert_eq!(found["sections"], serde_json::json!(["failures", "summary", "scene-bunny", "method"]));
    assert_eq!(found["charts"], 4 * (2 + KINDS.len()));
    // The drop of the base, and of mip9 and bin4a5 as far as the curves reach, in each of the charts of costs.
    assert_eq!((&found["rows"], &found["dashes"]), (&(4 * CODES.len()).into(), &(4 * 3).into()));
    assert_eq!(found["links"], serde_json::json!(["large.html", "degenerate.html"]));
    let found = browser.look(&folder.path().join("large.html"), look);
    assert_eq!((&found["charts"], &found["rows"]), (&(3 * (2 + KINDS.len())).into(), &6.into()));
    let found = browser.look(&folder.path().join("degenerate.html"), look);
    assert_eq!(found["sections"], serde_json::json!(["failures", "summary", "figures", "method"]));
    assert_eq!(found["wrong"], serde_json::json!(["invalid", "other bytes"]));
}

/// Writes the pages of the made-up records where `HEDGEROW_SAMPLE_REPORT` says, to look at.
fn a_sample_to_look_at() {
    let folder = std::env::var_os("HEDGEROW_SAMPLE_REPORT").expect("it names a folder");
    let folder = Path::new(&folder).join("stability");
    page_of(&folder, &growth());
    page_of(&folder, &large());
    page_of(&folder, &degenerate());
}
