//! The charts of a scene: build time against what the tree is worth, and where build time goes.

use crate::Result;
use crate::experiments::bench::pareto;
use crate::experiments::cpu_builders::measured::{Measured, OnScene, family};
use crate::report::chart::{Area, Caption, Chart, Drawn, Overlay};
use crate::report::labels::Rect;
use crate::report::names::{distinct, short, slug};
use crate::report::numbers::{duration, duration_tick, three_digits, tick};
use crate::report::plot::{Axis, Plot, Room, best_line};
use crate::report::stacked::{Part, Stack, stacked};
use crate::report::theme::{PHASES, SERIES, Tone};
use crate::subjects::retraced::TreeTracer;
use plotters::prelude::*;

/// Families in the order of their colours.
const FAMILIES: [&str; 9] = ["sweep", "binned", "aac", "bonsai", "incremental", "ploc-host", "host", "obvhs", "embree"];

/// The colour of a builder: that of its method.
pub(super) fn tone(builder: &str) -> Tone {
    let family = family(builder);
    SERIES[FAMILIES.iter().position(|other| *other == family).unwrap_or(FAMILIES.len())]
}

/// What build time is held against.
pub(super) struct Against {
    /// In the file's name.
    name: String,
    /// In the title.
    title: String,
    /// The name of the axis.
    axis: String,
    /// Whether less is better.
    is_cost: bool,
    /// The figures, one a builder.
    figures: Vec<Option<f64>>,
}

