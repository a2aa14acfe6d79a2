//! The section of children in order.

use super::Part;
use super::flagged::{both, gains, mrays_s};
use crate::Result;
use crate::experiments::accel::points::{AnyHitPoint, FlaggedRays};
use crate::report::bars::Bars;
use crate::report::numbers::{count, grouped, short_count, three_digits, tick, whole};
use crate::report::{Caption, Chart, Section, Table, bars, document, slug};
use crate::subjects::queries::MeanWork;
use maud::{Markup, html};

pub(super) fn part(points: &[AnyHitPoint]) -> Result<Option<Part>> {
    if points.is_empty() {
        return Ok(None);
    }
    let charts: Vec<Option<Chart>> = points.iter().map(chart).collect::<Result<_>>()?;
    let charts: Vec<Chart> = charts.into_iter().flatten().collect();
    let body = html! {
        p {
            "A shadow ray asks whether anything is in its way, and need not look into the nearest child first. With the flag ANY_HIT_ORDER the "
            "children of both levels lie in an order, and queries that end at their first hit take the left one first. The same rays go "
            "through structures without it and with it in turn, by the device's timestamps."
        }
        @for point in points.iter().filter(|point| point.rays.iter().any(|rays| rays.different > 0)) {
            p.note.wrong { (point.scene) ": some rays find no hit, or one, by the order alone. That is a fault of hedgerow." }
        }
        (document::charts(&charts))
        (buildings(points))
        (tracing(points))
    };
    Ok(Some((Section::new("any-hit", "Shadow rays by an order of children", body), charts)))
}

/// The gain of each kind of ray in one scene.
fn chart(point: &AnyHitPoint) -> Result<Option<Chart>> {
    let (all, in_words) = gains(&point.rays);
    let hits = |rays: &FlaggedRays| format!("{}% of {} rays hit", whole(100.0 * share(rays)), rays.rays);
    let hits: Vec<String> = point.rays.iter().map(hits).collect();
    let caption = Caption {
        name: format!("accel-any-hit-{}", slug(&point.scene)),
        title: format!("{}: speed with children in order over speed without", point.scene),
        alt: in_words,
        reading: format!(
            "{} instances of {} parts; {}. Right of 1, the order is faster. A ray that misses gains nothing by an order: it meets all \
             that it can. The line through a bar goes from the least to the greatest of the runs.",
            grouped(point.instances.into()),
            point.parts,
            hits.join(", "),
        ),
    };
    bars::bars(caption, &Bars { bars: all, axis: "time without / time with", number: tick, marks: Vec::new() })
}

/// Of the rays those that hit.
fn share(rays: &FlaggedRays) -> f64 {
    rays.hits as f64 / rays.count.max(1) as f64
}

fn buildings(points: &[AnyHitPoint]) -> Markup {
    Table::new("Children in order, building the top level", points)
        .name("scene", |point| &point.scene)
        .number("instances", "", |point| Some(point.instances.into()), count)
        .number("triangles", "", |point| Some(point.triangles as f64), short_count)
        .spread("without", "ms", |point| Some(point.off_build_ms), three_digits)
        .spread("with", "ms", |point| Some(point.on_build_ms), three_digits)
        .html()
}

/// 3 a node and 2 a test: what the notes call work.
fn work(work: &MeanWork) -> f64 {
    3.0 * (work.top_nodes + work.nodes_below) + 2.0 * work.tests
}

fn tracing(points: &[AnyHitPoint]) -> Markup {
    let rows = points.iter().flat_map(|point| point.rays.iter().map(|rays| (point.scene.as_str(), rays)));
    Table::new("Children in order, rays", rows)
        .name("scene", |(scene, _)| *scene)
        .text("rays", |(_, rays)| &rays.rays)
        .number("count", "", |(_, rays)| Some(rays.count as f64), short_count)
        .number("hit", "%", |(_, rays)| Some(100.0 * share(rays)), whole)
        .spread("gain", "×", |(_, rays)| Some(rays.gain), three_digits)
        .number("without", "Mrays/s", move |(_, rays)| mrays_s(rays, rays.off_ms.median), three_digits)
        .number("with", "Mrays/s", move |(_, rays)| mrays_s(rays, rays.on_ms.median), three_digits)
        .number("driver", "Mrays/s", move |(_, rays)| mrays_s(rays, rays.driver_ms?.median), three_digits)
        .figure("work", "", move |(_, rays)| both(rays, work))
        .figure("instances", "", move |(_, rays)| both(rays, |work| work.instances))
        .html()
}
