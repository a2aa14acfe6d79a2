//! Instances: matrices of every kind, many, at the same place, by pointers, and boxes that are never too small.

use crate::common::agree::{assert_agrees, assert_reports, probed};
use crate::common::backends::{Backend, Ours, backends};
use crate::common::device;
use crate::common::matrices::{Matrix, moved, rotation, scaled};
use crate::common::probe::{CONFIRM, IGNORE, ProbeRay, flags};
use crate::common::shapes::{Corners, boxes, icosphere, soup};
use crate::common::world::{Part, World, instances_at, top_level, transformed};
use hedgerow::accel::{Instance, Tree};
use hedgerow::ash::vk;
use hedgerow::ash::vk::Handle;
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::layout::{Child, InstanceRecord as Placed};
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::lbvh;
use hedgerow::bvh::wide::layout::{Wide8q, WideNode};
use hedgerow::geometry::Aabb;
use hedgerow_lab::random::SplitMix64;
use vk::GeometryFlagsKHR as GeometryFlags;

type Range = vk::AccelerationStructureBuildRangeInfoKHR;

fn triangles(corners: Corners) -> Part {
    Part::Triangles(vec![(corners, GeometryFlags::OPAQUE)])
}

/// Rays in the space of an object in −1..1, brought to the world by its matrix: t stays what it is.
fn rays_at(matrix: &Matrix, count: usize, seed: u64) -> Vec<ProbeRay> {
    let mut random = SplitMix64::new(seed);
    let to_world = matrix.map(|row| row.map(f64::from));
    let bring = |p: [f32; 3], w| transformed(&to_world, p.map(f64::from), w).map(|x| x as f32);
    let ray = |i: usize| {
        let (origin, target) = (random.around([3.0, 0.7][i / 2 % 2]), random.around(0.8));
        let way = std::array::from_fn(|k| target[k] - origin[k]);
        let (flags, decision) = [(flags::SKIP_BOXES, CONFIRM), (flags::NO_OPAQUE, IGNORE)][i % 2];
        ProbeRay { flags, decision, ..ProbeRay::new(bring(origin, 1.0), bring(way, 0.0)) }
    };
    (0..count).map(ray).collect()
}

/// A world's top level, read back.
fn top_of(world: &World, backend: &Ours) -> Tree<Placed> {
    let built = world.build(backend);
    Tree::from_bytes(&built.top.memory.read::<u8>(built.top.bytes as usize)).expect("a structure")
}

/// The leaves of a tree that is none itself, with boxes as rays meet them.
fn leaves_of(tree: &Tree<Placed>) -> Vec<Child> {
    match tree {
        Tree::OfTwo(tree) => {
            tree.validate().expect("a valid tree");
            let used = tree.nodes.iter().filter(|node| node.is_used());
            used.flat_map(|node| node.children).filter(Child::is_leaf).collect()
        }
        Tree::OfEight(tree) => {
            tree.nodes.iter().flat_map(WideNode::children).flatten().filter(Child::is_leaf).collect()
        }
    }
}

