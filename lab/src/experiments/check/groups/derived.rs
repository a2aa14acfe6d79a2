//! Trees made of trees: wide ones, those that follow their triangles, and those whose children have an order.

use super::builders::meshes;
use crate::device::{Buffer, Device};
use crate::experiments::check::cases::{Cases, Found, same, same_all};
use crate::experiments::check::corpus::{Mesh, unit_floats};
use crate::subjects::build_memory::DeviceMesh;
use hedgerow::bvh::child_order::{ChildOrder, ChildOrderPass};
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::counts::LinkCount;
use hedgerow::bvh::geometry::Primitives;
use hedgerow::bvh::layout::{Bvh2, Child, Header, Triangle};
use hedgerow::bvh::refit::{Refit, RefitOptions, RefitSchedule};
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::wide::LinkCounts;
use hedgerow::bvh::twin::{self, lbvh};
use hedgerow::bvh::wide::device::{WideCounts, WideOptions, WidePass};
use hedgerow::bvh::wide::layout::{Wide, WideNode};
use hedgerow::bvh::wide::quantised::QuantisedNode;

/// Bytes behind memory that nothing may touch.
const GUARD: [u8; 256] = [0xA5; 256];

pub fn wide(cases: &mut Cases<'_>) {
    for mesh in meshes(cases) {
        for collapse in [Collapse::OFF, Collapse::SAH] {
            let (name, positions, triangles) = &mesh;
            let tree = lbvh::build(positions, triangles, Code::Emc64Var.full(), collapse);
            let ordered = tree.clone().in_child_order(ChildOrder::MoreHitsForItsCost, &Collapse::SAH);
            for (tree, which) in [(tree, ""), (ordered, ", in order")] {
                let what = format!("{name}, {collapse:?}{which}");
                of_all_widths(cases, &what, &tree, &LinkCounts::default());
            }
        }
    }
}

/// Trees of wide nodes of every form, by counts of the tree's links if there are some.
pub(super) fn of_all_widths(cases: &mut Cases<'_>, what: &str, tree: &Bvh2, counts: &LinkCounts<'_>) {
    cases.case(format!("{what}, 4"), |device| wide_as_on_host::<[Child; 4]>(device, tree, counts));
    cases.case(format!("{what}, 8"), |device| wide_as_on_host::<[Child; 8]>(device, tree, counts));
    cases.case(format!("{what}, 8q"), |device| wide_as_on_host::<QuantisedNode>(device, tree, counts));
}

fn wide_as_on_host<N: WideNode>(device: &Device, tree: &Bvh2, counts: &LinkCounts<'_>) -> Found {
    let expected = Wide::<N>::of_counts(tree, counts);
    expected.validate()?;
    let Header { primitive_count, geometry_count, .. } = tree.header;
    let options = WideOptions { form: N::FORM, primitives: Primitives::Triangles, geometry_count };
    let wide = WidePass::new(device, &options, primitive_count);
    let sizes = wide.sizes();
    let source = device.upload("source", &tree.to_bytes())?;
    let guarded = |bytes: u64| [vec![0xEEu8; bytes as usize], GUARD.to_vec()].concat();
    let target = device.upload("target", &guarded(sizes.structure))?;
    let scratch = device.upload("scratch", &guarded(sizes.scratch))?;
    let upload = |counts: &[LinkCount]| (!counts.is_empty()).then(|| device.upload("counts", counts)).transpose();
    let [opened_by, ordered_by] = [upload(counts.opened_by)?, upload(counts.ordered_by)?];
    let [opened_by, ordered_by] = [&opened_by, &ordered_by].map(|counts| counts.as_ref().map(Buffer::region));
    let counts = WideCounts { opened_by, ordered_by };
    device.run(None, |r| wide.record_by_counts(r, source.address(), &counts, target.region(), scratch.region()))?;
    same("bytes behind the tree", &target.read_at::<u8>(sizes.structure, GUARD.len()), &GUARD.to_vec())?;
    same("bytes behind the scratch memory", &scratch.read_at::<u8>(sizes.scratch, GUARD.len()), &GUARD.to_vec())?;
    let header: Header = target.read(1)[0];
    let used = N::FORM.bytes_in_use(&header, size_of::<Triangle>() as u64).min(sizes.structure);
    let bytes = target.read::<u8>(used as usize);
    let got = Wide::<N>::from_bytes(&bytes)?;
    same("header", &got.header, &expected.header)?;
    same_all("node", &got.nodes, &expected.nodes)?;
    same_all("byte", &bytes, &expected.to_bytes())
}

