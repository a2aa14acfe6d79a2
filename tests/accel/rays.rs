//! Rays of every length, direction and limit: the same meetings through ours and the driver's, against brute force.

use crate::common::agree::{assert_agrees, probed};
use crate::common::backends::{Ours, backends};
use crate::common::device;
use crate::common::matrices::{rotation, scaled};
use crate::common::probe::{CONFIRM, IGNORE, ProbeRay, flags};
use crate::common::shapes::{boxes, soup};
use crate::common::world::{Part, World};
use hedgerow::accel::Instance;
use hedgerow::ash::vk::GeometryFlagsKHR as GeometryFlags;
use hedgerow_lab::random::SplitMix64;

/// Triangles and boxes, each under the same matrix.
fn world(transform: [[f32; 4]; 3]) -> World {
    let parts = vec![
        Part::Triangles(vec![(soup(40, 0.5, 3), GeometryFlags::OPAQUE)]),
        Part::Boxes(vec![(boxes(12, 0.2, 4), GeometryFlags::empty())]),
    ];
    World::new(parts, vec![Instance::new(1, transform), Instance::new(2, transform)])
}

/// From outside and inside towards places inside, in units of `scale`; every other asks for candidates.
fn rays(count: usize, scale: f32, length: f32, seed: u64) -> Vec<ProbeRay> {
    let mut random = SplitMix64::new(seed);
    let ray = |i: usize| {
        let origin = random.around([3.0, 0.5][i / 2 % 2] * scale);
        let target = random.around(0.8 * scale);
        let way: [f32; 3] = std::array::from_fn(|k| target[k] - origin[k]);
        let by = length / way.iter().map(|x| x * x).sum::<f32>().sqrt();
        let (flags, decision) = [(flags::SKIP_BOXES, CONFIRM), (flags::NO_OPAQUE, IGNORE)][i % 2];
        ProbeRay { flags, decision, ..ProbeRay::new(origin, way.map(|x| x * by)) }
    };
    (0..count).map(ray).collect()
}

/// `direction_length` of VK-GL-CTS, with lengths of eighteen orders of magnitude.
#[test]
fn directions_of_every_length_meet_the_same_places() {
    for backend in backends() {
        let mut hits = 0;
        for (i, scale) in [0.2, 1.0, 7.0].into_iter().enumerate() {
            for turn in 0..4 {
                let world = world(scaled(rotation(turn), [scale; 3]));
                let lengths = [1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e6, 1e9];
                let rays: Vec<ProbeRay> =
                    lengths.into_iter().flat_map(|length| rays(30, scale, length, 10 * turn + i as u64)).collect();
                hits += assert_agrees(&*backend, &format!("scale {scale}, turn {turn}"), &world, &rays);
            }
        }
        assert!(hits > 500, "{}: {hits} hits are no test", backend.name());
    }
}

#[test]
fn directions_along_axes_and_diagonals_meet_the_same_places() {
    let mut random = SplitMix64::new(8);
    let mut rays = Vec::new();
    for code in 0..5u32.pow(3) {
        // Zeros of both signs, and both ways along every axis.
        let component = |k: u32| [-0.0, 0.0, 1.0, -1.0, 1.0][(code / 5u32.pow(k) % 5) as usize];
        let direction: [f32; 3] = std::array::from_fn(|k| component(k as u32));
        if direction == [0.0; 3] {
            continue;
        }
        for i in 0..6 {
            let inside = random.around(0.7);
            let origin = std::array::from_fn(|k| inside[k] - [0.0, 4.0][i / 2 % 2] * direction[k]);
            let (flags, decision) = [(flags::SKIP_BOXES, CONFIRM), (flags::NO_OPAQUE, IGNORE)][i % 2];
            rays.push(ProbeRay { flags, decision, ..ProbeRay::new(origin, direction) });
        }
    }
    let quarter_turn = [[0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0]];
    for backend in backends() {
        for (name, transform) in
            [("identity", Instance::IDENTITY), ("quarter turn", quarter_turn), ("turned", rotation(1))]
        {
            let hits = assert_agrees(&*backend, name, &world(transform), &rays);
            assert!(hits > rays.len() / 8, "{}, {name}: {hits} hits are no test", backend.name());
        }
    }
}

/// A triangle that the ray from `(1, 1, 0)` along z meets at exactly 4, with weights of exactly a quarter.
fn exact() -> World {
    let triangle = [[0.0, 0.0, 4.0], [4.0, 0.0, 4.0], [0.0, 4.0, 4.0]];
    let part = Part::Triangles(vec![(vec![triangle], GeometryFlags::OPAQUE)]);
    World::new(vec![part], vec![Instance::new(1, Instance::IDENTITY)])
}

