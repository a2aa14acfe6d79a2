//! kd-trees in the tables of Papay 2025, appendix D: trees with their nodes, leaves, depth, cost, time and memory, and the tests and
//! steps of rays. What the thesis has measured itself stands below as context.

pub mod published;

use crate::measure::record::{Record, Trace};
use crate::report::elements::{column, number, scroll};
use crate::report::names::{short, slug};
use crate::report::numbers::{grouped, three_digits};
use crate::report::table::STYLE;
use crate::subjects::KD_TREE;
use comfy_table::{CellAlignment, Table};
use maud::{Markup, html};
use published::{Published, Row};

/// A figure of a tree: its name and unit, in a record, in a file of published figures, and as text.
struct Figure {
    name: &'static str,
    unit: &'static str,
    ours: fn(&Record) -> Option<f64>,
    theirs: &'static str,
    text: fn(f64) -> String,
}

fn count(value: f64) -> String {
    grouped(value as u64)
}

fn two_decimals(value: f64) -> String {
    format!("{value:.2}")
}

fn ratio(a: Option<u64>, b: Option<u64>) -> Option<f64> {
    a.zip(b.filter(|&b| b > 0)).map(|(a, b)| a as f64 / b as f64)
}

const TREE: [Figure; 9] = [
    Figure {
        name: "nodes",
        unit: "",
        ours: |r| r.quality.inner.zip(r.quality.leaves).map(|(inner, leaves)| (inner + leaves) as f64),
        theirs: "nodes",
        text: count,
    },
    Figure {
        name: "inner / leaves",
        unit: "",
        ours: |r| ratio(r.quality.inner, r.quality.leaves),
        theirs: "inner_to_leaf",
        text: two_decimals,
    },
    Figure {
        name: "full / empty",
        unit: "",
        ours: |r| {
            let full = r.quality.leaves.zip(r.quality.empty_leaves).map(|(all, empty)| all - empty);
            ratio(full, r.quality.empty_leaves)
        },
        theirs: "nonempty_to_empty_leaf",
        text: two_decimals,
    },
    Figure {
        name: "leaf size",
        unit: "mean",
        ours: |r| r.quality.prims_per_leaf,
        theirs: "avg_prims_leaf",
        text: two_decimals,
    },
    Figure {
        name: "leaf size",
        unit: "most",
        ours: |r| r.quality.prims_per_leaf_max.map(|most| most as f64),
        theirs: "max_prims_leaf",
        text: count,
    },
    Figure {
        name: "depth",
        unit: "mean",
        ours: |r| r.quality.depth_avg,
        theirs: "avg_depth",
        text: |v| format!("{v:.1}"),
    },
    Figure { name: "cost", unit: "", ours: |r| r.quality.sah, theirs: "cost", text: two_decimals },
    Figure {
        name: "build",
        unit: "ms",
        ours: |r| Some(r.build.median_ms),
        theirs: "build_dynamic_ms",
        text: three_digits,
    },
    Figure {
        name: "memory",
        unit: "MB",
        ours: |r| r.memory.structure_bytes.map(|bytes| bytes as f64 * 1e-6),
        theirs: "memory_mb",
        text: three_digits,
    },
];

/// A figure of rays, likewise.
struct RayFigure {
    name: &'static str,
    unit: &'static str,
    ours: fn(&Trace) -> Option<f64>,
    theirs: &'static str,
}

const RAYS: [RayFigure; 3] = [
    RayFigure { name: "tests", unit: "a ray", ours: |t| t.tests, theirs: "tests_per_ray" },
    RayFigure { name: "steps", unit: "a ray", ours: |t| t.steps, theirs: "steps_per_ray" },
    RayFigure { name: "speed", unit: "Mrays/s", ours: |t| Some(t.mrays_s), theirs: "mrays_s" },
];

/// What the thesis' rays are called where kinds are.
const THEIR_RAYS: &str = "its own";

/// The records of kd-trees.
pub fn of<'a>(records: &[&'a Record]) -> Vec<&'a Record> {
    records.iter().copied().filter(|record| record.kind == KD_TREE).collect()
}

fn name(name: &str, unit: &str) -> String {
    if unit.is_empty() { name.to_owned() } else { format!("{name}, {unit}") }
}

