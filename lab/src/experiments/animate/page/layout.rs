//! `animate.html`: one file that opens from the disk, with style, script and charts inside.

use super::Measured;
use super::standings::{Standing, fastest, standings};
use crate::experiments::animate::Way;
use crate::experiments::animate::points::{Animated, Failure, Setting};
use crate::experiments::bench::kd_trees::published::{self, Row};
use crate::report::chart::Chart;
use crate::report::elements::{column, facts, figure, foot, head, measured_by, number, scroll, spread};
use crate::report::numbers::{bytes, duration, grouped, three_digits};
use maud::{DOCTYPE, Markup, html};

/// The whole page; `links` name the pages that lie beside it.
pub(super) fn page(measured: &Measured, charts: &[Chart], links: &Markup) -> String {
    let (setting, failures) = (measured.setting.as_ref(), &measured.failures);
    let scene = setting.map_or("", |setting| setting.scene.as_str());
    let markup = html! {
        (DOCTYPE)
        html lang="en" {
            (head(&format!("hedgerow: {scene}, frame by frame")))
            body {
                a.skip href="#summary" { "Skip to the results" }
                header.hero {
                    p.kicker { "hedgerow animate" }
                    h1 { (scene) ", frame by frame" }
                    p.lead {
                        "Ways to have something to trace when some of a scene moves: all of it built from scratch, a tree beside the static one, a tree "
                        "of each object, a top level over instances, and objects' trees that are merged into the static one and taken out again."
                    }
                    @if let Some(setting) = setting {
                        (facts(&setting.machine, setting.device.as_ref(), [&setting.commit, &setting.when], &setting.options))
                        (measured_by(&setting.command))
                    }
                }
                nav aria-label="Sections" {
                    a href="#summary" { "Summary" }
                    @if setting.is_some_and(|setting| !setting.pictures.is_empty()) { a href="#pictures" { "Frames" } }
                    a href="#frames" { "Every frame" }
                    a href="#published" { "Published figures" }
                    a href="#method" { "How it is measured" }
                    (links)
                }
                main {
                    @if !failures.is_empty() { (warning(failures)) }
                    (summary(setting, &measured.frames, charts))
                    @if let Some(setting) = setting { (pictures(setting)) }
                    (frames(&measured.frames))
                    (context())
                    (method(setting))
                }
                @if let Some(setting) = setting { (foot(&setting.commit, &setting.when)) }
            }
        }
    };
    markup.into_string()
}

fn warning(failures: &[Failure]) -> Markup {
    html! {
        section.warning #failures {
            h2 { "What went wrong" }
            ul {
                @for Failure { way, frame, what } in failures {
                    li { b { (way.name()) } @if let Some(frame) = frame { ", frame " (frame) } ": " (what) }
                }
            }
        }
    }
}

fn summary(setting: Option<&Setting>, frames: &[Animated], charts: &[Chart]) -> Markup {
    let all = standings(frames);
    html! {
        section #summary {
            h2 { "Summary" }
            @if let Some(setting) = setting { p { (what_moves(setting)) } }
            p { (reading(&all)) }
            @for note in setting.map_or(&[][..], |setting| &setting.notes) { p.note { (note) } }
            div.charts .single[charts.len() == 1] { @for chart in charts { (figure(chart)) } }
            (scroll("The ways", ways(&all)))
        }
    }
}

fn what_moves(setting: &Setting) -> String {
    let moving: u64 = setting.objects.iter().map(|object| object.triangles).sum();
    let morphing = setting.objects.iter().filter(|object| object.morphs).count();
    let objects = match setting.objects.len() {
        1 => "1 object".to_owned(),
        count => format!("{count} objects"),
    };
    let of_them = match morphing {
        0 => "rigid".to_owned(),
        all if all == setting.objects.len() => "changing shape".to_owned(),
        some => format!("{some} of them changing shape"),
    };
    let still = grouped(setting.static_triangles);
    format!("{still} triangles stand still; {} move, in {objects}, {of_them}.", grouped(moving))
}

