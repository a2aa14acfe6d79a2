//! Boxes as the camera sees them: their edges as lines of a picture.

use crate::rays::kinds::Basis;
use crate::scene::Camera;
use glam::DVec3;
use hedgerow::geometry::Aabb;
use std::fmt::Write;

/// Units of a path in a pixel.
pub const UNITS: f64 = 10.0;
/// Lines end this many pixels outside of the picture, where no end of one is seen.
const MARGIN: f64 = 4.0;
/// What is nearer than this, relative to how far away a segment reaches, has no place in the picture.
const NEAR: f64 = 1e-6;

/// Corners of a box, bit i of which says whether it is the greater side of axis i, in an order in which few edges need a new start.
const EDGES: [(usize, usize); 12] =
    [(0, 1), (1, 3), (3, 2), (2, 0), (0, 4), (4, 5), (5, 7), (7, 6), (6, 4), (1, 5), (3, 7), (2, 6)];

/// From points in space to those of a picture.
pub struct Projection {
    frame: Basis,
    size: [f64; 2],
}

impl Projection {
    /// The picture that `camera` takes, in pixels.
    pub fn of(camera: &Camera, size: [u32; 2]) -> Projection {
        Projection { frame: Basis::of(camera, size), size: size.map(f64::from) }
    }

    /// What of a segment is in the picture, in pixels from its upper left corner.
    fn segment(&self, [a, b]: [[f32; 3]; 2]) -> Option<[[f64; 2]; 2]> {
        // To the right, up and away from the eye.
        let [mut a, mut b] = [a, b].map(|point| {
            let to = DVec3::from(point.map(f64::from)) - self.frame.eye;
            DVec3::new(to.dot(self.frame.right), to.dot(self.frame.up), to.dot(self.frame.forward))
        });
        let near = NEAR * a.z.abs().max(b.z.abs());
        if a.z.max(b.z) <= near {
            return None;
        }
        let cut = |from: DVec3, to: DVec3| from + (to - from) * ((near - from.z) / (to.z - from.z));
        if a.z < near {
            a = cut(a, b);
        } else if b.z < near {
            b = cut(b, a);
        }
        let [width, height] = self.size;
        let pixel = |p: DVec3| {
            let (x, y) = (p.x / (near.max(p.z) * self.frame.half[0]), p.y / (near.max(p.z) * self.frame.half[1]));
            [0.5 * (1.0 + x) * width, 0.5 * (1.0 - y) * height]
        };
        self.clipped([pixel(a), pixel(b)])
    }

    /// What of a line lies within the picture and its margin (Liang and Barsky 1984).
    fn clipped(&self, [a, b]: [[f64; 2]; 2]) -> Option<[[f64; 2]; 2]> {
        let (mut from, mut to) = (0.0_f64, 1.0_f64);
        for i in 0..2 {
            let (d, lo, hi) = (b[i] - a[i], -MARGIN - a[i], self.size[i] + MARGIN - a[i]);
            if d == 0.0 {
                if lo > 0.0 || hi < 0.0 {
                    return None;
                }
            } else {
                from = from.max((lo / d).min(hi / d));
                to = to.min((lo / d).max(hi / d));
            }
        }
        let at = |s: f64| [0, 1].map(|i| a[i] + s * (b[i] - a[i]));
        (from <= to).then(|| [at(from), at(to)])
    }

    /// Adds the edges of a box to the path of an SVG; false where none is in the picture. A box as small as a point is a dot.
    pub fn draw(&self, bounds: &Aabb, path: &mut String) -> bool {
        let corner = |c: usize| std::array::from_fn(|i| if c >> i & 1 == 0 { bounds.lo[i] } else { bounds.hi[i] });
        let rounded = |p: [f64; 2]| p.map(|c| (c * UNITS).round() as i64);
        let mut pen = None;
        let mut dot = None;
        for (from, to) in EDGES {
            let Some(ends) = self.segment([corner(from), corner(to)]) else { continue };
            let [from, to] = ends.map(rounded);
            dot = Some(from);
            if from == to {
                continue;
            }
            if pen != Some(from) {
                start(path, from);
            }
            let [x, y] = [to[0] - from[0], to[1] - from[1]];
            let _ = if y < 0 { write!(path, "l{x}{y}") } else { write!(path, "l{x} {y}") };
            pen = Some(to);
        }
        if let (None, Some(dot)) = (pen, dot) {
            start(path, dot);
            path.push_str("h0");
        }
        dot.is_some()
    }
}