/// All charts of a scene: costs and rays of all kinds first, then each kind by each tracer, then phases.
pub(super) fn of_scene(scene: &OnScene<'_>) -> Result<Vec<Chart>> {
    let of = |figure: &dyn Fn(&Measured<'_>) -> Option<f64>| scene.builders.iter().map(figure).collect();
    let cost = |name: &str, figure: fn(&Measured<'_>) -> Option<f64>| Against {
        name: slug(name),
        title: name.into(),
        axis: format!("{name} ← better is lower"),
        is_cost: true,
        figures: of(&figure),
    };
    let mut all = vec![cost("SAH", |m| m.quality()?.sah), cost("EPO", |m| m.quality()?.epo)];
    let speed = |of_what: &str, tracer: TreeTracer, figures| Against {
        name: slug(&format!("{of_what} {}", tracer.name())),
        title: format!("{of_what}, {}", tracer.name()),
        axis: format!("{of_what}, million a second →"),
        is_cost: false,
        figures,
    };
    all.extend(TreeTracer::ALL.map(|tracer| speed("all rays", tracer, of(&|m| m.traced(tracer)?.mrays_s()))));
    for kind in scene.kinds() {
        all.extend(
            TreeTracer::ALL
                .map(|tracer| speed(&format!("{kind} rays"), tracer, of(&|m| Some(m.rays(tracer, kind)?.mrays_s)))),
        );
    }
    let charts = all.iter().map(|against| scatter(scene, against)).chain([phases(scene)]);
    Ok(charts.collect::<Result<Vec<_>>>()?.into_iter().flatten().collect())
}

/// Build time against a figure. `None` if no builder has both.
fn scatter(scene: &OnScene<'_>, against: &Against) -> Result<Option<Chart>> {
    let Against { name, title, axis, is_cost, figures } = against;
    let with = scene.builders.iter().zip(figures).filter_map(|(m, y)| Some((m, (m.build_ms()?, (*y)?))));
    let points: Vec<(&Measured<'_>, (f64, f64))> =
        with.filter(|(_, at)| at.0 > 0.0 && at.0.is_finite() && at.1.is_finite()).collect();
    if points.is_empty() {
        return Ok(None);
    }
    let better = if *is_cost { -1.0 } else { 1.0 };
    let mut frontier = pareto::frontier(&points.iter().map(|(_, at)| (-at.0, better * at.1)).collect::<Vec<_>>());
    frontier.reverse();
    let best: Vec<String> = frontier.iter().map(|&i| short(&points[i].0.builder)).collect();
    let in_words = |(m, (x, y)): &(&Measured<'_>, (f64, f64))| {
        format!("{}: {}, {}", short(&m.builder), duration(*x), three_digits(*y))
    };
    let caption = Caption {
        name: format!("cpu-{}-{name}", slug(scene.scene)),
        title: format!("{}: build time against {title}", scene.scene),
        alt: points.iter().map(in_words).collect::<Vec<_>>().join("; "),
        reading: format!(
            "{} and to the left is better. No other beats at both: {}.",
            if *is_cost { "Down" } else { "Up" },
            best.join(", ")
        ),
    };
    let bound = |of: fn(&(f64, f64)) -> f64, start: f64, pick: fn(f64, f64) -> f64| {
        points.iter().map(|(_, at)| of(at)).fold(start, pick)
    };
    let (x_low, x_high) = (bound(|at| at.0, f64::INFINITY, f64::min), bound(|at| at.0, 0.0, f64::max));
    let (y_low, y_high) = (bound(|at| at.1, f64::INFINITY, f64::min), bound(|at| at.1, f64::NEG_INFINITY, f64::max));
    let margin = (0.12 * (y_high - y_low)).max(0.02 * y_high.abs()).max(1e-9);
    let (left, right) = (x_low / 1.5, x_high * 1.5);
    let (bottom, top) = (y_low - margin, y_high + margin);
    let draw = |area: &Area<'_>, overlay: &mut Overlay| -> Drawn {
        let x = Axis { name: "build time, all threads ← better is less", is_log: true, number: duration_tick };
        let y = Axis { name: axis, is_log: false, number: tick };
        let room = Room { left: 64, ..Room::default() };
        let mut plot = Plot::new(area, &room, (&x, left..right), (&y, bottom..top))?;
        let corners: Vec<(f64, f64)> = frontier.iter().map(|&i| points[i].1).collect();
        let edge = staircase(&corners, if *is_cost { top } else { bottom }, right);
        plot.line(edge.clone(), best_line())?;
        for (measured, at) in &points {
            let style = tone(&measured.builder).light.filled();
            if measured.is_peer() {
                plot.chart.draw_series([EmptyElement::at(*at) + Rectangle::new([(-5, -5), (6, 6)], style)])?;
            } else {
                plot.chart.draw_series([Circle::new(*at, 5, style)])?;
            }
        }
        let at: Vec<_> = points.iter().map(|(_, at)| plot.pixel(*at)).collect();
        let texts: Vec<_> = points.iter().map(|(m, _)| (short(&m.builder), tone(&m.builder))).collect();
        let edge: Vec<_> = edge.iter().map(|&corner| plot.pixel(corner)).collect();
        let lines: Vec<Rect> = edge.windows(2).map(|ends| Rect::around(ends[0], ends[1]).grown(4.0)).collect();
        overlay.label_points(&at, &texts, &lines, plot.frame);
        for ((measured, (build, figure)), &(x, y)) in points.iter().zip(&at) {
            let tip = format!("{}\n{}, {}", measured.builder, duration(*build), three_digits(*figure));
            overlay.tip(Rect { x: x - 9.0, y: y - 9.0, w: 18.0, h: 18.0 }, &tip);
        }
        Ok(())
    };
    Chart::draw(caption, draw).map(Some)
}

/// The edge of what the frontier beats, from the fastest build to the right end of the axis.
fn staircase(frontier: &[(f64, f64)], worst: f64, right: f64) -> Vec<(f64, f64)> {
    let (Some(&first), Some(&last)) = (frontier.first(), frontier.last()) else { return Vec::new() };
    let mut path = vec![(first.0, worst), first];
    for pair in frontier.windows(2) {
        path.push((pair[1].0, pair[0].1));
        path.push(pair[1]);
    }
    path.push((right, last.1));
    path
}

/// Where the time of builds goes, by all threads.
fn phases(scene: &OnScene<'_>) -> Result<Option<Chart>> {
    let records: Vec<_> =
        scene.builders.iter().filter_map(Measured::own).filter(|r| !r.build.phases.is_empty()).collect();
    let names = distinct(records.iter().flat_map(|record| &record.build.phases).map(|phase| phase.name.as_str()));
    let tone_of = |name: &str| PHASES[names.iter().position(|other| *other == name).unwrap_or(0) % PHASES.len()];
    let stacks: Vec<Stack> = records
        .iter()
        .map(|record| Stack {
            name: short(&record.builder),
            tone: tone(&record.builder),
            total: record.build.median_ms,
            parts: record
                .build
                .phases
                .iter()
                .map(|phase| Part {
                    name: phase.name.clone(),
                    milliseconds: phase.median_ms,
                    tone: tone_of(&phase.name),
                })
                .collect(),
        })
        .collect();
    let caption = Caption {
        name: format!("cpu-{}-phases", slug(scene.scene)),
        title: format!("{}: where build time goes, all threads", scene.scene),
        alt: stacks.iter().map(Stack::in_words).collect::<Vec<_>>().join("; "),
        reading: "One bar a builder, its phases from left to right in the order in which they run.".into(),
    };
    stacked(caption, "milliseconds", "build", &stacks)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_staircase_bounds_what_is_beaten() {
        let path = staircase(&[(1.0, 9.0), (2.0, 5.0)], 10.0, 4.0);
        assert_eq!(path, [(1.0, 10.0), (1.0, 9.0), (2.0, 9.0), (2.0, 5.0), (4.0, 5.0)]);
        assert!(staircase(&[], 0.0, 0.0).is_empty());
    }

    #[test]
    fn each_method_has_a_colour_of_its_own() {
        let tones = FAMILIES.map(tone);
        assert_eq!(distinct(tones.iter().map(|tone| tone.variable)).len(), FAMILIES.len());
        assert_eq!(tone("lbvh-host").variable, "series-9");
    }
}
