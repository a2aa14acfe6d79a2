//! The summary: every builder over `sweep`, geometric means over the scenes that have both.

use super::with_base;
use crate::experiments::cpu_builders::choice::BASE;
use crate::experiments::cpu_builders::measured::{Measured, OnScene};
use crate::measure::geometric_mean;
use crate::report::columns::Table;
use crate::report::elements::{bar, number};
use crate::report::names::{distinct, short};
use crate::report::numbers::{two_decimals, whole};
use crate::subjects::retraced::TreeTracer;
use maud::{Markup, html};

/// A figure of a builder on a scene.
type Of = fn(&Measured<'_>) -> Option<f64>;

/// A builder over the base.
struct Row<'r> {
    builder: &'r str,
    scenes: usize,
    figures: [Option<f64>; 6],
}

/// Build speed by all threads and by one, SAH, EPO, and speed of rays on the host and on the device.
const FIGURES: [Of; 6] = [
    |m| Some(1.0 / m.build_ms()?),
    |m| Some(1.0 / m.one_thread_ms()?),
    |m| m.quality()?.sah,
    |m| m.quality()?.epo,
    |m| m.traced(TreeTracer::Host)?.mrays_s(),
    |m| m.traced(TreeTracer::Device)?.mrays_s(),
];

fn rows<'s>(scenes: &'s [OnScene<'_>]) -> Vec<Row<'s>> {
    let builders = distinct(scenes.iter().flat_map(|scene| scene.builders.iter().map(|m| m.builder.as_str())));
    let row = |builder| {
        let both: Vec<_> = with_base(scenes).filter_map(|(scene, base)| Some((scene.of(builder)?, base))).collect();
        let ratio = |of: Of| geometric_mean(both.iter().filter_map(|(measured, base)| Some(of(measured)? / of(base)?)));
        Row { builder, scenes: both.len(), figures: FIGURES.map(ratio) }
    };
    builders.into_iter().map(row).collect()
}

pub(super) fn section(scenes: &[OnScene<'_>], notes: &[String]) -> Markup {
    if scenes.is_empty() {
        return html! { @for note in notes { p.note { (note) } } p { "Nothing could be measured." } };
    }
    let rows = rows(scenes);
    let most = |i: usize| rows.iter().filter_map(|row| row.figures[i]).fold(0.0, f64::max);
    let greatest: [f64; 6] = std::array::from_fn(most);
    let speed = move |i: usize| move |row: &&Row<'_>| bar(row.figures[i], greatest[i]);
    let ratio = |i: usize| move |row: &&Row<'_>| number(row.figures[i], |v| format!("{v:.3}"));
    let mut table = Table::new(format!("Every builder over {BASE}"), &rows)
        .id("summary-table")
        .cell(
            "builder",
            |row| html! { th scope="row" data-value=(row.builder) title=(row.builder) { (short(row.builder)) } },
        )
        .number("scenes", "", |row| Some(row.scenes as f64), whole)
        .figure("build speed", "×, all threads", speed(0));
    // A column without a figure says nothing.
    if greatest[1] > 0.0 {
        table = table.figure("build speed", "×, one thread", speed(1));
    }
    table = table.figure("SAH", "×", ratio(2)).figure("EPO", "×", ratio(3)).figure("rays", "×, host", speed(4));
    if greatest[5] > 0.0 {
        table = table.figure("rays", "×, device", speed(5));
    }
    html! {
        p {
            "Every builder over " b { (BASE) } ", which is 1: geometric means over the scenes that both have. Of speeds more is better, of "
            "SAH and EPO less. Rays are those of all kinds together."
        }
        @for note in notes { p.note { (note) } }
        (table.html())
        @if let Some(sentence) = best(&rows) { p { (sentence) } }
    }
}

/// Which builders lead, in a sentence.
fn best(rows: &[Row<'_>]) -> Option<String> {
    let greatest = |i: usize| {
        let with = rows.iter().filter_map(|row| Some((row.builder, row.figures[i]?)));
        with.max_by(|a, b| a.1.total_cmp(&b.1))
    };
    let least_sah =
        rows.iter().filter_map(|row| Some((row.builder, row.figures[2]?))).min_by(|a, b| a.1.total_cmp(&b.1))?;
    let (fast, rays) = (greatest(0)?, greatest(5).or(greatest(4))?);
    Some(format!(
        "Fastest to build is {} ({} × {BASE}). The least SAH has {} ({} ×). Rays are fastest through the trees of {} ({} ×).",
        short(fast.0),
        two_decimals(fast.1),
        short(least_sah.0),
        two_decimals(least_sah.1),
        short(rays.0),
        two_decimals(rays.1)
    ))
}
