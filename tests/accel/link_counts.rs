//! What rays do below each node, counted by queries of a shader: the numbers of a walk on the host.

use crate::common::device;
use crate::common::shapes::{Corners, hard_rays, soup, tree_of};
use hedgerow::bvh::child_order::ChildOrder;
use hedgerow::bvh::counts::LinkCount;
use hedgerow::bvh::layout::{Bvh2, Child};
use hedgerow::bvh::sah::Collapse;
use hedgerow::gpu::Kernel;
use hedgerow::trace::ray::PreparedRay;
use hedgerow::trace::{Query, Ray, slab, triangle};
use hedgerow_lab::{arguments, shaders};

/// What a ray does at the links of a tree: each one entered, and the leaf's where it hits.
fn count(tree: &Bvh2, ray: &Ray, query: Query, counts: &mut [LinkCount]) {
    let Some(ray) = PreparedRay::new(ray) else { return };
    let any_hit = query == Query::AnyHit;
    let (mut best, mut nearest, mut hit_at) = (ray.t_max, u32::MAX, None);
    let mut waiting: Vec<(f32, Child, Option<usize>)> = vec![(f32::NEG_INFINITY, tree.header.root, None)];
    while let Some((enter, child, link)) = waiting.pop() {
        if enter > best {
            continue;
        }
        if let Some(link) = link {
            counts[link].entered += 1;
        }
        if !child.is_leaf() {
            let children = tree.nodes[child.index as usize].children;
            let entered = children.map(|child| slab::enter(&ray, &child.bounds(), best));
            let left_first = any_hit && tree.header.child_order == 1;
            let right_first = !left_first && matches!(entered, [Some(left), Some(right)] if right < left);
            // The last is taken first.
            for side in if right_first { [0, 1] } else { [1, 0] } {
                let link = 2 * child.index as usize + side;
                // A long leaf is taken however far it is.
                let is_long = children[side].count >= 31;
                let put_off = |enter| (if is_long { f32::NEG_INFINITY } else { enter }, children[side], Some(link));
                waiting.extend(entered[side].map(put_off));
            }
            continue;
        }
        for record in &tree.records[child.index as usize..][..child.count as usize] {
            let Some(met) = triangle::meet(&ray, record) else { continue };
            let is_within = ray.t_min < met.t && met.t < ray.t_max;
            if is_within && (met.t < best || met.t == best && record.primitive < nearest) {
                (best, nearest, hit_at) = (met.t, record.primitive, link);
                if any_hit {
                    waiting.clear();
                    break;
                }
            }
        }
    }
    if let Some(link) = hit_at {
        counts[link].hits += 1;
    }
}

fn on_device(tree: &Bvh2, rays: &[Ray], query: Query) -> Vec<LinkCount> {
    let device = device();
    let structure = device.upload("structure", &tree.to_bytes()).expect("memory");
    let given = device.upload("rays", rays).expect("memory");
    let hits = device.buffer("hits", 16 * rays.len() as u64).expect("memory");
    // What is there already is added to.
    let begin = LinkCount { entered: 1000, hits: 100, work: 7 };
    let counts = device.upload("counts", &vec![begin; 2 * tree.nodes.len()]).expect("memory");
    let kernel = Kernel::new(&shaders::MEASURE_QUERY_LINKS, 64, &[u32::from(query == Query::AnyHit), 0]);
    let arguments = arguments::TraceQueries {
        structure: structure.address(),
        rays: given.address(),
        hits: hits.address(),
        works: counts.address(),
        first: 0,
        count: rays.len() as u32,
    };
    device.run(None, |r| r.dispatch(&kernel, &arguments, arguments.count.div_ceil(64))).expect("it traces");
    let counts: Vec<LinkCount> = counts.read(2 * tree.nodes.len());
    assert!(counts.iter().all(|of_link| of_link.work == begin.work), "work is not counted");
    let behind = |of_link: LinkCount| LinkCount {
        entered: of_link.entered - begin.entered,
        hits: of_link.hits - begin.hits,
        work: 0,
    };
    counts.into_iter().map(behind).collect()
}

#[test]
fn queries_count_at_links_what_the_walk_on_the_host_does() {
    // A leaf of more triangles than an entry of the stack has room for their number is among them.
    let pile = std::iter::repeat_n([[0.1, 0.2, -0.3], [0.2, 0.1, -0.3], [0.2, 0.3, -0.2]], 40);
    let corners: Corners = soup(900, 0.2, 3).into_iter().chain(pile).collect();
    let rays = hard_rays(&corners, 3000, 1.0, [0.0; 3], 8);
    let plain = tree_of(&corners);
    let ordered = plain.clone().in_child_order(ChildOrder::MoreHitsForItsCost, &Collapse::SAH);
    for (name, tree) in [("as built", &plain), ("in order", &ordered)] {
        for query in [Query::AnyHit, Query::ClosestHit] {
            let mut expected = vec![LinkCount::default(); 2 * tree.nodes.len()];
            rays.iter().for_each(|ray| count(tree, ray, query, &mut expected));
            let got = on_device(tree, &rays, query);
            for (link, (got, expected)) in got.iter().zip(&expected).enumerate() {
                assert_eq!(got, expected, "{name}, {query:?}: link {link}");
            }
            let hits: u32 = got.iter().map(|of_link| of_link.hits).sum();
            let of_rays =
                rays.iter().filter(|ray| hedgerow::trace::twin::tracer::any_hit_by_brute_force(tree, ray).is_some());
            assert_eq!(hits as usize, of_rays.count(), "{name}, {query:?}: each hit is at one leaf");
        }
    }
}
