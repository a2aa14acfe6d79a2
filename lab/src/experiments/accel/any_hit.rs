//! Children in order for rays that end at any hit, and not: what that takes to build, and what shadow and ao rays gain by queries.

use super::points::{AccelEntry, AnyHitPoint};
use super::rebraid::all_traced;
use super::{AccelSetup, WARM_UPS};
use crate::Result;
use crate::measure::{Sink, Spread, in_turn};
use crate::rays::sample;
use crate::scene::Instances;
use crate::subjects::levels::Levels;
use crate::subjects::structures::Structures;
use ash::vk;
use hedgerow::accel::ANY_HIT_ORDER;

type Flags = vk::BuildAccelerationStructureFlagsKHR;

/// Measures one scene by shadow and ao rays, whatever kinds the others take.
///
/// # Errors
/// Too little memory; the device failed; the scene is too large to be flattened, which rays are made with.
pub fn measure(stage: &AccelSetup<'_>, instances: &Instances, point: &mut Sink<'_, AccelEntry>) -> Result<()> {
    let say = |what: &str| (stage.say)(&format!("order of children in {}: {what}", instances.name));
    say("building");
    let ours = [(stage.ours(), Flags::empty()), (stage.ours(), ANY_HIT_ORDER)];
    let all = ours.into_iter().chain(Structures::drivers(stage.device).map(|drivers| (drivers, Flags::empty())));
    let levels = all.map(|(maker, flags)| Levels::new(maker, instances, flags));
    let mut levels: Vec<Levels<'_>> = levels.collect::<Result<_>>()?;
    let builds = in_turn(&mut levels, WARM_UPS, stage.runs, Levels::build);
    let builds: Vec<Spread> = builds.into_iter().map(|builds| Spread::of_some(&builds?)).collect::<Result<_>>()?;
    let stage = AccelSetup { kinds: &sample::ANY_HIT, ..*stage };
    point(AccelEntry::AnyHit(AnyHitPoint {
        scene: instances.name.clone(),
        instances: instances.instances.len() as u32,
        parts: instances.parts.len() as u32,
        triangles: instances.triangle_count(),
        off_build_ms: builds[0],
        on_build_ms: builds[1],
        rays: all_traced(&stage, instances, &mut levels, &say)?,
    }))
}
