//! Counts of rays by links: the device's are the twin's, number for number, and what is counted is what tracers do.

use crate::common::shapes::{Corners, hard_rays, icosphere, no_rays, placed, soup, tree_of, tree_with};
use crate::common::{corpus, device};
use hedgerow::bvh::child_order::{ChildOrder, ChildOrderPass};
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::counts::LinkCount;
use hedgerow::bvh::layout::{Bvh2, Triangle, status};
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::lbvh;
use hedgerow::gpu::Region;
use hedgerow::trace::counts::{CountPass, CountedRays, CountedWalk, Earlier, Tallies};
use hedgerow::trace::twin::{counts as host, tracer};
use hedgerow::trace::{Query, Ray};

const WALKS: [CountedWalk; 3] =
    [CountedWalk::AsTraced(Query::ClosestHit), CountedWalk::AsTraced(Query::AnyHit), CountedWalk::Exhaustive];
const GUARD: [u8; 64] = [0xA5; 64];

fn on_host(tree: &Bvh2, rays: &[Ray], walk: CountedWalk) -> Vec<LinkCount> {
    let mut counts = vec![LinkCount::default(); 2 * tree.nodes.len()];
    host::count(tree, rays, walk, &Collapse::SAH, &mut counts);
    counts
}

/// What the device counts of each `stride`-th ray, one sample after the other, with what came before treated as `earlier` says.
fn on_device(tree: &Bvh2, samples: &[(&[Ray], u32)], walk: CountedWalk, earlier: Earlier) -> Vec<LinkCount> {
    let device = device();
    let pass = CountPass::new(device, Collapse::SAH, tree.header.primitive_count);
    let guarded = |bytes: u64| [vec![0xEEu8; bytes as usize], GUARD.to_vec()].concat();
    let structure = device.upload("structure", &tree.to_bytes()).expect("memory");
    let tallies = device.upload("tallies", &guarded(pass.tally_bytes())).expect("memory");
    let counts = device.upload("counts", &guarded(pass.counts_bytes())).expect("memory");
    let scratch = device.upload("scratch", &guarded(pass.scratch_bytes())).expect("memory");
    let counted = Tallies { structure: structure.region(), tallies: tallies.region() };
    device.run(None, |r| pass.record_clear(r, &counted)).expect("cleared");
    for (i, &(rays, stride)) in samples.iter().enumerate() {
        let uploaded = device.upload("rays", rays).expect("memory");
        let rays = CountedRays { rays: uploaded.region(), ray_count: rays.len() as u32, first: 0, stride };
        let earlier = if i == 0 { Earlier::Dropped } else { earlier };
        device
            .run(None, |r| {
                pass.record_rays(r, walk, &rays, &counted)?;
                r.barrier();
                pass.record_gather(r, &counted, counts.region(), scratch.region(), earlier)
            })
            .expect("counted");
    }
    for (what, buffer, bytes) in [
        ("tallies", &tallies, pass.tally_bytes()),
        ("counts", &counts, pass.counts_bytes()),
        ("scratch", &scratch, pass.scratch_bytes()),
    ] {
        assert_eq!(buffer.read_at::<u8>(bytes, GUARD.len()), GUARD, "wrote behind the {what}");
    }
    counts.read(2 * tree.nodes.len())
}

#[track_caller]
fn assert_as_on_the_host(what: &str, tree: &Bvh2, rays: &[Ray]) {
    for walk in WALKS {
        let (got, expected) = (on_device(tree, &[(rays, 1)], walk, Earlier::Kept), on_host(tree, rays, walk));
        for (link, (got, expected)) in got.iter().zip(&expected).enumerate() {
            assert_eq!(got, expected, "{what}, {walk:?}: link {link}");
        }
    }
}

#[test]
fn counts_are_those_of_the_host_at_any_scale() {
    for (size, scale, far) in [(0.3, 1.0, 0.0), (1.0, 1.0, 3.0), (0.2, 1e-10, 0.0), (0.2, 1e15, 1.0)] {
        let offset = [far * scale, -far * scale, 0.5 * far * scale];
        let corners = placed(&soup(300, size, 5), scale, offset);
        let rays = hard_rays(&corners, 1_000, scale, offset, 11);
        for collapse in [Collapse::SAH, Collapse::OFF] {
            assert_as_on_the_host(&format!("soup of {scale:e}"), &tree_with(&corners, collapse), &rays);
        }
    }
    for count in [0, 1, 7, 8, 9, 63, 64, 65] {
        let corners = icosphere(2);
        assert_as_on_the_host("a sphere", &tree_of(&corners), &hard_rays(&corners, count, 1.0, [0.0; 3], 3));
    }
    assert_as_on_the_host("what is no ray", &tree_of(&icosphere(2)), &no_rays());
}

