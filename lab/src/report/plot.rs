//! The part of a chart that has axes: drawn by plotters, the same way in every chart.

use super::chart::{Area, Drawn, LABEL_SIZE};
use super::labels::{self, Rect};
use super::numbers::log_ticks;
use super::theme::{BEST, GRID, INK, MUTED, Tone};
use plotters::coord::combinators::{BindKeyPoints, LogCoord, WithKeyPoints};
use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use std::ops::Range;

/// An axis.
pub struct Axis<'a> {
    /// What it is called; empty if it is vertical and the chart labels it itself.
    pub name: &'a str,
    /// Whether its numbers are logarithmic.
    pub is_log: bool,
    /// How they are written.
    pub number: fn(f64) -> String,
}

/// The vertical axis of a chart of horizontal bars, which labels each of them.
pub const BARS: Axis<'_> = Axis { name: "", is_log: false, number: |_| String::new() };

/// How values lie along an axis.
pub enum Scale {
    /// Evenly.
    Linear(RangedCoordf64),
    /// By their logarithms, with numbers at [`log_ticks`].
    Log(WithKeyPoints<LogCoord<f64>>),
}

impl Scale {
    fn new(range: Range<f64>, is_log: bool) -> Scale {
        if is_log {
            let ticks = log_ticks(range.start, range.end);
            Scale::Log(range.log_scale().with_key_points(ticks))
        } else {
            Scale::Linear(range.into())
        }
    }
}

impl Ranged for Scale {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        match self {
            Scale::Linear(scale) => scale.map(value, limit),
            Scale::Log(scale) => scale.map(value, limit),
        }
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        match self {
            Scale::Linear(scale) => scale.key_points(hint),
            Scale::Log(scale) => scale.key_points(hint),
        }
    }

    fn range(&self) -> Range<f64> {
        match self {
            Scale::Linear(scale) => scale.range(),
            Scale::Log(scale) => scale.range(),
        }
    }
}

/// Pixels that are left free around the plotting area, beside those of the horizontal axis.
#[derive(Default)]
pub struct Room {
    /// Above.
    pub top: u32,
    /// Below.
    pub bottom: u32,
    /// To the left: for the vertical axis where it has a name.
    pub left: u32,
    /// To the right.
    pub right: u32,
}

/// The margin to the right of a chart whose lines have labels at their ends.
pub fn room_at_ends<S: AsRef<str>>(names: impl IntoIterator<Item = S>) -> u32 {
    labels::name_room(names, LABEL_SIZE) as u32 + 24
}

/// A plotting area with its axes.
pub struct Plot<'a, 'b> {
    /// What plotters draws on.
    pub chart: ChartContext<'a, SVGBackend<'b>, Cartesian2d<Scale, Scale>>,
    /// The plotting area in pixels of the chart.
    pub frame: Rect,
}

impl<'a, 'b> Plot<'a, 'b> {
    /// Draws grid, axes and their numbers; each axis comes with the values that it reaches over.
    ///
    /// # Errors
    /// A range is empty or not finite.
    pub fn new(
        area: &'a Area<'b>,
        room: &Room,
        (x, x_range): (&Axis<'_>, Range<f64>),
        (y, y_range): (&Axis<'_>, Range<f64>),
    ) -> Result<Plot<'a, 'b>, Box<dyn std::error::Error>> {
        let mut builder = ChartBuilder::on(area);
        builder.x_label_area_size(46).margin_top(room.top).margin_bottom(room.bottom).margin_right(room.right);
        if y.name.is_empty() {
            builder.margin_left(room.left);
        } else {
            builder.y_label_area_size(room.left);
        }
        let mut chart = builder.build_cartesian_2d(Scale::new(x_range, x.is_log), Scale::new(y_range, y.is_log))?;
        let x_number = |value: &f64| (x.number)(*value);
        let y_number = |value: &f64| (y.number)(*value);
        let mut mesh = chart.configure_mesh();
        mesh.light_line_style(TRANSPARENT)
            .bold_line_style(GRID.light)
            .axis_style(MUTED.light)
            .label_style(text(12.0, MUTED))
            .axis_desc_style(text(13.0, MUTED))
            .x_desc(x.name)
            .x_label_formatter(&x_number)
            .y_label_formatter(&y_number)
            .x_labels(8)
            .y_labels(8);
        if y.name.is_empty() {
            mesh.disable_y_mesh().disable_y_axis();
        } else {
            mesh.y_desc(y.name);
        }
        mesh.draw()?;
        let (columns, rows) = chart.plotting_area().get_pixel_range();
        let [x, y, right, bottom] = [columns.start, rows.start, columns.end, rows.end].map(f64::from);
        Ok(Plot { chart, frame: Rect { x, y, w: right - x, h: bottom - y } })
    }

    /// Where a value lies, in pixels of the chart.
    pub fn pixel(&self, at: (f64, f64)) -> (f64, f64) {
        let (x, y) = self.chart.backend_coord(&at);
        (f64::from(x), f64::from(y))
    }

    /// A line from point to point.
    ///
    /// # Errors
    /// plotters cannot draw it.
    pub fn line(&mut self, points: impl Into<Vec<(f64, f64)>>, style: ShapeStyle) -> Drawn {
        self.chart.draw_series([PathElement::new(points, style)])?;
        Ok(())
    }

    /// A thin line from the least to the greatest value of a spread.
    ///
    /// # Errors
    /// plotters cannot draw it.
    pub fn whisker(&mut self, from: (f64, f64), to: (f64, f64)) -> Drawn {
        // Less than a pixel has no length that could be drawn.
        if self.pixel(from) == self.pixel(to) {
            return Ok(());
        }
        self.line([from, to], INK.light.stroke_width(1))
    }
}

/// plotters' text size for a text of this many pixels: its SVG back end divides by 1.24.
fn text(pixels: f64, tone: Tone) -> TextStyle<'static> {
    ("sans-serif", pixels * 1.24).into_font().color(&tone.light)
}

/// The style of frontiers and envelopes: wide, behind the marks.
pub fn best_line() -> ShapeStyle {
    BEST.light.mix(0.65).stroke_width(6)
}
