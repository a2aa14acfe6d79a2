//! Re-braiding: top levels that open instances are those of the host, within the budget, and hold every primitive once.

use crate::common::backends::{Backend, Ours};
use crate::common::device;
use crate::common::mixture::{ReadBack, diagonal, mixture, part, scaled};
use crate::common::probe::{IGNORE, ProbeRay, flags};
use crate::common::shapes::{Corners, icosphere, placed, soup};
use crate::common::world::World;
use hedgerow::accel::{self, AccelOptions, Instance, REBRAID, Request, Tree, Wide, twin};
use hedgerow::ash::vk;
use hedgerow::bvh::codes::{Binning, Code, CodeBounds};
use hedgerow::bvh::layout::{self, Child, Record, Triangle, status};
use hedgerow::bvh::wide::layout::WideNode;
use hedgerow_lab::random::SplitMix64;
use std::collections::BTreeMap;
use vk::BuildAccelerationStructureFlagsKHR as Flags;

fn with_budget(rebraid_budget: f32) -> Ours {
    Ours::with_options(device(), AccelOptions { rebraid_budget, ..Ours::OPTIONS })
}

/// Where the entries of each instance begin.
fn entries_of(read: &ReadBack) -> BTreeMap<u32, Vec<[u32; 2]>> {
    let mut all = BTreeMap::<u32, Vec<[u32; 2]>>::new();
    for record in read.top.records().iter().filter(|record| record.structure != 0) {
        all.entry(record.instance).or_default().push(record.begin());
    }
    all
}

/// How often the entries of an instance reach each record of its structure.
fn reached_by(read: &ReadBack, instance: u32, starts: &[[u32; 2]]) -> Vec<u32> {
    let address = read.instances[instance as usize].structure;
    match (read.triangles.get(&address), read.boxes.get(&address)) {
        (Some(structure), _) => reached(structure, starts),
        (_, Some(structure)) => reached(structure, starts),
        _ => panic!("instance {instance} has entries and no structure"),
    }
}

fn reached<R: Record>(structure: &Tree<R>, starts: &[[u32; 2]]) -> Vec<u32> {
    let mut counts = vec![0; structure.header().active as usize];
    let mut count_all = |[index, count]: [u32; 2]| {
        let records = match structure {
            Tree::OfTwo(_) => index as usize..(index + count) as usize,
            Tree::OfEight(tree) => tree.places.records(index, count),
        };
        counts[records].iter_mut().for_each(|n| *n += 1);
    };
    let mut waiting = starts.to_vec();
    while let Some([index, count]) = waiting.pop() {
        match structure {
            Tree::OfTwo(_) if count > 0 => count_all([index, count]),
            Tree::OfTwo(tree) => {
                waiting.extend(tree.nodes[index as usize].children.map(|Child { index, count, .. }| [index, count]))
            }
            Tree::OfEight(tree) => {
                let node = &tree.nodes[index as usize];
                if let Some((first, count)) = node.long_leaf() {
                    count_all([first, count]);
                }
                // Of a node where an entry begins `count` says which slots it enters.
                for (slot, child) in node.children().into_iter().enumerate() {
                    match child.filter(|_| count >> slot & 1 != 0) {
                        Some(leaf) if leaf.is_leaf() => count_all([leaf.index, leaf.count]),
                        Some(node) => waiting.push([node.index, layout::InstanceRecord::ALL_SLOTS]),
                        None => {}
                    }
                }
            }
        }
    }
    counts
}

