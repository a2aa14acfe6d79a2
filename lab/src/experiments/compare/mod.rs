//! Two runs side by side: what became faster or slower, and what of it may be noise.

pub(crate) mod command;

use crate::measure::record::Record;
use crate::measure::statistics::Spread;
use crate::report::names::distinct;

/// A change of a trace speed below this share may always be noise: records hold no spread of it.
const LEAST_TRACE_NOISE: f64 = 0.03;

/// A figure before and after.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Change {
    /// Before.
    pub old: f64,
    /// After.
    pub new: f64,
    /// Whether measuring again could undo it.
    pub is_noise: bool,
}

impl Change {
    /// After over before.
    pub fn ratio(&self) -> f64 {
        self.new / self.old
    }
}

/// One builder on one scene in both runs.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// The scene.
    pub scene: String,
    /// The builder.
    pub builder: String,
    /// Build time in milliseconds; less is better.
    pub build_ms: Change,
    /// Trace speed of each kind of ray that both have, in Mrays/s; more is better.
    pub mrays_s: Vec<(String, Change)>,
    /// SAH cost, if both have it; less is better. The same tree has the same cost: any difference is real.
    pub sah: Option<Change>,
}

/// What two runs have in common, and what only one of them has.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Comparisons {
    /// Builders on scenes in both, in the order of the new run.
    pub pairs: Vec<Comparison>,
    /// `scene, builder` in the old run alone.
    pub only_old: Vec<String>,
    /// `scene, builder` in the new run alone.
    pub only_new: Vec<String>,
    /// What makes the runs hard to compare: other devices or drivers, other scenes of the same name, other rays.
    pub doubts: Vec<String>,
}

/// Compares two runs. Of several records of one builder on one scene the last counts.
pub fn compare(old: &[Record], new: &[Record]) -> Comparisons {
    let is_same = |a: &Record, b: &Record| a.scene == b.scene && a.builder == b.builder;
    let last = |records: &[Record]| -> Vec<Record> {
        let is_last = |i: &usize| !records[i + 1..].iter().any(|later| is_same(later, &records[*i]));
        (0..records.len()).filter(is_last).map(|i| records[i].clone()).collect()
    };
    let (old, new) = (last(old), last(new));
    let name = |r: &Record| format!("{}, {}", r.scene, r.builder);
    let mut found = Comparisons::default();
    for after in &new {
        match old.iter().find(|before| is_same(before, after)) {
            Some(before) => {
                found.pairs.push(pair(before, after));
                found.doubts.extend(doubts(before, after));
            }
            None => found.only_new.push(name(after)),
        }
    }
    found.doubts = distinct(found.doubts);
    found.only_old = old.iter().filter(|b| !new.iter().any(|a| is_same(a, b))).map(name).collect();
    found
}

fn pair(old: &Record, new: &Record) -> Comparison {
    let [before, after] = [old, new].map(|record| Spread::from(&record.build));
    let relative = |s: Spread| (s.max - s.min) / s.median;
    // The same machine traced as unevenly as it built.
    let trace_noise = relative(before).max(relative(after)).max(LEAST_TRACE_NOISE);
    let speeds = new.trace.iter().filter_map(|trace| {
        let (old, new) = (old.rays(&trace.rays)?.mrays_s, trace.mrays_s);
        let is_noise = (new / old).ln().abs() <= trace_noise.ln_1p();
        Some((trace.rays.clone(), Change { old, new, is_noise }))
    });
    let (old_tree, new_tree) = (&old.quality, &new.quality);
    let is_same_cost = (old_tree.c_t, old_tree.c_i) == (new_tree.c_t, new_tree.c_i);
    let sah = old_tree.sah.zip(new_tree.sah).filter(|_| is_same_cost);
    Comparison {
        scene: new.scene.clone(),
        builder: new.builder.clone(),
        build_ms: Change { old: before.median, new: after.median, is_noise: before.overlaps(&after) },
        mrays_s: speeds.collect(),
        sah: sah.map(|(old, new)| Change { old, new, is_noise: (new / old - 1.0).abs() < 1e-9 }),
    }
}

