//! A mesh from a binary PLY file, and the camera that `hedgerow render knot` has.

use crate::Result;

pub struct Mesh {
    pub positions: Vec<[f32; 3]>,
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// Reads what scenes/knot.ply holds: little-endian, three floats a vertex, triangles alone.
    pub fn read(path: &str) -> Result<Mesh> {
        let bytes = std::fs::read(path).map_err(|error| format!("{path}: {error}"))?;
        const END: &[u8] = b"end_header\n";
        let end = bytes.windows(END.len()).position(|w| w == END).ok_or("the file has no header of PLY")?;
        let (header, data) = (std::str::from_utf8(&bytes[..end])?, &bytes[end + END.len()..]);
        let count = |element: &str| -> Result<usize> {
            let line = header.lines().find_map(|line| line.strip_prefix(element));
            Ok(line.ok_or_else(|| format!("{path}: no line {element:?}"))?.trim().parse()?)
        };
        let (vertices, faces) = (count("element vertex")?, count("element face")?);
        let (vertex_bytes, face_bytes) = data.split_at_checked(12 * vertices).ok_or("the file is cut off")?;
        if face_bytes.len() != 13 * faces || face_bytes.chunks(13).any(|face| face[0] != 3) {
            return Err(format!("{path}: not all faces are triangles").into());
        }
        let word = |bytes: &[u8], i: usize| <[u8; 4]>::try_from(&bytes[4 * i..][..4]).expect("four bytes");
        let vertex = |v: &[u8]| std::array::from_fn(|i| f32::from_le_bytes(word(v, i)));
        let face = |f: &[u8]| std::array::from_fn(|i| u32::from_le_bytes(word(&f[1..], i)));
        let (positions, triangles) = (vertex_bytes.chunks(12).map(vertex), face_bytes.chunks(13).map(face));
        Ok(Mesh { positions: positions.collect(), triangles: triangles.collect() })
    }
}

/// Where the pixels of a picture lie in space.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Camera {
    eye: [f32; 3],
    /// From the eye to the picture's middle, and from there to its right and its upper edge.
    forward: [f32; 3],
    right: [f32; 3],
    up: [f32; 3],
}

impl Camera {
    /// That of the scene `knot` (lab/src/scene/cameras.rs).
    pub fn of_knot([width, height]: [u32; 2]) -> Camera {
        const EYE: [f64; 3] = [2.6, 4.6, 5.4];
        const LOOK: [f64; 3] = [0.0; 3];
        const UP: [f64; 3] = [0.0, 1.0, 0.0];
        const FIELD_OF_VIEW: f64 = 45.0;
        // Its numbers are floats before they are anything else.
        let eye = EYE.map(|x| f64::from(x as f32));
        let forward = unit(std::array::from_fn(|i| LOOK[i] - eye[i]));
        let right = unit(cross(forward, UP));
        let up = cross(right, forward);
        let half_height = (FIELD_OF_VIEW.to_radians() / 2.0).tan();
        let half_width = half_height * f64::from(width) / f64::from(height);
        let scaled = |a: [f64; 3], by: f64| a.map(|x| (x * by) as f32);
        Camera {
            eye: scaled(eye, 1.0),
            forward: scaled(forward, 1.0),
            right: scaled(right, half_width),
            up: scaled(up, half_height),
        }
    }
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(a: [f64; 3]) -> [f64; 3] {
    let length = a.iter().map(|x| x * x).sum::<f64>().sqrt();
    a.map(|x| x / length)
}
