//! The frame of each page: one file that opens from the disk, with style, script and charts inside.

use super::{Paged, Section};
use crate::experiments::stability::points::Run;
use crate::report::elements::{facts, figure, foot, head, measured_by};
use maud::{DOCTYPE, Markup, html};

/// The whole page; `links` name the pages that lie beside it.
pub(super) fn page<P: Paged>(points: &[P], run: Option<&Run>, sections: &[Section], links: &Markup) -> String {
    let [title, lead] = P::TITLE;
    let markup = html! {
        (DOCTYPE)
        html lang="en" {
            (head(&format!("hedgerow: {}", P::PAGE.name.to_lowercase())))
            body {
                a.skip href="#summary" { "Skip to the results" }
                header.hero {
                    p.kicker { "hedgerow benchmark" }
                    h1 { (title) }
                    p.lead { (lead) }
                    @if let Some(run) = run {
                        (facts(&run.machine, run.device.as_ref(), [&run.commit, &run.when], &run.options))
                        (measured_by(&run.command))
                    }
                }
                nav aria-label="Sections" {
                    a href="#summary" { "Summary" }
                    @for section in sections { a href={ "#" (section.id) } { (section.title) } }
                    a href="#method" { "How it is measured" }
                    (links)
                }
                main {
                    (failures(points, run))
                    section #summary {
                        h2 { "Summary" }
                        @if run.is_none() { p.note { "The run was ended before its end: these are the points up to there." } }
                        @for note in run.map_or(&[][..], |run| &run.notes) { p.note { (note) } }
                        @if points.is_empty() { p { "Nothing was measured." } } @else { (P::summary(points)) }
                    }
                    @for section in sections { (part(section)) }
                    section #method {
                        h2 { "How it is measured" }
                        p { "The same as " a href=(P::PAGE.records) { (P::PAGE.records) } ", where every figure is." }
                        dl.terms { (P::method()) }
                        p { "Figures of different machines do not compare." }
                    }
                }
                @if let Some(run) = run { (foot(&run.commit, &run.when)) }
            }
        }
    };
    markup.into_string()
}

fn part(section: &Section) -> Markup {
    html! {
        section #(section.id) {
            h2 { (section.title) }
            (section.above)
            @if !section.charts.is_empty() {
                div.charts .single[section.charts.len() == 1] { @for chart in &section.charts { (figure(chart)) } }
            }
            (section.below)
            @if !section.more.is_empty() {
                details {
                    summary { "Every kind of ray" }
                    div.charts { @for chart in &section.more { (figure(chart)) } }
                }
            }
        }
    }
}

/// What could not be measured, and what was wrong.
fn failures<P: Paged>(points: &[P], run: Option<&Run>) -> Markup {
    let of_points = P::failures(points);
    let of_run = run.map_or(&[][..], |run| &run.failures);
    if of_points.is_empty() && of_run.is_empty() {
        return html! {};
    }
    html! {
        section.warning #failures {
            h2 { "What went wrong" }
            ul {
                @for failure in of_run { li { b { (failure.of) } ": " (failure.what) } }
                @for failure in &of_points { li { (failure) } }
            }
        }
    }
}
