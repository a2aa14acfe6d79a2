//! Counts of rays by links, and what they teach: the order of children and wide nodes.

use super::builders::meshes;
use super::derived::of_all_widths;
use crate::device::Device;
use crate::experiments::check::cases::{Cases, Found, same_all};
use crate::experiments::check::shapes::{hard_rays, soup};
use hedgerow::bvh::child_order::{ChildOrder, ChildOrderPass};
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::counts::LinkCount;
use hedgerow::bvh::layout::{Bvh2, Triangle};
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::lbvh;
use hedgerow::bvh::twin::wide::LinkCounts;
use hedgerow::trace::counts::{CountPass, CountedRays, CountedWalk, Earlier, Tallies};
use hedgerow::trace::twin::counts;
use hedgerow::trace::{Query, Ray};

const WALKS: [CountedWalk; 3] =
    [CountedWalk::AsTraced(Query::ClosestHit), CountedWalk::AsTraced(Query::AnyHit), CountedWalk::Exhaustive];

pub fn ray_counts(cases: &mut Cases<'_>) {
    let rays = hard_rays(&soup(300, 0.3, 5), 600, 1.0, [0.0; 3], 11);
    for (name, positions, triangles) in meshes(cases) {
        let tree = lbvh::build(&positions, &triangles, Code::Emc64Var.full(), Collapse::SAH);
        for walk in WALKS {
            cases.case(format!("{name}, {walk:?}"), |device| as_on_host(device, &tree, &rays, walk));
        }
        let counted = counted(&tree, &rays, CountedWalk::Exhaustive);
        cases.case(format!("{name}, order of children"), |device| order_as_on_host(device, &tree, &counted));
        let mut swapped = counted.clone();
        let ordered = tree.clone().in_order_of_counts(&mut swapped, &Collapse::SAH);
        let opened = LinkCounts { opened_by: &counted, ..LinkCounts::default() };
        of_all_widths(cases, &format!("{name}, opened by visits"), &tree, &opened);
        let in_order = LinkCounts { ordered_by: &swapped, ..LinkCounts::default() };
        of_all_widths(cases, &format!("{name}, in order of hits"), &ordered, &in_order);
    }
}

fn counted(tree: &Bvh2, rays: &[Ray], walk: CountedWalk) -> Vec<LinkCount> {
    let mut all = vec![LinkCount::default(); 2 * tree.nodes.len()];
    counts::count(tree, rays, walk, &Collapse::SAH, &mut all);
    all
}

fn as_on_host(device: &Device, tree: &Bvh2, rays: &[Ray], walk: CountedWalk) -> Found {
    let expected = counted(tree, rays, walk);
    let pass = CountPass::new(device, Collapse::SAH, tree.header.primitive_count);
    let structure = device.upload("structure", &tree.to_bytes())?;
    let uploaded = device.upload("rays", rays)?;
    let tallies = device.buffer("tallies", pass.tally_bytes())?;
    let of_links = device.buffer("counts", pass.counts_bytes())?;
    let scratch = device.buffer("scratch", pass.scratch_bytes())?;
    let tallies = Tallies { structure: structure.region(), tallies: tallies.region() };
    let rays = CountedRays { rays: uploaded.region(), ray_count: rays.len() as u32, first: 0, stride: 1 };
    device.run(None, |recorder| {
        pass.record_clear(recorder, &tallies)?;
        recorder.barrier();
        pass.record_rays(recorder, walk, &rays, &tallies)?;
        recorder.barrier();
        pass.record_gather(recorder, &tallies, of_links.region(), scratch.region(), Earlier::Dropped)
    })?;
    // A tree without links has counts that nobody writes.
    let links = if tree.header.root.is_leaf() || tree.header.active == 0 { 0 } else { expected.len() };
    same_all("count of link", &of_links.read::<LinkCount>(links), &expected[..links])
}

fn order_as_on_host(device: &Device, tree: &Bvh2, counted: &[LinkCount]) -> Found {
    let mut expected_counts = counted.to_vec();
    let expected = tree.clone().in_order_of_counts(&mut expected_counts, &Collapse::SAH);
    let count = tree.header.primitive_count;
    let pass = ChildOrderPass::new(device, ChildOrder::MoreHitsForItsCost, Collapse::SAH, count);
    let bytes = tree.to_bytes();
    let structure = device.upload("structure", &bytes)?;
    let of_links = device.upload("counts", counted)?;
    let scratch = device.buffer("scratch", pass.scratch_bytes())?;
    device.run(None, |r| pass.record_by_counts(r, structure.region(), of_links.region(), scratch.region()))?;
    let got = Bvh2::<Triangle>::from_bytes(&structure.read::<u8>(bytes.len()))?;
    same_all("node", &got.nodes, &expected.nodes)?;
    same_all("count of link", &of_links.read::<LinkCount>(counted.len()), &expected_counts)
}
