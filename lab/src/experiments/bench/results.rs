//! `results.jsonl` and `results.csv`: the records as programs read them.

use crate::measure::record::Record;
use crate::report::lines::{self, Lines};
use crate::report::names::distinct;
use crate::{Error, Result};
use std::path::Path;

/// The name of the file of records.
pub const FILE: &str = "results.jsonl";

/// Makes `folder` and an empty `results.jsonl` in it, open for writing.
///
/// # Errors
/// The folder cannot be made or written to.
pub fn create(folder: &Path) -> Result<Lines> {
    Lines::create(folder, FILE)
}

/// The records of a `results.jsonl`, or of the one in a folder.
///
/// # Errors
/// The file cannot be read; a line is not a record of this schema.
pub fn read(path: &Path) -> Result<Vec<Record>> {
    lines::read(path, (FILE, "hedgerow bench"), |record: &Record| record.schema, |_| None)
}

/// Writes the records as a table: one row each, three columns a kind of ray.
///
/// # Errors
/// The file cannot be written.
pub fn write_csv(path: &Path, records: &[&Record]) -> Result<()> {
    let wrong = |e: csv::Error| Error::file(path)(e.into());
    let kinds = distinct(records.iter().flat_map(|r| &r.trace).map(|trace| trace.rays.as_str()));
    let mut table = csv::Writer::from_path(path).map_err(wrong)?;
    let per_kind = kinds.iter().flat_map(|kind| ["mrays_s", "steps", "tests"].map(|figure| format!("{kind}_{figure}")));
    table.write_record(COLUMNS.iter().map(|(name, _)| (*name).to_owned()).chain(per_kind)).map_err(wrong)?;
    for record in records {
        let figures = kinds.iter().flat_map(|kind| {
            let trace = record.rays(kind);
            [trace.map(|t| t.mrays_s), trace.and_then(|t| t.steps), trace.and_then(|t| t.tests)].map(text)
        });
        table.write_record(COLUMNS.iter().map(|(_, value)| value(record)).chain(figures)).map_err(wrong)?;
    }
    table.flush().map_err(Error::file(path))
}

/// A column: its name, and its value in a record.
type Column = (&'static str, fn(&Record) -> String);

const COLUMNS: [Column; 35] = [
    ("scene", |r| r.scene.clone()),
    ("triangles", |r| r.triangles.to_string()),
    ("builder", |r| r.builder.clone()),
    ("kind", |r| r.kind.clone()),
    ("device", |r| r.device.clone()),
    ("driver", |r| r.driver.clone()),
    ("subgroup", |r| r.subgroup.to_string()),
    ("commit", |r| r.commit.clone()),
    ("when", |r| r.when.clone()),
    ("timer", |r| r.build.timer.clone()),
    ("runs", |r| r.build.runs.to_string()),
    ("build_ms", |r| r.build.median_ms.to_string()),
    ("build_min_ms", |r| r.build.min_ms.to_string()),
    ("build_max_ms", |r| r.build.max_ms.to_string()),
    ("threads", |r| text(r.build.threads)),
    ("cpu_ms", |r| text(r.build.cpu_median_ms)),
    ("mtris_s", |r| r.mtris_s().to_string()),
    ("structure_bytes", |r| text(r.memory.structure_bytes)),
    ("scratch_bytes", |r| text(r.memory.scratch_bytes)),
    ("peak_bytes", |r| text(r.memory.peak_bytes)),
    ("sah", |r| text(r.quality.sah)),
    ("sah_inner", |r| text(r.quality.sah_inner)),
    ("sah_leaf", |r| text(r.quality.sah_leaf)),
    ("epo", |r| text(r.quality.epo)),
    ("lcv", |r| text(r.quality.lcv)),
    ("inner", |r| text(r.quality.inner)),
    ("leaves", |r| text(r.quality.leaves)),
    ("empty_leaves", |r| text(r.quality.empty_leaves)),
    ("refs", |r| text(r.quality.refs)),
    ("depth_avg", |r| text(r.quality.depth_avg)),
    ("depth_max", |r| text(r.quality.depth_max)),
    ("prims_per_leaf", |r| text(r.quality.prims_per_leaf)),
    ("prims_per_leaf_max", |r| text(r.quality.prims_per_leaf_max)),
    ("mrays_s", |r| text(r.mrays_s())),
    ("valid", |r| text(r.valid)),
];

/// A figure, or nothing where it was not measured.
fn text<T: ToString>(figure: Option<T>) -> String {
    figure.map_or_else(String::new, |figure| figure.to_string())
}
