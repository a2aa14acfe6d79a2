//! What growth and large primitives have in common: series over e, where they lose a tenth, and the charts of them.

use crate::Result;
use crate::experiments::stability::drop;
use crate::experiments::stability::points::Stretched;
use crate::measure::{Spread, geometric_mean};
use crate::rays::kinds::RayKind;
use crate::report::numbers::{three_digits, tick};
use crate::report::{Axis, Caption, Chart, Curve, Mark, SERIES, Tone, curves, short};
use maud::{Markup, html};

/// The horizontal axis of all charts.
const EXPONENT: Axis<'_> = Axis { name: "e: 2^e times as long", is_log: false, number: tick };

/// Where a tenth is lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Loss {
    /// Nothing was measured.
    Unmeasured,
    /// Up to this e, nowhere.
    Never(u32),
    /// From this e on.
    From(u32),
}

impl Loss {
    fn of(points: &[(u32, f64)], is_lost: impl Fn(f64) -> bool) -> Loss {
        match (drop::first(points.iter().copied(), is_lost), points.iter().map(|(e, _)| *e).max()) {
            (Some(e), _) => Loss::From(e),
            (None, Some(last)) => Loss::Never(last),
            (None, None) => Loss::Unmeasured,
        }
    }

    /// Of the cost.
    pub fn of_cost<S>(points: &[&Stretched<S>]) -> Loss {
        let costs: Vec<(u32, f64)> = points.iter().filter_map(|point| Some((point.e, point.relative_cost?))).collect();
        Loss::of(&costs, |cost| cost >= drop::COST)
    }

    /// Of the speed of a kind of ray: the first of two points in a row, as one alone may be noise; that at e = 0 is nothing else.
    pub fn of_speed<S>(points: &[&Stretched<S>], kind: &str) -> Loss {
        let measured = points.iter().filter_map(|point| Some((point.e, *point.relative_mrays.get(kind)?)));
        let speeds: Vec<(u32, f64)> = measured.filter(|(e, _)| *e > 0).collect();
        let next = |i: usize| speeds.get(i + 1).map_or(0.0, |(_, speed)| *speed);
        let pairs: Vec<(u32, f64)> =
            speeds.iter().enumerate().map(|(i, &(e, speed))| (e, speed.max(next(i)))).collect();
        Loss::of(&pairs, |speed| speed <= drop::SPEED)
    }

    /// The e, if there is one.
    pub fn e(self) -> Option<u32> {
        match self {
            Loss::From(e) => Some(e),
            _ => None,
        }
    }

    /// A cell.
    pub fn cell(self) -> Markup {
        match self {
            Loss::Unmeasured => html! { td.number.none data-value="" { span aria-label="not measured" { "–" } } },
            // Sorts behind every e.
            Loss::Never(last) => html! { td.number.met data-value="1000" title={ "up to e = " (last) } { "never" } },
            Loss::From(e) => html! { td.number data-value=(e) { (e) } },
        }
    }
}

/// The kinds of rays that any point has.
pub(super) fn kinds<S>(points: &[Stretched<S>]) -> Vec<&'static str> {
    let is_there = |kind: &&str| points.iter().any(|point| point.relative_mrays.contains_key(*kind));
    RayKind::ALL.map(RayKind::name).into_iter().filter(is_there).collect()
}

/// The colour of a builder: the same in all charts of the page.
pub(super) fn tone(builders: &[&str], builder: &str) -> Tone {
    SERIES[builders.iter().position(|b| *b == builder).unwrap_or(0) % SERIES.len()]
}

/// A curve a builder, of those that have points.
fn curves_of<S>(points: &[&Stretched<S>], builders: &[&str], of: impl Fn(&Stretched<S>) -> Option<f64>) -> Vec<Curve> {
    let curve = |builder: &&str| {
        let own = points.iter().filter(|point| point.builder == *builder);
        let points: Vec<_> = own.filter_map(|point| Some((f64::from(point.e), Spread::once(of(point)?)))).collect();
        Curve { name: short_codes(builder), tone: tone(builders, builder), points, law: None }
    };
    builders.iter().map(curve).filter(|curve| !curve.points.is_empty()).collect()
}

/// [`short`], and uncollapsed trees are what most series are of.
pub(super) fn short_codes(builder: &str) -> String {
    short(builder).trim_end_matches(", uncollapsed").to_owned()
}

