//! glTF 2.0 and GLB: the triangles of the default scene with their nodes' transforms applied, the first perspective camera,
//! the lights of KHR_lights_punctual, and the animations. Materials and skins are left alone.
//!
//! Every node that an animation moves, by itself or by a node above it, and every one whose weights are animated, is a dynamic
//! object with all primitives of its mesh; the others are static.

mod channels;
mod meshes;
mod nodes;

use super::check::malformed;
use super::dynamic::{DynamicContent, DynamicScene};
use super::{Content, LoadOptions, Scene, source};
use crate::Result;
use channels::Channels;
use gltf::accessor::{DataType, Dimensions};
use gltf::json::validation::Checked;
use gltf::{Accessor, Document, Semantic, buffer};
use std::path::Path;

/// Frames a second: a file has keys, at any times, and says nothing of frames.
const FRAME_RATE: f32 = 24.0;

/// Reads a `.gltf` or `.glb` file; buffers in files of their own lie beside it. What moves stands where it is at time 0, behind
/// what does not.
pub(super) fn read_at_rest(path: &Path, options: &LoadOptions<'_>) -> Result<Content> {
    let content = read(path, options)?;
    if content.objects.is_empty() {
        let camera = content.camera.map(|camera| camera.at(0.0));
        return Ok(Content { mesh: content.static_mesh, camera, lights: content.lights });
    }
    let Scene { mesh, camera, lights, .. } = content.into_scene(path)?.at(0.0)?;
    Ok(Content { mesh, camera: Some(camera), lights })
}

/// Reads a `.gltf` or `.glb` file with its animations, all at once and over and over.
pub(super) fn read(path: &Path, options: &LoadOptions<'_>) -> Result<DynamicContent> {
    let bytes = source::bytes(path, options)?;
    let unreadable = |error: gltf::Error| {
        let text = error.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
        let what = format_args!("{text}; is it cut off, or made for a newer glTF? export it again");
        malformed(path.display(), what)
    };
    let file = gltf::Gltf::from_slice_without_validation(&bytes).map_err(unreadable)?;
    positions_are_there(path, file.document.as_json())?;
    let document = Document::from_json(file.document.into_json()).map_err(unreadable)?;
    for buffer in document.buffers() {
        if let buffer::Source::Uri(uri) = buffer.source()
            && !is_utf8_when_decoded(uri)
        {
            let what = format_args!("buffer {} has a name that is not UTF-8: {uri}", buffer.index());
            return Err(malformed(path.display(), what));
        }
    }
    let buffers = gltf::import_buffers(&document, path.parent(), file.blob).map_err(unreadable)?;
    let file = File { path, document: &document, buffers: &buffers };
    let channels = Channels::read(file)?;
    let (frames, seconds) = ((channels.seconds() * FRAME_RATE).round().max(1.0), channels.seconds());
    if frames > DynamicScene::MOST_FRAMES as f32 {
        let most = DynamicScene::MOST_FRAMES as f32 / FRAME_RATE;
        let what = format_args!("its animations last {seconds} s, there may be {most} s; cut them");
        return Err(malformed(path.display(), what));
    }
    nodes::walk(file, &channels, DynamicContent { frames: frames as u32, seconds, ..DynamicContent::default() })
}

/// A document and the bytes of its buffers.
#[derive(Clone, Copy)]
struct File<'a> {
    path: &'a Path,
    document: &'a Document,
    buffers: &'a [buffer::Data],
}

/// What an accessor that is too long is told.
const CUT_OFF: &str = "reaches beyond the end of its buffer; is it cut off?";

impl<'a> File<'a> {
    fn bytes(self, buffer: gltf::Buffer<'_>) -> Option<&'a [u8]> {
        self.buffers.get(buffer.index()).map(|data| data.0.as_slice())
    }
}

/// The crate's validation looks into the accessor of the positions before it knows that there is one.
fn positions_are_there(path: &Path, json: &gltf::json::Root) -> Result<()> {
    for (mesh, primitives) in json.meshes.iter().map(|m| &m.primitives).enumerate() {
        for (primitive, attributes) in primitives.iter().map(|p| &p.attributes).enumerate() {
            let accessor = attributes.get(&Checked::Valid(Semantic::Positions)).map(|index| index.value());
            if let Some(accessor) = accessor.filter(|&a| a >= json.accessors.len()) {
                let place = format_args!("{}: mesh {mesh}, primitive {primitive}", path.display());
                let there = json.accessors.len();
                let what = format_args!("names accessor {accessor}, the file has {there}; is it cut off?");
                return Err(malformed(place, what));
            }
        }
    }
    Ok(())
}

fn has_type(accessor: &Accessor<'_>, dimensions: Dimensions, types: &[DataType]) -> bool {
    accessor.dimensions() == dimensions && types.contains(&accessor.data_type())
}

/// The crate decodes %-escapes in file names and takes it for granted that UTF-8 comes out.
fn is_utf8_when_decoded(uri: &str) -> bool {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let [first, others @ ..] = rest {
        let escaped = others.first_chunk().filter(|_| *first == b'%').and_then(|digits: &[u8; 2]| {
            let [high, low] = digits.map(|digit| char::from(digit).to_digit(16));
            Some((16 * high? + low?) as u8)
        });
        bytes.push(escaped.unwrap_or(*first));
        rest = if escaped.is_some() { &others[2..] } else { others };
    }
    std::str::from_utf8(&bytes).is_ok()
}
