//! Shaders that another build has compiled: the folder HEDGEROW_SPIRV, which scripts/cargo.sh names, one for each version of shaderc.
//!
//! Cargo runs a build script anew for each set of features, for clippy and for each target folder; compiling takes it minutes. A shader
//! lies in the folder of its name, in one named after all that it was made of.

use std::collections::hash_map::DefaultHasher;
use std::fs;
use std::hash::{Hash, Hasher};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// The newest of each shader are kept.
const MOST_OF_A_SHADER: usize = 6;

/// Where what was made of this text is kept, if anything is.
fn folder_of(shader: &str, made_of: &str) -> Option<PathBuf> {
    let root = std::env::var_os("HEDGEROW_SPIRV").filter(|root| !root.is_empty())?;
    let hash = |seed: u64| {
        let mut hasher = DefaultHasher::new();
        (seed, made_of).hash(&mut hasher);
        hasher.finish()
    };
    Some(Path::new(&root).join(shader).join(format!("{:016x}{:016x}", hash(0), hash(1))))
}

/// Copies what is kept of a shader into OUT_DIR; whether there is all of it.
pub fn take(shader: &str, made_of: &str, files: &[String], out: &Path) -> bool {
    let Some(folder) = folder_of(shader, made_of) else { return false };
    files.iter().all(|file| fs::copy(folder.join(flat(file)), out.join(file)).is_ok())
}

/// Keeps what OUT_DIR has of a shader. Where that fails, it is compiled again next time.
pub fn keep(shader: &str, made_of: &str, files: &[String], out: &Path) {
    let Some(folder) = folder_of(shader, made_of) else { return };
    let of_shader = folder.parent().expect("it lies in one");
    // Another build may look at the same time: the folder is whole when it has its name.
    let unfinished = of_shader.join(format!(".{}", std::process::id()));
    let _ = fs::create_dir_all(&unfinished);
    let is_whole = files.iter().all(|file| fs::copy(out.join(file), unfinished.join(flat(file))).is_ok());
    if !is_whole || fs::rename(&unfinished, &folder).is_err() {
        let _ = fs::remove_dir_all(&unfinished);
    }
    forget_old(of_shader);
}

/// One folder has all files of a shader.
fn flat(file: &str) -> String {
    file.replace('/', ".")
}

fn forget_old(of_shader: &Path) {
    let Ok(entries) = fs::read_dir(of_shader) else { return };
    let with_age =
        |path: PathBuf| (fs::metadata(&path).and_then(|m| m.modified()).unwrap_or(SystemTime::UNIX_EPOCH), path);
    let mut kept: Vec<_> = entries.flatten().map(|entry| with_age(entry.path())).collect();
    kept.sort();
    for (_, path) in kept.iter().rev().skip(MOST_OF_A_SHADER) {
        let _ = fs::remove_dir_all(path);
    }
}
