//! The charts: build and trace times stacked, a bar a way; and each way's frames one after the other.

use super::Measured;
use super::standings::{Standing, standings};
use crate::Result;
use crate::experiments::animate::Way;
use crate::experiments::animate::points::Animated;
use crate::measure::statistics::Spread;
use crate::report::chart::{Area, Axes, Caption, Chart, Drawn, LABEL_SIZE, Label, Overlay, frame, mesh, pixel};
use crate::report::curves::{self, Axis, Curve};
use crate::report::labels::{Rect, name_room, text_width};
use crate::report::numbers::{duration, duration_tick, tick};
use crate::report::theme::{INK, MUTED, PAPER, PHASES, SERIES, Tone};
use plotters::prelude::*;

/// The colour of a way, on all of the page.
pub fn tone(way: Way) -> Tone {
    SERIES[Way::ALL.iter().position(|&other| other == way).unwrap_or(0)]
}

/// The colour of a part of a bar: building, then the kinds of rays.
fn part_tone(part: usize) -> Tone {
    // Building apart from the rays, whose neighbours are told apart, too.
    PHASES[[0, 3, 5, 2, 6, 1, 4, 7][part % 8]]
}

pub(super) fn all(measured: &Measured) -> Result<Vec<Chart>> {
    let scene = measured.frames.first().map_or("", |frame| frame.scene.as_str());
    let standings = standings(&measured.frames);
    let charts = [stacked(scene, &standings)?, frames(scene, &measured.frames)?, builds(scene, &measured.frames)?];
    Ok(charts.into_iter().flatten().collect())
}

/// Building and each kind of rays, in their order.
fn parts(standing: &Standing) -> impl Iterator<Item = (&str, f64)> {
    [("build", standing.build_ms)].into_iter().chain(standing.trace_ms.iter().map(|(kind, ms)| (kind.as_str(), *ms)))
}

fn stacked(scene: &str, standings: &[Standing]) -> Result<Option<Chart>> {
    let longest = standings.iter().map(|s| s.frame_ms).fold(0.0, f64::max);
    if longest <= 0.0 {
        return Ok(None);
    }
    let in_words = |standing: &Standing| {
        let parts: Vec<String> = parts(standing).map(|(name, ms)| format!("{name} {}", duration(ms))).collect();
        format!("{} {} ({})", standing.way, duration(standing.frame_ms), parts.join(", "))
    };
    let caption = Caption {
        name: "animate-frame".into(),
        title: format!("{scene}: where the time of a frame goes"),
        alt: standings.iter().map(in_words).collect::<Vec<_>>().join("; "),
        reading: "One bar a way: what is built every frame, then the rays, kind by kind; means over the frames. Shorter is better.".into(),
    };
    let draw = |area: &Area<'_>, overlay: &mut Overlay| -> Drawn {
        let names = name_room(standings.iter().map(|s| s.way.name()), LABEL_SIZE);
        let mut chart = ChartBuilder::on(area)
            .x_label_area_size(46)
            .margin_left(names as u32 + 10)
            .margin_bottom(26)
            .build_cartesian_2d(0.0..1.14 * longest, 0.0..standings.len() as f64)?;
        let axes = Axes { x: "milliseconds a frame", y: "", x_number: &|v| tick(*v), y_number: &|_| String::new() };
        mesh(&mut chart, &axes)?;
        let inner = frame(&chart);
        for (row, standing) in standings.iter().enumerate() {
            let centre = (standings.len() - row) as f64 - 0.5;
            let mut from = 0.0;
            for (i, (name, ms)) in parts(standing).enumerate() {
                let corners = [(from, centre - 0.32), (from + ms, centre + 0.32)];
                let ((x0, y1), (x1, y0)) = (pixel(&chart, corners[0]), pixel(&chart, corners[1]));
                // SVG draws none without a width.
                if x1 > x0 {
                    chart.draw_series([Rectangle::new(corners, part_tone(i).light.filled())])?;
                    let edge = vec![(from + ms, centre - 0.32), (from + ms, centre + 0.32)];
                    chart.draw_series([PathElement::new(edge, PAPER.light.stroke_width(1))])?;
                }
                let share = 100.0 * ms / standing.frame_ms;
                let tip = format!("{}, {name}: {}, {share:.0} % of the frame", standing.way, duration(ms));
                overlay.tip(Rect { x: x0, y: y0, w: x1 - x0, h: y1 - y0 }, &tip);
                from += ms;
            }
            let (end, y) = pixel(&chart, (from, centre));
            let (total, name) = (duration(standing.frame_ms), standing.way.name());
            let label = |x, text, anchor, tone| Label { at: (x, y + 4.5), text, anchor, tone, size: LABEL_SIZE };
            overlay.label(label(end + 8.0, &total, "start", MUTED));
            overlay.name(label(inner.x - 8.0, name, "end", tone(standing.way)));
        }
        let most = standings.iter().max_by_key(|standing| standing.trace_ms.len());
        key(area, overlay, most.into_iter().flat_map(parts).map(|(name, _)| name))
    };
    Chart::draw(caption, draw).map(Some)
}

