//! PLY, ASCII and binary of either byte order, by ply-rs. Elements `vertex` (x, y, z) and `face` (vertex_indices or
//! vertex_index) of any number type; everything else is read over.

use super::check::{checked, malformed};
use super::{LoadOptions, Mesh, fan, source};
use crate::{Error, Result};
use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult};
use std::io::{BufRead, ErrorKind};
use std::path::Path;

/// Reads a PLY file.
pub(super) fn read(path: &Path, options: &LoadOptions<'_>) -> Result<Mesh> {
    let mut file = File { path, reader: Reader::new(source::open(path, options)?) };
    let header = Parser::<Skipped>::new().read_header(&mut file.reader).map_err(|e| file.error("the head", e))?;
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for element in header.elements.values() {
        match element.name.as_str() {
            "vertex" => {
                if let Some(axis) = ["x", "y", "z"].into_iter().find(|&axis| !element.properties.contains_key(axis)) {
                    let what = format_args!("vertices have no property {axis:?}; export it again");
                    return Err(malformed(path.display(), what));
                }
                file.elements(&header, element, |_, Vertex(position)| {
                    positions.push(position);
                    Ok(())
                })?;
            }
            "face" => {
                file.elements(&header, element, |face, Face(polygon)| {
                    let fan = fan(&polygon).ok_or_else(|| {
                        let has = format_args!("face {face} (from 0) has {} vertices", polygon.len());
                        let remedy = "a face needs at least 3; remove it or export it again";
                        malformed(path.display(), format_args!("{has}, {remedy}"))
                    })?;
                    triangles.extend(fan);
                    Ok(())
                })?;
            }
            _ => file.elements(&header, element, |_, Skipped| Ok(()))?,
        }
    }
    checked(path, Mesh { positions, triangles })
}

struct File<'a> {
    path: &'a Path,
    reader: Reader<Box<dyn BufRead + 'a>>,
}

impl File<'_> {
    /// Hands every item of an element on, one at a time where the encoding allows it.
    fn elements<E: PropertyAccess>(
        &mut self,
        header: &Header,
        element: &ElementDef,
        mut take: impl FnMut(usize, E) -> Result<()>,
    ) -> Result<()> {
        let parser = Parser::<E>::new();
        if header.encoding == Encoding::Ascii {
            // The parser counts lines only if it reads them all.
            let items = parser.read_payload_for_element(&mut self.reader, element, header);
            let items = items.map_err(|e| self.error(&format!("a {}", element.name), e))?;
            return items.into_iter().enumerate().try_for_each(|(item, value)| take(item, value));
        }
        for item in 0..element.count {
            let read = match header.encoding {
                Encoding::BinaryBigEndian => parser.read_big_endian_element(self.reader.get_mut(), element),
                _ => parser.read_little_endian_element(self.reader.get_mut(), element),
            };
            let place = || format!("{} {item} (from 0) of {}", element.name, element.count);
            take(item, read.map_err(|e| self.error(&place(), e))?)?;
        }
        Ok(())
    }

    fn error(&self, place: &str, error: ParseError) -> Error {
        if error.kind() == ErrorKind::UnexpectedEof {
            return malformed(self.path.display(), format_args!("ends before {place}; is it cut off?"));
        }
        let line = error.line();
        let text = error.to_string();
        let field = |name: &str| text.lines().filter_map(|l| l.trim().strip_prefix(name)).next_back();
        let first = text.lines().next().unwrap_or_default();
        let first = first.strip_prefix("Line ").and_then(|rest| rest.split_once(": ")).map_or(first, |(_, what)| what);
        let what = match (field("String: '"), field("Error: ")) {
            // What the grammar expected instead does not help people.
            (Some(row), Some(why)) if why.contains("expected one of") => {
                format!("{:?} cannot be read, numbers must be finite", row.trim_end_matches('\''))
            }
            (_, why) => why.unwrap_or(first).trim_end_matches('.').to_owned(),
        };
        match line {
            Some(line) => {
                let at = format_args!("{}:{line}: {place}", self.path.display());
                malformed(at, format_args!("{what}; is it cut off? repair or export it again"))
            }
            None => source::read_error(self.path, std::io::Error::new(error.kind(), format!("{place}: {what}"))),
        }
    }
}

/// An item that we read over.
struct Skipped;

impl PropertyAccess for Skipped {
    fn new() -> Skipped {
        Skipped
    }
}

struct Vertex([f32; 3]);

impl PropertyAccess for Vertex {
    fn new() -> Vertex {
        Vertex([f32::NAN; 3])
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        let Some(axis) = ["x", "y", "z"].iter().position(|&axis| axis == name) else {
            return PropertyAccessResult::Ignored;
        };
        let Some(value) = value.to_f32_lossy() else { return PropertyAccessResult::UnsupportedType };
        self.0[axis] = value;
        PropertyAccessResult::Set
    }
}

struct Face(Vec<u32>);

impl PropertyAccess for Face {
    fn new() -> Face {
        Face(Vec::new())
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        if !matches!(name, "vertex_indices" | "vertex_index") {
            return PropertyAccessResult::Ignored;
        }
        // A negative index is as far out of range as any.
        self.0 = match value {
            Property::ListChar(list) => list.into_iter().map(|v| u32::try_from(v).unwrap_or(u32::MAX)).collect(),
            Property::ListUChar(list) => list.into_iter().map(u32::from).collect(),
            Property::ListShort(list) => list.into_iter().map(|v| u32::try_from(v).unwrap_or(u32::MAX)).collect(),
            Property::ListUShort(list) => list.into_iter().map(u32::from).collect(),
            Property::ListInt(list) => list.into_iter().map(|v| u32::try_from(v).unwrap_or(u32::MAX)).collect(),
            Property::ListUInt(list) => list,
            _ => return PropertyAccessResult::UnsupportedType,
        };
        PropertyAccessResult::Set
    }
}
