//! End-point overlap on the device against that on the host, which cuts polygons in double precision.

use crate::common::shapes::{Corners, icosphere, placed, soup, tree_with};
use crate::common::{corpus, device};
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::epo::{OverlapBuffers, OverlapFigures, OverlapPass};
use hedgerow::bvh::layout::{Bvh2, status};
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin;
use hedgerow_lab::random::SplitMix64;

/// In pieces of so many records.
fn on_device(tree: &Bvh2, piece: u32) -> OverlapFigures {
    let device = device();
    let records = tree.header.primitive_count;
    let measure = OverlapPass::new(device, records);
    let structure = device.upload("structure", &tree.to_bytes()).expect("memory");
    let scratch = device.buffer("scratch", measure.scratch_bytes()).expect("memory");
    let result = device.buffer("result", size_of::<OverlapFigures>() as u64).expect("memory");
    let buffers = OverlapBuffers { structure: structure.address(), scratch: scratch.region(), result: result.region() };
    device
        .run(None, |recorder| {
            measure.begin(recorder, &buffers)?;
            recorder.barrier();
            for first in (0..records).step_by(piece as usize) {
                measure.overlaps(recorder, &buffers, first..records.min(first + piece))?;
            }
            recorder.barrier();
            measure.end(recorder, &buffers)
        })
        .expect("the device measures");
    result.read(1)[0]
}

/// Within what 24 bits give: the corners of a cut are off by some 2⁻²⁴ of the triangle's size, which is a thousandth of what is cut
/// off where that is a 10⁴th of it. Of a figure that is nothing but rounding (boxes that touch), a 10⁶th of a step is as good as 0.
#[track_caller]
fn assert_as_on_the_host(name: &str, tree: &Bvh2) {
    let expected = twin::epo::epo(tree, 3.0, 2.0);
    let figures = on_device(tree, u32::MAX);
    match (figures.epo(3.0, 2.0), expected) {
        (None, None) => {}
        (Some(got), Some(expected)) => {
            assert!((got - expected).abs() <= 1e-3 * expected + 1e-6, "{name}: {got}, the host has {expected}");
        }
        (got, expected) => panic!("{name}: {got:?}, the host has {expected:?}"),
    }
    assert_eq!(bytemuck::bytes_of(&on_device(tree, 100)), bytemuck::bytes_of(&figures), "{name}, in pieces");
}

#[test]
fn hard_meshes_have_the_overlap_of_the_host() {
    // Where no figure can agree: triangles whose corners lie on a line have the area that rounding leaves them, and the surface of
    // a scene 10^33 times as large as what is in it is 0 in 32 bits, of which the device says that there is no figure.
    let without = ["zero area", "a hundred far away"];
    for (name, positions, triangles) in corpus::meshes().into_iter().filter(|mesh| !without.contains(&&*mesh.0)) {
        for collapse in [Collapse::OFF, Collapse::SAH] {
            assert_as_on_the_host(&name, &twin::lbvh::build(&positions, &triangles, Code::Mc63.full(), collapse));
        }
    }
}

#[test]
fn scale_and_place_change_nothing() {
    for (scale, far) in [(1.0, 0.0), (1e-20, 0.0), (1e25, 0.0), (1.0, 10.0)] {
        let offset = [far * scale, -far * scale, 0.5 * far * scale];
        for (name, corners) in [("soup", soup(2000, 0.2, 7)), ("sphere", icosphere(4))] {
            let corners: Corners = placed(&corners, scale, offset);
            assert_as_on_the_host(&format!("{name} at {scale:e}, {far}"), &tree_with(&corners, Collapse::SAH));
        }
    }
}

/// The records of leaves in any order, and slots too: the figure is a property of the tree.
#[test]
fn the_order_of_records_and_slots_does_not_matter() {
    let tree = tree_with(&soup(500, 0.3, 3), Collapse::OFF);
    let mut random = SplitMix64::new(5);
    let mut shuffled = |count: usize| {
        let mut order: Vec<u32> = (0..count as u32).collect();
        (1..count).rev().for_each(|i| order.swap(i, random.bits() as usize % (i + 1)));
        order
    };
    let (records, slots) = (shuffled(tree.records.len()), shuffled(tree.nodes.len()));
    let mut other = tree.clone();
    for (from, &to) in records.iter().enumerate() {
        other.records[to as usize] = tree.records[from];
    }
    let renamed = |mut child: hedgerow::bvh::layout::Child| {
        let names = if child.is_leaf() { &records } else { &slots };
        child.index = names[child.index as usize];
        child
    };
    for (from, &to) in slots.iter().enumerate() {
        other.nodes[to as usize].children = tree.nodes[from].children.map(renamed);
    }
    other.header.root = renamed(tree.header.root);
    let expected = twin::epo::epo(&tree, 3.0, 2.0).expect("there is surface");
    let on_host = twin::epo::epo(&other, 3.0, 2.0).expect("there is surface");
    assert!((on_host - expected).abs() <= 1e-12 * expected, "{on_host}, {expected}");
    assert_as_on_the_host("shuffled", &other);
}

#[test]
fn trees_that_cannot_be_used_have_no_figure() {
    let mut tree = tree_with(&icosphere(2), Collapse::SAH);
    tree.header.status |= status::TOO_DEEP;
    assert_eq!(on_device(&tree, 64).epo(3.0, 2.0), None);
}
