//! How build time grows with the scene: time over triangles on logarithmic axes, with the fitted exponent of each builder.

use crate::Result;
use crate::experiments::bench::growth::PowerLaw;
use crate::measure::record::Record;
use crate::report::chart::{Area, Axes, Caption, Chart, Drawn, Overlay, frame, log_axis, mesh, pixel, room_at_ends};
use crate::report::labels::Rect;
use crate::report::names::short;
use crate::report::numbers::{duration, duration_tick, short_count};
use crate::report::theme::Legend;
use plotters::prelude::*;

/// A builder over all scenes.
struct Series<'a> {
    builder: &'a str,
    /// Triangles, milliseconds, scene.
    points: Vec<(f64, f64, &'a str)>,
    law: Option<PowerLaw>,
}

impl Series<'_> {
    fn label(&self) -> String {
        match self.law {
            Some(law) => format!("{}: n^{:.2}", short(self.builder), law.exponent),
            None => short(self.builder),
        }
    }
}

/// Build time over triangle count, all scenes and builders. `None` if all scenes have the same number of triangles.
///
/// # Errors
/// The chart cannot be drawn.
pub fn growth(records: &[&Record], legend: &Legend) -> Result<Option<Chart>> {
    let series: Vec<Series<'_>> = legend.builders().iter().filter_map(|builder| series(builder, records)).collect();
    let all = || series.iter().flat_map(|s| &s.points);
    let range = |of: fn(&(f64, f64, &str)) -> f64| {
        all().map(of).fold((f64::INFINITY, 0.0_f64), |(lo, hi), v| (lo.min(v), hi.max(v)))
    };
    let (triangles, times) = (range(|p| p.0), range(|p| p.1));
    if series.is_empty() || triangles.0 >= triangles.1 {
        return Ok(None);
    }
    let exponents: Vec<String> = series.iter().filter(|s| s.law.is_some()).map(Series::label).collect();
    let caption = Caption {
        name: "growth".into(),
        title: "Build time over the number of triangles".into(),
        alt: format!("Fitted laws, time proportional to n to the power: {}.", exponents.join("; ")),
        reading: "One mark a scene, both axes logarithmic, and the power law fitted through each builder's marks by least \
                  squares. An exponent of 1 is proportional; above 1, twice the triangles cost more than twice the time."
            .into(),
    };
    let texts: Vec<_> = series.iter().map(|s| (s.label(), legend.builder(s.builder))).collect();
    let draw = |area: &Area<'_>, overlay: &mut Overlay| -> Drawn {
        let (x, y) = (0.8 * triangles.0..1.2 * triangles.1, 0.7 * times.0..1.4 * times.1);
        let mut chart = ChartBuilder::on(area)
            .x_label_area_size(46)
            .y_label_area_size(76)
            .margin_right(room_at_ends(texts.iter().map(|t| &t.0)))
            .build_cartesian_2d(log_axis(x), log_axis(y))?;
        let axes =
            Axes { x: "triangles", y: "build time", x_number: &|v| short_count(*v), y_number: &|v| duration_tick(*v) };
        mesh(&mut chart, &axes)?;
        let mut ends = Vec::new();
        for s in &series {
            let tone = legend.builder(s.builder);
            let last = s.points.iter().map(|p| p.0).fold(0.0, f64::max);
            if let Some(law) = s.law {
                let first = s.points.iter().map(|p| p.0).fold(f64::INFINITY, f64::min);
                let line = vec![(first, law.at(first)), (last, law.at(last))];
                chart.draw_series([PathElement::new(line, tone.light.stroke_width(2))])?;
            }
            chart.draw_series(s.points.iter().map(|p| Circle::new((p.0, p.1), 4, tone.light.filled())))?;
            for &(n, ms, scene) in &s.points {
                let (x, y) = pixel(&chart, (n, ms));
                let tip = format!("{}\n{scene}: {} triangles, {}", s.builder, short_count(n), duration(ms));
                overlay.tip(Rect { x: x - 7.0, y: y - 7.0, w: 14.0, h: 14.0 }, &tip);
            }
            let height = s.law.map_or(s.points[0].1, |law| law.at(last));
            let right = pixel(&chart, (1.2 * triangles.1, height));
            ends.push((right.0, right.1));
        }
        overlay.label_ends(&ends, &texts, frame(&chart));
        Ok(())
    };
    Chart::draw(caption, draw).map(Some)
}

fn series<'a>(builder: &'a str, records: &[&'a Record]) -> Option<Series<'a>> {
    let points: Vec<(f64, f64, &str)> = records
        .iter()
        .filter(|r| r.builder == builder && r.build.median_ms > 0.0)
        .map(|r| (r.triangles as f64, r.build.median_ms, r.scene.as_str()))
        .collect();
    let law = PowerLaw::fit(&points.iter().map(|p| (p.0, p.1)).collect::<Vec<_>>());
    (!points.is_empty()).then_some(Series { builder, points, law })
}
