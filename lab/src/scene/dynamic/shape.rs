//! The mesh of an object in its own space: rigid, or morphing between meshes of one topology.

use super::looped;
use super::track::{Track, Value};
use std::borrow::Cow;

/// Where the vertices of an object are before it is placed; all of equal number.
#[derive(Debug, Clone)]
pub(in crate::scene) enum Shape {
    /// Always the same.
    Rigid(Vec<[f32; 3]>),
    /// Key frames evenly over a cycle, and straight from each to the next; behind the last comes the first again.
    KeyFrames {
        /// One or more.
        frames: Vec<Vec<[f32; 3]>>,
        /// How long the cycle takes.
        seconds: f32,
    },
    /// A mesh, and how far each target moves its vertices, times the target's weight.
    Targets {
        base: Vec<[f32; 3]>,
        targets: Vec<Vec<[f32; 3]>>,
        /// As many at every key as targets.
        weights: Track<Vec<f32>>,
        /// When the weights begin again.
        seconds: f32,
    },
}

impl Shape {
    /// Whether it is ever another.
    pub fn morphs(&self) -> bool {
        match self {
            Shape::Rigid(_) => false,
            Shape::KeyFrames { frames, .. } => frames.len() > 1,
            Shape::Targets { .. } => true,
        }
    }

    /// The vertices at a time.
    pub fn at(&self, time: f32) -> Cow<'_, [[f32; 3]]> {
        match self {
            Shape::Rigid(positions) => Cow::Borrowed(positions),
            Shape::KeyFrames { frames, seconds } => {
                let (frame, fraction) = place_in_cycle(time, *seconds, frames.len());
                if fraction == 0.0 || frames.len() == 1 {
                    return Cow::Borrowed(&frames[frame]);
                }
                let next = &frames[(frame + 1) % frames.len()];
                frames[frame].iter().zip(next).map(|(a, b)| <[f32; 3]>::between(a, b, fraction)).collect()
            }
            Shape::Targets { base, targets, weights, seconds } => {
                Cow::Owned(morphed(base, targets, &weights.at(looped(time, *seconds))))
            }
        }
    }
}

/// The key frame that is left and the fraction of the way to the next.
fn place_in_cycle(time: f32, seconds: f32, frames: usize) -> (usize, f32) {
    let place = looped(time, seconds) / seconds * frames as f32;
    // The time of a key frame is a fraction of the cycle, rounded: it shall still give this frame, not a blend with another.
    let nearest = place.round();
    let place = if (place - nearest).abs() <= 4.0 * f32::EPSILON * nearest { nearest } else { place };
    (place as usize % frames, place.fract())
}

/// `base` with every target moved by its weight.
pub(in crate::scene) fn morphed(base: &[[f32; 3]], targets: &[Vec<[f32; 3]>], weights: &[f32]) -> Vec<[f32; 3]> {
    let mut positions = base.to_vec();
    for (target, &weight) in targets.iter().zip(weights).filter(|&(_, &weight)| weight != 0.0) {
        for (position, by) in positions.iter_mut().zip(target) {
            (0..3).for_each(|i| position[i] += weight * by[i]);
        }
    }
    positions
}

#[cfg(test)]
mod tests {
    use super::super::track::Keys;
    use super::*;

    #[test]
    fn key_frames_are_met_blended_and_looped() {
        let frames = [0.0_f32, 4.0, 6.0].map(|x| vec![[x, 1.0, 0.0]]).to_vec();
        let shape = Shape::KeyFrames { frames, seconds: 3.0 };
        let x = |time: f32| shape.at(time)[0][0];
        for (time, expected) in
            [(0.0, 0.0), (0.25, 1.0), (1.0, 4.0), (1.5, 5.0), (2.0, 6.0), (2.5, 3.0), (3.0, 0.0), (6.25, 1.0)]
        {
            assert_eq!(x(time), expected, "{time}");
        }
        assert_eq!(x(-0.5), 3.0);
        assert!(shape.morphs());
    }

    #[test]
    fn the_time_of_a_key_frame_gives_this_frame_and_no_blend() {
        for frames in 1..200_usize {
            for seconds in [0.1_f32, 1.0, 7.3] {
                for frame in 0..frames {
                    let time = seconds * frame as f32 / frames as f32;
                    assert_eq!(place_in_cycle(time, seconds, frames), (frame, 0.0), "{frame} of {frames} in {seconds}");
                }
            }
        }
    }

    #[test]
    fn targets_move_by_their_weights() {
        let weights = Track::new(vec![0.0, 1.0], Keys::Linear(vec![vec![0.0, 1.0], vec![1.0, 0.0]]));
        let targets = vec![vec![[4.0, 0.0, 0.0]], vec![[0.0, 8.0, 0.0]]];
        let shape = Shape::Targets { base: vec![[1.0; 3]], targets, weights, seconds: 2.0 };
        assert_eq!(shape.at(0.25)[0], [2.0, 7.0, 1.0]);
        assert_eq!(shape.at(1.5)[0], [5.0, 1.0, 1.0]);
        assert_eq!(shape.at(2.25)[0], [2.0, 7.0, 1.0]);
    }
}
