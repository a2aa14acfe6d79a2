//! How top levels grow: building and updating one over 100, 1,000, 10,000… instances.

use super::points::{AccelEntry, TopLevel};
use super::{AccelSetup, WARM_UPS, apart, where_possible};
use crate::Result;
use crate::measure::{Sink, Spread, in_turn};
use crate::scene::{self, LoadOptions, SceneInstance};
use crate::subjects::levels::Levels;
use ash::vk;

/// The fewest instances, and how many times as many come next.
const FIRST: u32 = 100;
const TIMES: u32 = 10;

/// Measures both makers in turn over up to `most` instances, which move by a tenth of their cell between build and update.
///
/// # Errors
/// Too little memory; the device failed.
pub fn measure(stage: &AccelSetup<'_>, most: u32, point: &mut Sink<'_, AccelEntry>) -> Result<()> {
    for count in counts(most) {
        (stage.say)(&format!("top level of {count}"));
        let scene = scene::load_instances(&format!("gen:cells:{count}"), &LoadOptions::default())?;
        let flags = vk::BuildAccelerationStructureFlagsKHR::ALLOW_UPDATE;
        let makers = stage.makers();
        let mut levels: Vec<Levels<'_>> =
            makers.iter().map(|maker| Levels::new(maker.clone(), &scene, flags)).collect::<Result<_>>()?;
        let samples = in_turn(&mut levels, WARM_UPS, stage.runs, |levels| {
            levels.place(scene.instances.iter().map(|i| i.transform));
            let build = levels.build()?;
            levels.place(scene.instances.iter().enumerate().map(|(i, instance)| moved(i, instance)));
            Ok((build, where_possible(levels.update())?))
        });
        for ((maker, levels), samples) in makers.iter().zip(&levels).zip(samples) {
            let (builds, updates) = apart(&samples?);
            let [structure_bytes, scratch_bytes] = levels.top_bytes();
            point(AccelEntry::Tlas(TopLevel {
                instances: count,
                maker: maker.maker(),
                build_ms: Spread::of_some(&builds)?,
                update_ms: Spread::of(&updates),
                structure_bytes,
                scratch_bytes,
            }))?;
        }
    }
    Ok(())
}

fn counts(most: u32) -> Vec<u32> {
    let smaller =
        std::iter::successors(Some(FIRST), |count| count.checked_mul(TIMES)).take_while(|&count| count < most);
    smaller.chain([most]).collect()
}

/// Each in another direction.
fn moved(i: usize, instance: &SceneInstance) -> [[f32; 4]; 3] {
    let mut transform = instance.transform;
    transform[i % 3][3] += if (i / 3).is_multiple_of(2) { 0.2 } else { -0.2 };
    transform
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_grow_tenfold_and_end_with_the_most() {
        assert_eq!(counts(100_000), [100, 1_000, 10_000, 100_000]);
        assert_eq!(counts(2_500), [100, 1_000, 2_500]);
        assert_eq!(counts(50), [50]);
    }
}