#[test]
fn counts_of_bad_scenes_are_those_of_the_host() {
    for (name, positions, triangles) in corpus::meshes() {
        let tree = lbvh::build(&positions, &triangles, Code::Emc64Var.full(), Collapse::SAH);
        let corners = soup(40, 1.0, 2);
        assert_as_on_the_host(&name, &tree, &hard_rays(&corners, 70, 1.0, [0.0; 3], 9));
    }
}

#[test]
fn long_leaves_that_wait_are_taken_as_the_tracer_does() {
    let triangle = |place: f32| [[place, 0.0, 0.0], [place, 1.0, 0.0], [place, 0.0, 1.0]];
    let piles = [(0.0, 30), (1.0, 31), (2.0, 32), (3.0, 1000), (4.0, 1)];
    let corners: Corners = piles.iter().flat_map(|&(at, count)| std::iter::repeat_n(triangle(at), count)).collect();
    assert_as_on_the_host("piles", &tree_of(&corners), &hard_rays(&corners, 300, 1.0, [0.0; 3], 4));
}

/// What hangs from the root has the work of all steps but those at the root, and of all tests of rays to the closest hit.
#[test]
fn the_work_of_the_roots_links_is_that_of_the_tracer() {
    let corners = soup(500, 0.4, 21);
    let tree = tree_of(&corners);
    let rays = hard_rays(&corners, 2_000, 1.0, [0.0; 3], 5);
    let counts = on_host(&tree, &rays, CountedWalk::AsTraced(Query::ClosestHit));
    let root = 2 * tree.header.root.index as usize;
    let (mut steps, mut tests, mut walked) = (0, 0, 0);
    for ray in &rays {
        let work = tracer::trace(&tree, ray, Query::ClosestHit).1;
        (steps, tests, walked) = (steps + work.steps, tests + work.tests, walked + u32::from(work.steps > 0));
    }
    assert_eq!(counts[root].work + counts[root + 1].work, 3 * (steps - walked) + 2 * tests);
    // Of rays that end at any hit, those that do so hit something in one of the two.
    let counts = on_host(&tree, &rays, CountedWalk::AsTraced(Query::AnyHit));
    let hits = rays.iter().filter(|ray| tracer::any_hit(&tree, ray).is_some()).count() as u32;
    assert!(hits > 100, "{hits} hits");
    assert_eq!(counts[root].hits + counts[root + 1].hits, hits);
    for (link, count) in counts.iter().enumerate() {
        assert!(count.hits <= count.entered, "link {link}: {count:?}");
    }
}

/// A swapped tree has the same counts at swapped links, where rays go through all that they meet.
#[test]
fn exhaustive_counts_do_not_depend_on_the_order_of_children() {
    let corners = soup(400, 0.5, 8);
    let tree = tree_of(&corners);
    let rays = hard_rays(&corners, 500, 1.0, [0.0; 3], 6);
    let mut swapped = tree.clone();
    swapped.nodes.iter_mut().filter(|node| node.is_used()).for_each(|node| node.children.swap(0, 1));
    let (counts, of_swapped) =
        (on_host(&tree, &rays, CountedWalk::Exhaustive), on_host(&swapped, &rays, CountedWalk::Exhaustive));
    assert!(counts.iter().any(|count| count.hits > 0));
    for (link, count) in counts.iter().enumerate() {
        assert_eq!(*count, of_swapped[link ^ 1], "link {link}");
    }
}

