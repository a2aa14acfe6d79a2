//! The page of `hedgerow cpu-builders` from made-up records: what it says of them, and in a real browser. What was published is
//! compared with the reference data where HEDGEROW_REFERENCE names their folder.

use crate::browser::Browser;
use crate::conditional::needs;
use hedgerow_lab::experiments::bench::matrix::OnScene;
use hedgerow_lab::experiments::cpu_builders::frantal::{Group, PUBLISHED, PUBLISHED_MEANS};
use hedgerow_lab::experiments::cpu_builders::page::{self, Run};
use hedgerow_lab::measure::record::{
    BuildRecord, MemoryRecord, PhaseRecord, QualityRecord, Record, SCHEMA, TraceRecord,
};
use hedgerow_lab::measure::setting::Failure;
use hedgerow_lab::report::lines::Lines;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

crate::conditional::tests! {
    the_page_has_our_figures_with_those_published_in_brackets: needs::nothing(),
    the_page_says_where_sah_and_speed_disagree: needs::nothing(),
    peers_stand_beside_ours_with_both_tracers: needs::nothing(),
    without_the_dragon_only_ratios_are_shown: needs::nothing(),
    few_records_and_none_make_a_page_all_the_same: needs::nothing(),
    the_page_holds_together_in_a_browser: needs::browser(),
    published_figures_are_those_of_the_reference: needs::variable("HEDGEROW_REFERENCE"),
    published_means_follow_from_the_reference: needs::variable("HEDGEROW_REFERENCE"),
}

/// A builder: its name, kind, milliseconds of a build, SAH, EPO, and million rays a second.
type Builder = (&'static str, &'static str, f64, f64, f64, f64);

/// Costs of the dragon: binned:leaf=2:termination=flat is 1.1 times sweep, and of the bunny 1.2 times.
const DRAGON: [Builder; 9] = [
    ("sweep", "bvh2", 900.0, 100.0, 10.0, 1.0),
    ("sweep:threads=1", "bvh2", 1600.0, 100.0, 10.0, 0.0),
    ("sweep:trace=device", "bvh2", 900.0, 100.0, 10.0, 2.0),
    ("binned:leaf=2:termination=flat", "bvh2", 120.0, 110.0, 12.0, 0.8),
    ("binned:leaf=2:termination=flat:threads=1", "bvh2", 200.0, 110.0, 12.0, 0.0),
    // Less SAH than sweep, more EPO, and slower rays.
    ("aac-fast", "bvh2", 90.0, 90.0, 14.0, 0.5),
    ("obvhs-fast", "host", 300.0, 120.0, 15.0, 3.0),
    ("obvhs-fast:trace=host", "bvh2", 300.0, 120.0, 15.0, 0.4),
    ("obvhs-fast:trace=device", "bvh2", 300.0, 120.0, 15.0, 0.7),
];
const BUNNY: [Builder; 2] =
    [("sweep", "bvh2", 90.0, 50.0, 5.0, 2.0), ("binned:leaf=2:termination=flat", "bvh2", 12.0, 60.0, 6.0, 1.0)];

fn record(scene: &str, triangles: u64, builder: &Builder) -> Record {
    let &(name, kind, median_ms, sah, epo, mrays_s) = builder;
    let on_device = name.ends_with("device");
    let trace = ["primary", "shadow", "random"].map(|rays| TraceRecord {
        rays: rays.into(),
        count: 1000,
        hits: 900,
        mrays_s,
        steps: (kind == "bvh2").then_some(40.0),
        tests: (kind == "bvh2").then_some(9.0),
        runs: 5,
        checksum: "1".into(),
    });
    Record {
        schema: SCHEMA,
        scene: scene.into(),
        triangles,
        builder: name.into(),
        kind: kind.into(),
        device: if on_device { "llvmpipe" } else { "AMD EPYC 9R14" }.into(),
        driver: "x".into(),
        subgroup: if on_device { 8 } else { 0 },
        commit: "abc1234".into(),
        when: "2026-11-21T10:00:00Z".into(),
        build: BuildRecord {
            runs: 5,
            median_ms,
            min_ms: 0.96 * median_ms,
            max_ms: 1.09 * median_ms,
            timer: "wall".into(),
            phases: vec![
                PhaseRecord { name: "boxes".into(), median_ms: 0.1 * median_ms },
                PhaseRecord { name: "build".into(), median_ms: 0.9 * median_ms },
            ],
            cpu_median_ms: Some(1.7 * median_ms),
            threads: Some(2),
            ..BuildRecord::default()
        },
        memory: MemoryRecord { structure_bytes: Some(112 * triangles), scratch_bytes: None, peak_bytes: Some(1 << 20) },
        quality: QualityRecord {
            sah: Some(sah),
            c_t: 3.0,
            c_i: 2.0,
            epo: Some(epo),
            inner: Some(triangles),
            refs: Some(triangles),
            depth_max: Some(30),
            prims_per_leaf: Some(2.4),
            sah_inner: Some(0.3 * sah),
            sah_leaf: Some(0.05 * sah),
            ..QualityRecord::default()
        },
        trace: if mrays_s > 0.0 { trace.to_vec() } else { Vec::new() },
        valid: Some(true),
    }
}