#[test]
fn leaves_of_many_instances_show_each_of_them() {
    let mut random = SplitMix64::new(17);
    let parts = vec![triangles(soup(60, 0.4, 5)), Part::Boxes(vec![(boxes(9, 0.3, 6), GeometryFlags::empty())])];
    let placed = |i: u64| Instance::new(1 + i % 2, moved(scaled(rotation(i), [0.4; 3]), random.around(2.0)));
    let instances: Vec<Instance> = (0..700).map(placed).collect();
    let world =
        World { flags: vk::BuildAccelerationStructureFlagsKHR::PREFER_FAST_BUILD, ..World::new(parts, instances) };
    let backend = Ours::on(device());
    let built = world.build(&backend);
    let bytes = built.top.memory.read::<u8>(built.top.bytes as usize);
    let tree = Tree::<Placed>::from_bytes(&bytes).expect("a structure");
    let mut boxes = vec![Err(0); tree.records().len()];
    for leaf in leaves_of(&tree) {
        assert_eq!(leaf.count, 1);
        boxes[leaf.index as usize] = Ok(leaf.bounds());
    }
    let rays: Vec<ProbeRay> = (0..1500)
        .map(|i| {
            let (origin, target) = (random.around(3.0), random.around(2.0));
            let ray = ProbeRay::new(origin, std::array::from_fn(|k| target[k] - origin[k]));
            let (flags, decision) = [(flags::SKIP_BOXES, CONFIRM), (flags::NO_OPAQUE, IGNORE)][i % 2];
            ProbeRay { flags, decision, ..ray }
        })
        .collect();
    let expected = backend.probe(built.top.structure, &rays);
    assert!(expected.iter().filter(|report| report.committed.kind != 0).count() > 500, "too few hits for a test");
    // One a leaf, some a leaf, and all in one leaf, which is a node of its own where nodes are of eight.
    for (c_i, in_leaf) in [(1e9, 1..=1), (1.0, 2..=255), (0.0, 700..=700)] {
        let collapse = Collapse { c_i, ..Collapse::SAH };
        let record = |i: u32| tree.records()[i as usize];
        let of_two = lbvh::build_boxes(&boxes, record, Code::Mc30.full(), collapse);
        let of_eight = Wide8q::of(&of_two);
        let children = of_two.nodes.iter().filter(|node| node.is_used()).flat_map(|node| node.children);
        let largest = children.chain([of_two.header.root]).filter(Child::is_leaf).map(|leaf| leaf.count).max();
        assert!(largest.is_some_and(|most| in_leaf.contains(&most)), "{largest:?} a leaf, not {in_leaf:?}");
        for (what, bytes) in [("two", of_two.to_bytes()), ("eight", of_eight.to_bytes())] {
            let memory = device().upload("top level", &bytes).expect("memory");
            let got = backend.probe(vk::AccelerationStructureKHR::from_raw(memory.address()), &rays);
            for (i, (got, expected)) in got.iter().zip(&expected).enumerate() {
                let what = format!("nodes of {what}, up to {largest:?} a leaf, ray {i}");
                assert_eq!(got.committed, expected.committed, "{what}");
                // Where nothing is a hit, nothing is left out for being behind one.
                if rays[i].decision == IGNORE {
                    assert_eq!(got.candidate_count, expected.candidate_count, "{what}");
                }
            }
        }
    }
}

#[test]
fn what_a_ray_meets_in_an_object_does_not_depend_on_its_matrix() {
    let turned = |by: [f32; 3]| scaled(rotation(11), by);
    let mut sheared = rotation(12);
    sheared.iter_mut().for_each(|row| row[0] += 3.0 * row[1]);
    let matrices = [
        ("identity", Instance::IDENTITY),
        ("moved", moved(Instance::IDENTITY, [3.0, -20.0, 0.5])),
        ("turned", turned([1.0; 3])),
        ("axes exchanged", [[0.0, 0.0, 1.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]]),
        ("millionfold", turned([1e6; 3])),
        ("a millionth", turned([1e-6; 3])),
        ("as small as can be", scaled(Instance::IDENTITY, [1e-18; 3])),
        ("as large as can be", scaled(Instance::IDENTITY, [1e18; 3])),
        ("flat", turned([1.0, 1.0, 0.01])),
        ("long", turned([0.5, 5.0, 1.0])),
        ("mirrored", turned([-1.0, 1.0, 1.0])),
        ("inverted", turned([-3.0; 3])),
        ("sheared", sheared),
        ("sheared, mirrored and moved", moved(scaled(sheared, [1.0, -0.5, 1.0]), [5.0, 6.0, -7.0])),
        ("large and far away", moved(turned([1e4; 3]), [1e6, -2e6, 1e6])),
        ("small and away", moved(turned([1e-3; 3]), [0.01, 0.02, -0.01])),
    ];
    let parts = vec![triangles(soup(40, 0.5, 3)), Part::Boxes(vec![(boxes(12, 0.3, 4), GeometryFlags::empty())])];
    for backend in backends() {
        for (name, matrix) in matrices {
            let world = World::new(parts.clone(), vec![Instance::new(1, matrix), Instance::new(2, matrix)]);
            let hits = assert_agrees(&*backend, name, &world, &rays_at(&matrix, 300, 5));
            assert!(hits > 20, "{}, {name}: {hits} hits are no test", backend.name());
        }
    }
}

