//! `index.html`: one file that opens from the disk, with style, script and charts inside; pictures lie beside it.

use super::summary::{self, Standing};
use super::{Picture, Report, SceneCharts};
use crate::experiments::bench::kd_trees;
use crate::experiments::bench::matrix::Outcome;
use crate::measure::record::{Record, Trace};
use crate::report::chart::Chart;
use crate::report::choosing;
use crate::report::elements::{bar, column, facts, figure, foot, head, measured_by, number};
use crate::report::names::{short, slug};
use crate::report::numbers::{bytes, duration, grouped, short_count, three_digits};
use crate::report::table::verdict;
use crate::report::theme::Legend;
use maud::{DOCTYPE, Markup, html};

/// The whole page.
///
/// `links` name the pages that lie beside it.
pub(super) fn page(
    report: &Report,
    legend: &Legend,
    scenes: &[SceneCharts],
    growth: Option<&Chart>,
    links: &Markup,
) -> String {
    let records = report.records();
    let markup = html! {
        (DOCTYPE)
        html lang="en" {
            (head(&format!("hedgerow: {} scenes, {} builders", scenes.len(), legend.builders().len())))
            body {
                a.skip href="#summary" { "Skip to the results" }
                (header(report, legend, scenes))
                (navigation(scenes, [!kd_trees::of(&records).is_empty(), !report.choices.is_empty(), growth.is_some()], links))
                main {
                    @if !report.failures.is_empty() || records.iter().any(|r| r.valid == Some(false)) { (failures(report)) }
                    (summary_section(report, &records, legend))
                    @for scene in scenes { (scene_section(report, scene, legend)) }
                    (kd_trees::section(&records, &report.published))
                    (choosing::section(&report.choices, &records))
                    @if let Some(chart) = growth { (growth_section(chart)) }
                    (results_section(&records, legend))
                    (method_section(report))
                }
                (foot(&report.commit, &report.when))
            }
        }
    };
    markup.into_string()
}

fn header(report: &Report, legend: &Legend, scenes: &[SceneCharts]) -> Markup {
    html! {
        header.hero {
            p.kicker { "hedgerow benchmark" }
            h1 { "Build speed against tree quality" }
            p.lead {
                (legend.builders().len()) " builders of acceleration structures on " (scenes.len())
                " scenes, built and traced in turn in one process; trees of ours validated on the host, a sample of every kind of ray checked against brute force."
            }
            (facts(&report.machine, report.device.as_ref(), [&report.commit, &report.when], &report.options))
            (measured_by(&report.command))
        }
    }
}

fn navigation(scenes: &[SceneCharts], [kd_trees, choosing, growth]: [bool; 3], links: &Markup) -> Markup {
    html! {
        nav aria-label="Sections" {
            a href="#summary" { "Summary" }
            @for scene in scenes { a href={ "#scene-" (slug(&scene.scene)) } { (scene.scene) } }
            @if kd_trees { a href="#kd-trees" { "kd-trees" } }
            @if choosing { a href="#choosing" { "Choosing" } }
            @if growth { a href="#growth" { "Growth" } }
            a href="#results" { "All figures" }
            a href="#method" { "How it is measured" }
            (links)
        }
    }
}

fn failures(report: &Report) -> Markup {
    let faulty = report.outcomes.iter().filter(|outcome| !outcome.faults.is_empty());
    html! {
        section.warning #failures {
            h2 { "What went wrong" }
            ul {
                @for failure in &report.failures {
                    li { b { (failure.scene) } @if let Some(builder) = &failure.builder { ", " code { (builder) } } ": " (failure.what) }
                }
                @for outcome in faulty {
                    li { b { (outcome.record.scene) } ", " code { (outcome.record.builder) } " is not right: " (outcome.faults.join("; ")) }
                }
            }
        }
    }
}

/// A builder's name with its colour, and where it works if not on the device by our shaders.
fn builder_name(builder: &str, record: Option<&Record>, legend: &Legend) -> Markup {
    let peer = record.and_then(|record| match (record.kind.as_str(), record.build.timer.as_str()) {
        ("driver", _) => Some("driver"),
        (_, "wall") => Some("host"),
        _ => None,
    });
    html! {
        span.builder title=(builder) {
            i.dot style={ "background:var(--" (legend.builder(builder).variable) ")" } {}
            (short(builder))
            @if let Some(peer) = peer { " " span.tag { (peer) } }
        }
    }
}

