//! Triangles cut at planes across the axes, in double precision: what validators and the end-point overlap clip with.
//!
//! kd-trees clip in single precision, to the bits of their shaders: [`crate::kdtree::twin::clip`].

use super::Aabb;

/// Room for corners. A triangle cut at planes across the axes has 9 at most: two along planes of each axis and three edges.
/// Rounding may make a few of one.
const CORNERS: usize = 16;

/// A convex polygon: what planes across the axes leave of a triangle.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Polygon {
    corners: [[f64; 3]; CORNERS],
    count: usize,
}

impl Polygon {
    pub fn of(triangle: &[[f32; 3]; 3]) -> Polygon {
        let mut polygon = Polygon { corners: [[0.0; 3]; CORNERS], count: 3 };
        for (corner, v) in polygon.corners.iter_mut().zip(triangle) {
            *corner = v.map(f64::from);
        }
        polygon
    }

    pub fn corners(&self) -> &[[f64; 3]] {
        &self.corners[..self.count]
    }

    /// What of it lies in a box (Sutherland, Hodgman 1974).
    pub fn inside(&self, b: &Aabb) -> Polygon {
        (0..3).fold(*self, |polygon, axis| {
            polygon.beyond(axis, f64::from(b.lo[axis]), 1.0).beyond(axis, f64::from(b.hi[axis]), -1.0)
        })
    }

    /// What of it lies at the plane or beyond, in the direction of `sign`.
    pub fn beyond(&self, axis: usize, plane: f64, sign: f64) -> Polygon {
        let mut cut = Polygon { corners: [[0.0; 3]; CORNERS], count: 0 };
        let mut push = |corner| {
            if let Some(place) = cut.corners.get_mut(cut.count) {
                *place = corner;
                cut.count += 1;
            }
        };
        for i in 0..self.count {
            let (from, to) = (self.corners[i], self.corners[(i + 1) % self.count]);
            let (a, b) = (sign * (from[axis] - plane), sign * (to[axis] - plane));
            if a >= 0.0 {
                push(from);
            }
            if a < 0.0 && b > 0.0 || a > 0.0 && b < 0.0 {
                let t = a / (a - b);
                push(std::array::from_fn(|k| if k == axis { plane } else { from[k] + t * (to[k] - from[k]) }));
            }
        }
        cut
    }

    pub fn area(&self) -> f64 {
        let offset = |i: usize| -> [f64; 3] { std::array::from_fn(|k| self.corners[i][k] - self.corners[0][k]) };
        let mut sum = [0.0; 3];
        for i in 1..self.count.saturating_sub(1) {
            let (a, b) = (offset(i), offset(i + 1));
            for (k, sum) in sum.iter_mut().enumerate() {
                let (x, y) = ((k + 1) % 3, (k + 2) % 3);
                *sum += a[x] * b[y] - a[y] * b[x];
            }
        }
        0.5 * sum.iter().map(|x| x * x).sum::<f64>().sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [[f32; 3]; 3] = [[0.0, 0.0, 1.0], [4.0, 0.0, 1.0], [0.0, 4.0, 1.0]];

    #[test]
    fn a_triangle_is_cut_to_a_box() {
        let triangle = Polygon::of(&CORNERS);
        assert_eq!(triangle.area(), 8.0);
        let part = triangle.inside(&Aabb { lo: [1.0, 1.0, 0.0], hi: [2.0, 9.0, 1.0] });
        assert_eq!(part.area(), 1.5, "between x = 1 and 2, from y = 1 to 4 - x");
        assert_eq!(triangle.inside(&Aabb { lo: [0.0; 3], hi: [9.0, 9.0, 0.5] }).corners(), &[] as &[[f64; 3]]);
    }

    #[test]
    fn the_two_sides_of_a_plane_share_its_points() {
        let triangle = Polygon::of(&CORNERS);
        let [below, above] = [-1.0, 1.0].map(|sign| triangle.beyond(0, 1.5, sign));
        assert_eq!(below.area() + above.area(), triangle.area());
        assert!(above.corners().iter().all(|p| p[0] >= 1.5) && below.corners().iter().all(|p| p[0] <= 1.5));
    }
}
