//! The thesis' tables 2 to 6 and A.1 to A.8 in its layout: rows are scenes and kinds of rays, columns heuristics.

use super::Measured;
use super::published::{Beside, ratio};
use crate::experiments::fly::cadence::Cadence;
use crate::experiments::fly::points::{FlownFrame, FlownRays};
use crate::experiments::published;
use crate::report::Table;
use crate::report::numbers::{three_digits, two_decimals};
use maud::{Markup, html};
use std::num::NonZeroU32;

/// The heuristics by their names there and by option here; the first is by surface area.
const HEURISTICS: [(&str, &str); 6] = [
    ("SAH", "sah"),
    ("Int-Scene HQ", "interior-hq"),
    ("Int-Scene Fast", "interior-fast"),
    ("P-SAH", "perspective"),
    ("RDH", "rdh"),
    ("OSAH", "osah"),
];

/// Kinds of rays by their names here and there.
const KINDS: [(&str, &str); 6] = [
    ("primary", "primary"),
    ("diffuse1", "diffuse 1 st"),
    ("diffuse2", "diffuse 2 nd"),
    ("shadow", "shadow"),
    ("ao", "ao"),
    ("", "total"),
];

/// Which frames a table is of.
#[derive(Clone, Copy, PartialEq, Eq)]
enum View {
    /// The first, with trees that its own view has taught.
    Static,
    /// All, at a cadence.
    Flown(Cadence),
}

/// What a table is of.
#[derive(Clone, Copy, PartialEq, Eq)]
enum What {
    Nanoseconds,
    Steps,
    Tests,
}

/// Rebuilt in every so many frames, in all of them for 0.
fn every(frames: u32) -> View {
    View::Flown(Cadence::Every(NonZeroU32::new(frames).unwrap_or(NonZeroU32::MIN)))
}

/// Number, caption, metric of the thesis' figures, and what of ours.
fn lines() -> [(&'static str, &'static str, &'static str, What, View); 12] {
    use What::{Nanoseconds, Steps, Tests};
    let never = View::Flown(Cadence::Never);
    [
        ("2", "Nanoseconds a ray, a single viewpoint", "ns_per_ray_static", Nanoseconds, View::Static),
        ("4", "Nanoseconds a ray, camera path, trees kept", "ns_per_ray_animated_no_rebuild", Nanoseconds, never),
        ("5", "Nanoseconds a ray, rebuilt every three frames", "ns_per_ray_animated_rebuild3", Nanoseconds, every(3)),
        ("6", "Nanoseconds a ray, rebuilt every frame", "ns_per_ray_animated_rebuild1", Nanoseconds, every(1)),
        ("A.1", "Tests a ray, a single viewpoint", "tests_static", Tests, View::Static),
        ("A.2", "Steps a ray, a single viewpoint", "steps_static", Steps, View::Static),
        ("A.3", "Tests a ray, camera path, trees kept", "tests_animated_no_rebuild", Tests, never),
        ("A.4", "Steps a ray, camera path, trees kept", "steps_animated_no_rebuild", Steps, never),
        ("A.5", "Tests a ray, rebuilt every three frames", "tests_animated_rebuild3", Tests, every(3)),
        ("A.6", "Steps a ray, rebuilt every three frames", "steps_animated_rebuild3", Steps, every(3)),
        ("A.7", "Tests a ray, rebuilt every frame", "tests_animated_rebuild1", Tests, every(1)),
        ("A.8", "Steps a ray, rebuilt every frame", "steps_animated_rebuild1", Steps, every(1)),
    ]
}

/// An option of a builder as it is written.
fn option<'b>(builder: &'b str, key: &str) -> Option<&'b str> {
    builder.split(':').skip(1).filter_map(|option| option.split_once('=')).find(|(k, _)| *k == key).map(|(_, v)| v)
}

fn name(builder: &str) -> &str {
    builder.split(':').next().unwrap_or_default()
}

fn is_rdh(builder: &str) -> bool {
    option(builder, "heuristic") == Some("rdh")
}

