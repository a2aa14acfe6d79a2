//! Wavefront OBJ, by tobj.
//!
//! Two things keep us from handing the file to tobj as it is. It takes more than faces for triangles (an `l` of three points,
//! a comment behind a face) and fails on what does not matter here (a normal out of range, colours on some vertices only,
//! Latin-1 in a comment), so that [`screened`] lets pass `v`, `f` and `o` alone. And its errors carry no line: where it fails,
//! [`diagnose`] goes through the file again and names the first line that breaks a rule.

use super::check::malformed;
use super::{LoadOptions, Mesh, fan, source};
use crate::{Error, Result};
use std::borrow::Cow;
use std::path::Path;

/// Reads an OBJ file as one mesh; `o` and `g` mean nothing. Vertices that no face uses are left out.
pub(super) fn read(path: &Path, options: &LoadOptions<'_>) -> Result<Mesh> {
    let objects = parse(path, options, Objects::Merged)?;
    Ok(objects.into_iter().next().unwrap_or_default().1)
}

/// Reads an OBJ file object by object: the faces behind each `o` line, under its name.
pub(super) fn read_objects(path: &Path, options: &LoadOptions<'_>) -> Result<Vec<(String, Mesh)>> {
    parse(path, options, Objects::Named)
}

#[derive(Clone, Copy, PartialEq)]
enum Objects {
    Merged,
    Named,
}

fn parse(path: &Path, options: &LoadOptions<'_>, objects: Objects) -> Result<Vec<(String, Mesh)>> {
    let text = source::bytes(path, options)?;
    // A single index would split a vertex wherever its normal changes.
    let tobj_options = tobj::LoadOptions { single_index: false, triangulate: false, ..tobj::LoadOptions::default() };
    let no_materials = |_: &Path| Ok(Default::default());
    let parsed = tobj::load_obj_buf(&mut screened(&text, objects).as_bytes(), &tobj_options, no_materials);
    let fault = |what: &str| {
        diagnose(path, &text).unwrap_or_else(|| malformed(path.display(), format_args!("{what}; export it again")))
    };
    let (models, _) = parsed.map_err(|error| fault(&error.to_string()))?;
    models.into_iter().map(|model| Ok((model.name, mesh(model.mesh).map_err(fault)?))).collect()
}

/// Fans polygons out from their first vertex. The error says what is wrong, not where.
fn mesh(mesh: tobj::Mesh) -> Result<Mesh, &'static str> {
    let positions: Vec<[f32; 3]> = mesh.positions.as_chunks().0.to_vec();
    if positions.iter().flatten().any(|c| !c.is_finite()) {
        return Err("a vertex is not finite");
    }
    if mesh.face_arities.is_empty() {
        return Ok(Mesh { positions, triangles: mesh.indices.as_chunks().0.to_vec() });
    }
    let mut triangles = Vec::with_capacity(mesh.indices.len());
    let mut rest = mesh.indices.as_slice();
    for arity in mesh.face_arities {
        let polygon = rest.split_off(..arity as usize).ok_or("a face is cut off")?;
        triangles.extend(fan(polygon).ok_or("a face has fewer than three vertices")?);
    }
    Ok(Mesh { positions, triangles })
}

/// The lines of a file with their numbers from 1; a backslash at the end of a line joins it with the next.
fn lines(text: &[u8]) -> impl Iterator<Item = (usize, Cow<'_, str>)> {
    let mut raw = (1..).zip(text.split(|&b| b == b'\n').map(|line| line.trim_ascii_end()));
    std::iter::from_fn(move || {
        let (number, line) = raw.next()?;
        let mut line = String::from_utf8_lossy(line);
        while let Some(joined) = line.strip_suffix('\\') {
            let (_, next) = raw.next().unwrap_or((number, b""));
            line = Cow::Owned(format!("{joined} {}", String::from_utf8_lossy(next)));
        }
        Some((number, line))
    })
}