/// Ten thousand trees and as many stones: every one is a different size, turned and moved.
fn forest() -> World {
    let tree = vec![
        [[-0.3, -0.3, 0.0], [0.3, -0.3, 0.0], [0.0, 0.0, 2.0]],
        [[0.3, -0.3, 0.0], [0.0, 0.3, 0.0], [0.0, 0.0, 2.0]],
        [[0.0, 0.3, 0.0], [-0.3, -0.3, 0.0], [0.0, 0.0, 2.0]],
    ];
    let mut random = SplitMix64::new(21);
    let mut place = |i: u64| {
        let turn = std::f32::consts::PI * random.signed();
        let (s, c) = turn.sin_cos();
        let size = 1.0 + 0.5 * random.signed();
        let [x, y, _] = random.around(150.0);
        let rows = [[c * size, -s * size, 0.0, x], [s * size, c * size, 0.0, y], [0.0, 0.0, size, 0.0]];
        Instance::new(1 + i % 2, rows).with_index_and_mask(i as u32, 1 << (i % 3))
    };
    let instances = (0..20_000).map(&mut place).collect();
    World::new(vec![triangles(tree), triangles(soup(4, 0.6, 2))], instances)
}

#[test]
fn twenty_thousand_instances_are_met_where_they_are() {
    let world = forest();
    let mut random = SplitMix64::new(22);
    let rays: Vec<ProbeRay> = (0..200)
        .map(|i| {
            // At a tree or stone: across a part of the forest and down into it.
            let [aim, from] = [random.bits(), random.bits()].map(|n| world.instances[n as usize % 20_000].transform);
            let [x, y] = [0, 1].map(|k| aim[k][3] + 0.1 * random.signed());
            let across = [x + 0.1 * (from[0][3] - x), y + 0.1 * (from[1][3] - y), 0.5];
            let origin = [across, [from[0][3], from[1][3], 90.0]][i % 2];
            let way = std::array::from_fn(|k| [x, y, 0.3][k] - origin[k]);
            ProbeRay { mask: [1, 0xff, 6][i % 3], t_max: [1.0, 2.0][i % 2], ..ProbeRay::new(origin, way) }
        })
        .collect();
    for backend in backends() {
        let hits = assert_agrees(&*backend, "forest", &world, &rays);
        assert!(hits > 60, "{}: {hits} hits are no test", backend.name());
    }
}

/// From the middle, from between two shells and from outside, through spheres in spheres and boxes in boxes.
#[test]
fn shells_in_shells_are_met_in_their_order() {
    let sizes = [0.1, 0.2, 0.35, 0.5, 0.7, 0.71, 0.9, 1.0];
    let cubes = Part::Boxes(vec![(vec![[[-0.3; 3], [0.3; 3]]], GeometryFlags::empty())]);
    let spheres = sizes.iter().map(|&size| Instance::new(1, scaled(rotation(13), [size; 3])));
    let boxes = sizes.iter().map(|&size| Instance::new(2, scaled(rotation(14), [size; 3])));
    let world = World::new(vec![triangles(icosphere(2)), cubes], spheres.chain(boxes).collect());
    let mut random = SplitMix64::new(15);
    let rays: Vec<ProbeRay> = (0..500)
        .map(|i| {
            let (origin, target) = (random.around([0.02, 0.6, 3.0][i % 3]), random.around(0.5));
            let way = std::array::from_fn(|k| target[k] - origin[k]);
            let (flags, decision) = [(flags::NONE, CONFIRM), (flags::NO_OPAQUE, IGNORE)][i / 3 % 2];
            let t_min = [0.0, 0.3][i / 6 % 2];
            ProbeRay { flags, decision, generated_t: t_min, t_min, ..ProbeRay::new(origin, way) }
        })
        .collect();
    for backend in backends() {
        let hits = assert_agrees(&*backend, "shells", &world, &rays);
        assert!(hits > 150, "{}: {hits} hits are no test", backend.name());
    }
}

