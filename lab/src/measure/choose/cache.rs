//! The figures of a calibration, kept in a file: one for each device and driver.
//!
//! The folder is `HEDGEROW_CACHE`, or else `hedgerow` in the user's cache folder.

use super::calibration;
use super::candidates;
use super::model::{Measured, Model};
use crate::device::Device;
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Version of the figures' meaning: of the features, the scenes and the rays.
const VERSION: u32 = 8;

/// What a file holds: the figures, and what they belong to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Calibration {
    key: Key,
    measured: Vec<Measured>,
}

/// What the figures belong to: with another key they are measured anew.
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
        let plain = |c: char| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' };
        let words = format!("{} {}", self.device, self.driver).chars().map(plain).collect::<String>();
        let words: Vec<&str> = words.split('-').filter(|word| !word.is_empty()).collect();
        format!("costs-{}.json", words.join("-"))
    }
}

/// The cost model of `device`: from the cache, or measured and kept. With `anew`, measured in any case. `say` is told what is being
/// done.
///
/// A folder that cannot be written is no error: it is said, and the next one measures again.
///
/// # Errors
/// The device can build no candidate.
pub fn model_of(device: &Device, anew: bool, say: &mut dyn FnMut(&str)) -> Result<Model> {
    let key = Key::of(device);
    let path = folder().map(|folder| folder.join(key.file()));
    if let Some(measured) = path.as_deref().filter(|_| !anew).and_then(|path| read(path, &key)) {
        return Ok(Model::of(&measured));
    }
    let measured = calibration::measure(device, say)?;
    match &path {
        Some(path) => {
            if let Err(error) = write(path, &Calibration { key, measured: measured.clone() }) {
                log::warn!("the costs of builders are not kept: {error}");
            }
        }
        None => log::warn!("the costs of builders are not kept: no cache folder is known; set HEDGEROW_CACHE"),
    }
    Ok(Model::of(&measured))
}

fn folder() -> Option<PathBuf> {
    let variable = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    variable("HEDGEROW_CACHE").or_else(|| {
        let cache = if cfg!(windows) { variable("LOCALAPPDATA") } else { variable("XDG_CACHE_HOME") };
        Some(cache.or_else(|| Some(variable("HOME")?.join(".cache")))?.join("hedgerow"))
    })
}

/// The figures of a file, if they are there and belong to `key`.
fn read(path: &Path, key: &Key) -> Option<Vec<Measured>> {
    let text = std::fs::read_to_string(path).ok()?;
    let calibration: Calibration = serde_json::from_str(&text).ok()?;
    (calibration.key == *key).then_some(calibration.measured)
}

/// Written aside and moved: whoever reads meanwhile sees the old file or the new one.
fn write(path: &Path, calibration: &Calibration) -> Result<()> {
    let folder = path.parent().unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder).map_err(Error::file(folder))?;
    let text = serde_json::to_string(calibration).expect("figures are JSON");
    let aside = path.with_extension(format!("json.{}", std::process::id()));
    std::fs::write(&aside, text).map_err(Error::file(&aside))?;
    std::fs::rename(&aside, path).map_err(Error::file(path))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::choose::Features;
    use crate::measure::choose::prices::RayWork;

    fn calibration() -> Calibration {
        let key = Key {
            version: VERSION,
            program: "0.1.0".into(),
            device: "llvmpipe (LLVM 15.0.6, 256 bits)".into(),
            driver: "Mesa 25.0.7".into(),
            candidates: vec!["lbvh".into()],
        };
        let measured = Measured {
            scene: "a".into(),
            features: Features { triangles: 12, values: [0.1, 0.2, 0.3, 0.4, -0.5] },
            builder: "lbvh".into(),
            layout: "bvh2".into(),
            build_ms: 1.0 / 3.0,
            ray_ns: 1e3,
            work: RayWork { steps: 7.25, tests: 2.0 / 3.0 },
        };
        Calibration { key, measured: vec![measured] }
    }

    #[test]
    fn what_was_kept_is_found_again_by_its_key_alone() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let kept = calibration();
        let path = folder.path().join("deeper").join(kept.key.file());
        assert_eq!(read(&path, &kept.key), None);
        write(&path, &kept).expect("the folder is made");
        assert_eq!(read(&path, &kept.key), Some(kept.measured.clone()));
        let more = vec!["lbvh".into(), "ploc".into()];
        for other in [
            Key { version: VERSION + 1, ..kept.key.clone() },
            Key { driver: "Mesa 26.1.6".into(), ..kept.key.clone() },
            Key { candidates: more, ..kept.key.clone() },
        ] {
            assert_eq!(read(&path, &other), None, "{other:?}");
        }
        std::fs::write(&path, "{").expect("it is ours");
        assert_eq!(read(&path, &kept.key), None);
    }

    #[test]
    fn the_name_of_the_file_is_plain() {
        assert_eq!(calibration().key.file(), "costs-llvmpipe-llvm-15-0-6-256-bits-mesa-25-0-7.json");
    }
}
