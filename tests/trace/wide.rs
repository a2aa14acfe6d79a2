//! The tracers of wide trees: their hits are those of brute force, and those and their work on the device are the host's, bit
//! for bit.

use crate::common::device;
use crate::common::shapes::{
    Corners, hard_rays, icosphere, no_rays, placed, ray, rays_from_the_middle, soup, tree_of, tree_with,
};
use hedgerow::bvh::child_order::ChildOrder;
use hedgerow::bvh::layout::{Bvh2, Child, status};
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::wide::Form;
use hedgerow::bvh::wide::layout::Wide;
use hedgerow::bvh::wide::quantised::QuantisedNode;
use hedgerow::gpu::{Recorder, Region};
use hedgerow::trace::tracer::{self, Loads, TraceBuffers, TraceShape};
use hedgerow::trace::twin::tracer as host;
use hedgerow::trace::twin::wide::{self as wide_host, TracedNode};
use hedgerow::trace::wide::{Order, WideTracer};
use hedgerow::trace::{Hit, Query, Ray, Work, bottom_level};

/// An order with every way to cut the work: that for CPUs, that for GPUs, no shared memory at all, and a stack half here and half there.
fn tracers_in_order(form: Form, order: Order) -> Vec<WideTracer> {
    let limits = &device().limits;
    let loads = Loads::Gathered;
    let mut shapes = vec![
        TraceShape::subgroups(limits),
        TraceShape::groups(limits),
        TraceShape { workgroup: limits.subgroup_size, shared_levels: 0, rays_each: 1, loads },
        TraceShape { workgroup: 4 * limits.subgroup_size, shared_levels: 3, rays_each: 5, loads },
    ];
    if limits.int64 {
        shapes.push(TraceShape { loads: Loads::InLongs, ..TraceShape::subgroups(limits) });
    }
    shapes.into_iter().map(|shape| WideTracer::with(limits, form, order, shape)).collect()
}

/// The default, and every order for either query.
fn tracers(form: Form) -> Vec<WideTracer> {
    let limits = &device().limits;
    let mut tracers = vec![WideTracer::of(device(), form)];
    let orders = if form.is_quantised() { &[Order::Distance, Order::Octant][..] } else { &[Order::Distance] };
    orders.iter().for_each(|&order| tracers.extend(tracers_in_order(form, order)));
    if form.is_quantised() && limits.subgroup_is_exact && limits.subgroup_size <= Loads::MAX_LANES {
        let few = TraceShape { shared_levels: 3, rays_each: 5, ..TraceShape::lanes(limits) };
        tracers
            .extend([TraceShape::lanes(limits), few].map(|shape| WideTracer::with(limits, form, Order::Octant, shape)));
    }
    tracers
}

fn traced<N: TracedNode>(
    tree: &Wide<N>,
    rays: &[Ray],
    tracer: &WideTracer,
    query: Query,
    count: bool,
) -> (Vec<Hit>, Vec<Work>) {
    crate::common::traced(device(), &tree.to_bytes(), rays, count, |r, buffers| tracer.record(r, query, buffers))
        .expect("the device traces")
}

/// On the host as by brute force; on the device as on the host.
#[track_caller]
fn assert_form<N: TracedNode>(tree: &Bvh2, rays: &[Ray]) {
    let wide = Wide::<N>::of(tree);
    wide.validate().expect("a valid tree");
    let usable = tree.header.status & status::UNUSABLE == 0;
    for query in [Query::ClosestHit, Query::AnyHit] {
        let on_host = |order: Order| -> Vec<(Hit, Work)> {
            rays.iter().map(|ray| wide_host::trace(&wide, ray, query, order)).collect()
        };
        let expected = [Order::Distance, Order::Octant].map(on_host);
        for (ray, (hit, _)) in expected.iter().flat_map(|expected| rays.iter().zip(expected)).filter(|_| usable) {
            match query {
                Query::ClosestHit => {
                    assert_eq!(*hit, host::closest_hit_by_brute_force(tree, ray), "{} {ray:?}", N::FORM)
                }
                Query::AnyHit => assert_eq!(hit.t, host::any_hit_by_brute_force(tree, ray).t, "{} {ray:?}", N::FORM),
            }
        }
        for tracer in tracers(N::FORM) {
            let expected = &expected[tracer.order as usize];
            let (hits, work) = traced(&wide, rays, &tracer, query, true);
            let (alone, _) = traced(&wide, rays, &tracer, query, false);
            for (i, ray) in rays.iter().enumerate() {
                assert_eq!((hits[i], work[i]), expected[i], "{tracer:?} {query:?} {ray:?}");
                assert_eq!(alone[i].t, expected[i].0.t, "{tracer:?} {query:?} {ray:?}");
            }
        }
    }
}

