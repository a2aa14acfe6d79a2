//! The triangles of a mesh, and where its morph targets move them.

use super::{CUT_OFF, File, has_type};
use crate::Result;
use crate::scene::check::{self, malformed};
use crate::scene::{Mesh, fan};
use gltf::accessor::{DataType, Dimensions, Iter};
use gltf::mesh::Mode;
use gltf::{Primitive, Semantic};

/// The triangles of a primitive.
pub(super) struct Part {
    /// The file, the mesh and the primitive.
    pub place: String,
    pub mesh: Mesh,
    /// How far each morph target moves the vertices.
    pub targets: Vec<Vec<[f32; 3]>>,
}

/// The primitives of a mesh that have triangles.
pub(super) fn parts(file: File<'_>, mesh: &gltf::Mesh<'_>) -> Result<Vec<Part>> {
    mesh.primitives().filter_map(|primitive| part(file, mesh, &primitive).transpose()).collect()
}

fn part(file: File<'_>, mesh: &gltf::Mesh<'_>, primitive: &Primitive<'_>) -> Result<Option<Part>> {
    let place = format!("{}: mesh {}, primitive {}", file.path.display(), mesh.index(), primitive.index());
    let wrong = |what: &str| malformed(&place, what);
    if !matches!(primitive.mode(), Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
        return Ok(None);
    }
    let Some(accessor) = primitive.get(&Semantic::Positions).filter(|a| a.count() > 0) else { return Ok(None) };
    if !has_type(&accessor, Dimensions::Vec3, &[DataType::F32]) {
        return Err(wrong("positions are not three 32-bit floats; export it without quantisation"));
    }
    let reader = primitive.reader(|buffer| file.bytes(buffer));
    let positions: Vec<[f32; 3]> = reader.read_positions().ok_or_else(|| wrong(CUT_OFF))?.collect();
    check::vertices_are_finite(&place, &positions)?;
    let indices: Vec<u32> = match primitive.indices() {
        None => (0..positions.len() as u32).collect(),
        Some(accessor) if accessor.count() == 0 => Vec::new(),
        Some(accessor) => {
            if !has_type(&accessor, Dimensions::Scalar, &[DataType::U8, DataType::U16, DataType::U32]) {
                return Err(wrong("indices are not unsigned integers; export it again"));
            }
            reader.read_indices().ok_or_else(|| wrong(CUT_OFF))?.into_u32().collect()
        }
    };
    let triangles: Vec<[u32; 3]> = match (primitive.mode(), indices.as_chunks()) {
        (Mode::TriangleFan, _) => fan(&indices).into_iter().flatten().collect(),
        (Mode::TriangleStrip, _) => {
            // Every second triangle of a strip is turned round.
            let turned = |(t, v): (usize, &[u32])| [v[0], v[1 + t % 2], v[2 - t % 2]];
            indices.windows(3).enumerate().map(turned).collect()
        }
        (_, (whole, [])) => whole.to_vec(),
        _ => return Err(wrong(&format!("{} indices make no whole triangles; is it cut off?", indices.len()))),
    };
    check::indices_are_in_range(&place, &triangles, positions.len())?;
    let mut targets = Vec::new();
    for (target, accessor) in primitive.morph_targets().map(|target| target.positions()).enumerate() {
        let place = format!("{place}, target {target}");
        let Some(accessor) = accessor else {
            targets.push(vec![[0.0; 3]; positions.len()]);
            continue;
        };
        if !has_type(&accessor, Dimensions::Vec3, &[DataType::F32]) || accessor.count() != positions.len() {
            return Err(malformed(place, "not three 32-bit floats for each vertex; export it again"));
        }
        let moves = Iter::new(accessor, |buffer| file.bytes(buffer)).ok_or_else(|| malformed(&place, CUT_OFF))?;
        let moves: Vec<[f32; 3]> = moves.collect();
        check::vertices_are_finite(&place, &moves)?;
        targets.push(moves);
    }
    Ok(Some(Part { place, mesh: Mesh { positions, triangles }, targets }))
}
