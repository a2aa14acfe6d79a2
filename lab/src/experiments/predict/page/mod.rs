//! `predict.jsonl` and `predict.html`: what tells the time of rays, as programs read it and as people do.

mod charts;
mod pay;
mod tables;
mod thesis;

use super::record;
use super::samples::{Sample, Scope, samples};
use crate::Result;
use crate::experiments::bench::matrix::OnScene;
use crate::measure::{Failure, Setting};
use crate::report::{Document, Section, beside, distinct, document, lines};
use crate::subjects::retraced::TreeTracer;
use maud::{Markup, html};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// The file that says where and how.
const RUN: &str = "predict.json";

/// Where and how it was measured, and what could not be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// Where and how.
    pub setting: Setting,
    /// What could not be measured, or was wrong.
    pub failures: Vec<Failure<OnScene>>,
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

/// Writes `predict.html` and its charts into `folder`, from the records there; gives the page's path. The page names the others that
/// lie there.
///
/// # Errors
/// The records cannot be read; a file cannot be written.
pub fn write(folder: &Path) -> Result<PathBuf> {
    let records = record::read(folder)?;
    let run: Option<Run> = lines::read_one(&folder.join(RUN))?;
    let setting = run.as_ref().map(|run| &run.setting);
    let notes = setting.map_or(&[][..], |setting| &setting.notes);
    let all = samples(&records);
    let charts = charts::all(&all)?;
    let summary = html! {
        @for note in notes { p.note { (note) } }
        (tables::summary(&all))
    };
    let sections = vec![
        Section::new("summary", "Summary", summary),
        Section::new("kinds", "By kind of ray", tables::by_kind(&all)),
        Section::new("scenes", "By scene", tables::by_scene(&all)),
        Section::new("scatter", "All trees", charts::section(&all, &charts)),
        Section::new("pay", "What a build pays for", pay::section(&records)),
        Section::new("thesis", "Beside van Kralingen 2023", thesis::section(&all)),
        Section::method(Some(beside::PREDICT.records), terms()),
    ];
    let document = Document {
        tab: "what predicts tracing".into(),
        kicker: "hedgerow predict",
        title: "Which figure of a tree tells how fast it is traced".into(),
        lead: "Trees by area, by codes, by clustering, by splits and by heuristics, all traced by the same two tracers. A figure is worth \
               what it says of time: of two trees, the one that it calls cheaper shall be the faster one."
            .into(),
        setting,
        failures: document::told(run.iter().flat_map(|run| &run.failures)),
        sections,
    };
    document.write(folder, &beside::PREDICT, charts.iter())
}

/// The tracers that have traced.
fn tracers(samples: &[Sample]) -> impl Iterator<Item = TreeTracer> {
    TreeTracer::ALL.into_iter().filter(|tracer| samples.iter().any(|sample| sample.tracer == *tracer))
}

/// The kinds of rays by a tracer, all together first.
fn kinds(samples: &[Sample], tracer: TreeTracer) -> Vec<&str> {
    let all = samples.iter().filter(|sample| sample.tracer == tracer).map(|sample| sample.kind.as_str());
    let pooled = Scope::pooled(tracer).kind;
    distinct([pooled].into_iter().chain(all))
}

/// The scenes.
fn scenes(samples: &[Sample]) -> Vec<&str> {
    distinct(samples.iter().map(|sample| sample.scene.as_str()))
}

fn terms() -> Markup {
    html! {
        dt { "Ratios" }
        dd {
            "Each figure and each time over that of the reference, which is the first builder of " code { "-b" } ": where nothing else was "
            "asked for, binned by surface area with ten bins on all axes and single triangles, which are then collapsed as those of the trees "
            "by heuristics are. Correlations are between logarithms. Over several scenes the reference is no point, as it lies at 1 whatever the "
            "figures say; on one scene it is."
        }
        dt { "r, ρ" }
        dd {
            "Pearson's and Spearman's correlation. 1: the figure tells the time; 0: it says nothing; below 0: the opposite. The interval "
            "is that of 95% by Fisher's z, as if points were drawn one by one; trees of a scene are alike, so it is rather too narrow."
        }
        dt { "In brackets" }
        dd { "With six points or fewer and |r| below 0.8: chance gives as much in more than one of twenty draws. It says nothing." }
        dt { "Weights that are sought" }
        dd {
            "α and β, and prices of steps and tests. Over several scenes each scene is told by the weights of the others; the weights beside are "
            "those of all. On one scene they are its own, which flatters them."
        }
        dt { "SAH, EPO, C" }
        dd {
            "With 3 for a step and 2 for a test. EPO is an estimate from at most 32,768 triangles, the same ones of every tree; it is left out "
            "where it takes more than 5 s. A ratio to 0 is none: such points are missing, and n says so."
        }
        dt { "Cost by a heuristic" }
        dd {
            "Σ c(n) · F(n) / F(root), F the rays that meet a node: from anywhere in the scene, through the camera's picture, of a sample, or "
            "triangles below it on which rays ended. The surface area that heuristics mix in is left out. The sample has its own seed: no ray of it is timed."
        }
        dt { "Times" }
        dd {
            "Medians of runs in turn, after one that does not count, by our tracers: on every core of the host, and on the device over the "
            "uploaded tree. All rays together count by their numbers. A builder that has built for 3 s builds no more; if that was once, it is the figure."
        }
        dt { "When it pays" }
        dd {
            "Extra build time over what a ray gains: rays a build from which on the tree is the better choice. Not told apart: the least and greatest "
            "times of both overlap. Drawing the rays that teach a builder is not in its build time: a renderer has them from the frame before."
        }
    }
}
