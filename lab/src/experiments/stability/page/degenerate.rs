//! `degenerate.html`: who survives what.

use super::Paged;
use super::stretched::other_experiment;
use crate::Result;
use crate::experiments::stability::points::{Degenerate, Experiment};
use crate::report::beside::{DEGENERATE, Page};
use crate::report::elements::{number, scroll};
use crate::report::numbers::{count, three_digits, tick};
use crate::report::{Chart, Section, Table, distinct, lines, short};
use crate::scene;
use maud::{Markup, html};

impl lines::Entry for Degenerate {
    const FILE: &'static str = DEGENERATE.records;
    const COMMAND: &'static str = "hedgerow stability degenerate";

    fn fault(&self) -> Option<String> {
        other_experiment(self.experiment, Experiment::Degenerate)
    }
}

impl Paged for Degenerate {
    const PAGE: Page = DEGENERATE;
    const TITLE: [&'static str; 2] = [
        "Degenerate scenes",
        "Equal, flat, thin, far, huge, nested and broken triangles, and none at all: does every builder give a valid tree, the same bytes \
         each time, and the hits that brute force finds?",
    ];

    fn failures(points: &[Degenerate]) -> Vec<(String, String)> {
        let failed = points.iter().filter(|point| point.has_failed());
        failed.map(|point| (format!("{}, {}", point.scene, point.builder), point.faults.join("; "))).collect()
    }

    fn summary(points: &[Degenerate]) -> Markup {
        let ours = points.iter().filter(|point| point.is_ours);
        let (right, all) = (ours.clone().filter(|point| !point.has_failed()).count(), ours.count());
        let peers: Vec<&Degenerate> =
            points.iter().filter(|point| !point.is_ours && !point.faults.is_empty()).collect();
        let scenes = distinct(points.iter().map(|point| point.scene.as_str()));
        html! {
            p {
                "Of ours, " b { (right) " of " (all) } " pairs of a builder and one of " (scenes.len()) " scenes are right: a tree that keeps every rule of "
                "its layout, the same bytes each time, every finite triangle in it, and every ray of a sample as by brute force. "
                "A cell is the depth of the tree and what its status says, or what is wrong."
                @if !peers.is_empty() { " Of the peers, " (peers.len()) " are not: such cells are grey." }
            }
            (scroll("Who survives what", matrix(points, &scenes)))
        }
    }

    fn sections(points: &[Degenerate]) -> Result<(Vec<Section>, Vec<Chart>)> {
        let body = html! {
            p { "A heading sorts its column. Times are by the builder's own clock: timestamps of the device, or the wall's." }
            (figures(points))
        };
        Ok((vec![Section::new("figures", "All figures", body)], Vec::new()))
    }

    fn terms() -> Markup {
        html! {
            dt { "The scenes" }
            dd { "Of as many triangles as asked for, but for those whose name says how many; the same every time." }
            dt { "Valid" }
            dd { "A walk over the whole tree finds every rule of the layout kept: boxes exactly around what they hold, each triangle in one leaf, no deeper than tracers go." }
            dt { "The same bytes" }
            dd { "The structure is built as often as asked for, into the same memory, and every byte of it compared with those of the first build." }
            dt { "Hits" }
            dd {
                "Rays sent to triangles, from around the scene and from near the triangle, as closest-hit and as any-hit rays. Brute force over "
                "all triangles says what is right; a hit within a hair of an edge may go either way."
            }
            dt { "SAH cost" }
            dd { "(3 · Σ area of inner nodes + 2 · Σ area × triangles of leaves) / area of the root; 0 where that has none." }
        }
    }
}

/// What a scene is, in half a sentence.
fn what(scene: &str) -> Option<&'static str> {
    scene::degenerate(0).into_iter().find(|degenerate| degenerate.name == scene).map(|degenerate| degenerate.what)
}

fn matrix(points: &[Degenerate], scenes: &[&str]) -> Markup {
    let builders = distinct(points.iter().map(|point| point.builder.as_str()));
    html! {
        table #matrix {
            caption.hidden { "Who survives what" }
            thead { tr {
                th scope="col" .plain { "scene" }
                @for builder in &builders { th scope="col" .plain title=(builder) { (short(builder)) } }
            } }
            tbody {
                @for scene in scenes {
                    tr {
                        th scope="row" { (scene) @if let Some(what) = what(scene) { small { (what) } } }
                        @for builder in &builders { (cell(points.iter().find(|p| p.scene == *scene && p.builder == *builder))) }
                    }
                }
            }
        }
    }
}

/// The depth, or what is wrong, in a word.
fn cell(point: Option<&Degenerate>) -> Markup {
    let Some(point) = point else { return number(None, tick) };
    let word = match point {
        _ if point.faults.is_empty() => {
            let depth = point.depth_max.map_or("right".into(), |depth| depth.to_string());
            let status = point.status.as_ref().map_or(String::new(), |names| names.join(", "));
            return html! { td { (depth) @if !status.is_empty() { small { (status) } } } };
        }
        Degenerate { valid: Some(false), .. } => "invalid",
        Degenerate { same_bytes: Some(false), .. } => "other bytes",
        Degenerate { wrong: Some(1..), .. } => "wrong hits",
        _ => "failed",
    };
    let faults = point.faults.join("; ");
    html! { td .wrong[point.is_ours] .none[!point.is_ours] title=(faults) { (word) } }
}

fn figures(points: &[Degenerate]) -> Markup {
    let yes = |value: Option<bool>| match value {
        Some(true) => html! { td data-value="yes" { "yes" } },
        Some(false) => html! { td.wrong data-value="NO" { "NO" } },
        None => html! { td.none data-value="" { span aria-label="not measured" { "–" } } },
    };
    let of_count = |value: Option<u64>| value.map(|n| n as f64);
    Table::new("All figures", points)
        .name("scene", |point| &point.scene)
        .cell("builder", |point| {
            html! { td.builder data-value=(point.builder) title=(point.builder) { (short(&point.builder)) } }
        })
        .number("triangles", "", |point| Some(point.triangles as f64), count)
        .number("in the tree", "", move |point| of_count(point.active), count)
        .number("depth", "", move |point| of_count(point.depth_max), count)
        .number("SAH", "", |point| point.sah, three_digits)
        .text("status", |point| point.status.as_ref().map_or(String::new(), |names| names.join(", ")))
        .spread("build", "ms", |point| point.build_ms, three_digits)
        .cell("valid", move |point| yes(point.valid))
        .cell("same bytes", move |point| yes(point.same_bytes))
        .figure("rays that hit", "", |point| number(Some(point.hits as f64), |v| format!("{v:.0} of {}", point.rays)))
        .number("wrong", "", move |point| of_count(point.wrong), count)
        .cell("what is wrong", |point| {
            let faults = point.faults.join("; ");
            html! { td .wrong[point.has_failed()] data-value=(faults) { (faults) } }
        })
        .html()
}
