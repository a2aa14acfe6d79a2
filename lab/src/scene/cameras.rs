//! Where to look from: good places for scenes that many use, and a place that sees everything for the others.

use super::Camera;
use hedgerow::geometry::Aabb;

const Y: [f32; 3] = [0.0, 1.0, 0.0];
const Z: [f32; 3] = [0.0, 0.0, 1.0];

/// Scene (one that ends in a colon: all that begin so), eye, look-at, up and vertical field of view.
type KnownCamera = (&'static str, [f32; 3], [f32; 3], [f32; 3], f32);

const KNOWN: [KnownCamera; 26] = [
    ("pigman", [2.0, 2.0, 3.0], [0.0, 0.9, 0.0], Y, 40.0),
    ("knot", [2.6, 4.6, 5.4], [0.0, 0.0, 0.0], Y, 45.0),
    ("grass", [0.3, 0.6, 2.4], [0.0, 0.3, 0.0], Y, 60.0),
    ("pine_hill", [-38.0, 15.0, 44.0], [4.0, 9.0, -6.0], Y, 50.0),
    ("teapot", [0.0, 4.5, 9.0], [0.2, 1.4, 0.0], Y, 35.0),
    ("soldier_run", [1.6, 1.6, 3.0], [0.0, 0.9, 0.0], Y, 40.0),
    ("clocktower_twist", [4.0, 4.0, 6.0], [0.0, 2.7, 0.0], Y, 50.0),
    ("pigman_run", [2.0, 2.0, 3.0], [0.0, 0.9, 0.0], Y, 40.0),
    ("sponza", [-11.0, 4.0, 0.3], [2.0, 5.5, -0.3], Y, 65.0),
    ("bunny", [-0.02, 0.18, 0.42], [-0.02, 0.11, 0.0], Y, 30.0),
    ("armadillo", [0.3, 0.2, 2.0], [0.0, -0.05, 0.0], Y, 35.0),
    ("classroom", [-6.079, 0.764, -0.244], [3.862, -0.288, -0.498], Z, 60.0),
    ("samurai_monastery", [-30.0, 12.0, -50.0], [0.0, 6.0, 0.0], Y, 60.0),
    ("san_francisco", [-420.0, -300.0, 150.0], [100.0, 0.0, 20.0], Z, 60.0),
    ("terrain_jacksboro", [2000.0, 1900.0, 36_000.0], [14_000.0, 500.0, 16_000.0], Y, 50.0),
    ("motorbike", [3.0, -3.0, 1.8], [0.7, 0.0, 0.65], Z, 35.0),
    ("bunny_in_city", [36.2, -10.2, 15.8], [35.3, -9.6, 15.5], Z, 50.0),
    ("dragon", [-0.05, 0.2, 0.45], [-0.006, 0.125, 0.0], Y, 30.0),
    ("salle_de_bain", [4.443, 16.934, 49.910], [4.329, 16.821, 48.923], Y, 36.0),
    ("minecraft_region", [330.0, 190.0, 330.0], [128.0, 40.0, 128.0], Y, 50.0),
    ("country_kitchen", [1.211, 1.805, 3.852], [0.773, 1.763, 2.954], Y, 36.0),
    ("hair", [40.0, -110.0, 35.0], [0.0, -5.0, 20.0], Z, 50.0),
    ("forest", [60.0, 32.0, 60.0], [250.0, 12.0, 250.0], Y, 60.0),
    // The object on the floor, the stands behind it.
    ("gen:stadium:", [127.0, 3.0, -39.0], [123.0, 1.0, -45.0], Y, 50.0),
    // In the open corner of the room.
    ("gen:clutter:", [0.9, 0.6, 0.9], [-0.3, 0.25, -0.3], Y, 60.0),
    // In a street of the first plot, in the boxes of eleven blocks.
    ("gen:city:", [0.359, 0.06, -0.1], [0.359, 0.1, -0.35], Y, 60.0),
];

/// The camera of a scene that we know by name.
pub(super) fn known(name: &str) -> Option<Camera> {
    let (_, eye, look, up, fov) =
        *KNOWN.iter().find(|(known, ..)| *known == name || known.ends_with(':') && name.starts_with(known))?;
    Some(Camera { eye, look, up, fov })
}

/// A camera that sees the whole box, from the front, the right and above; y is up.
pub(super) fn around(bounds: &Aabb) -> Camera {
    const FOV: f32 = 40.0;
    const DIRECTION: [f32; 3] = [0.48, 0.36, 0.8];
    let look = bounds.centroid();
    let radius = 0.5 * bounds.diagonal();
    let distance = 1.05 * radius / (0.5 * FOV.to_radians()).sin();
    // A single point still needs an eye that is not in it.
    let magnitude = look.iter().fold(1.0_f32, |m, c| m.max(c.abs()));
    let distance = distance.max(1e-3 * magnitude).min(f32::MAX / 4.0);
    let eye = std::array::from_fn(|i| look[i] + distance * DIRECTION[i]);
    Camera { eye, look, up: Y, fov: FOV }
}

/// A camera just outside a corner of the box, the one of the greatest coordinates, that looks through its middle: scenes of
/// many things scattered fill the picture from here, some near and some far. y is up.
pub(super) fn from_corner(bounds: &Aabb) -> Camera {
    let (look, extent) = (bounds.centroid(), bounds.extent());
    let eye = std::array::from_fn(|i| look[i] + 0.55 * extent[i]);
    Camera { eye, look, up: Y, fov: 60.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_corner_of_the_box_is_in_the_picture() {
        for bounds in [
            Aabb { lo: [-1.0; 3], hi: [1.0; 3] },
            Aabb { lo: [10.0, 0.0, 0.0], hi: [5000.0, 0.0, 20.0] },
            Aabb { lo: [1e6, 1e6, 1e6], hi: [1e6 + 10.0, 1e6 + 1.0, 1e6] },
        ] {
            let camera = around(&bounds);
            let towards =
                |p: [f32; 3]| -> [f64; 3] { std::array::from_fn(|i| f64::from(p[i]) - f64::from(camera.eye[i])) };
            let cosine = |a: [f64; 3], b: [f64; 3]| {
                let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
                dot(a, b) / (dot(a, a) * dot(b, b)).sqrt()
            };
            for corner in 0..8 {
                let point = std::array::from_fn(|i| if corner >> i & 1 == 0 { bounds.lo[i] } else { bounds.hi[i] });
                let angle = cosine(towards(point), towards(camera.look)).acos().to_degrees();
                assert!(angle <= 0.5 * f64::from(camera.fov), "{bounds:?} {point:?} {angle}");
            }
        }
    }

    #[test]
    fn boxes_without_extent_and_huge_ones_get_a_finite_camera_that_looks_somewhere() {
        for (lo, hi) in [([5.0; 3], [5.0; 3]), ([-1e38; 3], [1e38; 3]), ([1e30; 3], [1e30; 3])] {
            let camera = around(&Aabb { lo, hi });
            assert!(camera.eye.iter().all(|c| c.is_finite()) && camera.eye != camera.look, "{camera:?}");
        }
    }
}
