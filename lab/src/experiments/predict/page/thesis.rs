//! Correlations of the thesis' own figures, which it does not print, beside those measured here.

use super::tables::{self, interval, matrix, rows};
use super::{kinds, scenes, tracers};
use crate::experiments::predict::published::{self, OUTLIER, SOURCE};
use crate::experiments::predict::samples::{Sample, Scope};
use crate::measure::correlation::Correlation;
use crate::report::Table;
use crate::report::numbers::{two_decimals, whole};
use crate::subjects::retraced::TreeTracer;
use maud::{Markup, html};

/// What was found of one predictor by the thesis' figures, and by ours.
struct Row {
    name: &'static str,
    theirs: Correlation,
    ours: Vec<Option<Correlation>>,
}

pub(super) fn section(samples: &[Sample]) -> Markup {
    let theirs = published::samples();
    let pooled = Scope::pooled(TreeTracer::Host);
    let ours: Vec<(TreeTracer, Vec<tables::Row>)> =
        tracers(samples).map(|tracer| (tracer, rows(samples, Scope::pooled(tracer)))).collect();
    let row = |(predictor, found): tables::Row| {
        let correlation = |(_, rows): &(TreeTracer, Vec<tables::Row>)| {
            rows.iter().find(|row| row.0.name == predictor.name).map(|row| row.1.correlation)
        };
        Row { name: predictor.name, theirs: found.correlation, ours: ours.iter().map(correlation).collect() }
    };
    let all: Vec<Row> = rows(&theirs, pooled).into_iter().map(row).collect();
    let mut table = Table::new("The thesis beside ours", &all)
        .name("figure", |row| row.name)
        .number("r", "thesis", |row| row.theirs.pearson, two_decimals)
        .text("95%", |row| interval(&row.theirs))
        .number("ρ", "thesis", |row| row.theirs.spearman, two_decimals)
        .number("n", "thesis", |row| Some(row.theirs.n as f64), whole);
    for (at, (tracer, _)) in ours.iter().enumerate() {
        table = table.number("r", tracer.name(), move |row| row.ours[at]?.pearson, two_decimals).number(
            "n",
            tracer.name(),
            move |row| Some(row.ours[at]?.n as f64),
            whole,
        );
    }
    let scope_of = |scene| Scope { scene: Some(scene), ..pooled };
    let by_scene: Vec<(String, Scope<'_>)> =
        scenes(&theirs).into_iter().map(|scene: &str| (scene.to_owned(), scope_of(scene))).collect();
    let by_kind: Vec<(String, Scope<'_>)> = kinds(&theirs, TreeTracer::Host)
        .into_iter()
        .map(|kind: &str| (kind.to_owned(), Scope { kind, ..pooled }))
        .collect();
    html! {
        p {
            (SOURCE) " prints times, steps, tests, SAH and EPO of five trees on eight scenes, and no correlation. These are computed from its "
            "static scenes as ours are, without the trees of " (OUTLIER) ": one tree that takes up to 29 times as long makes any correlation."
        }
        p { "Its machine, tracer, rays and meshes are others: compare what stands above what, not figure with figure." }
        (table.html())
        h3 { "The thesis by kind of ray" }
        (matrix("The thesis by kind of ray".into(), "rays", &theirs, &by_kind))
        h3 { "The thesis by scene" }
        p { "Five trees a scene: in brackets is what says nothing." }
        (matrix("The thesis by scene".into(), "scene", &theirs, &by_scene))
    }
}
