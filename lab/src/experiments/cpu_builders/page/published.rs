//! Our figures beside those of Frantál 2019, which stand in brackets.

use super::scenes::named;
use super::with_base;
use crate::experiments::cpu_builders::choice::BASE;
use crate::experiments::cpu_builders::frantal::tables::{Comparable, Line, TABLES};
use crate::experiments::cpu_builders::frantal::{
    COUNTERPARTS, Counterpart, DRAGON_TRIANGLES, Group, MACHINE, SOURCE, dragon, mean, parallel_binning,
};
use crate::experiments::cpu_builders::measured::{Measured, OnScene};
use crate::measure::geometric_mean;
use crate::report::columns::Table;
use crate::report::elements::number;
use crate::report::names::distinct;
use crate::report::numbers::{one_decimal, three_digits, two_decimals};
use crate::subjects::retraced::TreeTracer;
use maud::{Markup, html};

/// A figure of ours with the published one in brackets; a dash where ours was not measured.
fn with_published(ours: Option<f64>, theirs: Option<f64>, text: fn(f64) -> String) -> Markup {
    match ours.filter(|value| value.is_finite()) {
        None => match theirs {
            None => number(None, text),
            Some(theirs) => html! { td.number.none data-value="" { "– " small { "(" (text(theirs)) ")" } } },
        },
        Some(ours) => html! {
            td.number data-value=(ours) { (text(ours)) @if let Some(theirs) = theirs { small { "(" (text(theirs)) ")" } } }
        },
    }
}

/// A ratio, with two digits behind the point: those of the thesis have no more.
fn ratio(value: f64) -> String {
    two_decimals(value)
}

pub(super) fn section(scenes: &[OnScene<'_>]) -> Markup {
    let dragons: Vec<&OnScene<'_>> = scenes.iter().filter(|scene| scene.triangles == DRAGON_TRIANGLES).collect();
    html! {
        p {
            "What " (SOURCE) " gives, in brackets: context, never a result. It was measured on a " (MACHINE) ". There, as here, a step costs 3 "
            "and a test 2, and subtrees become leaves where that is cheaper."
        }
        h3 { "The dragon" }
        @if dragons.is_empty() {
            p { "No scene of 871 414 triangles was measured. Of other meshes only ratios compare." }
        }
        @for scene in dragons { (of_dragon(scene)) }
        @for group in Group::ALL { (ratios(group, scenes)) }
        h3 { "Parallel binning (table 24)" }
        (parallel(scenes))
        h3 { "Table by table" }
        (lines(scenes))
    }
}

/// The builders of a scene that have a counterpart, in the order of counterparts.
fn counterparts<'s, 'r>(scene: &'s OnScene<'r>) -> Vec<(&'static Counterpart, &'s Measured<'r>)> {
    COUNTERPARTS.iter().filter_map(|counterpart| Some((counterpart, scene.of(counterpart.builder)?))).collect()
}

fn of_dragon(scene: &OnScene<'_>) -> Markup {
    let rows = counterparts(scene);
    let table = Table::new("The dragon's trees beside tables 9, 10, 17 to 19, 38, 39, 42 and 45", &rows)
        .cell("builder", |(_, measured)| named(&measured.builder))
        .text("there", |(counterpart, _)| counterpart.method)
        .figure("SAH", "", |(c, m)| with_published(m.quality().and_then(|q| q.sah), dragon(c.method).sah, one_decimal))
        .number("SAH", "over theirs", |(c, m)| Some(m.quality()?.sah? / dragon(c.method).sah?), |v| format!("{v:.3}"))
        .figure("Σ inner", "", |(c, m)| {
            with_published(m.quality().and_then(|q| q.sah_inner), dragon(c.method).inner, one_decimal)
        })
        .figure("Σ leaf", "", |(c, m)| {
            with_published(m.quality().and_then(|q| q.sah_leaf), dragon(c.method).leaf, one_decimal)
        })
        .figure("references", "a leaf", |(c, m)| {
            with_published(m.quality().and_then(|q| q.prims_per_leaf), dragon(c.method).refs, one_decimal)
        })
        .text("differs", |(counterpart, _)| counterpart.differs);
    html! {
        p {
            b { (scene.scene) } " is the same mesh: absolute figures compare. Tables 9, 10, 17 to 19; +IBO 38 and 39; +EMC 42 and 45, where "
            "SAH is 3 · Σ inner + 2 · Σ leaf."
        }
        (table.html())
    }
}

/// A figure that is compared as a ratio: its heading, its unit, its name in the file of means, and itself.
type Compared = (&'static str, &'static str, &'static str, fn(&Measured<'_>) -> Option<f64>);

