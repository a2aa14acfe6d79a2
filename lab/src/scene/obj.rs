//! Wavefront OBJ: the lines `v`, `f` and `o`; all others make no triangle.
//!
//! No crate reads it, for those that do name no line where a file breaks a rule, and fail on what does not matter here (a normal
//! out of range, colours on some vertices only, Latin-1 in a comment).

use super::{LoadOptions, Mesh, source};
use crate::{Error, Result};
use std::borrow::Cow;
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
    let mut reading = Reading {
        vertices: lines(&text).filter(|(_, line)| split(line).0 == "v").count(),
        positions: Vec::new(),
        objects: vec![(UNNAMED.into(), Vec::new())],
    };
    for (number, line) in lines(&text) {
        let fault = |what: String| Error::Malformed(format!("{}:{number}: {what}", path.display()));
        reading.line(&line, objects).map_err(fault)?;
    }
    Ok(reading.meshes())
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

/// The keyword of a line, and what is behind it.
fn split(line: &str) -> (&str, &str) {
    let line = line.trim_start();
    line.split_once(char::is_whitespace).unwrap_or((line, ""))
}

/// What an object without a name is called.
const UNNAMED: &str = "unnamed_object";

/// A file while its lines are read.
struct Reading {
    /// Of the whole file: faces may name vertices that follow.
    vertices: usize,
    positions: Vec<[f32; 3]>,
    objects: Vec<(String, Vec<[u32; 3]>)>,
}

impl Reading {
    /// The error says what is wrong, not where.
    fn line(&mut self, line: &str, objects: Objects) -> Result<(), String> {
        let (keyword, rest) = split(line);
        let numbers = || rest.split_once('#').map_or(rest, |(before, _)| before).split_whitespace();
        match keyword {
            "v" => self.positions.push(vertex(numbers().collect())?),
            "f" => {
                let corners = numbers().map(|word| self.corner(word)).collect::<Result<Vec<u32>, String>>()?;
                let [first, fan @ ..] = &corners[..] else { return Err(too_few(0)) };
                if fan.len() < 2 {
                    return Err(too_few(corners.len()));
                }
                // Polygons are fanned out from their first vertex.
                let (_, triangles) = self.objects.last_mut().expect("there is one from the beginning");
                triangles.extend(fan.windows(2).map(|edge| [*first, edge[0], edge[1]]));
            }
            "o" if objects == Objects::Named => {
                // One without a face is none.
                self.objects.pop_if(|(_, triangles)| triangles.is_empty());
                let name = if rest.trim().is_empty() { UNNAMED } else { rest.trim() };
                self.objects.push((name.to_owned(), Vec::new()));
            }
            _ => {}
        }
        Ok(())
    }

    /// The vertex that a corner of a face names.
    fn corner(&self, word: &str) -> Result<u32, String> {
        let wrong = || format!("{word:?} is not a vertex of a face; repair or export the file again");
        let (before, vertices) = (self.positions.len() as i64, self.vertices as i64);
        let mut parts = word.split('/');
        let index: i64 = parts.next().unwrap_or_default().parse().map_err(|_| wrong())?;
        if parts.clone().count() > 2 || !parts.all(|part| part.is_empty() || part.parse::<isize>().is_ok()) {
            return Err(wrong());
        }
        match index {
            0 => Err("face names vertex 0, vertices count from 1; add 1 to every index".into()),
            _ if index > vertices => Err(format!("face names vertex {index}, the file has {vertices}; is it cut off?")),
            _ if index < -before => {
                Err(format!("face names vertex {index}, above it are {before}; is the head of the file missing?"))
            }
            1.. => Ok((index - 1) as u32),
            _ => Ok((before + index) as u32),
        }
    }

    /// Each object with the vertices that it uses, in the order in which it does.
    fn meshes(self) -> Vec<(String, Mesh)> {
        const UNUSED: u32 = u32::MAX;
        let mut new_indices = vec![UNUSED; self.positions.len()];
        let mesh = |(name, mut triangles): (String, Vec<[u32; 3]>)| {
            let mut used = Vec::new();
            for corner in triangles.iter_mut().flatten() {
                let new = &mut new_indices[*corner as usize];
                if *new == UNUSED {
                    *new = used.len() as u32;
                    used.push(*corner as usize);
                }
                *corner = *new;
            }
            used.iter().for_each(|&old| new_indices[old] = UNUSED);
            let positions = used.into_iter().map(|old| self.positions[old]).collect();
            (name, Mesh { positions, triangles })
        };
        self.objects.into_iter().map(mesh).collect()
    }
}

/// The position of a vertex line. With exactly one number more, that is a weight; more than that are colours.
fn vertex(mut words: Vec<&str>) -> Result<[f32; 3], String> {
    words.truncate(if words.len() == 4 { 4 } else { 3 });
    if words.len() < 3 {
        return Err(format!("vertex has {} coordinates, it needs 3; is the file cut off?", words.len()));
    }
    let mut numbers = [1.0_f32; 4];
    for (number, word) in numbers.iter_mut().zip(&words) {
        *number = word.parse().map_err(|_| format!("{word:?} is not a number; repair or export the file again"))?;
    }
    let [x, y, z, weight] = numbers;
    let position = [x, y, z].map(|coordinate| coordinate / weight);
    if weight == 0.0 || !numbers.iter().chain(&position).all(|n| n.is_finite()) {
        let written = words.join(", ");
        return Err(format!(
            "vertex ({written}) is not finite, every coordinate must be; repair or export the file again"
        ));
    }
    Ok(position)
}

fn too_few(corners: usize) -> String {
    let needs = "a face needs at least 3; remove it (points and lines are `p` and `l`), or is the file cut off?";
    format!("face has {corners} vertices, {needs}")
}
