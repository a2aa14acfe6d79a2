//! The order of children: the device's is the twin's, byte for byte; hits stay; and the better child comes first.

use crate::common::shapes::{Corners, hard_rays, icosphere, soup, tree_of, tree_with};
use crate::common::twins::{assert_same, on_device, on_host};
use crate::common::{corpus, device, with_tuning};
use hedgerow::bvh::builder::{BuildOptions, Method, Schedule, Treelets, Window};
use hedgerow::bvh::child_order::{ChildOrder, ChildOrderPass};
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::far;
use hedgerow::bvh::layout::{BoxRecord, Bvh2, Child, Record};
use hedgerow::bvh::reinsertion::ReinsertionOptions;
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::split::SplitOptions;
use hedgerow::bvh::twin::lbvh::{self, Finish};
use hedgerow::geometry::Aabb;
use hedgerow::gpu::TuningChoice;
use hedgerow::trace::tracer::{self, Loads, TraceShape};
use hedgerow::trace::twin::tracer as host;
use hedgerow::trace::{Hit, Query, Ray, Work};

const GUARD: [u8; 256] = [0xA5; 256];

/// What the device makes of a tree, planned for trees of up to `count` primitives; nothing else is written.
fn ordered<R: Record>(tree: &Bvh2<R>, order: ChildOrder, count: u32) -> Bvh2<R> {
    let device = device();
    let pass = ChildOrderPass::new(device, order, Collapse::SAH, count);
    let bytes = tree.to_bytes();
    let structure = device.upload("structure", &[&bytes[..], &GUARD].concat()).expect("memory");
    let scratch = vec![0xEEu8; pass.scratch_bytes() as usize];
    let scratch = device.upload("scratch", &[&scratch[..], &GUARD].concat()).expect("memory");
    device.run(None, |r| pass.record(r, structure.region(), scratch.region())).expect("the device works");
    assert_eq!(structure.read_at::<u8>(bytes.len() as u64, GUARD.len()), GUARD, "wrote behind the structure");
    assert_eq!(scratch.read_at::<u8>(pass.scratch_bytes(), GUARD.len()), GUARD, "wrote behind the scratch memory");
    Bvh2::from_bytes(&structure.read::<u8>(bytes.len())).expect("a structure")
}

#[track_caller]
fn assert_as_on_the_host<R: Record>(name: &str, tree: &Bvh2<R>) {
    for order in ChildOrder::ALL {
        let expected = tree.clone().in_child_order(order, &Collapse::SAH);
        expected.validate().unwrap_or_else(|error| panic!("{name}, {order:?}: {error}"));
        let got = ordered(tree, order, tree.header.primitive_count);
        for (slot, (got, expected)) in got.nodes.iter().zip(&expected.nodes).enumerate() {
            assert_eq!(got, expected, "{name}, {order:?}: node {slot}");
        }
        assert!(got.to_bytes() == expected.to_bytes(), "{name}, {order:?}");
        let again = expected.clone().in_child_order(order, &Collapse::SAH);
        assert!(again.to_bytes() == expected.to_bytes(), "{name}, {order:?}: twice is not once");
    }
}

#[test]
fn children_of_bad_scenes_have_the_order_of_the_host() {
    for (name, positions, triangles) in corpus::meshes() {
        for collapse in [Collapse::OFF, Collapse::SAH] {
            let tree = lbvh::build(&positions, &triangles, Code::Emc64Var.full(), collapse);
            assert_as_on_the_host(&name, &tree);
        }
    }
}

#[test]
fn compacted_trees_and_trees_of_boxes_have_the_order_of_the_host() {
    let corners = soup(2000, 0.2, 3);
    assert_as_on_the_host("compacted", &tree_of(&corners).compacted());
    let boxes: Vec<Aabb> = corners.iter().map(|corners| Aabb::around(corners)).collect();
    let tree: Bvh2<BoxRecord> = lbvh::build_aabbs(&boxes, Code::Emc64Var.full(), Collapse::SAH);
    assert_as_on_the_host("boxes", &tree);
}

