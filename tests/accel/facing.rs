//! Who sees what: masks, sides of triangles, mirrored instances and geometries.

use crate::common::agree::{assert_agrees, assert_reports, probed};
use crate::common::backends::{backends, vk_geometry};
use crate::common::geometries::Owned;
use crate::common::matrices::{moved, rotation, scaled};
use crate::common::probe::{ProbeRay, flags};
use crate::common::shapes::{Corners, icosphere, onto_sphere, soup};
use crate::common::world::{Part, World, bottom_level};
use hedgerow::accel::Instance;
use hedgerow::ash::vk;
use hedgerow::bvh::geometry::{IndexFormat, VertexFormat};
use hedgerow_lab::random::SplitMix64;
use vk::{GeometryFlagsKHR as GeometryFlags, GeometryInstanceFlagsKHR as Flags};

#[test]
fn a_ray_sees_the_instances_whose_mask_shares_a_bit_with_its_own() {
    let masks = [0, 1, 2, 4, 8, 0x10, 0x20, 0x40, 0x80, 0xff, 0x5a, 0xfe];
    let all_bits = Flags::TRIANGLE_FACING_CULL_DISABLE | Flags::TRIANGLE_FLIP_FACING | Flags::FORCE_OPAQUE;
    let square = vec![[[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]]];
    let part = Part::Triangles(vec![(square, GeometryFlags::empty())]);
    // The fields beside the mask have no bit in it, whether they are full or empty.
    for (index, offset, instance_flags) in [
        (0xff_ffff, 0xff_ffff, all_bits),
        (0, 0, Flags::empty()),
        (0x80_0000, 1, Flags::FORCE_NO_OPAQUE),
        (1, 0x80_0000, Flags::FORCE_OPAQUE),
    ] {
        let place = |(i, &mask): (usize, &u8)| {
            Instance::new(1, moved(Instance::IDENTITY, [4.0 * i as f32, 0.0, 0.0]))
                .with_index_and_mask(index, mask)
                .with_offset_and_flags(offset, instance_flags)
        };
        let world = World::new(vec![part.clone()], masks.iter().enumerate().map(place).collect());
        let to = |i: usize| ProbeRay::new([4.0 * i as f32 + 0.1, 0.05, -3.0], [0.0, 0.0, 1.0]);
        // Of a ray's mask eight bits count.
        let rays: Vec<ProbeRay> = (0..masks.len())
            .flat_map(|i| masks.map(|mask| ProbeRay { mask: u32::from(mask), ..to(i) }))
            .chain((0..masks.len()).flat_map(|i| [!0xff, !0x7f].map(|mask| ProbeRay { mask, ..to(i) })))
            .collect();
        for backend in backends() {
            let mut world = world.clone();
            if backend.name() == "driver" && crate::common::device().workarounds.driver_crashes_on_inactive_instances {
                world.instances.remove(0);
            }
            let hits = assert_agrees(&*backend, &format!("index {index:#x}"), &world, &rays);
            let shared = |mask: u32| masks.iter().filter(|&&other| u32::from(other) & mask != 0).count();
            let expected: usize = masks.iter().map(|&mask| shared(mask.into())).sum::<usize>() + shared(0x80);
            assert_eq!(hits, expected, "{}", backend.name());
        }
    }
}

/// A sphere whose triangles all show their fronts outside.
fn outward_sphere() -> Corners {
    let turned = |[a, b, c]: [[f32; 3]; 3]| {
        let volume = a[0] * (b[1] * c[2] - b[2] * c[1])
            + a[1] * (b[2] * c[0] - b[0] * c[2])
            + a[2] * (b[0] * c[1] - b[1] * c[0]);
        if volume > 0.0 { [a, b, c] } else { [a, c, b] }
    };
    icosphere(2).into_iter().map(turned).collect()
}

