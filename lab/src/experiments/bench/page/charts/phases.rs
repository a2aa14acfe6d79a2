//! Where the time of a build goes: its phases as stacked bars, one bar a builder.

use crate::Result;
use crate::measure::record::Record;
use crate::report::chart::{Area, Axes, Caption, Chart, Drawn, LABEL_SIZE, Label, Overlay, frame, mesh, pixel};
use crate::report::labels::{Rect, name_room, text_width};
use crate::report::names::{short, slug};
use crate::report::numbers::{duration, tick};
use crate::report::theme::{INK, Legend, MUTED, PAPER};
use plotters::prelude::*;

/// The phases of every builder on one scene. `None` if no builder tells its phases.
///
/// # Errors
/// The chart cannot be drawn.
pub fn phases(records: &[&Record], legend: &Legend) -> Result<Option<Chart>> {
    let bars: Vec<&Record> = records.iter().copied().filter(|r| !r.build.phases.is_empty()).collect();
    let Some(first) = bars.first() else { return Ok(None) };
    let scene = &first.scene;
    let longest = bars.iter().map(|r| r.build.median_ms.max(sum(r))).fold(0.0, f64::max);
    let in_words = |r: &&Record| {
        let phases = r.build.phases.iter().map(|p| format!("{} {}", p.name, duration(p.median_ms)));
        format!("{} {} ({})", short(&r.builder), duration(r.build.median_ms), phases.collect::<Vec<_>>().join(", "))
    };
    let caption = Caption {
        name: format!("{}-phases", slug(scene)),
        title: format!("{scene}: where the build time goes"),
        alt: bars.iter().map(in_words).collect::<Vec<_>>().join("; "),
        reading:
            "One bar a builder, its phases from left to right in the order in which they run. The table below says how \
                  far each is from the time that a plain copy of the bytes it must move would take."
                .into(),
    };
    let draw = |area: &Area<'_>, overlay: &mut Overlay| -> Drawn {
        let names = name_room(bars.iter().map(|r| short(&r.builder)), LABEL_SIZE);
        let mut chart = ChartBuilder::on(area)
            .x_label_area_size(46)
            .margin_left(names as u32 + 10)
            .margin_bottom(26)
            .build_cartesian_2d(0.0..1.14 * longest, 0.0..bars.len() as f64)?;
        let number = |v: &f64| tick(*v);
        mesh(&mut chart, &Axes { x: "milliseconds", y: "", x_number: &number, y_number: &|_| String::new() })?;
        let inner = frame(&chart);
        for (row, record) in bars.iter().enumerate() {
            let centre = (bars.len() - row) as f64 - 0.5;
            let mut from = 0.0;
            for phase in &record.build.phases {
                let to = from + phase.median_ms;
                let corners = [(from, centre - 0.32), (to, centre + 0.32)];
                chart.draw_series([Rectangle::new(corners, legend.phase(&phase.name).light.filled())])?;
                let ((x0, y1), (x1, y0)) = (pixel(&chart, corners[0]), pixel(&chart, corners[1]));
                let share = 100.0 * phase.median_ms / record.build.median_ms;
                let tip = format!("{}: {}, {share:.0} % of the build", phase.name, duration(phase.median_ms));
                overlay.tip(Rect { x: x0, y: y0, w: x1 - x0, h: y1 - y0 }, &tip);
                from = to;
            }
            let edges = record.build.phases.iter().scan(0.0, |at, p| {
                *at += p.median_ms;
                Some(*at)
            });
            for edge in edges {
                let line = vec![(edge, centre - 0.32), (edge, centre + 0.32)];
                chart.draw_series([PathElement::new(line, PAPER.light.stroke_width(1))])?;
            }
            let (end, y) = pixel(&chart, (from, centre));
            let total = duration(record.build.median_ms);
            let at = (end + 8.0, y + 4.5);
            overlay.label(Label { at, text: &total, anchor: "start", tone: MUTED, size: LABEL_SIZE });
            let at = (inner.x - 8.0, y + 4.5);
            let name = short(&record.builder);
            let tone = legend.builder(&record.builder);
            overlay.name(Label { at, text: &name, anchor: "end", tone, size: LABEL_SIZE });
        }
        let shown = |name: &&String| bars.iter().any(|r| r.build.phases.iter().any(|p| p.name == **name));
        key(area, overlay, &legend.phases().iter().filter(shown).collect::<Vec<_>>(), legend)
    };
    Chart::draw(caption, draw).map(Some)
}

fn sum(record: &Record) -> f64 {
    record.build.phases.iter().map(|p| p.median_ms).sum()
}

/// Which colour is which phase, in one row at the bottom.
fn key(area: &Area<'_>, overlay: &mut Overlay, names: &[&String], legend: &Legend) -> Drawn {
    let (columns, rows) = area.get_pixel_range();
    let (left, y) = (columns.start, rows.end - 8);
    let mut x = f64::from(left) + 8.0;
    for name in names {
        // The area's own coordinates begin at its corner.
        let corner = (x as i32 - left, y - rows.start - 11);
        area.draw(&Rectangle::new([corner, (corner.0 + 12, corner.1 + 12)], legend.phase(name).light.filled()))?;
        overlay.label(Label { at: (x + 17.0, f64::from(y)), text: name, anchor: "start", tone: INK, size: 12.0 });
        x += 17.0 + text_width(name, 12.0) + 16.0;
    }
    Ok(())
}