/// The builders of the columns: variants of the one that has heuristics, or of the first.
struct Columns<'m> {
    measured: &'m Measured,
    base: &'m str,
}

impl<'m> Columns<'m> {
    fn of(measured: &'m Measured) -> Columns<'m> {
        let builders = || measured.frames.iter().map(|frame| frame.builder.as_str());
        let base = builders().find(|builder| option(builder, "heuristic").is_some()).or(builders().next());
        Columns { measured, base: name(base.unwrap_or_default()) }
    }

    /// The frames of a scene with the builder of a heuristic; of several, the first that learns from all kinds of rays.
    fn frames(&self, scene: &str, heuristic: &str, view: View) -> Vec<&'m FlownFrame> {
        let is_by = |frame: &&FlownFrame| {
            frame.scene == scene
                && name(&frame.builder) == self.base
                && option(&frame.builder, "heuristic").unwrap_or("sah") == heuristic
                && option(&frame.builder, "rays").is_none()
        };
        let by: Vec<&FlownFrame> = self.measured.frames.iter().filter(is_by).collect();
        let Some(&first) = by.first() else { return by };
        // Nothing teaches it, so that it is as good in every frame.
        let is_kept = first.taught_by.is_none();
        let is_of = |frame: &&FlownFrame| match view {
            View::Static => (frame.cadence, frame.frame) == (first.cadence, first.frame),
            View::Flown(cadence) => frame.cadence == cadence || is_kept && frame.cadence == Cadence::Never,
        };
        by.into_iter().filter(|frame| frame.builder == first.builder).filter(is_of).collect()
    }

    /// A figure of ours.
    fn figure(&self, scene: &str, kind: &str, heuristic: &str, (what, view): (What, View)) -> Option<f64> {
        mean(self.frames(scene, heuristic, view), kind, what)
    }
}

/// The mean over all rays of a kind, or of all kinds.
fn mean(frames: Vec<&FlownFrame>, kind: &str, what: What) -> Option<f64> {
    let of = |rays: &FlownRays| match what {
        What::Nanoseconds => Some(1e6 * rays.trace_ms),
        What::Steps => rays.steps.map(|steps| steps * rays.count as f64),
        What::Tests => rays.tests.map(|tests| tests * rays.count as f64),
    };
    let rays = frames.iter().flat_map(|frame| &frame.trace).filter(|rays| kind.is_empty() || rays.rays == kind);
    let (sum, count) = rays
        .map(|rays| (of(rays), rays.count))
        .fold((Some(0.0), 0), |(sum, count), (more, rays)| (sum.zip(more).map(|(sum, more)| sum + more), count + rays));
    sum.filter(|_| count > 0).map(|sum| sum / count as f64)
}

/// A row of a table: a scene, and a kind of rays here and there.
type Row = (String, (&'static str, &'static str));

fn cell(value: Option<f64>, sah: Option<f64>, published: [Option<f64>; 2]) -> Markup {
    let Some(value) = value else {
        return html! { td.number.none data-value="" { span aria-label="not measured" { "–" } } };
    };
    let [figure, ratio] = published;
    html! {
        td.number data-value=(value) {
            (three_digits(value))
            small {
                @if let Some(sah) = sah.filter(|sah| *sah > 0.0) { "× " (two_decimals(value / sah)) }
                @if figure.is_some() || ratio.is_some() { " | " }
                @if let Some(figure) = figure { (three_digits(figure)) " " }
                @if let Some(ratio) = ratio { "× " (two_decimals(ratio)) }
            }
        }
    }
}

/// All tables.
pub(super) fn section(measured: &Measured) -> Markup {
    let columns = Columns::of(measured);
    html! {
        p {
            "In each cell first what was measured here, with its ratio to SAH; then, behind the bar, what the thesis has. That is its figure "
            "and its ratio for the dragon, which is the same mesh. For bunny, sponza and classroom it is the ratio of its Bunny, Sponza "
            "(another model) and Conference, for other scenes the geometric mean of the ratios of all its scenes. The SAH tree is never "
            "rebuilt, so that it is what trees of tables 5 and 6 are put over."
        }
        @for (number, caption, metric, what, view) in lines() {
            (table(&columns, (number, caption), (metric, what, view)))
            @if number == "2" { (costs(measured, &columns)) }
        }
        (representative_rays(&columns))
        (errata())
    }
}

