//! `cpu-builders.jsonl` and `cpu-builders.html`: builders on the CPU, as programs read it and as people do. Records are lines of
//! the schema of `hedgerow bench`; where and how they were measured, and what failed, stands in `cpu-builders.json` beside them.

mod charts;
mod orders;
mod peers;
mod published;
mod scenes;
mod summary;

use super::measured::{OnScene, by_scene};
use crate::Result;
use crate::experiments::bench::matrix;
use crate::measure::record::Record;
use crate::measure::{Failure, Setting};
use crate::report::chart::Chart;
use crate::report::{Document, Section, beside, document, lines};
use maud::{Markup, html};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// The file that says where and how.
const RUN: &str = "cpu-builders.json";

/// Where and how it was measured, and what could not be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// Where and how.
    pub setting: Setting,
    /// What could not be measured, or was wrong.
    pub failures: Vec<Failure<matrix::OnScene>>,
}

impl Run {
    /// Writes it into a folder.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<()> {
        lines::write_one(&folder.join(RUN), self)
    }
}

/// The records of a `cpu-builders.jsonl`, or of the one in a folder.
///
/// # Errors
/// The file cannot be read; a line is not a record of this schema.
pub fn read(path: &Path) -> Result<Vec<Record>> {
    lines::read(
        path,
        (beside::CPU_BUILDERS.records, "hedgerow cpu-builders"),
        |record: &Record| record.schema,
        |_| None,
    )
}

/// Writes `cpu-builders.html` and its charts into `folder`, from the records there; gives the page's path. The page names the
/// others that lie there.
///
/// # Errors
/// The records cannot be read; a file cannot be written.
pub fn write(folder: &Path) -> Result<PathBuf> {
    let records = read(folder)?;
    let run: Option<Run> = lines::read_one(&folder.join(RUN))?;
    let scenes = by_scene(&records);
    let charts: Vec<Vec<Chart>> = scenes.iter().map(charts::of_scene).collect::<Result<_>>()?;
    let setting = run.as_ref().map(|run| &run.setting);
    let notes = setting.map_or(&[][..], |setting| &setting.notes);
    let mut sections = vec![Section::new("summary", "Summary", summary::section(&scenes, notes))];
    sections.extend(scenes.iter().zip(&charts).map(|(scene, charts)| scenes::section(scene, charts)));
    sections.extend([
        Section::new("order", "Does SAH order ray times?", orders::section(&scenes)),
        Section::new("peers", "Beside peers", peers::section(&scenes)),
        Section::new("frantal", "Beside Frantál 2019", published::section(&scenes)),
        Section::method(Some(beside::CPU_BUILDERS.records), terms()),
    ]);
    let document = Document {
        tab: "builders on the CPU".into(),
        kicker: "hedgerow cpu-builders",
        title: "Builders of BVHs on the CPU".into(),
        lead: "Each builder runs on one thread and on all, in turn with the others. Our tracer takes the same rays through every tree, \
               on the host and on the device."
            .into(),
        setting,
        failures: document::told(run.iter().flat_map(|run| &run.failures)),
        sections,
    };
    document.write(folder, &beside::CPU_BUILDERS, charts.iter().flatten())
}

/// The scenes that have a builder to hold the others against.
fn with_base<'s, 'r>(
    scenes: &'s [OnScene<'r>],
) -> impl Iterator<Item = (&'s OnScene<'r>, &'s super::measured::Measured<'r>)> {
    scenes.iter().filter_map(|scene| Some((scene, scene.of(super::choice::BASE)?)))
}

fn terms() -> Markup {
    html! {
        dt { "Build" }
        dd {
            "Median wall-clock time from triangles to the finished tree, after a run that does not count. Builders run in turn. "
            "\"One thread\" is the same builder with " code { "threads=1" } "."
        }
        dt { "SAH" }
        dd {
            "(3 · Σ area of inner nodes + 2 · Σ area of leaves × their triangles) / area of the root. Σ inner and Σ leaf are the two sums, "
            "each over the area of the root."
        }
        dt { "EPO" }
        dd { "End-point overlap (Aila, Karras, Laine 2013): surface in a node's box that belongs to other subtrees." }
        dt { "Host and device" }
        dd {
            "Our tracers: on every core of the host, and on the device over the uploaded tree. Both walk the same bytes, so their steps and "
            "tests are those of the tree. A peer's own tracer walks the peer's own layout."
        }
        dt { "Pairs ordered rightly" }
        dd {
            "Of all pairs of builders on a scene, those where the one with less cost takes less time a ray. Pairs whose times differ by less "
            "than 2% are left out. Chance gives 50%."
        }
        dt { "Rank correlation" }
        dd { "Spearman's, between cost and time a ray: 1 where both have one order, 0 where they have nothing in common." }
        dt { "In brackets" }
        dd { "What was published. It stands beside a figure and never enters one." }
    }
}
