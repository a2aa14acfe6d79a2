//! Matrices of instances.
#![allow(missing_docs, reason = "names and types say it all: groups and tests are the only readers")]

use crate::random::SplitMix64;

pub type Matrix = [[f32; 4]; 3];

/// A rotation about an axis and by an angle, both from the number.
pub fn rotation(number: u64) -> Matrix {
    let mut random = SplitMix64::new(1000 + number);
    let axis = random.around(1.0).map(f64::from);
    let length = axis.iter().map(|x| x * x).sum::<f64>().sqrt();
    let [x, y, z] = axis.map(|a| a / length);
    let (s, c) = (3.0 * f64::from(random.signed())).sin_cos();
    let d = 1.0 - c;
    let rows = [
        [c + x * x * d, x * y * d - z * s, x * z * d + y * s],
        [y * x * d + z * s, c + y * y * d, y * z * d - x * s],
        [z * x * d - y * s, z * y * d + x * s, c + z * z * d],
    ];
    rows.map(|[a, b, c]| [a as f32, b as f32, c as f32, 0.0])
}

/// The matrix after a scale of the object's axes.
pub fn scaled(m: Matrix, by: [f32; 3]) -> Matrix {
    m.map(|[a, b, c, d]| [a * by[0], b * by[1], c * by[2], d])
}

/// The matrix with its object moved to `to`.
pub fn moved(m: Matrix, to: [f32; 3]) -> Matrix {
    std::array::from_fn(|k| [m[k][0], m[k][1], m[k][2], to[k]])
}
