//! Tracers: hits and work of the device against the host's, bit for bit, and those against brute force.

use crate::device::Device;
use crate::experiments::check::cases::{Cases, Found, same_all};
use crate::experiments::check::corpus;
use crate::experiments::check::shapes::{Corners, hard_rays, icosphere, placed, rays_from_the_middle, soup, tree_with};
use crate::experiments::check::traced::traced;
use hedgerow::bvh::child_order::ChildOrder;
use hedgerow::bvh::layout::{Bvh2, Child};
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::wide::Form;
use hedgerow::bvh::wide::layout::Wide;
use hedgerow::bvh::wide::quantised::QuantisedNode;
use hedgerow::gpu::Recorder;
use hedgerow::trace::kd::{KdTracer, Traversal};
use hedgerow::trace::tracer::{self, Loads, TraceBuffers, TraceShape};
use hedgerow::trace::twin::kd as kd_host;
use hedgerow::trace::twin::tracer as host;
use hedgerow::trace::twin::wide::{self as wide_host, TracedNode};
use hedgerow::trace::wide::{Order, WideTracer};
use hedgerow::trace::{Hit, Query, Ray, Work};
use hedgerow_host::kdtree::{self as kd_builder, HostKdOptions as KdOptions};
use rayon::prelude::*;

const QUERIES: [Query; 2] = [Query::ClosestHit, Query::AnyHit];

/// Triangles, and rays that are hard for them.
struct Scene {
    name: String,
    corners: Corners,
    rays: Vec<Ray>,
}

fn scenes(cases: &Cases<'_>) -> Vec<Scene> {
    let mut scenes = Vec::new();
    let scales: &[(f32, f32, f32)] = match cases.quick {
        true => &[(0.3, 1.0, 3.0)],
        false => &[(0.3, 1.0, 0.0), (1.0, 1.0, 3.0), (1e-3, 1.0, 1e4), (0.2, 1e-10, 0.0), (0.2, 1e15, 1.0)],
    };
    for &(size, scale, far) in scales {
        let offset = [far * scale, -far * scale, 0.5 * far * scale];
        let corners = placed(&soup(300, size, 5), scale, offset);
        let rays = hard_rays(&corners, 1000, scale, offset, 11);
        scenes.push(Scene { name: format!("soup of scale {scale:e}"), corners, rays });
    }
    let sphere = icosphere(if cases.quick { 2 } else { 3 });
    let rays = rays_from_the_middle(&sphere, 4000, 1.0, [0.0; 3]);
    scenes.push(Scene { name: "a closed sphere".into(), corners: sphere.clone(), rays });
    let counts: &[usize] = if cases.quick { &[0, 1, 9] } else { &[0, 1, 2, 7, 8, 9, 63, 64, 65, 127, 129] };
    for &count in counts {
        let rays = hard_rays(&sphere, count, 1.0, [0.0; 3], count as u64);
        scenes.push(Scene { name: format!("{count} rays"), corners: sphere.clone(), rays });
    }
    let pile = vec![[[-1.0, -1.0, 3.0], [3.0, -1.0, 3.0], [-1.0, 3.0, 3.0]]; 1000];
    let rays = hard_rays(&pile, 100, 1.0, [0.0; 3], 4);
    scenes.push(Scene { name: "a thousand at one place".into(), corners: pile, rays });
    scenes
}