#[test]
fn instances_may_lie_scattered_or_behind_an_offset() {
    let parts = vec![triangles(soup(30, 0.5, 6)), triangles(soup(5, 0.9, 7))];
    let mut random = SplitMix64::new(16);
    let mut matrix = |i| moved(rotation(i), random.around(3.0));
    let instances =
        (0..50).map(|i| Instance::new(1 + i % 2, matrix(i)).with_index_and_mask(i as u32 * 7, 0xff)).collect();
    let world = World::new(parts, instances);
    let rays = rays_at(&scaled(Instance::IDENTITY, [3.0; 3]), 400, 17);
    // As little aligned as is allowed: instances at multiples of 16 bytes, pointers at multiples of 8.
    const APART: usize = 80;
    for backend in backends() {
        let plain = world.build(&*backend);
        let placed = world.placed(&*backend, &plain.parts);
        let mut scattered = vec![0xa5u8; 16 + APART * placed.len()];
        let order = |i: usize| 16 + APART * (i * 17 % placed.len());
        for (i, instance) in placed.iter().enumerate() {
            scattered[order(i)..][..64].copy_from_slice(bytemuck::bytes_of(instance));
        }
        let data = device().upload("scattered", &scattered).expect("memory");
        let pointers = (0..placed.len()).map(|i| data.address() + order(i) as u64);
        let pointers: Vec<u64> = [!0; 3].into_iter().chain(pointers).collect();
        let pointers = device().upload("pointers", &pointers).expect("memory");
        let mut behind = vec![0xa5u8; 48];
        behind.extend_from_slice(bytemuck::cast_slice(&placed));
        let behind = device().upload("behind", &behind).expect("memory");
        let range = Range::default().primitive_count(placed.len() as u32);
        for (what, address, by_pointers, offset) in [
            ("scattered", pointers.address() + 8, true, 16),
            ("scattered, no offset", pointers.address() + 24, true, 0),
            ("behind an offset", behind.address(), false, 48),
            ("behind an address", behind.address() + 16, false, 32),
        ] {
            let geometry = instances_at(address, by_pointers);
            let top = top_level(&*backend, &geometry, range.primitive_offset(offset), world.flags);
            let reports = backend.probe(top.structure, &rays);
            let what = format!("{}, {what}", backend.name());
            let hits = assert_reports(&what, &world, &rays, &reports);
            assert!(hits > 120, "{what}: {hits} hits are no test");
        }
    }
}

/// Ours takes the lower instance, and the lower primitive; the driver any.
#[test]
fn of_instances_at_the_same_place_the_first_is_hit() {
    let matrix = rotation(18);
    let mut corners = soup(10, 0.6, 8);
    corners.extend(corners.clone());
    let instances = [2, 1, 2, 1, 1].map(|structure| Instance::new(structure, matrix)).to_vec();
    let world = World::new(vec![triangles(corners), triangles(soup(3, 0.2, 9))], instances);
    let alone = World { instances: vec![Instance::new(1, matrix)], ..world.clone() };
    let rays = rays_at(&matrix, 400, 19);
    for backend in backends() {
        let expected = probed(&*backend, &alone, &rays);
        let mut hits = 0;
        for (i, (got, alone)) in probed(&*backend, &world, &rays).iter().zip(&expected).enumerate() {
            let (got, alone) = (got.committed, alone.committed);
            // Those of the small soup aside.
            if got.kind == 0 || got.t != alone.t || [0, 2].contains(&got.instance) {
                continue;
            }
            hits += 1;
            let what = format!("{}: ray {i}: {got:?}", backend.name());
            assert_eq!(got.primitive % 10, alone.primitive % 10, "{what}");
            assert_eq!(got.barycentrics, alone.barycentrics, "{what}");
            if backend.name() == "hedgerow" {
                assert!(got.instance == 1 && got.primitive < 10, "{what}");
            }
        }
        assert!(hits > 40, "{}: {hits} hits are no test", backend.name());
    }
}