fn records() -> Vec<Record> {
    let dragon = DRAGON.iter().map(|builder| record("dragon", 871_414, builder));
    dragon.chain(BUNNY.iter().map(|builder| record("bunny", 69_451, builder))).collect()
}

/// The page of these records.
fn page_of(folder: &Path, records: &[Record]) -> String {
    let mut lines = Lines::create(folder, "cpu-builders.jsonl").expect("a folder of our own");
    records.iter().for_each(|record| lines.append(record).expect("written"));
    let at = OnScene { scene: "dragon".into(), builder: Some("bonsai".into()) };
    let setting = crate::pages::setting("hedgerow cpu-builders dragon -o <folder>", "5 after a warm-up");
    let run = Run { setting, failures: vec![Failure { at, what: "too <little> memory".into() }] };
    run.write(folder).expect("written");
    std::fs::read_to_string(page::write(folder).expect("the page is written")).expect("just written")
}

/// What a reader sees of the page of these records, and of one of its sections.
fn text_of(records: &[Record]) -> String {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let page = page_of(folder.path(), records);
    assert!(!page.contains("NaN") && !page.contains(">inf<"), "a figure that is none");
    crate::pages::text(&page, " ").split_whitespace().collect::<Vec<_>>().join(" ")
}

fn assert_says(text: &str, all: &[&str]) {
    for words in all {
        assert!(text.contains(words), "{words}: {text}");
    }
}

fn the_page_has_our_figures_with_those_published_in_brackets() {
    assert_says(
        &text_of(&records()),
        &[
            // Table 10, and ours over it: 100 / 138.2, 110 / 144.8.
            "100.0 (138.2) 0.724 30.0 (40.3) 5.0 (8.6) 2.4 (2.4)",
            "110.0 (144.8) 0.760",
            // √(1.1 · 1.2) beside the mean over eight objects.
            "1.15 (1.06)",
            "Geometric means over dragon, bunny. In brackets, over the 8 objects of the thesis.",
            "None of these scenes was measured: sponza, classroom, samurai_monastery, salle_de_bain, country_kitchen.",
            // Table 24: 120 ms of 200 ms.
            "All threads take 60.0% of the time of one, in the geometric mean over 1 builds (45.6% to 54.9% there",
            "dragon 200 120 60.0 204 yes",
            "(BIN) Dragon 889 427 48.0 1533",
            // One line a table.
            "45 EMC64VAR: both sums figures yes",
            "36 steps a random ray not here – The sphere there does not follow the scene's size",
            "dragon, bonsai : too &lt;little&gt; memory",
            "a note &amp; more",
        ],
    );
}

fn the_page_says_where_sah_and_speed_disagree() {
    // By SAH: aac-fast 90, sweep 100, binned 110, obvhs 120; speeds 0.5, 1, 0.8, 0.4. Of six pairs two are wrong.
    assert_says(
        &text_of(&records()),
        &[
            "dragon, host: SAH orders 67% of 6 pairs rightly, EPO 100%.",
            "They disagree most about aac-fast: it costs 18% less than binned leaf 2, termination flat by SAH, and takes 60% longer a ray.",
            "bunny, host: SAH orders 100% of 1 pair rightly, EPO 100%. SAH and speed agree everywhere.",
            "dragon, device: SAH orders 100% of 1 pair rightly",
            // Ranks 1, 2, 3, 4 by SAH are 3, 1, 2, 4 by time: 1 − 6 · 6 / (4 · 15).
            "dragon host all 4 6 67 100 0.40 1.00",
            "On the host, over all scenes and kinds of rays, SAH orders 71% of 21 pairs of builders rightly, EPO 100%.",
        ],
    );
}

fn peers_stand_beside_ours_with_both_tracers() {
    let text = text_of(&records());
    // 871,414 triangles in 300 ms; its own tracer, ours on the host, ours on the device.
    assert_says(&text, &["obvhs-fast dragon 2.90 120.0 15.00 40.0 9.00 3.00 0.400 0.700"]);
    assert!(!text.contains("No peer was measured"), "{text}");
    let ours: Vec<Record> = records().into_iter().filter(|record| !record.builder.starts_with("obvhs")).collect();
    assert_says(&text_of(&ours), &["No peer was measured."]);
}

