//! Figures over a quantity, one curve a subject, with the spread of each figure; where a curve has a power law, that is drawn,
//! and where something is expected at a place, so is that.

use crate::Result;
use crate::measure::statistics::Spread;
use crate::report::chart::{Area, Caption, Chart, Drawn, Overlay};
use crate::report::labels::Rect;
use crate::report::plot::{Plot, Room, room_at_ends};
use crate::report::power_law::PowerLaw;
use crate::report::theme::Tone;
use plotters::prelude::*;

pub use crate::report::plot::Axis;

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
    let (bottom, top) = if y.is_log { (0.7 * low, 1.4 * high) } else { (0.0, 1.1 * high) };
    // Room for the names of marks, a line each, above the curves.
    let room = 0.06 * marks.len() as f64;
    let share = (1.0 - room).max(0.2);
    let top = if y.is_log { top * (top / bottom).powf(room / share) } else { top / share };
    let marks: Vec<&Mark> = marks.iter().filter(|mark| (left..=right).contains(&mark.x)).collect();
    let shown: Vec<&Curve> = curves.iter().filter(|curve| !curve.points.is_empty()).collect();
    let room = Room { left: 76, right: room_at_ends(curves.iter().map(|curve| &curve.name)), ..Room::default() };
    let draw = |area: &Area<'_>, overlay: &mut Overlay| -> Drawn {
        let end = x_range.end;
        let mut plot = Plot::new(area, &room, (x, x_range), (y, bottom..top))?;
        draw_marks(&plot, overlay, &marks);
        let mut ends = Vec::new();
        for curve in &shown {
            let height = draw_curve(&mut plot, overlay, curve, x, y)?;
            ends.push(plot.pixel((end, height)));
        }
        let texts: Vec<_> = shown.iter().map(|curve| (curve.name.clone(), curve.tone)).collect();
        overlay.label_ends(&ends, &texts, plot.frame);
        Ok(())
    };
    Chart::draw(caption, draw).map(Some)
}

fn draw_marks(plot: &Plot<'_, '_>, overlay: &mut Overlay, marks: &[&Mark]) {
    let frame = plot.frame;
    let mut tops = Vec::new();
    for mark in marks {
        let x = plot.pixel((mark.x, 1.0)).0;
        overlay.dashes((x, frame.y), (x, frame.y + frame.h), mark.tone);
        tops.push((x, frame.y + 8.0));
    }
    let names: Vec<_> = marks.iter().map(|mark| (mark.name.clone(), mark.tone)).collect();
    overlay.label_points(&tops, &names, &[], frame);
}

/// Draws a curve, and gives its height at the right end.
fn draw_curve(
    plot: &mut Plot<'_, '_>,
    overlay: &mut Overlay,
    curve: &Curve,
    x_axis: &Axis<'_>,
    y_axis: &Axis<'_>,
) -> std::result::Result<f64, Box<dyn std::error::Error>> {
    let Curve { points, tone, .. } = curve;
    let (first, last) = (points[0].0, points[points.len() - 1].0);
    let line: Vec<(f64, f64)> = match curve.law {
        Some(law) => [first, last].map(|x| (x, law.at(x))).to_vec(),
        None => points.iter().map(|(x, spread)| (*x, spread.median)).collect(),
    };
    let height = line[line.len() - 1].1;
    plot.line(line, tone.light.stroke_width(2))?;
    for &(x, Spread { median, min, max, runs }) in points {
        plot.whisker((x, min), (x, max))?;
        plot.chart.draw_series([Circle::new((x, median), 4, tone.light.filled())])?;
        let at = plot.pixel((x, median));
        let [median, min, max] = [median, min, max].map(y_axis.number);
        let x = (x_axis.number)(x);
        let spread = if runs > 1 { format!(", from {min} to {max} in {runs} runs") } else { String::new() };
        let tip = format!("{}\n{x}: {median}{spread}", curve.name);
        overlay.tip(Rect { x: at.0 - 7.0, y: at.1 - 7.0, w: 14.0, h: 14.0 }, &tip);
    }
    Ok(height)
}
