//! `accel.jsonl` and `accel.html`: what `hedgerow accel` measures, as programs read it and as people do.
//!
//! The page follows from the records alone: whoever has them can write it again, and `hedgerow bench` does, so that the pages
//! name each other.

mod batch;
mod goals;
mod layout;
mod rebraid;
mod top_level;
mod update;

use crate::experiments::accel::points::{Batch, Entry, Failure, Rebraid, Setting, TopLevel, Update};
use crate::report::beside;
use crate::report::chart::Chart;
use crate::report::lines;
use crate::report::write_charts;
use crate::{Error, Result};
use maud::Markup;
use std::path::{Path, PathBuf};

impl lines::Entry for Entry {
    const FILE: &'static str = beside::ACCEL.records;
    const COMMAND: &'static str = "hedgerow accel";
}

/// `accel.jsonl`, open for writing.
pub type Points = lines::Points<Entry>;

/// The lines of an `accel.jsonl`, or of the one in a folder.
///
/// # Errors
/// The file cannot be read; a line is not a record of this schema.
pub fn read(path: &Path) -> Result<Vec<Entry>> {
    lines::entries(path)
}

/// The records, by what they are of.
#[derive(Debug, Default)]
struct Measured {
    setting: Option<Setting>,
    batches: Vec<Batch>,
    top_levels: Vec<TopLevel>,
    rebraids: Vec<Rebraid>,
    updates: Vec<Update>,
    failures: Vec<Failure>,
}

impl From<Vec<Entry>> for Measured {
    fn from(entries: Vec<Entry>) -> Measured {
        let mut measured = Measured::default();
        for entry in entries {
            match entry {
                Entry::Setting(setting) => measured.setting = Some(setting),
                Entry::Batch(point) => measured.batches.push(point),
                Entry::Tlas(point) => measured.top_levels.push(point),
                Entry::Rebraid(point) => measured.rebraids.push(point),
                Entry::Update(point) => measured.updates.push(point),
                Entry::Failure(failure) => measured.failures.push(failure),
            }
        }
        measured
    }
}

/// A part of the page.
struct Section {
    id: &'static str,
    title: &'static str,
    charts: Vec<Chart>,
    /// What is above the charts, and what below.
    above: Markup,
    below: Markup,
}

/// Writes `accel.html` and its charts into `folder`, from the `accel.jsonl` there; gives the page's path. The page names the
/// others that lie there.
///
/// # Errors
/// The records cannot be read; a file cannot be written.
pub fn write(folder: &Path) -> Result<PathBuf> {
    let measured = Measured::from(read(folder)?);
    let sections: Vec<Section> = [
        batch::section(&measured.batches)?,
        top_level::section(&measured.top_levels)?,
        rebraid::section(&measured.rebraids)?,
        update::section(&measured.updates)?,
    ]
    .into_iter()
    .flatten()
    .collect();
    write_charts(folder, sections.iter().flat_map(|section| &section.charts))?;
    let page = layout::page(&measured, &goals::goals(&measured), &sections, &beside::links(folder, beside::ACCEL.file));
    let path = folder.join("accel.html");
    std::fs::write(&path, page).map_err(Error::file(&path))?;
    Ok(path)
}
