//! Structures of nothing: they are built, traced and instanced like any other, and nothing in them is met.

use crate::common::agree::assert_reports;
use crate::common::backends::{Backend, Built, Ours, backends, vk_geometry};
use crate::common::device;
use crate::common::geometries::Owned;
use crate::common::matrices::{moved, rotation};
use crate::common::probe::{CONFIRM, IGNORE, ProbeRay};
use crate::common::shapes::{Corners, soup};
use crate::common::world::{Part, World, bottom_level};
use hedgerow::accel::Instance;
use hedgerow::ash::vk;
use hedgerow::bvh::geometry::{IndexFormat, VertexFormat};
use hedgerow::bvh::layout::{Bvh2, Triangle};
use hedgerow_lab::device::Buffer;
use hedgerow_lab::random::SplitMix64;
use vk::GeometryFlagsKHR as GeometryFlags;

type Range = vk::AccelerationStructureBuildRangeInfoKHR;

/// Ways to have nothing.
#[derive(Debug, Clone, Copy)]
enum Nothing {
    NoGeometries,
    /// So many geometries without a primitive.
    NoPrimitives(usize, IndexFormat),
    NoBoxes,
    /// The first component of a vertex is not a number.
    Inactive(IndexFormat),
}

const ALL: [Nothing; 10] = [
    Nothing::NoGeometries,
    Nothing::NoPrimitives(1, IndexFormat::NONE),
    Nothing::NoPrimitives(1, IndexFormat::U16),
    Nothing::NoPrimitives(1, IndexFormat::U32),
    Nothing::NoPrimitives(5, IndexFormat::NONE),
    Nothing::NoPrimitives(2, IndexFormat::U32),
    Nothing::NoBoxes,
    Nothing::Inactive(IndexFormat::NONE),
    Nothing::Inactive(IndexFormat::U16),
    Nothing::Inactive(IndexFormat::U32),
];

/// Triangles of which each has a vertex whose x is not a number.
fn inactive(index_format: IndexFormat) -> Owned {
    let mut owned = Owned::of(&soup(20, 0.5, 1), VertexFormat::FLOAT3, index_format, 0);
    for (i, triangle) in owned.vertices.chunks_exact_mut(36).enumerate() {
        triangle[12 * (i % 3)..][..4].copy_from_slice(&f32::NAN.to_le_bytes());
    }
    owned
}

fn built(backend: &dyn Backend, nothing: Nothing) -> (Built, Vec<Buffer<'static>>) {
    let (owned, count) = match nothing {
        Nothing::NoGeometries => return (bottom_level(backend, &[], &[]), Vec::new()),
        Nothing::NoBoxes => return Part::Boxes(vec![(Vec::new(), GeometryFlags::empty())]).build(backend),
        Nothing::NoPrimitives(count, format) => {
            (Owned { primitive_count: 0, ..Owned::of(&soup(1, 0.5, 1), VertexFormat::FLOAT3, format, 0) }, count)
        }
        Nothing::Inactive(format) => (inactive(format), 1),
    };
    let (geometry, memory) = owned.upload(0, 0);
    let geometries = vec![vk_geometry(&geometry, &owned); count];
    let ranges = vec![Range::default().primitive_count(owned.primitive_count); count];
    (bottom_level(backend, &geometries, &ranges), memory.into())
}

fn rays() -> Vec<ProbeRay> {
    let mut random = SplitMix64::new(4);
    let ray = |i: usize| {
        let (origin, target) = (random.around(3.0), random.around(1.0));
        let ray = ProbeRay::new(origin, std::array::from_fn(|k| target[k] - origin[k]));
        ProbeRay { decision: [CONFIRM, IGNORE][i % 2], ..ray }
    };
    (0..200).map(ray).collect()
}

#[test]
fn nothing_is_met_in_a_structure_of_nothing_and_all_beside_it() {
    let beside: Corners = soup(60, 0.5, 2);
    let good = Part::Triangles(vec![(beside, GeometryFlags::empty())]);
    let rays = rays();
    for backend in backends() {
        for nothing in ALL {
            // Instance 1 is something.
            let instances: Vec<Instance> = [1, 2, 1, 1, 1, 1, 1, 1, 1]
                .into_iter()
                .zip(0..)
                .map(|(structure, i)| Instance::new(structure, moved(rotation(i), [0.1 * i as f32; 3])))
                .collect();
            for count in [1, 2, 9] {
                let parts = vec![Part::Triangles(Vec::new()), good.clone()];
                let world = World::new(parts, instances[..count].to_vec());
                let (empty, mut memory) = built(&*backend, nothing);
                let (something, more) = good.build(&*backend);
                memory.extend(more);
                let top = world.build_over(&*backend, vec![empty, something], memory);
                let reports = backend.probe(top.top.structure, &rays);
                let what = format!("{}, {nothing:?}, {count} instances", backend.name());
                let hits = assert_reports(&what, &world, &rays, &reports);
                assert_eq!(hits > 20, count > 1, "{what}: {hits} hits");
                assert!(count > 1 || reports.iter().all(|report| report.candidate_count == 0), "{what}");
            }
        }
    }
}

#[test]
fn a_top_level_without_an_active_instance_is_empty() {
    let part = Part::Triangles(vec![(soup(60, 0.5, 2), GeometryFlags::OPAQUE)]);
    let seen = |structure| Instance::new(structure, Instance::IDENTITY);
    let unseen = seen(1).with_index_and_mask(0, 0);
    let rays = rays();
    for backend in backends() {
        for (name, instances) in [
            ("no instance", Vec::new()),
            ("an inactive one", vec![seen(0)]),
            ("inactive ones", vec![seen(0); 100]),
            ("one of mask 0", vec![unseen]),
            ("inactive ones and those of mask 0", [seen(0), unseen].repeat(40)),
        ] {
            if backend.name() == "driver"
                && crate::common::device().workarounds.driver_crashes_on_inactive_instances
                && !instances.is_empty()
            {
                continue;
            }
            for by_pointers in [false, true] {
                let world = World { by_pointers, ..World::new(vec![part.clone()], instances.clone()) };
                let built = world.build(&*backend);
                for (ray, report) in rays.iter().zip(backend.probe(built.top.structure, &rays)) {
                    let met = (report.committed.kind, report.candidate_count);
                    assert_eq!(met, (0, 0), "{}, {name}: {ray:?}", backend.name());
                }
            }
        }
    }
}

/// Ours alone: queried itself, and by its bytes.
#[test]
fn a_structure_of_nothing_says_so() {
    let ours = Ours::on(device());
    for nothing in ALL {
        let (empty, _memory) = built(&ours, nothing);
        let reports = ours.probe(empty.structure, &rays());
        assert!(reports.iter().all(|r| (r.committed.kind, r.candidate_count) == (0, 0)), "{nothing:?}");
        if !matches!(nothing, Nothing::NoBoxes) {
            let tree =
                Bvh2::<Triangle>::from_bytes(&empty.memory.read::<u8>(empty.bytes as usize)).expect("a structure");
            tree.validate().unwrap_or_else(|error| panic!("{nothing:?}: {error}"));
            assert_eq!(tree.header.active, 0, "{nothing:?}");
        }
    }
}
