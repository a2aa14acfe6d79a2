//! The chart that decides: total time of a build and its rays, over the number of rays; and the lower envelope.

use crate::Result;
use crate::measure::record::Record;
use crate::measure::total_time::{Line, Stretch, lower_envelope};
use crate::report::chart::{Area, Caption, Chart, Drawn, LABEL_SIZE, Label, Overlay};
use crate::report::labels::Rect;
use crate::report::names::{short, slug};
use crate::report::numbers::{duration_tick, short_count};
use crate::report::plot::{Axis, Plot, Room, best_line, room_at_ends};
use crate::report::theme::{Legend, MUTED, Tone};
use plotters::style::Color;

/// Points a curve.
const STEPS: usize = 72;

/// Total time over rays a build for one scene. `None` if nothing was traced.
///
/// # Errors
/// The chart cannot be drawn.
pub fn total_time(records: &[&Record], legend: &Legend) -> Result<Option<Chart>> {
    let traced: Vec<(&Record, Line)> =
        records.iter().filter_map(|r| Some((*r, Line::new(r.build.median_ms, r.mrays_s()?)))).collect();
    let Some((first, _)) = traced.first() else { return Ok(None) };
    let scene = &first.scene;
    let lines: Vec<Line> = traced.iter().map(|t| t.1).collect();
    let envelope = lower_envelope(&lines);
    let winners_in_words = verdict(&envelope, &|stretch: &Stretch| short(&traced[stretch.line].0.builder));
    let caption = Caption {
        name: format!("{}-total-time", slug(scene)),
        title: format!("{scene}: total time of a build and its rays"),
        alt: format!("The lower envelope: {winners_in_words}."),
        reading: format!(
            "The gold line is the lower envelope, and the strip above says whose it is: {winners_in_words}. Both axes are \
             logarithmic."
        ),
    };
    let rays = ray_range(&lines, &envelope);
    let samples: Vec<f64> = (0..=STEPS).map(|i| rays.0 * (rays.1 / rays.0).powf(i as f64 / STEPS as f64)).collect();
    let least = lines.iter().map(|l| l.at(rays.0)).fold(f64::INFINITY, f64::min);
    let greatest = lines.iter().map(|l| l.at(rays.1)).fold(0.0, f64::max);
    let texts: Vec<_> = traced.iter().map(|(r, _)| (short(&r.builder), legend.builder(&r.builder))).collect();
    let room = Room { top: 34, left: 76, right: room_at_ends(texts.iter().map(|t| &t.0)), ..Room::default() };
    let draw = |area: &Area<'_>, overlay: &mut Overlay| -> Drawn {
        let x = Axis { name: "rays traced a build", is_log: true, number: short_count };
        let y = Axis { name: "build and rays", is_log: true, number: duration_tick };
        let mut plot = Plot::new(area, &room, (&x, rays.0..rays.1), (&y, 0.8 * least..1.2 * greatest))?;
        let lowest = |&r: &f64| (r, lines.iter().map(|l| l.at(r)).fold(f64::INFINITY, f64::min));
        plot.line(samples.iter().map(lowest).collect::<Vec<_>>(), best_line())?;
        for (line, (_, tone)) in lines.iter().zip(&texts) {
            let curve: Vec<_> = samples.iter().map(|&r| (r, line.at(r))).collect();
            plot.line(curve, tone.light.stroke_width(2))?;
        }
        let ends: Vec<_> = lines.iter().map(|l| plot.pixel((rays.1, l.at(rays.1)))).collect();
        overlay.label_ends(&ends, &texts, plot.frame);
        let x_of = |rays_a_build: f64| plot.pixel((rays_a_build, greatest)).0;
        winners(overlay, plot.frame, &envelope, &texts, x_of);
        Ok(())
    };
    Chart::draw(caption, draw).map(Some)
}

/// A strip above the chart: the best builder for each number of rays, in the colours of the builders, and where they take over.
fn winners(
    overlay: &mut Overlay,
    frame: Rect,
    envelope: &[Stretch],
    names: &[(String, Tone)],
    x_of: impl Fn(f64) -> f64,
) {
    const HEIGHT: f64 = 9.0;
    let y = frame.y - 34.0;
    let end = frame.x + frame.w;
    let label = |overlay: &mut Overlay, at, text: &str, anchor, size| {
        overlay.label(Label { at, text, anchor, tone: MUTED, size });
    };
    label(overlay, (end + 15.0, y + HEIGHT), "← best", "start", LABEL_SIZE);
    let mut last_label = f64::NEG_INFINITY;
    for (i, stretch) in envelope.iter().enumerate() {
        let left = if i == 0 { frame.x } else { x_of(stretch.from) };
        let right = envelope.get(i + 1).map_or(end, |next| x_of(next.from));
        let (name, tone) = &names[stretch.line];
        let band = Rect { x: left, y, w: right - left, h: HEIGHT };
        overlay.band(band, *tone);
        overlay.tip(band, name);
        // Two that follow closely share a place: the first is written, the caption has them all.
        if i > 0 && left - last_label > 55.0 {
            label(overlay, (left, y + HEIGHT + 15.0), &short_count(stretch.from), "middle", 12.0);
            last_label = left;
        }
    }
}

/// The envelope in words: `lbvh up to 2 M rays, then ploc`.
fn verdict(envelope: &[Stretch], name: &impl Fn(&Stretch) -> String) -> String {
    let Some((first, rest)) = envelope.split_first() else { return String::new() };
    if rest.is_empty() {
        return format!("{} at any number", name(first));
    }
    rest.iter().fold(name(first), |text, stretch| {
        format!("{text} up to {}, then {}", short_count(stretch.from), name(stretch))
    })
}

/// The numbers of rays worth showing: from where building is nearly all to where tracing is, every crossing inside.
fn ray_range(lines: &[Line], envelope: &[Stretch]) -> (f64, f64) {
    let balance = |l: &Line| (l.build / l.ray).max(1.0);
    let least = lines.iter().map(balance).fold(f64::INFINITY, f64::min);
    let greatest = lines.iter().map(balance).fold(1.0, f64::max);
    let crossings = || envelope.iter().skip(1).map(|s| s.from);
    let from = crossings().fold(least, f64::min).max(1.0).log10().floor() - 1.0;
    let to = crossings().fold(greatest, f64::max).log10().ceil() + 1.0;
    (10.0_f64.powf(from.max(0.0)), 10.0_f64.powf(to))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_range_holds_every_crossing_with_room_around() {
        let lines = [Line { build: 1.0, ray: 1e-3 }, Line { build: 100.0, ray: 1e-4 }];
        let envelope = lower_envelope(&lines);
        let crossing = envelope[1].from;
        let (from, to) = ray_range(&lines, &envelope);
        assert!(from * 10.0 <= crossing && crossing * 10.0 <= to, "{from} {crossing} {to}");
    }

    #[test]
    fn the_verdict_names_who_wins_from_where() {
        let envelope = [Stretch { line: 0, from: 0.0 }, Stretch { line: 1, from: 2e6 }];
        let name = |s: &Stretch| ["lbvh", "ploc"][s.line].to_owned();
        assert_eq!(verdict(&envelope, &name), "lbvh up to 2 M, then ploc");
        assert_eq!(verdict(&envelope[..1], &name), "lbvh at any number");
    }
}
