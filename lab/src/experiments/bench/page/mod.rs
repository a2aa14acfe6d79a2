//! `index.html`: what `hedgerow bench` measured, with charts and tables, in a page that opens from the disk with no network.

pub mod charts;
mod layout;
pub mod summary;

use crate::experiments::bench::matrix::{Failure, Outcome};
use crate::experiments::bench::{kd_trees, results};
use crate::experiments::{accel, animate, stability};
use crate::measure::choose::hindsight::Choice;
pub use crate::measure::provenance::DeviceFacts;
use crate::measure::provenance::Machine;
use crate::measure::record::Record;
use crate::report::chart::Chart;
use crate::report::theme::Legend;
use crate::report::{beside, write_charts};
use crate::{Error, Result};
use std::path::Path;

/// A benchmark run: everything that the page says.
#[derive(Debug, Clone)]
pub struct Report {
    /// The machine.
    pub machine: Machine,
    /// The device, if one was used.
    pub device: Option<DeviceFacts>,
    /// Commit of the program.
    pub commit: String,
    /// When it was measured, RFC 3339 UTC.
    pub when: String,
    /// The command line that measures it again.
    pub command: String,
    /// Options with their values, for people.
    pub options: Vec<(String, String)>,
    /// What was measured, scene by scene.
    pub outcomes: Vec<Outcome>,
    /// What could not be measured.
    pub failures: Vec<Failure>,
    /// The builder that the others are compared with; the first one without.
    pub baseline: Option<String>,
    /// What a reader must know to judge the figures, such as a peer that is none.
    pub notes: Vec<String>,
    /// Pictures of the scenes, in files below the folder.
    pub pictures: Vec<Picture>,
    /// What `auto` chose for every scene, before it was measured.
    pub choices: Vec<Choice>,
    /// Published figures of kd-trees, to stand beside those that are measured.
    pub published: kd_trees::published::Published,
}

/// A picture of a scene.
#[derive(Debug, Clone)]
pub struct Picture {
    /// The scene's name.
    pub scene: String,
    /// File, relative to the report's folder, with `/`.
    pub file: String,
    /// What it is.
    pub caption: String,
    /// What it shows, for whoever cannot see it.
    pub alt: String,
}

/// The charts of one scene.
struct SceneCharts {
    scene: String,
    charts: Vec<Chart>,
}

impl Report {
    /// The records, in the order in which they were measured.
    pub fn records(&self) -> Vec<&Record> {
        self.outcomes.iter().map(|outcome| &outcome.record).collect()
    }

    /// The scenes, in the order in which they were measured.
    fn scenes(&self) -> Vec<&str> {
        let mut scenes: Vec<&str> = self.outcomes.iter().map(|o| o.record.scene.as_str()).collect();
        scenes.dedup();
        scenes
    }

    /// Writes `results.csv`, `charts/` and `index.html` into `folder`; `results.jsonl` is there already. Where there are records
    /// of other commands, too, their pages are written again, and all name each other.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<()> {
        let records = self.records();
        let legend = Legend::of(records.iter().copied());
        results::write_csv(&folder.join("results.csv"), &records)?;

        let mut scenes = Vec::new();
        for scene in self.scenes() {
            let of_scene: Vec<&Record> = records.iter().copied().filter(|r| r.scene == scene).collect();
            let charts = [
                charts::scatter::trace_speed(&of_scene, &legend)?,
                charts::scatter::sah_cost(&of_scene, &legend)?,
                charts::total_time::total_time(&of_scene, &legend)?,
                charts::phases::phases(&of_scene, &legend)?,
            ];
            scenes.push(SceneCharts { scene: scene.to_owned(), charts: charts.into_iter().flatten().collect() });
        }
        let growth = charts::growth::growth(&records, &legend)?;

        write_charts(folder, scenes.iter().flat_map(|s| &s.charts).chain(&growth))?;
        let page = layout::page(self, &legend, &scenes, growth.as_ref(), &beside::links(folder, beside::INDEX.file));
        let path = folder.join("index.html");
        std::fs::write(&path, page).map_err(Error::file(&path))?;
        if beside::ACCEL.is_in(folder) {
            accel::page::write(folder)?;
        }
        if beside::ANIMATE.is_in(folder) {
            animate::page::write(folder)?;
        }
        stability::page::write_all(folder)
    }
}