/// Which colour is which part, in one row at the bottom.
fn key<'n>(area: &Area<'_>, overlay: &mut Overlay, names: impl Iterator<Item = &'n str>) -> Drawn {
    let (columns, rows) = area.get_pixel_range();
    let (left, y) = (columns.start, rows.end - 8);
    let mut x = f64::from(left) + 8.0;
    for (i, name) in names.enumerate() {
        // The area's own coordinates begin at its corner.
        let corner = (x as i32 - left, y - rows.start - 11);
        area.draw(&Rectangle::new([corner, (corner.0 + 12, corner.1 + 12)], part_tone(i).light.filled()))?;
        overlay.label(Label { at: (x + 17.0, f64::from(y)), text: name, anchor: "start", tone: INK, size: 12.0 });
        x += 17.0 + text_width(name, 12.0) + 16.0;
    }
    Ok(())
}

/// A curve a way over the frames.
fn over_frames(points: &[Animated], of: impl Fn(&Animated) -> Spread) -> Vec<Curve> {
    let curve = |way: Way| {
        let of_way = points.iter().filter(|point| point.way == way);
        let points = of_way.map(|point| (f64::from(point.frame), of(point))).collect();
        Curve { name: way.name().to_owned(), tone: tone(way), points, law: None }
    };
    Way::ALL.into_iter().map(curve).filter(|curve| !curve.points.is_empty()).collect()
}

fn frames(scene: &str, points: &[Animated]) -> Result<Option<Chart>> {
    let total = |point: &Animated| {
        let sum = |of: fn(&Spread) -> f64| {
            of(&point.build_ms) + point.trace.iter().map(|rays| of(&rays.trace_ms)).sum::<f64>()
        };
        Spread { median: sum(|s| s.median), min: sum(|s| s.min), max: sum(|s| s.max), runs: point.build_ms.runs }
    };
    let caption = Caption {
        name: "animate-frames".into(),
        title: format!("{scene}: building and tracing, frame by frame"),
        alt: "The time of every frame in each way".into(),
        reading: "Build and rays together; the vertical axis is logarithmic. The line through a point goes from the fastest to the \
                  slowest run."
            .into(),
    };
    let x = Axis { name: "frame", is_log: false, number: tick };
    let y = Axis { name: "time of a frame", is_log: true, number: duration_tick };
    curves::curves(caption, &over_frames(points, total), &x, &y)
}

fn builds(scene: &str, points: &[Animated]) -> Result<Option<Chart>> {
    let caption = Caption {
        name: "animate-builds".into(),
        title: format!("{scene}: building, frame by frame"),
        alt: "What is built in every frame in each way: its time".into(),
        reading: "What a way must do a frame before rays can be traced; the vertical axis is logarithmic.".into(),
    };
    let x = Axis { name: "frame", is_log: false, number: tick };
    let y = Axis { name: "build time", is_log: true, number: duration_tick };
    curves::curves(caption, &over_frames(points, |point| point.build_ms), &x, &y)
}
