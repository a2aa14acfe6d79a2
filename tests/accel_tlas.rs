//! Top-level structures and queries through them: the same worlds through ours and the driver's, against brute force.

mod common;

use common::backends::{Backend, backends, is_new_lavapipe};
use common::probe::{CONFIRM, CONFIRM_ODD, IGNORE, ProbeRay, Report, TERMINATE, flags};
use common::shapes::{Random, soup};
use common::world::{Part, World, inverse, transformed};
use hedgerow::accel::{Instance, REBRAID};
use hedgerow::ash::vk;
use vk::{GeometryFlagsKHR as GeometryFlags, GeometryInstanceFlagsKHR as Flags};

/// A matrix that turns, shears, mirrors, scales and moves.
fn moved(random: &mut Random) -> [[f32; 4]; 3] {
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
    let mut random = Random(seed);
    let boxes = |random: &mut Random, count| -> Vec<[[f32; 3]; 2]> {
        let one = |random: &mut Random| {
            let (at, size) = (random.point(1.0), random.point(0.2).map(f32::abs));
            [at, std::array::from_fn(|k| at[k] + size[k])]
        };
        (0..count).map(|_| one(random)).collect()
    };
    let parts = vec![
        Part::Triangles(vec![
            (soup(20, 0.5, seed), GeometryFlags::OPAQUE),
            (soup(15, 0.5, seed + 1), GeometryFlags::NO_DUPLICATE_ANY_HIT_INVOCATION),
        ]),
        Part::Triangles(vec![(soup(40, 0.4, seed + 2), GeometryFlags::OPAQUE)]),
        Part::Boxes(vec![
            (boxes(&mut random, 6), GeometryFlags::empty()),
            (boxes(&mut random, 5), GeometryFlags::OPAQUE),
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
    let mut random = Random(seed);
    let ray = |_| {
        let origin = random.point(6.0);
        let target = random.point(3.0);
        let scale = 10f32.powf(2.0 * random.signed());
        ProbeRay::new(origin, std::array::from_fn(|k| scale * (target[k] - origin[k])))
    };
    (0..count).map(ray).collect()
}

#[track_caller]
fn assert_close(got: &[f32], expected: &[f64], what: &str) {
    let size = expected.iter().fold(1e-2, |a: f64, b| a.max(b.abs()));
    let close = got.iter().zip(expected).all(|(&g, &e)| (f64::from(g) - e).abs() <= 2e-4 * size);
    assert!(close && got.len() == expected.len(), "{what}: {got:?}, expected {expected:?}");
}

/// A report is what brute force says; rays that rounding may decide are left out. Returns how many committed to a hit.
#[track_caller]
fn assert_reports(name: &str, world: &World, rays: &[ProbeRay], reports: &[Report]) -> usize {
    let mut hits = 0;
    let mut compared = 0;
    for (i, (ray, report)) in rays.iter().zip(reports).enumerate() {
        let what = format!("{name}: ray {i} {ray:?}");
        assert_eq!(
            (report.t_min, report.flags, report.origin, report.direction),
            (ray.t_min, ray.flags, ray.origin, ray.direction),
            "{what}"
        );
        if world.is_close_call(ray) {
            continue;
        }
        compared += 1;
        let got = &report.committed;
        if ray.flags & flags::FIRST_HIT != 0 || ray.decision == TERMINATE {
            // Any of the meetings may be the first.
            let any = world.meetings(ray);
            let found = any.iter().any(|met| met.place == [got.instance, got.geometry, got.primitive]);
            if ray.decision == TERMINATE {
                assert!(report.candidate_count <= 1, "{what}: goes on after its end");
                assert!(got.kind == 0 || found, "{what}");
            } else {
                assert_eq!(got.kind != 0, world.committed(ray).is_some(), "{what}");
                assert!(got.kind == 0 || found, "{what}");
            }
            hits += usize::from(got.kind != 0);
            continue;
        }
        let expected = world.committed(ray);
        let all = world.meetings(ray);
        if all.iter().all(|met| met.is_box || !met.is_opaque) && ray.decision == IGNORE {
            // Nothing shortens the ray: all are candidates.
            let mut places: Vec<[u32; 4]> =
                all.iter().map(|m| [u32::from(m.is_box), m.place[0], m.place[1], m.place[2]]).collect();
            places.sort_unstable();
            // Boxes may be candidates though the ray passes by.
            let count_of_triangles = places.iter().filter(|p| p[0] == 0).count();
            let got = report.sorted_candidates();
            if report.candidate_count <= 8 {
                assert_eq!(got.iter().filter(|c| c[0] == 0).count(), count_of_triangles, "{what}: {got:?} {places:?}");
                assert!(places.iter().all(|place| got.contains(place)), "{what}: {got:?} {places:?}");
            }
        }
        let Some(met) = expected else {
            assert_eq!(got.kind, 0, "{what}: {got:?}");
            continue;
        };
        hits += 1;
        let instance = &world.instances[met.place[0] as usize];
        assert_eq!(got.kind, if met.is_box { 2 } else { 1 }, "{what}: {got:?} {met:?}");
        if met.is_box {
            // All that are generated are equally near: any of them may be it.
            assert!(all.iter().any(|m| m.is_box && m.place == [got.instance, got.geometry, got.primitive]), "{what}");
            assert_eq!(got.t, ray.generated_t, "{what}");
            continue;
        }
        assert_eq!([got.instance, got.geometry, got.primitive], met.place, "{what}: {got:?} {met:?}");
        assert_close(&[got.t], &[met.t], &what);
        assert_close(&got.barycentrics, &met.weights, &what);
        assert_eq!(got.is_front != 0, met.is_front, "{what}: which side");
        assert_eq!(got.custom_index, instance.index_and_mask & 0xff_ffff, "{what}");
        assert_eq!(got.offset, instance.offset_and_flags & 0xff_ffff, "{what}");
        let to_object = inverse(&instance.transform);
        assert_close(&got.object_origin, &transformed(&to_object, ray.origin.map(f64::from), 1.0), &what);
        assert_close(&got.object_direction, &transformed(&to_object, ray.direction.map(f64::from), 0.0), &what);
        for column in 0..4 {
            let (world, object) = (instance.transform.map(|r| f64::from(r[column])), to_object.map(|r| r[column]));
            assert_close(&got.object_to_world[column], &world, &what);
            assert_close(&got.world_to_object[column], &object, &what);
        }
    }
    assert!(compared * 10 > rays.len() * 7, "{name}: only {compared} of {} rays tell anything", rays.len());
    hits
}

fn probed(backend: &dyn Backend, world: &World, rays: &[ProbeRay]) -> Vec<Report> {
    let built = world.build(backend);
    let reports = backend.probe(built.top.structure, rays);
    backend.destroy(built.top.structure);
    built.parts.iter().for_each(|part| backend.destroy(part.structure));
    reports
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
            if backend.name() == "driver" && is_new_lavapipe() {
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
            let reports = probed(&*backend, &world, &all);
            hits += assert_reports(backend.name(), &world, &all, &reports);
        }
        assert!(hits > 300, "{}: {hits} hits are no test", backend.name());
    }
}