#[test]
fn what_was_not_planned_for_stays_as_it_is() {
    let tree = tree_of(&soup(500, 0.2, 3));
    let bytes = tree.to_bytes();
    assert!(ordered(&tree, ChildOrder::LargerBox, 499).to_bytes() == bytes, "a larger tree");
    let mut unusable = tree;
    unusable.header.status = hedgerow::bvh::layout::status::TOO_DEEP;
    let bytes = unusable.to_bytes();
    assert!(ordered(&unusable, ChildOrder::LargerBox, 500).to_bytes() == bytes, "a tree that cannot be traced");
}

#[test]
fn memory_that_is_too_small_is_refused_by_name() {
    let device = device();
    let pass = ChildOrderPass::new(device, ChildOrder::Cheaper, Collapse::SAH, 100);
    assert_eq!(pass.scratch_bytes(), 16 * 99);
    let memory = device.buffer("memory", 4096).expect("memory");
    let small = hedgerow::gpu::Region { bytes: pass.scratch_bytes() - 1, ..memory.region() };
    let error = pass.steps(memory.region(), small).expect_err("too small").to_string();
    assert!(error.contains("scratch memory of an order of children"), "{error}");
}

/// By every schedule of an LBVH, which orders children on the way, also where invocations meet in workgroups; and behind other methods.
#[test]
fn builds_have_the_order_of_the_host() {
    let splits = Some(SplitOptions::DEFAULT);
    let optimise = Some(ReinsertionOptions { rounds: 2, stride: 2 });
    let meshes = corpus::meshes().into_iter().chain([corpus::random("random 9000", 9000, [-0.5; 3], [1.0; 3])]);
    for (i, mesh) in meshes.enumerate() {
        for order in ChildOrder::ALL {
            let codes = Some(Code::Emc64Var.full());
            let lbvh = BuildOptions { codes, child_order: Some(order), ..BuildOptions::DEFAULT };
            let more = [
                BuildOptions { split: splits, ..lbvh },
                BuildOptions { optimise, ..lbvh },
                BuildOptions { method: Method::Ploc { radius: 8 }, ..lbvh },
                BuildOptions { method: Method::Hploc(Window::DEFAULT), ..lbvh },
                BuildOptions { method: Method::Hlbvh(Treelets::DEFAULT), collapse: Collapse::OFF, ..lbvh },
            ];
            let by = |schedule| BuildOptions { schedule: Some(schedule), ..lbvh };
            let mut all =
                vec![by(Schedule::Chain), by(Schedule::Workgroup), BuildOptions { collapse: Collapse::OFF, ..lbvh }];
            if order == ChildOrder::MoreHitsForItsCost {
                all.extend(more);
            }
            for options in all {
                let expected = on_host(&mesh, &options);
                let is_in_order = u32::from(!expected.header.root.is_leaf() && expected.header.active > 0);
                assert_eq!(expected.header.child_order, is_in_order, "{}, {options:?}", mesh.0);
                assert_same(&on_device(&mesh, &options), &expected, &format!("{}, {options:?}", mesh.0));
                if i % 3 == 0 && options.method == Method::Lbvh {
                    let got = with_tuning(TuningChoice::Gpu, || on_device(&mesh, &options));
                    assert_same(&got, &expected, &format!("{} as on a GPU, {options:?}", mesh.0));
                }
            }
        }
    }
}

/// What is near would be another child of the root then.
#[test]
fn an_order_leaves_what_is_far_untold() {
    let mut tree = tree_of(&soup(300, 0.1, 4));
    (tree.header.near_node, tree.header.far_sides) = (1, 1);
    tree.far = vec![tree.header.root.bounds(); far::SIDES];
    let got = ordered(&tree, ChildOrder::LargerBox, tree.header.primitive_count);
    assert_eq!((got.header.near_node, got.header.far_sides, got.far.len()), (0, 0, 0));
    assert_as_on_the_host("with something far", &tree);
}

