//! A scene: its charts, its trees, their builds, and their rays.

use super::charts::tone;
use crate::experiments::cpu_builders::measured::{Measured, OnScene};
use crate::measure::record::{BuildRecord, Record};
use crate::report::chart::Chart;
use crate::report::columns::Table;
use crate::report::document::{Section, charts};
use crate::report::elements::number;
use crate::report::names::{short, slug};
use crate::report::numbers::{grouped, one_decimal, size, three_digits, two_decimals, whole};
use crate::subjects::retraced::TreeTracer;
use maud::{Markup, html};

/// The charts that stand open: SAH, EPO, and all rays by both tracers; the others are folded.
const OPEN: [&str; 4] = ["sah", "epo", "all-rays-host", "all-rays-device"];

pub(super) fn section(scene: &OnScene<'_>, all: &[Chart]) -> Section {
    let prefix = format!("cpu-{}-", slug(scene.scene));
    let is_open = |chart: &&Chart| OPEN.contains(&chart.caption.name.trim_start_matches(&prefix));
    let is_phases = |chart: &&Chart| chart.caption.name.ends_with("-phases");
    let pick = |which: &dyn Fn(&&Chart) -> bool| all.iter().filter(which).cloned().collect::<Vec<_>>();
    let by_kind = pick(&|chart| !is_open(chart) && !is_phases(chart));
    let phases = pick(&is_phases);
    let content = html! {
        section.scene #{ "scene-" (slug(scene.scene)) } {
            h2 { (scene.scene) span.count { (grouped(scene.triangles)) " triangles" } }
            (charts(&pick(&is_open)))
            (trees(scene))
            h3 { "Builds" }
            (builds(scene))
            @if !phases.is_empty() { details { summary { "Where build time goes" } (charts(&phases)) (phase_table(scene)) } }
            (rays(scene))
            @if !by_kind.is_empty() { details { summary { "Build time against each kind of ray" } (charts(&by_kind)) } }
        }
    };
    Section { id: format!("scene-{}", slug(scene.scene)), name: scene.scene.to_owned(), content }
}

/// The cell that names a row by its builder.
pub(super) fn named(builder: &str) -> Markup {
    html! {
        th scope="row" data-value=(builder) {
            span.builder title=(builder) { i.dot style={ "background:var(--" (tone(builder).variable) ")" } {} (short(builder)) }
        }
    }
}

/// A table with a row a builder.
fn table<'s, 'r>(label: String, scene: &'s OnScene<'r>) -> Table<'s, &'s Measured<'r>> {
    Table::new(label, &scene.builders).cell("builder", |measured| named(&measured.builder))
}

fn trees(scene: &OnScene<'_>) -> Markup {
    table(format!("Trees of {}", scene.scene), scene)
        .number("SAH", "", |m| m.quality()?.sah, one_decimal)
        .number("Σ inner", "", |m| m.quality()?.sah_inner, two_decimals)
        .number("Σ leaf", "", |m| m.quality()?.sah_leaf, two_decimals)
        .number("references", "a leaf", |m| m.quality()?.prims_per_leaf, two_decimals)
        .number("EPO", "", |m| m.quality()?.epo, two_decimals)
        .number("build", "ms, one thread", |m| m.one_thread_ms(), three_digits)
        .number("build", "ms, all threads", |m| m.build_ms(), three_digits)
        .number("rays", "million/s, host", |m| m.traced(TreeTracer::Host)?.mrays_s(), three_digits)
        .number("rays", "million/s, device", |m| m.traced(TreeTracer::Device)?.mrays_s(), three_digits)
        .html()
}

fn builds(scene: &OnScene<'_>) -> Markup {
    let triangles = scene.triangles as f64;
    let build = |m: &Measured<'_>| m.own().map(|record| (&record.build).into());
    let one_thread = |m: &Measured<'_>| m.one_thread().map(|record| (&record.build).into());
    let cpu = |record: Option<&Record>| record.and_then(|record| record.build.cpu_median_ms);
    table(format!("Builds of {}", scene.scene), scene)
        .spread("one thread", "ms", move |m| one_thread(m), three_digits)
        .spread("all threads", "ms", move |m| build(m), three_digits)
        .number("all over one", "%", |m| Some(100.0 * m.build_ms()? / m.one_thread_ms()?), whole)
        .number("threads", "", |m| m.own()?.build.threads.map(f64::from), whole)
        .number("CPU time", "ms, all threads", move |m| cpu(m.own()), three_digits)
        .number("speed", "Mtri/s", |m| Some(m.own()?.mtris_s()), three_digits)
        .number("structure", "B/tri", move |m| Some(m.own()?.memory.structure_bytes? as f64 / triangles), one_decimal)
        .number("scratch", "B/tri", move |m| Some(m.own()?.memory.scratch_bytes? as f64 / triangles), one_decimal)
        .number("peak", "", |m| Some(m.own()?.memory.peak_bytes? as f64), size)
        .html()
}

fn phase_table(scene: &OnScene<'_>) -> Markup {
    let in_words = |build: &BuildRecord| {
        let phases = build.phases.iter().map(|phase| format!("{} {}", phase.name, three_digits(phase.median_ms)));
        phases.collect::<Vec<_>>().join(" · ")
    };
    let cell = move |record: Option<&Record>| record.map_or_else(String::new, |record| in_words(&record.build));
    table(format!("Phases of builds of {}", scene.scene), scene)
        .text("one thread, ms", move |m| cell(m.one_thread()))
        .text("all threads, ms", move |m| cell(m.own()))
        .html()
}

/// Speed, steps and tests of each kind of ray by our tracers, and speed by those of peers.
fn rays(scene: &OnScene<'_>) -> Markup {
    let kinds = scene.kinds();
    if kinds.is_empty() {
        return html! {};
    }
    let by = |tracer: TreeTracer| {
        let table = table(format!("Rays through the trees of {}, {}", scene.scene, tracer.name()), scene);
        kinds.iter().fold(table, |table, &kind| table.figure(kind, "", move |m| cell(m, tracer, kind))).html()
    };
    let is_traced = |tracer| scene.builders.iter().any(|m| m.traced(tracer).is_some());
    html! {
        details {
            summary { "Speed, steps and tests of each kind of ray" }
            p { "Million rays a second, and below it inner nodes visited and triangles tested a ray." }
            @for tracer in TreeTracer::ALL.into_iter().filter(|&tracer| is_traced(tracer)) {
                h3 { "Our tracer on the " (tracer.name()) }
                (by(tracer))
            }
        }
    }
}

fn cell(measured: &Measured<'_>, tracer: TreeTracer, kind: &str) -> Markup {
    let Some(trace) = measured.rays(tracer, kind) else { return number(None, three_digits) };
    html! {
        td.number data-value=(trace.mrays_s) {
            (three_digits(trace.mrays_s))
            @if let (Some(steps), Some(tests)) = (trace.steps, trace.tests) {
                small { (three_digits(steps)) " steps" br; (three_digits(tests)) " tests" }
            }
        }
    }
}
