//! The section of binning over λ.

use super::Part;
use crate::Result;
use crate::experiments::codes::published;
use crate::experiments::codes::tables::{Sweeps, lambda, signed};
use crate::measure::Spread;
use crate::report::elements::number;
use crate::report::numbers::{tick, two_decimals};
use crate::report::{Axis, Caption, Chart, Curve, SERIES, Section, Table, curves, document};
use maud::{Markup, html};

pub(super) fn part(sweeps: &Sweeps<'_>) -> Result<Option<Part>> {
    if sweeps.0.is_empty() {
        return Ok(None);
    }
    let charts: Vec<Chart> = sweeps
        .kinds()
        .into_iter()
        .map(|kind| chart(sweeps, kind))
        .collect::<Result<Vec<_>>>()?
        .into_iter()
        .flatten()
        .collect();
    let base = &sweeps.0[0].base;
    let body = html! {
        p {
            "Trees by binning, of each weight λ that the tables of the thesis have, beside those of " code { (base) } ". Changes in percent: of "
            "speed, more is faster; of SAH cost and work, less is cheaper."
        }
        (document::charts(&charts))
        h3 { "SAH cost" }
        (figures(sweeps, "SAH cost over λ", |scene, stretch| sweeps.sah_percent(scene, stretch)))
        @for kind in sweeps.kinds() {
            h3 { "Work of " (kind) " rays" }
            @let label = format!("Work of {kind} rays over λ");
            (figures(sweeps, &label, |scene, stretch| sweeps.work_percent(scene, stretch, kind)))
            h3 { "Speed of " (kind) " rays" }
            (speeds(sweeps, kind))
        }
    };
    Ok(Some((Section::new("sweep", "Binning over λ", body), charts)))
}

/// Speed over the base's, a curve a scene.
fn chart(sweeps: &Sweeps<'_>, kind: &str) -> Result<Option<Chart>> {
    let ratio = |percent: f64| 1.0 + percent / 100.0;
    let point = |scene: &str, stretch: u32| {
        let Spread { median, min, max, runs } = sweeps.rays(scene, stretch, kind)?.change_percent;
        Some((f64::from(stretch), Spread { median: ratio(median), min: ratio(min), max: ratio(max), runs }))
    };
    let curve = |(i, scene): (usize, &str)| Curve {
        name: scene.to_owned(),
        tone: SERIES[i % SERIES.len()],
        points: sweeps.stretches().into_iter().filter_map(|stretch| point(scene, stretch)).collect(),
        law: None,
    };
    let all: Vec<Curve> = sweeps.scenes().into_iter().enumerate().map(curve).filter(|c| !c.points.is_empty()).collect();
    let caption = Caption {
        name: format!("codes-sweep-{kind}"),
        title: format!("{kind} rays through trees by binning, over 1/λ"),
        alt: format!("Speed over that of the base for {}.", sweeps.scenes().join(", ")),
        reading: "Both axes are logarithmic. At 1 rays are as fast as through the base's tree; on the left squareness alone counts, on the \
                  right cost alone."
            .into(),
    };
    curves::curves(
        caption,
        &all,
        &Axis { name: "1/λ", is_log: true, number: tick },
        &Axis { name: "speed over the base's", is_log: true, number: two_decimals },
    )
}

/// A table of figures without noise, in percent.
fn figures(sweeps: &Sweeps<'_>, label: &str, of: impl Fn(&str, u32) -> Option<f64> + Copy) -> Markup {
    let mut table = Table::new(label, sweeps.scenes()).name("scene", |scene| *scene);
    for stretch in sweeps.stretches() {
        table = table.number(&lambda(stretch), "%", move |scene| of(scene, stretch), signed);
    }
    table.with_context(mean(sweeps, of).into_iter())
}

fn speeds(sweeps: &Sweeps<'_>, kind: &str) -> Markup {
    let spread = |scene: &str, stretch| Some(sweeps.rays(scene, stretch, kind)?.change_percent);
    let label = format!("Speed of {kind} rays over λ");
    let mut table = Table::new(label, sweeps.scenes()).name("scene", |scene| *scene);
    for stretch in sweeps.stretches() {
        table = table.spread(&lambda(stretch), "%", move |scene| spread(scene, stretch), signed);
    }
    let games = published::games(kind).into_iter().map(|(game, by_stretch)| {
        let figures = sweeps.stretches().into_iter().map(|stretch| by_stretch.get(&stretch).copied()).collect();
        context(&format!("{game} (Riemersma 2024)"), figures)
    });
    table.with_context(mean(sweeps, |scene, stretch| Some(spread(scene, stretch)?.median)).into_iter().chain(games))
}

/// The mean over the scenes, where there are several.
fn mean(sweeps: &Sweeps<'_>, figure: impl Fn(&str, u32) -> Option<f64>) -> Option<Markup> {
    let figures = sweeps.stretches().into_iter().map(|stretch| sweeps.mean(stretch, &figure)).collect();
    (sweeps.scenes().len() > 1).then(|| context("mean", figures))
}

/// A row below the others.
fn context(name: &str, figures: Vec<Option<f64>>) -> Markup {
    html! { th scope="row" { (name) } @for figure in figures { (number(figure, signed)) } }
}