#[test]
fn a_top_level_has_the_bytes_of_the_hosts() {
    // On both sides of the sizes up to which one workgroup does all rounds, builds, and finishes the tree.
    for (count, budget) in [
        (0, 2.0),
        (1, 7.5),
        (2, 1.5),
        (30, 4.0),
        (300, 2.0),
        (700, 5.0),
        (1024, 2.0),
        (1025, 2.0),
        (2500, 4.0),
        (2500, 1.0),
    ] {
        let backend = with_budget(budget);
        for by_pointers in [false, true] {
            let world = World { by_pointers, ..mixture(count, count as u64) };
            let read = ReadBack::new(&backend, &world);
            let options = AccelOptions { rebraid_budget: budget, ..Ours::OPTIONS };
            let expected = twin::top_level(&read.instances, |a| read.below(a), world.flags, &options);
            let what = format!("{count} instances, budget {budget}");
            assert_eq!(read.top.header(), expected.header(), "{what}");
            let differ = read.top.records().iter().zip(expected.records()).position(|(a, b)| a != b);
            assert_eq!(differ.map(|i| (read.top.records()[i], expected.records()[i])), None, "{what}");
            assert!(read.top.to_bytes() == expected.to_bytes(), "{what}: the nodes differ");
        }
    }
}

#[test]
fn what_the_flags_ask_for_is_what_the_host_builds() {
    let world = mixture(400, 3);
    let all = [
        Flags::empty(),
        REBRAID | Flags::PREFER_FAST_BUILD,
        Flags::PREFER_FAST_TRACE,
        REBRAID | Flags::LOW_MEMORY,
        REBRAID | Flags::ALLOW_UPDATE,
        Flags::PREFER_FAST_TRACE | Flags::ALLOW_UPDATE,
    ];
    for (flags, wide) in
        all.into_iter().flat_map(|flags| [(flags, Wide::Never), (flags, Wide::ByFlags), (flags, Wide::Always)])
    {
        let options = AccelOptions { wide, ..AccelOptions::DEFAULT };
        let read = ReadBack::new(&Ours::with_options(device(), options), &World { flags, ..world.clone() });
        let expected = twin::top_level(&read.instances, |a| read.below(a), flags, &options);
        assert!(read.top.to_bytes() == expected.to_bytes(), "{flags:?}");
        assert_eq!(read.top.validate().map_err(|error| error.to_string()), Ok(()), "{flags:?}, {wide:?}");
        let is_asked = match wide {
            Wide::Never => false,
            Wide::ByFlags => flags.contains(Flags::PREFER_FAST_TRACE),
            Wide::Always => true,
        };
        let is_wide = is_asked && !flags.intersects(Flags::ALLOW_UPDATE | Flags::PREFER_FAST_BUILD);
        assert_eq!(matches!(read.top, Tree::OfEight(_)), is_wide, "{flags:?}");
        let opens = flags.intersects(REBRAID | Flags::PREFER_FAST_TRACE) && !flags.contains(Flags::ALLOW_UPDATE);
        assert_eq!(read.top.header().primitive_count > 400, opens, "{flags:?}");
        assert_eq!(entries_of(&read).values().any(|starts| starts.len() > 1), opens, "{flags:?}");
    }
}

/// More than one workgroup finishes, and so many that no subtrees are moved.
#[test]
fn fast_traces_of_many_entries_are_what_the_host_builds() {
    let (flags, options) = (Flags::PREFER_FAST_TRACE, AccelOptions::DEFAULT);
    for (instances, at_least) in [(2400, 8193), (4800, 16_385)] {
        let mut world = mixture(instances, 5);
        // Two of them stand apart from all others, which have a node of their own.
        for (i, x) in [(7, 9.0e4), (instances - 9, -8.0e4)] {
            world.instances[i] = Instance::new(3, scaled(1.0, [x, 0.0, 0.0]));
        }
        let read = ReadBack::new(&Ours::with_options(device(), options), &World { flags, ..world });
        let expected = twin::top_level(&read.instances, |a| read.below(a), flags, &options);
        let header = read.top.header();
        assert!(header.primitive_count >= at_least, "{} entries", header.primitive_count);
        assert_ne!(header.near_node, 0, "{instances} instances");
        assert!(read.top.to_bytes() == expected.to_bytes(), "{instances} instances");
    }
}

