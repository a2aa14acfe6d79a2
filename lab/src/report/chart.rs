//! A chart: drawn once by plotters, then labelled; as a file of its own, as a picture, and inside the page.

use super::labels::{self, Rect};
use super::raster::rasterise;
use super::theme::{self, INK, MUTED, PAPER, Tone};
use crate::{Error, Result};
use plotters::coord::Shift;
use plotters::prelude::*;
use std::fmt::Write as _;

/// Width and height of every chart in pixels, before scaling.
pub const SIZE: (u32, u32) = (760, 460);
/// Pixels of a PNG per pixel of the chart.
const PNG_SCALE: f32 = 2.0;
/// Size of labels in pixels.
pub const LABEL_SIZE: f64 = 13.0;

/// A finished chart.
#[derive(Debug, Clone)]
pub struct Chart {
    /// What it is named by.
    pub caption: Caption,
    svg: String,
}

/// What every chart needs to be named by.
#[derive(Debug, Clone, Default)]
pub struct Caption {
    /// Stem of its files, and its identifier on the page.
    pub name: String,
    /// What it is.
    pub title: String,
    /// What it shows, in words, for people who cannot see it.
    pub alt: String,
    /// What a reader shall take from it; one or two sentences.
    pub reading: String,
}

/// The area that plotters draws on.
pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
/// What drawing gives: plotters' errors are many, and none is expected when drawing into memory.
pub type Drawn = std::result::Result<(), Box<dyn std::error::Error>>;

impl Chart {
    /// Draws a chart: `draw` gets the area below the title, and an overlay for labels and tooltips.
    ///
    /// # Errors
    /// [`Error::Chart`] if plotters cannot draw it (a range that is empty or not finite).
    pub fn draw(caption: Caption, draw: impl FnOnce(&Area<'_>, &mut Overlay) -> Drawn) -> Result<Chart> {
        let mut body = String::new();
        let mut overlay = Overlay::default();
        let drawing = (|| {
            let area = SVGBackend::with_string(&mut body, SIZE).into_drawing_area();
            area.fill(&PAPER.light)?;
            draw(&area.margin(44, 12, 12, 12), &mut overlay)?;
            area.present()?;
            Ok(())
        })();
        drawing.map_err(|e: Box<dyn std::error::Error>| Error::Chart {
            chart: caption.name.clone(),
            reason: e.to_string(),
        })?;
        let open = body.find(">\n").map_or(0, |at| at + 2);
        let close = body.rfind("</svg>").unwrap_or(body.len());
        let id = &caption.name;
        let svg = format!(
            "<svg width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {w} {h}\" xmlns=\"http://www.w3.org/2000/svg\" \
             font-family=\"sans-serif\" role=\"img\" aria-labelledby=\"{id}-title {id}-desc\">\n\
             <title id=\"{id}-title\">{title}</title>\n<desc id=\"{id}-desc\">{alt}</desc>\n{marks}\
             <text x=\"20\" y=\"30\" font-size=\"16\" font-weight=\"bold\" fill=\"{ink}\">{title}</text>\n{overlay}</svg>\n",
            w = SIZE.0,
            h = SIZE.1,
            title = escape(&caption.title),
            alt = escape(&caption.alt),
            marks = &body[open..close],
            ink = theme::hex(INK.light),
            overlay = overlay.svg,
        );
        Ok(Chart { caption, svg })
    }

    /// The chart as an SVG file.
    pub fn svg(&self) -> &str {
        &self.svg
    }

    /// The chart as a part of the page: every colour is a CSS variable, so that it follows the page's scheme.
    pub fn inline(&self) -> String {
        theme::all().fold(self.svg.clone(), |svg, tone| {
            svg.replace(&format!("\"{}\"", theme::hex(tone.light)), &format!("\"var(--{})\"", tone.variable))
        })
    }

    /// The chart as a PNG file, at twice its size. Text is set in Noto Sans, which the program carries: a machine without
    /// any font gives the same picture.
    ///
    /// # Errors
    /// [`Error::Chart`] if the SVG cannot be read back or the picture cannot be packed.
    pub fn png(&self) -> Result<Vec<u8>> {
        let wrong = |reason: String| Error::Chart { chart: self.caption.name.clone(), reason };
        let size = (SIZE.0 as f32 * PNG_SCALE, SIZE.1 as f32 * PNG_SCALE);
        let pixels = rasterise(&self.svg, (size.0 as u32, size.1 as u32), PNG_SCALE).map_err(wrong)?;
        pixels.encode_png().map_err(|e| wrong(e.to_string()))
    }
}

/// Text that SVG takes as text.
fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Labels and tooltips over the marks: what plotters has no notion of.
#[derive(Debug, Default)]
pub struct Overlay {
    svg: String,
}

/// A text of the overlay.
#[derive(Debug, Clone, Copy)]
pub struct Label<'a> {
    /// Anchor on the base line.
    pub at: (f64, f64),
    /// What it says.
    pub text: &'a str,
    /// `start`, `middle` or `end`.
    pub anchor: &'a str,
    /// Its colour.
    pub tone: Tone,
    /// Size in pixels.
    pub size: f64,
}

impl Overlay {
    /// A text with a halo of paper, so that lines behind it do not disturb.
    pub fn label(&mut self, label: Label<'_>) {
        self.text(label, &escape(label.text));
    }

