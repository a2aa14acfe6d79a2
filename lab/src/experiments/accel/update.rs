//! Updating against building anew, over an animation: time, growth of the SAH cost, and what rays lose.

use super::bundles::{self, Bundle};
use super::deforming::Deforming;
use super::points::{self, AccelEntry, UpdatedRays};
use super::{AccelSetup, WARM_UPS, where_possible};
use crate::Result;
use crate::measure::statistics::{Spread, in_turn, ratios};
use crate::scene::{Animation, Scene};
use crate::subjects::structures::Structures;

/// What one maker has: a structure of the first frame that is updated, and one that is built anew each frame.
struct Pair<'a> {
    structures: Structures<'a>,
    updated: Deforming<'a>,
    built: Deforming<'a>,
    /// Whether updates are possible.
    updates: bool,
}

impl<'a> Pair<'a> {
    fn new(structures: Structures<'a>, animation: &Animation) -> Result<Pair<'a>> {
        let mesh = animation.mesh(0);
        let mut updated = Deforming::new(structures.clone(), &mesh)?;
        updated.build()?;
        let updates = where_possible(updated.update())?.is_some();
        let built = Deforming::new(structures.clone(), &mesh)?;
        Ok(Pair { structures, updated, built, updates })
    }
}

/// Measures at most `frames` frames of an animation, evenly from the first to the last.
///
/// # Errors
/// Too little memory; the device failed.
pub fn measure(
    stage: &AccelSetup<'_>,
    animation: &Animation,
    frames: u32,
    point: &mut dyn FnMut(AccelEntry) -> Result<()>,
) -> Result<()> {
    let mut pairs: Vec<Pair<'_>> =
        stage.makers().into_iter().map(|maker| Pair::new(maker, animation)).collect::<Result<_>>()?;
    for frame in chosen(animation.frames.len(), frames as usize) {
        (stage.say)(&format!("updating {}: frame {frame}", animation.name));
        let positions = &animation.frames[frame];
        for pair in &pairs {
            pair.updated.set_positions(positions);
            pair.built.set_positions(positions);
        }
        let builds = in_turn(&mut pairs, WARM_UPS, stage.runs, |pair| {
            let update = pair.updates.then(|| pair.updated.update()).transpose()?;
            Ok((pair.built.build()?, update))
        });
        for pair in &mut pairs {
            pair.updated.build_top()?;
            pair.built.build_top()?;
        }
        let scene = Scene {
            name: animation.name.clone(),
            mesh: animation.mesh(frame),
            camera: animation.camera,
            lights: Vec::new(),
        };
        let mut rays = vec![Vec::new(); pairs.len()];
        for bundle in bundles::of(stage, &scene)? {
            for (rays, traced) in rays.iter_mut().zip(traced(stage, &mut pairs, &bundle)?) {
                rays.push(traced);
            }
        }
        for ((pair, builds), rays) in pairs.iter().zip(builds).zip(rays) {
            let builds = builds?;
            let updates: Vec<f64> = builds.iter().filter_map(|b| b.1).collect();
            let updated = pair.updated.header().filter(|_| pair.updates);
            point(AccelEntry::Update(points::Update {
                scene: animation.name.clone(),
                triangles: animation.triangles.len() as u64,
                frame: frame as u32,
                maker: pair.structures.maker(),
                build_ms: Spread::of_some(&builds.iter().map(|b| b.0).collect::<Vec<_>>())?,
                update_ms: Spread::of(&updates),
                growth: updated.map(|header| header.sah_growth().into()),
                updated_sah: updated.map(|header| header.sah().into()),
                built_sah: pair.built.header().map(|header| header.sah().into()),
                rays,
            }))?;
        }
    }
    Ok(())
}

/// The rays through both structures of every maker, in turn.
fn traced(stage: &AccelSetup<'_>, pairs: &mut [Pair<'_>], bundle: &Bundle<'_>) -> Result<Vec<UpdatedRays>> {
    let trace = |deforming: &mut Deforming<'_>| deforming.trace(&bundle.buffers, bundle.kind.query());
    let times = in_turn(pairs, WARM_UPS, stage.runs, |pair| {
        let updated = pair.updates.then(|| trace(&mut pair.updated)).transpose()?;
        Ok((trace(&mut pair.built)?, updated))
    });
    let rays = times.into_iter().map(|times| {
        let times = times?;
        let built: Vec<f64> = times.iter().map(|t| t.0).collect();
        let updated: Vec<f64> = times.iter().filter_map(|t| t.1).collect();
        Ok(UpdatedRays {
            rays: bundle.kind.name().into(),
            count: bundle.buffers.count.into(),
            built_ms: Spread::of_some(&built)?,
            updated_ms: Spread::of(&updated),
            slowdown: Spread::of(&ratios(&updated, &built)),
        })
    });
    rays.collect()
}

/// At most `most` of `count` frames, with the first and the last.
fn chosen(count: usize, most: usize) -> Vec<usize> {
    if count <= most {
        return (0..count).collect();
    }
    (0..most).map(|i| if most == 1 { 0 } else { i * (count - 1) / (most - 1) }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_chosen_evenly_with_the_first_and_the_last() {
        assert_eq!(chosen(3, 12), [0, 1, 2]);
        assert_eq!(chosen(24, 4), [0, 7, 15, 23]);
        assert_eq!(chosen(24, 1), [0]);
    }
}