#[test]
fn top_levels_by_any_codes_are_those_of_the_host() {
    let world = mixture(300, 8);
    let robust = Code::Mc63.full().with_bounds(CodeBounds::Robust).expect("no grid");
    for codes in [
        Code::Mc30.full(),
        Code::Emc64Sort.full().with_bits(40),
        Code::Mip6.full(),
        Code::Bin(Binning::Q4_A4).full(),
        robust,
    ] {
        let options = AccelOptions { top_codes: Some(codes), ..Ours::OPTIONS };
        let read = ReadBack::new(&Ours::with_options(device(), options), &world);
        let expected = twin::top_level(&read.instances, |a| read.below(a), world.flags, &options);
        assert_eq!(read.top.header().code_bits, codes.bits, "{codes:?}");
        assert!(read.top.to_bytes() == expected.to_bytes(), "{codes:?}");
    }
}

#[test]
fn entries_keep_to_the_budget_and_reach_every_primitive_once() {
    for (count, budget) in [(1, 2.0), (50, 1.3), (400, 2.0), (400, 16.0), (1500, 2.5)] {
        let read = ReadBack::new(&with_budget(budget), &mixture(count, 77));
        let most = (f64::from(budget) * count as f64).ceil() as u32;
        assert_eq!(read.top.header().primitive_count, read.top.header().active);
        assert!(read.top.header().active <= most, "{count} {budget}");
        let entries = entries_of(&read);
        assert_eq!(entries.values().map(Vec::len).sum::<usize>(), read.top.header().active as usize);
        for (&instance, starts) in &entries {
            let counts = reached_by(&read, instance, starts);
            assert!(
                !counts.is_empty() && counts.iter().all(|&n| n == 1),
                "{instance} of {count}: {starts:?} {counts:?}"
            );
        }
        // Not one that can be seen is lost: what is not there has no inverse, or nothing to show.
        for (i, instance) in read.instances.iter().enumerate().filter(|(i, _)| !entries.contains_key(&(*i as u32))) {
            let below = |b: &Tree<Triangle>| b.header().active == 0;
            let shows_nothing = instance.structure == 0 || read.triangles.get(&instance.structure).is_some_and(below);
            let m = instance.transform.map(|row| row.map(f64::from));
            let minor = |r: usize, s: usize, c: usize, d: usize| m[r][c] * m[s][d] - m[r][d] * m[s][c];
            let determinant = m[0][0] * minor(1, 2, 1, 2) - m[0][1] * minor(1, 2, 0, 2) + m[0][2] * minor(1, 2, 0, 1);
            let is_bad = determinant == 0.0 || instance.transform.iter().flatten().any(|x| !x.is_finite());
            assert!(shows_nothing || is_bad, "{i} {instance:?}");
        }
        assert_eq!(read.top.header().status & !status::BAD_INSTANCE, 0);
    }
}

#[test]
fn the_loose_are_opened_and_the_tight_are_not() {
    // A full sphere, a single triangle and a flat grid fill their boxes; of the rows, the larger has more to save.
    let grid: Corners = (0..128)
        .map(|t| {
            let (x, z) = ((t / 2 % 8) as f32, (t / 16) as f32);
            match t % 2 {
                0 => [[x, 0.0, z], [x, 0.0, z + 1.0], [x + 1.0, 0.0, z]],
                _ => [[x + 1.0, 0.0, z], [x, 0.0, z + 1.0], [x + 1.0, 0.0, z + 1.0]],
            }
        })
        .collect();
    let parts = vec![part(icosphere(3)), part(soup(1, 0.5, 1)), part(grid), part(diagonal(300))];
    let mut instances = Vec::new();
    for i in 0..12 {
        let at = [3.0 * i as f32, 0.0, 0.0];
        instances.extend([Instance::new(1, scaled(1.0, at)), Instance::new(2, scaled(1.0, at))]);
        instances.push(Instance::new(3, scaled(0.25, at)));
    }
    let (small, large) = (instances.len() as u32, instances.len() as u32 + 1);
    instances.extend([Instance::new(4, scaled(0.5, [0.0; 3])), Instance::new(4, scaled(4.0, [1.0; 3]))]);
    let world = World { flags: REBRAID, ..World::new(parts, instances) };
    let counts_at = |budget: f32| -> Vec<usize> {
        let entries = entries_of(&ReadBack::new(&with_budget(budget), &world));
        (0..world.instances.len() as u32).map(|i| entries[&i].len()).collect()
    };
    for budget in [1.2, 2.0, 4.0] {
        let counts = counts_at(budget);
        assert!(counts[..small as usize].iter().all(|&n| n == 1), "budget {budget}: {counts:?}");
        assert!(counts[large as usize] >= 8, "budget {budget}: {counts:?}");
        assert!(counts[large as usize] >= counts[small as usize], "budget {budget}: {counts:?}");
    }
    // Of eight entries more, the large one gets nearly all: even its quarters have more to save than the small one's halves.
    assert!(counts_at(1.2)[small as usize] <= 2);
}