/// What each curve is at its right end, in words.
fn ends(curves: &[Curve], what: &str) -> String {
    let end = |curve: &Curve| {
        let last = curve.points.last().map_or(f64::NAN, |(_, spread)| spread.median);
        format!("{} {}", curve.name, three_digits(last))
    };
    let e = curves.iter().flat_map(|curve| &curve.points).map(|(e, _)| *e).fold(0.0, f64::max);
    format!("{what} at e = {e}: {}.", curves.iter().map(end).collect::<Vec<_>>().join("; "))
}

/// Relative costs over e.
pub(super) fn cost_chart<S>(
    points: &[&Stretched<S>],
    builders: &[&str],
    marks: &[Mark],
    [name, title]: [&String; 2],
) -> Result<Option<Chart>> {
    let all = curves_of(points, builders, |point| point.relative_cost);
    let expected = if marks.is_empty() { "" } else { " Dashed: where the thesis expects the tenth to be lost." };
    let ends = ends(&all, "Relative costs");
    let caption = Caption {
        name: format!("{name}-cost"),
        title: format!("{title}: cost of the scene"),
        reading: format!(
            "SAH cost of what stays, over that at e = 0; logarithmic, 1 is as good as there.{expected} {ends}"
        ),
        alt: ends,
    };
    let y = Axis { name: "relative cost", is_log: true, number: tick };
    curves::curves_and_marks(caption, &all, marks, &EXPONENT, &y)
}

/// Relative speeds over e: of one kind of ray, or the geometric mean over all.
pub(super) fn speed_chart<S>(
    points: &[&Stretched<S>],
    builders: &[&str],
    kind: Option<&str>,
    [name, title]: [&String; 2],
) -> Result<Option<Chart>> {
    let all = curves_of(points, builders, |point| match kind {
        Some(kind) => point.relative_mrays.get(kind).copied(),
        None => geometric_mean(point.relative_mrays.values().copied()),
    });
    let rays = kind.map_or("all kinds of rays".to_owned(), |kind| format!("{kind} rays"));
    let mean = if kind.is_some() { "" } else { " Geometric means over the kinds of rays." };
    let ends = ends(&all, "Relative speeds");
    let caption = Caption {
        name: format!("{name}-speed-{}", kind.unwrap_or("all")),
        title: format!("{title}: speed of {rays}"),
        reading: format!(
            "Speed over that at e = 0, in the median of runs in turn; at e = 0 two structures of the same scene, which is the noise.{mean} {ends}"
        ),
        alt: ends,
    };
    curves::curves(caption, &all, &EXPONENT, &Axis { name: "relative speed", is_log: false, number: tick })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::stability::far::{FarTriangle, Side};
    use crate::experiments::stability::points::Experiment;
    use std::collections::BTreeMap;

    fn traced(e: u32, speed: f64) -> Stretched<FarTriangle> {
        Stretched {
            experiment: Experiment::Growth,
            scene: String::new(),
            builder: "lbvh".into(),
            by: FarTriangle { axes: 1, side: Side::Positive },
            e,
            cost: None,
            relative_cost: None,
            relative_mrays: BTreeMap::from([("ao".to_owned(), speed)]),
        }
    }

    #[test]
    fn one_slow_point_alone_is_noise() {
        let loss = |speeds: &[f64]| {
            let point = |(e, speed): (usize, &f64)| traced(2 * e as u32, *speed);
            let points: Vec<_> = speeds.iter().enumerate().map(point).collect();
            Loss::of_speed(&points.iter().collect::<Vec<_>>(), "ao")
        };
        assert_eq!(loss(&[0.8, 0.7, 1.0, 0.9, 0.5, 0.4]), Loss::From(6));
        assert_eq!(loss(&[1.0, 1.0, 0.5]), Loss::From(4), "nothing behind it says otherwise");
        assert_eq!(loss(&[0.5, 0.8, 1.0]), Loss::Never(4));
    }

    #[test]
    fn never_is_told_apart_from_not_measured() {
        let lost = |cost: f64| cost >= 1.1;
        assert_eq!(Loss::of(&[], lost), Loss::Unmeasured);
        assert_eq!(Loss::of(&[(0, 1.0), (60, 1.05)], lost), Loss::Never(60));
        assert_eq!(Loss::of(&[(0, 1.0), (46, 1.08), (50, 1.38)], lost), Loss::From(50));
        assert_eq!(Loss::From(50).e(), Some(50));
        assert!(Loss::Never(60).cell().into_string().contains("never"));
    }
}
