//! The sections of the page but the thesis' tables: the standing of cadences, scenes, sizes of pictures, all figures, and what words mean.

use super::Measured;
use super::totals::{Total, best_fixed, picture, totals};
use crate::experiments::fly::cadence::Cadence;
use crate::experiments::fly::fleet::scale;
use crate::report::numbers::{count, duration, grouped, short_count, three_digits, two_decimals, whole};
use crate::report::{Chart, Table, distinct, document};
use maud::{Markup, html};

/// Pictures for which the best fixed cadence is told.
const SIZES: [[u32; 2]; 6] = [[320, 180], [640, 360], [1280, 720], [1920, 1080], [3840, 2160], [7680, 4320]];

pub(super) fn summary(measured: &Measured) -> Markup {
    let notes = measured.setting.as_ref().map_or(&[][..], |setting| &setting.setting.notes);
    html! {
        @for sentence in reading(measured) { p { (sentence) } }
        @for note in notes { p.note { (note) } }
        @for path in &measured.paths {
            p {
                (path.scene) ": " (grouped(path.triangles)) " triangles, " (path.frames.len()) " of " (path.path_frames)
                " frames in " (path.seconds) " s; path " (path.path) "."
            }
        }
    }
}

/// How `gain` stands, for each size of picture.
fn reading(measured: &Measured) -> Vec<String> {
    let Some(setting) = &measured.setting else { return Vec::new() };
    let all = totals(&measured.frames);
    let sentence = |&size: &[u32; 2]| {
        let scale = scale(size, setting.size);
        let flown = all.iter().filter(|total| total.frame_size == Some(size));
        let over: Vec<(&Total, f64, bool)> = flown
            .filter_map(|total| {
                let best = best_fixed(&all, &total.scene, &total.builder, scale)?;
                Some((total, total.at(scale) / best.at(scale), best.cadence == Cadence::Never))
            })
            .collect();
        let (worst, ratio, _) = over.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
        let never = over.iter().filter(|(.., never)| *never).count();
        Some(format!(
            "With pictures of {}, gain takes at most {} times as long as the best fixed cadence ({} with {}). Never to rebuild is best in \
             {never} of {} flights.",
            picture(size),
            two_decimals(*ratio),
            worst.scene,
            worst.builder,
            over.len()
        ))
    };
    let told: Vec<String> = setting.frame_sizes.iter().filter_map(sentence).collect();
    if told.is_empty() { vec!["Gain was not flown, so that no cadence is put beside it.".into()] } else { told }
}

pub(super) fn scene(measured: &Measured, scene: &str, charts: &[Chart]) -> Markup {
    let Some(setting) = &measured.setting else { return document::charts(charts) };
    let all = totals(&measured.frames);
    let all = &all;
    let rows = setting.frame_sizes.iter().flat_map(|&size| {
        all.iter().filter(move |total| total.scene == scene && total.is_for(size)).map(move |total| (size, total))
    });
    let scale_of = |size| scale(size, setting.size);
    let table = Table::new(format!("{scene}: totals by builder and cadence"), rows)
        .name("builder", |(_, total)| &total.builder)
        .text("cadence", |(_, total)| total.cadence)
        .text("picture", |(size, _)| picture(*size))
        .number("builds", "", |(_, total)| Some(total.builds as f64), whole)
        .number("building", "", |(_, total)| Some(total.build_ms), duration)
        .number("looking", "", |(_, total)| Some(total.probe_ms), duration)
        .number("tracing", "", move |(size, total)| Some(total.trace_ms * scale_of(*size)), duration)
        .number("total", "", move |(size, total)| Some(total.at(scale_of(*size))), duration)
        .number(
            "over the best fixed",
            "×",
            move |(size, total)| {
                let scale = scale_of(*size);
                Some(total.at(scale) / best_fixed(all, &total.scene, &total.builder, scale)?.at(scale))
            },
            two_decimals,
        )
        .number("work", "a ray", |(_, total)| total.work, three_digits);
    html! { (document::charts(charts)) (table.html()) }
}