/// Who is fastest and by how much, in a sentence or two.
fn reading(all: &[Standing]) -> String {
    let Some(best) = fastest(all) else { return "Nothing was measured to its end.".into() };
    let times = |standing: &Standing| format!("{} × {}", three_digits(standing.frame_ms / best.frame_ms), standing.way);
    let others: Vec<String> = all.iter().filter(|other| other.way != best.way).map(times).collect();
    let mut text = format!("A frame takes least by {}: {} in the mean", best.way, duration(best.frame_ms));
    if !others.is_empty() {
        text += &format!("; the others take {} times as long", list(&others));
    }
    if all.iter().any(|standing| standing.timer != all[0].timer) {
        text +=
            ". Some of the builds were timed on the host and some on the device, so that a ratio of theirs says little";
    }
    text + "."
}

fn list(items: &[String]) -> String {
    items.iter().map(|item| item.replacen(" × ", " (", 1) + ")").collect::<Vec<_>>().join(", ")
}

fn ways(all: &[Standing]) -> Markup {
    let kinds: Vec<&String> = all.first().map_or_else(Vec::new, |s| s.trace_ms.iter().map(|(kind, _)| kind).collect());
    let best = fastest(all);
    html! {
        table.sortable #ways {
            caption.hidden { "The ways, means over the frames" }
            thead { tr {
                (column("way", "", false)) (column("builder", "", false)) (column("timed by", "", false)) (column("frames", "", true))
                (column("build", "ms", true))
                @for kind in &kinds { (column(kind, "ms", true)) }
                (column("frame", "ms", true)) (column("over the fastest", "×", true)) (column("SAH cost", "", true))
                (column("memory", "", true))
            } }
            tbody {
                @for standing in all {
                    tr {
                        th scope="row" data-value=(standing.way) { (standing.way.name()) }
                        td data-value=(standing.builder) { (standing.builder) }
                        td data-value=(standing.timer) { (standing.timer) }
                        (number(Some(standing.frames as f64), |v| format!("{v:.0}")))
                        (number(Some(standing.build_ms), three_digits))
                        @for (_, ms) in &standing.trace_ms { (number(Some(*ms), three_digits)) }
                        (number(Some(standing.frame_ms), three_digits))
                        (number(best.map(|best| standing.frame_ms / best.frame_ms), three_digits))
                        (number(standing.sah, three_digits))
                        (number(standing.structure_bytes, |v| bytes(v as u64)))
                    }
                }
            }
        }
    }
}

fn pictures(setting: &Setting) -> Markup {
    html! {
        @if !setting.pictures.is_empty() {
            section #pictures {
                h2 { "Frames" }
                div.pictures {
                    @for (frame, file) in &setting.pictures {
                        figure {
                            img src=(file) alt={ (setting.scene) " in frame " (frame) } loading="lazy";
                            figcaption { "Frame " (frame) }
                        }
                    }
                }
            }
        }
    }
}

fn frames(frames: &[Animated]) -> Markup {
    let most = frames.iter().max_by_key(|frame| frame.trace.len());
    let kinds: Vec<&str> =
        most.map_or_else(Vec::new, |frame| frame.trace.iter().map(|rays| rays.rays.as_str()).collect());
    html! {
        section #frames {
            h2 { "Every frame" }
            details {
                summary { "All figures" }
                p { "Times are medians of the runs, with the least and the greatest. Steps and tests are those of a ray in all trees." }
                (scroll("Every frame", html! {
                    table.sortable {
                        thead { tr {
                            (column("frame", "", true)) (column("way", "", false)) (column("build", "ms", true))
                            @for kind in &kinds {
                                (column(kind, "ms", true)) (column("steps", "a ray", true)) (column("tests", "a ray", true))
                            }
                            (column("frame", "ms", true)) (column("SAH cost", "", true))
                        } }
                        tbody {
                            @for frame in frames {
                                tr {
                                    (number(Some(frame.frame.into()), |v| format!("{v:.0}")))
                                    th scope="row" data-value=(frame.way) { (frame.way.name()) }
                                    (spread(Some(frame.build_ms), three_digits))
                                    @for kind in &kinds {
                                        @let rays = frame.trace.iter().find(|rays| rays.rays == *kind);
                                        (spread(rays.map(|rays| rays.trace_ms), three_digits))
                                        (number(rays.and_then(|rays| rays.steps), three_digits))
                                        (number(rays.and_then(|rays| rays.tests), three_digits))
                                    }
                                    (number(Some(frame.frame_ms()), three_digits))
                                    (number(frame.sah, three_digits))
                                }
                            }
                        }
                    }
                }))
            }
        }
    }
}

