//! Where time goes: stacked bars, one a subject, with a key to their parts.

use super::chart::{Area, Caption, Chart, Drawn, LABEL_SIZE, Label, Overlay};
use super::labels::{Rect, name_room, text_width};
use super::numbers::{duration, tick};
use super::plot::{self, Axis, Plot, Room};
use super::theme::{INK, PAPER, Tone};
use crate::Result;
use plotters::prelude::*;

/// A bar.
#[derive(Debug, Clone)]
pub struct Stack {
    /// To its left.
    pub name: String,
    /// The colour of the name.
    pub tone: Tone,
    /// All of it in milliseconds, to its right.
    pub total: f64,
    /// From left to right.
    pub parts: Vec<Part>,
}

/// A part of a bar.
#[derive(Debug, Clone)]
pub struct Part {
    /// In the key.
    pub name: String,
    /// How long, in milliseconds.
    pub milliseconds: f64,
    /// Its colour.
    pub tone: Tone,
}

impl Stack {
    /// The bar in words.
    pub fn in_words(&self) -> String {
        let parts: Vec<String> =
            self.parts.iter().map(|part| format!("{} {}", part.name, duration(part.milliseconds))).collect();
        format!("{} {} ({})", self.name, duration(self.total), parts.join(", "))
    }
}

/// Draws the bars, whose parts are parts of `whole`. `None` if there are none.
///
/// # Errors
/// The chart cannot be drawn.
pub fn stacked(caption: Caption, axis: &str, whole: &str, stacks: &[Stack]) -> Result<Option<Chart>> {
    let length = |stack: &Stack| stack.parts.iter().map(|part| part.milliseconds).sum::<f64>();
    let longest = stacks.iter().map(|stack| stack.total.max(length(stack))).fold(0.0, f64::max);
    if longest <= 0.0 {
        return Ok(None);
    }
    let left = name_room(stacks.iter().map(|stack| &stack.name), LABEL_SIZE) as u32 + 10;
    let room = Room { left, bottom: 26, ..Room::default() };
    let draw = |area: &Area<'_>, overlay: &mut Overlay| -> Drawn {
        let times = Axis { name: axis, is_log: false, number: tick };
        let rows = 0.0..stacks.len() as f64;
        let mut plot = Plot::new(area, &room, (&times, 0.0..1.14 * longest), (&plot::BARS, rows))?;
        for (row, stack) in stacks.iter().enumerate() {
            let centre = (stacks.len() - row) as f64 - 0.5;
            let mut from = 0.0;
            for part in &stack.parts {
                let to = from + part.milliseconds;
                let corners = [(from, centre - 0.32), (to, centre + 0.32)];
                let ((x0, y1), (x1, y0)) = (plot.pixel(corners[0]), plot.pixel(corners[1]));
                // SVG draws none without a width.
                if x1 > x0 {
                    plot.chart.draw_series([Rectangle::new(corners, part.tone.light.filled())])?;
                    plot.line([(to, centre - 0.32), (to, centre + 0.32)], PAPER.light.stroke_width(1))?;
                }
                let share = 100.0 * part.milliseconds / stack.total;
                let time = duration(part.milliseconds);
                let tip = format!("{}, {}: {time}, {share:.0} % of the {whole}", stack.name, part.name);
                overlay.tip(Rect { x: x0, y: y0, w: x1 - x0, h: y1 - y0 }, &tip);
                from = to;
            }
            let (end, y) = plot.pixel((from, centre));
            overlay.label_bar(y, (plot.frame.x, &stack.name, stack.tone), (end, &duration(stack.total)));
        }
        let mut parts: Vec<&Part> = Vec::new();
        for part in stacks.iter().flat_map(|stack| &stack.parts) {
            if parts.iter().all(|other| other.name != part.name) {
                parts.push(part);
            }
        }
        key(area, overlay, &parts)
    };
    Chart::draw(caption, draw).map(Some)
}

/// Which colour is which part, in one row at the bottom.
fn key(area: &Area<'_>, overlay: &mut Overlay, parts: &[&Part]) -> Drawn {
    let (columns, rows) = area.get_pixel_range();
    let (left, y) = (columns.start, rows.end - 8);
    let mut x = f64::from(left) + 8.0;
    for part in parts {
        // The area's own coordinates begin at its corner.
        let corner = (x as i32 - left, y - rows.start - 11);
        area.draw(&Rectangle::new([corner, (corner.0 + 12, corner.1 + 12)], part.tone.light.filled()))?;
        let at = (x + 17.0, f64::from(y));
        overlay.label(Label { at, text: &part.name, anchor: "start", tone: INK, size: 12.0 });
        x += 17.0 + text_width(&part.name, 12.0) + 16.0;
    }
    Ok(())
}