#[test]
fn a_limit_that_equals_t_leaves_the_hit_out_and_the_next_float_lets_it_in() {
    let (at, below, above) = (4f32, 4f32.next_down(), 4f32.next_up());
    let cases = [
        (0.0, at, false),
        (0.0, below, false),
        (0.0, above, true),
        (at, 1e30, false),
        (above, 1e30, false),
        (below, 1e30, true),
        (below, above, true),
        (at, at, false),
        (below, below, false),
        (0.0, 0.0, false),
        (0.0, f32::INFINITY, true),
    ];
    for backend in backends() {
        for length in [1.0, 2f32.powi(-29), 2f32.powi(30)] {
            // From before the triangle and from behind it; and from its plane, where t is 0.
            for (origin_z, towards) in [(0.0, 1.0), (8.0, -1.0)] {
                let ray = ProbeRay::new([1.0, 1.0, origin_z], [0.0, 0.0, towards * length]);
                let all =
                    cases.map(|(t_min, t_max, _)| ProbeRay { t_min: t_min / length, t_max: t_max / length, ..ray });
                let reports = probed(&*backend, &exact(), &all);
                for ((case, ray), report) in cases.iter().zip(&all).zip(&reports) {
                    let hit = &report.committed;
                    assert_eq!(hit.kind != 0, case.2, "{}: {case:?}, {ray:?}: {hit:?}", backend.name());
                    if case.2 {
                        let expected = (4.0 / length, [0.25; 2], u32::from(towards < 0.0));
                        assert_eq!((hit.t, hit.barycentrics, hit.is_front), expected, "{}: {case:?}", backend.name());
                    }
                }
            }
            let from_the_plane = ProbeRay::new([1.0, 1.0, 4.0], [0.25 * length, 0.5 * length, length]);
            let report = probed(&*backend, &exact(), &[from_the_plane]);
            assert_eq!(report[0].committed.kind, 0, "{}: t is 0, and so is t_min", backend.name());
        }
    }
}

/// Vulkan asks that limits are not negative; ours takes them as they are.
#[test]
fn a_negative_limit_lets_in_what_lies_behind() {
    let behind = ProbeRay { t_min: -8.0, ..ProbeRay::new([1.0, 1.0, 8.0], [0.0, 0.0, 1.0]) };
    let on = ProbeRay { t_min: -1e-30, ..ProbeRay::new([1.0, 1.0, 4.0], [0.0, 0.0, 1.0]) };
    let cases = [(behind, Some(-4.0)), (ProbeRay { t_max: -4.0, ..behind }, None), (on, Some(0.0))];
    let reports = probed(&Ours::on(device()), &exact(), &cases.map(|(ray, _)| ray));
    for ((ray, expected), report) in cases.iter().zip(&reports) {
        let hit = &report.committed;
        assert_eq!((hit.kind != 0).then_some(hit.t), *expected, "{ray:?}");
    }
}

/// Ours alone: Vulkan leaves undefined what such rays do.
#[test]
fn what_is_no_ray_meets_nothing() {
    let (nan, inf) = (f32::NAN, f32::INFINITY);
    let good = ProbeRay::new([1.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    let mut bad = vec![
        ProbeRay { direction: [0.0; 3], ..good },
        ProbeRay { direction: [-0.0; 3], t_min: -inf, ..good },
        ProbeRay { direction: [0.0, 0.0, 1e-40], ..good },
        ProbeRay { direction: [0.0, 0.0, 3e38], ..good },
        ProbeRay { t_min: nan, ..good },
        ProbeRay { t_max: nan, ..good },
        ProbeRay { t_min: 9.0, t_max: 1.0, ..good },
        ProbeRay { t_min: inf, t_max: inf, ..good },
        ProbeRay { t_min: -inf, t_max: -inf, ..good },
    ];
    for k in 0..3 {
        for what in [nan, inf, -inf] {
            let set = |mut v: [f32; 3]| {
                v[k] = what;
                v
            };
            bad.push(ProbeRay { origin: set(good.origin), ..good });
            bad.push(ProbeRay { direction: set(good.direction), ..good });
            bad.push(ProbeRay { origin: [what; 3], direction: [what; 3], t_min: what, t_max: what, ..good });
        }
    }
    // Among good ones, and through boxes and triangles.
    let all: Vec<ProbeRay> = bad.iter().flat_map(|&ray| [ray, good]).collect();
    let boxes = Part::Boxes(vec![(vec![[[0.0, 0.0, -1.0], [4.0, 4.0, 6.0]]], GeometryFlags::empty())]);
    let boxes = World::new(vec![boxes], vec![Instance::new(1, rotation(1)), Instance::new(1, Instance::IDENTITY)]);
    for world in [exact(), boxes] {
        let reports = probed(&Ours::on(device()), &world, &all);
        for (ray, report) in all.iter().zip(&reports) {
            let is_good = *ray == good;
            assert_eq!(report.committed.kind != 0, is_good, "{ray:?}: {:?}", report.committed);
            assert!(is_good || report.candidate_count == 0, "{ray:?}: {} candidates", report.candidate_count);
        }
    }
}
