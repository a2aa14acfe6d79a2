//! What was to be reached, and whether it is.

use super::Measured;
use super::batch::{by_preference, find, in_words};
use crate::experiments::accel::points::{FlaggedRays, Implementation, RebraidPoint, Submission};
use crate::measure::{Spread, geometric_mean};

/// Of the time of one call, that of a call each.
const BATCH: f64 = 10.0;
/// Of the speed of rays through plain top levels, that through re-braided ones: where boxes overlap, and where they do not.
const REBRAID: f64 = 1.2;
const REBRAID_APART: f64 = 0.97;
/// Of the speed of the driver's ray queries, in the mean of scenes and kinds of rays, and for the slowest of them.
const OVER_DRIVER: f64 = 1.4;
const SLOWEST_OVER_DRIVER: f64 = 0.95;

/// Milliseconds of ours.
type Ours = fn(&FlaggedRays) -> Option<Spread>;

/// How a shader takes the rays, beside the driver's queries.
const WAYS: [(&str, Ours); 2] =
    [("one for each invocation", |rays| Some(rays.on_ms)), ("many, in turn", |rays| rays.in_turn_ms)];

/// Something to be reached.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Goal {
    /// What, in words.
    pub what: String,
    /// The ratio, with how far it goes either way.
    pub ratio: Spread,
    /// The least that it should be.
    pub least: f64,
}

impl Goal {
    /// Whether it is reached, by the median.
    pub fn is_met(&self) -> bool {
        self.ratio.median >= self.least
    }

    /// In a word or a few: met, missed, or either within the noise.
    pub fn verdict(&self) -> &'static str {
        let is_certain = (self.ratio.min >= self.least) == (self.ratio.max >= self.least);
        match (self.is_met(), is_certain) {
            (true, true) => "met",
            (true, false) => "met, within the spread",
            (false, true) => "missed",
            (false, false) => "missed, within the spread",
        }
    }
}

/// All of which there are figures.
pub(super) fn goals(measured: &Measured) -> Vec<Goal> {
    let mut goals = Vec::new();
    for batches in by_preference(&measured.batches) {
        let most = batches.iter().map(|point| point.structures).max().unwrap_or(0);
        for (maker, way, against, least) in [
            (Implementation::Ours, Submission::OneSubmit, Submission::OneSubmit.name(), BATCH),
            (Implementation::Ours, Submission::SubmitEach, Submission::SubmitEach.name(), BATCH),
            (Implementation::Driver, Submission::OneCall, "one call of the driver's", 1.0),
        ] {
            if let Some(point) = find(&batches, most, Some(maker), way) {
                let what = format!("{most} structures {} in one call, against {against}", in_words(point.prefer));
                goals.push(Goal { what, ratio: point.over_our_call, least });
            }
        }
    }
    for point in &measured.rebraids {
        let (least, how) = (least_gain(point), if overlaps(point) { "boxes overlap" } else { "boxes apart" });
        if let Some(ratio) = mean_gain(&point.rays) {
            goals.push(Goal { what: format!("{}, re-braided ({how}): all kinds of rays", point.scene), ratio, least });
        }
    }
    for (way, ours) in WAYS {
        if let Some(ratio) = over_driver(&measured.rebraids, ours) {
            let what = format!("rays through both levels, {way}, against the driver's queries");
            goals.push(Goal { what, ratio, least: OVER_DRIVER });
            let slowest = Spread { median: ratio.min, max: ratio.min, ..ratio };
            goals.push(Goal { what: "the slowest of them".into(), ratio: slowest, least: SLOWEST_OVER_DRIVER });
        }
    }
    for point in &measured.rebraids {
        if let Some(driver) = &point.driver {
            let ([ours, theirs], what) = ([point.on.build_ms, driver.build_ms], &point.scene);
            let ratio = Spread {
                median: theirs.median / ours.median,
                min: theirs.min / ours.max,
                max: theirs.max / ours.min,
                runs: ours.runs,
            };
            goals.push(Goal {
                what: format!("{what}: the top level's build, against the driver's"),
                ratio,
                least: 1.0,
            });
        }
    }
    goals
}

/// How many times as fast rays are as the driver's: the geometric mean over scenes and kinds of rays, the least and the greatest.
fn over_driver(points: &[RebraidPoint], ours: Ours) -> Option<Spread> {
    let rays = points.iter().flat_map(|point| &point.rays);
    let ratios: Vec<f64> = rays.filter_map(|r| Some(r.driver_ms?.median / ours(r)?.median)).collect();
    let median = geometric_mean(ratios.iter().copied())?;
    Some(Spread { median, ..Spread::of(&ratios)? })
}

/// Whether re-braiding has something to gain: the box of an instance overlaps another's, in the mean.
pub(super) fn overlaps(point: &RebraidPoint) -> bool {
    point.overlaps >= 1.0
}

/// What re-braiding is to gain.
pub(super) fn least_gain(point: &RebraidPoint) -> f64 {
    if overlaps(point) { REBRAID } else { REBRAID_APART }
}

/// The geometric mean over kinds of rays, and the least and greatest median of a kind.
pub(super) fn mean_gain(rays: &[FlaggedRays]) -> Option<Spread> {
    let medians: Vec<f64> = rays.iter().map(|rays| rays.gain.median).collect();
    let median = geometric_mean(medians.iter().copied())?;
    Some(Spread { median, ..Spread::of(&medians)? })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_goal_within_the_spread_is_told_as_such() {
        let goal = |median, min, max| {
            let ratio = Spread { median, min, max, runs: 5 };
            Goal { what: String::new(), ratio, least: 10.0 }.verdict()
        };
        assert_eq!(goal(12.0, 11.0, 13.0), "met");
        assert_eq!(goal(12.0, 9.0, 13.0), "met, within the spread");
        assert_eq!(goal(8.0, 7.0, 9.0), "missed");
        assert_eq!(goal(8.0, 7.0, 11.0), "missed, within the spread");
    }
}