/// An order on the way is the order behind, but for the order in which areas are added up: the same work.
#[test]
fn an_order_on_the_way_is_worth_the_one_behind() {
    let corners: Corners = soup(2000, 0.02, 8).into_iter().chain(soup(60, 1.0, 9)).collect();
    let (order, collapse) = (ChildOrder::MoreHitsForItsCost, Collapse::SAH);
    let built = |finish: Finish| lbvh::build_corners(corners.iter().copied().map(Ok), Code::Emc64Var.full(), finish);
    let behind = built(collapse.into()).in_child_order(order, &collapse);
    let on_the_way = built(Finish { collapse, child_order: Some(order) });
    let different = behind.nodes.iter().zip(&on_the_way.nodes).filter(|(a, b)| a.is_used() && a != b).count();
    assert_eq!(on_the_way.header, behind.header);
    assert!(different <= 2, "{different} of {} nodes", behind.header.inner_nodes);
}

fn shapes() -> Vec<TraceShape> {
    let limits = &device().limits;
    let few =
        TraceShape { workgroup: 4 * limits.subgroup_size, shared_levels: 3, rays_each: 5, loads: Loads::Gathered };
    let mut shapes = vec![TraceShape::of(device()), TraceShape::subgroups(limits), TraceShape::groups(limits), few];
    if limits.int64 {
        shapes.push(TraceShape { loads: Loads::InLongs, ..few });
    }
    if limits.subgroup_is_exact && limits.subgroup_size <= Loads::MAX_LANES {
        shapes.push(TraceShape::lanes(limits));
    }
    shapes
}

/// Rays that end at any hit find one where they did before, and the device goes the way of the host.
#[track_caller]
fn assert_hits_stay(corners: &Corners, rays: &[Ray]) {
    let tree = tree_of(corners);
    for order in ChildOrder::ALL {
        let ordered = tree.clone().in_child_order(order, &Collapse::SAH);
        let expected: Vec<(Hit, Work)> = rays.iter().map(|ray| host::trace_left_first(&ordered, ray)).collect();
        for (ray, (hit, _)) in rays.iter().zip(&expected) {
            assert_eq!(hit.t, host::any_hit_by_brute_force(&tree, ray).t, "{order:?} {ray:?}");
            let closest = host::trace(&ordered, ray, Query::ClosestHit).0;
            assert_eq!(closest, host::closest_hit_by_brute_force(&tree, ray), "{order:?} {ray:?}");
        }
        for shape in shapes() {
            let (hits, work) = crate::common::traced(device(), &ordered.to_bytes(), rays, true, |r, buffers| {
                tracer::record_left_first(r, &shape, buffers)
            })
            .expect("the device traces");
            for (i, ray) in rays.iter().enumerate() {
                assert_eq!((hits[i], work[i]), expected[i], "{shape:?} {order:?} {ray:?}");
            }
        }
    }
}

#[test]
fn left_first_finds_what_brute_force_does_and_the_device_goes_the_same_way() {
    let corners = soup(300, 0.3, 5);
    assert_hits_stay(&corners, &hard_rays(&corners, 1000, 1.0, [0.0; 3], 11));
    // Leaves of which the count takes the place of the distance.
    let triangle = |place: f32| [[place, 0.0, 0.0], [place, 1.0, 0.0], [place, 0.0, 1.0]];
    let piles = [(0.0, 30), (1.0, 31), (2.0, 32), (3.0, 1000), (4.0, 1)];
    let corners: Corners = piles.iter().flat_map(|&(at, count)| std::iter::repeat_n(triangle(at), count)).collect();
    assert_hits_stay(&corners, &hard_rays(&corners, 300, 1.0, [0.0; 3], 4));
}

