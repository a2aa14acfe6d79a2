//! A tree from both sides: built on the device, and by the twins on the host with the same options; and room enough for any.

use super::cases::{Found, same_all};
use super::corpus::Mesh;
use crate::device::Device;
use crate::subjects::build_memory::{BuildMemory, DeviceMesh};
use anyhow::{bail, ensure};
use hedgerow::bvh::builder::{BuildOptions, Builder, Input};
use hedgerow::bvh::layout::Bvh2;
use hedgerow::bvh::twin;
use hedgerow::kdtree::builder::KdEstimate;
use hedgerow::kdtree::merge::MergeEstimate;

/// Room for kd-trees of scenes where most triangles straddle most planes.
pub const PLENTY: KdEstimate = KdEstimate {
    level_references: 20.0,
    level_nodes: 20.0,
    subtree_nodes: 20.0,
    cut_references: 20.0,
    subtree_references: 20.0,
    subtrees: 20.0,
    arena: 60.0,
};

/// Room for objects that lie in the densest part of a kd-tree.
pub const PLENTY_TO_MERGE: MergeEstimate = MergeEstimate {
    pairs: 60.0,
    items: 20.0,
    marked: 40.0,
    build: KdEstimate {
        level_references: 200.0,
        level_nodes: 60.0,
        subtree_nodes: 200.0,
        cut_references: 400.0,
        subtree_references: 400.0,
        subtrees: 60.0,
        arena: 0.0,
    },
};

/// The device's tree over `input`.
///
/// # Panics
/// The device failed, or left bytes that belong to no part of a tree.
pub fn built(device: &Device, options: &BuildOptions, input: &Input) -> Bvh2 {
    let builder = Builder::new(device, options, input.primitive_count).expect("few enough primitives");
    let sizes = builder.sizes();
    let BuildMemory { structure, scratch, .. } = BuildMemory::new(device, sizes).expect("memory");
    // Whatever was there before changes nothing.
    const BEFORE: u8 = 0x5A;
    structure.write(&vec![BEFORE; sizes.structure as usize]);
    scratch.write(&vec![0xA5u8; sizes.scratch as usize]);
    device.run(None, |r| builder.record(r, input, structure.region(), scratch.region())).expect("it builds");
    let bytes = structure.read::<u8>(sizes.structure as usize);
    let tree = Bvh2::from_bytes(&bytes).expect("a structure");
    let own = tree.to_bytes();
    assert!(own == bytes[..own.len()], "bytes that belong to no part");
    assert!(bytes[own.len()..].iter().all(|&byte| byte == BEFORE), "bytes behind the tree");
    tree
}

/// The device's tree of a mesh.
///
/// # Panics
/// As [`built`].
pub fn on_device(device: &Device, (_, positions, triangles): &Mesh, options: &BuildOptions) -> Bvh2 {
    let mesh = DeviceMesh::new(device, positions, triangles).expect("memory");
    built(device, options, &mesh.input)
}

/// What [`on_device`] must equal, byte for byte. The options name the codes.
///
/// # Panics
/// They do not.
pub fn on_host((_, positions, triangles): &Mesh, options: &BuildOptions) -> Bvh2 {
    let codes = options.codes.expect("codes are named");
    let corners = || twin::lbvh::corners(positions, triangles);
    twin::build(options, codes, |finish| match &options.split {
        _ if options.pairs => twin::pairs::build_corners(corners(), codes, finish),
        None => twin::lbvh::build_corners(corners(), codes, finish).into(),
        Some(split) => twin::split::build_corners(corners(), split, codes, finish).into(),
    })
}

/// Nothing if the bytes are the same; otherwise what differs first.
///
/// # Errors
/// They differ.
pub fn compare(got: &Bvh2, expected: &Bvh2) -> Found {
    if got.to_bytes() == expected.to_bytes() {
        return Ok(());
    }
    ensure!(got.header == expected.header, "header {:?}, expected {:?}", got.header, expected.header);
    same_all("record", &got.records, &expected.records)?;
    same_all("node", &got.nodes, &expected.nodes)?;
    bail!("other bytes")
}
