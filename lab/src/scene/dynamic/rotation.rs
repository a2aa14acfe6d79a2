//! Rotations as unit quaternions, by sums, products and square roots alone: the same on every machine.

use crate::scene::generators::turn;

/// A unit quaternion: x, y, z, w.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::scene) struct Rotation(pub [f64; 4]);

impl Default for Rotation {
    fn default() -> Rotation {
        Rotation([0.0, 0.0, 0.0, 1.0])
    }
}

impl Rotation {
    /// By an angle in degrees about an axis of any length; `None` for one of no length.
    pub fn about(axis: [f32; 3], degrees: f32) -> Option<Rotation> {
        let axis = axis.map(f64::from);
        let length = axis.iter().map(|c| c * c).sum::<f64>().sqrt();
        let half = (f64::from(degrees) % 720.0).to_radians() / 2.0;
        let [cosine, sine] = turn(half);
        let [x, y, z] = axis.map(|c| c / length * sine);
        Rotation([x, y, z, cosine]).unit().filter(|_| length > 0.0)
    }

    /// The same rotation, of length 1; `None` if it has no direction.
    pub fn unit(self) -> Option<Rotation> {
        // By the greatest first: squares of tiny and huge components would leave the range.
        let greatest = self.0.iter().fold(0.0_f64, |g, c| g.max(c.abs()));
        let scaled = self.0.map(|c| c / greatest);
        let length = scaled.iter().map(|c| c * c).sum::<f64>().sqrt();
        (greatest > 0.0 && length.is_finite()).then(|| Rotation(scaled.map(|c| c / length)))
    }

    /// The rotation a fraction of the way to `other`, evenly and the shorter way round.
    ///
    /// Halving the arc is adding and shortening: the digits of the fraction say which half to go on with, so that the
    /// inverse cosine of a formula in closed form is not needed.
    pub fn towards(&self, other: &Rotation, fraction: f32) -> Rotation {
        if fraction <= 0.0 || fraction >= 1.0 {
            return if fraction <= 0.0 { *self } else { *other };
        }
        const DIGITS: u32 = 32;
        let dot: f64 = (0..4).map(|i| self.0[i] * other.0[i]).sum();
        // Both signs of a quaternion are the same rotation; the nearer one is the shorter way.
        let (mut from, mut to) = (*self, if dot < 0.0 { Rotation(other.0.map(|c| -c)) } else { *other });
        let mut rest = f64::from(fraction);
        for _ in 0..DIGITS {
            let middle = Rotation(std::array::from_fn(|i| from.0[i] + to.0[i])).unit().unwrap_or(from);
            rest *= 2.0;
            if rest < 1.0 {
                to = middle;
            } else {
                (from, rest) = (middle, rest - 1.0);
            }
        }
        from
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DMat3, DQuat};

    impl Rotation {
        /// The three rows of its matrix.
        fn rows(&self) -> [[f64; 3]; 3] {
            DMat3::from_quat(DQuat::from_array(self.0)).transpose().to_cols_array_2d()
        }
    }

    const X: [f32; 3] = [1.0, 0.0, 0.0];
    const Y: [f32; 3] = [0.0, 1.0, 0.0];

    fn rotation(axis: [f32; 3], degrees: f32) -> Rotation {
        Rotation::about(axis, degrees).expect("an axis")
    }

    fn near(a: Rotation, b: Rotation) -> bool {
        a.rows().into_iter().flatten().zip(b.rows().into_iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-7)
    }

    #[test]
    fn a_quarter_turn_takes_one_axis_to_the_next() {
        // About y: z goes to x, x to −z.
        let rows = rotation([0.0, 7.0, 0.0], 90.0).rows();
        let expected = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]];
        assert!(rows.iter().flatten().zip(expected.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-12), "{rows:?}");
        assert!(near(rotation(X, 360.0), Rotation::default()) && near(rotation(X, 810.0), rotation(X, 90.0)));
        assert_eq!(Rotation::about([0.0; 3], 90.0), None);
    }

    #[test]
    fn the_way_between_two_rotations_is_even() {
        for to in [1.0, 30.0, 90.0, 179.0] {
            for fraction in [0.0, 0.1, 0.25, 1.0 / 3.0, 0.5, 0.9, 1.0] {
                let between = rotation(Y, 10.0).towards(&rotation(Y, 10.0 + to), fraction);
                assert!(near(between, rotation(Y, 10.0 + fraction * to)), "{fraction} of {to}: {between:?}");
            }
        }
    }

    #[test]
    fn it_goes_the_shorter_way_round() {
        assert!(near(rotation(X, 0.0).towards(&rotation(X, 270.0), 0.5), rotation(X, -45.0)));
        let negated = Rotation(rotation(X, 80.0).0.map(|c| -c));
        assert!(near(rotation(X, 0.0).towards(&negated, 0.25), rotation(X, 20.0)));
    }

    #[test]
    fn whatever_has_a_direction_gets_length_1() {
        for c in [1e-300, 1e-45, 1.0, 1e38] {
            assert_eq!(Rotation([0.0, c, 0.0, 0.0]).unit(), Some(Rotation([0.0, 1.0, 0.0, 0.0])));
        }
        assert_eq!(Rotation([0.0; 4]).unit(), None);
        assert_eq!(Rotation([f64::NAN; 4]).unit(), None);
    }
}