fn table(columns: &Columns<'_>, (number, caption): (&str, &str), (metric, what, view): (&str, What, View)) -> Markup {
    let scenes = columns.measured.scenes();
    let rows = scenes.iter().flat_map(|scene| KINDS.map(|kind| (scene.clone(), kind)));
    // A tree that is kept is no row of what is rebuilt.
    let is_of = |frame: &FlownFrame| matches!(view, View::Static) || view == View::Flown(frame.cadence);
    let has = |(scene, (kind, _)): &Row| {
        HEURISTICS.iter().any(|(_, option)| {
            let frames = columns.frames(scene, option, view);
            frames.iter().all(|frame| is_of(frame)) && mean(frames, kind, what).is_some()
        })
    };
    let rows: Vec<Row> = rows.filter(has).collect();
    if rows.is_empty() {
        return html! {};
    }
    let label = format!("Table {number}: {caption}");
    let table =
        Table::new(label.clone(), rows).name("Scene", |row: &Row| row.0.clone()).text("Rays", |row: &Row| row.1.1);
    let table = HEURISTICS.iter().fold(table, |table, &(there, here)| {
        table.figure(there, "", move |(scene, (kind, row))| {
            let value = columns.figure(scene, kind, here, (what, view));
            let sah = columns.figure(scene, kind, HEURISTICS[0].1, (what, view));
            cell(value, sah.filter(|_| here != HEURISTICS[0].1), beside(scene, (metric, row), there))
        })
    });
    html! { details open[number == "2"] { summary { (label) } (table.html()) } }
}

/// The figure and the ratio that stand beside ours.
fn beside(scene: &str, (metric, row): (&str, &str), heuristic: &str) -> [Option<f64>; 2] {
    let beside = Beside::of(scene);
    let figure = match beside {
        Beside::Same(there) => published::of(metric, there, row, heuristic),
        _ => None,
    };
    [figure, ratio(metric, beside, row, heuristic).filter(|_| heuristic != HEURISTICS[0].0)]
}

/// Weights of the overlap in table 3, as it has them from Aila et al. 2013; of other scenes their mean.
fn alpha(scene: &str) -> f64 {
    match scene {
        "dragon" => 0.61,
        "sponza" => 0.84,
        "classroom" => 0.42,
        _ => 0.71,
    }
}

/// Table 3: what trees cost by measures that no ray is traced for.
fn costs(measured: &Measured, columns: &Columns<'_>) -> Markup {
    const ROWS: [&str; 3] = ["SAH", "EPO", "SAH+EPO"];
    let cost = |scene: &str, heuristic: &str, row: &str| -> Option<f64> {
        let frame = *columns.frames(scene, heuristic, View::Static).first()?;
        let tree = measured.trees.iter().find(|tree| tree.scene == scene && tree.builder == frame.builder)?;
        match row {
            "SAH" => tree.sah,
            "EPO" => tree.epo,
            _ => Some((1.0 - alpha(scene)) * tree.sah? + alpha(scene) * tree.epo?),
        }
    };
    let cost = &cost;
    let scenes = measured.scenes();
    let rows = scenes.iter().flat_map(|scene| ROWS.map(|row| (scene.clone(), row)));
    let rows: Vec<(String, &str)> =
        rows.filter(|(scene, row)| HEURISTICS.iter().any(|(_, here)| cost(scene, here, row).is_some())).collect();
    if rows.is_empty() {
        return html! {};
    }
    let table =
        Table::new("Table 3: costs of trees", rows).name("Scene", |row| row.0.clone()).text("Cost", |row| row.1);
    let table = HEURISTICS.iter().fold(table, |table, &(there, here)| {
        table.figure(there, "", move |(scene, row)| {
            let sah = cost(scene, HEURISTICS[0].1, row).filter(|_| here != HEURISTICS[0].1);
            let row_there = match (Beside::of(scene), *row) {
                (Beside::Same(_), "SAH+EPO") => "SAH+EPO _{a=0.61}",
                (_, row) => row,
            };
            cell(cost(scene, here, row), sah, beside(scene, ("cost_static", row_there), there))
        })
    });
    html! {
        details { summary { "Table 3: costs of trees" }
            p { "By c_T = 3 and c_I = 2; the thesis does not say its own, so that figures of the dragon compare as ratios." }
            (table.html())
        }
    }
}

