//! What the pages of the report are made of.

use super::chart::Chart;
use super::numbers::{bytes, three_digits};
use super::theme::{self, Tone};
use crate::measure::setting::Setting;
use maud::{DOCTYPE, Markup, PreEscaped, html};

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// The head of a page, with style inside.
fn head(title: &str) -> Markup {
    html! {
        head {
            meta charset="utf-8";
            meta name="viewport" content="width=device-width, initial-scale=1";
            meta name="color-scheme" content="light dark";
            title { (title) }
            link rel="icon" href="data:,";
            style { (PreEscaped(colours())) (PreEscaped(STYLE)) }
        }
    }
}

/// A page with this in its body.
pub fn page(title: &str, body: &Markup) -> String {
    let markup = html! {
        (DOCTYPE)
        html lang="en" { (head(title)) body { (body) } }
    };
    markup.into_string()
}

/// The end of a page: who made it, and the script.
pub fn foot(commit: &str, when: &str) -> Markup {
    html! {
        footer { p { "Made by hedgerow " (env!("CARGO_PKG_VERSION")) ", commit " code { (commit) } ", " (when) "." } }
        script { (PreEscaped(SCRIPT)) }
    }
}

/// The theme as CSS variables: light, and dark where the reader's system asks for it.
fn colours() -> String {
    let variables =
        |of: fn(&Tone) -> String| theme::all().map(|t| format!("--{}:{};", t.variable, of(&t))).collect::<String>();
    let light = variables(|t| theme::hex(t.light));
    let dark = variables(|t| theme::hex(t.dark));
    format!(":root{{{light}}}\n@media (prefers-color-scheme:dark){{:root{{{dark}}}}}\n")
}

/// Where and how it was measured, with the command line that measures it again.
pub fn facts(setting: &Setting) -> Markup {
    let Setting { machine, device, commit, when, command, options, .. } = setting;
    html! {
        dl.facts {
            div { dt { "Processor" } dd { (machine.cpu) span { (machine.cores) " cores, " (machine.system) } } }
            @if let Some(memory) = machine.memory { div { dt { "Memory" } dd { (bytes(memory)) } } }
            @if let Some(device) = device {
                div { dt { "Device" } dd { (device.name) span { (device.kind) ", subgroups of " (device.subgroup) ", " (bytes(device.memory)) } } }
                div { dt { "Driver" } dd { (device.driver) span { "Vulkan " (device.vulkan) } } }
                @if let Some(rate) = device.copy_gb_s {
                    div { dt { "Plain copy" } dd { (three_digits(rate)) " GB/s" span { "read and written, measured" } } }
                }
            }
            div { dt { "Commit" } dd { code { (commit) } span { (when) } } }
            @for (name, value) in options { div { dt { (name) } dd { (value) } } }
        }
        p.command { span { "Measured by" } code { (command) } }
    }
}

/// A cell with a figure; a dash where it was not measured.
pub fn number(value: Option<f64>, text: impl Fn(f64) -> String) -> Markup {
    match value.filter(|v| v.is_finite()) {
        Some(value) => html! { td.number data-value=(value) { (text(value)) } },
        None => html! { td.number.none data-value="" { span aria-label="not measured" { "–" } } },
    }
}

/// A cell with a figure and a bar as long as its share of the greatest.
pub fn bar(value: Option<f64>, greatest: f64) -> Markup {
    match value.filter(|v| v.is_finite() && greatest > 0.0) {
        Some(value) => {
            let share = format!("--share:{:.1}%", 100.0 * value / greatest);
            html! { td.number.bar data-value=(value) style=(share) { (three_digits(value)) } }
        }
        None => number(None, three_digits),
    }
}

/// A table that may be wider than the page.
pub fn scroll(label: &str, table: Markup) -> Markup {
    html! { div.scroll tabindex="0" role="region" aria-label=(label) { (table) } }
}

/// A chart with what to read from it, and its files.
pub fn figure(chart: &Chart) -> Markup {
    html! {
        figure.chart {
            div.canvas { (PreEscaped(chart.inline())) }
            figcaption {
                (chart.caption.reading) " "
                span.files { a href={ "charts/" (chart.caption.name) ".svg" } { "SVG" } " " a href={ "charts/" (chart.caption.name) ".png" } { "PNG" } }
            }
        }
    }
}
