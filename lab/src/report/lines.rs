//! Files of one JSON record a line: each is on the disk as soon as it is measured, and read back with the line that is wrong.

use crate::measure::record::SCHEMA;
use crate::{Error, Result};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::{BufRead, BufReader, Write};
use std::marker::PhantomData;
use std::path::{Path, PathBuf};

/// A file of records, open for writing.
#[derive(Debug)]
pub struct Lines {
    path: PathBuf,
    file: File,
}

impl Lines {
    /// Makes `folder` and the empty file `name` in it.
    ///
    /// # Errors
    /// The folder cannot be made or written to.
    pub fn create(folder: &Path, name: &str) -> Result<Lines> {
        std::fs::create_dir_all(folder).map_err(Error::file(folder))?;
        let path = folder.join(name);
        let file = File::create(&path).map_err(Error::file(&path))?;
        Ok(Lines { path, file })
    }

    /// Appends a record.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn append(&mut self, record: &impl Serialize) -> Result<()> {
        let mut line = serde_json::to_vec(record).expect("a record has no keys but strings");
        line.push(b'\n');
        self.file.write_all(&line).and_then(|()| self.file.flush()).map_err(Error::file(&self.path))
    }
}

/// The records of a file that `command` writes, or of the file `name` in a folder.
///
/// # Errors
/// The file cannot be read; a line is not a record, or one of another schema.
pub fn read<R: DeserializeOwned>(
    path: &Path,
    (name, command): (&str, &str),
    schema: fn(&R) -> u32,
    fault: fn(&R) -> Option<String>,
) -> Result<Vec<R>> {
    let path = if path.is_dir() { path.join(name) } else { path.to_owned() };
    let file = File::open(&path).map_err(Error::file(&path))?;
    let mut records = Vec::new();
    for (number, line) in BufReader::new(file).lines().enumerate() {
        let line = line.map_err(Error::file(&path))?;
        if line.trim().is_empty() {
            continue;
        }
        let wrong = |what: String| {
            Error::Malformed(format!("{}:{}: {what}; is it a {name} of `{command}`?", path.display(), number + 1))
        };
        let record: R = serde_json::from_str(&line).map_err(|e| wrong(format!("not a record: {e}")))?;
        if schema(&record) != SCHEMA {
            return Err(wrong(format!("schema {}, this program reads {SCHEMA}", schema(&record))));
        }
        if let Some(fault) = fault(&record) {
            return Err(wrong(fault));
        }
        records.push(record);
    }
    Ok(records)
}

/// What the lines of a file say, of several kinds, each marked by its `experiment`.
pub trait Entry: Serialize + DeserializeOwned {
    /// The name of the file.
    const FILE: &'static str;
    /// The command that writes it.
    const COMMAND: &'static str;
    /// What is wrong with an entry that is none of this file.
    fn fault(&self) -> Option<String> {
        None
    }
}

/// An entry as it is written.
#[derive(Serialize, Deserialize)]
struct Line<E> {
    schema: u32,
    #[serde(flatten)]
    entry: E,
}

/// A file of entries, open for writing: each is on the disk as soon as it is measured.
#[derive(Debug)]
pub struct Points<E>(Lines, PhantomData<E>);

impl<E: Entry> Points<E> {
    /// Makes `folder` and the empty file in it.
    ///
    /// # Errors
    /// The folder cannot be made or written to.
    pub fn create(folder: &Path) -> Result<Points<E>> {
        Ok(Points(Lines::create(folder, E::FILE)?, PhantomData))
    }

    /// Appends a line.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn append(&mut self, entry: E) -> Result<()> {
        self.0.append(&Line { schema: SCHEMA, entry })
    }
}

/// Writes all entries of a file into `folder`.
///
/// # Errors
/// The file cannot be written.
pub fn write<E: Entry>(folder: &Path, entries: Vec<E>) -> Result<()> {
    let mut points = Points::create(folder)?;
    entries.into_iter().try_for_each(|entry| points.append(entry))
}

/// The entries of a file, or of the one in a folder.
///
/// # Errors
/// The file cannot be read; a line is not an entry of this schema.
pub fn entries<E: Entry>(path: &Path) -> Result<Vec<E>> {
    let lines = read(path, (E::FILE, E::COMMAND), |line: &Line<E>| line.schema, |line| line.entry.fault())?;
    Ok(lines.into_iter().map(|line| line.entry).collect())
}

/// Writes a file of one record.
///
/// # Errors
/// The file cannot be written.
pub fn write_one(path: &Path, entry: &impl Serialize) -> Result<()> {
    let text = serde_json::to_string(&Line { schema: SCHEMA, entry }).expect("a record has no keys but strings") + "\n";
    std::fs::write(path, text).map_err(Error::file(path))
}

/// The record of such a file; `None` where there is none.
///
/// # Errors
/// The file cannot be read, or is not such a record of this schema.
pub fn read_one<E: DeserializeOwned>(path: &Path) -> Result<Option<E>> {
    if !path.is_file() {
        return Ok(None);
    }
    let text = std::fs::read_to_string(path).map_err(Error::file(path))?;
    let wrong =
        |what: String| Error::Malformed(format!("{}: {what}; delete the file, or measure again", path.display()));
    let line: Line<E> = serde_json::from_str(&text).map_err(|error| wrong(error.to_string()))?;
    match line.schema {
        SCHEMA => Ok(Some(line.entry)),
        other => Err(wrong(format!("schema {other}, this program reads {SCHEMA}"))),
    }
}