/// The best fixed cadence by the number of rays a frame.
pub(super) fn sizes(measured: &Measured) -> Markup {
    let Some(setting) = &measured.setting else { return html! {} };
    let all = totals(&measured.frames);
    let all = &all;
    let taught = measured.frames.iter().filter(|frame| frame.taught_by.is_some());
    let rows = distinct(taught.map(|frame| (frame.scene.clone(), frame.builder.clone())));
    let table = Table::new("The best fixed cadence by the size of the picture", rows)
        .name("scene", |row| row.0.clone())
        .text("builder", |row| row.1.clone());
    let table = SIZES.iter().fold(table, |table, &size| {
        let scale = scale(size, setting.size);
        let rays = move |scene: &str, builder: &str| {
            let total = all.iter().find(|total| total.scene == scene && total.builder == builder)?;
            Some(total.rays as f64 * scale / total.frames as f64)
        };
        table.cell(&picture(size), move |(scene, builder)| {
            let best = best_fixed(all, scene, builder, scale).map_or("–".to_owned(), |best| best.cadence.to_string());
            html! { td data-value=(best) { (best) @if let Some(rays) = rays(scene, builder) { small { (short_count(rays)) " rays" } } } }
        })
    });
    html! {
        p {
            "Of the fixed cadences that were flown, the one of least total time, builds charged, by the picture, with the rays of a frame "
            "below. Tracing goes with the number of pixels, which small pictures cannot show: builds of hundreds of milliseconds pay where "
            "there are many rays."
        }
        (table.html())
    }
}

pub(super) fn every_frame(measured: &Measured) -> Markup {
    let most = measured.frames.iter().max_by_key(|frame| frame.trace.len());
    let kinds = most.into_iter().flat_map(|frame| frame.trace.iter().map(|rays| rays.rays.as_str()));
    let mut all = Table::new("Every frame", &measured.frames)
        .name("scene", |frame| &frame.scene)
        .text("builder", |frame| &frame.builder)
        .text("cadence", |frame| frame.cadence)
        .text("for", |frame| frame.frame_size.map_or("–".into(), picture))
        .number("frame", "", |frame| Some(frame.frame.into()), whole)
        .number("built in", "", |frame| Some(frame.built_at.into()), whole)
        .number("taught by", "", |frame| frame.taught_by.map(f64::from), whole)
        .number("build", "ms", |frame| Some(frame.build_ms), three_digits)
        .number("looking", "ms", |frame| Some(frame.probe_ms), three_digits)
        .number("over plain", "×", |frame| frame.ratio, three_digits)
        .number("rays taught", "", |frame| frame.sample_rays.map(|n| n as f64), count)
        .number("triangles seen", "", |frame| frame.seen_triangles.map(|n| n as f64), count);
    for kind in kinds {
        all = all
            .number(
                kind,
                "ms",
                move |frame| frame.trace.iter().find(|r| r.rays == kind).map(|r| r.trace_ms),
                three_digits,
            )
            .number("steps", "a ray", move |frame| frame.trace.iter().find(|r| r.rays == kind)?.steps, three_digits)
            .number("tests", "a ray", move |frame| frame.trace.iter().find(|r| r.rays == kind)?.tests, three_digits);
    }
    html! { details { summary { "All figures" } (all.html()) } }
}

pub(super) fn terms() -> Markup {
    html! {
        dt { "Cadence" }
        dd { "When a tree is built again: never, in every so many of the measured frames, or by gain. All build in the first." }
        dt { "What teaches" }
        dd { "The frame before the one in which a tree is built: its camera, and rays with a seed of their own. The first tree is taught by its own view with that other seed. Rays that are measured never teach." }
        dt { "Gain" }
        dd {
            "Looks at a sample of each frame's rays, a 64th and at most 16,384: their work over that through a plain tree by surface area. What "
            "that ratio is above what it was when the tree was new, a rebuild would win. It rebuilds where the frames to come, if they go as "
            "the last did, win the price of a build; or where what was lost beyond what earlier trees lost at that age has reached it. "
            "Looking is charged, and so is the plain tree."
        }
        dt { "Builds" }
        dd { "Timed once. Cadences that build in one frame share the tree and its time. What it takes to make or trace rays that teach is not charged: those are rays of a frame that was traced." }
        dt { "Tracing" }
        dd { "The median of the runs, all trees in turn. For other pictures it is multiplied by the ratio of pixels; the samples that teach stay as they are." }
        dt { "Work" }
        dd { "3 a step and 2 a test, of all rays by their number. It does not depend on the machine." }
    }
}
