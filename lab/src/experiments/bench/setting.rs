//! `bench.json`: where and how the records beside it were measured, for pages that are made of them later.

use crate::measure::provenance::{DeviceFacts, Machine};
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::path::Path;

const FILE: &str = "bench.json";

/// Where and how a benchmark runs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Setting {
    /// [`crate::measure::record::SCHEMA`].
    pub schema: u32,
    /// The machine.
    pub machine: Machine,
    /// The device, if one is used.
    pub device: Option<DeviceFacts>,
    /// The command line.
    pub command: String,
    /// Options with their values, for people.
    pub options: Vec<(String, String)>,
    /// What a reader must know to judge the figures.
    pub notes: Vec<String>,
}

impl Setting {
    /// Writes it into a folder, before anything is measured.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<()> {
        let path = folder.join(FILE);
        let text = serde_json::to_string(self).expect("a setting has no keys but strings") + "\n";
        std::fs::write(&path, text).map_err(Error::file(&path))
    }

    /// That of a folder; `None` where there is none.
    ///
    /// # Errors
    /// The file cannot be read, or is no setting.
    pub fn read(folder: &Path) -> Result<Option<Setting>> {
        let path = folder.join(FILE);
        if !path.is_file() {
            return Ok(None);
        }
        let text = std::fs::read_to_string(&path).map_err(Error::file(&path))?;
        let wrong = |e: serde_json::Error| {
            Error::Malformed(format!("{}:{}: {e}; delete the file, or measure again", path.display(), e.line()))
        };
        serde_json::from_str(&text).map(Some).map_err(wrong)
    }
}