/// Figure 15: the first frame by trees that learned from some kinds of rays alone.
fn representative_rays(columns: &Columns<'_>) -> Markup {
    let first_frames = |scene: &str| -> Vec<&FlownFrame> {
        let mut first: Vec<&FlownFrame> = Vec::new();
        for frame in columns.measured.frames.iter().filter(|f| f.scene == scene && is_rdh(&f.builder)) {
            if first.iter().all(|other| other.builder != frame.builder) {
                first.push(frame);
            }
        }
        first
    };
    let rows: Vec<(String, &FlownFrame)> = columns
        .measured
        .scenes()
        .into_iter()
        .flat_map(|scene| first_frames(&scene).into_iter().map(move |frame| (scene.clone(), frame)))
        .collect();
    if rows.iter().all(|(_, frame)| option(&frame.builder, "rays").is_none()) {
        return html! {};
    }
    let work = |frames: Vec<&FlownFrame>, kind: &str| {
        Some(3.0 * mean(frames.clone(), kind, What::Steps)? + 2.0 * mean(frames, kind, What::Tests)?)
    };
    let table = Table::new("Figure 15: work over SAH by the rays that RDH learned from", rows)
        .name("Scene", |row| row.0.clone())
        .text("Learned from", |(_, frame)| option(&frame.builder, "rays").unwrap_or("all kinds").replace('+', ", "));
    let table = KINDS.iter().fold(table, |table, &(kind, heading)| {
        table.number(
            heading,
            "over SAH",
            move |(scene, frame)| {
                let sah = work(columns.frames(scene, HEURISTICS[0].1, View::Static), kind)?;
                Some(work(vec![*frame], kind)? / sah)
            },
            two_decimals,
        )
    });
    html! {
        details { summary { "Figure 15: RDH by the rays that it learned from" }
            p {
                "Work of the first frame, 3 a step and 2 a test, over that through the SAH tree. The figure in the thesis has no numbers left; "
                "its text finds that only all kinds together are good, and primary rays alone poor."
            }
            (table.html())
        }
    }
}

/// What is wrong in these tables of the thesis.
fn errata() -> Markup {
    html! {
        details { summary { "Errata of the thesis" }
            ul {
                li { "The caption of table 6 repeats that of table 5: table 6 is of trees that are rebuilt every frame." }
                li { "Table 6 lacks Soda Hall. The rows stand in the slides at the end, beside Conference's of table 6, and are used here." }
                li { "Its text says that RDH is about 10% faster than the next in Soda Hall: 823 against 945 ns are 13%." }
                li { "Its conclusion says that OSAH is best for all scenes where nothing is rebuilt: in table 4 it is best in one of eight." }
                li { "Costs c_T and c_I, build times, paths, lights, the number of frames and the variance are not told." }
                li { "RDH on the dragon takes 34 times as long as SAH in table 5, by leaves of many triangles. Leaves are made by surface area here." }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_of_builders_are_told_apart() {
        let builder = "binned:axes=all:heuristic=rdh:rays=primary+ao";
        assert_eq!(
            (name(builder), option(builder, "heuristic"), option(builder, "bins")),
            ("binned", Some("rdh"), None)
        );
        assert!(is_rdh(builder) && !is_rdh("binned:axes=all"));
    }
}
