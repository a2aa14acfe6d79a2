//! `fly.jsonl` and `fly.html`: camera paths, frame by frame and by cadence, as programs read it and as people do.
//!
//! The page follows from the records alone: anyone who has them can write it again.

mod charts;
mod parts;
mod published;
mod tables;
pub mod totals;

use crate::Result;
use crate::experiments::fly::points::{BuilderInFrame, FlownFrame, FlownPath, FlownTree, FlyEntry, FlySetting};
use crate::measure::Failure;
use crate::report::{Chart, Document, Section, beside, distinct, document, lines, slug};
use std::path::{Path, PathBuf};

impl lines::Entry for FlyEntry {
    const FILE: &'static str = beside::FLY.records;
    const COMMAND: &'static str = "hedgerow fly";
}

/// `fly.jsonl`, open for writing.
pub type Points = lines::Points<FlyEntry>;

/// The lines of a `fly.jsonl`, or of the one in a folder.
///
/// # Errors
/// The file cannot be read; a line is not a record of this schema.
pub fn read(path: &Path) -> Result<Vec<FlyEntry>> {
    lines::entries(path)
}

/// The records, by what they are of.
#[derive(Debug, Default)]
struct Measured {
    setting: Option<FlySetting>,
    paths: Vec<FlownPath>,
    trees: Vec<FlownTree>,
    frames: Vec<FlownFrame>,
    failures: Vec<Failure<BuilderInFrame>>,
}

impl Measured {
    /// The scenes that have figures.
    fn scenes(&self) -> Vec<String> {
        distinct(self.frames.iter().map(|frame| frame.scene.clone()))
    }
}

/// Writes `fly.html` and its charts into `folder`, from the `fly.jsonl` there; gives the page's path. The page names the others that lie
/// there.
///
/// # Errors
/// The records cannot be read; a file cannot be written.
pub fn write(folder: &Path) -> Result<PathBuf> {
    let mut measured = Measured::default();
    for entry in read(folder)? {
        match entry {
            FlyEntry::Setting(setting) => measured.setting = Some(setting),
            FlyEntry::Path(path) => measured.paths.push(path),
            FlyEntry::Tree(tree) => measured.trees.push(tree),
            FlyEntry::Fly(frame) => measured.frames.push(frame),
            FlyEntry::Failure(failure) => measured.failures.push(failure),
        }
    }
    let scenes = measured.scenes();
    let charts: Vec<Vec<Chart>> =
        scenes.iter().map(|scene| charts::of_scene(&measured, scene)).collect::<Result<_>>()?;
    let mut sections = vec![Section::new("summary", "Summary", parts::summary(&measured))];
    for (scene, charts) in scenes.iter().zip(&charts) {
        sections.push(Section::new(
            format!("scene-{}", slug(scene)),
            scene.clone(),
            parts::scene(&measured, scene, charts),
        ));
    }
    sections.extend([
        Section::new("sizes", "How many rays pay for a rebuild", parts::sizes(&measured)),
        Section::new("thesis", "The tables of van Kralingen 2023", tables::section(&measured)),
        Section::new("frames", "Every frame", parts::every_frame(&measured)),
        Section::method(Some(beside::FLY.records), parts::terms()),
    ]);
    let document = Document {
        tab: "camera paths".into(),
        kicker: "hedgerow fly",
        title: "Camera paths".into(),
        lead: "A camera flies through scenes that stand. Trees that learn from what it sees grow stale, and are built again at a cadence, \
               each taught by the frame before: what that takes, and what it wins."
            .into(),
        setting: measured.setting.as_ref().map(|setting| &setting.setting),
        failures: document::told(&measured.failures),
        sections,
    };
    document.write(folder, &beside::FLY, charts.iter().flatten())
}