/// Rays that end at any hit, left children first in a tree in order: they name the triangles that they name in the binary tree, and on
/// the device as on the host. The closest hits are what they were.
#[track_caller]
fn assert_left_first<N: TracedNode>(tree: &Bvh2, rays: &[Ray]) {
    let ordered = tree.clone().in_child_order(ChildOrder::MoreHitsForItsCost, &Collapse::SAH);
    let wide = Wide::<N>::of(&ordered);
    wide.validate().expect("a valid tree");
    let expected: Vec<(Hit, Work)> =
        rays.iter().map(|ray| wide_host::trace(&wide, ray, Query::AnyHit, Order::LeftFirst)).collect();
    for (ray, (hit, _)) in rays.iter().zip(&expected) {
        assert_eq!(*hit, host::trace_left_first(&ordered, ray).0, "{} {ray:?}", N::FORM);
        for order in [Order::Distance, Order::Octant] {
            let any = wide_host::trace(&wide, ray, Query::AnyHit, order).0;
            assert_eq!(any.t, hit.t, "{} {order:?} {ray:?}", N::FORM);
            let closest = wide_host::trace(&wide, ray, Query::ClosestHit, order).0;
            assert_eq!(closest, host::closest_hit(tree, ray), "{} {order:?} {ray:?}", N::FORM);
        }
    }
    for tracer in tracers_in_order(N::FORM, Order::LeftFirst) {
        let (hits, work) = traced(&wide, rays, &tracer, Query::AnyHit, true);
        let (alone, _) = traced(&wide, rays, &tracer, Query::AnyHit, false);
        for (i, ray) in rays.iter().enumerate() {
            assert_eq!((hits[i], work[i]), expected[i], "{tracer:?} {ray:?}");
            assert_eq!(alone[i], expected[i].0, "{tracer:?} {ray:?}");
        }
    }
}

#[track_caller]
fn assert_all_forms(tree: &Bvh2, rays: &[Ray]) {
    assert_form::<[Child; 4]>(tree, rays);
    assert_form::<[Child; 8]>(tree, rays);
    assert_form::<QuantisedNode>(tree, rays);
    assert_left_first::<[Child; 4]>(tree, rays);
    assert_left_first::<[Child; 8]>(tree, rays);
    assert_left_first::<QuantisedNode>(tree, rays);
}

#[test]
fn hits_are_those_of_brute_force_at_any_scale() {
    for (size, scale, far) in
        [(0.3, 1.0, 0.0), (1.0, 1.0, 3.0), (1e-3, 1.0, 1e4), (0.2, 1e-10, 0.0), (0.2, 1e-25, 0.0), (0.2, 1e25, 1.0)]
    {
        let offset = [far * scale, -far * scale, 0.5 * far * scale];
        let corners = placed(&soup(300, size, 5), scale, offset);
        let rays = hard_rays(&corners, 1_000, scale, offset, 11);
        for collapse in [Collapse::SAH, Collapse::OFF] {
            assert_all_forms(&tree_with(&corners, collapse), &rays);
        }
    }
}

/// One call for trees of either form: the hits and the work of the tracer of each.
#[test]
fn a_bottom_level_is_traced_whichever_its_nodes_are() {
    let corners = soup(300, 0.3, 5);
    let tree = tree_of(&corners);
    let wide = Wide::<QuantisedNode>::of(&tree);
    let rays = hard_rays(&corners, 777, 1.0, [0.0; 3], 3);
    for query in [Query::ClosestHit, Query::AnyHit] {
        let by_both = |bytes: &[u8], count| {
            crate::common::traced(device(), bytes, &rays, count, |r, buffers| bottom_level::record(r, query, buffers))
                .expect("the device traces")
        };
        let of_two: (Vec<Hit>, Vec<Work>) = rays.iter().map(|ray| host::trace(&tree, ray, query)).unzip();
        let of_eight = rays.iter().map(|ray| wide_host::trace(&wide, ray, query, Order::Octant)).unzip();
        assert!(by_both(&tree.to_bytes(), true) == of_two, "{query:?}");
        assert!(by_both(&wide.to_bytes(), true) == of_eight, "{query:?}");
        assert!(of_two.0.iter().any(Hit::is_some) && of_two.1 != of_eight.1, "the forms are told apart by their work");
        assert!(by_both(&wide.to_bytes(), false).0 == of_eight.0, "{query:?}, uncounted");
        // Neither form: empty.
        let mut other = tree.to_bytes();
        other[4..8].fill(0xff);
        assert!(by_both(&other, false).0.iter().all(|hit| !hit.is_some()), "{query:?}");
    }
}

