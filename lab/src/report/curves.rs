//! Figures over a quantity, one curve a subject, with the spread of each figure; where a curve has a power law, that is drawn,
//! and where something is expected at a place, so is that.

use crate::Result;
use crate::measure::statistics::Spread;
use crate::report::chart::{Area, Axes, Caption, Chart, Drawn, Overlay, frame, log_axis, mesh, pixel, room_at_ends};
use crate::report::labels::Rect;
use crate::report::power_law::PowerLaw;
use crate::report::theme::{INK, Tone};
use plotters::coord::ranged1d::{Ranged, ValueFormatter};
use plotters::prelude::*;
use std::ops::Range;

/// One subject.
#[derive(Debug, Clone)]
pub struct Curve {
    /// At its right end.
    pub name: String,
    /// Its colour.
    pub tone: Tone,
    /// From left to right.
    pub points: Vec<(f64, Spread)>,
    /// Drawn instead of lines from point to point.
    pub law: Option<PowerLaw>,
}

impl Curve {
    /// With the power law through its medians, whose exponent stands behind the name.
    pub fn with_law(self) -> Curve {
        let law = PowerLaw::fit(&self.points.iter().map(|(x, spread)| (*x, spread.median)).collect::<Vec<_>>());
        match law {
            Some(law) => Curve { name: format!("{}: n^{:.2}", self.name, law.exponent), law: Some(law), ..self },
            None => self,
        }
    }
}

/// A place on the horizontal axis where something is expected.
#[derive(Debug, Clone)]
pub struct Mark {
    /// At its upper end.
    pub name: String,
    /// Its colour.
    pub tone: Tone,
    /// Where.
    pub x: f64,
}

/// An axis.
pub struct Axis<'a> {
    /// What it is called.
    pub name: &'a str,
    /// Whether its numbers are logarithmic.
    pub is_log: bool,
    /// How they are written.
    pub number: fn(f64) -> String,
}

/// Draws the curves. `None` if there are none, or all points have one place on the horizontal axis.
///
/// # Errors
/// The chart cannot be drawn.
pub fn curves(caption: Caption, curves: &[Curve], x: &Axis<'_>, y: &Axis<'_>) -> Result<Option<Chart>> {
    curves_and_marks(caption, curves, &[], x, y)
}

/// The same with dashed lines at `marks`, as far as the curves reach.
///
/// # Errors
/// The chart cannot be drawn.
pub fn curves_and_marks(
    caption: Caption,
    curves: &[Curve],
    marks: &[Mark],
    x: &Axis<'_>,
    y: &Axis<'_>,
) -> Result<Option<Chart>> {
    let points = || curves.iter().flat_map(|curve| &curve.points);
    let (left, right) = points().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, r), p| (l.min(p.0), r.max(p.0)));
    // A law may end below the least point or above the greatest.
    let laws = || curves.iter().filter_map(|curve| curve.law).flat_map(|law| [law.at(left), law.at(right)]);
    let low = points().map(|p| p.1.min).chain(laws()).fold(f64::INFINITY, f64::min);
    let high = points().map(|p| p.1.max).chain(laws()).fold(0.0, f64::max);
    if left >= right || high <= 0.0 {
        return Ok(None);
    }
    let x_range = if x.is_log { 0.8 * left..1.2 * right } else { left..right + 0.02 * (right - left) };
    let y_range = if y.is_log { 0.7 * low..1.4 * high } else { 0.0..1.1 * high };
    // Room for the names of marks, a line each, above the curves.
    let room = 0.06 * marks.len() as f64;
    let y_range = match y.is_log {
        true => y_range.start..y_range.end * (y_range.end / y_range.start).powf(room / (1.0 - room).max(0.2)),
        false => y_range.start..y_range.end / (1.0 - room).max(0.2),
    };
    let marks: Vec<&Mark> = marks.iter().filter(|mark| (left..=right).contains(&mark.x)).collect();
    let names = room_at_ends(curves.iter().map(|curve| &curve.name));
    let draw = |area: &Area<'_>, overlay: &mut Overlay| -> Drawn {
        let mut chart = ChartBuilder::on(area);
        chart.x_label_area_size(46).y_label_area_size(76).margin_right(names);
        let axes = Axes { x: x.name, y: y.name, x_number: &|v| (x.number)(*v), y_number: &|v| (y.number)(*v) };
        let linear = |range: &Range<f64>| range.clone();
        match (x.is_log, y.is_log) {
            (true, true) => {
                let chart = chart.build_cartesian_2d(log_axis(x_range.clone()), log_axis(y_range.clone()))?;
                drawn(chart, overlay, (curves, &marks), &axes, x_range.end)
            }
            (true, false) => {
                let chart = chart.build_cartesian_2d(log_axis(x_range.clone()), linear(&y_range))?;
                drawn(chart, overlay, (curves, &marks), &axes, x_range.end)
            }
            (false, true) => {
                let chart = chart.build_cartesian_2d(linear(&x_range), log_axis(y_range.clone()))?;
                drawn(chart, overlay, (curves, &marks), &axes, x_range.end)
            }
            (false, false) => {
                let chart = chart.build_cartesian_2d(linear(&x_range), linear(&y_range))?;
                drawn(chart, overlay, (curves, &marks), &axes, x_range.end)
            }
        }
    };
    Chart::draw(caption, draw).map(Some)
}

