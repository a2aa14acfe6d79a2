//! Updating against building again, over an animation: time, growth of the SAH cost, and what rays lose.

use super::points::{self, AccelEntry, UpdatedRays};
use super::{AccelSetup, WARM_UPS, apart, where_possible};
use crate::Result;
use crate::measure::{Sink, Spread, in_turn, ratios};
use crate::rays::kinds::RayKind;
use crate::scene::{Animation, Mesh, Scene};
use crate::subjects::device_rays::RayBuffers;
use crate::subjects::level::Level;
use crate::subjects::queries::Queries;
use crate::subjects::structures::Structures;
use ash::vk;
use hedgerow::accel::Instance;
use hedgerow::gpu::Timestamps;
use hedgerow::trace::Query;

type Mode = vk::BuildAccelerationStructureModeKHR;
type Flags = vk::BuildAccelerationStructureFlagsKHR;

/// A mesh whose vertices move, as a bottom level under a top level of one instance.
struct Deforming<'a> {
    bottom: Level<'a>,
    /// Its box follows that of the bottom level: it is built before rays are traced.
    top: Level<'a>,
}

impl<'a> Deforming<'a> {
    /// Uploads the mesh; nothing is built yet.
    fn new(structures: &Structures<'a>, mesh: &Mesh) -> Result<Deforming<'a>> {
        let bottom = Level::bottom(structures, mesh, Flags::ALLOW_UPDATE)?;
        let top = Level::top(structures, &[bottom.instance(structures, Instance::IDENTITY)], Flags::empty())?;
        Ok(Deforming { bottom, top })
    }
}

/// What one maker has: a structure of the first frame that is updated, and one that is built again each frame.
struct Pair<'a> {
    structures: Structures<'a>,
    timestamps: Timestamps,
    updated: Deforming<'a>,
    built: Deforming<'a>,
    /// Whether updates are possible.
    updates: bool,
}

impl<'a> Pair<'a> {
    fn new(structures: Structures<'a>, animation: &Animation) -> Result<Pair<'a>> {
        let mesh = animation.mesh(0);
        let mut timestamps = Timestamps::new(structures.device, 1)?;
        let updated = Deforming::new(&structures, &mesh)?;
        updated.bottom.build(&structures, &mut timestamps, Mode::BUILD)?;
        let updates = where_possible(updated.bottom.build(&structures, &mut timestamps, Mode::UPDATE))?.is_some();
        let built = Deforming::new(&structures, &mesh)?;
        Ok(Pair { structures, timestamps, updated, built, updates })
    }

    /// Updates the one where that is possible, and builds the other; milliseconds of the build and of the update.
    fn build(&mut self) -> Result<(f64, Option<f64>)> {
        let Pair { structures, timestamps, updated, built, updates } = self;
        let update = updates.then(|| updated.bottom.build(structures, timestamps, Mode::UPDATE)).transpose()?;
        Ok((built.bottom.build(structures, timestamps, Mode::BUILD)?, update))
    }

    /// Traces rays through both; milliseconds through the one built again, and through the updated one.
    fn trace(&mut self, rays: &RayBuffers<'_>, query: Query) -> Result<(f64, Option<f64>)> {
        let Pair { structures, timestamps, updated, built, updates } = self;
        let mut trace = |top: &Level<'_>| structures.trace(timestamps, top.structure(), rays, query, Queries::OneEach);
        let updated = updates.then(|| trace(&updated.top)).transpose()?;
        Ok((trace(&built.top)?, updated))
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
    point: &mut Sink<'_, AccelEntry>,
) -> Result<()> {
    let mut pairs: Vec<Pair<'_>> =
        stage.makers().into_iter().map(|maker| Pair::new(maker, animation)).collect::<Result<_>>()?;
    for frame in chosen(animation.frames.len(), frames as usize) {
        (stage.say)(&format!("updating {}: frame {frame}", animation.name));
        let positions = &animation.frames[frame];
        for pair in &pairs {
            pair.updated.bottom.input().write(positions);
            pair.built.bottom.input().write(positions);
        }
        let builds = in_turn(&mut pairs, WARM_UPS, stage.runs, Pair::build);
        for Pair { structures, timestamps, updated, built, .. } in &mut pairs {
            updated.top.build(structures, timestamps, Mode::BUILD)?;
            built.top.build(structures, timestamps, Mode::BUILD)?;
        }
        let scene = Scene {
            name: animation.name.clone(),
            mesh: animation.mesh(frame),
            camera: animation.camera,
            lights: Vec::new(),
        };
        let mut rays = vec![Vec::new(); pairs.len()];
        for (kind, buffers) in stage.rays_to(&scene)? {
            for (rays, traced) in rays.iter_mut().zip(traced(stage, &mut pairs, kind, &buffers)?) {
                rays.push(traced);
            }
        }
        for ((pair, builds), rays) in pairs.iter().zip(builds).zip(rays) {
            let (builds, updates) = apart(&builds?);
            let updated = pair.updated.bottom.header().filter(|_| pair.updates);
            point(AccelEntry::Update(points::Update {
                scene: animation.name.clone(),
                triangles: animation.triangles.len() as u64,
                frame: frame as u32,
                maker: pair.structures.maker(),
                build_ms: Spread::of_some(&builds)?,
                update_ms: Spread::of(&updates),
                growth: updated.map(|header| header.sah_growth().into()),
                updated_sah: updated.map(|header| header.sah().into()),
                built_sah: pair.built.bottom.header().map(|header| header.sah().into()),
                rays,
            }))?;
        }
    }
    Ok(())
}

/// The rays through both structures of every maker, in turn.
fn traced(
    stage: &AccelSetup<'_>,
    pairs: &mut [Pair<'_>],
    kind: RayKind,
    buffers: &RayBuffers<'_>,
) -> Result<Vec<UpdatedRays>> {
    let times = in_turn(pairs, WARM_UPS, stage.runs, |pair| pair.trace(buffers, kind.query()));
    let rays = times.into_iter().map(|times| {
        let (built, updated) = apart(&times?);
        Ok(UpdatedRays {
            rays: kind.name().into(),
            count: buffers.count.into(),
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
