//! Where an object is: a node of a scene and its ancestors, each placed by translation · rotation · scale.

use super::looped;
use super::rotation::Rotation;
use super::track::Track;
use glam::{DAffine3, DQuat, Vec3};

/// How a node is placed in its parent.
#[derive(Debug, Clone)]
pub(in crate::scene) enum Step {
    /// Always the same. In 64 bits: a chain is rounded once, at its end.
    Fixed(DAffine3),
    /// By keys.
    Moving(Pose),
}

/// Translation · rotation · scale, each by its own keys.
#[derive(Debug, Clone)]
pub(in crate::scene) struct Pose {
    pub translation: Track<[f32; 3]>,
    pub rotation: Track<Rotation>,
    pub scale: Track<[f32; 3]>,
}

/// The steps from the world down to the object, over and over.
#[derive(Debug, Clone)]
pub(in crate::scene) struct Motion {
    steps: Vec<Step>,
    seconds: f32,
}

impl Motion {
    /// Stays where it is.
    pub const STILL: Motion = Motion { steps: Vec::new(), seconds: 1.0 };

    /// Through `steps`, the outermost first, from the beginning again every `seconds`.
    pub fn new(steps: Vec<Step>, seconds: f32) -> Motion {
        Motion { steps, seconds }
    }

    /// Object to world at a time.
    pub fn at(&self, time: f32) -> [[f32; 4]; 3] {
        let time = looped(time, self.seconds);
        let steps = self.steps.iter().map(|step| match step {
            Step::Fixed(affine) => *affine,
            Step::Moving(pose) => pose.at(time),
        });
        rows(&steps.fold(DAffine3::IDENTITY, |outer, inner| outer * inner))
    }
}

impl Pose {
    fn at(&self, time: f32) -> DAffine3 {
        let [scale, translation] = [&self.scale, &self.translation].map(|track| Vec3::from(track.at(time)).as_dvec3());
        DAffine3::from_scale_rotation_translation(scale, DQuat::from_array(self.rotation.at(time).0), translation)
    }
}

/// The rows of a map, each rounded; the fourth column is the translation.
pub(in crate::scene) fn rows(map: &DAffine3) -> [[f32; 4]; 3] {
    let columns = map.to_cols_array_2d();
    std::array::from_fn(|i| columns.map(|column| column[i] as f32))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::dynamic::track::Keys;
    use glam::DVec3;

    #[test]
    fn scale_comes_first_then_rotation_then_translation_then_the_parent() {
        let quarter_about_z = Rotation::about([0.0, 0.0, 1.0], 90.0).expect("an axis");
        let pose = Pose {
            translation: Track::new(vec![0.0, 1.0], Keys::Linear(vec![[0.0; 3], [10.0, 0.0, 0.0]])),
            rotation: Track::still(quarter_about_z),
            scale: Track::still([2.0, 3.0, 1.0]),
        };
        let twice = DAffine3 { translation: 5.0 * DVec3::Z, ..DAffine3::from_scale(DVec3::splat(2.0)) };
        let motion = Motion::new(vec![Step::Fixed(twice), Step::Moving(pose)], 2.0);
        // (1, 1, 1) → (2, 3, 1) → (−3, 2, 1) → (2, 2, 1) → (4, 4, 7), half a second on.
        let expected = [[0.0, -6.0, 0.0, 10.0], [4.0, 0.0, 0.0, 0.0], [0.0, 0.0, 2.0, 5.0]];
        for time in [0.5, 2.5, -1.5] {
            let at = motion.at(time);
            assert!(at.iter().flatten().zip(expected.iter().flatten()).all(|(a, e)| (a - e).abs() < 1e-6), "{at:?}");
        }
        assert_eq!(Motion::STILL.at(7.0), crate::scene::SceneInstance::IDENTITY);
    }
}
