//! What `hedgerow stability` measures, as programs read it and as people do: for each experiment a file of points, a file that
//! says where and how they were measured, and a page.
//!
//! The page follows from the two files alone: whoever has them can write it again, and other commands do, so that the pages
//! name each other.

mod degenerate;
mod growth;
mod large;
mod layout;
mod losses;

use crate::experiments::stability::points::{Degenerate, Growth, Large, Point, Run};
use crate::measure::record::SCHEMA;
use crate::report::beside::{self, Page};
use crate::report::chart::Chart;
use crate::report::lines::{self, Lines};
use crate::report::write_charts;
use crate::{Error, Result};
use maud::Markup;
use std::path::{Path, PathBuf};

/// Points that have a page.
pub trait Paged: Point {
    /// The page, and the file of the points.
    const PAGE: Page;
    /// Its title, and what it is about.
    const TITLE: [&'static str; 2];
    /// What went wrong, beside what the run says.
    fn failures(points: &[Self]) -> Vec<String>;
    /// What is to be seen first.
    fn summary(points: &[Self]) -> Markup;
    /// The other parts of the page.
    ///
    /// # Errors
    /// A chart cannot be drawn.
    fn sections(points: &[Self]) -> Result<Vec<Section>>;
    /// How it is measured: terms and what they mean.
    fn method() -> Markup;
}

/// A part of a page.
pub struct Section {
    id: String,
    title: String,
    charts: Vec<Chart>,
    /// What is above the charts, and what below.
    above: Markup,
    below: Markup,
    /// Charts for who wants to know more.
    more: Vec<Chart>,
}

/// A file of points, open for writing: each is on the disk as soon as it is measured.
#[derive(Debug)]
pub struct Points<P> {
    folder: PathBuf,
    lines: Lines,
    of: std::marker::PhantomData<P>,
}

impl<P: Paged> Points<P> {
    /// Makes `folder` and an empty file in it.
    ///
    /// # Errors
    /// The folder cannot be made or written to.
    pub fn create(folder: &Path) -> Result<Points<P>> {
        let lines = Lines::create(folder, P::PAGE.records)?;
        Ok(Points { folder: folder.to_owned(), lines, of: std::marker::PhantomData })
    }

    /// Appends a point.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn append(&mut self, point: &P) -> Result<()> {
        self.lines.append(point)
    }

    /// Writes where and how they were measured, the page, and the pages beside it, which name it; gives the page's path.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn finish(self, run: &Run) -> Result<PathBuf> {
        let path = run_path::<P>(&self.folder);
        let json = serde_json::to_vec(run).expect("a run has no keys but strings");
        std::fs::write(&path, json).map_err(Error::file(&path))?;
        if beside::ACCEL.is_in(&self.folder) {
            crate::experiments::accel::page::write(&self.folder)?;
        }
        write_all(&self.folder)?;
        Ok(self.folder.join(P::PAGE.file))
    }
}

/// `growth.run.json` and the like.
fn run_path<P: Point>(folder: &Path) -> PathBuf {
    folder.join(format!("{}.run.json", P::EXPERIMENT))
}

/// The points of a file, or of that in a folder.
///
/// # Errors
/// The file cannot be read; a line is not a point of this schema and experiment.
pub fn read<P: Paged>(path: &Path) -> Result<Vec<P>> {
    let command = format!("hedgerow stability {}", P::EXPERIMENT);
    let points = lines::read(path, P::PAGE.records, &command, |point: &P| point.head().schema)?;
    match points.iter().position(|point| point.head().experiment != P::EXPERIMENT) {
        None => Ok(points),
        Some(i) => Err(Error::Malformed(format!(
            "{}:{}: experiment {:?}; is it a {} of `{command}`?",
            path.display(),
            i + 1,
            points[i].head().experiment,
            P::PAGE.records
        ))),
    }
}

/// Where and how the points in a folder were measured; `None` where that was not written: the run was ended before its end.
///
/// # Errors
/// The file cannot be read, or is of another schema.
pub fn read_run<P: Paged>(folder: &Path) -> Result<Option<Run>> {
    let path = run_path::<P>(folder);
    if !path.is_file() {
        return Ok(None);
    }
    let json = std::fs::read(&path).map_err(Error::file(&path))?;
    let wrong = |what: String| Error::Malformed(format!("{}: {what}; measure it again", path.display()));
    let run: Run = serde_json::from_slice(&json).map_err(|e| wrong(e.to_string()))?;
    if run.schema != SCHEMA {
        return Err(wrong(format!("schema {}, this program reads {SCHEMA}", run.schema)));
    }
    Ok(Some(run))
}

/// Writes the page of every experiment whose points lie in `folder`.
///
/// # Errors
/// The points cannot be read; a file cannot be written.
pub fn write_all(folder: &Path) -> Result<()> {
    write::<Growth>(folder)?;
    write::<Large>(folder)?;
    write::<Degenerate>(folder)
}

fn write<P: Paged>(folder: &Path) -> Result<()> {
    if !P::PAGE.is_in(folder) {
        return Ok(());
    }
    let points: Vec<P> = read(folder)?;
    let run = read_run::<P>(folder)?;
    let sections = P::sections(&points)?;
    write_charts(folder, sections.iter().flat_map(|section| section.charts.iter().chain(&section.more)))?;
    let page = layout::page(&points, run.as_ref(), &sections, &beside::links(folder, P::PAGE.file));
    let path = folder.join(P::PAGE.file);
    std::fs::write(&path, page).map_err(Error::file(&path))
}
