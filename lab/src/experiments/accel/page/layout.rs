//! `accel.html`: one file that opens from the disk, with style, script and charts inside.

use super::goals::Goal;
use super::{Measured, Section};
use crate::experiments::accel::points::{Failure, Setting};
use crate::report::elements::{column, facts, figure, foot, head, measured_by, number, scroll, spread};
use crate::report::numbers::three_digits;
use maud::{DOCTYPE, Markup, html};

/// The whole page; `links` name the pages that lie beside it.
pub(super) fn page(measured: &Measured, goals: &[Goal], sections: &[Section], links: &Markup) -> String {
    let (setting, failures) = (measured.setting.as_ref(), &measured.failures);
    let markup = html! {
        (DOCTYPE)
        html lang="en" {
            (head("hedgerow: batches, top levels, re-braiding, updates"))
            body {
                a.skip href="#summary" { "Skip to the results" }
                header.hero {
                    p.kicker { "hedgerow benchmark" }
                    h1 { "Structures as engines use them" }
                    p.lead {
                        "Batches of small builds, top levels of many instances, re-braiding, and updates, through the calls of "
                        "VK_KHR_acceleration_structure: ours in compute shaders, and the driver's by the same calls, in turn in one process."
                    }
                    @if let Some(setting) = setting {
                        (facts(&setting.machine, Some(&setting.device), [&setting.commit, &setting.when], &setting.options))
                        (measured_by(&setting.command))
                    }
                }
                nav aria-label="Sections" {
                    a href="#summary" { "Summary" }
                    @for section in sections { a href={ "#" (section.id) } { (section.title) } }
                    a href="#method" { "How it is measured" }
                    (links)
                }
                main {
                    @if !failures.is_empty() { (warning(failures)) }
                    (summary(setting, goals))
                    @for section in sections {
                        section #(section.id) {
                            h2 { (section.title) }
                            (section.above)
                            div.charts .single[section.charts.len() == 1] { @for chart in &section.charts { (figure(chart)) } }
                            (section.below)
                        }
                    }
                    (method())
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
            ul { @for failure in failures { li { b { (failure.of) } ": " (failure.what) } } }
        }
    }
}

/// What was to be reached, and whether it is.
fn summary(setting: Option<&Setting>, goals: &[Goal]) -> Markup {
    let (met, all) = (goals.iter().filter(|goal| goal.is_met()).count(), goals.len());
    html! {
        section #summary {
            h2 { "Summary" }
            @if goals.is_empty() { p { "Nothing that has a goal was measured." } } @else {
                p {
                    "Goals met: " (met) " of " (all) ". Ratios of times, in the median of the runs and from the least to the greatest: above 1, "
                    "the first is faster. Those over all kinds of rays are geometric means, from the kind that gains least to that which gains "
                    "most."
                }
            }
            @for note in setting.map_or(&[][..], |setting| &setting.notes) { p.note { (note) } }
            @if !goals.is_empty() {
                (scroll("Goals", html! {
                    table.sortable #goals {
                        caption.hidden { "Goals" }
                        thead { tr {
                            (column("what", "", false)) (column("is", "×", true)) (column("shall be at least", "×", true)) (column("verdict", "", false))
                        } }
                        tbody {
                            @for goal in goals {
                                tr {
                                    th scope="row" data-value=(goal.what) { (goal.what) }
                                    (spread(Some(goal.ratio), three_digits))
                                    (number(Some(goal.least), three_digits))
                                    td .met[goal.is_met()] .wrong[!goal.is_met()] data-value=(goal.verdict()) { (goal.verdict()) }
                                }
                            }
                        }
                    }
                }))
            }
        }
    }
}

fn method() -> Markup {
    html! {
        section #method {
            h2 { "How it is measured" }
            p { "The same as " a href="accel.jsonl" { "accel.jsonl" } ", where every figure is." }
            dl.terms {
                dt { "In turn" }
                dd {
                    "Everything that is compared runs in turn in one process, A B A B, after a warm-up that does not count. Ratios are taken run "
                    "by run, so that what slows down a run slows both."
                }
                dt { "Times" }
                dd {
                    "Of batches by the wall's clock, from before the recording of the commands to behind the wait for them. Each submit has a command "
                    "pool and a fence of its own; what that takes stands beside them as empty submits. All others by the device's timestamps."
                }
                dt { "The driver" }
                dd {
                    "Its own structures, built by the same structs with the same flags, and traced by ray queries in the same shader as ours."
                }
                dt { "Rays" }
                dd {
                    b { "primary" } " through the camera's pixels; from what they hit: " b { "shadow" } " to the lights, " b { "ao" }
                    " four short rays around the normal, " b { "diffuse1" } " one cosine-weighted bounce and " b { "diffuse2" } " the next, "
                    b { "reflection" } " the mirror direction; " b { "random" } " between points of the sphere around the scene."
                }
                dt { "SAH cost" }
                dd { "Expected work of a random ray: (3 · Σ area of inner nodes + 2 · Σ area × triangles of leaves) / area of the root." }
            }
            p { "Figures of different machines do not compare." }
        }
    }
}