/// Time a ray of our host's tracer.
fn ray_time(measured: &Measured<'_>, kind: &str) -> Option<f64> {
    Some(1.0 / measured.rays(TreeTracer::Host, kind)?.mrays_s)
}

const COMPARED: [Compared; 9] = [
    ("SAH", "", "sah", |m| m.quality()?.sah),
    ("Σ inner", "", "inner", |m| m.quality()?.sah_inner),
    ("Σ leaf", "", "leaf", |m| m.quality()?.sah_leaf),
    ("build", "one thread", "build", |m| m.one_thread_ms()),
    ("time", "primary", "primary_time", |m| ray_time(m, "primary")),
    ("steps", "primary", "primary_steps", |m| m.rays(TreeTracer::Host, "primary")?.steps),
    ("tests", "primary", "primary_tests", |m| m.rays(TreeTracer::Host, "primary")?.tests),
    ("time", "primary, shadow", "primary_shadow_time", |m| {
        let [primary, shadow] = ["primary", "shadow"].map(|kind| m.rays(TreeTracer::Host, kind));
        Some([primary?, shadow?].iter().map(|trace| trace.count as f64 / trace.mrays_s).sum())
    }),
    ("time", "random", "random_time", |m| ray_time(m, "random")),
];

/// Geometric means over the scenes of a group that have both the builder and the base.
fn ratios(group: Group, scenes: &[OnScene<'_>]) -> Markup {
    let own: Vec<(&OnScene<'_>, &Measured<'_>)> =
        with_base(scenes).filter(|(s, _)| Group::of(s.scene) == group).collect();
    let names = own.iter().map(|(scene, _)| scene.scene).collect::<Vec<_>>();
    let is_measured =
        |c: &&Counterpart| c.builder != BASE && own.iter().any(|(scene, _)| scene.of(c.builder).is_some());
    let rows: Vec<&Counterpart> = COUNTERPARTS.iter().filter(is_measured).collect();
    if group == Group::Others && rows.is_empty() {
        return html! {};
    }
    let mut table = Table::new(format!("{} over {BASE}", group.name()), &rows)
        .cell("builder", |counterpart| named(counterpart.builder))
        .text("there", |counterpart| counterpart.method);
    let own = &own;
    for (heading, unit, metric, of) in COMPARED {
        table = table.figure(heading, unit, move |counterpart| {
            let ratios = own.iter().filter_map(|(scene, base)| Some(of(scene.of(counterpart.builder)?)? / of(base)?));
            with_published(geometric_mean(ratios), mean(group, metric, counterpart.method).map(|mean| mean.mean), ratio)
        });
    }
    html! {
        h3 { (group.name()) ", over " (BASE) }
        @match group {
            Group::Others => p { "Geometric means over " (names.join(", ")) ". The thesis has no such scenes." },
            _ if names.is_empty() => p { "None of these scenes was measured: " (group.scenes().join(", ")) "." },
            _ => p {
                "Geometric means over " (names.join(", ")) ". In brackets, over the "
                @if group == Group::Objects { "8 objects" } @else { "12 architectural scenes" }
                " of the thesis. Its scenes are others, and its sweep sorts in every node, so that its builds are less of it."
            },
        }
        @if !rows.is_empty() { (table.html()) }
    }
}

/// The table of parallel binning.
const PARALLEL_BINNING: u32 = 24;

/// Whether binning was built by one thread and by all.
fn is_parallel_binning(measured: &Measured<'_>) -> bool {
    measured.family() == "binned" && measured.one_thread_ms().is_some() && measured.build_ms().is_some()
}

/// Binning by all threads over one, beside table 24.
fn parallel(scenes: &[OnScene<'_>]) -> Markup {
    let binned = scenes.iter().flat_map(|scene| scene.builders.iter().map(move |m| (scene.scene, m)));
    let rows: Vec<(&str, &Measured<'_>)> = binned.filter(|(_, measured)| is_parallel_binning(measured)).collect();
    let published = parallel_binning();
    let percent = || published.iter().map(|(_, [percent, ..])| *percent);
    let is_same = |m: &Measured<'_>| {
        let [one, all] =
            [m.one_thread()?, m.own()?].map(|r| (r.quality.sah, r.quality.refs, r.quality.inner, r.quality.depth_max));
        Some(one == all)
    };
    let table = Table::new("Binning by all threads over one, beside table 24", &rows)
        .cell("builder", |(_, measured)| named(&measured.builder))
        .text("scene", |(scene, _)| *scene)
        .number("one thread", "ms", |(_, m)| m.one_thread_ms(), three_digits)
        .number("all threads", "ms", |(_, m)| m.build_ms(), three_digits)
        .number("all over one", "%", |(_, m)| Some(100.0 * m.build_ms()? / m.one_thread_ms()?), one_decimal)
        .number("CPU time", "ms, all threads", |(_, m)| m.own()?.build.cpu_median_ms, three_digits)
        .text("same tree", move |(_, m)| match is_same(m) {
            Some(true) => "yes",
            Some(false) => "NO",
            None => "–",
        })
        .with_context(published.iter().map(|(scene, [percent, real, user])| {
            html! {
                th scope="row" { "(BIN)" } td { (scene) }
                (number(Some(1e3 * real / (percent / 100.0)), three_digits)) (number(Some(1e3 * real), three_digits))
                (number(Some(*percent), one_decimal)) (number(Some(1e3 * user), three_digits)) td { "yes" }
            }
        }));
    let share = geometric_mean(rows.iter().filter_map(|(_, m)| Some(m.build_ms()? / m.one_thread_ms()?)));
    let (least, most) = (percent().fold(f64::INFINITY, f64::min), percent().fold(0.0, f64::max));
    html! {
        @match share {
            Some(share) => p {
                "All threads take " (one_decimal(100.0 * share)) "% of the time of one, in the geometric mean over " (rows.len())
                " builds (" (one_decimal(least)) "% to " (one_decimal(most)) "% there, with 4 threads on 2 cores)."
            },
            None => p {
                "Nothing to compare: binned was not built on one thread and on all. In the thesis all threads take " (one_decimal(least))
                "% to " (one_decimal(most)) "% of the time of one, with 4 threads on 2 cores."
            },
        }
        details {
            summary { "Builds by one thread and by all, and table 24 in grey" }
            p { "There, the time of one thread follows from the time of all and its share." }
            (table)
        }
    }
}

/// One line for each table of the thesis.
fn lines(scenes: &[OnScene<'_>]) -> Markup {
    let has_dragon = scenes.iter().any(|scene| scene.triangles == DRAGON_TRIANGLES);
    let groups = distinct(scenes.iter().map(|scene| Group::of(scene.scene)));
    let has_ratios = groups.iter().any(|group| *group != Group::Others);
    let has_threads = scenes.iter().flat_map(|scene| &scene.builders).any(is_parallel_binning);
    let in_this_run = move |line: &Line| match line.compares {
        _ if line.table == PARALLEL_BINNING && has_threads => "yes",
        Comparable::No => "–",
        Comparable::Absolute if has_dragon => "yes",
        Comparable::Absolute | Comparable::Ratios if has_ratios => "as ratios",
        _ => "its scenes were not measured",
    };
    Table::new("The tables of Frantál 2019", TABLES.iter())
        .name("table", |line| line.table)
        .text("holds", |line| line.holds)
        .text("compares as", |line| line.compares.name())
        .text("in this run", move |line| in_this_run(line))
        // Sentences: they may take several lines.
        .cell("how, or why not", |line| html! { td style="white-space:normal;min-width:22rem" { (line.here) } })
        .html()
}
