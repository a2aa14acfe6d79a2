//! Our builders on the host beside those of others, in one table.

use super::scenes::named;
use crate::experiments::cpu_builders::measured::{Measured, OnScene};
use crate::measure::record::{Record, TraceRecord};
use crate::report::columns::Table;
use crate::report::names::slug;
use crate::report::numbers::{one_decimal, three_digits, two_decimals};
use crate::subjects::retraced::TreeTracer;
use maud::{Markup, html};

/// Ours: presets for whoever wants one, and what they stand on.
const OURS: [&str; 5] = ["host-fast", "host-best", "aac-fast", "binned", "sweep"];

/// A mean over all rays of all kinds; `None` where a kind has none.
fn mean(record: Option<&Record>, of: fn(&TraceRecord) -> Option<f64>) -> Option<f64> {
    let traces = &record?.trace;
    let rays: f64 = traces.iter().map(|trace| trace.count as f64).sum();
    let sum: Option<f64> = traces.iter().map(|trace| Some(trace.count as f64 * of(trace)?)).sum();
    Some(sum? / rays).filter(|mean| mean.is_finite())
}

/// The record in which steps and tests are counted: our tracer's, wherever it worked.
fn counted<'r>(measured: &Measured<'r>) -> Option<&'r Record> {
    TreeTracer::ALL.into_iter().find_map(|tracer| measured.traced(tracer))
}

pub(super) fn section(scenes: &[OnScene<'_>]) -> Markup {
    let is_shown = |m: &&Measured<'_>| m.is_peer() || OURS.contains(&m.builder.as_str());
    let rows: Vec<(&str, &Measured<'_>)> = scenes
        .iter()
        .flat_map(|scene| scene.builders.iter().filter(is_shown).map(|measured| (scene.scene, measured)))
        .collect();
    let has_peers = rows.iter().any(|(_, measured)| measured.is_peer());
    let table = Table::new("Builders on the host beside peers", &rows)
        .id("peers-table")
        .cell("builder", |(_, measured)| named(&measured.builder))
        .cell("scene", |(scene, _)| html! { td data-value=(scene) { a href={ "#scene-" (slug(scene)) } { (scene) } } })
        .number("build", "Mtri/s", |(_, m)| Some(m.own()?.mtris_s()), three_digits)
        .number("SAH", "", |(_, m)| m.quality()?.sah, one_decimal)
        .number("EPO", "", |(_, m)| m.quality()?.epo, two_decimals)
        .number("steps", "a ray", |(_, m)| mean(counted(m), |trace| trace.steps), three_digits)
        .number("tests", "a ray", |(_, m)| mean(counted(m), |trace| trace.tests), three_digits)
        .number(
            "rays",
            "million/s, peer's tracer",
            |(_, m)| m.own().filter(|_| m.has_own_tracer())?.mrays_s(),
            three_digits,
        )
        .number("rays", "million/s, our host", |(_, m)| m.traced(TreeTracer::Host)?.mrays_s(), three_digits)
        .number("rays", "million/s, our device", |(_, m)| m.traced(TreeTracer::Device)?.mrays_s(), three_digits);
    html! {
        p {
            "Ours are " (OURS.join(", ")) ", as far as they were measured. Steps, tests and speeds are means over all rays of all kinds. Our "
            "tracers take rays through the trees of peers that show them; a peer's own tracer counts no steps."
        }
        @if !has_peers {
            p.note {
                "No peer was measured. obvhs and Embree are in builds with the features " code { "peer-obvhs" } " and " code { "peer-embree" } "."
            }
        }
        (table.html())
    }
}
