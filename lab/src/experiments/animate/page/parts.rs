//! The parts of `animate.html`.

use super::standings::{Standing, fastest, standings};
use crate::experiments::animate::AnimationMethod;
use crate::experiments::animate::points::{Animated, SceneSetting};
use crate::experiments::bench::kd_trees::published;
use crate::report::numbers::{count, duration, grouped, size, three_digits, whole};
use crate::report::{Chart, Table, document};
use maud::{Markup, html};

pub(super) fn summary(setting: Option<&SceneSetting>, frames: &[Animated], charts: &[Chart]) -> Markup {
    let all = standings(frames);
    html! {
        @if let Some(setting) = setting { p { (what_moves(setting)) } }
        p { (reading(&all)) }
        @for note in setting.map_or(&[][..], |setting| &setting.setting.notes) { p.note { (note) } }
        (document::charts(charts))
        (ways(&all))
    }
}

fn what_moves(setting: &SceneSetting) -> String {
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

/// Which way is fastest, and by how much, in a sentence or two.
fn reading(all: &[Standing]) -> String {
    let Some(best) = fastest(all) else { return "Nothing was measured to its end.".into() };
    let times = |standing: &Standing| format!("{} ({})", three_digits(standing.frame_ms / best.frame_ms), standing.way);
    let others: Vec<String> = all.iter().filter(|other| other.way != best.way).map(times).collect();
    let mut text = format!("A frame takes least by {}: {} in the mean", best.way, duration(best.frame_ms));
    if !others.is_empty() {
        text += &format!("; the others take {} times as long", others.join(", "));
    }
    if all.iter().any(|standing| standing.timer != all[0].timer) {
        text +=
            ". Some of the builds were timed on the host and some on the device, so that a ratio of theirs says little";
    }
    text + "."
}

fn ways(all: &[Standing]) -> Markup {
    let best = fastest(all).map_or(f64::NAN, |best| best.frame_ms);
    let table = Table::new("The ways, means over the frames", all)
        .id("ways")
        .name("way", |standing| standing.way)
        .text("builder", |standing| &standing.builder)
        .text("timed by", |standing| &standing.timer)
        .number("frames", "", |standing| Some(standing.frames as f64), whole)
        .number("build", "ms", |standing| Some(standing.build_ms), three_digits);
    let kinds = all.first().map_or(&[][..], |standing| &standing.trace_ms);
    let table = kinds.iter().enumerate().fold(table, |table, (i, (kind, _))| {
        table.number(kind, "ms", move |standing| Some(standing.trace_ms.get(i)?.1), three_digits)
    });
    table
        .number("frame", "ms", |standing| Some(standing.frame_ms), three_digits)
        .number("over the fastest", "×", move |standing| Some(standing.frame_ms / best), three_digits)
        .number("SAH cost", "", |standing| standing.sah, three_digits)
        .number("memory", "", |standing| standing.structure_bytes, size)
        .html()
}

pub(super) fn pictures(setting: &SceneSetting) -> Markup {
    html! {
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

pub(super) fn every_frame(frames: &[Animated]) -> Markup {
    let most = frames.iter().max_by_key(|frame| frame.trace.len());
    let kinds = most.into_iter().flat_map(|frame| frame.trace.iter().map(|rays| rays.rays.as_str()));
    let mut all = Table::new("Every frame", frames)
        .number("frame", "", |frame| Some(frame.frame.into()), whole)
        .name("way", |frame| frame.way)
        .spread("build", "ms", |frame| Some(frame.build_ms), three_digits);
    for kind in kinds {
        let of = move |frame: &Animated| frame.trace.iter().find(|rays| rays.rays == kind).cloned();
        all = all
            .spread(kind, "ms", move |frame| Some(of(frame)?.trace_ms), three_digits)
            .number("steps", "a ray", move |frame| of(frame)?.steps, three_digits)
            .number("tests", "a ray", move |frame| of(frame)?.tests, three_digits);
    }
    all = all.number("frame", "ms", |frame| Some(frame.frame_ms()), three_digits);
    all = all.number("SAH cost", "", |frame| frame.sah, three_digits);
    html! {
        details {
            summary { "All figures" }
            p { "Times are medians of the runs, with the least and the greatest. Steps and tests are those of a ray in all trees." }
            (all.html())
        }
    }
}

/// What the thesis' configurations are called here.
fn way_of(config: &str) -> Option<AnimationMethod> {
    [("single", AnimationMethod::Rebuild), ("double", AnimationMethod::TwoTrees), ("merge", AnimationMethod::Merge)]
        .into_iter()
        .find_map(|(ending, way)| config.ends_with(ending).then_some(way))
}

/// What Papay 2025 has measured.
pub(super) fn published() -> Markup {
    let table = Table::new("Published figures of dynamic scenes", published::papay_dynamic())
        .name("scene", |row| row.scene.clone())
        .number("static triangles", "", |row| row.triangles.map(|n| n as f64), count)
        .text("configuration", |row| row.config.clone())
        .text("way", |row| way_of(&row.config).map_or("–", AnimationMethod::name))
        .number("build", "ms", |row| row.figure("build_dynamic_ms"), three_digits)
        .number("frame", "s", |row| row.figure("frame_s"), three_digits)
        .number("speed", "Mrays/s", |row| row.figure("mrays_s"), three_digits)
        .number("steps", "a ray", |row| row.figure("steps_per_ray"), three_digits)
        .number("tests", "a ray", |row| row.figure("tests_per_ray"), three_digits);
    html! {
        p.note {
            "Papay 2025, " i { "Efficient ray tracing algorithms exploiting kd-trees on a GPU" } ", section 11.3.2: context, not to be "
            "compared row by row. Other scenes, another machine (Ryzen 5600, RTX 4080), and its merging is on the host alone, where "
            "two trees were faster in every scene."
        }
        details {
            summary { "Its dynamic scenes" }
            (table.html())
        }
    }
}

pub(super) fn terms(setting: Option<&SceneSetting>) -> Markup {
    html! {
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
}