fn without_the_dragon_only_ratios_are_shown() {
    let bunny: Vec<Record> = records().into_iter().filter(|record| record.scene == "bunny").collect();
    let text = text_of(&bunny);
    assert_says(
        &text,
        &["No scene of 871 414 triangles was measured.", "1.20 (1.06)", "45 EMC64VAR: both sums figures as ratios"],
    );
    assert!(!text.contains("(138.2)"), "{text}");
    // Another scene is neither an object nor a building of the thesis.
    let hall: Vec<Record> = bunny.into_iter().map(|record| Record { scene: "hall".into(), ..record }).collect();
    let text = text_of(&hall);
    assert_says(&text, &["The thesis has no such scenes.", "figures its scenes were not measured"]);
    assert!(text.contains("1.20") && !text.contains("1.20 (1.06)"), "{text}");
}

fn few_records_and_none_make_a_page_all_the_same() {
    assert_says(&text_of(&[]), &["Nothing could be measured."]);
    for record in records() {
        text_of(&[record]);
    }
    let mut bare = records();
    for record in &mut bare {
        record.quality = QualityRecord { c_t: 3.0, c_i: 2.0, ..QualityRecord::default() };
        record.build.phases.clear();
        record.trace.clear();
    }
    text_of(&bare);
}

fn the_page_holds_together_in_a_browser() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    page_of(folder.path(), &records());
    let browser = Browser::find();
    let look = r##"return { rows: all("#summary-table tbody tr").length };"##;
    let found = browser.look(&folder.path().join("cpu-builders.html"), look);
    let sections = ["failures", "summary", "scene-dragon", "scene-bunny", "order", "peers", "frantal", "method"];
    assert_eq!(found["sections"], serde_json::json!(sections));
    assert_eq!(found["rows"], 4);
}

/// The figures of the reference, by table, metric, scene and method.
fn reference() -> BTreeMap<(String, String, String, String), f64> {
    let folder = std::env::var_os("HEDGEROW_REFERENCE").map(PathBuf::from).expect("it names a folder");
    let path = folder.join("frantal2019_bvh_cpu.csv");
    let mut file = csv::Reader::from_path(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    type Row = (String, String, String, String, f64);
    let rows = file.deserialize().map(|row: Result<Row, _>| row.expect("table,metric,scene,method,value"));
    rows.map(|(table, metric, scene, method, value)| ((table, metric, scene, method), value)).collect()
}

fn published_figures_are_those_of_the_reference() {
    let reference = reference();
    let of_dragon = reference.keys().filter(|key| key.2 == "Dragon").count();
    // Table 24 is not in the reference.
    let ours: Vec<_> = PUBLISHED.iter().filter(|figure| figure.table != 24).collect();
    assert_eq!(ours.len(), of_dragon);
    for figure in ours {
        let key = (figure.table.to_string(), figure.metric.clone(), figure.scene.clone(), figure.method.clone());
        assert_eq!(reference.get(&key), Some(&figure.value), "{key:?}");
    }
}

fn published_means_follow_from_the_reference() {
    let reference = reference();
    let of = |table: &str, metric: &str, scene: &str, method: &str| {
        let key = [table, metric, scene, method].map(str::to_owned);
        reference[&key.into()]
    };
    const OBJECTS: [&str; 8] =
        ["Serapis", "Armadillo", "Angel", "Dragon", "H. Buddha", "Blade", "Hairball", "A. Dragon"];
    let scenes: Vec<&str> =
        reference.keys().filter(|key| key.0 == "10" && key.3 == "FSW").map(|key| key.2.as_str()).collect();
    let tables = [
        ("sah", "10", "sah_cost"),
        ("build", "11", "build_real_s"),
        ("primary_time", "13", "render_primary_real_s"),
        ("primary_steps", "15", "steps_primary"),
        ("primary_tests", "16", "tests_primary"),
        ("inner", "18", "sum_sa_inner"),
        ("leaf", "19", "sum_sa_leaf_n"),
        ("random_time", "34", "render_random_real_s"),
    ];
    let mut compared = 0;
    for mean in PUBLISHED_MEANS.iter().filter(|mean| !mean.method.contains('+')) {
        let Some((_, table, metric)) = tables.iter().find(|(name, ..)| *name == mean.metric) else { continue };
        let in_group = scenes.iter().filter(|scene| OBJECTS.contains(scene) == (mean.group == Group::Objects));
        let ratios: Vec<f64> =
            in_group.map(|scene| of(table, metric, scene, &mean.method) / of(table, metric, scene, "FSW")).collect();
        let expected = (ratios.iter().map(|ratio| ratio.ln()).sum::<f64>() / ratios.len() as f64).exp();
        assert!((expected - mean.mean).abs() < 1e-3, "{mean:?}: {expected}");
        compared += 1;
    }
    assert_eq!(compared, 2 * 10 * tables.len());
}
