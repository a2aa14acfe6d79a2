//! Top-level structures and queries through them: the same worlds through ours and the driver's, against brute force.

use crate::common::agree::assert_agrees;
use crate::common::backends::backends;
use crate::common::probe::{CONFIRM, CONFIRM_ODD, IGNORE, ProbeRay, TERMINATE, flags};
use crate::common::shapes::{boxes, soup};
use crate::common::world::{Part, World, inverse};
use hedgerow::accel::{Instance, REBRAID};
use hedgerow::ash::vk;
use hedgerow_lab::random::SplitMix64;
use vk::{GeometryFlagsKHR as GeometryFlags, GeometryInstanceFlagsKHR as Flags};

/// A matrix that turns, shears, mirrors, scales and moves.
fn moved(random: &mut SplitMix64) -> [[f32; 4]; 3] {
    loop {
        let m: [[f32; 4]; 3] =
            [(); 3].map(|()| [random.signed(), random.signed(), random.signed(), 4.0 * random.signed()]);
        // Not so flat that float32 has little to say of where a ray goes.
        let largest = inverse(&m).iter().flatten().fold(0f64, |a, b| a.max(b.abs()));
        if largest < 12.0 {
            return m;
        }
    }
}

/// Three parts (two geometries of triangles, one of them opaque; one opaque; boxes) seen thirty times.
fn world(seed: u64) -> World {
    let mut random = SplitMix64::new(seed);
    let parts = vec![
        Part::Triangles(vec![
            (soup(20, 0.5, seed), GeometryFlags::OPAQUE),
            (soup(15, 0.5, seed + 1), GeometryFlags::NO_DUPLICATE_ANY_HIT_INVOCATION),
        ]),
        Part::Triangles(vec![(soup(40, 0.4, seed + 2), GeometryFlags::OPAQUE)]),
        Part::Boxes(vec![
            (boxes(6, 0.2, seed + 3), GeometryFlags::empty()),
            (boxes(5, 0.2, seed + 4), GeometryFlags::OPAQUE),
        ]),
    ];
    let all_flags = [
        Flags::empty(),
        Flags::TRIANGLE_FACING_CULL_DISABLE,
        Flags::TRIANGLE_FLIP_FACING,
        Flags::FORCE_OPAQUE,
        Flags::FORCE_NO_OPAQUE,
        Flags::TRIANGLE_FLIP_FACING | Flags::FORCE_NO_OPAQUE,
    ];
    let instances = (0..30)
        .map(|i| {
            let part = 1 + random.bits() % 3;
            // Some are inactive.
            let structure = if i % 7 == 6 { 0 } else { part };
            let (index, mask) = (random.bits() as u32 & 0xff_ffff, 1 << (random.bits() % 8));
            let (offset, flags) = (random.bits() as u32 & 0xff_ffff, all_flags[random.bits() as usize % 6]);
            let transform = if i == 3 { Instance::IDENTITY } else { moved(&mut random) };
            Instance::new(structure, transform).with_index_and_mask(index, mask).with_offset_and_flags(offset, flags)
        })
        .collect();
    World::new(parts, instances)
}

fn rays(seed: u64, count: usize) -> Vec<ProbeRay> {
    let mut random = SplitMix64::new(seed);
    let ray = |_| {
        let origin = random.around(6.0);
        let target = random.around(3.0);
        let scale = 10f32.powf(2.0 * random.signed());
        ProbeRay::new(origin, std::array::from_fn(|k| scale * (target[k] - origin[k])))
    };
    (0..count).map(ray).collect()
}

#[test]
fn every_flag_and_decision_is_reported_as_by_brute_force() {
    let all_flags = [
        flags::NONE,
        flags::OPAQUE,
        flags::NO_OPAQUE,
        flags::FIRST_HIT,
        flags::CULL_BACK,
        flags::CULL_FRONT,
        flags::CULL_OPAQUE,
        flags::CULL_NO_OPAQUE,
        flags::SKIP_TRIANGLES,
        flags::SKIP_BOXES,
        flags::CULL_BACK | flags::NO_OPAQUE,
        flags::SKIP_BOXES | flags::CULL_FRONT | flags::FIRST_HIT,
    ];
    for backend in backends() {
        let mut hits = 0;
        for (by_pointers, seed, rebraids) in [(false, 1, false), (true, 2, false), (false, 1, true), (true, 2, true)] {
            let mut world = World { by_pointers, ..world(seed) };
            if rebraids {
                // The flag is ours alone.
                if backend.name() == "driver" {
                    continue;
                }
                world.flags = REBRAID;
            }
            if backend.name() == "driver" && crate::common::device().workarounds.driver_crashes_on_inactive_instances {
                world.instances.retain(|instance| instance.structure != 0);
            }
            let mut all = Vec::new();
            let mut base = rays(seed, 600).into_iter().cycle();
            for flags in all_flags {
                for decision in [IGNORE, CONFIRM, CONFIRM_ODD, TERMINATE] {
                    for mask in [0xff, 0x0f, 0x81] {
                        for _ in 0..20 {
                            let ray = base.next().expect("a cycle");
                            let t_max = [1e30, 0.9][all.len() % 2];
                            all.push(ProbeRay { flags, decision, mask, t_max, generated_t: 0.25, ..ray });
                        }
                    }
                }
            }
            hits += assert_agrees(&*backend, &format!("world {seed}"), &world, &all);
        }
        assert!(hits > 300, "{}: {hits} hits are no test", backend.name());
    }
}
