//! What `hedgerow stability` measures, as programs read it and as people do: for each experiment a file of points, a file that
//! says where and how they were measured, and a page.
//!
//! The page follows from the two files alone: anyone who has them can write it again, and other commands do, so that the pages
//! name each other.

mod degenerate;
mod greedy;
mod growth;
mod large;
mod losses;
mod stretched;
pub(super) mod top;

use super::points::{Degenerate, Greedy, Growth, Large, Run};
use super::top::points::TopGrowth;
use crate::Result;
use crate::experiments::write_pages;
use crate::report::beside::Page;
use crate::report::lines::Entry;
use crate::report::{Chart, Document, Section, document, lines};
use maud::{Markup, html};
use std::path::{Path, PathBuf};

/// Points that have a page.
pub trait Paged: Entry {
    /// The page, and the file of the points.
    const PAGE: Page;
    /// Its title, and what it is about.
    const TITLE: [&'static str; 2];
    /// What went wrong, beside what the run says: of what, and what.
    fn failures(_points: &[Self]) -> Vec<(String, String)> {
        Vec::new()
    }
    /// What to look at first.
    fn summary(points: &[Self]) -> Markup;
    /// The other parts of the page, and their charts.
    ///
    /// # Errors
    /// A chart cannot be drawn.
    fn sections(points: &[Self]) -> Result<(Vec<Section>, Vec<Chart>)>;
    /// How it is measured: terms and what they mean.
    fn terms() -> Markup;
}

/// Writes where and how the points in `folder` were measured, their page, and the pages beside it, which name it; gives the page's
/// path.
///
/// # Errors
/// A file cannot be written.
pub fn finish<P: Paged>(folder: &Path, run: &Run) -> Result<PathBuf> {
    lines::write_one(&run_file::<P>(folder), run)?;
    write_pages(folder)?;
    Ok(folder.join(P::PAGE.file))
}

/// The file that says where and how the points in a folder were measured.
fn run_file<P: Paged>(folder: &Path) -> PathBuf {
    folder.join(format!("{}.run.json", P::PAGE.stem()))
}

/// Where and how the points in a folder were measured; `None` where that was not written: the run was ended before its end.
///
/// # Errors
/// The file cannot be read, or is of another schema.
pub fn read_run<P: Paged>(folder: &Path) -> Result<Option<Run>> {
    lines::read_one(&run_file::<P>(folder))
}

/// Writes the page of every experiment whose points lie in `folder`.
///
/// # Errors
/// The points cannot be read; a file cannot be written.
pub fn write_all(folder: &Path) -> Result<()> {
    write::<Growth>(folder)?;
    write::<TopGrowth>(folder)?;
    write::<Large>(folder)?;
    write::<Degenerate>(folder)?;
    write::<Greedy>(folder)
}

fn write<P: Paged>(folder: &Path) -> Result<()> {
    if !P::PAGE.is_in(folder) {
        return Ok(());
    }
    let points: Vec<P> = lines::entries(folder)?;
    let run = read_run::<P>(folder)?;
    let (parts, charts) = P::sections(&points)?;
    let summary = html! {
        @if run.is_none() { p.note { "The run was ended before its end: these are the points up to there." } }
        @for note in run.as_ref().map_or(&[][..], |run| &run.setting.notes) { p.note { (note) } }
        @if points.is_empty() { p { "Nothing was measured." } } @else { (P::summary(&points)) }
    };
    let mut sections = vec![Section::new("summary", "Summary", summary)];
    sections.extend(parts);
    sections.push(Section::method(Some(P::PAGE.records), P::terms()));
    let mut failures = document::told(run.iter().flat_map(|run| &run.failures));
    failures.extend(P::failures(&points));
    let [title, lead] = P::TITLE;
    let document = Document {
        tab: P::PAGE.name.to_lowercase(),
        kicker: "hedgerow benchmark",
        title: title.into(),
        lead: lead.into(),
        setting: run.as_ref().map(|run| &run.setting),
        failures,
        sections,
    };
    document.write(folder, &P::PAGE, charts.iter()).map(drop)
}
