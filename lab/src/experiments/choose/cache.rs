//! The table of costs, kept in a file: one for each device and driver.
//!
//! The folder is `HEDGEROW_CACHE`, or else `hedgerow` in the user's cache folder.

use super::{CostTable, calibration, candidates};
use crate::device::Device;
use crate::report::names::slug;
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Version of the table's meaning: of its classes, scenes and rays.
const VERSION: u32 = 9;

/// What a file holds: the table, and what it belongs to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Calibration {
    key: Key,
    #[serde(flatten)]
    table: CostTable,
}

/// What the table belongs to: with another key it is measured again.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct Key {
    version: u32,
    program: String,
    device: String,
    driver: String,
    candidates: Vec<String>,
}

impl Key {
    fn of(device: &Device) -> Key {
        let found = device.found();
        Key {
            version: VERSION,
            program: env!("CARGO_PKG_VERSION").into(),
            device: found.name.clone(),
            driver: found.driver.clone(),
            candidates: candidates::possible(device).iter().map(ToString::to_string).collect(),
        }
    }

    /// The file's name: letters and digits of device and driver, all else a hyphen.
    fn file(&self) -> String {
        format!("costs-{}.json", slug(&format!("{} {}", self.device, self.driver)))
    }
}

/// The table of `device`: from the cache, or measured and kept. With `anew`, measured in any case. `say` is called with what is
/// being done.
///
/// A folder that cannot be written is not an error: a warning says so, and the next program measures again.
///
/// # Errors
/// The device can build no candidate.
pub fn table_of(device: &Device, anew: bool, say: &mut dyn FnMut(&str)) -> Result<CostTable> {
    let folder = folder();
    if let Some(table) = folder.as_deref().filter(|_| !anew).and_then(|folder| read(folder, &Key::of(device))) {
        return Ok(table);
    }
    let table = calibration::measure(device, say)?;
    match folder {
        Some(folder) => {
            if let Err(error) = keep(&folder, device, &table) {
                log::warn!("the costs of builders are not kept: {error}");
            }
        }
        None => log::warn!("the costs of builders are not kept: no cache folder is known; set HEDGEROW_CACHE"),
    }
    Ok(table)
}

/// Keeps the table of `device` in a folder, where programs with that `HEDGEROW_CACHE` find it.
///
/// # Errors
/// The folder cannot be made or written.
pub fn keep(folder: &Path, device: &Device, table: &CostTable) -> Result<()> {
    write(folder, &Calibration { key: Key::of(device), table: table.clone() })
}

fn folder() -> Option<PathBuf> {
    let variable = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    variable("HEDGEROW_CACHE").or_else(|| {
        let cache = if cfg!(windows) { variable("LOCALAPPDATA") } else { variable("XDG_CACHE_HOME") };
        Some(cache.or_else(|| Some(variable("HOME")?.join(".cache")))?.join("hedgerow"))
    })
}

/// The table of `key`, if its file is in the folder and belongs to it.
fn read(folder: &Path, key: &Key) -> Option<CostTable> {
    let text = std::fs::read_to_string(folder.join(key.file())).ok()?;
    let calibration: Calibration = serde_json::from_str(&text).ok()?;
    (calibration.key == *key).then_some(calibration.table)
}

/// Written aside and moved: a program that reads meanwhile sees the old file or the new one.
fn write(folder: &Path, calibration: &Calibration) -> Result<()> {
    let path = folder.join(calibration.key.file());
    std::fs::create_dir_all(folder).map_err(Error::file(folder))?;
    let text = serde_json::to_string_pretty(calibration).expect("figures are JSON");
    let aside = path.with_extension(format!("json.{}", std::process::id()));
    std::fs::write(&aside, text).map_err(Error::file(&aside))?;
    std::fs::rename(&aside, &path).map_err(Error::file(&path))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::choose::{Cost, CostRow, SceneClass};

    fn calibration() -> Calibration {
        let key = Key {
            version: VERSION,
            program: "0.1.0".into(),
            device: "llvmpipe (LLVM 15.0.6, 256 bits)".into(),
            driver: "Mesa 25.0.7".into(),
            candidates: vec!["lbvh".into()],
        };
        let cost = Cost { builder: "lbvh".into(), build_ms: 1.0 / 3.0, ray_ns: 1e3 };
        let row = CostRow { class: SceneClass { triangles: 12, is_crowded: true }, costs: vec![cost] };
        Calibration { key, table: CostTable { rows: vec![row] } }
    }

    #[test]
    fn what_was_kept_is_found_again_by_its_key_alone() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let kept = calibration();
        let deeper = folder.path().join("deeper");
        assert_eq!(read(&deeper, &kept.key), None);
        write(&deeper, &kept).expect("the folder is made");
        assert_eq!(read(&deeper, &kept.key), Some(kept.table.clone()));
        let more = vec!["lbvh".into(), "ploc".into()];
        for other in [
            Key { version: VERSION + 1, ..kept.key.clone() },
            Key { driver: "Mesa-25.0.7".into(), ..kept.key.clone() },
            Key { candidates: more, ..kept.key.clone() },
        ] {
            assert_eq!(other.file(), kept.key.file(), "the name alone does not tell them apart");
            assert_eq!(read(&deeper, &other), None, "{other:?}");
        }
        std::fs::write(deeper.join(kept.key.file()), "{").expect("it is ours");
        assert_eq!(read(&deeper, &kept.key), None);
    }

    #[test]
    fn the_name_of_the_file_is_plain() {
        assert_eq!(calibration().key.file(), "costs-llvmpipe-llvm-15-0-6-256-bits-mesa-25-0-7.json");
    }
}
