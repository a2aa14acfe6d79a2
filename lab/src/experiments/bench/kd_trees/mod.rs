//! kd-trees in the tables of Papay 2025, appendix D: trees with their nodes, leaves, depth, cost, time and memory, and the
//! tests and steps of rays. What the thesis has measured itself stands below as context.

pub mod published;

use crate::measure::record::{Record, TraceRecord};
use crate::report::chart::Chart;
use crate::report::columns;
use crate::report::document;
use crate::report::elements::number;
use crate::report::names::{short, slug};
use crate::report::numbers::{count, grouped, one_decimal, three_digits, two_decimals};
use crate::report::table::{or_dash, with_header};
use crate::subjects::KD_TREE;
use comfy_table::Table;
use maud::{Markup, html};
use published::{Published, Row};

/// A figure: its name and unit, in what was measured, in a file of published figures, and as text.
struct Figure<R> {
    name: &'static str,
    unit: &'static str,
    ours: fn(&R) -> Option<f64>,
    theirs: &'static str,
    text: fn(f64) -> String,
}

impl<R> Figure<R> {
    const fn new(
        [name, unit, theirs]: [&'static str; 3],
        text: fn(f64) -> String,
        ours: fn(&R) -> Option<f64>,
    ) -> Figure<R> {
        Figure { name, unit, ours, theirs, text }
    }
}

fn ratio(a: Option<u64>, b: Option<u64>) -> Option<f64> {
    a.zip(b.filter(|&b| b > 0)).map(|(a, b)| a as f64 / b as f64)
}

const TREE: [Figure<Record>; 13] = [
    Figure::new(["nodes", "", "nodes"], count, |r| Some((r.quality.inner? + r.quality.leaves?) as f64)),
    Figure::new(["inner / leaves", "", "inner_to_leaf"], two_decimals, |r| ratio(r.quality.inner, r.quality.leaves)),
    Figure::new(["full / empty", "", "nonempty_to_empty_leaf"], two_decimals, |r| {
        ratio(Some(r.quality.leaves? - r.quality.empty_leaves?), r.quality.empty_leaves)
    }),
    Figure::new(["leaf size", "mean", "avg_prims_leaf"], two_decimals, |r| r.quality.prims_per_leaf),
    Figure::new(["leaf size", "most", "max_prims_leaf"], count, |r| Some(r.quality.prims_per_leaf_max? as f64)),
    Figure::new(["depth", "mean", "avg_depth"], one_decimal, |r| r.quality.depth_avg),
    Figure::new(["cost", "", "cost"], two_decimals, |r| r.quality.sah),
    Figure::new(["build", "ms", "build_dynamic_ms"], three_digits, |r| Some(r.build.median_ms)),
    Figure::new(["task pool", "ms", "pool_ms"], three_digits, |r| r.build.pool_ms),
    Figure::new(["retrievals", "thousands", "retrievals_k"], three_digits, |r| Some(r.build.retrievals? as f64 * 1e-3)),
    Figure::new(["skipped", "thousands", "skipped_k"], three_digits, |r| {
        Some(r.build.skipped_retrievals? as f64 * 1e-3)
    }),
    Figure::new(["build and rays", "s", "frame_s"], three_digits, |r| Some(r.build.median_ms * 1e-3 + r.rays_s()?)),
    Figure::new(["memory", "MB", "memory_mb"], three_digits, |r| Some(r.memory.structure_bytes? as f64 * 1e-6)),
];

const RAYS: [Figure<TraceRecord>; 3] = [
    Figure::new(["tests", "a ray", "tests_per_ray"], three_digits, |t| t.tests),
    Figure::new(["steps", "a ray", "steps_per_ray"], three_digits, |t| t.steps),
    Figure::new(["speed", "Mrays/s", "mrays_s"], three_digits, |t| Some(t.mrays_s)),
];

/// What the thesis' rays are called where kinds are.
const THEIR_RAYS: &str = "its own";

/// The records of kd-trees.
pub fn of<'a>(records: &[&'a Record]) -> Vec<&'a Record> {
    records.iter().copied().filter(|record| record.kind == KD_TREE).collect()
}

/// An empty table for the terminal, with columns for names and figures.
fn table<R>(names: [&str; 3], figures: &[Figure<R>]) -> Table {
    let figure = |f: &Figure<R>| if f.unit.is_empty() { f.name.to_owned() } else { format!("{}, {}", f.name, f.unit) };
    with_header(names.map(str::to_owned).into_iter().chain(figures.iter().map(figure)), 3)
}

