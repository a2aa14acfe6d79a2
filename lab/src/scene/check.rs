//! The rules that every mesh from a file must keep; degenerate, duplicate and huge triangles are legal.
//!
//! `place` is the file, or the part of it in which the items are counted (`scene.glb: mesh 2, primitive 0`).

use super::Mesh;
use crate::{Error, Result};
use std::fmt::Display;
use std::path::Path;

/// What is wrong with a file, or with a part of it.
pub(super) fn malformed(place: impl Display, what: impl Display) -> Error {
    Error::Malformed(format!("{place}: {what}"))
}

/// Every vertex is finite.
pub(super) fn vertices_are_finite(place: impl Display, positions: &[[f32; 3]]) -> Result<()> {
    let Some(vertex) = positions.iter().position(|p| !p.iter().all(|c| c.is_finite())) else { return Ok(()) };
    let [x, y, z] = positions[vertex];
    let remedy = "every coordinate must be finite; repair or export it again";
    Err(malformed(place, format_args!("vertex {vertex} (from 0) is ({x}, {y}, {z}), {remedy}")))
}

/// Every index names a vertex.
pub(super) fn indices_are_in_range(place: impl Display, triangles: &[[u32; 3]], vertices: usize) -> Result<()> {
    let is_wrong = |triangle: &[u32; 3]| triangle.iter().any(|&v| v as usize >= vertices);
    let Some(triangle) = triangles.iter().position(is_wrong) else { return Ok(()) };
    let vertex = triangles[triangle].into_iter().max().unwrap_or_default();
    let named = format_args!("triangle {triangle} names vertex {vertex} (both from 0)");
    Err(malformed(place, format_args!("{named}, there are {vertices}; is it cut off?")))
}

/// The mesh, if it keeps both rules.
pub(super) fn checked(path: &Path, mesh: Mesh) -> Result<Mesh> {
    vertices_are_finite(path.display(), &mesh.positions)?;
    indices_are_in_range(path.display(), &mesh.triangles, mesh.positions.len())?;
    Ok(mesh)
}

/// Vertices can be named by 32 bits.
pub(super) fn vertices_can_be_counted(place: impl Display, vertices: usize) -> Result<()> {
    if u32::try_from(vertices).is_ok() {
        return Ok(());
    }
    let most = u32::MAX;
    Err(Error::Scene(format!("{place}: {vertices} vertices, an index of 32 bits names {most}; take a part of it")))
}
