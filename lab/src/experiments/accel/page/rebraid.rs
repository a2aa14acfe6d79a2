//! The section of re-braiding.

use super::Part;
use super::flagged::{both, gains, mrays_s};
use super::goals::{self, mean_gain, overlaps};
use crate::Result;
use crate::experiments::accel::points::{RebraidPoint, TopLevelPoint};
use crate::report::bars::Bars;
use crate::report::numbers::{count, grouped, short_count, three_digits, tick, whole};
use crate::report::{Caption, Chart, Section, Table, bars, document, slug};
use maud::{Markup, html};

pub(super) fn part(points: &[RebraidPoint]) -> Result<Option<Part>> {
    if points.is_empty() {
        return Ok(None);
    }
    let charts: Vec<Option<Chart>> = points.iter().map(chart).collect::<Result<_>>()?;
    let charts: Vec<Chart> = charts.into_iter().flatten().collect();
    let body = html! {
        p {
            "A top level that opens instances whose boxes are loose (Benthin, Woop, Wald 2017), against one that does not: "
            "rays of each kind through one and the other in turn, by the device's timestamps."
        }
        @for point in points.iter().filter(|point| point.rays.iter().any(|rays| rays.different > 0)) {
            p.note.wrong { (point.scene) ": some rays hit something else through the re-braided top level. That is a fault of hedgerow." }
        }
        (document::charts(&charts))
        (buildings(points))
        details {
            summary { "Rays and their work" }
            p {
                "Nodes of the top level, instances entered, nodes below and triangles tested, in the mean over the rays: first "
                "through the plain top level, then through the re-braided one. In turn: many rays for each invocation, through the "
                "re-braided one, as " code { "trace/query_turns.glsl" } " takes them; the driver's queries cannot."
            }
            (tracing(points))
        }
    };
    Ok(Some((Section::new("rebraid", "Re-braiding", body), charts)))
}

/// The gain of each kind of ray in one scene.
fn chart(point: &RebraidPoint) -> Result<Option<Chart>> {
    let (all, in_words) = gains(&point.rays);
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
        alt: in_words,
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
            number: tick,
            marks: vec![(goal, format!("goal {goal}"))],
        },
    )
}

/// What building takes with and without, beside the driver's.
fn buildings(points: &[RebraidPoint]) -> Markup {
    let mut rows: Vec<(&RebraidPoint, &str, &TopLevelPoint)> = Vec::new();
    for point in points {
        rows.extend([(point, "hedgerow", &point.off), (point, "hedgerow, re-braided", &point.on)]);
        rows.extend(point.driver.as_ref().map(|side| (point, "driver", side)));
    }
    let an_instance = |point: &RebraidPoint, bytes: u64| Some(bytes as f64 / f64::from(point.instances));
    Table::new("Re-braiding, building", rows)
        .name("scene", |(point, ..)| &point.scene)
        .text("top level", |(_, name, _)| *name)
        .number("instances", "", |(point, ..)| Some(point.instances.into()), count)
        .number("entries", "", |(.., side)| side.entries.map(f64::from), count)
        .spread("build", "ms", |(.., side)| Some(side.build_ms), three_digits)
        .number("structure", "B/instance", move |(point, _, side)| an_instance(point, side.structure_bytes), whole)
        .number("scratch", "B/instance", move |(point, _, side)| an_instance(point, side.scratch_bytes), whole)
        .html()
}

/// Every kind of ray in every scene.
fn tracing(points: &[RebraidPoint]) -> Markup {
    let rows = points.iter().flat_map(|point| point.rays.iter().map(|rays| (point.scene.as_str(), rays)));
    Table::new("Re-braiding, rays", rows)
        .name("scene", |(scene, _)| *scene)
        .text("rays", |(_, rays)| &rays.rays)
        .number("count", "", |(_, rays)| Some(rays.count as f64), short_count)
        .spread("gain", "×", |(_, rays)| Some(rays.gain), three_digits)
        .number("without", "Mrays/s", move |(_, rays)| mrays_s(rays, rays.off_ms.median), three_digits)
        .number("with", "Mrays/s", move |(_, rays)| mrays_s(rays, rays.on_ms.median), three_digits)
        .number("in turn", "Mrays/s", move |(_, rays)| mrays_s(rays, rays.in_turn_ms?.median), three_digits)
        .number("driver", "Mrays/s", move |(_, rays)| mrays_s(rays, rays.driver_ms?.median), three_digits)
        .figure("top nodes", "", move |(_, rays)| both(rays, |work| work.top_nodes))
        .figure("instances", "", move |(_, rays)| both(rays, |work| work.instances))
        .figure("nodes below", "", move |(_, rays)| both(rays, |work| work.nodes_below))
        .figure("tests", "", move |(_, rays)| both(rays, |work| work.tests))
        .html()
}
