//! The short answer: how every builder stands against one of them, over all scenes.

use crate::measure::record::Record;
use crate::measure::statistics::geometric_mean;
use crate::report::theme::Legend;

/// A builder over all scenes that it and the baseline have in common.
#[derive(Debug, Clone, PartialEq)]
pub struct Standing {
    /// The builder.
    pub builder: String,
    /// Scenes in common.
    pub scenes: usize,
    /// Geometric mean of the ratios of build speed; above 1 it builds faster than the baseline.
    pub build: Option<f64>,
    /// Geometric mean of the ratios of trace speed, all rays together.
    pub trace: Option<f64>,
    /// Geometric mean of the ratios of SAH cost to that of [`sah_baseline`]; below 1 its trees are better.
    pub sah: Option<f64>,
}

/// What every builder is compared with: the `wanted` one where it was measured, otherwise the first.
pub fn baseline<'a>(legend: &'a Legend, wanted: Option<&str>) -> Option<&'a str> {
    let builders = &legend.builders;
    builders.iter().find(|b| Some(b.as_str()) == wanted).or(builders.first()).map(String::as_str)
}

/// What SAH costs are compared with: the baseline, or the first builder that reports its cost if the baseline does not.
pub fn sah_baseline<'a>(records: &[&'a Record], baseline: &str) -> Option<&'a str> {
    let mut told = records.iter().filter(|r| r.quality.sah.is_some()).map(|r| r.builder.as_str());
    told.clone().find(|builder| *builder == baseline).or_else(|| told.next())
}

/// How every builder stands against `baseline`, in the order of the legend.
pub fn standings(records: &[&Record], legend: &Legend, baseline: &str) -> Vec<Standing> {
    let of = |builder: &str, scene: &str| records.iter().find(|r| r.builder == builder && r.scene == scene);
    let sah_baseline = sah_baseline(records, baseline).unwrap_or(baseline);
    let standing = |builder: &String| {
        let ours = || records.iter().filter(|r| r.builder == *builder);
        let ratio = |base: &str, figure: fn(&Record) -> Option<f64>| {
            geometric_mean(ours().filter_map(|r| Some(figure(r)? / figure(of(base, &r.scene)?)?)))
        };
        Standing {
            builder: builder.clone(),
            scenes: ours().filter(|r| of(baseline, &r.scene).is_some()).count(),
            build: ratio(baseline, |r| Some(r.mtris_s())),
            trace: ratio(baseline, Record::mrays_s),
            sah: ratio(sah_baseline, |r| r.quality.sah),
        }
    };
    legend.builders.iter().map(standing).collect()
}
