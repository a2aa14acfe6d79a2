//! A value that changes with time: keys, and how it goes from one to the next. Between keys as glTF 2.0 has it (appendix C).

use super::rotation::Rotation;

/// Keys of a value, in the order of their times. Before the first key and behind the last the value stays.
#[derive(Debug, Clone)]
pub(in crate::scene) struct Track<V> {
    times: Vec<f32>,
    keys: Keys<V>,
}

/// The values at the keys of a track, as many as times, and what is between them.
#[derive(Debug, Clone)]
pub(in crate::scene) enum Keys<V> {
    /// Each value stays until the next key.
    Step(Vec<V>),
    /// From value to value, evenly.
    Linear(Vec<V>),
    /// A cubic Hermite spline: into each key, the value there, and out of it. Tangents are per second.
    Cubic(Vec<[V; 3]>),
}

/// What a track can lead through.
pub(in crate::scene) trait Value: Clone {
    /// Σ weight · value.
    fn sum(terms: &[(f32, &Self)]) -> Self;

    /// The value a fraction of the way from `a` to `b`: exactly `a` at 0 and exactly `b` at 1.
    fn between(a: &Self, b: &Self, fraction: f32) -> Self {
        Self::sum(&[(1.0 - fraction, a), (fraction, b)])
    }

    /// The nearest value that means something; a sum need not, and may have none.
    fn settled(self) -> Option<Self> {
        Some(self)
    }
}

impl<V: Value> Track<V> {
    /// A track of one key or more, as many times as keys, each later than the one before.
    pub fn new(times: Vec<f32>, keys: Keys<V>) -> Track<V> {
        debug_assert!(!times.is_empty() && times.len() == keys.len() && times.is_sorted_by(|a, b| a < b));
        Track { times, keys }
    }

    /// A value that never changes.
    pub fn still(value: V) -> Track<V> {
        Track::new(vec![0.0], Keys::Step(vec![value]))
    }

    /// The value at a time.
    pub fn at(&self, time: f32) -> V {
        let behind = self.times.partition_point(|&key| key <= time);
        let Some(key) = behind.checked_sub(1) else { return self.keys.value(0).clone() };
        if behind == self.times.len() {
            return self.keys.value(key).clone();
        }
        let span = self.times[behind] - self.times[key];
        self.keys.between(key, (time - self.times[key]) / span, span)
    }
}

impl<V: Value> Keys<V> {
    pub fn len(&self) -> usize {
        match self {
            Keys::Step(values) | Keys::Linear(values) => values.len(),
            Keys::Cubic(values) => values.len(),
        }
    }

    fn value(&self, key: usize) -> &V {
        match self {
            Keys::Step(values) | Keys::Linear(values) => &values[key],
            Keys::Cubic(values) => &values[key][1],
        }
    }

    /// The value a fraction of the way from a key to the next, `span` seconds apart.
    fn between(&self, key: usize, fraction: f32, span: f32) -> V {
        match self {
            Keys::Step(values) => values[key].clone(),
            Keys::Linear(values) => V::between(&values[key], &values[key + 1], fraction),
            Keys::Cubic(values) => {
                let ([_, from, out_of], [into, to, _]) = (&values[key], &values[key + 1]);
                let (t, t2, t3) = (fraction, fraction * fraction, fraction * fraction * fraction);
                V::sum(&[
                    (2.0 * t3 - 3.0 * t2 + 1.0, from),
                    (span * (t3 - 2.0 * t2 + t), out_of),
                    (-2.0 * t3 + 3.0 * t2, to),
                    (span * (t3 - t2), into),
                ])
                .settled()
                .unwrap_or_else(|| from.clone())
            }
        }
    }
}

impl Value for f32 {
    fn sum(terms: &[(f32, &f32)]) -> f32 {
        terms.iter().map(|&(weight, &value)| weight * value).sum()
    }
}

impl Value for [f32; 3] {
    fn sum(terms: &[(f32, &Self)]) -> Self {
        std::array::from_fn(|i| terms.iter().map(|(weight, value)| weight * value[i]).sum())
    }
}

/// The weights of morph targets, equally many at every key.
impl Value for Vec<f32> {
    fn sum(terms: &[(f32, &Self)]) -> Self {
        let (_, first) = terms[0];
        (0..first.len()).map(|i| terms.iter().map(|(weight, value)| weight * value[i]).sum()).collect()
    }
}

impl Value for Rotation {
    fn sum(terms: &[(f32, &Self)]) -> Self {
        let component = |i: usize| terms.iter().map(|(weight, rotation)| f64::from(*weight) * rotation.0[i]).sum();
        Rotation(std::array::from_fn(component))
    }

    fn between(a: &Self, b: &Self, fraction: f32) -> Self {
        a.towards(b, fraction)
    }

    fn settled(self) -> Option<Self> {
        self.unit()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_goes_evenly_between_its_keys_and_stays_before_and_behind_them() {
        let track = Track::new(vec![1.0, 2.0, 4.0], Keys::Linear(vec![10.0_f32, 20.0, 0.0]));
        for (time, value) in
            [(0.0, 10.0), (1.0, 10.0), (1.25, 12.5), (2.0, 20.0), (3.0, 10.0), (3.5, 5.0), (4.0, 0.0), (9.0, 0.0)]
        {
            assert_eq!(track.at(time), value, "{time}");
        }
    }

    #[test]
    fn a_stepping_value_stays_until_its_next_key() {
        let track = Track::new(vec![1.0, 2.0], Keys::Step(vec![[1.0_f32, 2.0, 3.0], [4.0, 5.0, 6.0]]));
        assert_eq!(track.at(0.0), [1.0, 2.0, 3.0]);
        assert_eq!(track.at(1.999), [1.0, 2.0, 3.0]);
        assert_eq!(track.at(2.0), [4.0, 5.0, 6.0]);
    }

    #[test]
    fn a_spline_meets_its_keys_with_their_tangents() {
        // From 0 with slope 4 to 1 with slope −2, over two seconds. Worked out by hand at the half:
        // ½·0 + 2·⅛·4 + ½·1 + 2·(−⅛)·(−2) = 2.
        let track = Track::new(vec![0.0, 2.0], Keys::Cubic(vec![[9.0_f32, 0.0, 4.0], [-2.0, 1.0, 9.0]]));
        assert_eq!((track.at(0.0), track.at(1.0), track.at(2.0)), (0.0, 2.0, 1.0));
        let slope = |at: f32| (track.at(at + 1e-3) - track.at(at - 1e-3)) / 2e-3;
        assert!((slope(2e-3) - 4.0).abs() < 0.05 && (slope(2.0 - 2e-3) + 2.0).abs() < 0.05);
    }

    #[test]
    fn both_ends_are_met_exactly() {
        for (a, b) in [(0.1_f32, 1e9_f32), (1e9, 0.1), (-3.4e38, 3.4e38)] {
            assert_eq!((f32::between(&a, &b, 0.0), f32::between(&a, &b, 1.0)), (a, b));
            assert!(f32::between(&a, &b, 0.5).is_finite());
        }
    }
}