/// What `record` records finds the same hits with the same work.
fn as_on_host(
    device: &Device,
    structure: &[u8],
    rays: &[Ray],
    expected: &[(Hit, Work)],
    record: impl FnOnce(&mut Recorder<'_>, &TraceBuffers) -> hedgerow::Result<()>,
) -> Found {
    let (hits, work) = traced(device, structure, rays, true, record)?;
    let (expected_hits, expected_work): (Vec<Hit>, Vec<Work>) = expected.iter().copied().unzip();
    same_all("hit of ray", &hits, &expected_hits)?;
    same_all("work of ray", &work, &expected_work)
}

/// The closest hits of brute force; of any-hit whether there is one.
fn as_by_brute_force(tree: &Bvh2, rays: &[Ray], query: Query, hits: &[(Hit, Work)]) -> Found {
    let hits = hits.iter().map(|(hit, _)| hit);
    match query {
        Query::ClosestHit => {
            let expected: Vec<Hit> = rays.par_iter().map(|ray| host::closest_hit_by_brute_force(tree, ray)).collect();
            same_all("hit of ray", &hits.copied().collect::<Vec<_>>(), &expected)
        }
        Query::AnyHit => {
            let expected: Vec<f32> = rays.par_iter().map(|ray| host::any_hit_by_brute_force(tree, ray).t).collect();
            same_all("any hit of ray", &hits.map(|hit| hit.t).collect::<Vec<_>>(), &expected)
        }
    }
}

/// The default, and cut as for the other kind of device.
fn shapes(device: &Device, quick: bool) -> Vec<TraceShape> {
    let limits = &device.limits;
    let mut shapes = vec![TraceShape::of(device), TraceShape::subgroups(limits), TraceShape::groups(limits)];
    let lanes = limits.subgroup_size;
    if !quick {
        let few = TraceShape { workgroup: 4 * lanes, shared_levels: 3, rays_each: 5, loads: Loads::Gathered };
        shapes.push(TraceShape { workgroup: lanes, shared_levels: 0, rays_each: 1, loads: Loads::Gathered });
        shapes.extend((few.workgroup <= limits.workgroup_invocations).then_some(few));
    }
    let mut different: Vec<TraceShape> = Vec::new();
    for shape in shapes {
        if !different.contains(&shape) {
            different.push(shape);
        }
    }
    different
}

pub fn binary(cases: &mut Cases<'_>) {
    for Scene { name, corners, rays } in scenes(cases) {
        for collapse in [Collapse::SAH, Collapse::OFF] {
            let tree = tree_with(&corners, collapse);
            let bytes = tree.to_bytes();
            for query in QUERIES {
                let expected: Vec<(Hit, Work)> = rays.iter().map(|ray| host::trace(&tree, ray, query)).collect();
                let what = format!("{name}, {collapse:?}, {query:?}");
                cases.case(format!("{what}, the host's"), |_| as_by_brute_force(&tree, &rays, query, &expected));
                for shape in shapes(cases.device, cases.quick) {
                    cases.case(format!("{what}, {shape:?}"), |device| {
                        as_on_host(device, &bytes, &rays, &expected, |r, buffers| {
                            tracer::record(r, &shape, query, buffers)
                        })
                    });
                }
            }
            left_first(cases, &format!("{name}, {collapse:?}"), &tree, &rays);
        }
    }
}

/// Rays that end at any hit, through children in an order.
fn left_first(cases: &mut Cases<'_>, name: &str, tree: &Bvh2, rays: &[Ray]) {
    let tree = tree.clone().in_child_order(ChildOrder::MoreHitsForItsCost, &Collapse::SAH);
    let expected: Vec<(Hit, Work)> = rays.iter().map(|ray| host::trace_left_first(&tree, ray)).collect();
    let what = format!("{name}, left first");
    cases.case(format!("{what}, the host's"), |_| as_by_brute_force(&tree, rays, Query::AnyHit, &expected));
    for shape in shapes(cases.device, cases.quick) {
        cases.case(format!("{what}, {shape:?}"), |device| {
            as_on_host(device, &tree.to_bytes(), rays, &expected, |r, buffers| {
                tracer::record_left_first(r, &shape, buffers)
            })
        });
    }
}

/// The default, and others that its form has; for rays that end at any hit, where children have an order, those that take the left one
/// first.
fn wide_tracers(device: &Device, form: Form, quick: bool, is_ordered: bool) -> Vec<WideTracer> {
    let limits = &device.limits;
    let first =
        if is_ordered { WideTracer::in_order(device, form, Order::LeftFirst) } else { WideTracer::of(device, form) };
    let mut tracers = vec![first];
    let orders: &[Order] = match form.is_quantised() {
        _ if is_ordered => &[Order::LeftFirst],
        true => &[Order::Distance, Order::Octant],
        false => &[Order::Distance],
    };
    for &order in orders {
        let all = [TraceShape::groups(limits), TraceShape::subgroups(limits)];
        let all = all.into_iter().take(if quick { 1 } else { 2 });
        tracers.extend(all.map(|shape| WideTracer::with(limits, form, order, shape)));
    }
    tracers
}

pub fn wide(cases: &mut Cases<'_>) {
    for Scene { name, corners, rays } in scenes(cases) {
        let tree = tree_with(&corners, Collapse::SAH);
        wide_form::<[Child; 4]>(cases, &name, &tree, &rays);
        wide_form::<[Child; 8]>(cases, &name, &tree, &rays);
        wide_form::<QuantisedNode>(cases, &name, &tree, &rays);
    }
}

fn wide_form<N: TracedNode>(cases: &mut Cases<'_>, name: &str, tree: &Bvh2, rays: &[Ray]) {
    let ordered = tree.clone().in_child_order(ChildOrder::MoreHitsForItsCost, &Collapse::SAH);
    for (query, tree, is_ordered) in
        [(Query::ClosestHit, tree, false), (Query::AnyHit, tree, false), (Query::AnyHit, &ordered, true)]
    {
        let wide = Wide::<N>::of(tree);
        let bytes = wide.to_bytes();
        for tracer in wide_tracers(cases.device, N::FORM, cases.quick, is_ordered) {
            let trace = |ray: &Ray| wide_host::trace(&wide, ray, query, tracer.order);
            let expected: Vec<(Hit, Work)> = rays.iter().map(trace).collect();
            cases.case(format!("{name}, {query:?}, {tracer:?}"), |device| {
                as_by_brute_force(tree, rays, query, &expected)?;
                as_on_host(device, &bytes, rays, &expected, |r, buffers| tracer.record(r, query, buffers))
            });
        }
    }
}

pub fn kd(cases: &mut Cases<'_>) {
    let all = [
        Traversal::STACK,
        Traversal::RESTART,
        Traversal::PUSH_DOWN,
        Traversal::short_stack(1),
        Traversal::short_stack(8),
        Traversal::short_stack_with_push_down(2),
    ];
    for Scene { name, corners, rays } in scenes(cases) {
        let (_, positions, triangles) = corpus::soup("", corners.clone());
        let Ok(tree) = kd_builder::build(&positions, &triangles, &KdOptions::BINNED) else {
            cases.left_out(format!("{name}: there is no kd-tree of it"));
            continue;
        };
        let (bvh, bytes) = (tree_with(&corners, Collapse::SAH), tree.to_bytes());
        for &traversal in &all[..if cases.quick { 1 } else { all.len() }] {
            for query in QUERIES {
                let trace = |ray: &Ray| kd_host::trace(&tree, ray, query, traversal);
                let expected: Vec<(Hit, Work)> = rays.iter().map(trace).collect();
                cases.case(format!("{name}, {query:?}, {traversal:?}"), |device| {
                    as_by_brute_force(&bvh, &rays, query, &expected)?;
                    let tracer = KdTracer::new(device, traversal);
                    as_on_host(device, &bytes, &rays, &expected, |r, buffers| tracer.record(r, query, buffers))
                });
            }
        }
    }
}