fn start(path: &mut String, [x, y]: [i64; 2]) {
    let _ = if y < 0 { write!(path, "M{x}{y}") } else { write!(path, "M{x} {y}") };
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rays::kinds::{self, RayKind, RayOptions};
    use crate::scene::{self, LoadOptions};

    /// At the origin, looking down −z, 90° up and down.
    fn plain() -> Projection {
        let camera = Camera { eye: [0.0; 3], look: [0.0, 0.0, -1.0], up: [0.0, 1.0, 0.0], fov: 90.0 };
        Projection::of(&camera, [200, 100])
    }

    #[test]
    fn a_point_on_a_ray_is_in_its_pixel() {
        let scene = scene::load("gen:icosphere:1", &LoadOptions::default()).expect("a generator");
        let size = [40, 30];
        let options = RayOptions { size, seed: 1 };
        let rays = kinds::generate(RayKind::Primary, &scene, &options, &mut |_| Ok(Vec::new())).expect("rays");
        let projection = Projection::of(&scene.camera, size);
        for (i, ray) in rays.iter().enumerate() {
            let point = std::array::from_fn(|k| ray.origin[k] + 3.0 * ray.direction[k]);
            let [at, _] = projection.segment([point; 2]).expect("in the picture");
            let centre = [i % 40, i / 40].map(|c| c as f64 + 0.5);
            assert!((0..2).all(|k| (at[k] - centre[k]).abs() < 1e-3), "{at:?} is not {centre:?}");
        }
    }

    #[test]
    fn lines_are_cut_at_the_eye_and_at_the_picture() {
        let projection = plain();
        let seen = |ends| projection.segment(ends).map(|ends| ends.map(|p| p.map(|c| (c * 1e6).round() / 1e6)));
        // Half way up at the distance of two: a quarter above the middle.
        assert_eq!(seen([[0.0, 1.0, -2.0]; 2]), Some([[100.0, 25.0]; 2]));
        assert_eq!(seen([[0.0, 1.0, 2.0], [1.0, 1.0, 3.0]]), None, "behind the eye");
        assert_eq!(seen([[9.0, 0.0, -1.0], [9.0, 1.0, -1.0]]), None, "on the right of the picture");
        let below = [[0.0, -1.0, -1.0], [0.0, -1.0, 5.0]];
        assert_eq!(seen(below), Some([[100.0, 100.0], [100.0, 100.0 + MARGIN]]), "from below the picture to the eye");
        assert!(projection.segment([[f32::MAX; 3], [-f32::MAX; 3]]).is_none_or(|ends| ends[0][0].is_finite()));
    }

    #[test]
    fn a_box_is_a_path_of_twelve_edges() {
        let mut path = String::new();
        assert!(plain().draw(&Aabb { lo: [-1.0, -1.0, -4.0], hi: [1.0, 1.0, -2.0] }, &mut path));
        assert_eq!(path.matches('l').count(), 12, "{path}");
        assert!(path.starts_with("M875 625l250 0") && !path.contains("NaN"), "{path}");

        path.clear();
        assert!(plain().draw(&Aabb { lo: [0.0, 0.0, -2.0], hi: [1e-6, 1e-6, -2.0] }, &mut path));
        assert_eq!(path, "M1000 500h0", "a dot");

        path.clear();
        assert!(!plain().draw(&Aabb { lo: [0.0, 0.0, 1.0], hi: [1.0; 3] }, &mut path), "behind the eye");
        assert_eq!(path, "");
    }
}
