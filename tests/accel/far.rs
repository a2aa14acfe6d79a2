//! Top levels with instances far away: the bytes of the host's, bits of codes by the spread, and what is near is opened first.

use crate::common::agree::assert_agrees;
use crate::common::backends::Ours;
use crate::common::device;
use crate::common::mixture::{ReadBack, diagonal, mixture, part, scaled};
use crate::common::probe::{CONFIRM, ProbeRay, flags};
use crate::common::shapes::icosphere;
use crate::common::world::World;
use hedgerow::accel::{AccelOptions, Instance, REBRAID, Tree, twin};
use hedgerow::ash::vk;
use hedgerow::bvh::builder::{BuildOptions, Builder};
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::layout::{Child, InstanceRecord};
use hedgerow::bvh::wide::Form;
use hedgerow::bvh::wide::layout::WideNode;
use hedgerow_lab::random::SplitMix64;
use std::collections::BTreeSet;
use vk::BuildAccelerationStructureFlagsKHR as Flags;

/// Where things are far: at 2^`e`, in one axis or three, to either side in turn.
fn far(count: usize, e: i32, axes: usize) -> Vec<Instance> {
    let place = |i: usize| {
        let at = if i.is_multiple_of(2) { 2f32.powi(e) } else { -(2f32.powi(e)) };
        let to = std::array::from_fn(|axis| if axis < axes { at } else { 0.5 * i as f32 / count as f32 });
        Instance::new(1, scaled(1e-6 * at.abs(), to))
    };
    (0..count).map(place).collect()
}

/// A grid of rows along diagonals, which are loose, and what is far.
fn grid(side: u32, far: &[Instance], flags: Flags) -> World {
    let at = |i: u32| [i % side, i / side % side, i / side / side].map(|k| k as f32);
    let near = (0..side * side * side).map(|i| Instance::new(1, scaled(0.4, at(i))));
    World {
        flags,
        ..World::new(vec![part(diagonal(50)), part(icosphere(1))], near.chain(far.iter().copied()).collect())
    }
}

#[test]
fn top_levels_with_something_far_have_the_bytes_of_the_hosts() {
    let all_flags = [
        Flags::PREFER_FAST_BUILD,
        Flags::PREFER_FAST_BUILD | REBRAID,
        Flags::empty(),
        Flags::PREFER_FAST_TRACE,
        Flags::PREFER_FAST_TRACE | Flags::LOW_MEMORY,
    ];
    let ours = Ours::on(device());
    // By one workgroup and by chains; few far, and so many that they count as the scene; at 2³ behind a gap.
    for (side, count) in [(4, 1), (4, 40), (4, 80), (7, 30), (13, 1), (13, 100)] {
        for (axes, e) in [(1, 3), (1, 60), (3, 3), (3, 9), (3, 60)] {
            for flags in all_flags {
                let read = ReadBack::new(&ours, &grid(side, &far(count, e, axes), flags));
                let expected = twin::top_level(&read.instances, |a| read.below(a), flags, &Ours::OPTIONS);
                let what = format!("{side}³ and {count} at 2^{e} in {axes}, {flags:?}");
                assert_eq!(read.top.header(), expected.header(), "{what}");
                assert!(read.top.to_bytes() == expected.to_bytes(), "{what}");
            }
        }
    }
}

/// Of 512 instances the sample takes every other: here all of those are left out, so that nothing tells what is far.
#[test]
fn where_the_sample_is_left_out_nothing_is_far_and_bits_are_those_by_number() {
    let ours = Ours::on(device());
    let World { instances, .. } = grid(8, &[], Flags::empty());
    let instances = instances.into_iter().enumerate().map(|(i, near)| match i {
        _ if i % 2 == 0 => Instance::new(1, scaled(f32::NAN, [0.0; 3])),
        1 => far(1, 30, 3)[0],
        _ => near,
    });
    let instances: Vec<Instance> = instances.collect();
    for flags in [Flags::PREFER_FAST_BUILD, Flags::empty()] {
        let by_number = ReadBack::new(&ours, &grid(8, &[], flags)).top.header().code_bits;
        let world = World { flags, ..World::new(vec![part(diagonal(50)), part(icosphere(1))], instances.clone()) };
        let read = ReadBack::new(&ours, &world);
        let expected = twin::top_level(&read.instances, |a| read.below(a), flags, &Ours::OPTIONS);
        let header = *read.top.header();
        assert_eq!(header.code_bits, by_number, "{flags:?}");
        assert!(read.top.to_bytes() == expected.to_bytes(), "{flags:?}: {header:?}, {:?}", expected.header());
    }
}

