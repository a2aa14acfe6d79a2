//! `.tri` and `.anim`: headerless little-endian arrays, indices from 0.
//!
//! - `.tri`: `u32` vertex count V, `u32` triangle count T, V × 3 `f32`, T × 3 `u32`.
//! - `.anim`: `u32` V, `u32` T, `u32` frame count K, T × 3 `u32`, then K frames of V × 3 `f32`.

use super::check::{self, checked, malformed};
use super::{LoadOptions, Mesh, source};
use crate::{Error, Result};
use std::io::{BufRead, ErrorKind, Read};
use std::path::Path;

/// Reads a `.tri` file.
pub(super) fn read_tri(path: &Path, options: &LoadOptions<'_>) -> Result<Mesh> {
    let mut words = Words { path, reader: source::open(path, options)? };
    let [vertices, triangles] = words.head(["vertex count", "triangle count"])?;
    let positions = words.triples(vertices, "vertices", f32::from_bits)?;
    let triangles = words.triples(triangles, "triangles", |word| word)?;
    words.end("triangle")?;
    checked(path, Mesh { positions, triangles })
}

/// Reads the first frame of an `.anim` file.
pub(super) fn read_anim(path: &Path, options: &LoadOptions<'_>) -> Result<Mesh> {
    let mut words = Words { path, reader: source::open(path, options)? };
    let ([vertices, _], triangles) = words.anim_topology()?;
    let positions = words.triples(vertices, "vertices of the first frame", f32::from_bits)?;
    checked(path, Mesh { positions, triangles })
}

/// The triangles and the positions in each frame.
pub(super) type Frames = (Vec<[u32; 3]>, Vec<Vec<[f32; 3]>>);

/// Reads all frames of an `.anim` file.
pub(super) fn read_frames(path: &Path, options: &LoadOptions<'_>) -> Result<Frames> {
    let mut words = Words { path, reader: source::open(path, options)? };
    let ([vertices, count], triangles) = words.anim_topology()?;
    check::indices_are_in_range(path.display(), &triangles, vertices as usize)?;
    let mut frames = Vec::new();
    // Frames without vertices take no bytes: a wrong count of them would not be seen at the end of the file.
    for frame in 0..if vertices == 0 { 0 } else { count } {
        let place = format!("frame {frame} (from 0) of {count}");
        let positions = words.triples(vertices, &format!("vertices of {place}"), f32::from_bits)?;
        check::vertices_are_finite(format_args!("{}: {place}", path.display()), &positions)?;
        frames.push(positions);
    }
    words.end("frame")?;
    Ok((triangles, frames))
}

/// The words of a file, in order.
struct Words<'a> {
    path: &'a Path,
    reader: Box<dyn BufRead + 'a>,
}

impl Words<'_> {
    fn head<const N: usize>(&mut self, names: [&str; N]) -> Result<[u32; N]> {
        let mut words = [0; N];
        for (word, name) in words.iter_mut().zip(names) {
            let mut bytes = [0; 4];
            self.reader.read_exact(&mut bytes).map_err(|e| self.error(e, || format!("the {name}")))?;
            *word = u32::from_le_bytes(bytes);
        }
        Ok(words)
    }

    /// The head of an `.anim` file, as vertex count and frame count, and its triangles.
    fn anim_topology(&mut self) -> Result<([u32; 2], Vec<[u32; 3]>)> {
        let [vertices, triangles, frames] = self.head(["vertex count", "triangle count", "frame count"])?;
        if frames == 0 {
            return Err(malformed(self.path.display(), "no frames; an animation needs at least one"));
        }
        Ok(([vertices, frames], self.triples(triangles, "triangles", |word| word)?))
    }

    /// `count` triples of words. Memory grows with what is read, so that a wrong count in the head does not take it all.
    fn triples<T>(&mut self, count: u32, what: &str, value: impl Fn(u32) -> T) -> Result<Vec<[T; 3]>> {
        const AT_ONCE: usize = 1 << 16;
        let count = count as usize;
        let mut triples = Vec::with_capacity(count.min(AT_ONCE));
        let mut buffer = vec![[0_u32; 3]; count.min(AT_ONCE)];
        while triples.len() < count {
            let words = &mut buffer[..(count - triples.len()).min(AT_ONCE)];
            let read = self.reader.read_exact(bytemuck::cast_slice_mut(words));
            read.map_err(|e| self.error(e, || format!("its {count} {what} (after {} or more)", triples.len())))?;
            triples.extend(words.iter().map(|triple| triple.map(|word| value(u32::from_le(word)))));
        }
        triples.shrink_to_fit();
        Ok(triples)
    }

    /// Nothing may follow the `last` item.
    fn end(&mut self, last: &str) -> Result<()> {
        match self.reader.read(&mut [0]) {
            Ok(0) => Ok(()),
            Ok(_) => {
                let what = format_args!("goes on behind its last {last}; its counts are wrong, write it again");
                Err(malformed(self.path.display(), what))
            }
            Err(error) => Err(source::read_error(self.path, error)),
        }
    }

    fn error(&self, error: std::io::Error, what: impl Fn() -> String) -> Error {
        if error.kind() == ErrorKind::UnexpectedEof {
            malformed(self.path.display(), format_args!("ends before {}; is it cut off?", what()))
        } else {
            source::read_error(self.path, error)
        }
    }
}
