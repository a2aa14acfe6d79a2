//! The section of updates.

use super::Section;
use crate::Result;
use crate::experiments::accel::points::{Maker, Update, UpdatedRays};
use crate::measure::statistics::Spread;
use crate::report::chart::{Caption, Chart};
use crate::report::curves::{self, Axis, Curve};
use crate::report::elements::{column, number, scroll, spread};
use crate::report::names::slug;
use crate::report::numbers::{duration_tick, grouped, short_count, three_digits, tick};
use crate::report::theme::{SERIES, Tone};
use maud::{Markup, html};

pub(super) fn section(points: &[Update]) -> Result<Option<Section>> {
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
    let is_missing = points.iter().any(|point| point.maker == Maker::Ours && point.update_ms.is_none());
    Ok(Some(Section {
        id: "updates",
        title: "Updating against building from scratch",
        charts,
        above: html! {
            p {
                "The vertices of a mesh move from frame to frame. Its structure is either built from scratch, or that of the first frame is "
                "updated: it keeps its tree and gets new boxes, which takes less time and lets the tree grow worse. Both by the "
                "device's timestamps."
            }
            @if is_missing { p.note { "Structures of ours were not updated here: that was not measured." } }
            @for (scene, reading) in &readings { p { b { (scene) } ": " (reading) } }
        },
        below: html! {
            details {
                summary { "Every frame" }
                p {
                    "Growth is what the structure itself tells of its SAH cost since it was built. Building from scratch pays from as many rays a "
                    "frame on, in the mix that was traced, as save by the better tree what building takes longer."
                }
                (scroll("Updates", table(points)))
            }
        },
    }))
}

/// A curve over the frames of one maker.
fn curve(frames: &[&Update], maker: Maker, name: &str, tone: Tone, of: impl Fn(&Update) -> Option<Spread>) -> Curve {
    let of_maker = frames.iter().filter(|point| point.maker == maker);
    let points = of_maker.filter_map(|point| Some((f64::from(point.frame), of(point)?))).collect();
    Curve { name: format!("{} {name}", maker.name()), tone, points, law: None }
}

fn times(scene: &str, frames: &[&Update]) -> Result<Option<Chart>> {
    let all = [
        curve(frames, Maker::Ours, "build", SERIES[0], |point| Some(point.build_ms)),
        curve(frames, Maker::Ours, "update", SERIES[2], |point| point.update_ms),
        curve(frames, Maker::Driver, "build", SERIES[1], |point| Some(point.build_ms)),
        curve(frames, Maker::Driver, "update", SERIES[5], |point| point.update_ms),
    ];
    let all: Vec<Curve> = all.into_iter().filter(|curve| !curve.points.is_empty()).collect();
    let median = |curve: &Curve| {
        let medians: Vec<f64> = curve.points.iter().map(|(_, spread)| spread.median).collect();
        Spread::of(&medians).map_or(f64::NAN, |spread| spread.median)
    };
    let in_words: Vec<String> =
        all.iter().map(|curve| format!("{}: {} ms", curve.name, three_digits(median(curve)))).collect();
    let triangles = frames.first().map_or(0, |point| point.triangles);
    let caption = Caption {
        name: format!("accel-update-{}", slug(scene)),
        title: format!("{scene}: building and updating, frame by frame"),
        alt: format!("In the median over the frames, {}.", in_words.join("; ")),
        reading: format!(
            "{} triangles; the vertical axis is logarithmic. In the median over the frames, {}.",
            grouped(triangles),
            in_words.join("; ")
        ),
    };
    let x = Axis { name: "frame", is_log: false, number: &|v| tick(*v) };
    curves::curves(caption, &all, &x, &Axis { name: "device time", is_log: true, number: &|v| duration_tick(*v) })
}

fn quality(scene: &str, frames: &[&Update]) -> Result<Option<Chart>> {
    let one = |value: f64| Spread { median: value, min: value, max: value, runs: 1 };
    let against = |point: &Update| Some(one(point.updated_sah? / point.built_sah?));
    let all = [
        curve(frames, Maker::Ours, "SAH growth", SERIES[4], |point| point.growth.map(one)),
        curve(frames, Maker::Ours, "SAH / anew", SERIES[0], against),
        curve(frames, Maker::Ours, "time of rays / anew", SERIES[2], |point| point.slowdown().map(one)),
        curve(frames, Maker::Driver, "time of rays / anew", SERIES[5], |point| point.slowdown().map(one)),
    ];
    let all: Vec<Curve> = all.into_iter().filter(|curve| !curve.points.is_empty()).collect();
    let caption = Caption {
        name: format!("accel-growth-{}", slug(scene)),
        title: format!("{scene}: what updating costs the tree"),
        alt: reading(frames),
        reading: "Growth is what the updated structure tells of its SAH cost since it was built; beside it its SAH cost, and the \
                  time of all rays through it, over those of a structure built from scratch. 1 is as good as new."
            .into(),
    };
    let x = Axis { name: "frame", is_log: false, number: &|v| tick(*v) };
    curves::curves(caption, &all, &x, &Axis { name: "times as much", is_log: false, number: &|v| tick(*v) })
}

/// From where on building anew pays, in a sentence.
fn reading(frames: &[&Update]) -> String {
    let ours: Vec<&&Update> = frames.iter().filter(|point| point.maker == Maker::Ours).collect();
    let (Some(first), Some(last)) = (ours.first(), ours.last()) else {
        return "nothing of ours was measured.".into();
    };
    let Some(update_ms) = last.update_ms else {
        return "updates of ours were not measured.".into();
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

fn table(points: &[Update]) -> Markup {
    let kinds: Vec<&UpdatedRays> =
        points.iter().max_by_key(|point| point.rays.len()).map_or(vec![], |point| point.rays.iter().collect());
    let of =
        |point: &Update, kind: &str| point.rays.iter().find(|rays| rays.rays == kind).and_then(|rays| rays.slowdown);
    html! {
        table.sortable {
            thead { tr {
                (column("scene", "", false)) (column("frame", "", true)) (column("whose", "", false)) (column("build", "ms", true))
                (column("update", "ms", true)) (column("growth", "×", true)) (column("SAH updated", "", true))
                (column("SAH anew", "", true))
                @for kind in &kinds { (column(&format!("{}, updated / anew", kind.rays), "×", true)) }
                (column("anew pays from", "rays a frame", true))
            } }
            tbody {
                @for point in points {
                    tr {
                        th scope="row" data-value=(point.scene) { (point.scene) }
                        (number(Some(point.frame.into()), |v| format!("{v:.0}")))
                        td data-value=(point.maker.name()) { (point.maker.name()) }
                        (spread(Some(point.build_ms), three_digits))
                        (spread(point.update_ms, three_digits))
                        (number(point.growth, three_digits))
                        (number(point.updated_sah, three_digits))
                        (number(point.built_sah, three_digits))
                        @for kind in &kinds { (spread(of(point, &kind.rays), three_digits)) }
                        (number(point.pays_from(), short_count))
                    }
                }
            }
        }
    }
}
