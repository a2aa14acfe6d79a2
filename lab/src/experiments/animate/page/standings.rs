//! The ways against each other, by means over the frames.

use crate::experiments::animate::AnimationMethod;
use crate::experiments::animate::points::Animated;
use crate::report::distinct;
use crate::report::numbers::{duration, size, three_digits};
use crate::report::table::{or_dash, with_header};
use comfy_table::Table;

/// A way, in the mean over the frames of the medians of their runs.
#[derive(Debug, Clone, PartialEq)]
pub struct Standing {
    /// The way.
    pub way: AnimationMethod,
    /// The builder of what is built each frame.
    pub builder: String,
    /// What builds were timed by.
    pub timer: String,
    /// How many frames.
    pub frames: usize,
    /// Milliseconds of building.
    pub build_ms: f64,
    /// Milliseconds of each kind of rays.
    pub trace_ms: Vec<(String, f64)>,
    /// Milliseconds of both.
    pub frame_ms: f64,
    /// SAH cost, where rays go through one tree.
    pub sah: Option<f64>,
    /// Bytes of all structures.
    pub structure_bytes: Option<f64>,
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0u32), |(sum, count), value| (sum + value, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

/// Each way in the order in which it first appears.
pub fn standings(frames: &[Animated]) -> Vec<Standing> {
    let standing = |way: AnimationMethod| {
        let of_way: Vec<&Animated> = frames.iter().filter(|frame| frame.way == way).collect();
        let kinds = distinct(of_way.iter().flat_map(|frame| &frame.trace).map(|rays| rays.rays.as_str()));
        let count = of_way.len() as f64;
        let of_kind = |kind: &str| {
            let all = of_way.iter().flat_map(|frame| &frame.trace).filter(|rays| rays.rays == kind);
            all.map(|rays| rays.trace_ms.median).sum::<f64>() / count
        };
        let first = of_way.first()?;
        Some(Standing {
            way,
            builder: first.builder.clone(),
            timer: first.timer.clone(),
            frames: of_way.len(),
            build_ms: mean(of_way.iter().map(|frame| frame.build_ms.median))?,
            trace_ms: kinds.iter().map(|kind| ((*kind).to_owned(), of_kind(kind))).collect(),
            frame_ms: mean(of_way.iter().map(|frame| frame.frame_ms()))?,
            sah: mean(of_way.iter().filter_map(|frame| frame.sah)),
            structure_bytes: mean(of_way.iter().filter_map(|f| f.memory.structure_bytes).map(|bytes| bytes as f64)),
        })
    };
    distinct(frames.iter().map(|frame| frame.way)).into_iter().filter_map(standing).collect()
}

/// The way whose frames take least.
pub fn fastest(standings: &[Standing]) -> Option<&Standing> {
    standings.iter().min_by(|a, b| a.frame_ms.total_cmp(&b.frame_ms))
}

/// The ways as a table for the terminal.
pub fn table(frames: &[Animated]) -> Table {
    let all = standings(frames);
    let kinds: Vec<&String> = all.first().map_or_else(Vec::new, |s| s.trace_ms.iter().map(|(kind, _)| kind).collect());
    let head = ["way", "builder", "timer", "frames", "build"].map(String::from);
    let tail = ["frame", "× fastest", "SAH", "memory"].map(String::from);
    let mut table = with_header(head.into_iter().chain(kinds.into_iter().cloned()).chain(tail), 3);
    let least = fastest(&all).map_or(f64::NAN, |fastest| fastest.frame_ms);
    for standing in &all {
        let head = [
            standing.way.name().to_owned(),
            standing.builder.clone(),
            standing.timer.clone(),
            standing.frames.to_string(),
            duration(standing.build_ms),
        ];
        let tail = [
            duration(standing.frame_ms),
            three_digits(standing.frame_ms / least),
            or_dash(standing.sah, three_digits),
            or_dash(standing.structure_bytes, size),
        ];
        table.add_row(head.into_iter().chain(standing.trace_ms.iter().map(|(_, ms)| duration(*ms))).chain(tail));
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::animate::points::Rays;
    use crate::measure::record::MemoryRecord;
    use crate::measure::statistics::Spread;

    fn frame(number: u32, way: AnimationMethod, build: f64, trace: [f64; 2]) -> Animated {
        let spread = |median: f64| Spread { median, min: median, max: median, runs: 1 };
        let rays = |(kind, ms): (&str, f64)| Rays {
            rays: kind.into(),
            count: 100,
            hits: 50,
            trace_ms: spread(ms),
            steps: None,
            tests: None,
            checksum: "1".into(),
            different: 0,
        };
        Animated {
            scene: "scene".into(),
            frame: number,
            time: number as f32,
            way,
            builder: "kd-gpu".into(),
            timer: "device".into(),
            static_triangles: 10,
            dynamic_triangles: 2,
            build_ms: spread(build),
            trace: ["primary", "shadow"].into_iter().zip(trace).map(rays).collect(),
            memory: MemoryRecord { structure_bytes: Some(1024), ..MemoryRecord::default() },
            sah: (way == AnimationMethod::Rebuild).then_some(50.0),
        }
    }

    #[test]
    fn a_way_stands_by_the_means_over_its_frames() {
        let frames = [
            frame(0, AnimationMethod::Rebuild, 10.0, [1.0, 2.0]),
            frame(0, AnimationMethod::TwoTrees, 2.0, [2.0, 3.0]),
            frame(1, AnimationMethod::Rebuild, 14.0, [3.0, 2.0]),
            frame(1, AnimationMethod::TwoTrees, 4.0, [2.0, 3.0]),
        ];
        let all = standings(&frames);
        let [rebuild, two] = &all[..] else { panic!("{all:?}") };
        assert_eq!(
            (rebuild.way, rebuild.frames, rebuild.build_ms, rebuild.frame_ms),
            (AnimationMethod::Rebuild, 2, 12.0, 16.0)
        );
        assert_eq!(rebuild.trace_ms, [("primary".to_owned(), 2.0), ("shadow".to_owned(), 2.0)]);
        assert_eq!((rebuild.sah, two.sah), (Some(50.0), None));
        assert_eq!(fastest(&all).map(|s| s.way), Some(AnimationMethod::TwoTrees));
        let text = table(&frames).to_string();
        assert!(text.contains("two-trees") && text.contains("8.00 ms") && text.contains("2.00"), "{text}");
    }
}
