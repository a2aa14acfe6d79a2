//! A few figures side by side, each with its spread: horizontal bars, and lines where goals are.

use crate::Result;
use crate::measure::statistics::Spread;
use crate::report::chart::{Area, Axes, Caption, Chart, Drawn, LABEL_SIZE, Label, Overlay, frame, mesh, pixel};
use crate::report::labels::{Rect, name_room, text_width};
use crate::report::theme::{INK, MUTED, Tone};
use plotters::prelude::*;

/// Pixels of a bar's height, at most.
const THICKNESS: f64 = 34.0;

/// One bar.
#[derive(Debug, Clone)]
pub struct Bar {
    /// To its left.
    pub label: String,
    /// To its right.
    pub figure: String,
    /// As long as the median, with a whisker from the least to the greatest.
    pub spread: Spread,
    /// Its colour.
    pub tone: Tone,
}

/// The bars of a chart.
pub struct Bars<'a> {
    /// From top to bottom.
    pub bars: Vec<Bar>,
    /// What the axis is called.
    pub axis: &'a str,
    /// How its numbers are written.
    pub number: fn(f64) -> String,
    /// Values that bars are held against, with their names.
    pub marks: Vec<(f64, String)>,
}

/// Draws the bars. `None` if there are none.
///
/// # Errors
/// The chart cannot be drawn.
pub fn bars(caption: Caption, what: &Bars<'_>) -> Result<Option<Chart>> {
    let Bars { bars, axis, number, marks } = what;
    let values = bars.iter().map(|b| b.spread.max).chain(marks.iter().map(|m| m.0));
    let longest = values.fold(0.0, f64::max);
    if bars.is_empty() || longest <= 0.0 {
        return Ok(None);
    }
    let figures = bars.iter().map(|b| text_width(&b.figure, LABEL_SIZE)).fold(0.0, f64::max);
    let draw = |area: &Area<'_>, overlay: &mut Overlay| -> Drawn {
        let mut chart = ChartBuilder::on(area)
            .x_label_area_size(46)
            .margin_top(if marks.is_empty() { 0 } else { 22 })
            .margin_left(name_room(bars.iter().map(|b| &b.label), LABEL_SIZE) as u32 + 10)
            .margin_right(figures as u32 + 12)
            .build_cartesian_2d(0.0..1.02 * longest, 0.0..bars.len() as f64)?;
        mesh(&mut chart, &Axes { x: axis, y: "", x_number: &|v| number(*v), y_number: &|_| String::new() })?;
        let inner = frame(&chart);
        let row = inner.h / bars.len() as f64;
        let half = 0.5 * (0.7_f64).min(THICKNESS / row);
        for (i, bar) in bars.iter().enumerate() {
            let centre = (bars.len() - i) as f64 - 0.5;
            let Spread { median, min, max, .. } = bar.spread;
            let corners = [(0.0, centre - half), (median, centre + half)];
            chart.draw_series([Rectangle::new(corners, bar.tone.light.filled())])?;
            let whisker = |value: f64, half: f64| vec![(value, centre - half), (value, centre + half)];
            let ink = INK.light.stroke_width(1);
            // Less than a pixel has no length that could be drawn.
            if chart.backend_coord(&(min, centre)) != chart.backend_coord(&(max, centre)) {
                chart.draw_series([PathElement::new(vec![(min, centre), (max, centre)], ink)])?;
            }
            for end in [min, max] {
                chart.draw_series([PathElement::new(whisker(end, 0.4 * half), ink)])?;
            }
            let (end, y) = pixel(&chart, (max.max(median), centre));
            let at = (end + 8.0, y + 4.5);
            overlay.label(Label { at, text: &bar.figure, anchor: "start", tone: MUTED, size: LABEL_SIZE });
            let at = (inner.x - 8.0, y + 4.5);
            overlay.name(Label { at, text: &bar.label, anchor: "end", tone: bar.tone, size: LABEL_SIZE });
            let tip = format!(
                "{}: {}, from {} to {} in {} runs",
                bar.label,
                bar.figure,
                number(min),
                number(max),
                bar.spread.runs
            );
            overlay.tip(Rect { x: inner.x, y: y - 0.5 * row, w: inner.w, h: row }, &tip);
        }
        for (value, name) in marks {
            let line = vec![(*value, 0.0), (*value, bars.len() as f64)];
            chart.draw_series([PathElement::new(line, INK.light.stroke_width(2))])?;
            let at = (pixel(&chart, (*value, 0.0)).0, inner.y - 7.0);
            overlay.label(Label { at, text: name, anchor: "middle", tone: INK, size: 12.0 });
        }
        Ok(())
    };
    Chart::draw(caption, draw).map(Some)
}
