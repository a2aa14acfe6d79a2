//! The charts: build and trace times stacked, a bar a way; and each way's frames one after the other.

use super::Measured;
use super::standings::{Standing, standings};
use crate::Result;
use crate::experiments::animate::AnimationMethod;
use crate::experiments::animate::points::Animated;
use crate::measure::Spread;
use crate::report::numbers::{duration_tick, tick};
use crate::report::stacked::{Part, Stack, stacked};
use crate::report::theme::PHASES;
use crate::report::{Axis, Caption, Chart, Curve, SERIES, Tone, curves};

/// The colour of a way, on all of the page.
pub fn tone(way: AnimationMethod) -> Tone {
    SERIES[AnimationMethod::ALL.iter().position(|&other| other == way).unwrap_or(0)]
}

/// The colour of a part of a bar: building, then the kinds of rays.
fn part_tone(part: usize) -> Tone {
    // Building apart from the rays, whose neighbours are told apart, too.
    PHASES[[0, 3, 5, 2, 6, 1, 4, 7][part % 8]]
}

pub(super) fn all(measured: &Measured) -> Result<Vec<Chart>> {
    let scene = measured.frames.first().map_or("", |frame| frame.scene.as_str());
    let standings = standings(&measured.frames);
    let total = |point: &Animated| {
        let sum = |of: fn(&Spread) -> f64| {
            of(&point.build_ms) + point.trace.iter().map(|rays| of(&rays.trace_ms)).sum::<f64>()
        };
        Spread { median: sum(|s| s.median), min: sum(|s| s.min), max: sum(|s| s.max), runs: point.build_ms.runs }
    };
    let frames = Caption {
        name: "animate-frames".into(),
        title: format!("{scene}: building and tracing, frame by frame"),
        alt: "The time of every frame in each way".into(),
        reading: "Build and rays together; the vertical axis is logarithmic. The line through a point goes from the fastest to the \
                  slowest run."
            .into(),
    };
    let builds = Caption {
        name: "animate-builds".into(),
        title: format!("{scene}: building, frame by frame"),
        alt: "What is built in every frame in each way: its time".into(),
        reading: "What a way must do a frame before rays can be traced; the vertical axis is logarithmic.".into(),
    };
    let charts = [
        parts_of_frames(scene, &standings)?,
        over_frames(&measured.frames, frames, "time of a frame", total)?,
        over_frames(&measured.frames, builds, "build time", |point| point.build_ms)?,
    ];
    Ok(charts.into_iter().flatten().collect())
}

fn stack(standing: &Standing) -> Stack {
    let rays = standing.trace_ms.iter().map(|(kind, ms)| (kind.as_str(), *ms));
    let parts = [("build", standing.build_ms)].into_iter().chain(rays).enumerate();
    Stack {
        name: standing.way.to_string(),
        tone: tone(standing.way),
        total: standing.frame_ms,
        parts: parts.map(|(i, (name, ms))| Part { name: name.into(), milliseconds: ms, tone: part_tone(i) }).collect(),
    }
}

fn parts_of_frames(scene: &str, standings: &[Standing]) -> Result<Option<Chart>> {
    let stacks: Vec<Stack> = standings.iter().map(stack).collect();
    let caption = Caption {
        name: "animate-frame".into(),
        title: format!("{scene}: where the time of a frame goes"),
        alt: stacks.iter().map(Stack::in_words).collect::<Vec<_>>().join("; "),
        reading: "One bar a way: what is built every frame, then the rays, kind by kind; means over the frames. Shorter is better.".into(),
    };
    stacked(caption, "milliseconds a frame", "frame", &stacks)
}

/// A curve a way over the frames.
fn over_frames(
    points: &[Animated],
    caption: Caption,
    time: &str,
    of: impl Fn(&Animated) -> Spread,
) -> Result<Option<Chart>> {
    let curve = |way: AnimationMethod| {
        let of_way = points.iter().filter(|point| point.way == way);
        let points = of_way.map(|point| (f64::from(point.frame), of(point))).collect();
        Curve { name: way.name().to_owned(), tone: tone(way), points, law: None }
    };
    let ways = AnimationMethod::ALL.into_iter().map(curve);
    let curves: Vec<Curve> = ways.filter(|curve| !curve.points.is_empty()).collect();
    let x = Axis { name: "frame", is_log: false, number: tick };
    curves::curves(caption, &curves, &x, &Axis { name: time, is_log: true, number: duration_tick })
}
