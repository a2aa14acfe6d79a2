//! Tracers of BVHs and of wide trees, cut in every way, against the host's; and wide trees as the device collapses them.

use crate::common::device;
use crate::common::shapes::{hard_rays, icosphere, placed, soup, tree_of};
use hedgerow::bvh::child_order::{ChildOrder, ChildOrderPass};
use hedgerow::bvh::geometry::Primitives;
use hedgerow::bvh::layout::{Bvh2, Child};
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::wide::device::{WideOptions, WidePass};
use hedgerow::bvh::wide::layout::Wide;
use hedgerow::bvh::wide::quantised::QuantisedNode;
use hedgerow::gpu::Recorder;
use hedgerow::trace::tracer::{self, Loads, TraceBuffers, TraceShape};
use hedgerow::trace::twin::tracer as host;
use hedgerow::trace::twin::wide::{self as wide_host, TracedNode};
use hedgerow::trace::wide::{Order, WideTracer};
use hedgerow::trace::{Hit, Query, Ray, Work};

/// Trees and the rays that are traced through them.
fn cases() -> Vec<(Bvh2, Vec<Ray>)> {
    let soups = [placed(&soup(300, 0.3, 5), 1.0, [3.0, -3.0, 1.5]), icosphere(3)];
    soups.iter().map(|corners| (tree_of(corners), hard_rays(corners, 400, 1.0, [0.0; 3], 11))).collect()
}

/// Cut for CPUs, for GPUs, and without shared memory; lane by lane where there is a kernel for it.
fn shapes(lanes: bool) -> Vec<TraceShape> {
    let limits = &device().limits;
    let private =
        TraceShape { workgroup: limits.subgroup_size, shared_levels: 0, rays_each: 5, loads: Loads::Gathered };
    let by_lanes = lanes && limits.subgroup_is_exact && limits.subgroup_size <= Loads::MAX_LANES;
    [TraceShape::subgroups(limits), TraceShape::groups(limits), private]
        .into_iter()
        .chain(by_lanes.then(|| TraceShape::lanes(limits)))
        .collect()
}

/// Hits and work of rays through a structure.
pub fn traced(
    structure: &[u8],
    rays: &[Ray],
    record: impl FnOnce(&mut Recorder<'_>, &TraceBuffers) -> hedgerow::Result<()>,
) -> Vec<(Hit, Work)> {
    let (hits, work) = crate::common::traced(device(), structure, rays, true, record).expect("the device traces");
    hits.into_iter().zip(work).collect()
}

pub fn hits_and_work_are_those_of_the_host() {
    for (tree, rays) in cases() {
        for query in [Query::ClosestHit, Query::AnyHit] {
            let expected: Vec<_> = rays.iter().map(|ray| host::trace(&tree, ray, query)).collect();
            for shape in shapes(true) {
                let got = traced(&tree.to_bytes(), &rays, |r, buffers| tracer::record(r, &shape, query, buffers));
                assert_eq!(got, expected, "{shape:?} {query:?}");
            }
        }
    }
}

pub fn children_in_order_are_those_of_the_host() {
    for (tree, rays) in cases() {
        for order in ChildOrder::ALL {
            let expected = tree.clone().in_child_order(order, &Collapse::SAH);
            let pass = ChildOrderPass::new(device(), order, Collapse::SAH, tree.header.primitive_count);
            let bytes = tree.to_bytes();
            let structure = device().upload("structure", &bytes).expect("memory");
            let scratch = device().buffer("scratch", pass.scratch_bytes()).expect("memory");
            device().run(None, |r| pass.record(r, structure.region(), scratch.region())).expect("the device works");
            assert!(structure.read::<u8>(bytes.len()) == expected.to_bytes(), "{order:?}: other bytes");
            if order == ChildOrder::MoreHitsForItsCost {
                assert_left_first(&expected, &rays);
            }
        }
    }
}

fn assert_left_first(tree: &Bvh2, rays: &[Ray]) {
    let expected: Vec<_> = rays.iter().map(|ray| host::trace_left_first(tree, ray)).collect();
    for shape in shapes(true) {
        let got = traced(&tree.to_bytes(), rays, |r, buffers| tracer::record_left_first(r, &shape, buffers));
        assert_eq!(got, expected, "{shape:?}");
    }
}

pub fn wide_trees_are_those_of_the_host() {
    for (tree, rays) in cases() {
        let ordered = tree.clone().in_child_order(ChildOrder::MoreHitsForItsCost, &Collapse::SAH);
        assert_form::<[Child; 4]>(&tree, &rays);
        assert_form::<[Child; 8]>(&tree, &rays);
        assert_form::<QuantisedNode>(&tree, &rays);
        assert_form::<[Child; 4]>(&ordered, &rays);
        assert_form::<[Child; 8]>(&ordered, &rays);
        assert_form::<QuantisedNode>(&ordered, &rays);
    }
}

/// Where children have an order, the left one is taken first.
fn assert_form<N: TracedNode>(tree: &Bvh2, rays: &[Ray]) {
    let wide = Wide::<N>::of(tree);
    assert!(collapsed::<N>(tree) == wide.to_bytes(), "{}: other bytes", N::FORM);
    let orders = match N::FORM.is_quantised() {
        _ if tree.header.child_order != 0 => &[Order::LeftFirst][..],
        true => &[Order::Distance, Order::Octant],
        false => &[Order::Distance],
    };
    for &order in orders {
        for (i, shape) in shapes(order == Order::Octant).into_iter().enumerate() {
            let tracer = WideTracer::with(&device().limits, N::FORM, order, shape);
            let queries = match order {
                Order::LeftFirst => &[Query::AnyHit][..],
                _ if i == 0 => &[Query::ClosestHit, Query::AnyHit],
                _ => &[Query::ClosestHit],
            };
            for &query in queries {
                let expected: Vec<_> = rays.iter().map(|ray| wide_host::trace(&wide, ray, query, order)).collect();
                let got = traced(&wide.to_bytes(), rays, |r, buffers| tracer.record(r, query, buffers));
                assert_eq!(got, expected, "{tracer:?} {query:?}");
            }
        }
    }
}

/// The bytes in use of the wide tree that the device makes.
fn collapsed<N: TracedNode>(tree: &Bvh2) -> Vec<u8> {
    let header = &tree.header;
    let options =
        WideOptions { form: N::FORM, primitives: Primitives::Triangles, geometry_count: header.geometry_count };
    let wide = WidePass::new(device(), &options, header.primitive_count);
    let sizes = wide.sizes();
    let source = device().upload("source", &tree.to_bytes()).expect("memory");
    let target = device().buffer("target", sizes.structure).expect("memory");
    let scratch = device().buffer("scratch", sizes.scratch).expect("memory");
    device()
        .run(None, |r| wide.record(r, source.address(), target.region(), scratch.region()))
        .expect("the device collapses");
    let record_bytes = size_of::<hedgerow::bvh::layout::Triangle>() as u64;
    target.read(N::FORM.bytes_in_use(&target.read(1)[0], record_bytes) as usize)
}
