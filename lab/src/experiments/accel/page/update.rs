//! The section of updates.

use super::{Part, Series, curves_of};
use crate::Result;
use crate::experiments::accel::points::{Implementation, Update};
use crate::measure::Spread;
use crate::report::numbers::{duration_tick, grouped, short_count, three_digits, tick, whole};
use crate::report::{Axis, Caption, Chart, Curve, SERIES, Section, Table, curves, document, slug};
use maud::{Markup, html};

pub(super) fn part(points: &[Update]) -> Result<Option<Part>> {
    let mut scenes: Vec<&str> = points.iter().map(|point| point.scene.as_str()).collect();
    scenes.dedup();
    if scenes.is_empty() {
        return Ok(None);
    }
    let mut charts = Vec::new();
    let mut readings = Vec::new();
    for scene in scenes {
        let frames: Vec<&Update> = points.iter().filter(|point| point.scene == scene).collect();
        charts.extend(times(scene, &frames)?);
        charts.extend(quality(scene, &frames)?);
        readings.push((scene, reading(&frames)));
    }
    let is_missing = points.iter().any(|point| point.maker == Implementation::Ours && point.update_ms.is_none());
    let body = html! {
        p {
            "The vertices of a mesh move from frame to frame. Its structure is either built from scratch, or that of the first frame is "
            "updated: it keeps its tree and gets new boxes, which takes less time and lets the tree grow worse. Both by the "
            "device's timestamps."
        }
        @if is_missing { p.note { "Updates of our structures were not measured in this run." } }
        @for (scene, reading) in &readings { p { b { (scene) } ": " (reading) } }
        (document::charts(&charts))
        details {
            summary { "Every frame" }
            p {
                "Growth is how far the SAH cost has grown since the build, as the structure itself reports it. The last column has "
                "the rays per frame, in the mix that was traced, from which a build from scratch pays: then the better tree saves as "
                "much time as the build takes longer."
            }
            (every_frame(points))
        }
    };
    Ok(Some((Section::new("updates", "Updating against building from scratch", body), charts)))
}

/// The horizontal axis of all charts.
const FRAME: Axis<'_> = Axis { name: "frame", is_log: false, number: tick };

/// Where a point of a chart stands.
fn place(point: &Update) -> (Implementation, u32) {
    (point.maker, point.frame)
}

fn times(scene: &str, frames: &[&Update]) -> Result<Option<Chart>> {
    let series: [Series<'_, Update>; 4] = [
        (Implementation::Ours, "build", SERIES[0], &|point| Some(point.build_ms)),
        (Implementation::Ours, "update", SERIES[2], &|point| point.update_ms),
        (Implementation::Driver, "build", SERIES[1], &|point| Some(point.build_ms)),
        (Implementation::Driver, "update", SERIES[5], &|point| point.update_ms),
    ];
    let all = curves_of(frames, place, &series);
    let median = |curve: &Curve| {
        let medians: Vec<f64> = curve.points.iter().map(|(_, spread)| spread.median).collect();
        Spread::of(&medians).map_or(f64::NAN, |spread| spread.median)
    };
    let in_words: Vec<String> =
        all.iter().map(|curve| format!("{}: {} ms", curve.name, three_digits(median(curve)))).collect();
    let in_words = format!("In the median over the frames, {}.", in_words.join("; "));
    let triangles = grouped(frames.first().map_or(0, |point| point.triangles));
    let caption = Caption {
        name: format!("accel-update-{}", slug(scene)),
        title: format!("{scene}: building and updating, frame by frame"),
        reading: format!("{triangles} triangles; the vertical axis is logarithmic. {in_words}"),
        alt: in_words,
    };
    curves::curves(caption, &all, &FRAME, &Axis { name: "device time", is_log: true, number: duration_tick })
}

