//! Re-braiding, plainly: round by round.

use super::{Below, Entry};
use crate::accel::Instance;
use crate::accel::rebraid::{FAR_GAIN, ROUNDS, class_of};
use crate::bvh::codes;
use crate::geometry::Aabb;

/// Opens entries, up to `capacity` of them (`rebraid.glsl`).
pub fn rebraid<'a>(
    entries: &mut Vec<Entry>,
    instances: &[Instance],
    below: &impl Fn(u64) -> Option<Below<'a>>,
    capacity: u32,
) {
    let boxes: Vec<Result<Aabb, u32>> = entries.iter().map(|entry| entry.bounds).collect();
    let near = codes::fences_around(&boxes);
    for round in 0..ROUNDS {
        let left = (capacity as usize).saturating_sub(entries.len());
        let share = left.div_ceil((ROUNDS - round) as usize);
        // The highest class of gain first, in a class the first.
        let of = |entry: &Entry| &instances[entry.instance as usize];
        let is_far = |bounds: &Aabb| near.is_some_and(|near| codes::is_apart(bounds, &near));
        let gain = |entry: &Entry| {
            let gain = below(of(entry).structure)?.gain_of(entry, &of(entry).transform)?;
            Some(if entry.bounds.is_ok_and(|bounds| is_far(&bounds)) { gain.min(FAR_GAIN) } else { gain })
        };
        let gains: Vec<Option<f32>> = entries.iter().map(|e| e.bounds.is_ok().then(|| gain(e)).flatten()).collect();
        let mut opened: Vec<usize> = (0..entries.len()).filter(|&i| gains[i].is_some()).collect();
        opened.sort_by_key(|&i| (std::cmp::Reverse(gains[i].map(class_of)), i));
        opened.truncate(share);
        opened.sort_unstable();
        for i in opened {
            let (entry, instance) = (entries[i], of(&entries[i]));
            let Some(below) = below(instance.structure) else { continue };
            let Some(children) = below.opened(&entry.start) else { continue };
            let [left, right] = children.map(|start| {
                let halves = below.halves(&instance.transform, &start);
                Entry { bounds: Ok(halves.union()), start, ..entry }
            });
            entries[i] = left;
            entries.push(right);
        }
    }
}

impl Below<'_> {
    /// What opening an entry saves.
    fn gain_of(&self, entry: &Entry, m: &[[f32; 4]; 3]) -> Option<f32> {
        self.opened(&entry.start)?;
        let saved = self.halves(m, &entry.start).saved;
        (saved.is_finite() && saved > 0.0).then_some(saved)
    }
}
