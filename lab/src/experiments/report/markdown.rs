//! Records as a page of Markdown: `docs/results.md`, the one generated file that the repository keeps.

use crate::experiments::bench::results;
use crate::measure::record::Record;
use crate::report::names::distinct;
use crate::report::numbers::three_digits;
use crate::report::table::styled;
use crate::{Error, Result};
use comfy_table::presets::ASCII_MARKDOWN;
use comfy_table::{CellAlignment, Table};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Columns before those of rays.
const COLUMNS: [&str; 6] = ["scene", "triangles", "builder", "build, ms", "SAH cost", "EPO"];
/// The first column of numbers behind the builder.
const FIRST_NUMBER: usize = 3;
/// Marks a builder whose structure or hits were wrong.
const WRONG: char = '†';

/// Writes the records of `folders` to `path`, a table for each device and commit.
///
/// # Errors
/// A folder has no `results.jsonl`, or a line of it is not a record; `path` cannot be written.
pub fn write(folders: &[PathBuf], path: &Path) -> Result<()> {
    let mut records = Vec::new();
    for folder in folders {
        records.extend(results::read(folder)?);
    }
    std::fs::write(path, page(&records)).map_err(Error::file(path))
}

/// The page of these records.
fn page(records: &[Record]) -> String {
    let mut runs: BTreeMap<(&str, &str, &str), Vec<&Record>> = BTreeMap::new();
    for record in records {
        runs.entry((&record.device, &record.driver, &record.commit)).or_default().push(record);
    }
    let mut page = "# Results\n\n`hedgerow report DIR… --markdown docs/results.md` writes this page from the records of `hedgerow \
                    bench`. Rays are in millions a second.\n"
        .to_owned();
    for ((device, driver, commit), records) in runs {
        let dates = records.iter().map(|record| record.when.split('T').next().unwrap_or(&record.when));
        let date = dates.max().unwrap_or("an unknown day");
        let runs = records.iter().map(|record| record.build.runs).max().unwrap_or(0);
        write!(
            page,
            "\n## {device}\n\n{driver}, commit {commit}, {date}, medians of {runs} runs.\n\n{}\n",
            table(&records)
        )
        .expect("writing to a string");
        if records.iter().any(|record| is_wrong(record)) {
            writeln!(page, "\n{WRONG} Not a valid structure, or hits that are wrong by brute force.")
                .expect("writing to a string");
        }
    }
    page
}

fn table(records: &[&Record]) -> Table {
    let kinds = distinct(records.iter().flat_map(|record| &record.trace).map(|trace| trace.rays.as_str()));
    let mut table = styled(ASCII_MARKDOWN, COLUMNS.into_iter().chain(kinds.iter().copied()), FIRST_NUMBER);
    table.column_mut(1).expect("triangles").set_cell_alignment(CellAlignment::Right);
    for record in records {
        let rays = kinds.iter().map(|kind| figure(record.rays(kind).map(|trace| trace.mrays_s)));
        let before = [
            record.scene.clone(),
            record.triangles.to_string(),
            format!("`{}`{}", record.builder, if is_wrong(record) { format!(" {WRONG}") } else { String::new() }),
            three_digits(record.build.median_ms),
            figure(record.quality.sah),
            figure(record.quality.epo),
        ];
        table.add_row(before.into_iter().chain(rays));
    }
    table
}

fn is_wrong(record: &Record) -> bool {
    record.valid == Some(false)
}

fn figure(value: Option<f64>) -> String {
    value.map_or(String::new(), three_digits)
}
