//! glTF 2.0 and GLB: the triangles of the default scene with their nodes' transforms applied, the first perspective camera,
//! and the lights of KHR_lights_punctual. Materials, skins and animations are left alone.

use super::{Camera, Content, Light, LoadOptions, Mesh, check, source};
use crate::{Error, Result};
use glam::{Mat4, Vec3};
use gltf::accessor::{DataType, Dimensions};
use gltf::json::extensions::scene::khr_lights_punctual::Type as LightType;
use gltf::json::validation::Checked;
use gltf::mesh::Mode;
use gltf::{Accessor, Document, Node, Primitive, Semantic, buffer};
use std::collections::HashSet;
use std::path::Path;

/// Reads a `.gltf` or `.glb` file; buffers in files of their own lie beside it.
pub(super) fn read(path: &Path, options: &LoadOptions<'_>) -> Result<Content> {
    let bytes = source::bytes(path, options)?;
    let file = gltf::Gltf::from_slice_without_validation(&bytes).map_err(|e| malformed(path, one_line(&e)))?;
    positions_are_there(path, file.document.as_json())?;
    let document = Document::from_json(file.document.into_json()).map_err(|e| malformed(path, one_line(&e)))?;
    for buffer in document.buffers() {
        if let buffer::Source::Uri(uri) = buffer.source()
            && !is_utf8_when_decoded(uri)
        {
            return Err(malformed(path, format!("buffer {} has a name that is not UTF-8: {uri}", buffer.index())));
        }
    }
    let buffers =
        gltf::import_buffers(&document, path.parent(), file.blob).map_err(|e| malformed(path, one_line(&e)))?;
    let mut flat =
        Flat { path, document: &document, buffers: &buffers, content: Content::default(), directional: vec![] };
    flat.nodes()?;
    let Flat { mut content, directional, .. } = flat;
    let bounds = content.mesh.bounds();
    content.lights.extend(directional.into_iter().map(|towards| {
        let far = Vec3::from(bounds.centroid()) - towards * (10.0 * bounds.diagonal());
        point_light(far)
    }));
    content.lights.retain(|light| light.corner.iter().all(|c| c.is_finite()));
    Ok(content)
}

/// The scene while its nodes are walked.
struct Flat<'a> {
    path: &'a Path,
    document: &'a Document,
    buffers: &'a [buffer::Data],
    content: Content,
    /// Where directional lights shine to; they get a place when the box of the scene is known.
    directional: Vec<Vec3>,
}

