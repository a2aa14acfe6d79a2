//! Reinsertion: the device's bytes are the host's; trees stay valid and never become worse.

use crate::common::{corpus, device};
use hedgerow::bvh::child_order::ChildOrder;
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::far;
use hedgerow::bvh::flux::{FluxGrid, GRID_BYTES};
use hedgerow::bvh::layout::{Bvh2, Child, MAX_DEPTH, Node, Record, status};
use hedgerow::bvh::reinsertion::{Cost, Probed, Reinsertion, ReinsertionOptions};
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::reinsertion::CostOnHost;
use hedgerow::bvh::twin::{lbvh, ploc, quality};
use hedgerow::gpu::Region;
use hedgerow::trace::twin::{flux, tracer, trial};
use hedgerow::trace::{Hit, Query, Ray};

/// The LBVH and PLOC of every mesh, with one triangle a leaf.
fn trees() -> impl Iterator<Item = (String, Bvh2)> {
    let large = [corpus::random("20,000 random", 20_000, [0.0; 3], [1.0; 3])];
    corpus::meshes().into_iter().chain(large).flat_map(|(name, positions, triangles)| {
        let lbvh = lbvh::build(&positions, &triangles, Code::Mc30.full(), Collapse::OFF);
        let ploc = ploc::build(&lbvh, 4);
        [(format!("LBVH, {name}"), lbvh), (format!("PLOC, {name}"), ploc)]
    })
}

/// Few links a round, every link, and a stride that all of them take.
const OPTIONS: [ReinsertionOptions; 3] = [
    ReinsertionOptions::FAST,
    ReinsertionOptions { rounds: 4, stride: 1 },
    ReinsertionOptions { rounds: 12, stride: 5 },
];

/// Cost of the steps: what reinsertion lessens.
fn area(tree: &Bvh2) -> f64 {
    quality::of(tree, 1.0, 0.0).sah
}

#[test]
fn optimised_trees_are_valid_with_the_same_records_and_never_worse() {
    for (name, tree) in trees() {
        for options in OPTIONS {
            let optimised = tree.reinserted(&options);
            assert!(optimised.records == tree.records, "{name}: other records");
            assert_eq!(optimised.header, tree.header, "{name}");
            if quality::of(&optimised, 1.0, 0.0).depth_max <= MAX_DEPTH {
                optimised.validate().unwrap_or_else(|e| panic!("{name} {options:?}: {e}"));
            }
            for collapse in [Collapse::SAH, Collapse::OFF] {
                optimised.collapsed(&collapse).validate().unwrap_or_else(|e| panic!("{name} {options:?}: {e}"));
            }
            let (before, after) = (area(&tree), area(&optimised));
            assert!(after <= before * (1.0 + 1e-6), "{name} {options:?}: {before} became {after}");
        }
    }
}

/// Sixty-four cells of sixteen triangles in any order, against a tree that knows where each lies.
#[test]
fn a_tree_that_is_bad_below_becomes_better_than_a_good_one() {
    let (_, positions, triangles) = corpus::random("random 1023", 1023, [0.0; 3], [1.0; 3]);
    let lbvh = |bits| lbvh::build(&positions, &triangles, Code::Mc30.full().with_bits(bits), Collapse::OFF);
    let (bad, good) = (lbvh(6), ploc::build(&lbvh(30), 25));
    let optimised = bad.reinserted(&ReinsertionOptions::HIGH);
    assert!(area(&bad) > 1.3 * area(&good), "{} is not bad against {}", area(&bad), area(&good));
    assert!(area(&optimised) < area(&good), "{} against {}", area(&optimised), area(&good));
}