/// What a line means to us.
enum Line<'a> {
    /// Its coordinates; a weight may follow.
    Vertex(&'a str),
    /// Its vertices.
    Face(&'a str),
    /// A new object.
    Object(&'a str),
    /// Something that makes no triangle.
    Other,
}

impl Line<'_> {
    fn of(line: &str) -> Line<'_> {
        let line = line.trim_start();
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let without_comment = || rest.split_once('#').map_or(rest, |(before, _)| before);
        match keyword {
            "v" => Line::Vertex(without_comment()),
            "f" => Line::Face(without_comment()),
            "o" => Line::Object(rest),
            _ => Line::Other,
        }
    }
}

/// The coordinates of a vertex line, and its weight if it has exactly one number more; more than that are colours.
fn coordinates(vertex: &str) -> impl Iterator<Item = &str> {
    let numbers = vertex.split_whitespace().count();
    vertex.split_whitespace().take(if numbers == 4 { 4 } else { 3 })
}

/// The lines of a file that matter, as tobj reads them.
fn screened(text: &[u8], objects: Objects) -> String {
    let mut screened = String::with_capacity(text.len());
    for (_, line) in lines(text) {
        match Line::of(&line) {
            Line::Vertex(vertex) => {
                screened.push('v');
                coordinates(vertex).for_each(|number| screened.extend([" ", number]));
                screened.push('\n');
            }
            Line::Face(face) => screened.extend(["f ", face, "\n"]),
            Line::Object(name) if objects == Objects::Named => screened.extend(["o ", name, "\n"]),
            Line::Object(_) | Line::Other => {}
        }
    }
    screened
}

/// The first line that breaks a rule.
fn diagnose(path: &Path, text: &[u8]) -> Option<Error> {
    let vertices = lines(text).filter(|(_, line)| matches!(Line::of(line), Line::Vertex(_))).count();
    let mut before = 0;
    lines(text).find_map(|(number, line)| {
        let fault = match Line::of(&line) {
            Line::Vertex(vertex) => {
                before += 1;
                vertex_fault(vertex)
            }
            Line::Face(face) => face_fault(face, before, vertices),
            Line::Object(_) | Line::Other => None,
        };
        fault.map(|fault| malformed(format_args!("{}:{number}", path.display()), fault))
    })
}

fn vertex_fault(vertex: &str) -> Option<String> {
    let words: Vec<&str> = coordinates(vertex).collect();
    if words.len() < 3 {
        return Some(format!("vertex has {} coordinates, it needs 3; is the file cut off?", words.len()));
    }
    if let Some(word) = words.iter().find(|word| word.parse::<f32>().is_err()) {
        return Some(format!("{word:?} is not a number; repair or export the file again"));
    }
    let numbers: Vec<f32> = words.iter().flat_map(|word| word.parse()).collect();
    let weight = numbers.get(3).copied().unwrap_or(1.0);
    let finite = weight != 0.0 && numbers.iter().all(|n| n.is_finite() && (n / weight).is_finite());
    (!finite).then(|| {
        let written = words.join(", ");
        format!("vertex ({written}) is not finite, every coordinate must be; repair or export the file again")
    })
}

/// `before` vertices stand above the face, `vertices` in the whole file.
fn face_fault(face: &str, before: usize, vertices: usize) -> Option<String> {
    let corner_fault = |corner: &str| {
        let mut parts = corner.split('/');
        let position = parts.next().and_then(|position| position.parse::<i64>().ok());
        let others_are_sound =
            parts.clone().count() <= 2 && parts.all(|part| part.is_empty() || part.parse::<isize>().is_ok());
        match position.filter(|_| others_are_sound) {
            None => Some(format!("{corner:?} is not a vertex of a face; repair or export the file again")),
            Some(0) => Some("face names vertex 0, vertices count from 1; add 1 to every index".into()),
            Some(index) if index > vertices as i64 => {
                Some(format!("face names vertex {index}, the file has {vertices}; is it cut off?"))
            }
            Some(index) if index < -(before as i64) => {
                Some(format!("face names vertex {index}, above it are {before}; is the head of the file missing?"))
            }
            Some(_) => None,
        }
    };
    face.split_whitespace().find_map(corner_fault).or_else(|| {
        let corners = face.split_whitespace().count();
        let needs = "a face needs at least 3; remove it (points and lines are `p` and `l`), or is the file cut off?";
        (corners < 3).then(|| format!("face has {corners} vertices, {needs}"))
    })
}