impl Flat<'_> {
    /// Walks the default scene, else the first; a file without scenes is a library of which we take every root.
    fn nodes(&mut self) -> Result<()> {
        let document = self.document;
        let roots: Vec<Node<'_>> = match document.default_scene().or_else(|| document.scenes().next()) {
            Some(scene) => scene.nodes().collect(),
            None => {
                let children: HashSet<usize> = document.nodes().flat_map(|n| n.children().map(|c| c.index())).collect();
                document.nodes().filter(|n| !children.contains(&n.index())).collect()
            }
        };
        let mut seen = vec![false; document.nodes().len()];
        // A stack of our own: the depth of the tree is the file's choice.
        let mut stack: Vec<_> = roots.into_iter().rev().map(|node| (node, Mat4::IDENTITY)).collect();
        while let Some((node, parent)) = stack.pop() {
            if std::mem::replace(&mut seen[node.index()], true) {
                let what = format!("node {} has two parents, or is its own; export it again", node.index());
                return Err(malformed(self.path, what));
            }
            let to_world = parent * Mat4::from_cols_array_2d(&node.transform().matrix());
            self.node(&node, &to_world)?;
            let children: Vec<_> = node.children().collect();
            stack.extend(children.into_iter().rev().map(|child| (child, to_world)));
        }
        Ok(())
    }

    fn node(&mut self, node: &Node<'_>, to_world: &Mat4) -> Result<()> {
        if let Some(mesh) = node.mesh() {
            for primitive in mesh.primitives() {
                self.primitive(mesh.index(), &primitive, to_world)?;
            }
        }
        let (eye, backwards) = (to_world.w_axis.truncate(), to_world.z_axis.truncate().normalize_or_zero());
        if self.content.camera.is_none()
            && let Some(camera) = node.camera()
            && let gltf::camera::Projection::Perspective(lens) = camera.projection()
            && backwards != Vec3::ZERO
            && eye.is_finite()
        {
            let (look, up) = ((eye - backwards).into(), to_world.y_axis.truncate().normalize_or(Vec3::Y).into());
            self.content.camera = Some(Camera { eye: eye.into(), look, up, fov: lens.yfov().to_degrees() });
        }
        match node.light().map(|light| self.light_type(light.index())) {
            Some(LightType::Directional) => self.directional.push(-backwards),
            Some(LightType::Point | LightType::Spot) => self.content.lights.push(point_light(eye)),
            None => {}
        }
        Ok(())
    }

    /// The crate's own `kind()` panics on a spot light without its angles.
    fn light_type(&self, light: usize) -> LightType {
        let lights = self.document.as_json().extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref());
        match lights.and_then(|l| l.lights.get(light)).map(|l| &l.type_) {
            Some(Checked::Valid(kind)) => *kind,
            _ => LightType::Point,
        }
    }

    fn primitive(&mut self, mesh: usize, primitive: &Primitive<'_>, to_world: &Mat4) -> Result<()> {
        let place = format!("{}: mesh {mesh}, primitive {}", self.path.display(), primitive.index());
        let wrong = |what: &str| Err(Error::Malformed(format!("{place}: {what}")));
        let fans: fn(usize, &[u32]) -> [u32; 3] = match primitive.mode() {
            Mode::Triangles => |t, v| [v[3 * t], v[3 * t + 1], v[3 * t + 2]],
            // Every second triangle of a strip is turned round.
            Mode::TriangleStrip => |t, v| [v[t], v[t + 1 + t % 2], v[t + 2 - t % 2]],
            Mode::TriangleFan => |t, v| [v[0], v[t + 1], v[t + 2]],
            _ => return Ok(()),
        };
        let Some(accessor) = primitive.get(&Semantic::Positions).filter(|a| a.count() > 0) else { return Ok(()) };
        if !has_type(&accessor, Dimensions::Vec3, &[DataType::F32]) {
            return wrong("positions are not three 32-bit floats; export it without quantisation");
        }
        let reader = primitive.reader(|buffer| self.buffers.get(buffer.index()).map(|data| data.0.as_slice()));
        let cut_off = "reaches beyond the end of its buffer; is it cut off?";
        let Some(positions) = reader.read_positions() else { return wrong(cut_off) };
        let positions: Vec<[f32; 3]> = positions.collect();
        check::vertices_are_finite(&place, &positions)?;
        let indices: Vec<u32> = match primitive.indices() {
            None => (0..positions.len() as u32).collect(),
            Some(accessor) if accessor.count() == 0 => Vec::new(),
            Some(accessor) => {
                if !has_type(&accessor, Dimensions::Scalar, &[DataType::U8, DataType::U16, DataType::U32]) {
                    return wrong("indices are not unsigned integers; export it again");
                }
                let Some(indices) = reader.read_indices() else { return wrong(cut_off) };
                indices.into_u32().collect()
            }
        };
        let count = match primitive.mode() {
            Mode::Triangles if !indices.len().is_multiple_of(3) => {
                return wrong(&format!("{} indices make no whole triangles; is it cut off?", indices.len()));
            }
            Mode::Triangles => indices.len() / 3,
            _ => indices.len().saturating_sub(2),
        };
        let triangles: Vec<[u32; 3]> = (0..count).map(|t| fans(t, &indices)).collect();
        check::indices_are_in_range(&place, &triangles, positions.len())?;
        self.append(&place, &Mesh { positions, triangles }, to_world)
    }

    fn append(&mut self, place: &str, part: &Mesh, to_world: &Mat4) -> Result<()> {
        let mesh = &mut self.content.mesh;
        let first = mesh.positions.len();
        check::vertices_can_be_counted(place, first + part.positions.len())?;
        mesh.positions.extend(part.positions.iter().map(|&p| to_world.transform_point3(p.into()).to_array()));
        check::vertices_are_finite(format!("{place}, placed by its node"), &mesh.positions[first..])?;
        mesh.triangles.extend(part.triangles.iter().map(|t| t.map(|v| v + first as u32)));
        Ok(())
    }
}

/// The crate's validation looks into the accessor of the positions before it knows that there is one.
fn positions_are_there(path: &Path, json: &gltf::json::Root) -> Result<()> {
    for (mesh, primitives) in json.meshes.iter().map(|m| &m.primitives).enumerate() {
        for (primitive, attributes) in primitives.iter().map(|p| &p.attributes).enumerate() {
            let accessor = attributes.get(&Checked::Valid(Semantic::Positions)).map(|index| index.value());
            if let Some(accessor) = accessor.filter(|&a| a >= json.accessors.len()) {
                let what = format!("names accessor {accessor}, the file has {}; is it cut off?", json.accessors.len());
                return Err(malformed(path, format!("mesh {mesh}, primitive {primitive}: {what}")));
            }
        }
    }
    Ok(())
}

fn has_type(accessor: &Accessor<'_>, dimensions: Dimensions, types: &[DataType]) -> bool {
    accessor.dimensions() == dimensions && types.contains(&accessor.data_type())
}

fn point_light(corner: Vec3) -> Light {
    Light { corner: corner.into(), edges: [[0.0; 3]; 2] }
}

/// The crate decodes %-escapes in file names and takes it for granted that UTF-8 comes out.
fn is_utf8_when_decoded(uri: &str) -> bool {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let [first, others @ ..] = rest {
        let escaped = match rest {
            [b'%', a, b, ..] => [*a, *b].map(|digit| char::from(digit).to_digit(16)),
            _ => [None; 2],
        };
        if let [Some(high), Some(low)] = escaped {
            bytes.push((16 * high + low) as u8);
            rest = &others[2..];
        } else {
            bytes.push(*first);
            rest = others;
        }
    }
    std::str::from_utf8(&bytes).is_ok()
}

fn one_line(error: &gltf::Error) -> String {
    let text = error.to_string();
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    format!("{text}; is it cut off, or made for a newer glTF? export it again")
}

fn malformed(path: &Path, what: String) -> Error {
    Error::Malformed(format!("{}: {what}", path.display()))
}