/// Single triangles are not opened, so that half of the entries that there may be are empty. Every other instance of those that are far lies to
/// the same side: by a sample of every other entry they would be more than a quarter of all, and count as the scene.
#[test]
fn entries_that_rebraiding_leaves_empty_tell_nothing_of_what_is_far() {
    let ours = Ours::on(device());
    let World { instances, .. } = grid(6, &[], Flags::empty());
    let instances = [&instances[..156], &far(100, 30, 3)].concat();
    let all = |flags| World { flags, ..World::new(vec![part(diagonal(1)), part(diagonal(1))], instances.clone()) };
    let [opened, whole] = [REBRAID, Flags::empty()].map(|rebraid| {
        let flags = Flags::PREFER_FAST_BUILD | rebraid;
        let read = ReadBack::new(&ours, &all(flags));
        let expected = twin::top_level(&read.instances, |a| read.below(a), flags, &Ours::OPTIONS);
        assert!(read.top.to_bytes() == expected.to_bytes(), "{flags:?}: {:?}", read.top.header());
        *read.top.header()
    });
    assert_eq!((opened.active, whole.active), (256, 256));
    assert_eq!(opened.code_bits, whole.code_bits);
}

#[test]
fn bits_are_as_many_as_the_spread_needs() {
    let ours = Ours::on(device());
    let bits = |side, far: &[Instance], flags| {
        let read = ReadBack::new(&ours, &grid(side, far, flags));
        read.top.header().code_bits
    };
    for side in [4, 13] {
        for flags in [Flags::PREFER_FAST_BUILD, Flags::empty()] {
            let alone = bits(side, &[], flags);
            let one = bits(side, &far(1, 30, 3), flags);
            assert!(one > alone, "{side} {flags:?}: {one} bits with something far, {alone} without");
            assert_eq!(bits(side, &far(1, 60, 3), flags), one, "{side} {flags:?}: however far it is");
        }
    }
    // One word of a code is what low memory has.
    let low = bits(4, &far(1, 60, 3), Flags::LOW_MEMORY);
    assert!(low <= 32, "{low} bits");
    // What the spread is not asked for keeps its bits.
    let given = AccelOptions { top_codes: Some(Code::Emc64Var.full().with_bits(24)), ..AccelOptions::DEFAULT };
    let read = ReadBack::new(&Ours::with_options(device(), given), &grid(4, &far(1, 60, 3), Flags::empty()));
    assert_eq!(read.top.header().code_bits, 24);
}

#[test]
fn what_is_near_is_opened_before_what_is_far_however_large() {
    let ours = Ours::on(device());
    for side in [5, 11] {
        let near = side * side * side;
        let opened = |far: &[Instance]| {
            let read = ReadBack::new(&ours, &grid(side, far, Flags::PREFER_FAST_TRACE));
            let of_near = |record: &&InstanceRecord| record.structure != 0 && record.instance < near;
            read.top.records().iter().filter(of_near).count() as u32
        };
        // The budget grows with each far instance by four entries, of which it takes one.
        let (alone, with_far) = (opened(&[]), opened(&far(20, 60, 3)));
        assert!(alone > 2 * near, "{alone} entries of {near} instances");
        assert!(with_far >= alone, "{with_far} entries of {near} instances with something far, {alone} without");
    }
}