#[test]
fn candidates_are_those_of_whole_instances() {
    let mut random = SplitMix64::new(41);
    let parts = vec![part(diagonal(60)), part(soup(50, 0.4, 3)), part(placed(&diagonal(90), 1.0, [0.2, 0.0, 0.0]))];
    let instances: Vec<Instance> = (0..60)
        .map(|i| {
            let m = [(); 3].map(|()| [random.signed(), random.signed(), random.signed(), random.signed()]);
            Instance::new(1 + i % 3, m)
        })
        .collect();
    let whole = World::new(parts, instances);
    // The top level is of nodes of eight; and of nodes of two, over the same.
    let by_two = World { flags: Flags::PREFER_FAST_BUILD, ..whole.clone() };
    let opened = World { flags: REBRAID, ..whole.clone() };
    let opened_by_two = World { flags: REBRAID | Flags::PREFER_FAST_BUILD, ..whole.clone() };
    let rays: Vec<ProbeRay> = (0..2000)
        .map(|i| {
            let origin = random.around(2.0);
            // Some begin within the boxes, some run along the rows.
            let to = if i % 2 == 0 { random.around(1.0) } else { origin.map(|x| -x) };
            let ray = ProbeRay::new(origin, std::array::from_fn(|k| to[k] - origin[k]));
            ProbeRay { flags: flags::NO_OPAQUE, decision: IGNORE, ..ray }
        })
        .collect();
    let backend = with_budget(6.0);
    let read = ReadBack::new(&backend, &opened);
    assert!(entries_of(&read).values().any(|starts| starts.len() > 4), "nothing is opened: no test");
    let [expected, all @ ..] = [&by_two, &whole, &opened, &opened_by_two].map(|world| {
        let built = world.build(&backend);
        backend.probe(built.top.structure, &rays)
    });
    for (what, got) in ["whole", "opened", "opened, nodes of two"].into_iter().zip(&all) {
        let mut met = 0;
        for (i, (expected, got)) in expected.iter().zip(got).enumerate() {
            // An any-hit shader runs once for each: neither twice nor less for what is opened.
            assert_eq!(got.candidate_count, expected.candidate_count, "{what}, ray {i}");
            if got.candidate_count <= 8 {
                assert_eq!(got.sorted_candidates(), expected.sorted_candidates(), "{what}, ray {i}");
            }
            met += got.candidate_count;
        }
        assert!(met > 1000, "{what}: {met} candidates are no test");
    }
}

#[test]
fn the_same_input_gives_the_same_bytes_every_time() {
    for count in [600, 3000] {
        let world = mixture(count, 9);
        let backend = with_budget(3.0);
        let built = world.build(&backend);
        // What lies behind the structure is nobody's.
        let in_use = |built: &crate::common::backends::Built| {
            let bytes = built.memory.read::<u8>(built.bytes as usize);
            Tree::<layout::InstanceRecord>::from_bytes(&bytes).expect("a top level").to_bytes()
        };
        let bytes = in_use(&built.top);
        for _ in 0..5 {
            let info = vk::AccelerationStructureBuildGeometryInfoKHR::default()
                .ty(vk::AccelerationStructureTypeKHR::TOP_LEVEL)
                .flags(REBRAID)
                .geometries(std::slice::from_ref(&built.geometry));
            let range = vk::AccelerationStructureBuildRangeInfoKHR::default().primitive_count(count as u32);
            let again = crate::common::backends::Built::new(&backend, &info, &[range], 0);
            assert!(in_use(&again) == bytes, "{count}");
        }
    }
}

