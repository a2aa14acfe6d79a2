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

/// An empty table in our style; columns from `texts` on are aligned to the right.
pub fn with_header<S: Into<String>>(header: impl IntoIterator<Item = S>, texts: usize) -> Table {
    styled(STYLE, header, texts)
}

/// An empty table in any style; columns from `texts` on are aligned to the right.
pub fn styled<S: Into<String>>(style: TableStyle, header: impl IntoIterator<Item = S>, texts: usize) -> Table {
    let mut table = Table::new();
    table.load_style(style);
    table.set_header(header.into_iter().map(Into::into));
    for column in table.column_iter_mut().skip(texts) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

/// A figure, or a dash where it was not measured.
pub fn or_dash<T>(value: Option<T>, text: impl FnOnce(T) -> String) -> String {
    value.map_or_else(|| "–".into(), text)
}

/// One row a record, in the order given.
pub fn table(records: &[&Record]) -> Table {
    let header =
        ["scene", "builder", "triangles", "build", "min – max", "Mtri/s", "SAH", "EPO", "LCV", "depth", "Mrays/s"];
    let mut table = with_header(header.into_iter().chain(["right"]), 2);
    for record in records {
        table.add_row([
            record.scene.clone(),
            short(&record.builder),
            grouped(record.triangles),
            duration(record.build.median_ms),
            format!("{} – {}", three_digits(record.build.min_ms), three_digits(record.build.max_ms)),
            three_digits(record.mtris_s()),
            or_dash(record.quality.sah, three_digits),
            or_dash(record.quality.epo, three_digits),
            or_dash(record.quality.lcv, three_digits),
            or_dash(record.quality.depth_max, |depth| depth.to_string()),
            or_dash(record.mrays_s(), three_digits),
            verdict(record.valid).to_owned(),
        ]);
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