/// Ours alone: a bottom-level structure that is queried itself is as one instance without a transform.
#[test]
fn a_bottom_level_is_queried_as_under_the_identity() {
    let ours = Ours::on(device());
    for part in [triangles(soup(60, 0.5, 10)), Part::Boxes(vec![(boxes(30, 0.3, 11), GeometryFlags::OPAQUE)])] {
        let world = World::new(vec![part], vec![Instance::new(1, Instance::IDENTITY).with_index_and_mask(0, 0xff)]);
        let built = world.build(&ours);
        let rays = rays_at(&Instance::IDENTITY, 300, 20);
        let reports = ours.probe(built.parts[0].structure, &rays);
        assert_eq!(reports, ours.probe(built.top.structure, &rays));
        assert_reports("queried itself", &world, &rays, &reports);
    }
}

/// Every corner, moved in double precision, lies in the box of its entry; and the box is that of the object's box, at most.
#[test]
fn the_box_of_an_instance_holds_all_of_it_and_little_more() {
    let mut random = SplitMix64::new(23);
    let meshes = [soup(1, 1.0, 1), soup(20, 0.3, 2), icosphere(2), vec![[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]]];
    let instances: Vec<Instance> = (0..2000)
        .map(|i| {
            let exponent = 6.0 * random.signed();
            let size = [(); 3].map(|()| 10f32.powf(exponent + 0.5 * random.signed()) * random.signed().signum());
            let base = [rotation(i), Instance::IDENTITY, [(); 3].map(|()| [(); 4].map(|()| random.signed()))];
            let matrix = scaled(base[i as usize % 3], size);
            let away = [0.0, 1.0, 1e3, 1e6][i as usize / 3 % 4];
            Instance::new(1 + random.bits() % 4, moved(matrix, random.around(away)))
        })
        .collect();
    let parts: Vec<Part> = meshes.iter().cloned().map(triangles).collect();
    for flags in [vk::BuildAccelerationStructureFlagsKHR::PREFER_FAST_BUILD, Default::default()] {
        let world = World { flags, ..World::new(parts.clone(), instances.clone()) };
        boxes_hold(&world, &meshes);
    }
}

/// Boxes of the top level's leaves hold every corner of the meshes in them, in nodes of two and of eight.
fn boxes_hold(world: &World, meshes: &[Corners]) {
    let tree = top_of(world, &Ours::on(device()));
    // Bytes of a node's own grid are coarser.
    let is_exact = matches!(tree, Tree::OfTwo(_));
    assert_eq!((tree.header().status, tree.header().active), (0, 2000));
    let mut checked = 0;
    for leaf in leaves_of(&tree) {
        for placed in &tree.records()[leaf.index as usize..][..leaf.count as usize] {
            checked += 1;
            let instance = &world.instances[placed.instance as usize];
            let corners = &meshes[instance.structure as usize - 1];
            let matrix = instance.transform.map(|row| row.map(f64::from));
            let around = Aabb::around(corners.as_flattened());
            for row in 0..3 {
                let (lo, hi) = (f64::from(leaf.lo[row]), f64::from(leaf.hi[row]));
                for corner in corners.as_flattened() {
                    let at = transformed(&matrix, corner.map(f64::from), 1.0)[row];
                    assert!(lo <= at && at <= hi, "{instance:?}: {at} outside of {lo}..{hi}");
                }
                let ends = |k: usize| [around.lo[k], around.hi[k]].map(|x| matrix[row][k] * f64::from(x));
                let least = (0..3).map(|k| ends(k)[0].min(ends(k)[1])).sum::<f64>() + matrix[row][3];
                let most = (0..3).map(|k| ends(k)[0].max(ends(k)[1])).sum::<f64>() + matrix[row][3];
                let terms: f64 = (0..3).map(|k| ends(k)[0].abs().max(ends(k)[1].abs())).sum();
                let slack = 1e-6 * (terms + matrix[row][3].abs());
                let is_tight = least - slack <= lo && hi <= most + slack;
                assert!(is_tight || !is_exact, "{instance:?}: {lo}..{hi}, not {least}..{most}");
            }
        }
    }
    assert_eq!(checked, 2000);
}
