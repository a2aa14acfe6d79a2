//! `.inst`: placed copies of the objects of an OBJ file, one a line: the object's `o` name and a row-major 3×4
//! object-to-world matrix; `#` begins a comment. `NAME.inst` places the objects of `NAME_parts.obj` beside it.
//! Flattened in the order of the file.

use super::{LoadOptions, Mesh, check, lookup, obj, source};
use crate::{Error, Result};
use std::path::{Path, PathBuf};

/// Reads the instances and writes every copy out.
pub(super) fn read(path: &Path, options: &LoadOptions<'_>) -> Result<Mesh> {
    let text = source::bytes(path, options)?;
    let parts_path = parts_of(path)?;
    let parts = obj::read_objects(&parts_path, options)?;
    let mut mesh = Mesh::default();
    for (line, text) in (1..).zip(String::from_utf8_lossy(&text).lines()) {
        let place = format!("{}:{line}", path.display());
        let text = text.split_once('#').map_or(text, |(before, _)| before);
        let Some((name, matrix)) = instance(&place, text)? else { continue };
        let mut known = false;
        for (_, part) in parts.iter().filter(|(part, _)| part == name) {
            known = true;
            append(&place, part, &matrix, &mut mesh)?;
        }
        if !known {
            let names = parts.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ");
            let parts = parts_path.display();
            return Err(Error::Malformed(format!(
                "{place}: {parts} has no object {name:?}, it has {names}; correct the name"
            )));
        }
    }
    Ok(mesh)
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
    let numbers: Vec<Option<f32>> = words.map(|word| word.parse().ok().filter(|n: &f32| n.is_finite())).collect();
    let numbers: Option<Vec<f32>> = numbers.into_iter().collect();
    match numbers.as_deref().map(<[f32]>::as_chunks::<4>) {
        Some((&[x, y, z], [])) => Ok(Some((name, [x, y, z]))),
        _ => Err(Error::Malformed(format!(
            "{place}: an instance is a name and 12 finite numbers (a row-major 3x4 matrix); is the file cut off?"
        ))),
    }
}

fn append(place: &str, part: &Mesh, matrix: &Matrix, mesh: &mut Mesh) -> Result<()> {
    let first = mesh.positions.len();
    check::vertices_can_be_counted(place, first + part.positions.len())?;
    let rows = matrix.map(|row| row.map(f64::from));
    mesh.positions.extend(part.positions.iter().map(|p| {
        let [x, y, z] = p.map(f64::from);
        rows.map(|[a, b, c, d]| (a * x + b * y + c * z + d) as f32)
    }));
    check::vertices_are_finite(place, &mesh.positions[first..])?;
    mesh.triangles.extend(part.triangles.iter().map(|t| t.map(|v| v + first as u32)));
    Ok(())
}