#[test]
fn the_device_gives_the_bytes_of_the_host_and_touches_nothing_else() {
    const GUARD: [u8; 256] = [0xA5; 256];
    let device = device();
    for (name, tree) in trees() {
        for options in OPTIONS {
            let reinsertion = Reinsertion::new(device, &options, tree.header.primitive_count);
            let bytes = tree.to_bytes();
            let structure = device.upload("structure", &[&bytes[..], &GUARD].concat()).unwrap();
            let scratch_bytes = reinsertion.scratch_bytes();
            let scratch =
                device.upload("scratch", &[vec![0xFF; scratch_bytes as usize], GUARD.to_vec()].concat()).unwrap();
            device.run(None, |r| reinsertion.record(r, structure.region(), scratch.region())).unwrap();
            let got = structure.read::<u8>(bytes.len());
            assert!(got == tree.reinserted(&options).to_bytes(), "{name} {options:?}: other bytes");
            assert_eq!(
                structure.read_at::<u8>(bytes.len() as u64, GUARD.len()),
                GUARD,
                "{name}: wrote behind the structure"
            );
            assert_eq!(
                scratch.read_at::<u8>(scratch_bytes, GUARD.len()),
                GUARD,
                "{name}: wrote behind the scratch memory"
            );
        }
    }
}

/// Rays from the middle of a scene that go into one corner of it, and where they hit.
fn taught(tree: &Bvh2, count: u32) -> Vec<(Ray, Hit)> {
    let bounds = tree.header.root.bounds();
    let middle = bounds.centroid();
    let ray = |i: u32| {
        let part = [7919 * i % 1009, 6101 * i % 1013, 4001 * i % 1019].map(|k| k as f32 / 1019.0);
        let direction =
            std::array::from_fn(|k| (bounds.hi[k] - middle[k]) * part[k] + 1e-3 * (bounds.hi[0] - middle[0]));
        Ray { origin: middle, t_min: 0.0, direction, t_max: f32::INFINITY }
    };
    (0..count).map(ray).map(|ray| (ray, tracer::closest_hit(tree, &ray))).collect()
}

fn flux_of(tree: &Bvh2, rays: &[(Ray, Hit)]) -> FluxGrid {
    flux::fill(tree, rays.iter().map(|(ray, hit)| (ray, hit)))
}

/// The tree after rounds on the device, and what a probe of it finds before them.
fn by_rays_on_device(
    tree: &Bvh2,
    options: &ReinsertionOptions,
    first_round: u32,
    cost: Option<(&FluxGrid, f32)>,
) -> (Bvh2, Probed) {
    const GUARD: [u8; 256] = [0xA5; 256];
    let device = device();
    let count = tree.header.primitive_count;
    let pass = Reinsertion::new(device, options, count).from_round(first_round);
    let probe = Reinsertion::new(device, &ReinsertionOptions::PROBE, count);
    let structure = device.upload("structure", &[&tree.to_bytes()[..], &GUARD].concat()).unwrap();
    let grid = cost.map(|(grid, share)| (device.upload("grid", &grid.to_bytes()).unwrap(), share));
    let cost = grid.as_ref().map_or(Cost::Area, |(grid, share)| Cost::Rays { grid: grid.region(), share: *share });
    let scratch_bytes = match cost {
        Cost::Area => pass.scratch_bytes().max(probe.scratch_bytes()),
        Cost::Rays { .. } => pass.scratch_bytes_by_rays().max(probe.scratch_bytes_by_rays()),
    };
    let scratch = device.upload("scratch", &[vec![0xFF; scratch_bytes as usize], GUARD.to_vec()].concat()).unwrap();
    let found = device.upload("found", &[0xEEu8; size_of::<Probed>()]).unwrap();
    device.run(None, |r| probe.record_probe(r, structure.region(), &cost, scratch.region(), found.region())).unwrap();
    let bytes = tree.to_bytes().len();
    assert!(structure.read::<u8>(bytes) == tree.to_bytes(), "a probe changes nothing");
    device.run(None, |r| pass.record_rounds(r, structure.region(), &cost, scratch.region())).unwrap();
    assert_eq!(structure.read_at::<u8>(bytes as u64, GUARD.len()), GUARD, "wrote behind the structure");
    assert_eq!(scratch.read_at::<u8>(scratch_bytes, GUARD.len()), GUARD, "wrote behind the scratch memory");
    (Bvh2::from_bytes(&structure.read::<u8>(bytes)).expect("a structure"), found.read(1)[0])
}

