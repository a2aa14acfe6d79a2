//! `results.jsonl` and `results.csv`: the records as programs read them.

use crate::measure::record::{Record, SCHEMA};
use crate::{Error, Result};
use std::fs::File;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};

/// `results.jsonl`, open for writing: each record is on the disk as soon as it is measured.
#[derive(Debug)]
pub struct Results {
    path: PathBuf,
    file: File,
}

impl Results {
    /// Makes `folder` and an empty `results.jsonl` in it.
    ///
    /// # Errors
    /// The folder cannot be made or written to.
    pub fn create(folder: &Path) -> Result<Results> {
        std::fs::create_dir_all(folder).map_err(Error::file(folder))?;
        let path = folder.join("results.jsonl");
        let file = File::create(&path).map_err(Error::file(&path))?;
        Ok(Results { path, file })
    }

    /// Appends a record.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn append(&mut self, record: &Record) -> Result<()> {
        let mut line = serde_json::to_vec(record).expect("a record has no keys but strings");
        line.push(b'\n');
        self.file.write_all(&line).and_then(|()| self.file.flush()).map_err(Error::file(&self.path))
    }
}

/// The records of a `results.jsonl`, or of the one in a folder.
///
/// # Errors
/// The file cannot be read; a line is not a record of this schema.
pub fn read(path: &Path) -> Result<Vec<Record>> {
    let path = if path.is_dir() { path.join("results.jsonl") } else { path.to_owned() };
    let file = File::open(&path).map_err(Error::file(&path))?;
    let mut records = Vec::new();
    for (number, line) in BufReader::new(file).lines().enumerate() {
        let line = line.map_err(Error::file(&path))?;
        if line.trim().is_empty() {
            continue;
        }
        let wrong = |what: String| {
            Error::Malformed(format!(
                "{}:{}: {what}; is it a results.jsonl of `hedgerow bench`?",
                path.display(),
                number + 1
            ))
        };
        let record: Record = serde_json::from_str(&line).map_err(|e| wrong(format!("not a record: {e}")))?;
        if record.schema != SCHEMA {
            return Err(wrong(format!("schema {}, this program reads {SCHEMA}", record.schema)));
        }
        records.push(record);
    }
    Ok(records)
}

/// Writes the records as a table: one row each, three columns a kind of ray.
///
/// # Errors
/// The file cannot be written.
pub fn write_csv(path: &Path, records: &[&Record]) -> Result<()> {
    let wrong = |e: csv::Error| Error::file(path)(e.into());
    let mut kinds: Vec<&str> = Vec::new();
    for trace in records.iter().flat_map(|r| &r.trace) {
        if !kinds.contains(&trace.rays.as_str()) {
            kinds.push(&trace.rays);
        }
    }
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

const COLUMNS: [Column; 30] = [
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
    ("mtris_s", |r| r.mtris_s().to_string()),
    ("structure_bytes", |r| text(r.memory.structure_bytes)),
    ("scratch_bytes", |r| text(r.memory.scratch_bytes)),
    ("peak_bytes", |r| text(r.memory.peak_bytes)),
    ("sah", |r| text(r.quality.sah)),
    ("epo", |r| text(r.quality.epo)),
    ("lcv", |r| text(r.quality.lcv)),
    ("inner", |r| text(r.quality.inner)),
    ("leaves", |r| text(r.quality.leaves)),
    ("empty_leaves", |r| text(r.quality.empty_leaves)),
    ("refs", |r| text(r.quality.refs)),
    ("depth_avg", |r| text(r.quality.depth_avg)),
    ("depth_max", |r| text(r.quality.depth_max)),
    ("prims_per_leaf", |r| text(r.quality.prims_per_leaf)),
    ("mrays_s", |r| text(r.mrays_s())),
    ("valid", |r| text(r.valid)),
];

/// A figure, or nothing where it was not measured.
fn text<T: ToString>(figure: Option<T>) -> String {
    figure.map_or_else(String::new, |figure| figure.to_string())
}
