//! The records as a table for the terminal.

use super::names::short;
use super::numbers::{duration, grouped, three_digits};
use crate::measure::record::Record;
use comfy_table::{CellAlignment, LineStyle, Table, TableStyle};

/// Lines above, below and under the heading: a hundred rows stay readable.
pub const STYLE: TableStyle = TableStyle::new()
    .top_border(LineStyle::none().fill('─').junction('─'))
    .header_separator(LineStyle::none().fill('─').junction('─'))
    .bottom_border(LineStyle::none().fill('─').junction('─'));

/// One row a record, in the order given.
pub fn table(records: &[&Record]) -> Table {
    let mut table = Table::new();
    table.load_style(STYLE);
    table.set_header([
        "scene",
        "triangles",
        "builder",
        "build",
        "min – max",
        "Mtri/s",
        "SAH",
        "EPO",
        "LCV",
        "depth",
        "Mrays/s",
        "right",
    ]);
    for record in records {
        let figure = |figure: Option<f64>| figure.map_or("–".into(), three_digits);
        table.add_row([
            record.scene.clone(),
            grouped(record.triangles),
            short(&record.builder),
            duration(record.build.median_ms),
            format!("{} – {}", three_digits(record.build.min_ms), three_digits(record.build.max_ms)),
            three_digits(record.mtris_s()),
            figure(record.quality.sah),
            figure(record.quality.epo),
            figure(record.quality.lcv),
            record.quality.depth_max.map_or("–".into(), |depth| depth.to_string()),
            figure(record.mrays_s()),
            verdict(record.valid).to_owned(),
        ]);
    }
    for column in [1, 3, 4, 5, 6, 7, 8, 9, 10] {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table
}

/// What `valid` means, in a word.
pub fn verdict(valid: Option<bool>) -> &'static str {
    match valid {
        Some(true) => "yes",
        Some(false) => "NO",
        None => "not checked",
    }
}
