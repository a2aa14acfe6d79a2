//! The rules that every mesh from a file must keep; degenerate, duplicate and huge triangles are legal.
//!
//! `place` is the file, or the part of it in which the items are counted (`scene.glb: mesh 2, primitive 0`).

use crate::{Error, Result};
use std::fmt::Display;

/// Every vertex is finite.
pub(super) fn vertices_are_finite(place: impl Display, positions: &[[f32; 3]]) -> Result<()> {
    match positions.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
        None => Ok(()),
        Some(vertex) => {
            let [x, y, z] = positions[vertex];
            Err(Error::Malformed(format!(
                "{place}: vertex {vertex} (from 0) is ({x}, {y}, {z}), every coordinate must be finite; repair or export it \
                 again"
            )))
        }
    }
}

/// Every index names a vertex.
pub(super) fn indices_are_in_range(place: impl Display, triangles: &[[u32; 3]], vertices: usize) -> Result<()> {
    match triangles.iter().position(|t| t.iter().any(|&v| v as usize >= vertices)) {
        None => Ok(()),
        Some(triangle) => {
            let wrong = triangles[triangle].into_iter().max().unwrap_or_default();
            Err(Error::Malformed(format!(
                "{place}: triangle {triangle} names vertex {wrong} (both from 0), there are {vertices}; is it cut off?"
            )))
        }
    }
}

/// Vertices can be named by 32 bits.
pub(super) fn vertices_can_be_counted(place: impl Display, vertices: usize) -> Result<()> {
    if u32::try_from(vertices).is_ok() {
        return Ok(());
    }
    Err(Error::Scene(format!(
        "{place}: {vertices} vertices, an index of 32 bits names {}; take a part of it",
        u32::MAX
    )))
}
