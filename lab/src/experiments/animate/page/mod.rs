//! `animate.jsonl` and `animate.html`: a scene that moves, frame by frame in each of the ways, as programs read it and as
//! people do.
//!
//! The page follows from the records alone: anyone who has them can write it again.

mod charts;
mod parts;
pub mod standings;

use crate::Result;
use crate::experiments::animate::points::{AnimateEntry, Animated, SceneSetting, WayInFrame};
use crate::measure::Failure;
use crate::report::{Document, Section, beside, document, lines};
use std::path::{Path, PathBuf};

impl lines::Entry for AnimateEntry {
    const FILE: &'static str = beside::ANIMATE.records;
    const COMMAND: &'static str = "hedgerow animate";
}

/// `animate.jsonl`, open for writing.
pub type Points = lines::Points<AnimateEntry>;

/// The lines of an `animate.jsonl`, or of the one in a folder.
///
/// # Errors
/// The file cannot be read; a line is not a record of this schema.
pub fn read(path: &Path) -> Result<Vec<AnimateEntry>> {
    lines::entries(path)
}

/// The records, by what they are of.
#[derive(Debug, Default)]
struct Measured {
    setting: Option<SceneSetting>,
    frames: Vec<Animated>,
    failures: Vec<Failure<WayInFrame>>,
}

/// Writes `animate.html` and its charts into `folder`, from the `animate.jsonl` there; gives the page's path. The page names the
/// others that lie there.
///
/// # Errors
/// The records cannot be read; a file cannot be written.
pub fn write(folder: &Path) -> Result<PathBuf> {
    let mut measured = Measured::default();
    for entry in read(folder)? {
        match entry {
            AnimateEntry::Setting(setting) => measured.setting = Some(setting),
            AnimateEntry::Animate(frame) => measured.frames.push(frame),
            AnimateEntry::Failure(failure) => measured.failures.push(failure),
        }
    }
    let charts = charts::all(&measured)?;
    let setting = measured.setting.as_ref();
    let scene = setting.map_or("", |setting| setting.scene.as_str());
    let mut sections = vec![Section::new("summary", "Summary", parts::summary(setting, &measured.frames, &charts))];
    if let Some(setting) = setting.filter(|setting| !setting.pictures.is_empty()) {
        sections.push(Section::new("pictures", "Frames", parts::pictures(setting)));
    }
    sections.extend([
        Section::new("frames", "Every frame", parts::every_frame(&measured.frames)),
        Section::new("published", "Published figures", parts::published()),
        Section::method(Some(beside::ANIMATE.records), parts::terms(setting)),
    ]);
    let document = Document {
        tab: format!("{scene}, frame by frame"),
        kicker: "hedgerow animate",
        title: format!("{scene}, frame by frame"),
        lead: "Ways to have something to trace when some of a scene moves: all of it built from scratch, a tree beside the static \
               one, a tree of each object, a top level over instances, and objects' trees that are merged into the static one and \
               taken out again."
            .into(),
        setting: setting.map(|setting| &setting.setting),
        failures: document::told(&measured.failures),
        sections,
    };
    document.write(folder, &beside::ANIMATE, charts.iter())
}
