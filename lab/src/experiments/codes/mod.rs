//! What `hedgerow codes` measures: what codes are worth and what they cost, as Riemersma 2024 does in chapter 4.
//!
//! [`sweep`]: rays through trees by binning, over the weight λ of its stretch factor (tables 8 to 11). [`added_time`]: what every
//! code adds to the time of a build (table 7). Both hold a builder with some codes against the same one with [`BASE`], in turn, and
//! give [`points`] as they go; [`published`] has the thesis' own figures.

pub mod added_time;
pub(crate) mod command;
pub mod page;
pub mod points;
pub mod published;
pub mod sweep;
mod tables;

use crate::device::Device;
use crate::named::named;
use crate::rays::kinds::{RayKind, RayOptions};
use crate::subjects::builders::Spec;
use crate::{Error, Result};
use hedgerow::bvh::codes::{Code, Codes};

/// What all codes are held against: extended Morton codes of 64 bits, without the size (chapter 4 of the thesis).
pub const BASE: Codes = Code::Emc64VarNoSize.full();
/// Runs that do not count, before those that do.
const WARM_UPS: u32 = 1;
/// Builds or traces of a run, of which the least counts: what disturbs one makes it longer.
const OF_A_RUN: u32 = 3;
/// Costs of a step and of a triangle test in the SAH, those of the theses.
const COSTS: [f64; 2] = [3.0, 2.0];

/// One of the experiments.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Experiment {
    /// [`sweep`].
    Sweep,
    /// [`added_time`].
    AddedTime,
}

named!(Experiment, "experiment": Sweep = "sweep", AddedTime = "added-time");

/// What both experiments have in common.
pub struct CodesSetup<'a> {
    /// Where builders that need a device run.
    pub device: Option<&'a Device>,
    /// The builder, without codes.
    pub builder: Spec,
    /// Counted runs of everything, in turn, after one that warms up.
    pub runs: u32,
    /// Kinds of rays.
    pub kinds: &'a [RayKind],
    /// Their number and seed.
    pub rays: RayOptions,
    /// Is called with what is being done, for a progress bar.
    pub say: &'a dyn Fn(&str),
}

impl CodesSetup<'_> {
    /// The builder with these codes.
    ///
    /// # Errors
    /// [`Error::Argument`] if it takes none, or has some.
    pub fn with(&self, codes: Codes) -> Result<Spec> {
        with_codes(&self.builder, codes)
    }
}

/// A builder that has no codes, with these.
///
/// # Errors
/// [`Error::Argument`] if it takes none, or has some.
pub fn with_codes(builder: &Spec, codes: Codes) -> Result<Spec> {
    if builder.option("codes").is_some() {
        let what = "has codes of its own, and it is codes that are compared here; leave codes= out";
        return Err(Error::Argument(format!("builder {builder} {what}")));
    }
    format!("{builder}:codes={codes}").parse()
}

/// The shortest of a run, in milliseconds.
fn least_of_a_run(mut one: impl FnMut() -> Result<f64>) -> Result<f64> {
    (0..OF_A_RUN).try_fold(f64::INFINITY, |least, _| Ok(least.min(one()?)))
}

/// The change from one time or cost to another, in percent: below 0 where the other is less.
fn percent(ratio: f64) -> f64 {
    100.0 * (ratio - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_put_behind_a_builder_that_has_none() {
        let spec = |text: &str| text.parse::<Spec>().expect("a builder");
        let with =
            with_codes(&spec("lbvh:collapse=off"), "bin4a4~2048".parse().expect("codes")).expect("it takes codes");
        assert_eq!(with.to_string(), "lbvh:collapse=off:codes=bin4a4~2048");
        let two = with_codes(&spec("lbvh:codes=mc30"), BASE).expect_err("it has some");
        assert!(two.to_string().contains("leave codes= out"), "{two}");
        let none = with_codes(&spec("kd-gpu"), BASE).expect_err("it takes none");
        assert!(none.to_string().contains("no option \"codes\""), "{none}");
    }

    #[test]
    fn the_least_of_a_run_counts() {
        let mut times = [3.0, 1.5, 2.0, 0.5].into_iter();
        assert_eq!(least_of_a_run(|| Ok(times.next().expect("three"))).ok(), Some(1.5));
        assert_eq!(times.next(), Some(0.5), "the fourth is of the next run");
    }

    #[test]
    fn a_change_is_told_in_percent() {
        assert_eq!([1.0, 1.5, 0.75].map(percent), [0.0, 50.0, -25.0]);
    }
}
