//! `index.html`: one file that opens from the disk, with style, script and charts inside; pictures lie beside it.

use super::summary::{self, Standing};
use super::{Picture, Report, SceneCharts};
use crate::experiments::bench::kd_trees;
use crate::experiments::bench::matrix::Outcome;
use crate::experiments::choose::page as choosing;
use crate::measure::record::{PhaseRecord, Record, TraceRecord};
use crate::report::chart::Chart;
use crate::report::columns::Table;
use crate::report::document::{self, Document, Section};
use crate::report::elements::{bar, figure, number};
use crate::report::names::{distinct, short, slug};
use crate::report::numbers::{
    count, duration, grouped, one_decimal, short_count, size, three_digits, two_decimals, whole,
};
use crate::report::table::verdict;
use crate::report::theme::Legend;
use maud::{Markup, html};

/// The whole page.
pub(super) fn document<'r>(
    report: &'r Report,
    legend: &Legend,
    scenes: &[SceneCharts<'_>],
    [schedules, growth]: [Option<&Chart>; 2],
) -> Document<'r> {
    let records = report.records();
    let mut sections = vec![Section::new("summary", "Summary", summary(report, &records, legend))];
    sections.extend(scenes.iter().map(|(scene, charts)| scene_section(report, scene, charts, legend)));
    if !kd_trees::of(&records).is_empty() {
        sections.push(Section::new("kd-trees", "kd-trees", kd_trees::section(&records, schedules, &report.published)));
    }
    if !report.choices.is_empty() {
        let content = choosing::section(&report.choices, &records);
        sections.push(Section { id: "choosing".into(), name: "Choosing".into(), content });
    }
    let growth = growth.map(|chart| document::charts(std::slice::from_ref(chart)));
    sections.extend(growth.map(|chart| Section::new("growth", "How build time grows", chart)));
    sections.push(Section::new("results", "All figures", results(&records, legend)));
    sections.push(Section::method(None, terms(report)));
    let several = |count: usize, what: &str| format!("{count} {what}{}", if count == 1 { "" } else { "s" });
    let [of_builders, of_scenes] = [several(legend.builders.len(), "builder"), several(scenes.len(), "scene")];
    Document {
        tab: format!("{of_scenes}, {of_builders}"),
        kicker: "hedgerow benchmark",
        title: "Build speed against tree quality".into(),
        lead: format!(
            "{of_builders} of acceleration structures on {of_scenes}, built and traced in turn in one process; trees of ours \
             validated on the host, a sample of every kind of ray checked against brute force."
        ),
        setting: Some(&report.setting),
        failures: failures(report),
        sections,
    }
}

fn failures(report: &Report) -> Vec<(String, String)> {
    let faulty = report.outcomes.iter().filter(|outcome| !outcome.faults.is_empty());
    let wrong = faulty.map(|Outcome { record, faults, .. }| {
        (format!("{}, {} is not right", record.scene, record.builder), faults.join("; "))
    });
    document::told(&report.failures).into_iter().chain(wrong).collect()
}

/// The name of a record's builder with its colour, and where it works if not on the device by our shaders.
fn builder_name(Record { builder, kind, build, .. }: &Record, legend: &Legend) -> Markup {
    let peer = match (kind.as_str(), build.timer.as_str()) {
        ("driver", _) => Some("driver"),
        (_, "wall") => Some("host"),
        _ => None,
    };
    html! {
        span.builder title=(builder) {
            i.dot style={ "background:var(--" (legend.builder(builder).variable) ")" } {}
            (short(builder))
            @if let Some(peer) = peer { " " span.tag { (peer) } }
        }
    }
}

fn summary(report: &Report, records: &[&Record], legend: &Legend) -> Markup {
    let Some(baseline) = summary::baseline(legend, report.baseline.as_deref()) else {
        return html! { p { "Nothing could be measured." } };
    };
    let sah_baseline = summary::sah_baseline(records, baseline);
    let standings = summary::standings(records, legend, baseline);
    let most = |of: fn(&Standing) -> Option<f64>| standings.iter().filter_map(of).fold(0.0, f64::max);
    let (build_most, trace_most) = (most(|s| s.build), most(|s| s.trace));
    let first = |builder: &str| records.iter().find(|r| r.builder == builder).expect("standings are of records");
    let table = Table::new(format!("Every builder against {}", short(baseline)), &standings)
        .id("summary-table")
        .cell("builder", |standing| named(first(&standing.builder), legend))
        .number("scenes", "", |standing| Some(standing.scenes as f64), whole)
        .figure("build speed", "×", move |standing| bar(standing.build, build_most))
        .figure("trace speed", "×", move |standing| bar(standing.trace, trace_most))
        .number("SAH cost", "×", |standing| standing.sah, |v| format!("{v:.3}"));
    html! {
        p {
            "Every builder against " b { (short(baseline)) } ", which is 1: geometric means over the scenes that both have. "
            "Of speeds, more is better; of the SAH cost, less"
            @if let Some(other) = sah_baseline.filter(|b| *b != baseline) { " (against " b { (short(other)) } ")" }
            "."
        }
        @for note in &report.setting.notes { p.note { (note) } }
        (table.html())
    }
}