    /// The same of a name that may be too long: then it is cut ([`labels::fitted`]), and shown whole when pointed at.
    pub fn name(&mut self, label: Label<'_>) {
        let shown = labels::fitted(label.text, label.size);
        let whole = if shown == label.text { String::new() } else { format!("<title>{}</title>", escape(label.text)) };
        self.text(label, &format!("{whole}{}", escape(&shown)));
    }

    fn text(&mut self, Label { at: (x, y), anchor, tone, size, .. }: Label<'_>, content: &str) {
        let (fill, paper) = (theme::hex(tone.light), theme::hex(PAPER.light));
        let _ = writeln!(
            self.svg,
            "<text x=\"{x:.1}\" y=\"{y:.1}\" font-size=\"{size}\" text-anchor=\"{anchor}\" fill=\"{fill}\" \
             stroke=\"{paper}\" stroke-width=\"3\" stroke-linejoin=\"round\" paint-order=\"stroke\">{content}</text>",
        );
    }

    /// A thin line, from a label to what it names.
    pub fn leader(&mut self, from: (f64, f64), to: (f64, f64), tone: Tone) {
        self.line(from, to, tone, "stroke-width=\"1\" opacity=\"0.6\"");
    }

    /// A dashed line, for what is expected and not measured.
    pub fn dashes(&mut self, from: (f64, f64), to: (f64, f64), tone: Tone) {
        self.line(from, to, tone, "stroke-width=\"1.5\" stroke-dasharray=\"5 4\"");
    }

    fn line(&mut self, (x1, y1): (f64, f64), (x2, y2): (f64, f64), tone: Tone, style: &str) {
        let stroke = theme::hex(tone.light);
        let _ = writeln!(
            self.svg,
            "<line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" stroke=\"{stroke}\" {style}/>"
        );
    }

    /// A coloured rectangle.
    pub fn band(&mut self, place: Rect, tone: Tone) {
        self.rectangle(place, &format!("rx=\"2\" fill=\"{}\"/>", theme::hex(tone.light)));
    }

    /// An invisible rectangle that shows `text` when pointed at.
    pub fn tip(&mut self, place: Rect, text: &str) {
        self.rectangle(place, &format!("opacity=\"0\"><title>{}</title></rect>", escape(text)));
    }

    fn rectangle(&mut self, Rect { x, y, w, h }: Rect, rest: &str) {
        // A phase of no time has no width, and SVG draws no such rectangle.
        let w = w.max(1.0);
        let _ = writeln!(self.svg, "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{w:.1}\" height=\"{h:.1}\" {rest}");
    }

    /// What stands beside a bar at the height `y`: its name to the left of `begin`, its figure to the right of `end`.
    pub fn label_bar(&mut self, y: f64, (begin, name, tone): (f64, &str, Tone), (end, figure): (f64, &str)) {
        let label = |x, text, anchor, tone| Label { at: (x, y + 4.5), text, anchor, tone, size: LABEL_SIZE };
        self.label(label(end + 8.0, figure, "start", MUTED));
        self.name(label(begin - 8.0, name, "end", tone));
    }

    /// Labels the points of a chart, each beside its anchor, without covering each other nor, where there is room, `lines`;
    /// `frame` is the plotting area.
    pub fn label_points(&mut self, points: &[(f64, f64)], texts: &[(String, Tone)], lines: &[Rect], frame: Rect) {
        const HEIGHT: f64 = 16.0;
        let widths: Vec<f64> = texts.iter().map(|(t, _)| labels::name_room([t], LABEL_SIZE)).collect();
        let places = labels::place(points, &widths, HEIGHT, lines, &frame);
        for ((&point, place), (text, tone)) in points.iter().zip(&places).zip(texts) {
            let near = place.nearest(point);
            if (near.0 - point.0).hypot(near.1 - point.1) > 14.0 {
                self.leader(near, point, *tone);
            }
            // The text's estimated width is on the safe side: it stands at the end of its place that faces the point.
            let (x, anchor) = match place.x + 0.5 * place.w - point.0 {
                d if d > 1.0 => (place.x, "start"),
                d if d < -1.0 => (place.x + place.w, "end"),
                _ => (place.x + 0.5 * place.w, "middle"),
            };
            let at = (x, place.y + 0.78 * HEIGHT);
            self.name(Label { at, text, anchor, tone: *tone, size: LABEL_SIZE });
        }
    }

    /// Labels lines at their right ends, spread so that they do not cover each other;
    /// [`room_at_ends`](super::plot::room_at_ends) is the margin for it.
    pub fn label_ends(&mut self, ends: &[(f64, f64)], texts: &[(String, Tone)], frame: Rect) {
        let heights: Vec<f64> = ends.iter().map(|e| e.1).collect();
        let moved = labels::spread(&heights, 17.0, frame.y + 6.0, frame.y + frame.h - 6.0);
        for ((&(x, y), moved), (text, tone)) in ends.iter().zip(moved).zip(texts) {
            self.leader((x + 2.0, y), (x + 12.0, moved), *tone);
            let at = (x + 15.0, moved + 4.5);
            self.name(Label { at, text, anchor: "start", tone: *tone, size: LABEL_SIZE });
        }
    }
}
