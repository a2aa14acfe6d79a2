//! The section of re-braiding.

use super::Section;
use super::goals::{self, mean_gain, overlaps};
use crate::Result;
use crate::experiments::accel::points::{BraidedRays, Rebraid, Side};
use crate::report::bars::{self, Bar, Bars};
use crate::report::chart::{Caption, Chart};
use crate::report::elements::{column, number, scroll, spread};
use crate::report::names::slug;
use crate::report::numbers::{grouped, short_count, three_digits, tick};
use crate::report::theme::SERIES;
use maud::{Markup, html};

pub(super) fn section(points: &[Rebraid]) -> Result<Option<Section>> {
    if points.is_empty() {
        return Ok(None);
    }
    let charts: Vec<Option<Chart>> = points.iter().map(chart).collect::<Result<_>>()?;
    Ok(Some(Section {
        id: "rebraid",
        title: "Re-braiding",
        charts: charts.into_iter().flatten().collect(),
        above: html! {
            p {
                "A top level that opens instances whose boxes are loose (Benthin, Woop, Wald 2017), against one that does not: "
                "rays of each kind through one and the other in turn, by the device's timestamps."
            }
            @for point in points.iter().filter(|point| point.rays.iter().any(|rays| rays.different > 0)) {
                p.note.wrong { (point.scene) ": some rays hit something else through the re-braided top level. That is an error of ours." }
            }
        },
        below: html! {
            (scroll("Re-braiding, building", buildings(points)))
            details {
                summary { "Rays and their work" }
                p {
                    "Nodes of the top level, instances entered, nodes below and triangles tested, in the mean over the rays: first "
                    "through the plain top level, then through the re-braided one."
                }
                (scroll("Re-braiding, rays", tracing(points)))
            }
        },
    }))
}

/// The gain of each kind of ray in one scene.
fn chart(point: &Rebraid) -> Result<Option<Chart>> {
    let bar = |(i, rays): (usize, &BraidedRays)| Bar {
        label: rays.rays.clone(),
        figure: three_digits(rays.gain.median),
        spread: rays.gain,
        tone: SERIES[i % SERIES.len()],
    };
    let all: Vec<Bar> = point.rays.iter().enumerate().map(bar).collect();
    let in_words: Vec<String> = all.iter().map(|bar| format!("{} {}", bar.label, bar.figure)).collect();
    let mean = mean_gain(&point.rays).map_or(f64::NAN, |gain| gain.median);
    let slowest = point.rays.iter().min_by(|a, b| a.gain.median.total_cmp(&b.gain.median));
    let slower = match slowest {
        Some(rays) if rays.gain.median < 1.0 => format!("; {} rays lose", rays.rays),
        _ => String::new(),
    };
    let boxes = match overlaps(point) {
        true => format!("each instance's box overlaps {} others", three_digits(point.overlaps)),
        false => "hardly any instances' boxes overlap".into(),
    };
    let caption = Caption {
        name: format!("accel-rebraid-{}", slug(&point.scene)),
        title: format!("{}: speed with re-braiding over speed without", point.scene),
        alt: in_words.join("; "),
        reading: format!(
            "{} instances of {} parts; {boxes}. Right of 1, re-braiding is faster: {} in the geometric mean over kinds{slower}. \
             The line through a bar goes from the least to the greatest of the runs.",
            grouped(point.instances.into()),
            point.parts,
            three_digits(mean),
        ),
    };
    let goal = goals::least_gain(point);
    bars::bars(
        caption,
        &Bars {
            bars: all,
            axis: "time without / time with",
            number: &|v| tick(*v),
            marks: vec![(goal, format!("goal {goal}"))],
        },
    )
}

/// What building takes with and without, beside the driver's.
fn buildings(points: &[Rebraid]) -> Markup {
    let sides = |point: &Rebraid| -> Vec<(&'static str, Side)> {
        let ours = [("hedgerow", &point.off), ("hedgerow, re-braided", &point.on)];
        let all = ours.into_iter().chain(point.driver.as_ref().map(|side| ("driver", side)));
        all.map(|(name, side)| (name, side.clone())).collect()
    };
    html! {
        table.sortable {
            thead { tr {
                (column("scene", "", false)) (column("top level", "", false)) (column("instances", "", true))
                (column("entries", "", true)) (column("build", "ms", true)) (column("structure", "B/instance", true))
                (column("scratch", "B/instance", true))
            } }
            tbody {
                @for point in points {
                    @for (name, side) in sides(point) {
                        @let an_instance = |bytes: u64| Some(bytes as f64 / f64::from(point.instances));
                        tr {
                            th scope="row" data-value=(point.scene) { (point.scene) }
                            td data-value=(name) { (name) }
                            (number(Some(point.instances.into()), |v| grouped(v as u64)))
                            (number(side.entries.map(f64::from), |v| grouped(v as u64)))
                            (spread(Some(side.build_ms), three_digits))
                            (number(an_instance(side.structure_bytes), |v| format!("{v:.0}")))
                            (number(an_instance(side.scratch_bytes), |v| format!("{v:.0}")))
                        }
                    }
                }
            }
        }
    }
}

/// Every kind of ray in every scene.
fn tracing(points: &[Rebraid]) -> Markup {
    let mrays_s = |rays: &BraidedRays, milliseconds: f64| Some(rays.count as f64 / (milliseconds * 1e3));
    let both = |off: f64, on: f64| {
        html! { td.number data-value=(on) { (three_digits(off)) " → " (three_digits(on)) } }
    };
    html! {
        table.sortable {
            thead { tr {
                (column("scene", "", false)) (column("rays", "", false)) (column("count", "", true)) (column("gain", "×", true))
                (column("without", "Mrays/s", true)) (column("with", "Mrays/s", true)) (column("driver", "Mrays/s", true))
                (column("top nodes", "", true)) (column("instances", "", true)) (column("nodes below", "", true))
                (column("tests", "", true))
            } }
            tbody {
                @for point in points {
                    @for rays in &point.rays {
                        @let (off, on) = (rays.off_work, rays.on_work);
                        tr {
                            th scope="row" data-value=(point.scene) { (point.scene) }
                            td data-value=(rays.rays) { (rays.rays) }
                            (number(Some(rays.count as f64), short_count))
                            (spread(Some(rays.gain), three_digits))
                            (number(mrays_s(rays, rays.off_ms.median), three_digits))
                            (number(mrays_s(rays, rays.on_ms.median), three_digits))
                            (number(rays.driver_ms.and_then(|ms| mrays_s(rays, ms.median)), three_digits))
                            (both(off.top_nodes, on.top_nodes))
                            (both(off.instances, on.instances))
                            (both(off.nodes_below, on.nodes_below))
                            (both(off.tests, on.tests))
                        }
                    }
                }
            }
        }
    }
}