fn quality(scene: &str, frames: &[&Update]) -> Result<Option<Chart>> {
    let growth = |point: &Update| point.growth.map(Spread::once);
    let against = |point: &Update| Some(Spread::once(point.updated_sah? / point.built_sah?));
    let slowdown = |point: &Update| point.slowdown().map(Spread::once);
    let series: [Series<'_, Update>; 4] = [
        (Implementation::Ours, "SAH growth", SERIES[4], &growth),
        (Implementation::Ours, "SAH / rebuilt", SERIES[0], &against),
        (Implementation::Ours, "time of rays / rebuilt", SERIES[2], &slowdown),
        (Implementation::Driver, "time of rays / rebuilt", SERIES[5], &slowdown),
    ];
    let all = curves_of(frames, place, &series);
    let caption = Caption {
        name: format!("accel-growth-{}", slug(scene)),
        title: format!("{scene}: what updating costs the tree"),
        alt: reading(frames),
        reading: "Growth is how far the SAH cost of the updated structure has grown since it was built; beside it its SAH cost, and the \
                  time of all rays through it, over those of a structure built from scratch. 1 is as good as new."
            .into(),
    };
    curves::curves(caption, &all, &FRAME, &Axis { name: "times as much", is_log: false, number: tick })
}

/// From where on building again pays, in a sentence.
fn reading(frames: &[&Update]) -> String {
    let ours: Vec<&&Update> = frames.iter().filter(|point| point.maker == Implementation::Ours).collect();
    let (Some(first), Some(last)) = (ours.first(), ours.last()) else {
        return "our structures were not measured.".into();
    };
    let Some(update_ms) = last.update_ms else {
        return "our updates were not measured.".into();
    };
    let rays: u64 = last.rays.iter().map(|rays| rays.count).sum();
    let faster = last.build_ms.median / update_ms.median;
    let pays = |point: &&&Update| point.pays_from().is_some_and(|from| from <= rays as f64);
    // From the frame on after which it never fails to pay: noise may let single frames before it pay.
    let paying = ours.iter().rev().take_while(|point| pays(point)).last();
    let verdict = match paying {
        Some(point) => format!(
            "with {} rays per frame, building from scratch pays from frame {} on, where the SAH cost has grown to {} times what it was",
            short_count(rays as f64),
            point.frame,
            three_digits(point.growth.unwrap_or(f64::NAN)),
        ),
        None => match last.pays_from() {
            Some(from) => format!(
                "with {} rays per frame, building from scratch does not pay up to frame {}; it would there from {} rays on",
                short_count(rays as f64),
                last.frame,
                short_count(from)
            ),
            None => format!("rays lose nothing by updating up to frame {}", last.frame),
        },
    };
    format!(
        "from frame {} to {} the SAH cost of the updated structure grows to {} times what it was: {} times that of one built from scratch, \
         with {} times the time of its rays; an update takes {} of a build's time; {verdict}.",
        first.frame,
        last.frame,
        last.growth.map_or("–".into(), three_digits),
        last.updated_sah.zip(last.built_sah).map_or("–".into(), |(updated, built)| three_digits(updated / built)),
        last.slowdown().map_or("–".into(), three_digits),
        three_digits(1.0 / faster),
    )
}

fn every_frame(points: &[Update]) -> Markup {
    let most = points.iter().max_by_key(|point| point.rays.len());
    let kinds = most.into_iter().flat_map(|point| point.rays.iter().map(|rays| rays.rays.as_str()));
    let slowdown =
        |point: &Update, kind: &str| point.rays.iter().find(|rays| rays.rays == kind).and_then(|rays| rays.slowdown);
    let table = Table::new("Updates", points)
        .name("scene", |point| &point.scene)
        .number("frame", "", |point| Some(point.frame.into()), whole)
        .text("whose", |point| point.maker.name())
        .spread("build", "ms", |point| Some(point.build_ms), three_digits)
        .spread("update", "ms", |point| point.update_ms, three_digits)
        .number("growth", "×", |point| point.growth, three_digits)
        .number("SAH updated", "", |point| point.updated_sah, three_digits)
        .number("SAH rebuilt", "", |point| point.built_sah, three_digits);
    let table = kinds.fold(table, |table, kind| {
        table.spread(&format!("{kind}, updated / rebuilt"), "×", move |point| slowdown(point, kind), three_digits)
    });
    table.number("a build pays from", "rays a frame", |point| point.pays_from(), short_count).html()
}
