//! One chart a predictor: every tree of every scene, what is told against what is measured.

use super::{scenes, tracers};
use crate::Result;
use crate::experiments::predict::found::{Found, found};
use crate::experiments::predict::predictor::{self, Predictor};
use crate::experiments::predict::record::short;
use crate::experiments::predict::samples::{Point, Sample, Scope};
use crate::report::chart::{Area, Caption, Chart, Drawn, Overlay};
use crate::report::document;
use crate::report::labels::Rect;
use crate::report::names::slug;
use crate::report::numbers::two_decimals;
use crate::report::plot::{Axis, Plot, Room};
use crate::report::theme::{MUTED, SERIES, Tone};
use crate::subjects::retraced::TreeTracer;
use maud::{Markup, html};
use plotters::prelude::*;

/// The points of a tracer, and what was found.
struct Cloud<'s> {
    tracer: TreeTracer,
    points: Vec<Point<'s>>,
    found: Found,
}

/// The colour of a scene.
fn tone(scenes: &[&str], scene: &str) -> Tone {
    SERIES[scenes.iter().position(|other| *other == scene).unwrap_or(0) % SERIES.len()]
}

/// All charts, of those predictors that tell two trees apart.
pub(super) fn all(samples: &[Sample]) -> Result<Vec<Chart>> {
    let scenes = scenes(samples);
    let mut charts = Vec::new();
    for predictor in &predictor::ALL {
        let cloud = |tracer| {
            let points = Scope::pooled(tracer).points(samples);
            let found = found(predictor, &points);
            Cloud { tracer, points, found }
        };
        let clouds: Vec<Cloud<'_>> =
            tracers(samples).map(cloud).filter(|cloud| cloud.found.correlation.pearson.is_some()).collect();
        if !clouds.is_empty() {
            charts.push(scatter(predictor, &scenes, &clouds)?);
        }
    }
    Ok(charts)
}

fn in_words(cloud: &Cloud<'_>) -> String {
    let correlation = cloud.found.correlation;
    let r = correlation.pearson.map_or_else(|| "–".into(), two_decimals);
    format!("{}: r {r}, {} trees", cloud.tracer.name(), correlation.n)
}

/// Bounds of logarithms, with room around them.
fn range(logs: impl Iterator<Item = f64> + Clone) -> std::ops::Range<f64> {
    let (low, high) = (logs.clone().fold(0.0, f64::min), logs.fold(0.0, f64::max));
    let margin = (0.08 * (high - low)).max(0.02);
    low - margin..high + margin
}

/// A number of an axis of logarithms.
fn ratio(log: f64) -> String {
    two_decimals(log.exp())
}

fn scatter(predictor: &Predictor, scenes: &[&str], clouds: &[Cloud<'_>]) -> Result<Chart> {
    let words = clouds.iter().map(in_words).collect::<Vec<_>>().join("; ");
    let caption = Caption {
        name: format!("predict-{}", slug(predictor.name)),
        title: format!("{}: told against measured", predictor.name),
        alt: words.clone(),
        reading: format!(
            "{}. Circles are the host, squares the device; the dashes are where both ratios are equal. {words}.",
            predictor.what
        ),
    };
    let all = clouds.iter().flat_map(|cloud| &cloud.found.ratios);
    let (x_range, y_range) = (range(all.clone().map(|ratio| ratio[0].ln())), range(all.map(|ratio| ratio[1].ln())));
    let draw = |area: &Area<'_>, overlay: &mut Overlay| -> Drawn {
        let x_name = format!("{}, over the reference's", predictor.name);
        let x = Axis { name: &x_name, is_log: false, number: ratio };
        let y = Axis { name: "time of a ray, over the reference's", is_log: false, number: ratio };
        let room = Room { left: 64, ..Room::default() };
        let mut plot = Plot::new(area, &room, (&x, x_range.clone()), (&y, y_range.clone()))?;
        let (low, high) = (x_range.start.max(y_range.start), x_range.end.min(y_range.end));
        overlay.dashes(plot.pixel((low, low)), plot.pixel((high, high)), MUTED);
        for Cloud { tracer, points, found } in clouds {
            for (ratios, number) in found.ratios.iter().zip(&found.numbers) {
                let tree = points[*number].tree;
                let (at, style) = ((ratios[0].ln(), ratios[1].ln()), tone(scenes, &tree.scene).light.filled());
                if *tracer == TreeTracer::Host {
                    plot.chart.draw_series([Circle::new(at, 4, style)])?;
                } else {
                    plot.chart.draw_series([EmptyElement::at(at) + Rectangle::new([(-4, -4), (5, 5)], style)])?;
                }
                let (x, y) = plot.pixel(at);
                let tip = format!(
                    "{}, {}, {}\n{} × predicted, {} × measured",
                    tree.scene,
                    short(&tree.builder),
                    tracer.name(),
                    two_decimals(ratios[0]),
                    two_decimals(ratios[1])
                );
                overlay.tip(Rect { x: x - 6.0, y: y - 6.0, w: 12.0, h: 12.0 }, &tip);
            }
        }
        Ok(())
    };
    Chart::draw(caption, draw)
}

pub(super) fn section(samples: &[Sample], charts: &[Chart]) -> Markup {
    let scenes = scenes(samples);
    html! {
        p { "Every tree of every scene with all rays together. A figure that tells times puts them on a line that rises." }
        p { @for scene in &scenes {
            span.builder { i.dot style={ "background:var(--" (tone(&scenes, scene).variable) ")" } {} (scene) } " "
        } }
        (document::charts(charts))
    }
}