/// The cell that names a row by its builder.
fn named(record: &Record, legend: &Legend) -> Markup {
    html! { th scope="row" data-value=(record.builder) { (builder_name(record, legend)) } }
}

fn scene_section(report: &Report, scene: &str, charts: &[Chart], legend: &Legend) -> Section {
    let outcomes: Vec<&Outcome> = report.outcomes.iter().filter(|o| o.record.scene == scene).collect();
    let triangles = outcomes.first().map_or(0, |o| o.record.triangles);
    let pictures: Vec<&Picture> = report.pictures.iter().filter(|p| p.scene == scene).collect();
    let id = format!("scene-{}", slug(scene));
    let content = html! {
        section.scene #(id) {
            h2 { (scene) span.count { (grouped(triangles)) " triangles" } }
            @if !pictures.is_empty() {
                div.pictures {
                    @for picture in pictures {
                        figure { img src=(picture.file) alt=(picture.alt) loading="lazy"; figcaption { (picture.caption) } }
                    }
                }
            }
            div.charts { @for chart in charts { (figure(chart)) } }
            (phase_table(report, &outcomes, legend))
            (ray_table(&outcomes, legend))
            (choices(&outcomes, legend))
        }
    };
    Section { id, name: scene.to_owned(), content }
}

/// Each phase beside what a plain copy of the bytes that it must move would take.
fn phase_table(report: &Report, outcomes: &[&Outcome], legend: &Legend) -> Markup {
    struct Row<'o> {
        record: &'o Record,
        phase: &'o PhaseRecord,
        moved: Option<f64>,
    }
    let copy_gb_s = report.setting.device.as_ref().and_then(|d| d.copy_gb_s);
    let mut rows = Vec::new();
    for Outcome { record, traffic, .. } in outcomes {
        let moved = traffic.iter().map(|moved| moved.map(|bytes| bytes as f64));
        rows.extend(record.build.phases.iter().zip(moved).map(|(phase, moved)| Row { record, phase, moved }));
    }
    if rows.iter().all(|row| row.moved.is_none()) {
        return html! {};
    }
    let copy = move |row: &Row<'_>| Some(row.moved? / (copy_gb_s? * 1e6));
    let label = "Phases beside a plain copy";
    let table = Table::new(label, rows)
        .cell("builder", |row| named(row.record, legend))
        .text("phase", |row| &row.phase.name)
        .number("time", "ms", |row| Some(row.phase.median_ms), three_digits)
        .number("share", "%", |row| Some(100.0 * row.phase.median_ms / row.record.build.median_ms), whole)
        .number("must move", "", |row| row.moved, size)
        .number("rate", "GB/s", |row| Some(row.moved? / (row.phase.median_ms * 1e6)), three_digits)
        .number("copy takes", "ms", copy, three_digits)
        .number("phase / copy", "×", move |row| Some(row.phase.median_ms / copy(row)?), three_digits);
    html! {
        details {
            summary { (label) }
            p {
                "Bytes are the least that a phase must move: each input read once, each output written once. The last column says how many "
                "times longer the phase takes than a plain copy of them."
            }
            (table.html())
        }
    }
}

/// Speed, steps and tests for each kind of ray.
fn ray_table(outcomes: &[&Outcome], legend: &Legend) -> Markup {
    let Some(most) = outcomes.iter().max_by_key(|o| o.record.trace.len()).filter(|o| !o.record.trace.is_empty()) else {
        return html! {};
    };
    let label = "Speed, steps and tests for each kind of ray";
    let rows = outcomes.iter().map(|outcome| &outcome.record);
    let table = Table::new(label, rows).cell("builder", |record| named(record, legend));
    let table = most.record.trace.iter().fold(table, |table, kind| {
        table.figure(&kind.rays, &short_count(kind.count as f64), |record| ray_cell(record.rays(&kind.rays)))
    });
    html! {
        details {
            summary { (label) }
            p { "Million rays a second, and below it inner nodes visited and triangles tested a ray, where the tracer counts them." }
            (table.html())
        }
    }
}

fn ray_cell(trace: Option<&TraceRecord>) -> Markup {
    let Some(trace) = trace else { return number(None, three_digits) };
    html! {
        td.number data-value=(trace.mrays_s) {
            (three_digits(trace.mrays_s))
            @if let (Some(steps), Some(tests)) = (trace.steps, trace.tests) {
                small { (three_digits(steps)) " steps" br; (three_digits(tests)) " tests" }
            }
        }
    }
}

/// What the builders chose where they were left the choice; builders that chose the same stand together.
fn choices(outcomes: &[&Outcome], legend: &Legend) -> Markup {
    let chosen = distinct(outcomes.iter().filter_map(|outcome| outcome.choice.as_deref()));
    html! {
        @if !chosen.is_empty() {
            h3 { "Chosen for this scene and device" }
            ul.choices {
                @for choice in chosen {
                    li {
                        code { (choice) } " by "
                        @for (i, outcome) in outcomes.iter().filter(|o| o.choice.as_deref() == Some(choice)).enumerate() {
                            @if i > 0 { ", " }
                            (builder_name(&outcome.record, legend))
                        }
                    }
                }
            }
        }
    }
}