fn doubts(old: &Record, new: &Record) -> Vec<String> {
    let mut doubts = Vec::new();
    if old.device != new.device || old.driver != new.driver {
        doubts.push(format!(
            "measured on {} ({}) and on {} ({}): figures of different machines do not compare",
            old.device, old.driver, new.device, new.driver
        ));
    }
    if old.triangles != new.triangles {
        doubts.push(format!("{} had {} triangles and has {}", new.scene, old.triangles, new.triangles));
    }
    if new.trace.iter().any(|after| old.rays(&after.rays).is_some_and(|before| before.count != after.count)) {
        doubts.push(format!("{} was traced with another number of rays", new.scene));
    }
    if old.build.runs < 3 || new.build.runs < 3 {
        doubts.push("fewer than three runs say little of the noise".into());
    }
    doubts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::record::{BuildRecord, MemoryRecord, QualityRecord, SCHEMA, TraceRecord};

    fn record(scene: &str, (min, median, max): (f64, f64, f64), mrays_s: f64, sah: Option<f64>) -> Record {
        Record {
            schema: SCHEMA,
            scene: scene.into(),
            triangles: 1000,
            builder: "lbvh".into(),
            kind: "bvh2".into(),
            device: "a device".into(),
            driver: "a driver".into(),
            subgroup: 8,
            commit: "abc1234".into(),
            when: "2026-11-21T10:00:00Z".into(),
            build: BuildRecord {
                runs: 5,
                median_ms: median,
                min_ms: min,
                max_ms: max,
                timer: "device".into(),
                ..BuildRecord::default()
            },
            memory: MemoryRecord::default(),
            quality: QualityRecord { sah, c_t: 3.0, c_i: 2.0, ..QualityRecord::default() },
            trace: vec![TraceRecord {
                rays: "primary".into(),
                count: 100,
                hits: 90,
                mrays_s,
                steps: None,
                tests: None,
                runs: 5,
                checksum: "1".into(),
            }],
            valid: Some(true),
        }
    }

    fn one(old: Record, new: Record) -> Comparison {
        let found = compare(&[old], &[new]);
        assert!(found.doubts.is_empty(), "{:?}", found.doubts);
        found.pairs.into_iter().next().expect("the same scene and builder")
    }

    #[test]
    fn a_build_time_outside_both_spreads_is_a_change() {
        let found = one(record("a", (9.0, 10.0, 11.0), 2.0, None), record("a", (7.0, 8.0, 8.9), 2.0, None));
        assert!(!found.build_ms.is_noise);
        assert!((found.build_ms.ratio() - 0.8).abs() < 1e-12);
    }

    #[test]
    fn build_times_whose_spreads_meet_may_be_noise() {
        let found = one(record("a", (9.0, 10.0, 11.0), 2.0, None), record("a", (7.0, 8.0, 9.1), 2.0, None));
        assert!(found.build_ms.is_noise, "8 against 10, but one run of the old took 9.0 and one of the new 9.1");
    }

    #[test]
    fn a_trace_speed_is_noise_within_the_spread_of_the_builds() {
        // Spread of the builds: 2 of 10, so that a fifth up may be noise and a third may not.
        let old = || record("a", (9.0, 10.0, 11.0), 3.0, None);
        let of = |mrays_s| one(old(), record("a", (9.0, 10.0, 11.0), mrays_s, None)).mrays_s[0].1.is_noise;
        assert!(of(3.5) && of(2.6));
        assert!(!of(4.0) && !of(2.0));
        // Steady builds: three percent remain.
        let steady = |mrays_s| record("a", (10.0, 10.0, 10.0), mrays_s, None);
        assert!(one(steady(3.0), steady(3.08)).mrays_s[0].1.is_noise);
        assert!(!one(steady(3.0), steady(3.1)).mrays_s[0].1.is_noise);
    }

    #[test]
    fn any_difference_of_the_sah_cost_is_real() {
        let of = |old, new| {
            one(record("a", (1.0, 1.0, 1.0), 1.0, Some(old)), record("a", (1.0, 1.0, 1.0), 1.0, Some(new))).sah
        };
        assert_eq!(of(100.0, 100.0).map(|c| c.is_noise), Some(true));
        assert_eq!(of(100.0, 100.1).map(|c| c.is_noise), Some(false));
    }

    #[test]
    fn what_only_one_run_has_is_named() {
        let of = |scene| record(scene, (1.0, 1.0, 1.0), 1.0, None);
        let found = compare(&[of("a"), of("b")], &[of("b"), of("c")]);
        assert_eq!(
            (found.pairs.len(), &found.only_old[..], &found.only_new[..]),
            (1, &["a, lbvh".into()][..], &["c, lbvh".into()][..])
        );
    }

    #[test]
    fn other_machines_scenes_and_rays_are_doubted() {
        let old = record("a", (1.0, 1.0, 1.0), 1.0, None);
        let mut new = old.clone();
        (new.driver, new.triangles, new.trace[0].count, new.build.runs) = ("another".into(), 999, 50, 1);
        let doubts = compare(&[old], &[new]).doubts;
        assert_eq!(doubts.len(), 4, "{doubts:?}");
        assert!(doubts[0].contains("different machines"), "{doubts:?}");
    }
}
