//! The section of what codes add to a build.

use super::Part;
use crate::Result;
use crate::experiments::codes::points::AddedTime;
use crate::experiments::codes::published;
use crate::experiments::codes::tables::{AddedTimes, signed};
use crate::measure::Spread;
use crate::report::elements::number;
use crate::report::numbers::{tick, two_decimals, whole};
use crate::report::{Axis, Caption, Chart, Curve, SERIES, Section, Table, curves, document};
use hedgerow::bvh::codes::{Code, Codes};
use maud::{Markup, html};

pub(super) fn part(added: &AddedTimes<'_>) -> Result<Option<Part>> {
    if added.0.is_empty() {
        return Ok(None);
    }
    let charts = Vec::from_iter(chart(added)?);
    let base = &added.0[0].base;
    let body = html! {
        p {
            "What a build takes longer with other codes than with those of " code { (base) } ", in percent. In brackets what table 7 of the "
            "thesis has for the same thing."
        }
        (document::charts(&charts))
        (every_code(added))
    };
    Ok(Some((Section::new("added-time", "Time added to a build", body), charts)))
}

/// Of binning, by the bits of its counts: a curve for each depth of the splits, ours and the thesis'.
fn chart(added: &AddedTimes<'_>) -> Result<Option<Chart>> {
    let binnings = added.codes().into_iter().filter_map(|name| match name.parse::<Codes>().ok()?.code {
        Code::Bin(binning) => Some((name, binning)),
        _ => None,
    });
    let binnings: Vec<_> = binnings.collect();
    let times = |percent: f64| 1.0 + percent / 100.0;
    let mut all = Vec::new();
    for (i, depth) in [2, 4, 6].into_iter().enumerate() {
        let own = || binnings.iter().filter(|(_, binning)| binning.depth() == depth);
        let ours = own().filter_map(|(name, binning)| {
            let of_codes = |a: &&&AddedTime| a.codes == **name;
            let medians: Vec<f64> = added.0.iter().filter(of_codes).map(|a| times(a.added_percent.median)).collect();
            let spread = Spread::of(&medians)?;
            Some((f64::from(binning.count_bits()), Spread { median: times(added.mean(name)?), ..spread }))
        });
        let theirs = own().filter_map(|(name, binning)| {
            Some((f64::from(binning.count_bits()), Spread::once(times(published::mean_added_percent(name)?))))
        });
        let (ours, theirs): (Vec<_>, Vec<_>) = (ours.collect(), theirs.collect());
        for (whose, points, tone) in [("", ours, 2 * i), (", Riemersma 2024", theirs, 2 * i + 1)] {
            let name = format!("depth {depth}{whose}");
            all.push(Curve { name, tone: SERIES[tone % SERIES.len()], points, law: None });
        }
    }
    all.retain(|curve| !curve.points.is_empty());
    let caption = Caption {
        name: "codes-added-time".into(),
        title: "Build with binning over one with the base's codes".into(),
        alt: "Over the bits of counts, a curve for each depth of the splits, ours and those of table 7.".into(),
        reading: "Points are means over the scenes, with the least and greatest of them.".into(),
    };
    curves::curves(
        caption,
        &all,
        &Axis { name: "bits of a count", is_log: false, number: tick },
        &Axis { name: "build time over the base's", is_log: false, number: two_decimals },
    )
}

fn every_code(added: &AddedTimes<'_>) -> Markup {
    let mut table = Table::new("Time added by every code", added.codes())
        .id("added-time-table")
        .cell("codes", |codes| html! { th scope="row" data-value=(codes) { code { (codes) } } })
        .figure("mean", "%", |codes| cell(added.mean(codes), None, published::mean_added_percent(codes)));
    for scene in added.scenes() {
        table = table.figure(scene, "%", move |codes| {
            let spread = added.at(scene, codes).map(|added| added.added_percent);
            cell(spread.map(|s| s.median), spread, published::added_percent(scene, codes))
        });
    }
    table.html()
}

/// A figure, its spread below, and the thesis' in brackets.
fn cell(ours: Option<f64>, spread: Option<Spread>, theirs: Option<f64>) -> Markup {
    let Some(ours) = ours else { return number(None, signed) };
    html! {
        td.number data-value=(ours) {
            (signed(ours))
            @if let Some(Spread { min, max, .. }) = spread { small { (signed(min)) " – " (signed(max)) } }
            @if let Some(theirs) = theirs { small { "(" (whole(theirs)) ")" } }
        }
    }
}
