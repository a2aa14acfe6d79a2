//! A few figures side by side, each with its spread: horizontal bars, and lines where goals are.

use crate::Result;
use crate::measure::statistics::Spread;
use crate::report::chart::{Area, Caption, Chart, Drawn, LABEL_SIZE, Label, Overlay};
use crate::report::labels::{Rect, name_room, text_width};
use crate::report::plot::{self, Axis, Plot, Room};
use crate::report::theme::{INK, Tone};
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
    let room = Room {
        top: if marks.is_empty() { 0 } else { 22 },
        left: name_room(bars.iter().map(|b| &b.label), LABEL_SIZE) as u32 + 10,
        right: figures as u32 + 12,
        ..Room::default()
    };
    let draw = |area: &Area<'_>, overlay: &mut Overlay| -> Drawn {
        let count = bars.len() as f64;
        let values = Axis { name: axis, is_log: false, number: *number };
        let mut plot = Plot::new(area, &room, (&values, 0.0..1.02 * longest), (&plot::BARS, 0.0..count))?;
        let Rect { x: left, y: top, w: width, h: height } = plot.frame;
        let row = height / count;
        let half = 0.5 * (0.7_f64).min(THICKNESS / row);
        for (i, bar) in bars.iter().enumerate() {
            let Bar { label, figure, spread: Spread { median, min, max, runs }, tone } = bar;
            let centre = (bars.len() - i) as f64 - 0.5;
            let corners = [(0.0, centre - half), (*median, centre + half)];
            plot.chart.draw_series([Rectangle::new(corners, tone.light.filled())])?;
            plot.whisker((*min, centre), (*max, centre))?;
            for end in [*min, *max] {
                let edge = [(end, centre - 0.4 * half), (end, centre + 0.4 * half)];
                plot.line(edge, INK.light.stroke_width(1))?;
            }
            let (end, y) = plot.pixel((max.max(*median), centre));
            overlay.label_bar(y, (left, label, *tone), (end, figure));
            let [least, most] = [*min, *max].map(number);
            let tip = format!("{label}: {figure}, from {least} to {most} in {runs} runs");
            overlay.tip(Rect { x: left, y: y - 0.5 * row, w: width, h: row }, &tip);
        }
        for (value, name) in marks {
            plot.line([(*value, 0.0), (*value, count)], INK.light.stroke_width(2))?;
            let at = (plot.pixel((*value, 0.0)).0, top - 7.0);
            overlay.label(Label { at, text: name, anchor: "middle", tone: INK, size: 12.0 });
        }
        Ok(())
    };
    Chart::draw(caption, draw).map(Some)
}
