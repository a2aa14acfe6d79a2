//! Whether SAH and EPO order the times of rays.

use crate::experiments::cpu_builders::measured::OnScene;
use crate::experiments::cpu_builders::order::{Ordering, furthest_off, ordering};
use crate::measure::record::{QualityRecord, Record};
use crate::report::columns::Table;
use crate::report::names::short;
use crate::report::numbers::{two_decimals, whole};
use crate::subjects::retraced::TreeTracer;
use maud::{Markup, html};

/// What all kinds of rays together are called.
const ALL_RAYS: &str = "all";

/// A cost of a tree.
type Cost = fn(&QualityRecord) -> Option<f64>;
const SAH: Cost = |quality| quality.sah;
const EPO: Cost = |quality| quality.epo;

/// A kind of ray on a scene by a tracer.
struct Row<'r> {
    scene: &'r str,
    tracer: TreeTracer,
    kind: &'r str,
    builders: usize,
    by_sah: Option<Ordering>,
    by_epo: Option<Ordering>,
}

/// Time a ray, in nanoseconds.
fn time(record: &Record, kind: &str) -> Option<f64> {
    let mrays_s = if kind == ALL_RAYS { record.mrays_s() } else { record.rays(kind).map(|trace| trace.mrays_s) }?;
    Some(1e3 / mrays_s).filter(|time| time.is_finite())
}

/// The builders with a cost and a time.
fn both<'s>(scene: &'s OnScene<'_>, tracer: TreeTracer, kind: &str, cost: Cost) -> (Vec<&'s str>, Vec<f64>, Vec<f64>) {
    let of = |m: &'s crate::experiments::cpu_builders::measured::Measured<'_>| {
        Some((m.builder.as_str(), cost(m.quality()?)?, time(m.traced(tracer)?, kind)?))
    };
    let (mut names, mut costs, mut times) = (Vec::new(), Vec::new(), Vec::new());
    for (name, cost, time) in scene.builders.iter().filter_map(of) {
        names.push(name);
        costs.push(cost);
        times.push(time);
    }
    (names, costs, times)
}

fn rows<'s>(scenes: &'s [OnScene<'_>]) -> Vec<Row<'s>> {
    let mut rows = Vec::new();
    for scene in scenes {
        for tracer in TreeTracer::ALL {
            for kind in [ALL_RAYS].into_iter().chain(scene.kinds()) {
                let by = |cost: Cost| {
                    let (_, costs, times) = both(scene, tracer, kind, cost);
                    ordering(&costs, &times)
                };
                let builders = both(scene, tracer, kind, SAH).0.len();
                if builders > 1 {
                    rows.push(Row { scene: scene.scene, tracer, kind, builders, by_sah: by(SAH), by_epo: by(EPO) });
                }
            }
        }
    }
    rows
}

fn percent(share: Option<f64>) -> String {
    share.map_or_else(|| "–".into(), |share| format!("{:.0}%", 100.0 * share))
}

/// What a scene says, by a tracer: how well both costs order its builders, and where SAH is furthest off.
fn sentence(scene: &OnScene<'_>, tracer: TreeTracer) -> Option<String> {
    let (names, costs, times) = both(scene, tracer, ALL_RAYS, SAH);
    let by_sah = ordering(&costs, &times)?;
    let (_, epos, of_epos) = both(scene, tracer, ALL_RAYS, EPO);
    let by_epo = ordering(&epos, &of_epos).and_then(|found| found.share());
    let epo = by_epo.map_or_else(String::new, |share| format!(", EPO {}", percent(Some(share))));
    let off = match furthest_off(&costs, &times) {
        None => "SAH and speed agree everywhere.".to_owned(),
        Some((cheap, fast)) => format!(
            "They disagree most about {}: it costs {:.0}% less than {} by SAH, and takes {:.0}% longer a ray.",
            short(names[cheap]),
            100.0 * (1.0 - costs[cheap] / costs[fast]),
            short(names[fast]),
            100.0 * (times[cheap] / times[fast] - 1.0)
        ),
    };
    let (scene, share) = (scene.scene, percent(by_sah.share()));
    let pairs = if by_sah.pairs == 1 { "1 pair".to_owned() } else { format!("{} pairs", by_sah.pairs) };
    Some(format!("{scene}, {}: SAH orders {share} of {pairs} rightly{epo}. {off}", tracer.name()))
}

/// Both costs over all scenes and kinds of rays, by a tracer.
fn overall(rows: &[Row<'_>], tracer: TreeTracer) -> Option<String> {
    let share = |of: fn(&Row<'_>) -> Option<Ordering>| {
        let found: Vec<Ordering> =
            rows.iter().filter(|row| row.tracer == tracer && row.kind != ALL_RAYS).filter_map(of).collect();
        let pairs: usize = found.iter().map(|found| found.pairs).sum();
        let right: usize = found.iter().map(|found| found.right).sum();
        (pairs > 0).then(|| (pairs, right as f64 / pairs as f64))
    };
    let (pairs, by_sah) = share(|row| row.by_sah)?;
    let by_epo = share(|row| row.by_epo).map(|(_, share)| share);
    let epo = by_epo.map_or_else(String::new, |share| format!(", EPO {}", percent(Some(share))));
    Some(format!(
        "On the {}, over all scenes and kinds of rays, SAH orders {} of {pairs} pairs of builders rightly{epo}.",
        tracer.name(),
        percent(Some(by_sah))
    ))
}

pub(super) fn section(scenes: &[OnScene<'_>]) -> Markup {
    let rows = rows(scenes);
    if rows.is_empty() {
        return html! { p { "Two builders must be traced before anything has an order." } };
    }
    let of_scenes =
        scenes.iter().flat_map(|scene| TreeTracer::ALL.into_iter().filter_map(|tracer| sentence(scene, tracer)));
    let share = |found: Option<Ordering>| Some(100.0 * found?.share()?);
    let table = Table::new("How SAH and EPO order the times of rays", &rows)
        .id("order-table")
        .name("scene", |row| row.scene)
        .text("tracer", |row| row.tracer.name())
        .text("rays", |row| row.kind)
        .number("builders", "", |row| Some(row.builders as f64), whole)
        .number("pairs", "", |row| Some(row.by_sah?.pairs as f64), whole)
        .number("SAH", "% of pairs", move |row| share(row.by_sah), whole)
        .number("EPO", "% of pairs", move |row| share(row.by_epo), whole)
        .number("SAH", "rank correlation", |row| row.by_sah?.rank, two_decimals)
        .number("EPO", "rank correlation", |row| row.by_epo?.rank, two_decimals);
    html! {
        p { "A cost is worth what it says of speed: of two trees, the one that costs less shall be the faster one." }
        @for sentence in TreeTracer::ALL.into_iter().filter_map(|tracer| overall(&rows, tracer)) { p { b { (sentence) } } }
        ul { @for sentence in of_scenes { li { (sentence) } } }
        details { summary { "Each scene, tracer and kind of ray" } (table.html()) }
    }
}