#[test]
fn any_number_of_rays_is_traced_and_nothing_behind_them_written() {
    let corners = icosphere(2);
    let tree = tree_of(&corners);
    for count in [0, 1, 2, 7, 8, 9, 63, 64, 65, 1000] {
        assert_all_forms(&tree, &hard_rays(&corners, count, 1.0, [0.0; 3], count as u64));
    }
}

/// A short leaf has its count beside its index or in a byte; a long one has a place of its own.
#[test]
fn leaves_of_any_length_can_wait() {
    let mut corners = Vec::new();
    let lengths = [29, 30, 31, 32, 33, 254, 255, 256, 257, 1000, 1];
    for (place, count) in lengths.into_iter().enumerate() {
        let place = place as f32;
        let triangle = [[place, 0.0, 0.0], [place, 1.0, 0.0], [place, 0.0, 1.0]];
        corners.extend(std::iter::repeat_n(triangle, count));
    }
    let tree = tree_of(&corners);
    let rays: Vec<Ray> = (0..64)
        .flat_map(|i| {
            let from = 0.25 + 10.5 * i as f32 / 64.0;
            [1.0, -1.0].map(|to| ray([from, 0.25, 0.25], [to, 0.01, 0.01]))
        })
        .collect();
    assert_all_forms(&tree, &rays);
}

#[test]
fn closed_surfaces_do_not_leak() {
    for (scale, offset) in
        [(1.0, [0.0; 3]), (1e-20, [0.0; 3]), (1e20, [0.0; 3]), (1.0, [1e3, -1e4, 1e2]), (1.0, [1e6; 3])]
    {
        let corners = placed(&icosphere(4), scale, offset);
        let rays = rays_from_the_middle(&corners, 20_000, scale, offset);
        let tree = tree_of(&corners);
        assert_tight::<[Child; 4]>(&tree, &rays);
        assert_tight::<[Child; 8]>(&tree, &rays);
        assert_tight::<QuantisedNode>(&tree, &rays);
    }

    fn assert_tight<N: TracedNode>(tree: &Bvh2, rays: &[Ray]) {
        let wide = Wide::<N>::of(tree);
        for tracer in tracers(N::FORM).iter().take(3) {
            let (hits, _) = traced(&wide, rays, tracer, Query::ClosestHit, false);
            for (ray, hit) in rays.iter().zip(&hits) {
                assert!(hit.is_some(), "{tracer:?} leaks: {ray:?}");
                assert_eq!(*hit, host::closest_hit(tree, ray), "{tracer:?} {ray:?}");
            }
        }
    }
}

#[test]
fn what_is_no_ray_hits_nothing_and_ends() {
    let tree = tree_of(&icosphere(3));
    assert_all_forms(&tree, &no_rays());
}

#[test]
fn limits_are_exclusive() {
    let tree = tree_of(&vec![[[-1.0, -1.0, 2.0], [3.0, -1.0, 2.0], [-1.0, 3.0, 2.0]]]);
    let (below, above) = (2f32.next_down(), 2f32.next_up());
    let ends = [f32::NEG_INFINITY, 0.0, below, 2.0, above, 3.0, f32::INFINITY, f32::NAN];
    let rays: Vec<Ray> = ends
        .iter()
        .flat_map(|&t_min| ends.map(|t_max| Ray { t_min, t_max, ..ray([0.0; 3], [0.0, 0.0, 1.0]) }))
        .collect();
    assert_all_forms(&tree, &rays);
}

