//! How much of a camera's picture a box covers (van Kralingen 2023, section 3.2.1, equation 12).
//!
//! The faces of a box that look at the eye, three at most, lie side by side in the picture. Each is cut to the pyramid of the
//! picture before it is projected (Sutherland and Hodgman 1974), so that nothing behind the eye is divided by its depth.

use glam::DVec3;
use hedgerow::geometry::Aabb;
use hedgerow::{Error, Result};

/// A pinhole camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pinhole {
    /// Where it is.
    pub eye: [f32; 3],
    /// A point in the middle of the picture.
    pub look: [f32; 3],
    /// What is up in the picture; it need not be at right angles to anything.
    pub up: [f32; 3],
    /// Degrees from the lower edge of the picture to the upper one, more than 0 and less than 180.
    pub fov: f32,
    /// The picture's width over its height.
    pub aspect: f32,
}

impl Pinhole {
    /// Whether it sees anything.
    ///
    /// # Errors
    /// [`Error::Argument`] names what cannot be seen by, and what can.
    pub fn check(&self) -> Result<()> {
        let Pinhole { eye, look, up, fov, aspect } = self;
        let is_finite = eye.iter().chain(look).chain(up).all(|x| x.is_finite());
        let error = |text: String| Err(Error::Argument(text));
        match (eye == look, *fov > 0.0 && *fov < 180.0, *aspect > 0.0 && aspect.is_finite()) {
            _ if !is_finite => {
                error(format!("a camera at {eye:?} that looks at {look:?} is not finite; take finite points"))
            }
            (true, ..) => {
                error(format!("a camera at {eye:?} that looks at itself has no direction; take another point"))
            }
            (_, false, _) => {
                error(format!("a picture {fov} degrees high cannot be taken; take more than 0, less than 180"))
            }
            (.., false) => error(format!("a picture {aspect} times as wide as high cannot be taken; take more than 0")),
            _ => Ok(()),
        }
    }

    /// The same in a scene whose lengths are scaled by this.
    pub fn scaled(&self, scale: f32) -> Pinhole {
        Pinhole { eye: self.eye.map(|x| x * scale), look: self.look.map(|x| x * scale), ..*self }
    }
}

/// The picture of a camera.
pub(super) struct Picture {
    eye: DVec3,
    /// What gives a point's place to the right, up and forward: in the picture both of the former are no farther than the last.
    axes: [DVec3; 3],
    /// Points nearer than this along the view are not projected: their place would not be finite.
    near: f64,
}

impl Picture {
    /// Of a scene with a diagonal of this length.
    pub fn new(camera: &Pinhole, diagonal: f64) -> Picture {
        let [eye, look, up] = [camera.eye, camera.look, camera.up].map(|v| DVec3::from_array(v.map(f64::from)));
        let forward = (look - eye).normalize_or(DVec3::NEG_Z);
        // A camera that looks straight up has no right; any direction across will do.
        let right = forward.cross(up).try_normalize().unwrap_or(forward.any_orthonormal_vector());
        let half_height = (f64::from(camera.fov).to_radians() / 2.0).tan();
        let half_width = half_height * f64::from(camera.aspect);
        let axes = [right / half_width, right.cross(forward) / half_height, forward];
        Picture { eye, axes, near: 1e-9 * diagonal }
    }

    /// The part of the picture that a box covers, 1 if the eye is in it: from there all rays meet it.
    pub fn covered(&self, bounds: &Aabb) -> f64 {
        let [lo, hi] = [bounds.lo, bounds.hi].map(|corner| DVec3::from_array(corner.map(f64::from)));
        if self.eye.cmpge(lo).all() && self.eye.cmple(hi).all() {
            return 1.0;
        }
        let seen = (0..3).filter_map(|axis| {
            let looks_here = self.eye[axis] < lo[axis] || self.eye[axis] > hi[axis];
            let at = if self.eye[axis] < lo[axis] { lo[axis] } else { hi[axis] };
            looks_here.then(|| self.covered_by_face(axis, at, lo, hi))
        });
        seen.sum::<f64>().min(1.0)
    }

    fn covered_by_face(&self, axis: usize, at: f64, lo: DVec3, hi: DVec3) -> f64 {
        let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
        let corner = |u: f64, v: f64| {
            let mut corner = DVec3::ZERO;
            (corner[axis], corner[a], corner[b]) = (at, u, v);
            let offset = corner - self.eye;
            DVec3::from_array(self.axes.map(|axis| axis.dot(offset)))
        };
        let face = [corner(lo[a], lo[b]), corner(hi[a], lo[b]), corner(hi[a], hi[b]), corner(lo[a], hi[b])];
        let sides: [fn(DVec3) -> f64; 4] = [|p| p.z - p.x, |p| p.z + p.x, |p| p.z - p.y, |p| p.z + p.y];
        let cut = Polygon::of(face).beyond(|p| p.z - self.near);
        // The picture is 2 by 2.
        0.25 * sides.into_iter().fold(cut, |polygon, side| polygon.beyond(side)).projected_area()
    }
}

/// Corners of a face that is cut by five planes, of which each adds one at most; rounding may make a few of one.
const CORNERS: usize = 16;

/// A convex polygon.
#[derive(Clone, Copy)]
struct Polygon {
    corners: [DVec3; CORNERS],
    count: usize,
}

