//! Build speed against trace speed, and against SAH cost, for one scene; with the frontier that no builder beats at both.

use crate::Result;
use crate::experiments::bench::pareto;
use crate::measure::record::Record;
use crate::report::chart::{Area, Axes, Caption, Chart, Drawn, Overlay, best_line, frame, mesh, pixel};
use crate::report::labels::Rect;
use crate::report::names::{short, slug};
use crate::report::numbers::{three_digits, tick};
use crate::report::theme::{Legend, Tone};
use plotters::prelude::*;

/// Where a builder works, which its mark tells: ours on the device a disc, the driver a square, the host a triangle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Place {
    Device,
    Driver,
    Host,
}

struct Point {
    at: (f64, f64),
    name: String,
    tone: Tone,
    place: Place,
}

/// Build speed against trace speed over all rays: up and to the right is better. `None` if nothing was traced.
///
/// # Errors
/// The chart cannot be drawn.
pub fn trace_speed(records: &[&Record], legend: &Legend) -> Result<Option<Chart>> {
    let Some(scene) = records.first().map(|r| r.scene.clone()) else { return Ok(None) };
    let points = points(records, legend, |record| record.mrays_s());
    let frontier = pareto::frontier(&points.iter().map(|p| p.at).collect::<Vec<_>>());
    let caption = Caption {
        name: format!("{}-trace-speed", slug(&scene)),
        title: format!("{scene}: build speed against trace speed"),
        alt: in_words(&points, "million rays a second"),
        reading: format!(
            "Up and to the right is better. The gold line bounds the builders that no other beats at both: {}.",
            list(&frontier, &points)
        ),
    };
    scatter(caption, &points, &frontier, Axis::Speed("trace speed, million rays a second →"))
}

/// Build speed against SAH cost: down and to the right is better. `None` if no builder tells its cost.
///
/// # Errors
/// The chart cannot be drawn.
pub fn sah_cost(records: &[&Record], legend: &Legend) -> Result<Option<Chart>> {
    let Some(scene) = records.first().map(|r| r.scene.clone()) else { return Ok(None) };
    let points = points(records, legend, |record| record.quality.sah);
    let frontier = pareto::frontier(&points.iter().map(|p| (p.at.0, -p.at.1)).collect::<Vec<_>>());
    let caption = Caption {
        name: format!("{}-sah-cost", slug(&scene)),
        title: format!("{scene}: build speed against SAH cost"),
        alt: in_words(&points, "SAH cost"),
        reading: format!(
            "Down and to the right is better: a lower cost promises faster tracing. No other beats at both: {}. A driver does \
             not show its trees, so it has no mark here.",
            list(&frontier, &points)
        ),
    };
    scatter(caption, &points, &frontier, Axis::Cost("SAH cost ← better is lower"))
}

fn points(records: &[&Record], legend: &Legend, y: impl Fn(&Record) -> Option<f64>) -> Vec<Point> {
    let place = |record: &Record| match (record.kind.as_str(), record.build.timer.as_str()) {
        ("driver", _) => Place::Driver,
        (_, "device") => Place::Device,
        _ => Place::Host,
    };
    let point = |record: &&Record| {
        let at = (record.mtris_s(), y(record)?);
        let finite = at.0.is_finite() && at.1.is_finite();
        finite.then(|| Point {
            at,
            name: record.builder.clone(),
            tone: legend.builder(&record.builder),
            place: place(record),
        })
    };
    records.iter().filter_map(point).collect()
}

fn in_words(points: &[Point], unit: &str) -> String {
    let point = |p: &Point| {
        format!(
            "{}: {} million triangles a second, {} {unit}",
            short(&p.name),
            three_digits(p.at.0),
            three_digits(p.at.1)
        )
    };
    points.iter().map(point).collect::<Vec<_>>().join("; ")
}

fn list(frontier: &[usize], points: &[Point]) -> String {
    frontier.iter().map(|&i| short(&points[i].name)).collect::<Vec<_>>().join(", ")
}

/// The vertical axis.
enum Axis<'a> {
    /// From zero; more is better.
    Speed(&'a str),
    /// Around the values: costs of one scene differ by percents; less is better.
    Cost(&'a str),
}

fn scatter(caption: Caption, points: &[Point], frontier: &[usize], axis: Axis<'_>) -> Result<Option<Chart>> {
    if points.is_empty() {
        return Ok(None);
    }
    let greatest = |of: fn(&Point) -> f64| points.iter().map(of).fold(0.0, f64::max);
    let least = |of: fn(&Point) -> f64| points.iter().map(of).fold(f64::INFINITY, f64::min);
    let x_range = 0.0..1.12 * greatest(|p| p.at.0);
    let (y_range, y_name, falls) = match axis {
        Axis::Speed(name) => (0.0..1.12 * greatest(|p| p.at.1), name, false),
        Axis::Cost(name) => {
            let (low, high) = (least(|p| p.at.1), greatest(|p| p.at.1));
            let margin = (0.12 * (high - low)).max(0.02 * high);
            (low - margin..high + margin, name, true)
        }
    };
    let draw = |area: &Area<'_>, overlay: &mut Overlay| -> Drawn {
        let mut chart = ChartBuilder::on(area)
            .x_label_area_size(46)
            .y_label_area_size(64)
            .build_cartesian_2d(x_range.clone(), y_range.clone())?;
        let number = |v: &f64| tick(*v);
        let x_name = "build speed, million triangles a second →";
        mesh(&mut chart, &Axes { x: x_name, y: y_name, x_number: &number, y_number: &number })?;
        let worst = if falls { y_range.end } else { 0.0 };
        let edge = staircase(&frontier.iter().map(|&i| points[i].at).collect::<Vec<_>>(), x_range.start, worst);
        chart.draw_series([PathElement::new(edge.clone(), best_line())])?;
        for point in points {
            let style = point.tone.light.filled();
            match point.place {
                Place::Device => chart.draw_series([Circle::new(point.at, 6, style)])?,
                Place::Driver => {
                    chart.draw_series([EmptyElement::at(point.at) + Rectangle::new([(-5, -5), (6, 6)], style)])?
                }
                Place::Host => chart.draw_series([TriangleMarker::new(point.at, 8, style)])?,
            };
        }
        let at: Vec<_> = points.iter().map(|p| pixel(&chart, p.at)).collect();
        let texts: Vec<_> = points.iter().map(|p| (short(&p.name), p.tone)).collect();
        let edge: Vec<_> = edge.iter().map(|&corner| pixel(&chart, corner)).collect();
        let lines: Vec<Rect> = edge.windows(2).map(|ends| Rect::around(ends[0], ends[1]).grown(4.0)).collect();
        overlay.label_points(&at, &texts, &lines, frame(&chart));
        for (point, &(x, y)) in points.iter().zip(&at) {
            let tip = format!("{}\n{} Mtri/s, {}", point.name, three_digits(point.at.0), three_digits(point.at.1));
            overlay.tip(Rect { x: x - 9.0, y: y - 9.0, w: 18.0, h: 18.0 }, &tip);
        }
        Ok(())
    };
    Chart::draw(caption, draw).map(Some)
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
