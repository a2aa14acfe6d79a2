//! Build speed against trace speed, and against SAH cost, for one scene; with the frontier that no builder beats at both.

use crate::Result;
use crate::experiments::bench::pareto;
use crate::measure::record::Record;
use crate::report::chart::{Area, Caption, Chart, Drawn, Overlay};
use crate::report::labels::Rect;
use crate::report::names::{short, slug};
use crate::report::numbers::{three_digits, tick};
use crate::report::plot::{Axis, Plot, Room, best_line};
use crate::report::theme::Legend;
use plotters::prelude::*;

/// What build speed is held against.
pub struct Against {
    /// In the title, and in the name of the file.
    name: &'static str,
    /// The unit, behind a figure.
    unit: &'static str,
    /// The name of the axis.
    axis: &'static str,
    /// Its figure of a record.
    figure: fn(&Record) -> Option<f64>,
    /// Whether less is better. The axis is then around the values, for costs of one scene differ by percents; otherwise it begins
    /// at zero.
    is_cost: bool,
    /// What a reader shall take from the chart: before and behind the names of the builders on the frontier.
    reading: [&'static str; 2],
}

/// The trace speed over all rays: up and to the right is better.
pub const TRACE_SPEED: Against = Against {
    name: "trace speed",
    unit: "million rays a second",
    axis: "trace speed, million rays a second →",
    figure: Record::mrays_s,
    is_cost: false,
    reading: ["Up and to the right is better. The gold line bounds the builders that no other beats at both: ", "."],
};

/// The SAH cost: down and to the right is better.
pub const SAH_COST: Against = Against {
    name: "SAH cost",
    unit: "SAH cost",
    axis: "SAH cost ← better is lower",
    figure: |record| record.quality.sah,
    is_cost: true,
    reading: [
        "Down and to the right is better: a lower cost promises faster tracing. No other beats at both: ",
        ". A driver does not show its trees, so it has no mark here.",
    ],
};

/// A builder with both figures.
struct Point<'a> {
    record: &'a Record,
    at: (f64, f64),
}

/// The builders on one scene. `None` if none has the figure.
///
/// # Errors
/// The chart cannot be drawn.
pub fn scatter(records: &[&Record], legend: &Legend, against: &Against) -> Result<Option<Chart>> {
    let figures = records.iter().filter_map(|record| Some((*record, (record.mtris_s(), (against.figure)(record)?))));
    let finite = figures.filter(|(_, at)| at.0.is_finite() && at.1.is_finite());
    let points: Vec<Point<'_>> = finite.map(|(record, at)| Point { record, at }).collect();
    let Some(Point { record: Record { scene, .. }, .. }) = points.first() else { return Ok(None) };
    let better = if against.is_cost { -1.0 } else { 1.0 };
    let frontier = pareto::frontier(&points.iter().map(|p| (p.at.0, better * p.at.1)).collect::<Vec<_>>());
    let name = |point: &Point<'_>| short(&point.record.builder);
    let in_words = |point: &Point<'_>| {
        let [build, other] = [point.at.0, point.at.1].map(three_digits);
        format!("{}: {build} million triangles a second, {other} {}", name(point), against.unit)
    };
    let best: Vec<String> = frontier.iter().map(|&i| name(&points[i])).collect();
    let caption = Caption {
        name: format!("{}-{}", slug(scene), slug(against.name)),
        title: format!("{scene}: build speed against {}", against.name),
        alt: points.iter().map(in_words).collect::<Vec<_>>().join("; "),
        reading: against.reading.join(&best.join(", ")),
    };
    let greatest = |of: fn(&Point<'_>) -> f64| points.iter().map(of).fold(0.0, f64::max);
    let high = greatest(|p| p.at.1);
    let (bottom, top) = if against.is_cost {
        let low = points.iter().map(|p| p.at.1).fold(f64::INFINITY, f64::min);
        let margin = (0.12 * (high - low)).max(0.02 * high);
        (low - margin, high + margin)
    } else {
        (0.0, 1.12 * high)
    };
    let draw = |area: &Area<'_>, overlay: &mut Overlay| -> Drawn {
        let x = Axis { name: "build speed, million triangles a second →", is_log: false, number: tick };
        let y = Axis { name: against.axis, is_log: false, number: tick };
        let room = Room { left: 64, ..Room::default() };
        let mut plot = Plot::new(area, &room, (&x, 0.0..1.12 * greatest(|p| p.at.0)), (&y, bottom..top))?;
        let worst = if against.is_cost { top } else { 0.0 };
        let edge = staircase(&frontier.iter().map(|&i| points[i].at).collect::<Vec<_>>(), 0.0, worst);
        plot.line(edge.clone(), best_line())?;
        for Point { record, at } in &points {
            draw_mark(&mut plot, record, *at, legend.builder(&record.builder).light.filled())?;
        }
        let at: Vec<_> = points.iter().map(|p| plot.pixel(p.at)).collect();
        let texts: Vec<_> = points.iter().map(|p| (name(p), legend.builder(&p.record.builder))).collect();
        let edge: Vec<_> = edge.iter().map(|&corner| plot.pixel(corner)).collect();
        let lines: Vec<Rect> = edge.windows(2).map(|ends| Rect::around(ends[0], ends[1]).grown(4.0)).collect();
        overlay.label_points(&at, &texts, &lines, plot.frame);
        for (point, &(x, y)) in points.iter().zip(&at) {
            let [build, other] = [point.at.0, point.at.1].map(three_digits);
            let tip = format!("{}\n{build} Mtri/s, {other}", point.record.builder);
            overlay.tip(Rect { x: x - 9.0, y: y - 9.0, w: 18.0, h: 18.0 }, &tip);
        }
        Ok(())
    };
    Chart::draw(caption, draw).map(Some)
}

/// A mark for where the builder works: ours on the device a disc, the driver a square, the host a triangle.
fn draw_mark(plot: &mut Plot<'_, '_>, record: &Record, at: (f64, f64), style: ShapeStyle) -> Drawn {
    match (record.kind.as_str(), record.build.timer.as_str()) {
        ("driver", _) => plot.chart.draw_series([EmptyElement::at(at) + Rectangle::new([(-5, -5), (6, 6)], style)])?,
        (_, "device") => plot.chart.draw_series([Circle::new(at, 6, style)])?,
        _ => plot.chart.draw_series([TriangleMarker::new(at, 8, style)])?,
    };
    Ok(())
}

/// The edge of the region that the points on the frontier dominate: from the left end of the axis to the worst value.
fn staircase(frontier: &[(f64, f64)], left: f64, worst: f64) -> Vec<(f64, f64)> {
    let Some(&first) = frontier.first() else { return Vec::new() };
    let mut path = vec![(left, first.1), first];
    for pair in frontier.windows(2) {
        path.push((pair[0].0, pair[1].1));
        path.push(pair[1]);
    }
    path.push((frontier[frontier.len() - 1].0, worst));
    path
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_staircase_bounds_what_the_frontier_dominates() {
        let path = staircase(&[(1.0, 3.0), (2.0, 2.0)], 0.0, 0.0);
        assert_eq!(path, [(0.0, 3.0), (1.0, 3.0), (1.0, 2.0), (2.0, 2.0), (2.0, 0.0)]);
    }
}