/// Both tables for the terminal, measured figures above published ones; nothing without a kd-tree.
pub fn text(records: &[&Record], published: &Published) -> Option<String> {
    let ours = of(records);
    if ours.is_empty() {
        return None;
    }
    let dash = |figure: Option<f64>, text: fn(f64) -> String| figure.map_or("–".into(), text);
    let mut trees = with_header(3, TREE.iter().map(|f| name(f.name, f.unit)), &["scene", "triangles", "builder"]);
    for record in &ours {
        let figures = TREE.iter().map(|f| dash((f.ours)(record), f.text));
        let head = [record.scene.clone(), grouped(record.triangles), short(&record.builder)];
        trees.add_row(head.into_iter().chain(figures));
    }
    for row in &published.rows {
        let figures = TREE.iter().map(|f| dash(row.figure(f.theirs), f.text));
        let triangles = row.triangles.map_or("–".into(), grouped);
        trees.add_row([format!("({})", row.scene), triangles, row.config.clone()].into_iter().chain(figures));
    }
    let mut rays = with_header(3, RAYS.iter().map(|f| name(f.name, f.unit)), &["scene", "builder", "rays"]);
    for (record, trace) in ours.iter().flat_map(|record| record.trace.iter().map(move |trace| (record, trace))) {
        let figures = RAYS.iter().map(|f| dash((f.ours)(trace), three_digits));
        rays.add_row([record.scene.clone(), short(&record.builder), trace.rays.clone()].into_iter().chain(figures));
    }
    for row in &published.rows {
        let figures = RAYS.iter().map(|f| dash(row.figure(f.theirs), three_digits));
        rays.add_row([format!("({})", row.scene), row.config.clone(), THEIR_RAYS.into()].into_iter().chain(figures));
    }
    let others = published.file.as_deref().unwrap_or(
        "what Papay 2025 published, of other scenes, on another machine, by costs of a step and a test that it does not tell",
    );
    Some(format!("kd-trees; in brackets {others}\n{trees}\n{rays}"))
}

fn with_header(numbers: usize, figures: impl Iterator<Item = String>, names: &[&str]) -> Table {
    let mut table = Table::new();
    table.load_style(STYLE);
    table.set_header(names.iter().map(|&name| name.to_owned()).chain(figures));
    for column in table.column_iter_mut().skip(numbers) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

/// Both tables for the page; nothing without a kd-tree.
pub(crate) fn section(records: &[&Record], published: &Published) -> Markup {
    let ours = of(records);
    if ours.is_empty() {
        return html! {};
    }
    html! {
        section #kd-trees {
            h2 { "kd-trees" }
            p {
                "In the tables of Papay 2025, " i { "Efficient ray tracing algorithms exploiting kd-trees on a GPU" } ", appendix D. Nodes count "
                "leaves that hold nothing, full leaves are the others, and their size is the number of triangles in one."
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
            (scroll("kd-trees", trees(&ours, &published.rows)))
            @if ours.iter().any(|record| !record.trace.is_empty()) {
                h3 { "Tests and steps" }
                (scroll("Tests and steps of rays through kd-trees", rays(&ours, &published.rows)))
            }
        }
    }
}

fn trees(ours: &[&Record], published: &[Row]) -> Markup {
    html! {
        table.sortable #kd-tree-table {
            caption.hidden { "kd-trees" }
            thead { tr {
                (column("scene", "", false)) (column("builder", "", false)) (column("triangles", "", true))
                @for figure in &TREE { (column(figure.name, figure.unit, true)) }
            } }
            tbody {
                @for record in ours {
                    tr {
                        th scope="row" data-value=(record.scene) { a href={ "#scene-" (slug(&record.scene)) } { (record.scene) } }
                        td data-value=(record.builder) { (short(&record.builder)) }
                        (number(Some(record.triangles as f64), count))
                        @for figure in &TREE { (number((figure.ours)(record), figure.text)) }
                    }
                }
            }
            tbody.context {
                @for row in published {
                    tr {
                        th scope="row" { (row.scene) } td { (row.config) }
                        (number(row.triangles.map(|n| n as f64), count))
                        @for figure in &TREE { (number(row.figure(figure.theirs), figure.text)) }
                    }
                }
            }
        }
    }
}

fn rays(ours: &[&Record], published: &[Row]) -> Markup {
    html! {
        table.sortable {
            caption.hidden { "Tests and steps of rays through kd-trees" }
            thead { tr {
                (column("scene", "", false)) (column("builder", "", false)) (column("rays", "", false))
                @for figure in &RAYS { (column(figure.name, figure.unit, true)) }
            } }
            tbody {
                @for record in ours {
                    @for trace in &record.trace {
                        tr {
                            th scope="row" data-value=(record.scene) { (record.scene) }
                            td data-value=(record.builder) { (short(&record.builder)) }
                            td data-value=(trace.rays) { (trace.rays) }
                            @for figure in &RAYS { (number((figure.ours)(trace), three_digits)) }
                        }
                    }
                }
            }
            tbody.context {
                @for row in published {
                    tr {
                        th scope="row" { (row.scene) } td { (row.config) } td { (THEIR_RAYS) }
                        @for figure in &RAYS { (number(row.figure(figure.theirs), three_digits)) }
                    }
                }
            }
        }
    }
}
