//! Builds and rays together, by builder and cadence, for pictures of any size: tracing goes with the number of rays, builds do not.

use crate::experiments::fly::cadence::Cadence;
use crate::experiments::fly::fleet::scale;
use crate::experiments::fly::points::FlownFrame;
use crate::report::distinct;
use crate::report::numbers::{duration, three_digits, two_decimals};
use crate::report::table::{or_dash, with_header};
use comfy_table::Table;

/// A builder at a cadence through a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Total {
    /// The scene.
    pub scene: String,
    /// The builder.
    pub builder: String,
    /// The cadence.
    pub cadence: Cadence,
    /// Of `gain`, the picture for which it flew.
    pub frame_size: Option<[u32; 2]>,
    /// How many frames.
    pub frames: usize,
    /// How many builds, the first among them.
    pub builds: usize,
    /// Milliseconds of all builds.
    pub build_ms: f64,
    /// Milliseconds of looking whether a rebuild pays, for its picture.
    pub probe_ms: f64,
    /// Milliseconds of tracing the small pictures.
    pub trace_ms: f64,
    /// Rays of the small pictures.
    pub rays: u64,
    /// Work a ray: 3 a step and 2 a test.
    pub work: Option<f64>,
}

impl Total {
    /// Milliseconds of the flight with pictures of `scale` times as many pixels.
    pub fn at(&self, scale: f64) -> f64 {
        self.build_ms + self.probe_ms + self.trace_ms * scale
    }

    /// Whether it is meant for this picture: fixed cadences are for all.
    pub fn is_for(&self, size: [u32; 2]) -> bool {
        self.frame_size.is_none_or(|flown_for| flown_for == size)
    }
}

/// The totals, in the order in which builders and cadences first appear.
pub fn totals(frames: &[FlownFrame]) -> Vec<Total> {
    let key = |frame: &FlownFrame| (frame.scene.clone(), frame.builder.clone(), frame.cadence, frame.frame_size);
    let total = |of| {
        let frames: Vec<&FlownFrame> = frames.iter().filter(|frame| key(frame) == of).collect();
        let sum = |of: fn(&FlownFrame) -> f64| frames.iter().map(|frame| of(frame)).sum();
        let rays: u64 = frames.iter().map(|frame| frame.ray_count()).sum();
        let work: Option<f64> = frames.iter().map(|frame| Some(frame.work()? * frame.ray_count() as f64)).sum();
        let (scene, builder, cadence, frame_size) = of;
        Total {
            scene,
            builder,
            cadence,
            frame_size,
            frames: frames.len(),
            builds: frames.iter().filter(|frame| frame.built_at == frame.frame).count(),
            build_ms: sum(|frame| frame.build_ms),
            probe_ms: sum(|frame| frame.probe_ms),
            trace_ms: sum(FlownFrame::trace_ms),
            rays,
            work: work.filter(|_| rays > 0).map(|work| work / rays as f64),
        }
    };
    distinct(frames.iter().map(key)).into_iter().map(total).collect()
}

/// The one of least total time among fixed cadences of a builder through a scene.
pub fn best_fixed<'t>(all: &'t [Total], scene: &str, builder: &str, scale: f64) -> Option<&'t Total> {
    let of_it = |total: &&Total| total.scene == scene && total.builder == builder && total.cadence != Cadence::Gain;
    all.iter().filter(of_it).min_by(|a, b| a.at(scale).total_cmp(&b.at(scale)))
}

/// The totals for the terminal, for the pictures that were asked for.
pub fn table(frames: &[FlownFrame], measured: [u32; 2], frame_sizes: &[[u32; 2]]) -> Table {
    let all = totals(frames);
    let head = [
        "scene",
        "builder",
        "cadence",
        "picture",
        "builds",
        "building",
        "tracing",
        "total",
        "× best fixed",
        "work/ray",
    ];
    let mut table = with_header(head, 4);
    for total in &all {
        for &size in frame_sizes.iter().filter(|&&size| total.is_for(size)) {
            let scale = scale(size, measured);
            let best = best_fixed(&all, &total.scene, &total.builder, scale).map(|best| best.at(scale));
            table.add_row([
                total.scene.clone(),
                total.builder.clone(),
                total.cadence.to_string(),
                picture(size),
                total.builds.to_string(),
                duration(total.build_ms + total.probe_ms),
                duration(total.trace_ms * scale),
                duration(total.at(scale)),
                or_dash(best, |best| two_decimals(total.at(scale) / best)),
                or_dash(total.work, three_digits),
            ]);
        }
    }
    table
}

/// `1280x720`.
pub fn picture([width, height]: [u32; 2]) -> String {
    format!("{width}x{height}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::fly::points::FlownRays;
    use std::num::NonZeroU32;

    fn frame(number: u32, cadence: Cadence, [build_ms, probe_ms, trace_ms]: [f64; 3]) -> FlownFrame {
        let rays = FlownRays { rays: "primary".into(), count: 100, trace_ms, steps: Some(10.0), tests: Some(5.0) };
        FlownFrame {
            scene: "scene".into(),
            builder: "binned:heuristic=rdh".into(),
            cadence,
            frame_size: (cadence == Cadence::Gain).then_some([20, 10]),
            frame: number,
            built_at: if build_ms > 0.0 { number } else { 0 },
            taught_by: Some(0),
            build_ms,
            timer: "wall".into(),
            probe_ms,
            ratio: None,
            trace: vec![rays],
            sample_rays: None,
            seen_triangles: None,
        }
    }

    #[test]
    fn builds_are_charged_as_they_are_and_rays_by_the_size_of_the_picture() {
        let every = Cadence::Every(NonZeroU32::MIN);
        let frames = [
            frame(0, Cadence::Never, [10.0, 0.0, 2.0]),
            frame(1, Cadence::Never, [0.0, 0.0, 3.0]),
            frame(0, every, [10.0, 0.0, 2.0]),
            frame(1, every, [12.0, 0.0, 1.0]),
            frame(0, Cadence::Gain, [10.0, 0.5, 2.0]),
            frame(1, Cadence::Gain, [0.0, 0.5, 3.0]),
        ];
        let all = totals(&frames);
        let [never, always, gain] = &all[..] else { panic!("{all:?}") };
        assert_eq!([never.at(1.0), always.at(1.0), gain.at(1.0)], [15.0, 25.0, 16.0]);
        assert_eq!([never.builds, always.builds, gain.builds], [1, 2, 1]);
        assert_eq!((never.work, never.rays), (Some(40.0), 200));
        let best = |scale: f64| best_fixed(&all, "scene", "binned:heuristic=rdh", scale).map(|best| best.cadence);
        // 10 + 5s against 22 + 3s: the same at 6.
        assert_eq!([best(5.0), best(7.0)], [Some(Cadence::Never), Some(every)]);
        assert!(gain.is_for([20, 10]) && !gain.is_for([40, 10]) && never.is_for([40, 10]));
        let text = table(&frames, [10, 10], &[[20, 10]]).to_string();
        assert!(text.contains("20x10") && text.contains("1.05"), "21 of 20: {text}");
    }
}
