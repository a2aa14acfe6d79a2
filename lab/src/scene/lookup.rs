//! From what a user types to a file: paths as they are, bare names looked up in folders of scenes.

use crate::{Error, Result};
use std::fs::DirEntry;
use std::path::{Path, PathBuf};

/// The formats, by extension, in the order in which a bare name without one is looked up.
pub(super) const FORMATS: [&str; 8] = ["obj", "ply", "glb", "gltf", "tri", "anim", "inst", "dyn"];

/// The folders that need no option: `scenes/` of the working directory and of the repository.
pub fn own_folders() -> Vec<PathBuf> {
    vec!["scenes".into(), concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes").into()]
}

/// The scene files of a folder, by name, without the parts that an `.inst` file beside them places, and without dynamic scenes:
/// standing still, they are other scenes put together.
///
/// # Errors
/// The folder cannot be read.
pub fn list(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries: Vec<DirEntry> = std::fs::read_dir(folder).and_then(Iterator::collect).map_err(Error::file(folder))?;
    let is_scene =
        |path: &PathBuf| path.is_file() && format_of(path).is_some_and(|f| f != "dyn" && FORMATS.contains(&f.as_str()));
    let mut files: Vec<PathBuf> = entries.iter().map(DirEntry::path).filter(is_scene).collect();
    files.sort_by_key(|path| (name_of(path), path.clone()));
    let placed: Vec<String> = files
        .iter()
        .filter(|path| format_of(path).as_deref() == Some("inst"))
        .map(|path| name_of(path) + "_parts")
        .collect();
    files.retain(|path| !placed.contains(&name_of(path)));
    Ok(files)
}

/// About how many bytes a scene takes, for sharing scenes out; 0 where that cannot be told without loading it.
pub fn weight(spec: &str, folders: &[PathBuf]) -> u64 {
    /// Of a triangle in a text file.
    const BYTES: u64 = 64;
    if let Ok(Some(generated)) = super::generators::Generated::find(spec) {
        return BYTES * generated.size();
    }
    find(spec, folders)
        .and_then(|path| std::fs::metadata(&path).map_err(Error::file(path)))
        .map_or(0, |file| file.len())
}

/// The file that `spec` names.
pub(super) fn find(spec: &str, folders: &[PathBuf]) -> Result<PathBuf> {
    let path = Path::new(spec);
    if path.is_file() {
        return Ok(path.into());
    }
    let is_bare = path.components().count() == 1 && !spec.ends_with(['/', '\\']);
    let places = folders.iter().filter(|_| is_bare).map(|folder| folder.join(spec)).chain([path.into()]);
    if let Some(found) = places.flat_map(|place| variants(&place)).find(|p| p.is_file()) {
        return Ok(found);
    }
    let looked = folders.iter().map(|f| f.display().to_string()).collect::<Vec<_>>().join(", ");
    Err(Error::Scene(if path.is_dir() {
        format!(
            "{spec} is a folder; name a scene file in it, or the folder with --scenes-dir and the scene by its name"
        )
    } else if is_bare && folders.is_empty() {
        format!("there is no scene {spec:?}: no file of this name, and no folder to look in; name either of them")
    } else if is_bare {
        format!(
            "there is no scene {spec:?}, neither as a file nor in {looked}; name a file, or a folder with --scenes-dir"
        )
    } else {
        format!("{spec}: no such file; check the path")
    }))
}

/// `path` as it stands, packed, and with each extension, plain and packed.
fn variants(path: &Path) -> impl Iterator<Item = PathBuf> + use<> {
    let path = path.display().to_string();
    let endings = FORMATS.iter().flat_map(|f| [format!(".{f}"), format!(".{f}.zst")]);
    [String::new(), ".zst".into()].into_iter().chain(endings).map(move |ending| format!("{path}{ending}").into())
}

/// Whether the file is packed.
pub(super) fn is_packed(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("zst"))
}

/// The file's name without `.zst`.
fn unpacked(path: &Path) -> &Path {
    let name = Path::new(path.file_name().unwrap_or_default());
    if is_packed(path) { Path::new(name.file_stem().unwrap_or_default()) } else { name }
}

/// The format by the file's extension, in lower case, `.zst` left away.
pub(super) fn format_of(path: &Path) -> Option<String> {
    unpacked(path).extension().map(|e| e.to_string_lossy().to_lowercase())
}

/// The scene's name: the file's, without extensions.
pub(super) fn name_of(path: &Path) -> String {
    unpacked(path).file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packed_files_are_named_and_typed_as_if_unpacked() {
        for path in ["a/sponza.obj", "sponza.obj.zst", "b/sponza.OBJ.ZST"] {
            assert_eq!(name_of(Path::new(path)), "sponza");
            assert_eq!(format_of(Path::new(path)).as_deref(), Some("obj"));
        }
        assert_eq!(name_of(Path::new("v1.2.tri")), "v1.2");
        assert_eq!(format_of(Path::new("sponza")), None);
    }
}
