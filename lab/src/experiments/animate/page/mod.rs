//! `animate.jsonl` and `animate.html`: a scene that moves, frame by frame in each of the ways, as programs read it and as people do.
//!
//! The page follows from the records alone: whoever has them can write it again.

mod charts;
mod layout;
pub mod standings;

use crate::experiments::animate::points::{Animated, Entry, Failure, Setting};
use crate::report::beside;
use crate::report::lines;
use crate::report::write_charts;
use crate::{Error, Result};
use std::path::{Path, PathBuf};

impl lines::Entry for Entry {
    const FILE: &'static str = beside::ANIMATE.records;
    const COMMAND: &'static str = "hedgerow animate";
}

/// `animate.jsonl`, open for writing.
pub type Points = lines::Points<Entry>;

/// The lines of an `animate.jsonl`, or of the one in a folder.
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
    frames: Vec<Animated>,
    failures: Vec<Failure>,
}

impl From<Vec<Entry>> for Measured {
    fn from(entries: Vec<Entry>) -> Measured {
        let mut measured = Measured::default();
        for entry in entries {
            match entry {
                Entry::Setting(setting) => measured.setting = Some(setting),
                Entry::Animate(frame) => measured.frames.push(frame),
                Entry::Failure(failure) => measured.failures.push(failure),
            }
        }
        measured
    }
}

/// Writes `animate.html` and its charts into `folder`, from the `animate.jsonl` there; gives the page's path. The page names the
/// others that lie there.
///
/// # Errors
/// The records cannot be read; a file cannot be written.
pub fn write(folder: &Path) -> Result<PathBuf> {
    let measured = Measured::from(read(folder)?);
    let charts = charts::all(&measured)?;
    write_charts(folder, charts.iter())?;
    let page = layout::page(&measured, &charts, &beside::links(folder, beside::ANIMATE.file));
    let path = folder.join(beside::ANIMATE.file);
    std::fs::write(&path, page).map_err(Error::file(&path))?;
    Ok(path)
}