/// The children of the root of a tree over two leaves, once it is in order: where each lies along x.
fn places(tree: &Bvh2, order: ChildOrder) -> [f32; 2] {
    let tree = tree.clone().in_child_order(order, &Collapse::SAH);
    tree.nodes[tree.header.root.index as usize].children.map(|child: Child| child.lo[0])
}

#[test]
fn each_rule_puts_first_what_it_is_named_for() {
    // At x = 0 a wall of two triangles that fills its box. At x = 10 a larger box with nothing but one sliver along its diagonal.
    let wall: Corners =
        vec![[[0.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 4.0]], [[0.0, 4.0, 4.0], [0.0, 4.0, 0.0], [0.0, 0.0, 4.0]]];
    let sliver: Corners = vec![[[10.0, 0.0, 0.0], [20.0, 9.0, 9.0], [20.0, 9.1, 9.0]]];
    let both: Corners = wall.into_iter().chain(sliver).collect();
    let tree = tree_of(&both);
    let root = tree.nodes[tree.header.root.index as usize];
    assert!(root.children.iter().all(Child::is_leaf), "the wall is a leaf");
    assert_eq!(places(&tree, ChildOrder::LargerBox)[0], 10.0);
    assert_eq!(places(&tree, ChildOrder::LargerPrimitives)[0], 0.0);
    assert_eq!(places(&tree, ChildOrder::MoreHitsForItsCost)[0], 0.0);
    // One test is less than two, by less than what the larger box costs more to be met: c_T (p_r − p_l) counts too.
    let [wall_area, sliver_area] = [16.0, 10.0 * 9.1 + 10.0 * 9.0 + 9.1 * 9.0];
    let area = 20.0 * 9.1 + 20.0 * 9.0 + 9.1 * 9.0;
    let shares: [f32; 2] = [wall_area, sliver_area].map(|of_child: f32| of_child / area);
    let both = (shares[0] + shares[1] - 1.0f32).max(0.0);
    let is_sliver_first = both * (2.0 * 2.0 - 2.0) + 3.0 * (shares[1] - shares[0]) > 0.0;
    assert_eq!(places(&tree, ChildOrder::Cheaper)[0], if is_sliver_first { 10.0 } else { 0.0 });
}

/// Steps and tests of rays that end at any hit, by their costs.
fn work(tree: &Bvh2, rays: &[Ray]) -> f64 {
    let of_ray = |ray| {
        let (_, work) = host::trace_left_first(tree, ray);
        3.0 * f64::from(work.steps) + 2.0 * f64::from(work.tests)
    };
    rays.iter().map(of_ray).sum()
}

#[test]
fn the_first_child_is_the_better_one() {
    // Rays between random points of a sphere: those for which the rule is derived.
    let around = icosphere(2);
    let ends: Vec<[f32; 3]> = around.iter().map(|corners| corners[0].map(|x| 2.0 * x)).collect();
    let rays: Vec<Ray> = (0..3000)
        .map(|i| {
            let [from, to] = [ends[i % ends.len()], ends[(i * 7 + 3) % ends.len()]];
            let direction = std::array::from_fn(|k| to[k] - from[k] + 1e-3 * (i % 13) as f32);
            Ray { origin: from, t_min: 0.0, direction, t_max: 1.0 }
        })
        .collect();
    // Large triangles among many small ones.
    let corners: Corners = soup(2000, 0.02, 8).into_iter().chain(soup(60, 1.0, 9)).collect();
    let tree = tree_with(&corners, Collapse::SAH);
    let best = tree.clone().in_child_order(ChildOrder::MoreHitsForItsCost, &Collapse::SAH);
    let mut worst = best.clone();
    worst.nodes.iter_mut().filter(|node| node.is_used()).for_each(|node| node.children.swap(0, 1));
    let [best, plain, worst] = [&best, &tree, &worst].map(|tree| work(tree, &rays));
    assert!(best < 0.97 * plain && plain < 0.97 * worst, "{best} in order, {plain} as built, {worst} the other way");
}
