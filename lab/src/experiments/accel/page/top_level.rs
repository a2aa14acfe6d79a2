//! The section of top levels.

use super::Part;
use crate::Result;
use crate::experiments::accel::points::{Implementation, TopLevel};
use crate::measure::statistics::Spread;
use crate::report::chart::Caption;
use crate::report::columns::Table;
use crate::report::curves::{self, Axis, Curve};
use crate::report::numbers::{count, duration_tick, grouped, one_decimal, short_count, three_digits};
use crate::report::theme::SERIES;
use maud::{Markup, html};

pub(super) fn part(points: &[TopLevel]) -> Result<Option<Part>> {
    if points.is_empty() {
        return Ok(None);
    }
    let curve = |maker: Implementation, what: &str, series: usize, of: fn(&TopLevel) -> Option<Spread>| {
        let of_maker = points.iter().filter(|point| point.maker == maker);
        let points = of_maker.filter_map(|point| Some((f64::from(point.instances), of(point)?))).collect();
        Curve { name: format!("{} {what}", maker.name()), tone: SERIES[series], points, law: None }.with_law()
    };
    let all = [
        curve(Implementation::Ours, "build", 0, |point| Some(point.build_ms)),
        curve(Implementation::Ours, "update", 2, |point| point.update_ms),
        curve(Implementation::Driver, "build", 1, |point| Some(point.build_ms)),
        curve(Implementation::Driver, "update", 5, |point| point.update_ms),
    ];
    let all: Vec<Curve> = all.into_iter().filter(|curve| !curve.points.is_empty()).collect();
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
    Ok(Some(Part {
        id: "tlas",
        title: "Top levels",
        charts: chart.into_iter().collect(),
        above: html! {
            p {
                "A top level over instances of three spheres, each in a cell of its own, built, and updated in place after every "
                "instance has moved by a tenth of its cell. By the device's timestamps."
            }
        },
        below: every_level(points),
    }))
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