/// Both tables for the terminal, measured figures above published ones; nothing without a kd-tree.
pub fn text(records: &[&Record], published: &Published) -> Option<String> {
    let ours = of(records);
    if ours.is_empty() {
        return None;
    }
    let mut trees = table(["scene", "triangles", "builder"], &TREE);
    let mut rays = table(["scene", "builder", "rays"], &RAYS);
    for record in ours {
        let (scene, builder) = (record.scene.clone(), short(&record.builder));
        let figures = TREE.iter().map(|f| or_dash((f.ours)(record), f.text));
        trees.add_row([scene.clone(), grouped(record.triangles), builder.clone()].into_iter().chain(figures));
        for trace in &record.trace {
            let figures = RAYS.iter().map(|f| or_dash((f.ours)(trace), f.text));
            rays.add_row([scene.clone(), builder.clone(), trace.rays.clone()].into_iter().chain(figures));
        }
    }
    for row in &published.rows {
        let (scene, builder) = (format!("({})", row.scene), row.config.clone());
        let figures = TREE.iter().map(|f| or_dash(row.figure(f.theirs), f.text));
        trees.add_row([scene.clone(), or_dash(row.triangles, grouped), builder.clone()].into_iter().chain(figures));
        let figures = RAYS.iter().map(|f| or_dash(row.figure(f.theirs), f.text));
        rays.add_row([scene, builder, THEIR_RAYS.to_owned()].into_iter().chain(figures));
    }
    let others = published.file.as_deref().unwrap_or(
        "what Papay 2025 published, of other scenes, on another machine, by costs of a step and a test that it does not give",
    );
    Some(format!("kd-trees; in brackets {others}\n{trees}\n{rays}"))
}

/// Both tables for the page.
pub(crate) fn section(records: &[&Record], schedules: Option<&Chart>, published: &Published) -> Markup {
    let ours = of(records);
    html! {
        p {
            "In the tables of Papay 2025, " i { "Efficient ray tracing algorithms exploiting kd-trees on a GPU" } ", appendix D. Nodes count "
            "leaves that hold nothing, full leaves are the others, and their size is the number of triangles in one. The task pool is the "
            "part of the build that it takes (T_TP); retrievals are tasks and chunks that workers took out of it (N_R), skipped ones steps "
            "that a worker went on with by itself (N_SR). Build and rays is a build and all its rays, one kind after the other (T_F)."
        }
        @if let Some(file) = &published.file {
            p.note { "Below each table, in grey, are the published figures of " code { (file) } ": context, never a result." }
        } @else {
            p.note {
                "Below each table, in grey, is what was published there: context, not to be compared row by row. Its scenes are not ours, "
                "not even those of the same name; what a step and a test cost in its SAH is not in the text that is left; its times are of "
                "another machine (Ryzen 5600, one thread; RTX 4080), its nodes have 16 bytes, its rays are those of its own pictures."
            }
        }
        (trees(&ours, &published.rows))
        @if let Some(chart) = schedules {
            h3 { "Schedules" }
            (document::charts(std::slice::from_ref(chart)))
        }
        @if ours.iter().any(|record| !record.trace.is_empty()) {
            h3 { "Tests and steps" }
            (rays(&ours, &published.rows))
        }
    }
}

fn trees(ours: &[&Record], published: &[Row]) -> Markup {
    let table = columns::Table::new("kd-trees", ours.iter().copied())
        .id("kd-tree-table")
        .cell("scene", |record| {
            html! { th scope="row" data-value=(record.scene) { a href={ "#scene-" (slug(&record.scene)) } { (record.scene) } } }
        })
        .cell("builder", |record| html! { td data-value=(record.builder) { (short(&record.builder)) } })
        .number("triangles", "", |record| Some(record.triangles as f64), count);
    let table = TREE.iter().fold(table, |table, figure| {
        table.number(figure.name, figure.unit, |record| (figure.ours)(record), figure.text)
    });
    table.with_context(published.iter().map(|row| {
        html! {
            th scope="row" { (row.scene) } td { (row.config) }
            (number(row.triangles.map(|n| n as f64), count))
            @for figure in &TREE { (number(row.figure(figure.theirs), figure.text)) }
        }
    }))
}

fn rays(ours: &[&Record], published: &[Row]) -> Markup {
    let rows = ours.iter().flat_map(|record| record.trace.iter().map(|trace| (*record, trace)));
    let table = columns::Table::new("Tests and steps of rays through kd-trees", rows)
        .name("scene", |(record, _)| &record.scene)
        .cell("builder", |(record, _)| html! { td data-value=(record.builder) { (short(&record.builder)) } })
        .text("rays", |(_, trace)| &trace.rays);
    let table = RAYS.iter().fold(table, |table, figure| {
        table.number(figure.name, figure.unit, |(_, trace)| (figure.ours)(trace), figure.text)
    });
    table.with_context(published.iter().map(|row| {
        html! {
            th scope="row" { (row.scene) } td { (row.config) } td { (THEIR_RAYS) }
            @for figure in &RAYS { (number(row.figure(figure.theirs), figure.text)) }
        }
    }))
}