#[test]
fn rounds_by_rays_and_their_probe_are_those_of_the_host() {
    let options = ReinsertionOptions { rounds: 12, stride: 5 };
    let (mut moved, mut gained, mut unused) = (0, 0, 0);
    for (name, tree) in trees().filter(|(_, tree)| tree.nodes.len() < 10_000) {
        let mut tree = tree.collapsed(&Collapse::SAH);
        // What lies in the slots that collapsing left unused is not looked at: it would lead far out of the memory.
        for child in tree.nodes.iter_mut().filter(|node| !node.is_used()).flat_map(|node| &mut node.children) {
            child.index = u32::MAX;
            unused += 1;
        }
        let grid = flux_of(&tree, &taught(&tree, 500));
        for (cost, on_host) in [
            (Some((&grid, 0.9)), CostOnHost::Rays { grid: &grid, share: 0.9 }),
            (Some((&grid, 0.0)), CostOnHost::Rays { grid: &grid, share: 0.0 }),
            (None, CostOnHost::Area),
        ] {
            let expected = tree.reinserted_by(&options, 3, &on_host).expect("a share");
            let (got, probed) = by_rays_on_device(&tree, &options, 3, cost);
            assert!(
                got.to_bytes() == expected.to_bytes(),
                "{name}, {cost:?}: another tree",
                cost = cost.map(|cost| cost.1)
            );
            assert_eq!(probed, tree.probed(&ReinsertionOptions::PROBE, &on_host).expect("a share"), "{name}");
            moved += usize::from(got.nodes != tree.nodes);
            gained += usize::from(probed.gains > 0);
            if quality::of(&got, 1.0, 0.0).depth_max <= MAX_DEPTH {
                got.validate().unwrap_or_else(|e| panic!("{name}: {e}"));
            }
        }
    }
    assert!(
        moved > 20 && gained > 20 && unused > 1000,
        "{moved} trees moved, {gained} gained; {unused} unused children"
    );
}

#[test]
fn without_rays_and_with_no_share_rounds_are_by_area() {
    let (_, positions, triangles) = corpus::random("random 2000", 2000, [0.0; 3], [1.0; 3]);
    let tree = lbvh::build(&positions, &triangles, Code::Mc30.full(), Collapse::SAH);
    let by_area = tree.reinserted_by(&ReinsertionOptions::FAST, 0, &CostOnHost::Area).expect("a tree");
    assert!(by_area.nodes != tree.nodes);
    let (empty, full) = (flux_of(&tree, &[]), flux_of(&tree, &taught(&tree, 2000)));
    for (grid, share) in [(&empty, 0.9), (&full, 0.0)] {
        let got = tree.reinserted_by(&ReinsertionOptions::FAST, 0, &CostOnHost::Rays { grid, share }).expect("a share");
        assert!(got.to_bytes() == by_area.to_bytes(), "share {share}");
    }
    let by_rays = CostOnHost::Rays { grid: &full, share: 0.9 };
    let by_rays = tree.reinserted_by(&ReinsertionOptions::FAST, 0, &by_rays).expect("a share");
    assert!(by_rays.nodes != by_area.nodes);
}

/// Rays that all go into one corner: there the tree gets better for other rays of the kind, more than by area.
#[test]
fn rays_teach_where_work_is_saved() {
    let (_, positions, triangles) = corpus::random("random 4000", 4000, [0.0; 3], [1.0; 3]);
    let tree = lbvh::build(&positions, &triangles, Code::Mc30.full().with_bits(12), Collapse::SAH);
    let all = taught(&tree, 4000);
    let (teaching, measured): (Vec<_>, Vec<_>) = all.into_iter().enumerate().partition(|(i, _)| i % 2 == 0);
    let teaching: Vec<(Ray, Hit)> = teaching.into_iter().map(|(_, ray)| ray).collect();
    let grid = flux_of(&tree, &teaching);
    let work = |tree: &Bvh2| -> u64 {
        trial::work(tree, measured.iter().map(|(_, (ray, _))| ray), Query::ClosestHit, &Collapse::SAH)
    };
    let rounds = |cost| work(&tree.reinserted_by(&ReinsertionOptions::FAST, 0, &cost).expect("a share"));
    let (by_area, by_rays) = (rounds(CostOnHost::Area), rounds(CostOnHost::Rays { grid: &grid, share: Cost::SHARE }));
    assert!(by_rays < by_area, "{by_rays} by rays, {by_area} by area, {} before", work(&tree));
}