fn results(records: &[&Record], legend: &Legend) -> Markup {
    let greatest = |of: fn(&Record) -> Option<f64>| records.iter().filter_map(|r| of(r)).fold(0.0, f64::max);
    let (build_most, trace_most) = (greatest(|r| Some(r.mtris_s())), greatest(Record::mrays_s));
    let a_triangle = |record: &Record, total: Option<u64>| Some(total? as f64 / record.triangles as f64);
    let table = Table::new("Every builder on every scene", records.iter().copied())
        .id("results-table")
        .cell("scene", |record| {
            html! { th scope="row" data-value=(record.scene) { a href={ "#scene-" (slug(&record.scene)) } { (record.scene) } } }
        })
        .cell("builder", |record| html! { td data-value=(record.builder) { (builder_name(record, legend)) } })
        .number("triangles", "", |record| Some(record.triangles as f64), count)
        .number("build", "ms", |record| Some(record.build.median_ms), three_digits)
        .figure("min – max", "ms", |record| {
            let [min, max] = [record.build.min_ms, record.build.max_ms];
            html! { td.number.spread data-value=(max - min) { (three_digits(min)) " – " (three_digits(max)) } }
        })
        .figure("build speed", "Mtri/s", move |record| bar(Some(record.mtris_s()), build_most))
        .figure("trace speed", "Mrays/s", move |record| bar(record.mrays_s(), trace_most))
        .number("SAH cost", "", |record| record.quality.sah, three_digits)
        .number("EPO", "", |record| record.quality.epo, three_digits)
        .number("LCV", "", |record| record.quality.lcv, three_digits)
        .number("depth", "", |record| Some(record.quality.depth_max? as f64), whole)
        .number("leaf", "triangles", |record| record.quality.prims_per_leaf, two_decimals)
        .number("structure", "B/tri", move |record| a_triangle(record, record.memory.structure_bytes), one_decimal)
        .number("scratch", "B/tri", move |record| a_triangle(record, record.memory.scratch_bytes), one_decimal)
        .cell("right", |record| {
            let verdict = verdict(record.valid);
            html! { td .wrong[record.valid == Some(false)] data-value=(verdict) { (verdict) } }
        });
    html! {
        p {
            "One row a builder and scene; press a heading to sort. The same as "
            a href="results.csv" { "results.csv" } " and " a href="results.jsonl" { "results.jsonl" } ", where every figure is."
        }
        p.filter { label for="filter" { "Show rows with " } input #filter type="search" placeholder="a scene or builder" autocomplete="off"; }
        (table.html())
    }
}

fn terms(report: &Report) -> Markup {
    let longest = report.outcomes.iter().map(|o| o.record.build.median_ms).fold(0.0, f64::max);
    html! {
        dt { "Build time" }
        dd {
            "Median of several builds after a warm-up that does not count, from triangles in device memory to the finished tree; by the "
            "device's timestamps, or by the wall's clock for builders on the host. Builders run in turn, A B A B, so that a machine that "
            "slows down slows all of them. The longest here took " (duration(longest)) "."
        }
        dt { "Trace speed" }
        dd { "All rays of all kinds over the time of all, in million rays a second. Each kind by itself stands with its scene." }
        dt { "Kinds of rays" }
        dd {
            b { "primary" } " through the camera's pixels; from what they hit: " b { "shadow" } " to the lights, " b { "ao" }
            " four short rays around the normal, " b { "diffuse1" } " one cosine-weighted bounce and " b { "diffuse2" } " the next, "
            b { "reflection" } " the mirror direction; " b { "random" } " between points of the sphere around the scene."
        }
        dt { "SAH cost" }
        dd {
            "Expected work of a random ray: (3 · Σ area of inner nodes + 2 · Σ area × triangles of leaves) / area of the root. "
            "Lower is better, and only trees of the same scene compare."
        }
        dt { "EPO" }
        dd {
            "End-point overlap (Aila, Karras, Laine 2013): of all surface, what lies in a node's box and belongs to triangles of other "
            "subtrees, times what the node costs, summed over the nodes. Rays that end there visit the node in vain."
        }
        dt { "LCV" }
        dd {
            "Leaf count variability (the same): the standard deviation of the number of leaves that a " b { "diffuse1" }
            " ray visits. Rays that are traced side by side wait for the one that visits most."
        }
        dt { "Right" }
        dd {
            "The tree was walked on the host and every rule of its layout checked, a sample of every kind of ray hits what brute force "
            "finds, and where two builders' hits differ beyond a ten-thousandth of the distance, brute force is with this one."
        }
        dt { "Frontier" }
        dd { "The builders that no other beats at both figures of a chart." }
        dt { "Total time" }
        dd {
            "A build and the rays traced until the next one. If few rays are traced per build, a fast builder wins; if many, a "
            "good tree; the lower envelope says from how many rays on which is best."
        }
    }
}
