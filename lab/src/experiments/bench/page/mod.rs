//! `index.html`: what `hedgerow bench` measured, with charts and tables, in a page that opens from the disk with no network.

pub mod charts;
mod layout;
pub mod summary;

use crate::Result;
use crate::experiments::bench::matrix::{OnScene, Outcome};
use crate::experiments::bench::{kd_trees, results};
use crate::experiments::choose::hindsight::Choice;
use crate::experiments::write_pages;
use crate::measure::record::Record;
use crate::measure::setting::{Failure, Setting};
use crate::report::chart::Chart;
use crate::report::theme::Legend;
use crate::report::{beside, lines};
use charts::scatter::{SAH_COST, TRACE_SPEED, scatter};
use std::path::Path;

/// A benchmark run: everything that the page says.
#[derive(Debug, Clone)]
pub struct Report {
    /// Where and how.
    pub setting: Setting,
    /// What was measured, scene by scene.
    pub outcomes: Vec<Outcome>,
    /// What could not be measured.
    pub failures: Vec<Failure<OnScene>>,
    /// The builder that the others are compared with; the first one without.
    pub baseline: Option<String>,
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
    /// What it shows, for people who cannot see it.
    pub alt: String,
}

/// A scene and its charts.
type SceneCharts<'r> = (&'r str, Vec<Chart>);

/// The file that says where and how the records beside it were measured, for pages that are made of them later.
const SETTING: &str = "bench.json";

/// Where and how the records in a folder were measured; `None` where that was not written.
///
/// # Errors
/// The file cannot be read, or is not a setting.
pub fn read_setting(folder: &Path) -> Result<Option<Setting>> {
    lines::read_one(&folder.join(SETTING))
}

impl Report {
    /// Without figures yet.
    pub fn new(setting: Setting) -> Report {
        Report {
            setting,
            outcomes: Vec::new(),
            failures: Vec::new(),
            baseline: None,
            pictures: Vec::new(),
            choices: Vec::new(),
            published: kd_trees::published::papay(),
        }
    }

    /// Writes where and how into a folder, before anything is measured. Commit and time stand in each record.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write_setting(&self, folder: &Path) -> Result<()> {
        let setting = Setting { commit: String::new(), when: String::new(), ..self.setting.clone() };
        lines::write_one(&folder.join(SETTING), &setting)
    }

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

        let mut scenes: Vec<SceneCharts<'_>> = Vec::new();
        for scene in self.scenes() {
            let of_scene: Vec<&Record> = records.iter().copied().filter(|r| r.scene == scene).collect();
            let charts = [
                scatter(&of_scene, &legend, &TRACE_SPEED)?,
                scatter(&of_scene, &legend, &SAH_COST)?,
                charts::total_time::total_time(&of_scene, &legend)?,
                charts::phases::phases(&of_scene, &legend)?,
            ];
            scenes.push((scene, charts.into_iter().flatten().collect()));
        }
        let growth = charts::growth::growth(&records, &legend)?;
        let schedules = charts::schedules::schedules(&records, &legend)?;

        let charts = scenes.iter().flat_map(|(_, charts)| charts).chain(&schedules).chain(&growth);
        layout::document(self, &legend, &scenes, [schedules.as_ref(), growth.as_ref()]).write(
            folder,
            &beside::INDEX,
            charts,
        )?;
        write_pages(folder)
    }
}