#[test]
fn a_part_of_the_rays_is_counted_and_what_was_counted_before_is_kept_halved_or_dropped() {
    let corners = soup(300, 0.3, 5);
    let tree = tree_of(&corners);
    let rays = hard_rays(&corners, 1_001, 1.0, [0.0; 3], 11);
    let walk = CountedWalk::Exhaustive;
    let every_third: Vec<Ray> = rays.iter().step_by(3).copied().collect();
    let (all, third) = (on_host(&tree, &rays, walk), on_host(&tree, &every_third, walk));
    assert_eq!(on_device(&tree, &[(&rays[..], 3)], walk, Earlier::Kept), third);
    let samples = [(&rays[..], 1), (&rays[..], 3)];
    assert_eq!(on_device(&tree, &samples, walk, Earlier::Dropped), third);
    let mut kept = all.clone();
    host::count(&tree, &every_third, walk, &Collapse::SAH, &mut kept);
    assert_eq!(on_device(&tree, &samples, walk, Earlier::Kept), kept);
    let mut halved = all;
    host::halve(&mut halved);
    host::count(&tree, &every_third, walk, &Collapse::SAH, &mut halved);
    assert_eq!(on_device(&tree, &samples, walk, Earlier::Halved), halved);
}

/// The largest number that 32 bits hold stands for all that are larger.
#[test]
fn work_that_has_no_room_stays_at_the_most() {
    let pile = [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let far = [[9.0, 0.0, 0.0], [9.0, 1.0, 0.0], [9.0, 0.0, 1.0]];
    let tree = tree_of(&[vec![pile; 60_000], vec![far]].concat());
    let ray = Ray { origin: [-1.0, 0.2, 0.2], t_min: 0.0, direction: [1.0, 0.0, 0.0], t_max: 5.0 };
    let rays = vec![ray; 4];
    let costs = Collapse { c_i: 20_000.0, ..Collapse::SAH };
    let mut expected = vec![LinkCount::default(); 2 * tree.nodes.len()];
    host::count(&tree, &rays, CountedWalk::AsTraced(Query::AnyHit), &costs, &mut expected);
    assert!(expected.iter().any(|count| count.work == u32::MAX), "4 × 60,000 × 20,000 is more than 32 bits hold");
    let device = device();
    let pass = CountPass::new(device, costs, tree.header.primitive_count);
    let structure = device.upload("structure", &tree.to_bytes()).expect("memory");
    let uploaded = device.upload("rays", &rays).expect("memory");
    let memory = |bytes| device.buffer("memory", bytes).expect("memory");
    let (tallies, counts, scratch) =
        (memory(pass.tally_bytes()), memory(pass.counts_bytes()), memory(pass.scratch_bytes()));
    let counted = Tallies { structure: structure.region(), tallies: tallies.region() };
    let rays = CountedRays { rays: uploaded.region(), ray_count: 4, first: 0, stride: 1 };
    device
        .run(None, |r| {
            pass.record_clear(r, &counted)?;
            r.barrier();
            pass.record_rays(r, CountedWalk::AsTraced(Query::AnyHit), &rays, &counted)?;
            r.barrier();
            pass.record_gather(r, &counted, counts.region(), scratch.region(), Earlier::Dropped)
        })
        .expect("counted");
    assert_eq!(counts.read::<LinkCount>(expected.len()), expected);
}

#[test]
fn trees_without_links_and_those_that_cannot_be_used_have_no_counts() {
    let rays = hard_rays(&icosphere(0), 40, 1.0, [0.0; 3], 1);
    assert_as_on_the_host("no triangles", &tree_of(&Corners::new()), &rays);
    let mut tree = tree_of(&icosphere(1));
    tree.header.status |= status::TOO_DEEP;
    for walk in WALKS {
        assert!(on_host(&tree, &rays, walk).iter().all(|count| *count == LinkCount::default()));
    }
}

#[test]
fn what_cannot_be_counted_is_refused_by_name() {
    let device = device();
    let pass = CountPass::new(device, Collapse::SAH, 100);
    let of = |bytes| Region { address: 16, bytes };
    let tallies = Tallies { structure: of(1 << 20), tallies: of(pass.tally_bytes()) };
    let rays = CountedRays { rays: of(320), ray_count: 10, first: 0, stride: 1 };
    let walk = CountedWalk::Exhaustive;
    let refused = |rays: CountedRays, tallies: Tallies| {
        device.run(None, |r| pass.record_rays(r, walk, &rays, &tallies)).expect_err("refused").to_string()
    };
    assert!(refused(CountedRays { stride: 0, ..rays }, tallies).contains("take a stride of 1"));
    assert!(refused(CountedRays { ray_count: (1 << 27) + 1, ..rays }, tallies).contains("134217728"));
    assert!(refused(CountedRays { ray_count: 11, ..rays }, tallies).contains("memory of rays of 320"));
    let small = Tallies { tallies: of(pass.tally_bytes() - 1), ..tallies };
    assert!(refused(rays, small).contains("memory for tallies of rays"));
    let gathered = |counts: u64, scratch: u64| {
        device
            .run(None, |r| pass.record_gather(r, &tallies, of(counts), of(scratch), Earlier::Kept))
            .expect_err("refused")
            .to_string()
    };
    assert!(gathered(pass.counts_bytes() - 1, pass.scratch_bytes()).contains("memory for counts of rays"));
    assert!(gathered(pass.counts_bytes(), pass.scratch_bytes() - 1).contains("scratch memory for counts of rays"));
}

#[test]
fn rays_teach_which_child_comes_first_and_the_device_learns_the_same() {
    // A large triangle that all rays pass by within its box, and behind it a wall of small ones that stops them.
    let beside = [[0.0, -10.0, -10.0], [0.0, 10.0, -10.0], [0.0, -10.0, 10.0]];
    let cell = |i: usize| {
        let [y, z] = [i % 20, i / 20].map(|k| 0.5 * k as f32);
        [
            [[5.0, y, z], [5.0, y + 0.5, z], [5.0, y, z + 0.5]],
            [[5.0, y + 0.5, z + 0.5], [5.0, y + 0.5, z], [5.0, y, z + 0.5]],
        ]
    };
    let corners: Corners = (0..400).flat_map(cell).chain([beside]).collect();
    let tree = tree_of(&corners);
    let ray = |i: u32| {
        let [y, z] = [7919 * i % 1000, 6101 * i % 1000].map(|k| 1.0 + 0.008 * k as f32);
        Ray { origin: [-1.0, y, z], t_min: 0.0, direction: [1.0, 0.01, 0.0], t_max: f32::INFINITY }
    };
    let rays: Vec<Ray> = (0..400).map(ray).collect();
    let (teaching, measured) = rays.split_at(200);
    let counts = on_host(&tree, teaching, CountedWalk::Exhaustive);
    let mut expected_counts = counts.clone();
    let expected = tree.clone().in_order_of_counts(&mut expected_counts, &Collapse::SAH);
    expected.validate().expect("sound");
    let mut again_counts = expected_counts.clone();
    let again = expected.clone().in_order_of_counts(&mut again_counts, &Collapse::SAH);
    assert!(again.to_bytes() == expected.to_bytes(), "twice is not once");
    assert_eq!(expected_counts, on_host(&expected, teaching, CountedWalk::Exhaustive), "counts go with their links");

    let device = device();
    let pass = ChildOrderPass::new(device, ChildOrder::MoreHitsForItsCost, Collapse::SAH, tree.header.primitive_count);
    let structure = device.upload("structure", &tree.to_bytes()).expect("memory");
    let on_device = device.upload("counts", &counts).expect("memory");
    let scratch = device.buffer("scratch", pass.scratch_bytes()).expect("memory");
    device
        .run(None, |r| pass.record_by_counts(r, structure.region(), on_device.region(), scratch.region()))
        .expect("in order");
    let got = Bvh2::<Triangle>::from_bytes(&structure.read::<u8>(tree.to_bytes().len())).expect("a structure");
    for (slot, (got, expected)) in got.nodes.iter().zip(&expected.nodes).enumerate() {
        assert_eq!(got, expected, "node {slot}");
    }
    assert_eq!(on_device.read::<LinkCount>(counts.len()), expected_counts);

    let work = |tree: &Bvh2| -> u32 {
        let of_ray = |ray: &Ray| tracer::trace_left_first(tree, ray).1;
        measured.iter().map(of_ray).map(|work| 3 * work.steps + 2 * work.tests).sum()
    };
    let unlearned = work(&tree.clone().in_child_order(ChildOrder::MoreHitsForItsCost, &Collapse::SAH));
    let learned = work(&expected);
    assert!(learned < unlearned, "{learned} learned, {unlearned} by geometry");
}
