//! Wavefront OBJ, by tobj.
//!
//! Two things keep us from handing the file to tobj as it is. It takes more than faces for triangles (an `l` of three points,
//! a comment behind a face) and fails on what does not matter here (a normal out of range, colours on some vertices only,
//! Latin-1 in a comment), so that [`Screen`] lets pass `v`, `f` and `o` alone. And its errors carry no line: where it fails,
//! [`diagnose`] goes through the file again and names the first line that breaks a rule.

use super::{LoadOptions, Mesh, source};
use crate::{Error, Result};
use std::borrow::Cow;
use std::io::{self, BufRead, Read};
use std::path::Path;

/// Reads an OBJ file as one mesh; `o` and `g` mean nothing. Vertices that no face uses are left out.
pub(super) fn read(path: &Path, options: &LoadOptions<'_>) -> Result<Mesh> {
    let objects = parse(path, options, Objects::Merged)?;
    Ok(objects.into_iter().next().map(|(_, mesh)| mesh).unwrap_or_default())
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
    let mut screen = Screen::new(&text, objects);
    let no_materials = |_: &Path| Ok(Default::default());
    let parsed = tobj::load_obj_buf(&mut screen, &tobj_options, no_materials);
    let fault =
        |what: &str| diagnose(path, &text).unwrap_or_else(|| malformed(path, format!("{what}; export it again")));
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
        let (polygon, others) = rest.split_at(arity as usize);
        rest = others;
        let [first, fan @ ..] = polygon else { return Err("a face has no vertices") };
        if fan.len() < 2 {
            return Err("a face has fewer than three vertices");
        }
        triangles.extend(fan.windows(2).map(|edge| [*first, edge[0], edge[1]]));
    }
    Ok(Mesh { positions, triangles })
}

fn malformed(path: &Path, what: String) -> Error {
    Error::Malformed(format!("{}: {what}", path.display()))
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
struct Screen<L> {
    lines: L,
    objects: Objects,
    line: Vec<u8>,
    at: usize,
}

impl Screen<()> {
    fn new(text: &[u8], objects: Objects) -> Screen<impl Iterator<Item = (usize, Cow<'_, str>)>> {
        Screen { lines: lines(text), objects, line: Vec::new(), at: 0 }
    }
}

impl<'a, L: Iterator<Item = (usize, Cow<'a, str>)>> BufRead for Screen<L> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        while self.at == self.line.len() {
            let Some((_, line)) = self.lines.next() else { break };
            self.at = 0;
            self.line.clear();
            match Line::of(&line) {
                Line::Vertex(vertex) => {
                    self.line.push(b'v');
                    for number in coordinates(vertex) {
                        self.line.push(b' ');
                        self.line.extend_from_slice(number.as_bytes());
                    }
                    self.line.push(b'\n');
                }
                Line::Face(face) => self.line.extend_from_slice(format!("f {face}\n").as_bytes()),
                Line::Object(name) if self.objects == Objects::Named => {
                    self.line.extend_from_slice(format!("o {name}\n").as_bytes());
                }
                Line::Object(_) | Line::Other => {}
            }
        }
        Ok(&self.line[self.at..])
    }

    fn consume(&mut self, bytes: usize) {
        self.at += bytes;
    }
}

impl<'a, L: Iterator<Item = (usize, Cow<'a, str>)>> Read for Screen<L> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.fill_buf()?.read(buffer)?;
        self.consume(read);
        Ok(read)
    }
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
        fault.map(|fault| Error::Malformed(format!("{}:{number}: {fault}", path.display())))
    })
}

fn vertex_fault(vertex: &str) -> Option<String> {
    let words: Vec<&str> = coordinates(vertex).collect();
    if words.len() < 3 {
        return Some(format!("vertex has {} coordinates, it needs 3; is the file cut off?", words.len()));
    }
    let mut numbers = Vec::new();
    for word in &words {
        match word.parse::<f32>() {
            Ok(number) => numbers.push(number),
            Err(_) => return Some(format!("{word:?} is not a number; repair or export the file again")),
        }
    }
    let weight = numbers.get(3).copied().unwrap_or(1.0);
    let finite =
        weight != 0.0 && numbers.iter().all(|n| n.is_finite()) && numbers.iter().all(|n| (n / weight).is_finite());
    (!finite).then(|| {
        let written = words.join(", ");
        format!("vertex ({written}) is not finite, every coordinate must be; repair or export the file again")
    })
}

/// `before` vertices stand above the face, `vertices` in the whole file.
fn face_fault(face: &str, before: usize, vertices: usize) -> Option<String> {
    let mut corners = 0;
    for corner in face.split_whitespace() {
        corners += 1;
        let mut parts = corner.split('/');
        let position = parts.next().unwrap_or_default();
        if parts.clone().count() > 2 || !parts.all(|part| part.is_empty() || part.parse::<isize>().is_ok()) {
            return Some(format!("{corner:?} is not a vertex of a face; repair or export the file again"));
        }
        match position.parse::<i64>() {
            Err(_) => return Some(format!("{corner:?} is not a vertex of a face; repair or export the file again")),
            Ok(0) => return Some("face names vertex 0, vertices count from 1; add 1 to every index".into()),
            Ok(index) if index > vertices as i64 => {
                return Some(format!("face names vertex {index}, the file has {vertices}; is it cut off?"));
            }
            Ok(index) if index < -(before as i64) => {
                return Some(format!(
                    "face names vertex {index}, above it are {before}; is the head of the file missing?"
                ));
            }
            Ok(_) => {}
        }
    }
    let needs = "a face needs at least 3; remove it (points and lines are `p` and `l`), or is the file cut off?";
    (corners < 3).then(|| format!("face has {corners} vertices, {needs}"))
}