/// What a leaf holds, or the children of a node.
fn inside(top: &Tree<InstanceRecord>, child: &Child) -> (Vec<InstanceRecord>, Vec<Child>) {
    let index = child.index as usize;
    match top {
        Tree::OfTwo(tree) if child.is_leaf() => (tree.records[index..][..child.count as usize].to_vec(), vec![]),
        Tree::OfTwo(tree) => (vec![], tree.nodes[index].children.to_vec()),
        Tree::OfEight(tree) => {
            let leaf = if child.is_leaf() { Some((child.index, child.count)) } else { tree.nodes[index].long_leaf() };
            let records = leaf.map(|(first, count)| tree.leaf(first, count).to_vec());
            let children = || tree.nodes[index].children().into_iter().flatten().collect();
            records.map_or_else(|| (vec![], children()), |records| (records, vec![]))
        }
    }
}

/// The children of the root, each with the instances below it.
fn below_the_root(read: &ReadBack) -> Vec<(Child, BTreeSet<u32>)> {
    let below = |child: Child| {
        let (mut instances, mut waiting) = (BTreeSet::new(), vec![child]);
        while let Some(child) = waiting.pop() {
            let (records, children) = inside(&read.top, &child);
            instances.extend(records.iter().map(|record| record.instance));
            waiting.extend(children);
        }
        (child, instances)
    };
    inside(&read.top, &read.top.header().root).1.into_iter().map(below).collect()
}

/// In cells as large as the way to what is far, all that is near would be one box: it has a node of its own, which costs one node more.
#[test]
fn all_that_is_near_is_one_child_of_the_root() {
    let ours = Ours::on(device());
    for (side, count, axes, e) in [(2, 1, 1, 14), (4, 1, 3, 60), (4, 20, 1, 60), (7, 30, 3, 14)] {
        let near = side * side * side;
        let has_near = |instances: &&BTreeSet<u32>| instances.iter().any(|&instance| instance < near);
        let root = |far: &[Instance]| {
            let read = ReadBack::new(&ours, &grid(side, far, Flags::PREFER_FAST_TRACE));
            let header = read.top.header();
            assert!(header.inner_nodes <= Form::EightQuantised.nodes_at_most(header.active), "{header:?}");
            below_the_root(&read).into_iter().map(|(_, below)| below).collect::<Vec<_>>()
        };
        let what = format!("{side}³ and {count} at 2^{e} in {axes}");
        let with_far = root(&far(count, e, axes));
        let of_near: Vec<_> = with_far.iter().filter(has_near).collect();
        assert_eq!(of_near.len(), 1, "{what}: {with_far:?}");
        assert!(of_near[0].iter().copied().eq(0..near), "{what}: {of_near:?}");
        let alone = root(&[]);
        assert!(alone.iter().filter(has_near).count() > 1, "{what}: {alone:?}");
    }
}

/// The sides of what is far, as a header has them: 2 · axis, and 1 more for the positive one.
#[test]
fn the_header_names_the_node_over_what_is_near_and_the_sides_of_what_is_far() {
    let ours = Ours::on(device());
    let header_of = |world: &World| {
        let read = ReadBack::new(&ours, world);
        read.top.validate().expect("valid");
        let header = *read.top.header();
        let is_near = |child: &Child| header.near_node != 0 && !child.is_leaf() && child.index == header.near_node;
        let near = below_the_root(&read).into_iter().find(|(child, _)| is_near(child));
        (header.far_sides, near.map(|(_, below)| below))
    };
    // In nodes of eight, and of two.
    for flags in [Flags::PREFER_FAST_TRACE, Flags::PREFER_FAST_BUILD, Flags::PREFER_FAST_TRACE | Flags::ALLOW_UPDATE] {
        let with = |far: &[Instance]| grid(4, far, flags);
        assert_eq!(header_of(&with(&[])), (0, None), "{flags:?}");
        let all_near = Some((0..64).collect());
        for (count, axes, e, sides) in [(1, 1, 14, 0b10), (1, 3, 60, 0b10), (20, 1, 60, 0b11), (8, 3, 9, 0b11)] {
            let what = format!("{count} at 2^{e} in {axes}, {flags:?}");
            assert_eq!(header_of(&with(&far(count, e, axes))), (sides, all_near.clone()), "{what}");
        }
        // Along y and z, and what is large but reaches into none of the others.
        let beside =
            [[3.0, 4000.0, 1.0], [0.0, -4000.0, 2.0], [1.0, 2.0, -9000.0]].map(|to| Instance::new(1, scaled(2.0, to)));
        assert_eq!(header_of(&with(&beside)), (0b01_1100, all_near), "{flags:?}");
        // What is far, and one triangle that reaches through everything: a ray may meet that anywhere.
        let mut world = with(&far(1, 14, 1));
        world.parts.push(part(vec![[[-1.0; 3], [1.0; 3], [1.0, -1.0, 0.0]]]));
        world.instances.push(Instance::new(3, scaled(1000.0, [0.0; 3])));
        assert_eq!(header_of(&world), (0, None), "{flags:?}");
    }
}

