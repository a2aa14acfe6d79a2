//! A page of a command: one file that opens from the disk, with style, script and charts inside.

use super::beside::{self, Page};
use super::chart::Chart;
use super::elements::{facts, figure, foot, page};
use super::write_charts;
use crate::measure::setting::{Failure, Setting};
use crate::{Error, Result};
use maud::{Markup, html};
use std::fmt::Display;
use std::path::{Path, PathBuf};

/// Everything that a page says.
pub struct Document<'a> {
    /// In the browser's tab, behind the program's name.
    pub tab: String,
    /// The command that made it.
    pub kicker: &'static str,
    /// The heading.
    pub title: String,
    /// What it is about, in a few sentences.
    pub lead: String,
    /// Where and how it was measured, if that was written.
    pub setting: Option<&'a Setting>,
    /// What went wrong: of what, and what.
    pub failures: Vec<(String, String)>,
    /// Its parts, the summary first.
    pub sections: Vec<Section>,
}

/// A part of a page.
pub struct Section {
    /// Its anchor.
    pub id: String,
    /// What the navigation calls it.
    pub name: String,
    /// All of it, with its heading.
    pub content: Markup,
}

impl Section {
    /// A part with its name as the heading.
    pub fn new(id: impl Into<String>, name: impl Into<String>, body: Markup) -> Section {
        let (id, name) = (id.into(), name.into());
        let content = html! { section #(id) { h2 { (name) } (body) } };
        Section { id, name, content }
    }

    /// How it is measured: where every figure is, and terms with what they mean.
    pub fn method(records: Option<&str>, terms: Markup) -> Section {
        let body = html! {
            @if let Some(records) = records { p { "The same as " a href=(records) { (records) } ", where every figure is." } }
            dl.terms { (terms) }
            p { "Figures of different machines do not compare." }
        };
        Section::new("method", "How it is measured", body)
    }
}

/// Charts beside each other; one alone takes the width.
pub fn charts(all: &[Chart]) -> Markup {
    html! { @if !all.is_empty() { div.charts .single[all.len() == 1] { @for chart in all { (figure(chart)) } } } }
}

/// Failures as [`Document::failures`] has them.
pub fn told<'f, At: Display + 'f>(failures: impl IntoIterator<Item = &'f Failure<At>>) -> Vec<(String, String)> {
    failures.into_iter().map(|failure| (failure.at.to_string(), failure.what.clone())).collect()
}

impl Document<'_> {
    /// Writes the page and its charts into `folder`, and gives the page's path. It names the other pages that lie there.
    ///
    /// # Errors
    /// A chart cannot be drawn; a file cannot be written.
    pub fn write<'c>(&self, folder: &Path, page: &Page, charts: impl Iterator<Item = &'c Chart>) -> Result<PathBuf> {
        write_charts(folder, charts)?;
        let path = folder.join(page.file);
        std::fs::write(&path, self.html(&beside::links(folder, page.file))).map_err(Error::file(&path))?;
        Ok(path)
    }

    fn html(&self, links: &Markup) -> String {
        let body = html! {
            a.skip href="#summary" { "Skip to the results" }
            header.hero {
                p.kicker { (self.kicker) }
                h1 { (self.title) }
                p.lead { (self.lead) }
                @if let Some(setting) = self.setting { (facts(setting)) }
            }
            nav aria-label="Sections" {
                @for section in &self.sections { a href={ "#" (section.id) } { (section.name) } }
                (links)
            }
            main {
                @if !self.failures.is_empty() {
                    section.warning #failures {
                        h2 { "What went wrong" }
                        ul { @for (of, what) in &self.failures { li { b { (of) } ": " (what) } } }
                    }
                }
                @for section in &self.sections { (section.content) }
            }
            @if let Some(setting) = self.setting { (foot(&setting.commit, &setting.when)) }
        };
        page(&format!("hedgerow: {}", self.tab), &body)
    }
}
