//! `.inst`: placed copies of the objects of an OBJ file, one a line: the object's `o` name and a row-major 3×4
//! object-to-world matrix; `#` begins a comment. `NAME.inst` places the objects of `NAME_parts.obj` beside it.

use super::check::{self, malformed};
use super::{Instances, LoadOptions, Mesh, SceneInstance, cameras, lookup, obj, source};
use crate::{Error, Result};
use hedgerow::geometry::Aabb;
use std::path::{Path, PathBuf};

/// Reads the instances, in the order of the file; the objects become its parts, in theirs. A name that several objects bear
/// places them all.
pub(super) fn read(path: &Path, options: &LoadOptions<'_>) -> Result<Instances> {
    let text = source::bytes(path, options)?;
    let parts_path = parts_of(path)?;
    let (names, parts): (Vec<String>, Vec<Mesh>) = obj::read_objects(&parts_path, options)?.into_iter().unzip();
    let boxes: Vec<Aabb> = parts.iter().map(|part| Aabb::around(&part.positions)).collect();
    let mut instances = Vec::new();
    for (line, text) in (1..).zip(String::from_utf8_lossy(&text).lines()) {
        let place = format!("{}:{line}", path.display());
        let text = text.split_once('#').map_or(text, |(before, _)| before);
        let Some((name, transform)) = instance(&place, text)? else { continue };
        let before = instances.len();
        for part in (0..names.len()).filter(|&part| names[part] == name) {
            let instance = SceneInstance { part: part as u32, transform };
            placed_is_finite(&place, &parts[part], &boxes[part], &instance)?;
            instances.push(instance);
        }
        if instances.len() == before {
            let (parts, names) = (parts_path.display(), names.join(", "));
            let what = format_args!("{parts} has no object {name:?}, it has {names}; correct the name");
            return Err(malformed(place, what));
        }
    }
    Ok(Instances::new(lookup::name_of(path), parts, instances, cameras::around))
}

fn parts_of(path: &Path) -> Result<PathBuf> {
    let name = lookup::name_of(path) + "_parts";
    [".obj", ".obj.zst"]
        .map(|ending| path.with_file_name(format!("{name}{ending}")))
        .into_iter()
        .find(|p| p.is_file())
        .ok_or_else(|| {
            let path = path.display();
            Error::Scene(format!(
                "{path}: the objects that it places are missing; put {name}.obj or {name}.obj.zst beside it"
            ))
        })
}

/// Object to world, row by row.
type Matrix = [[f32; 4]; 3];

/// The object and where it stands; `None` for an empty line.
fn instance<'a>(place: &str, line: &'a str) -> Result<Option<(&'a str, Matrix)>> {
    let mut words = line.split_whitespace();
    let Some(name) = words.next() else { return Ok(None) };
    let numbers: Option<Vec<f32>> = words.map(|word| word.parse().ok().filter(|n: &f32| n.is_finite())).collect();
    match numbers.as_deref().map(<[f32]>::as_chunks::<4>) {
        Some((&[x, y, z], [])) => Ok(Some((name, [x, y, z]))),
        _ => {
            let what = "an instance is a name and 12 finite numbers (a row-major 3x4 matrix); is the file cut off?";
            Err(malformed(place, what))
        }
    }
}

/// Every vertex is finite where the instance puts it; `bounds` is around all of them.
fn placed_is_finite(place: &str, part: &Mesh, bounds: &Aabb, instance: &SceneInstance) -> Result<()> {
    // The corners of the box go as far as any vertex, so that the vertices are asked only to name the one at fault.
    let Aabb { lo, hi } = instance.place_box(bounds);
    if part.positions.is_empty() || lo.into_iter().chain(hi).all(f32::is_finite) {
        return Ok(());
    }
    let placed: Vec<[f32; 3]> = part.positions.iter().map(|&p| instance.place(p)).collect();
    check::vertices_are_finite(place, &placed)
}
