//! The section of top levels.

use super::{Part, Series, curves_of};
use crate::Result;
use crate::experiments::accel::points::{Implementation, TopLevel};
use crate::report::numbers::{count, duration_tick, grouped, one_decimal, short_count, three_digits};
use crate::report::{Axis, Caption, Curve, SERIES, Section, Table, curves, document};
use maud::{Markup, html};

pub(super) fn part(points: &[TopLevel]) -> Result<Option<Part>> {
    if points.is_empty() {
        return Ok(None);
    }
    let all: Vec<&TopLevel> = points.iter().collect();
    let series: [Series<'_, TopLevel>; 4] = [
        (Implementation::Ours, "build", SERIES[0], &|point| Some(point.build_ms)),
        (Implementation::Ours, "update", SERIES[2], &|point| point.update_ms),
        (Implementation::Driver, "build", SERIES[1], &|point| Some(point.build_ms)),
        (Implementation::Driver, "update", SERIES[5], &|point| point.update_ms),
    ];
    let curves = curves_of(&all, |point| (point.maker, point.instances), &series);
    let all: Vec<Curve> = curves.into_iter().map(Curve::with_law).collect();
    let names: Vec<&str> = all.iter().map(|curve| curve.name.as_str()).collect();
    let caption = Caption {
        name: "accel-tlas".into(),
        title: "Top levels: time over the number of instances".into(),
        alt: format!("Fitted laws, time proportional to n to the power: {}.", names.join("; ")),
        reading: format!(
            "Both axes are logarithmic; behind the names, the power laws fitted through the medians by least squares. {}",
            reading(points)
        ),
    };
    let chart = curves::curves(
        caption,
        &all,
        &Axis { name: "instances", is_log: true, number: short_count },
        &Axis { name: "device time", is_log: true, number: duration_tick },
    )?;
    let charts = Vec::from_iter(chart);
    let body = html! {
        p {
            "A top level over instances of three spheres, each in a cell of its own, built, and updated in place after every "
            "instance has moved by a tenth of its cell. By the device's timestamps."
        }
        (document::charts(&charts))
        (every_level(points))
    };
    Ok(Some((Section::new("tlas", "Top levels", body), charts)))
}

fn every_level(points: &[TopLevel]) -> Markup {
    let an_instance = |point: &TopLevel, bytes: u64| Some(bytes as f64 / f64::from(point.instances));
    let share = |point: &TopLevel| Some(point.update_ms?.median / point.build_ms.median);
    Table::new("Top levels", points)
        .number("instances", "", |point| Some(point.instances.into()), count)
        .text("whose", |point| point.maker.name())
        .spread("build", "ms", |point| Some(point.build_ms), three_digits)
        .spread("update", "ms", |point| point.update_ms, three_digits)
        .number("update / build", "×", move |point| share(point), three_digits)
        .number("structure", "B/instance", move |point| an_instance(point, point.structure_bytes), one_decimal)
        .number("scratch", "B/instance", move |point| an_instance(point, point.scratch_bytes), one_decimal)
        .html()
}

/// The largest top level in a sentence, ours against the driver's.
fn reading(points: &[TopLevel]) -> String {
    let most = points.iter().map(|point| point.instances).max().unwrap_or(0);
    let of = |maker| points.iter().find(|point| point.instances == most && point.maker == maker);
    let (Some(ours), Some(drivers)) = (of(Implementation::Ours), of(Implementation::Driver)) else {
        return String::new();
    };
    let against = |ours: f64, drivers: f64| match drivers / ours {
        ratio if ratio >= 1.0 => format!("{} times as fast as the driver's", three_digits(ratio)),
        ratio => format!("slower than the driver's, {} times its time", three_digits(1.0 / ratio)),
    };
    let build = against(ours.build_ms.median, drivers.build_ms.median);
    let update = match (ours.update_ms, drivers.update_ms) {
        (Some(ours), Some(drivers)) => format!(", and our update {}", against(ours.median, drivers.median)),
        _ => String::new(),
    };
    format!("Over {} instances our build is {build}{update}.", grouped(most.into()))
}
