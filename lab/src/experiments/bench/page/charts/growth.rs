//! How build time grows with the scene: time over triangles on logarithmic axes, with the fitted exponent of each builder.

use crate::Result;
use crate::measure::record::Record;
use crate::measure::statistics::Spread;
use crate::report::chart::{Caption, Chart};
use crate::report::curves::{self, Axis, Curve};
use crate::report::names::short;
use crate::report::numbers::{duration_tick, short_count};
use crate::report::theme::Legend;

/// Build time over triangles, over all scenes. `None` unless there are scenes of two sizes.
///
/// # Errors
/// The chart cannot be drawn.
pub fn growth(records: &[&Record], legend: &Legend) -> Result<Option<Chart>> {
    let curve = |builder: &String| {
        let own = records.iter().filter(|r| r.builder == *builder && r.build.median_ms > 0.0);
        let mut points: Vec<_> = own.map(|r| (r.triangles as f64, Spread::from(&r.build))).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        Curve { name: short(builder), tone: legend.builder(builder), points, law: None }.with_law()
    };
    let curves: Vec<Curve> = legend.builders.iter().map(curve).filter(|curve| !curve.points.is_empty()).collect();
    let exponents: Vec<&str> =
        curves.iter().filter(|curve| curve.law.is_some()).map(|curve| curve.name.as_str()).collect();
    let caption = Caption {
        name: "growth".into(),
        title: "Build time over the number of triangles".into(),
        alt: format!("Fitted laws, time proportional to n to the power: {}.", exponents.join("; ")),
        reading: "One mark a scene, both axes logarithmic, and the power law fitted through each builder's marks by least \
                  squares. An exponent of 1 is proportional; above 1, twice the triangles cost more than twice the time."
            .into(),
    };
    curves::curves(
        caption,
        &curves,
        &Axis { name: "triangles", is_log: true, number: short_count },
        &Axis { name: "build time", is_log: true, number: duration_tick },
    )
}