#[test]
fn trees_that_are_empty_or_cannot_be_used_have_no_hits() {
    let rays = hard_rays(&icosphere(0), 40, 1.0, [0.0; 3], 1);
    assert_all_forms(&tree_of(&Corners::new()), &rays);
    for bit in [status::TOO_DEEP, status::SPIN_RAN_OUT] {
        let mut tree = tree_of(&icosphere(1));
        tree.header.status |= bit;
        assert_all_forms(&tree, &rays);
        let wide = Wide::<QuantisedNode>::of(&tree);
        assert!(rays.iter().all(|ray| !wide_host::trace(&wide, ray, Query::ClosestHit, Order::Octant).0.is_some()));
    }
}

#[test]
fn of_a_thousand_coincident_triangles_the_first_is_hit() {
    let corners = vec![[[-1.0, -1.0, 3.0], [3.0, -1.0, 3.0], [-1.0, 3.0, 3.0]]; 1000];
    let rays = hard_rays(&corners, 100, 1.0, [0.0; 3], 4);
    for collapse in [Collapse::SAH, Collapse::OFF] {
        assert_all_forms(&tree_with(&corners, collapse), &rays);
    }
}

/// A structure of a kind that a kernel does not walk is empty to it: its bytes mean something else.
#[test]
fn structures_of_another_kind_are_met_by_no_ray() {
    let corners = soup(500, 0.2, 3);
    let tree = tree_of(&corners);
    let rays = hard_rays(&corners, 500, 1.0, [0.0; 3], 4);
    assert!(rays.iter().any(|ray| host::trace(&tree, ray, Query::ClosestHit).0.is_some()));
    let [of_two, of_four, as_bytes] =
        [tree.to_bytes(), Wide::<[Child; 4]>::of(&tree).to_bytes(), Wide::<QuantisedNode>::of(&tree).to_bytes()];
    let limits = &device().limits;
    let mut shapes = vec![TraceShape::of(device()), TraceShape::subgroups(limits)];
    if limits.subgroup_is_exact && limits.subgroup_size <= Loads::MAX_LANES {
        shapes.push(TraceShape::lanes(limits));
    }
    let met = |hits: Vec<Hit>| hits.iter().filter(|hit| hit.is_some()).count();
    for bytes in [&of_four, &as_bytes] {
        for shape in &shapes {
            let record =
                |r: &mut Recorder<'_>, buffers: &TraceBuffers| tracer::record(r, shape, Query::ClosestHit, buffers);
            let (hits, _) = crate::common::traced(device(), bytes, &rays, false, record).expect("it traces");
            assert_eq!(met(hits), 0, "{shape:?}");
        }
    }
    for (form, others) in [(Form::Four, [&of_two, &as_bytes]), (Form::EightQuantised, [&of_two, &of_four])] {
        for tracer in tracers(form) {
            for bytes in others {
                let record =
                    |r: &mut Recorder<'_>, buffers: &TraceBuffers| tracer.record(r, Query::ClosestHit, buffers);
                let (hits, _) = crate::common::traced(device(), bytes, &rays, false, record).expect("it traces");
                assert_eq!(met(hits), 0, "{tracer:?}");
            }
        }
    }
}

#[test]
fn what_there_is_no_kernel_for_is_refused() {
    const MEMORY: Region = Region::unbounded(16);
    let limits = &device().limits;
    let buffers = TraceBuffers { structure: 16, rays: MEMORY, hits: MEMORY, work: None, count: 0 };
    for (form, order, shape) in [
        (Form::Four, Order::Octant, TraceShape::subgroups(limits)),
        (Form::Eight, Order::Distance, TraceShape::lanes(limits)),
        (Form::EightQuantised, Order::Distance, TraceShape::lanes(limits)),
    ] {
        let tracer = WideTracer { form, order, shape };
        let refused = device().run(None, |recorder| tracer.record(recorder, Query::ClosestHit, &buffers));
        assert!(refused.expect_err("no kernel").to_string().contains("no kernel traces"), "{tracer:?}");
    }
    for form in Form::ALL {
        let lanes = WideTracer { form, order: Order::LeftFirst, shape: TraceShape::lanes(limits) };
        let refused = device().run(None, |recorder| lanes.record(recorder, Query::AnyHit, &buffers));
        assert!(refused.expect_err("no kernel").to_string().contains("no kernel traces"), "{lanes:?}");
        let tracer = WideTracer::in_order(device(), form, Order::LeftFirst);
        let refused = device().run(None, |recorder| tracer.record(recorder, Query::ClosestHit, &buffers));
        assert!(refused.expect_err("the closest hit").to_string().contains("end at any hit"), "{tracer:?}");
    }
}