#[test]
fn fewer_instances_than_were_planned_for_are_opened_too() {
    // Their number lies in device memory: the entries behind it have no instance, and stay closed.
    let world = mixture(200, 21);
    let backend = with_budget(2.0);
    let built = world.build(&backend);
    let info = vk::AccelerationStructureBuildGeometryInfoKHR::default()
        .ty(vk::AccelerationStructureTypeKHR::TOP_LEVEL)
        .flags(REBRAID)
        .geometries(std::slice::from_ref(&built.geometry));
    let top = crate::common::backends::Built::place(&backend, &info, &[200], 0);
    let (_memory, scratch) = top.scratch(&backend, &info, &[200]);
    let range = device().upload("range", &[120u32, 0, 0, 0]).expect("memory");
    let info = info
        .dst_acceleration_structure(top.structure)
        .scratch_data(vk::DeviceOrHostAddressKHR { device_address: scratch });
    device()
        .run(None, |recorder| unsafe {
            let indirect: accel::Device<'_> = backend.0;
            indirect.cmd_build_acceleration_structures_indirect(
                recorder.commands(),
                &[info],
                &[range.address()],
                &[16],
                &[&[200]],
            )
        })
        .expect("it builds");
    let tree: Tree<layout::InstanceRecord> =
        Tree::from_bytes(&top.memory.read::<u8>(top.bytes as usize)).expect("a top level");
    let mut counts = BTreeMap::<u32, u32>::new();
    tree.records().iter().filter(|r| r.structure != 0).for_each(|r| *counts.entry(r.instance).or_default() += 1);
    assert_eq!(counts.values().sum::<u32>(), tree.header().active);
    assert!(counts.keys().all(|&i| i < 120) && counts.values().any(|&n| n > 1), "{counts:?}");
}

/// Few entries are one node, and what one workgroup makes needs other memory than a chain: what is asked for must suffice for fewer, too.
#[test]
fn the_sizes_of_a_maximum_of_instances_suffice_for_every_smaller_count() {
    let instances = vk::AccelerationStructureGeometryInstancesDataKHR::default()
        .data(vk::DeviceOrHostAddressConstKHR { device_address: 16 });
    let geometry = vk::AccelerationStructureGeometryKHR::default()
        .geometry_type(vk::GeometryTypeKHR::INSTANCES)
        .geometry(vk::AccelerationStructureGeometryDataKHR { instances });
    let info = vk::AccelerationStructureBuildGeometryInfoKHR::default()
        .ty(vk::AccelerationStructureTypeKHR::TOP_LEVEL)
        .geometries(std::slice::from_ref(&geometry));
    let counts = (0..70).chain((7..20).flat_map(|bit| [-1, 0, 1, 300].map(|by| ((1i64 << bit) + by) as u32)));
    let mut counts: Vec<u32> = counts.collect();
    counts.sort_unstable();
    for flags in [Flags::empty(), Flags::PREFER_FAST_BUILD, Flags::PREFER_FAST_TRACE, REBRAID, Flags::ALLOW_UPDATE] {
        for wide in [Wide::Never, Wide::ByFlags, Wide::Always] {
            let ours = Ours::with_options(device(), AccelOptions { wide, ..AccelOptions::DEFAULT });
            let mut most = [0; 2];
            for &count in &counts {
                let sizes = ours.build_sizes(&info.flags(flags), &[count]);
                let needed =
                    Request::instances(16, count).with_flags(flags).sizes(&ours.0).expect("as many as there may be");
                most = [most[0].max(needed.structure), most[1].max(needed.scratch)];
                assert!(
                    sizes.acceleration_structure_size >= most[0] && sizes.build_scratch_size >= most[1],
                    "{count}, {flags:?}, {wide:?}: {sizes:?}, {most:?}"
                );
            }
        }
    }
}