/// Which side is the object's, whatever its matrix does with it; and culling goes by that.
#[test]
fn a_sphere_shows_its_front_outside_and_its_back_inside_even_when_it_is_mirrored() {
    let mirrored = scaled(rotation(2), [-1.0, 1.0, 1.0]);
    let inverted = scaled(rotation(3), [-2.0; 3]);
    let sphere = Part::Triangles(vec![(outward_sphere(), GeometryFlags::OPAQUE)]);
    let kinds = [Flags::empty(), Flags::TRIANGLE_FLIP_FACING, Flags::TRIANGLE_FACING_CULL_DISABLE];
    for backend in backends() {
        for (name, matrix) in [("plain", rotation(1)), ("mirrored", mirrored), ("inverted", inverted)] {
            for instance_flags in kinds {
                let instance = Instance::new(1, matrix).with_offset_and_flags(0, instance_flags);
                let world = World::new(vec![sphere.clone()], vec![instance]);
                let mut random = SplitMix64::new(6);
                let through: Vec<[f32; 3]> = (0..60).map(|_| onto_sphere(random.around(1.0))).collect();
                // From far outside through a place near the centre: in at the front, out at the back.
                let ray = |way: &[f32; 3]| ProbeRay::new(way.map(|x| -6.0 * x), way.map(|x| 1.01 * x + 0.003));
                let culls = [flags::NONE, flags::CULL_BACK, flags::CULL_FRONT];
                let rays: Vec<ProbeRay> = culls
                    .into_iter()
                    .flat_map(|flags| through.iter().map(move |way| ProbeRay { flags, ..ray(way) }))
                    .collect();
                let what = format!("{}, {name}, {instance_flags:?}", backend.name());
                let reports = probed(&*backend, &world, &rays);
                assert_reports(&what, &world, &rays, &reports);
                let flips = instance_flags == Flags::TRIANGLE_FLIP_FACING;
                for (i, report) in reports[..through.len()].iter().enumerate() {
                    let culled = [1, 2].map(|k| reports[k * through.len() + i].committed);
                    let [without_back, without_front] = if flips { [culled[1], culled[0]] } else { culled };
                    assert_eq!(report.committed.is_front == 1, !flips, "{what}: ray {i}");
                    assert_eq!(without_back, report.committed, "{what}: ray {i}");
                    if instance_flags == Flags::TRIANGLE_FACING_CULL_DISABLE {
                        assert_eq!(without_front, report.committed, "{what}: ray {i}");
                    } else {
                        assert_eq!(without_front.is_front == 1, flips, "{what}: ray {i}");
                        assert!(without_front.t > report.committed.t, "{what}: ray {i} goes out where it came in");
                    }
                }
            }
        }
    }
}

/// Unlike the matrix of an instance, that of a geometry moves its vertices: mirrored triangles turn round.
#[test]
fn the_transform_of_a_geometry_that_mirrors_turns_its_triangles_round() {
    let corners = soup(60, 0.6, 14);
    for (name, matrix) in [
        ("as it is", Instance::IDENTITY),
        ("mirrored", [[-1.0, 0.0, 0.0, 0.5], [0.0, 2.0, 0.0, 0.0], [0.0, 0.0, 1.0, -0.25]]),
        ("axes exchanged", [[0.0, 1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.5], [0.0, 0.0, 1.0, 0.0]]),
    ] {
        let mut owned = Owned::of(&corners, VertexFormat::FLOAT3, IndexFormat::U32, 4);
        // Exact: small multiples of 1/8 times powers of two.
        let vertex = |v: &[f32; 3]| v.map(|x| (8.0 * x).round() / 8.0);
        let image = |v: [f32; 3]| matrix.map(|[a, b, c, d]| a * v[0] + b * v[1] + c * v[2] + d);
        let expected: Corners = corners.iter().map(|t| t.each_ref().map(|v| image(vertex(v)))).collect();
        owned.transform = Some(matrix);
        let instances = vec![Instance::new(1, rotation(5)), Instance::new(1, scaled(rotation(6), [1.0, -1.0, 1.0]))];
        let world = World::new(vec![Part::Triangles(vec![(expected, GeometryFlags::OPAQUE)])], instances);
        let mut random = SplitMix64::new(3);
        let rays: Vec<ProbeRay> = (0..600)
            .map(|i| {
                let (origin, way) = (random.around(4.0), random.around(1.0));
                let towards = std::array::from_fn(|k| way[k] - origin[k]);
                let flags = [flags::NONE, flags::CULL_BACK, flags::CULL_FRONT][i % 3];
                ProbeRay { flags, ..ProbeRay::new(origin, towards) }
            })
            .collect();
        for backend in backends() {
            let (geometry, memory) = owned.upload(0, 0);
            let range = vk::AccelerationStructureBuildRangeInfoKHR::default().primitive_count(owned.primitive_count);
            let part = bottom_level(&*backend, &[vk_geometry(&geometry, &owned)], &[range]);
            let built = world.build_over(&*backend, vec![part], memory.into());
            let reports = backend.probe(built.top.structure, &rays);
            let hits = assert_reports(&format!("{}, {name}", backend.name()), &world, &rays, &reports);
            assert!(hits > 200, "{}, {name}: {hits} hits are no test", backend.name());
        }
    }
}