/// From what is near to what is near, to what is far and past it, up to limits before and behind.
#[test]
fn rays_meet_what_is_near_and_what_is_far_as_by_brute_force() {
    let ours = Ours::on(device());
    let mut random = SplitMix64::new(5);
    let flags_of_forms = [Flags::PREFER_FAST_TRACE, Flags::PREFER_FAST_BUILD];
    for (axes, flags_of_form) in [1, 3].into_iter().flat_map(|axes| flags_of_forms.map(|form| (axes, form))) {
        // Beside each other, so that a ray tells which it meets.
        let beside = |(i, far): (usize, &Instance)| {
            let [x, y, z] = far.transform.map(|row| row[3]);
            Instance::new(2, scaled(6.0, [x, y + 20.0 * i as f32, z]))
        };
        let far: Vec<Instance> = far(6, 7, axes).iter().enumerate().map(beside).collect();
        let world = grid(4, &far, flags_of_form);
        assert_ne!(ReadBack::new(&ours, &world).top.header().near_node, 0);
        let ray = |i: usize| {
            let origin: [f32; 3] = std::array::from_fn(|_| 1.5 + 2.5 * random.signed());
            let target = match i % 3 {
                0 => std::array::from_fn(|_| 1.5 + 2.0 * random.signed()),
                _ => far[i / 3 % far.len()].transform.map(|row| row[3] + 5.0 * random.signed()),
            };
            let direction: [f32; 3] = std::array::from_fn(|k| target[k] - origin[k]);
            let t_max = [f32::INFINITY, 0.5, 1.5][i / 9 % 3];
            let which = [flags::OPAQUE, flags::OPAQUE | flags::FIRST_HIT][i / 2 % 2];
            ProbeRay { flags: which, decision: CONFIRM, t_max, ..ProbeRay::new(origin, direction) }
        };
        let rays: Vec<ProbeRay> = (0..600).map(ray).collect();
        let hits = assert_agrees(&ours, &format!("far in {axes} axes, {flags_of_form:?}"), &world, &rays);
        assert!(hits > 150, "{hits} hits are no test");
    }
}

#[test]
fn mixtures_of_all_transforms_with_something_far_have_the_bytes_of_the_hosts() {
    let ours = Ours::on(device());
    for count in [2, 40, 700, 2600] {
        let mut world = mixture(count, 5);
        world.instances.extend(far(7, 33, 3));
        let read = ReadBack::new(&ours, &world);
        let expected = twin::top_level(&read.instances, |a| read.below(a), world.flags, &Ours::OPTIONS);
        assert_eq!(read.top.header(), expected.header(), "{count}");
        assert!(read.top.to_bytes() == expected.to_bytes(), "{count}");
    }
}

#[test]
fn bits_that_no_codes_have_are_refused_by_the_fields_name() {
    let robust = "emc64var+robust/40".parse().expect("codes");
    let plain = Code::Emc64Var.full().with_bits(24);
    for (codes, most) in [(robust, 32), (robust, 48), (plain, 64), ("mc30+robust".parse().expect("codes"), 32)] {
        let options = BuildOptions { codes: Some(codes), bits_up_to: Some(most), ..BuildOptions::DEFAULT };
        let refused = Builder::new(device(), &options, 100).expect_err("no such bits");
        assert!(refused.to_string().contains("bits_up_to is"), "{refused}");
    }
    let options = BuildOptions { codes: Some(robust), bits_up_to: Some(64), ..BuildOptions::DEFAULT };
    assert!(Builder::new(device(), &options, 100).is_ok());
}
