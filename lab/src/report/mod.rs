//! What pages are made of: charts, tables, pictures, numbers as people read them, and files of records.
//!
//! [`Chart`] is drawn once, as SVG, PNG and part of a page; [`bars`], [`stacked`] and [`curves`] are its usual kinds, and a
//! [`plot`] is the part with axes. A [`document`](mod@document) is a whole page, [`columns`] its tables, [`elements`] the rest
//! of it; [`theme`] its colours, [`beside`] the pages that name each other. [`lines`] reads and writes files of one record a
//! line. [`picture`] renders scenes.

pub mod bars;
pub mod beside;
pub mod chart;
pub mod columns;
pub mod curves;
pub mod document;
pub mod elements;
pub mod labels;
pub mod lines;
pub mod names;
pub mod numbers;
pub mod picture;
pub mod plot;
pub mod power_law;
pub mod raster;
pub mod stacked;
pub mod table;
pub mod theme;

pub use chart::{Caption, Chart};
pub use columns::Table;
pub use curves::{Axis, Curve, Mark};
pub use document::{Document, Section};
pub use names::{distinct, short, slug};
pub use theme::{SERIES, Tone};

use crate::{Error, Result};
use std::path::Path;

/// Writes charts as SVG and PNG into the folder `charts/` of `folder`; those that are there already stay.
pub fn write_charts<'a>(folder: &Path, charts: impl Iterator<Item = &'a Chart>) -> Result<()> {
    let folder = folder.join("charts");
    std::fs::create_dir_all(&folder).map_err(Error::file(&folder))?;
    for chart in charts {
        let [svg, png] = ["svg", "png"].map(|extension| folder.join(format!("{}.{extension}", chart.caption.name)));
        if png.is_file() && std::fs::read(&svg).is_ok_and(|content| content == chart.svg().as_bytes()) {
            continue;
        }
        // The SVG last: where it is, so is its picture.
        for (path, content) in [(png, chart.png()?), (svg, chart.svg().as_bytes().to_vec())] {
            std::fs::write(&path, content).map_err(Error::file(&path))?;
        }
    }
    Ok(())
}