#[test]
fn rounds_take_the_order_of_children_away() {
    let (_, positions, triangles) = corpus::random("random 500", 500, [0.0; 3], [1.0; 3]);
    let tree = lbvh::build(&positions, &triangles, Code::Mc30.full(), Collapse::SAH);
    let mut tree = tree.in_child_order(ChildOrder::LargerBox, &Collapse::SAH);
    assert_eq!(tree.header.child_order, 1);
    // And what is told of something far, as subtrees may go there.
    (tree.header.near_node, tree.header.far_sides) = (1, 1);
    tree.far = vec![tree.header.root.bounds(); far::SIDES];
    let (got, _) = by_rays_on_device(&tree, &ReinsertionOptions::FAST, 0, None);
    assert_eq!((got.header.child_order, got.header.near_node, got.header.far_sides), (0, 0, 0));
    let expected = tree.reinserted_by(&ReinsertionOptions::FAST, 0, &CostOnHost::Area).expect("a tree");
    assert!(got.to_bytes() == expected.to_bytes());
}

#[test]
fn a_tree_that_is_too_deep_says_so() {
    // A chain: each node holds a triangle and the rest, the deepest at the bottom.
    let chain = |count: u32| {
        let corner = |i: u32| [[i as f32, 0.0, 0.0], [i as f32, 1.0, 0.0], [i as f32 + 0.5, 0.0, 1.0]];
        let positions: Vec<[f32; 3]> = (0..count).flat_map(corner).collect();
        let triangles: Vec<[u32; 3]> = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let mut tree = lbvh::build(&positions, &triangles, Code::Mc30.full(), Collapse::OFF);
        let leaf = |i: u32| {
            let bounds = tree.records[i as usize].bounds().expect("a triangle");
            Child { lo: bounds.lo, index: i, hi: bounds.hi, count: 1 }
        };
        let leaves: Vec<Child> = (0..count).map(leaf).collect();
        let mut rest = leaves[0];
        for slot in 0..count - 1 {
            let other = leaves[slot as usize + 1];
            tree.nodes[slot as usize] = Node { children: [rest, other] };
            let around = rest.bounds().union(&other.bounds());
            rest = Child { lo: around.lo, index: slot, hi: around.hi, count: 0 };
        }
        tree.header.root = rest;
        tree
    };
    let none = ReinsertionOptions { rounds: 0, stride: 1 };
    for (count, expected) in [(MAX_DEPTH + 1, 0), (MAX_DEPTH + 2, status::TOO_DEEP)] {
        let tree = chain(count);
        let (got, _) = by_rays_on_device(&tree, &none, 0, None);
        assert_eq!(got.header.status, expected, "{count} triangles");
        assert_eq!(tree.reinserted_by(&none, 0, &CostOnHost::Area).expect("a tree").header.status, expected);
    }
}

#[test]
fn what_rounds_cannot_take_is_refused_by_name() {
    let device = device();
    let pass = Reinsertion::new(device, &ReinsertionOptions::FAST, 100);
    let of = |bytes| Region { address: 16, bytes };
    let refused = |cost: Cost, scratch: u64| {
        device.run(None, |r| pass.record_rounds(r, of(1 << 20), &cost, of(scratch))).expect_err("refused").to_string()
    };
    let by_rays = |bytes, share| Cost::Rays { grid: of(bytes), share };
    for share in [-0.1, 1.0, f32::NAN] {
        let error = refused(by_rays(GRID_BYTES, share), 1 << 20);
        assert!(error.contains("take one from 0") && error.contains("0.99"), "{error}");
    }
    assert!(refused(by_rays(GRID_BYTES - 1, 0.9), 1 << 20).contains("a grid of rays that teach reinsertion"));
    assert!(refused(by_rays(GRID_BYTES, 0.9), pass.scratch_bytes_by_rays() - 1).contains("scratch memory"));
    assert!(refused(Cost::Area, pass.scratch_bytes() - 1).contains("scratch memory"));
    let found = |bytes| {
        device
            .run(None, |r| pass.record_probe(r, of(1 << 20), &Cost::Area, of(1 << 20), of(bytes)))
            .expect_err("refused")
            .to_string()
    };
    assert!(found(15).contains("what a probe finds"));
}