fn drawn<X, Y>(
    mut chart: ChartContext<'_, SVGBackend<'_>, Cartesian2d<X, Y>>,
    overlay: &mut Overlay,
    (curves, marks): (&[Curve], &[&Mark]),
    axes: &Axes<'_>,
    end: f64,
) -> Drawn
where
    X: Ranged<ValueType = f64> + ValueFormatter<f64>,
    Y: Ranged<ValueType = f64> + ValueFormatter<f64>,
{
    mesh(&mut chart, axes)?;
    let area = frame(&chart);
    let places: Vec<f64> = marks.iter().map(|mark| pixel(&chart, (mark.x, 1.0)).0).collect();
    for (mark, &x) in marks.iter().zip(&places) {
        overlay.dashes((x, area.y), (x, area.y + area.h), mark.tone);
    }
    let tops: Vec<(f64, f64)> = places.iter().map(|&x| (x, area.y + 8.0)).collect();
    let names: Vec<_> = marks.iter().map(|mark| (mark.name.clone(), mark.tone)).collect();
    overlay.label_points(&tops, &names, &[], area);
    let shown: Vec<&Curve> = curves.iter().filter(|curve| !curve.points.is_empty()).collect();
    let mut ends = Vec::new();
    for curve in &shown {
        let Curve { points, tone, .. } = curve;
        let (first, last) = (points[0].0, points[points.len() - 1].0);
        let line: Vec<(f64, f64)> = match curve.law {
            Some(law) => [first, last].map(|x| (x, law.at(x))).to_vec(),
            None => points.iter().map(|(x, spread)| (*x, spread.median)).collect(),
        };
        let height = line[line.len() - 1].1;
        chart.draw_series([PathElement::new(line, tone.light.stroke_width(2))])?;
        for &(x, Spread { median, min, max, runs }) in points {
            // Less than a pixel has no length that could be drawn.
            if chart.backend_coord(&(x, min)) != chart.backend_coord(&(x, max)) {
                chart.draw_series([PathElement::new(vec![(x, min), (x, max)], INK.light.stroke_width(1))])?;
            }
            chart.draw_series([Circle::new((x, median), 4, tone.light.filled())])?;
            let at = pixel(&chart, (x, median));
            let [median, min, max] = [median, min, max].map(|v| (axes.y_number)(&v));
            let x = (axes.x_number)(&x);
            let spread = if runs > 1 { format!(", from {min} to {max} in {runs} runs") } else { String::new() };
            let tip = format!("{}\n{x}: {median}{spread}", curve.name);
            overlay.tip(Rect { x: at.0 - 7.0, y: at.1 - 7.0, w: 14.0, h: 14.0 }, &tip);
        }
        ends.push((pixel(&chart, (end, height)).0, pixel(&chart, (end, height)).1));
    }
    let texts: Vec<_> = shown.iter().map(|curve| (curve.name.clone(), curve.tone)).collect();
    overlay.label_ends(&ends, &texts, area);
    Ok(())
}