fn summary_section(report: &Report, records: &[&Record], legend: &Legend) -> Markup {
    let Some(baseline) = summary::baseline(legend, report.baseline.as_deref()) else {
        return html! { section #summary { h2 { "Summary" } p { "Nothing could be measured." } } };
    };
    let sah_baseline = summary::sah_baseline(records, baseline);
    let standings = summary::standings(records, legend, baseline);
    let most = |of: fn(&Standing) -> Option<f64>| standings.iter().filter_map(of).fold(0.0, f64::max);
    let (build_most, trace_most) = (most(|s| s.build), most(|s| s.trace));
    let first = |builder: &str| records.iter().find(|r| r.builder == builder).copied();
    html! {
        section #summary {
            h2 { "Summary" }
            p {
                "Every builder against " b { (short(baseline)) } ", which is 1: geometric means over the scenes that both have. "
                "Of speeds, more is better; of the SAH cost, less"
                @if let Some(other) = sah_baseline.filter(|b| *b != baseline) { " (against " b { (short(other)) } ")" }
                "."
            }
            @for note in &report.notes { p.note { (note) } }
            div.scroll tabindex="0" role="region" aria-label="Summary table" {
                table.sortable #summary-table {
                    caption.hidden { "Every builder against " (short(baseline)) }
                    thead { tr {
                        (column("builder", "", false)) (column("scenes", "", true)) (column("build speed", "×", true))
                        (column("trace speed", "×", true)) (column("SAH cost", "×", true))
                    } }
                    tbody {
                        @for standing in &standings {
                            tr {
                                th scope="row" data-value=(standing.builder) { (builder_name(&standing.builder, first(&standing.builder), legend)) }
                                (number(Some(standing.scenes as f64), |v| format!("{v:.0}")))
                                (bar(standing.build, build_most))
                                (bar(standing.trace, trace_most))
                                (number(standing.sah, |v| format!("{v:.3}")))
                            }
                        }
                    }
                }
            }
        }
    }
}

fn scene_section(report: &Report, scene: &SceneCharts, legend: &Legend) -> Markup {
    let outcomes: Vec<&Outcome> = report.outcomes.iter().filter(|o| o.record.scene == scene.scene).collect();
    let triangles = outcomes.first().map_or(0, |o| o.record.triangles);
    let pictures: Vec<&Picture> = report.pictures.iter().filter(|p| p.scene == scene.scene).collect();
    html! {
        section.scene #{ "scene-" (slug(&scene.scene)) } {
            h2 { (scene.scene) span.count { (grouped(triangles)) " triangles" } }
            @if !pictures.is_empty() {
                div.pictures {
                    @for picture in pictures {
                        figure { img src=(picture.file) alt=(picture.alt) loading="lazy"; figcaption { (picture.caption) } }
                    }
                }
            }
            div.charts { @for chart in &scene.charts { (figure(chart)) } }
            (phase_table(report, &outcomes, legend))
            (ray_table(&outcomes, legend))
            (choices(&outcomes, legend))
        }
    }
}

/// Each phase beside what a plain copy of the bytes that it must move would take.
fn phase_table(report: &Report, outcomes: &[&Outcome], legend: &Legend) -> Markup {
    let copy_gb_s = report.device.as_ref().and_then(|d| d.copy_gb_s);
    let rows: Vec<_> = outcomes
        .iter()
        .flat_map(|o| {
            o.record.build.phases.iter().zip(&o.traffic).map(move |(phase, moved)| (&o.record, phase, *moved))
        })
        .collect();
    if rows.iter().all(|(_, _, moved)| moved.is_none()) {
        return html! {};
    }
    html! {
        details {
            summary { "Phases beside a plain copy" }
            p {
                "Bytes are the least that a phase must move: each input read once, each output written once. The last column says how many "
                "times longer the phase takes than a plain copy of them."
            }
            div.scroll tabindex="0" role="region" aria-label="Phases beside a plain copy" {
                table.sortable {
                    thead { tr {
                        (column("builder", "", false)) (column("phase", "", false)) (column("time", "ms", true)) (column("share", "%", true))
                        (column("must move", "", true)) (column("rate", "GB/s", true)) (column("copy takes", "ms", true))
                        (column("phase / copy", "×", true))
                    } }
                    tbody {
                        @for (record, phase, moved) in rows {
                            @let moved = moved.map(|b| b as f64);
                            @let rate = moved.map(|b| b / (phase.median_ms * 1e6));
                            @let copy = moved.zip(copy_gb_s).map(|(b, rate)| b / (rate * 1e6));
                            tr {
                                th scope="row" data-value=(record.builder) { (builder_name(&record.builder, Some(record), legend)) }
                                td data-value=(phase.name) { (phase.name) }
                                (number(Some(phase.median_ms), three_digits))
                                (number(Some(100.0 * phase.median_ms / record.build.median_ms), |v| format!("{v:.0}")))
                                (number(moved, |b| bytes(b as u64)))
                                (number(rate, three_digits))
                                (number(copy, three_digits))
                                (number(copy.map(|c| phase.median_ms / c), three_digits))
                            }
                        }
                    }
                }
            }
        }
    }
}