pub fn refit(cases: &mut Cases<'_>) {
    for mesh in meshes(cases) {
        let (name, positions, triangles) = &mesh;
        let mut next = unit_floats(3);
        let moved: Vec<[f32; 3]> = positions.iter().map(|_| [next(), 3.0 * next(), next() - 7.0]).collect();
        for collapse in [Collapse::SAH, Collapse::OFF] {
            let tree = lbvh::build(positions, triangles, Code::Emc64Var.full(), collapse);
            for schedule in [RefitSchedule::Chain, RefitSchedule::Workgroup] {
                cases.case(format!("{name}, {collapse:?}, {schedule:?}"), |device| {
                    let moved = (name.clone(), moved.clone(), triangles.clone());
                    refit_as_on_host(device, &tree, &moved, schedule)
                });
            }
        }
    }
}

fn refit_as_on_host(device: &Device, tree: &Bvh2, mesh: &Mesh, schedule: RefitSchedule) -> Found {
    let (_, positions, triangles) = mesh;
    let mut expected = tree.clone();
    twin::refit::refit_corners(&mut expected, lbvh::corners(positions, triangles), Collapse::SAH);
    expected.validate()?;
    let count = triangles.len() as u32;
    let mesh = DeviceMesh::new(device, positions, triangles)?;
    let options = RefitOptions { schedule: Some(schedule), ..RefitOptions::DEFAULT };
    let refit = Refit::new(device, &options, count)?;
    let bytes = tree.to_bytes();
    let structure = device.upload("structure", &[&bytes[..], &GUARD].concat())?;
    let scratch = device.upload("scratch", &vec![0xA5u8; refit.scratch_bytes() as usize])?;
    device.run(None, |recorder| refit.record(recorder, &mesh.input, structure.region(), scratch.region()))?;
    same("bytes behind the tree", &structure.read_at::<u8>(bytes.len() as u64, GUARD.len()), &GUARD.to_vec())?;
    let got = Bvh2::<Triangle>::from_bytes(&structure.read::<u8>(bytes.len()))?;
    // Points have a cost that is not a number, which equals nothing.
    let comparable =
        |header: &Header| Header { cost: if header.cost.is_nan() { -1.0 } else { header.cost }, ..*header };
    same("header", &comparable(&got.header), &comparable(&expected.header))?;
    same_all("record", &got.records, &expected.records)?;
    same_all("node", &got.nodes, &expected.nodes)
}

pub fn child_order(cases: &mut Cases<'_>) {
    for (name, positions, triangles) in meshes(cases) {
        let tree = lbvh::build(&positions, &triangles, Code::Emc64Var.full(), Collapse::SAH);
        for order in ChildOrder::ALL {
            cases.case(format!("{name}, {order:?}"), |device| child_order_as_on_host(device, &tree, order));
        }
    }
}

fn child_order_as_on_host(device: &Device, tree: &Bvh2, order: ChildOrder) -> Found {
    let expected = tree.clone().in_child_order(order, &Collapse::SAH);
    expected.validate()?;
    let pass = ChildOrderPass::new(device, order, Collapse::SAH, tree.header.primitive_count);
    let bytes = tree.to_bytes();
    let structure = device.upload("structure", &[&bytes[..], &GUARD].concat())?;
    let scratch = device.upload("scratch", &vec![0xA5u8; pass.scratch_bytes() as usize])?;
    device.run(None, |recorder| pass.record(recorder, structure.region(), scratch.region()))?;
    same("bytes behind the tree", &structure.read_at::<u8>(bytes.len() as u64, GUARD.len()), &GUARD.to_vec())?;
    let got = Bvh2::<Triangle>::from_bytes(&structure.read::<u8>(bytes.len()))?;
    same_all("node", &got.nodes, &expected.nodes)?;
    same_all("byte", &got.to_bytes(), &expected.to_bytes())
}
