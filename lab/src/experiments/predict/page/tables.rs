//! Correlations as tables: over all scenes, by kind of ray, and by scene.

use super::{kinds, scenes, tracers};
use crate::experiments::predict::found::{Found, found};
use crate::experiments::predict::predictor::{self, Predictor};
use crate::experiments::predict::samples::{Sample, Scope};
use crate::measure::correlation::Correlation;
use crate::report::Table;
use crate::report::elements::number;
use crate::report::numbers::{two_decimals, whole};
use crate::subjects::retraced::TreeTracer;
use maud::{Markup, html};

/// A predictor with what was found of it.
pub(super) type Row = (&'static Predictor, Found);

/// All predictors that say something over a scope.
pub(super) fn rows(samples: &[Sample], scope: Scope<'_>) -> Vec<Row> {
    let points = scope.points(samples);
    let all = predictor::ALL.iter().map(|predictor| (predictor, found(predictor, &points)));
    all.filter(|(_, found)| found.correlation.n > 1).collect()
}

/// The one that goes with time best.
fn best(rows: &[Row], is_wanted: impl Fn(&Predictor) -> bool) -> Option<&Row> {
    let r = |row: &Row| row.1.correlation.pearson.unwrap_or(-1.0);
    rows.iter().filter(|row| is_wanted(row.0)).max_by(|a, b| r(a).total_cmp(&r(b)))
}

/// A cell with a correlation; in brackets where it says nothing.
pub(super) fn cell(correlation: &Correlation) -> Markup {
    let Some(r) = correlation.pearson else { return number(None, two_decimals) };
    let rank = correlation.spearman.map_or_else(String::new, |rho| format!("ρ {rho:.2}, "));
    html! {
        td.number data-value=(r) {
            @if correlation.says_nothing() { "(" (two_decimals(r)) ")" } @else { (two_decimals(r)) }
            small { (rank) "n " (correlation.n) }
        }
    }
}

/// The interval of a correlation, in words.
pub(super) fn interval(correlation: &Correlation) -> String {
    correlation.interval().map_or_else(|| "–".into(), |[low, high]| format!("{low:.2} to {high:.2}"))
}

fn in_words((predictor, found): &Row) -> String {
    let r = found.correlation.pearson.map_or_else(|| "–".into(), two_decimals);
    format!("{} (r = {r}, {})", predictor.name, interval(&found.correlation))
}

pub(super) fn summary(samples: &[Sample]) -> Markup {
    let of_tracer = |tracer: TreeTracer| (tracer, rows(samples, Scope::pooled(tracer)));
    let all: Vec<(TreeTracer, Vec<Row>)> =
        tracers(samples).map(of_tracer).filter(|(_, rows)| !rows.is_empty()).collect();
    if all.is_empty() {
        return html! { p { "Two trees of a scene must be traced before a figure can tell them apart." } };
    }
    html! {
        @for (tracer, rows) in &all {
            @let (of_static, of_all) = (best(rows, |predictor| predictor.is_static), best(rows, |_| true));
            @if let (Some(of_static), Some(of_all)) = (of_static, of_all) {
                p {
                    b { "On the " (tracer.name()) ", over " (scenes(samples).len()) " scenes, of what a tree says by itself " (in_words(of_static))
                        " goes with the time of rays best; of all figures " (in_words(of_all)) "." }
                }
            }
        }
        @for (tracer, rows) in &all { (pooled(*tracer, rows)) }
    }
}

fn pooled(tracer: TreeTracer, rows: &[Row]) -> Markup {
    let table = Table::new(format!("All rays on all scenes, {}", tracer.name()), rows)
        .name("figure", |row| row.0.name)
        .text("what it is", |row| row.0.what)
        .number("r", "", |row| row.1.correlation.pearson, two_decimals)
        .text("95%", |row| interval(&row.1.correlation))
        .number("ρ", "", |row| row.1.correlation.spearman, two_decimals)
        .number("n", "", |row| Some(row.1.correlation.n as f64), whole)
        .text("weights of all", |row| row.1.fitted.clone().unwrap_or_default());
    html! { h3 { "All rays, all scenes, " (tracer.name()) } (table.html()) }
}

/// A row a scope, a column a predictor.
pub(super) fn matrix(label: String, heading: &str, samples: &[Sample], scopes: &[(String, Scope<'_>)]) -> Markup {
    let of_scope = |(name, scope): &(String, Scope<'_>)| (name.clone(), rows(samples, *scope));
    let all: Vec<(String, Vec<Row>)> = scopes.iter().map(of_scope).filter(|(_, rows)| !rows.is_empty()).collect();
    if all.is_empty() {
        return html! { p { "Nothing to correlate." } };
    }
    let find = |rows: &[Row], name: &str| rows.iter().find(|row| row.0.name == name).map(|row| row.1.correlation);
    let shown =
        predictor::ALL.iter().filter(|predictor| all.iter().any(|(_, rows)| find(rows, predictor.name).is_some()));
    let mut table = Table::new(label, &all).name(heading, |(name, _)| name);
    for predictor in shown {
        table = table.figure(predictor.name, "", move |(_, rows)| match find(rows, predictor.name) {
            Some(correlation) => cell(&correlation),
            None => number(None, two_decimals),
        });
    }
    table.html()
}

pub(super) fn by_kind(samples: &[Sample]) -> Markup {
    let scopes = |tracer: TreeTracer| -> Vec<(String, Scope<'_>)> {
        kinds(samples, tracer).into_iter().map(|kind| (kind.to_owned(), Scope { tracer, kind, scene: None })).collect()
    };
    html! {
        p { "Correlations of each kind of ray, over all scenes. What is best for one kind need not be for another." }
        @for tracer in tracers(samples) {
            h3 { "On the " (tracer.name()) }
            (matrix(format!("By kind of ray, {}", tracer.name()), "rays", samples, &scopes(tracer)))
        }
    }
}

pub(super) fn by_scene(samples: &[Sample]) -> Markup {
    let all_rays = |tracer: TreeTracer| -> Vec<(String, Scope<'_>)> {
        let scope = |scene| Scope { scene: Some(scene), ..Scope::pooled(tracer) };
        scenes(samples).into_iter().map(|scene| (scene.to_owned(), scope(scene))).collect()
    };
    let each_kind = |tracer: TreeTracer| -> Vec<(String, Scope<'_>)> {
        let of_scene = |scene| {
            let of_kind = move |kind| (format!("{scene}, {kind}"), Scope { tracer, kind, scene: Some(scene) });
            kinds(samples, tracer).into_iter().skip(1).map(of_kind)
        };
        scenes(samples).into_iter().flat_map(of_scene).collect()
    };
    html! {
        p { "Correlations over the trees of one scene. Weights that are sought are the scene's own here, so that they do better than they can tell." }
        @for tracer in tracers(samples) {
            h3 { "All rays, " (tracer.name()) }
            (matrix(format!("By scene, {}", tracer.name()), "scene", samples, &all_rays(tracer)))
            details {
                summary { "Each scene and kind of ray, " (tracer.name()) }
                (matrix(format!("By scene and kind of ray, {}", tracer.name()), "scene, rays", samples, &each_kind(tracer)))
            }
        }
    }
}
