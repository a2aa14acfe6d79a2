//! Ray and hit files: headerless little-endian arrays (CONTRACT, "Ray files").

use crate::{Error, Result};
use bytemuck::Pod;
use hedgerow::trace::{Hit, Ray};
use std::path::Path;

/// Reads a ray file: 32 bytes a ray.
///
/// # Errors
/// The file cannot be read, or its length is not a multiple of 32.
pub fn read_rays(path: impl AsRef<Path>) -> Result<Vec<Ray>> {
    read(path.as_ref(), "rays", "f32 origin.xyz, t_min, direction.xyz, t_max")
}

/// Writes a ray file.
///
/// # Errors
/// The file cannot be written.
pub fn write_rays(path: impl AsRef<Path>, rays: &[Ray]) -> Result<()> {
    write(path.as_ref(), rays)
}

/// Reads a hit file: 16 bytes a ray.
///
/// # Errors
/// The file cannot be read, or its length is not a multiple of 16.
pub fn read_hits(path: impl AsRef<Path>) -> Result<Vec<Hit>> {
    read(path.as_ref(), "hits", "f32 t, u32 primitive index, f32 u, v")
}

/// Writes a hit file.
///
/// # Errors
/// The file cannot be written.
pub fn write_hits(path: impl AsRef<Path>, hits: &[Hit]) -> Result<()> {
    write(path.as_ref(), hits)
}

fn read<T: Pod>(path: &Path, what: &str, fields: &str) -> Result<Vec<T>> {
    let bytes = std::fs::read(path).map_err(Error::file(path))?;
    let each = size_of::<T>();
    if bytes.len() % each != 0 {
        let (path, whole) = (path.display(), bytes.len() / each);
        return Err(Error::Malformed(format!(
            "{path}: {} bytes are no whole number of {what} of {each} bytes ({fields}): {whole} fit; is it cut off, or not \
             a file of {what}?",
            bytes.len()
        )));
    }
    // Floats and words of both files are four bytes; a big-endian host turns each.
    let words: Vec<u32> = bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    Ok(bytemuck::pod_collect_to_vec(&words))
}

fn write<T: Pod>(path: &Path, items: &[T]) -> Result<()> {
    let words: &[u32] = bytemuck::cast_slice(items);
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    std::fs::write(path, bytes).map_err(Error::file(path))
}