/// Speed, steps and tests for each kind of ray.
fn ray_table(outcomes: &[&Outcome], legend: &Legend) -> Markup {
    let kinds: Vec<&Trace> =
        outcomes.iter().max_by_key(|o| o.record.trace.len()).map_or(vec![], |o| o.record.trace.iter().collect());
    if kinds.is_empty() {
        return html! {};
    }
    html! {
        details {
            summary { "Speed, steps and tests for each kind of ray" }
            p { "Million rays a second, and below it inner nodes visited and triangles tested a ray, where the tracer counts them." }
            div.scroll tabindex="0" role="region" aria-label="Speed, steps and tests for each kind of ray" {
                table.sortable {
                    thead { tr {
                        (column("builder", "", false))
                        @for kind in &kinds { (column(&kind.rays, &short_count(kind.count as f64), true)) }
                    } }
                    tbody {
                        @for outcome in outcomes {
                            @let record = &outcome.record;
                            tr {
                                th scope="row" data-value=(record.builder) { (builder_name(&record.builder, Some(record), legend)) }
                                @for kind in &kinds { (ray_cell(record.rays(&kind.rays))) }
                            }
                        }
                    }
                }
            }
        }
    }
}

fn ray_cell(trace: Option<&Trace>) -> Markup {
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
    let mut chosen: Vec<(&str, Vec<&Record>)> = Vec::new();
    for outcome in outcomes {
        let Some(choice) = outcome.choice.as_deref() else { continue };
        match chosen.iter_mut().find(|(known, _)| *known == choice) {
            Some((_, records)) => records.push(&outcome.record),
            None => chosen.push((choice, vec![&outcome.record])),
        }
    }
    html! {
        @if !chosen.is_empty() {
            h3 { "Chosen for this scene and device" }
            ul.choices {
                @for (choice, records) in chosen {
                    li {
                        code { (choice) } " by "
                        @for (i, record) in records.iter().enumerate() {
                            @if i > 0 { ", " }
                            (builder_name(&record.builder, Some(record), legend))
                        }
                    }
                }
            }
        }
    }
}

fn growth_section(chart: &Chart) -> Markup {
    html! {
        section #growth {
            h2 { "How build time grows" }
            div.charts.single { (figure(chart)) }
        }
    }
}

fn results_section(records: &[&Record], legend: &Legend) -> Markup {
    let greatest = |of: fn(&Record) -> Option<f64>| records.iter().filter_map(|r| of(r)).fold(0.0, f64::max);
    let (build_most, trace_most) = (greatest(|r| Some(r.mtris_s())), greatest(Record::mrays_s));
    let a_triangle = |record: &Record, total: Option<u64>| total.map(|b| b as f64 / record.triangles as f64);
    html! {
        section #results {
            h2 { "All figures" }
            p {
                "One row a builder and scene; press a heading to sort. The same as "
                a href="results.csv" { "results.csv" } " and " a href="results.jsonl" { "results.jsonl" } ", where every figure is."
            }
            p.filter { label for="filter" { "Show rows with " } input #filter type="search" placeholder="a scene or builder" autocomplete="off"; }
            div.scroll tabindex="0" role="region" aria-label="All figures" {
                table.sortable #results-table {
                    caption.hidden { "Every builder on every scene" }
                    thead { tr {
                        (column("scene", "", false)) (column("builder", "", false)) (column("triangles", "", true))
                        (column("build", "ms", true)) (column("min – max", "ms", true)) (column("build speed", "Mtri/s", true))
                        (column("trace speed", "Mrays/s", true)) (column("SAH cost", "", true)) (column("EPO", "", true)) (column("LCV", "", true)) (column("depth", "", true))
                        (column("leaf", "triangles", true)) (column("structure", "B/tri", true)) (column("scratch", "B/tri", true))
                        (column("right", "", false))
                    } }
                    tbody {
                        @for record in records {
                            tr {
                                th scope="row" data-value=(record.scene) { a href={ "#scene-" (slug(&record.scene)) } { (record.scene) } }
                                td data-value=(record.builder) { (builder_name(&record.builder, Some(record), legend)) }
                                (number(Some(record.triangles as f64), |v| grouped(v as u64)))
                                (number(Some(record.build.median_ms), three_digits))
                                td.number.spread data-value=(record.build.max_ms - record.build.min_ms) {
                                    (three_digits(record.build.min_ms)) " – " (three_digits(record.build.max_ms))
                                }
                                (bar(Some(record.mtris_s()), build_most))
                                (bar(record.mrays_s(), trace_most))
                                (number(record.quality.sah, three_digits))
                                (number(record.quality.epo, three_digits))
                                (number(record.quality.lcv, three_digits))
                                (number(record.quality.depth_max.map(|d| d as f64), |v| format!("{v:.0}")))
                                (number(record.quality.prims_per_leaf, |v| format!("{v:.2}")))
                                (number(a_triangle(record, record.memory.structure_bytes), |v| format!("{v:.1}")))
                                (number(a_triangle(record, record.memory.scratch_bytes), |v| format!("{v:.1}")))
                                td .wrong[record.valid == Some(false)] data-value=(verdict(record.valid)) { (verdict(record.valid)) }
                            }
                        }
                    }
                }
            }
        }
    }
}

fn method_section(report: &Report) -> Markup {
    let longest = report.outcomes.iter().map(|o| o.record.build.median_ms).fold(0.0, f64::max);
    html! {
        section #method {
            h2 { "How it is measured" }
            dl.terms {
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
            p { "Figures of different machines do not compare." }
        }
    }
}
