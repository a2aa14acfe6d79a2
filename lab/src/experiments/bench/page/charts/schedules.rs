//! The schedules of a builder of kd-trees side by side: build time over that of the chain, over how deep the tree is.

use crate::Result;
use crate::experiments::bench::kd_trees;
use crate::measure::record::Record;
use crate::measure::statistics::Spread;
use crate::report::chart::{Caption, Chart};
use crate::report::curves::{self, Axis, Curve};
use crate::report::names::short;
use crate::report::numbers::{one_decimal, two_decimals};
use crate::report::theme::Legend;

const CHAIN: &str = "schedule=chain";

/// A builder without its schedule.
fn without_schedule(builder: &str) -> Vec<&str> {
    builder.split(':').filter(|option| !option.starts_with("schedule=")).collect()
}

/// The same builder by the chain on the same scene.
fn by_chain<'a>(records: &[&'a Record], record: &Record) -> Option<&'a Record> {
    let is_it = |base: &&&Record| {
        base.scene == record.scene
            && base.builder.split(':').any(|option| option == CHAIN)
            && without_schedule(&base.builder) == without_schedule(&record.builder)
    };
    records.iter().find(is_it).copied()
}

/// Build time over that of the chain, over the mean depth of leaves. `None` where no other schedule was measured beside a chain.
///
/// # Errors
/// The chart cannot be drawn.
pub fn schedules(records: &[&Record], legend: &Legend) -> Result<Option<Chart>> {
    let records = kd_trees::of(records);
    let point = |record: &&Record| {
        let chain = by_chain(&records, record)?.build.median_ms;
        let Spread { median, min, max, runs } = Spread::from(&record.build);
        let ratio = Spread { median: median / chain, min: min / chain, max: max / chain, runs };
        (chain > 0.0).then_some((record.quality.depth_avg?, ratio))
    };
    let curve = |builder: &String| {
        let mut points: Vec<_> = records.iter().filter(|r| r.builder == *builder).filter_map(point).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        Curve { name: short(builder), tone: legend.builder(builder), points, law: None }
    };
    let curves: Vec<Curve> = legend.builders.iter().map(curve).filter(|curve| !curve.points.is_empty()).collect();
    if curves.len() < 2 {
        return Ok(None);
    }
    let names: Vec<&str> = curves.iter().map(|curve| curve.name.as_str()).collect();
    let caption = Caption {
        name: "kd-schedules".into(),
        title: "Build time of kd-trees by schedule over the depth of the tree".into(),
        alt: format!("Build time over that of the chain: {}.", names.join("; ")),
        reading: "One mark a scene and schedule: build time over that of the chain of dispatches on the same scene, over the mean \
                  depth of leaves. Below 1 is faster than the chain. All schedules build the same bytes."
            .into(),
    };
    curves::curves(
        caption,
        &curves,
        &Axis { name: "mean depth of leaves", is_log: false, number: one_decimal },
        &Axis { name: "time over the chain's", is_log: false, number: two_decimals },
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::record::{BuildRecord, MemoryRecord, QualityRecord, SCHEMA};

    fn record(scene: &str, builder: &str, median_ms: f64, depth: f64) -> Record {
        Record {
            schema: SCHEMA,
            scene: scene.into(),
            triangles: 100,
            builder: builder.into(),
            kind: "kdtree".into(),
            device: "a device".into(),
            driver: "a driver".into(),
            subgroup: 8,
            commit: "abc1234".into(),
            when: "2026-11-21T10:00:00Z".into(),
            build: BuildRecord { runs: 1, median_ms, min_ms: median_ms, max_ms: median_ms, ..BuildRecord::default() },
            memory: MemoryRecord::default(),
            quality: QualityRecord { depth_avg: Some(depth), ..QualityRecord::default() },
            trace: Vec::new(),
            valid: None,
        }
    }

    #[test]
    fn schedules_stand_beside_the_chain_of_the_same_builder_and_scene() {
        let records = [
            record("a", "kd-gpu:bins=32:schedule=chain", 10.0, 19.0),
            record("a", "kd-gpu:schedule=across-levels:bins=32", 5.0, 19.0),
            record("b", "kd-gpu:bins=32:schedule=chain", 20.0, 23.0),
        ];
        let records: Vec<&Record> = records.iter().collect();
        assert_eq!(by_chain(&records, records[1]).map(|r| r.build.median_ms), Some(10.0));
        let legend = Legend::of(records.iter().copied());
        assert!(schedules(&records, &legend).expect("a chart").is_some());
        assert!(schedules(&[records[0], records[2]], &legend).expect("none").is_none(), "nothing beside the chain");
        assert!(schedules(&[records[1], records[2]], &legend).expect("none").is_none(), "of another scene");
    }
}
