//! Memory of bottom levels, by what is asked for: the structure, the scratch memory of its build, and a compacted copy.

use super::points::{AccelEntry, Implementation, MemoryPoint};
use super::{AccelSetup, WARM_UPS};
use crate::Result;
use crate::measure::{Sink, Spread, in_turn};
use crate::scene::{Instances, Mesh};
use crate::subjects::level::Level;
use crate::subjects::structures::Structures;
use ash::vk;
use hedgerow::accel::{AccelOptions, Wide};
use hedgerow::gpu::Timestamps;

type Flags = vk::BuildAccelerationStructureFlagsKHR;

/// What is built beside each other: in nodes of eight or not, and by which flags. All can be compacted.
const BUILT: [(Wide, Flags); 5] = [
    (Wide::Never, Flags::PREFER_FAST_BUILD),
    (Wide::Never, Flags::PREFER_FAST_TRACE),
    (Wide::Always, Flags::empty()),
    (Wide::Always, Flags::PREFER_FAST_TRACE),
    (Wide::Always, Flags::from_raw(Flags::PREFER_FAST_TRACE.as_raw() | Flags::LOW_MEMORY.as_raw())),
];

/// A structure of a maker's.
struct Built<'a> {
    maker: Structures<'a>,
    of_eight: bool,
    flags: Flags,
    level: Level<'a>,
    timestamps: Timestamps,
}

impl<'a> Built<'a> {
    fn new(maker: Structures<'a>, of_eight: bool, flags: Flags, mesh: &Mesh) -> Result<Built<'a>> {
        let flags = flags | Flags::ALLOW_COMPACTION;
        let level = Level::bottom(&maker, mesh, flags)?;
        let timestamps = Timestamps::new(maker.device, 1)?;
        Ok(Built { maker, of_eight, flags, level, timestamps })
    }

    fn build(&mut self) -> Result<f64> {
        self.level.build(&self.maker, &mut self.timestamps, vk::BuildAccelerationStructureModeKHR::BUILD)
    }
}

/// Measures a scene, all of whose parts are one structure here.
///
/// # Errors
/// Too little memory; the device failed.
pub fn measure(stage: &AccelSetup<'_>, scene: &Instances, point: &mut Sink<'_, AccelEntry>) -> Result<()> {
    (stage.say)(&format!("memory of {}", scene.name));
    let mesh = joined(&scene.parts);
    let ours = BUILT.into_iter().map(|(wide, flags)| {
        (Structures::ours(stage.device, AccelOptions { wide, ..AccelOptions::DEFAULT }), wide == Wide::Always, flags)
    });
    let drivers = Structures::drivers(stage.device).map(|driver| (driver, false, Flags::PREFER_FAST_TRACE));
    let built = ours.chain(drivers).map(|(maker, of_eight, flags)| Built::new(maker, of_eight, flags, &mesh));
    let mut built: Vec<Built<'_>> = built.collect::<Result<_>>()?;
    let times = in_turn(&mut built, WARM_UPS, stage.runs, Built::build);
    for (built, times) in built.iter().zip(times) {
        let [structure_bytes, scratch_bytes] = built.level.bytes();
        point(AccelEntry::Memory(MemoryPoint {
            scene: scene.name.clone(),
            triangles: mesh.triangles.len() as u64,
            maker: built.maker.maker(),
            of_eight: built.of_eight,
            flags: names(built.flags),
            build_ms: Spread::of_some(&times?)?,
            structure_bytes,
            scratch_bytes,
            compacted_bytes: match built.maker.maker() {
                Implementation::Ours => Some(built.maker.compacted_bytes(built.level.structure())?),
                Implementation::Driver => None,
            },
        }))?;
    }
    Ok(())
}

/// The preferences among the flags, in words.
fn names(flags: Flags) -> String {
    let all = [
        (Flags::PREFER_FAST_BUILD, "fast build"),
        (Flags::PREFER_FAST_TRACE, "fast trace"),
        (Flags::LOW_MEMORY, "low memory"),
    ];
    let names: Vec<&str> = all.iter().filter(|(flag, _)| flags.contains(*flag)).map(|(_, name)| *name).collect();
    if names.is_empty() { "none".into() } else { names.join(", ") }
}

fn joined(parts: &[Mesh]) -> Mesh {
    let mut all = Mesh { positions: Vec::new(), triangles: Vec::new() };
    for part in parts {
        let first = all.positions.len() as u32;
        all.positions.extend_from_slice(&part.positions);
        all.triangles.extend(part.triangles.iter().map(|triangle| triangle.map(|vertex| first + vertex)));
    }
    all
}