/// What the thesis' configurations are called here.
fn way_of(config: &str) -> Option<Way> {
    [("single", Way::Rebuild), ("double", Way::TwoTrees), ("merge", Way::Merge)]
        .into_iter()
        .find_map(|(ending, way)| config.ends_with(ending).then_some(way))
}

/// What Papay 2025 has measured.
fn context() -> Markup {
    let figures = [
        ("build", "ms", "build_dynamic_ms"),
        ("frame", "s", "frame_s"),
        ("speed", "Mrays/s", "mrays_s"),
        ("steps", "a ray", "steps_per_ray"),
        ("tests", "a ray", "tests_per_ray"),
    ];
    let cell = |row: &Row, metric: &str| number(row.figure(metric), three_digits);
    html! {
        section #published {
            h2 { "Published figures" }
            p.note {
                "Papay 2025, " i { "Efficient ray tracing algorithms exploiting kd-trees on a GPU" } ", section 11.3.2: context, not to be "
                "compared row by row. Other scenes, another machine (Ryzen 5600, RTX 4080), and its merging is on the host alone, where "
                "two trees were faster in every scene."
            }
            details {
                summary { "Its dynamic scenes" }
                (scroll("Published figures of dynamic scenes", html! {
                    table.sortable {
                        thead { tr {
                            (column("scene", "", false)) (column("static triangles", "", true)) (column("configuration", "", false)) (column("way", "", false))
                            @for (name, unit, _) in figures { (column(name, unit, true)) }
                        } }
                        tbody.context {
                            @for row in published::papay_dynamic() {
                                tr {
                                    th scope="row" data-value=(row.scene) { (row.scene) }
                                    (number(row.triangles.map(|n| n as f64), |v| grouped(v as u64)))
                                    td data-value=(row.config) { (row.config) }
                                    td { (way_of(&row.config).map_or("–", Way::name)) }
                                    @for (_, _, metric) in figures { (cell(&row, metric)) }
                                }
                            }
                        }
                    }
                }))
            }
        }
    }
}

fn method(setting: Option<&Setting>) -> Markup {
    html! {
        section #method {
            h2 { "How it is measured" }
            p { "The same as " a href="animate.jsonl" { "animate.jsonl" } ", where every figure is." }
            dl.terms {
                dt { "rebuild" }
                dd { "One kd-tree over all triangles, built from scratch in every frame." }
                dt { "two-trees" }
                dd { "A kd-tree of what stands still, built once, and one over all that moves. A ray goes through both, through the second no farther than it has hit in the first." }
                dt { "tree-per-object" }
                dd { "The same with a tree of each object." }
                dt { "two-level" }
                dd { "A bottom level of what stands still and of each object, and a top level built in every frame; bottom levels of what changes its shape are built from scratch, too. Always on the device." }
                dt { "merge" }
                dd { "Objects are merged into the kd-tree of what stands still, and taken out again before the next frame: both are in its time. On the device the leaves that objects are in are built from scratch; on the host the kd-tree of each object is built and merged." }
                dt { "Static trees" }
                dd {
                    "Built once, before the clock runs"
                    @if let Some(setting) = setting { ", by " code { (setting.static_builder) } }
                    "."
                }
                dt { "Times" }
                dd { "By the device's timestamps what is built or traced there, otherwise by the wall's clock. Ways run in turn in each frame, A B A B; vertices are placed and uploaded before the clock runs, and so are trees of the host that the device traces." }
                dt { "Rays" }
                dd { "The same for all ways; their hits are compared ray by ray with those of the first way: bit for bit between kd-trees, within rounding where rays are brought into an instance's space." }
                dt { "SAH cost" }
                dd { "Expected work of a random ray: (3 · Σ area of inner nodes + 2 · Σ area × triangles of leaves) / area of the root. Only where rays go through one tree." }
            }
            p { "Figures of different machines do not compare." }
        }
    }
}