impl Polygon {
    fn of(face: [DVec3; 4]) -> Polygon {
        let mut polygon = Polygon { corners: [DVec3::ZERO; CORNERS], count: 4 };
        polygon.corners[..4].copy_from_slice(&face);
        polygon
    }

    /// What of it lies where `side` is not negative.
    fn beyond(&self, side: impl Fn(DVec3) -> f64) -> Polygon {
        let mut cut = Polygon { corners: [DVec3::ZERO; CORNERS], count: 0 };
        let mut push = |corner| {
            if let Some(place) = cut.corners.get_mut(cut.count) {
                *place = corner;
                cut.count += 1;
            }
        };
        for i in 0..self.count {
            let (from, to) = (self.corners[i], self.corners[(i + 1) % self.count]);
            let (a, b) = (side(from), side(to));
            if a >= 0.0 {
                push(from);
            }
            if a * b < 0.0 {
                push(from + (to - from) * (a / (a - b)));
            }
        }
        cut
    }

    /// Its area where x and y are divided by z.
    fn projected_area(&self) -> f64 {
        let place = |i: usize| (self.corners[i % self.count] / self.corners[i % self.count].z).truncate();
        let twice: f64 =
            (1..self.count.saturating_sub(1)).map(|i| (place(i) - place(0)).perp_dot(place(i + 1) - place(0))).sum();
        0.5 * twice.abs()
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{Random, meets, part_of};
    use super::*;

    const SCENE: Aabb = Aabb { lo: [-2.0, 0.0, -1.0], hi: [2.0, 1.5, 3.0] };
    const CAMERA: Pinhole =
        Pinhole { eye: [-1.5, 0.7, -0.5], look: [1.0, 0.5, 2.0], up: [0.0, 1.0, 0.0], fov: 60.0, aspect: 4.0 / 3.0 };

    /// The part of the pixels whose rays meet a box, made as a renderer makes them.
    fn counted(camera: &Pinhole, bounds: &Aabb, [width, height]: [u32; 2]) -> f64 {
        let [eye, look, up] = [camera.eye, camera.look, camera.up].map(|v| DVec3::from_array(v.map(f64::from)));
        let forward = (look - eye).normalize();
        let right = forward.cross(up).normalize();
        let up = right.cross(forward);
        let half = (f64::from(camera.fov).to_radians() / 2.0).tan();
        let met = |pixel: &u32| {
            let x = (f64::from(pixel % width) + 0.5) / f64::from(width) * 2.0 - 1.0;
            let y = 1.0 - (f64::from(pixel / width) + 0.5) / f64::from(height) * 2.0;
            let direction = forward + right * (x * half * f64::from(camera.aspect)) + up * (y * half);
            meets(bounds, eye.to_array(), direction.to_array())
        };
        (0..width * height).filter(met).count() as f64 / f64::from(width * height)
    }

    #[test]
    fn a_box_covers_as_many_pixels_as_its_part_of_the_picture_says() {
        const SIZE: [u32; 2] = [256, 192];
        let mut random = Random::new(11);
        let outside = Pinhole { eye: [8.0, 4.0, -6.0], look: [0.0, 0.5, 0.5], ..CAMERA };
        for camera in [CAMERA, outside] {
            let picture = Picture::new(&camera, f64::from(SCENE.diagonal()));
            for _ in 0..50 {
                let bounds = part_of(&SCENE, &mut random);
                let (covered, counted) = (picture.covered(&bounds), counted(&camera, &bounds, SIZE));
                // A pixel is counted whole: half of those along the outline, at most as long as the picture's, are off.
                let tolerance = 0.01 * counted + 60.0 / f64::from(SIZE[0] * SIZE[1]);
                assert!((covered - counted).abs() < tolerance, "{bounds:?}: {covered}, {counted}");
            }
        }
    }

    #[test]
    fn an_eye_on_a_face_or_in_the_box_sees_nothing_else() {
        let picture = Picture::new(&CAMERA, 5.0);
        let around = Aabb { lo: [-2.0, 0.0, -1.0], hi: [0.0, 1.0, 0.0] };
        for face in [around, Aabb { lo: CAMERA.eye, ..around }, Aabb { lo: CAMERA.eye, hi: CAMERA.eye }] {
            assert_eq!(picture.covered(&face), 1.0);
        }
        // Just in front of a wall, and just behind it.
        let wall = |z: f32| Aabb { lo: [-90.0, -90.0, z], hi: [90.0, 90.0, z] };
        let ahead = Picture::new(&Pinhole { eye: [0.0; 3], look: [0.0, 0.0, 1.0], ..CAMERA }, 100.0);
        assert!((ahead.covered(&wall(1e-3)) - 1.0).abs() < 1e-9);
        assert_eq!(ahead.covered(&wall(-1e-3)), 0.0);
    }

    #[test]
    fn a_camera_that_sees_nothing_is_named() {
        let said = |camera: Pinhole| camera.check().expect_err("cannot see").to_string();
        assert!(said(Pinhole { look: CAMERA.eye, ..CAMERA }).contains("looks at itself"));
        assert!(said(Pinhole { fov: 180.0, ..CAMERA }).contains("180 degrees"));
        assert!(said(Pinhole { aspect: 0.0, ..CAMERA }).contains("0 times as wide"));
        assert!(said(Pinhole { eye: [f32::NAN; 3], ..CAMERA }).contains("not finite"));
        assert!(Pinhole { up: [0.0; 3], ..CAMERA }.check().is_ok());
    }
}
