//! The rules that every mesh from a file must keep; degenerate, duplicate and huge triangles are legal.

use crate::{Error, Result};
use std::path::Path;

/// Every vertex is finite.
pub(super) fn vertices_are_finite(path: &Path, positions: &[[f32; 3]]) -> Result<()> {
    match positions.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
        None => Ok(()),
        Some(vertex) => {
            let [x, y, z] = positions[vertex];
            Err(Error::Malformed(format!(
                "{}: vertex {vertex} (from 0) is ({x}, {y}, {z}), every coordinate must be finite; repair or export it again",
                path.display()
            )))
        }
    }
}

/// Every index names a vertex.
pub(super) fn indices_are_in_range(path: &Path, triangles: &[[u32; 3]], vertices: usize) -> Result<()> {
    match triangles.iter().position(|t| t.iter().any(|&v| v as usize >= vertices)) {
        None => Ok(()),
        Some(triangle) => {
            let wrong = triangles[triangle].into_iter().max().unwrap_or_default();
            Err(Error::Malformed(format!(
                "{}: triangle {triangle} names vertex {wrong} (both from 0), the file has {vertices}; is it cut off?",
                path.display()
            )))
        }
    }
}
