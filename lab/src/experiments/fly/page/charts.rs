//! The charts of a scene: work over the frames by cadence, a chart a builder that is taught; and total time, builds charged.

use super::Measured;
use super::totals::{Total, picture, totals};
use crate::Result;
use crate::experiments::fly::cadence::Cadence;
use crate::experiments::fly::fleet::scale;
use crate::experiments::fly::points::FlownFrame;
use crate::measure::Spread;
use crate::report::numbers::tick;
use crate::report::stacked::{Part, Stack, stacked};
use crate::report::theme::PHASES;
use crate::report::{Axis, Caption, Chart, Curve, SERIES, Tone, curves, distinct, short, slug};

/// Those of a scene.
pub(super) fn of_scene(measured: &Measured, scene: &str) -> Result<Vec<Chart>> {
    let frames: Vec<&FlownFrame> = measured.frames.iter().filter(|frame| frame.scene == scene).collect();
    let taught = distinct(frames.iter().filter(|f| f.taught_by.is_some()).map(|f| f.builder.as_str()));
    let mut charts = Vec::new();
    for builder in taught {
        charts.extend(work_over_frames(&frames, scene, builder)?);
    }
    if let Some(setting) = &measured.setting {
        for &size in &setting.frame_sizes {
            charts.extend(total_times(measured, scene, (size, setting.size))?);
        }
    }
    Ok(charts)
}

/// The colour of a cadence, on all of the page; `place` is its place among those that were flown.
fn tone(cadence: Cadence, place: usize) -> Tone {
    match cadence {
        Cadence::Never => SERIES[0],
        Cadence::Gain => SERIES[2],
        Cadence::Every(_) => SERIES[[1, 3, 4, 5, 6][place % 5]],
    }
}

fn work_over_frames(frames: &[&FlownFrame], scene: &str, builder: &str) -> Result<Option<Chart>> {
    let of_builder: Vec<&&FlownFrame> = frames.iter().filter(|frame| frame.builder == builder).collect();
    let flown = distinct(of_builder.iter().map(|frame| (frame.cadence, frame.frame_size)));
    // The first that is kept because nothing teaches it.
    let plain = frames.iter().find(|frame| frame.taught_by.is_none()).map(|frame| frame.builder.as_str());
    let curve = |name: String, tone: Tone, of: Vec<&&FlownFrame>| {
        let points =
            of.iter().filter_map(|frame| Some((f64::from(frame.frame), Spread::once(frame.work()?)))).collect();
        Curve { name, tone, points, law: None }
    };
    let mut all: Vec<Curve> = flown
        .iter()
        .enumerate()
        .map(|(place, &(cadence, size))| {
            let of = of_builder.iter().copied().filter(|f| (f.cadence, f.frame_size) == (cadence, size)).collect();
            let name = size.map_or(cadence.to_string(), |size| format!("{cadence} {}", picture(size)));
            curve(name, tone(cadence, place), of)
        })
        .collect();
    if let Some(plain) = plain {
        all.push(curve(short(plain), SERIES[8], frames.iter().filter(|frame| frame.builder == plain).collect()));
    }
    all.retain(|curve| !curve.points.is_empty());
    let caption = Caption {
        name: format!("fly-work-{}-{}", slug(scene), slug(builder)),
        title: format!("{scene}: work a ray, frame by frame"),
        alt: format!("Work a ray in every frame with {builder}, a line a cadence"),
        reading: format!(
            "With {builder}. 3 a step and 2 a test, over rays of all kinds. Where lines of cadences lie apart, trees grow stale."
        ),
    };
    let x = Axis { name: "frame", is_log: false, number: tick };
    curves::curves(caption, &all, &x, &Axis { name: "work a ray", is_log: false, number: tick })
}

fn total_times(measured: &Measured, scene: &str, (size, traced): ([u32; 2], [u32; 2])) -> Result<Option<Chart>> {
    let scale = scale(size, traced);
    let all = totals(&measured.frames);
    let of_scene = all.iter().filter(|total| total.scene == scene && total.is_for(size));
    let builders = distinct(measured.frames.iter().map(|frame| frame.builder.as_str()));
    let stack = |(place, total): (usize, &Total)| {
        let part = |name: &str, milliseconds, tone| Part { name: name.into(), milliseconds, tone };
        Stack {
            name: format!("{}, {}", label(&total.builder, &builders), total.cadence),
            tone: tone(total.cadence, place),
            total: total.at(scale),
            parts: vec![
                part("builds", total.build_ms, PHASES[0]),
                part("looking", total.probe_ms, PHASES[3]),
                part("rays", total.trace_ms * scale, PHASES[5]),
            ],
        }
    };
    let stacks: Vec<Stack> = of_scene.enumerate().map(stack).collect();
    let picture = picture(size);
    let caption = Caption {
        name: format!("fly-total-{}-{picture}", slug(scene)),
        title: format!("{scene}: the whole flight, builds charged, {picture}"),
        alt: stacks.iter().map(Stack::in_words).collect::<Vec<_>>().join("; "),
        reading: "One bar a builder and cadence. Shorter is better. Tracing is that of the small pictures, times the ratio of pixels.".into(),
    };
    stacked(caption, "milliseconds of the flight", "flight", &stacks)
}

/// A builder by its name and what it learns from, where no other of `all` is called so: bars have little room for names.
fn label(builder: &str, all: &[&str]) -> String {
    let brief = |builder: &str| {
        let mut parts = builder.split(':');
        let name = parts.next().unwrap_or_default().to_owned();
        let of_learning = ["heuristic=", "rays="];
        let values = parts.filter_map(|part| of_learning.iter().find_map(|key| part.strip_prefix(key)));
        values.fold(name, |label, value| label + " " + value)
    };
    let own = brief(builder);
    if all.iter().filter(|other| brief(other) == own).count() > 1 { short(builder) } else { own }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn builders_are_called_by_what_they_learn_from_unless_two_were_called_the_same() {
        let rdh = "binned:axes=all:bins=10:heuristic=rdh:rays=primary";
        assert_eq!(label(rdh, &["hploc", rdh]), "binned rdh primary");
        assert_eq!(label("hploc:radius=8", &["hploc", "hploc:radius=8"]), "hploc radius 8");
    }
}
