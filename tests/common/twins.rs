//! A tree from both sides: built on the device, and by the twins on the host with the same options.

use super::corpus::Mesh;
use super::device;
use hedgerow::bvh::builder::{Builder, Input, Method, Options, Window};
use hedgerow::bvh::host;
use hedgerow::bvh::layout::Bvh2;
use hedgerow::bvh::sah::Collapse;

/// The device's tree over `input`.
pub fn built(options: &Options, input: &Input) -> Bvh2 {
    let device = device();
    let builder = Builder::new(device, options, input.primitive_count).expect("few enough primitives");
    let sizes = builder.sizes();
    let structure = device.buffer("structure", sizes.structure).expect("memory");
    let scratch = device.buffer("scratch", sizes.scratch).expect("memory");
    // Whatever was there before changes nothing.
    structure.write(&vec![0x5Au8; sizes.structure as usize]);
    scratch.write(&vec![0xA5u8; sizes.scratch as usize]);
    device.warm(&builder.kernels(input)).expect("the kernels compile");
    device.run(None, |r| builder.record(r, input, structure.address(), scratch.address())).expect("it builds");
    let bytes = structure.read::<u8>(sizes.structure as usize);
    let tree = Bvh2::from_bytes(&bytes).expect("a structure");
    assert!(tree.to_bytes() == bytes, "bytes that belong to no part");
    tree
}

/// The device's tree of a mesh.
pub fn on_device((_, positions, triangles): &Mesh, options: &Options) -> Bvh2 {
    let vertices = device().upload("positions", positions).expect("memory");
    let indices = device().upload("indices", triangles).expect("memory");
    let (corners, count) = (positions.len() as u32, triangles.len() as u32);
    built(options, &Input::mesh(vertices.address(), corners, indices.address(), count))
}

/// What [`on_device`] must equal, byte for byte. The options name the codes.
pub fn on_host((_, positions, triangles): &Mesh, options: &Options) -> Bvh2 {
    let codes = options.codes.expect("codes are named");
    let lbvh = |collapse| match &options.split {
        None => host::lbvh::build(positions, triangles, codes, collapse),
        Some(split) => host::split::build(positions, triangles, split, codes, collapse),
    };
    if options.method == Method::Lbvh && options.optimise.is_none() {
        // Its own collapsing leaves other bytes in slots that fall out.
        return lbvh(options.collapse);
    }
    let radix = lbvh(Collapse::OFF);
    let tree = match options.method {
        Method::Lbvh => radix,
        Method::Hlbvh(treelets) => {
            let bits = treelets.bits(codes, radix.header.primitive_count);
            host::hlbvh::build(&radix, codes, host::hlbvh::Treelets { bits, primitives: treelets.primitives })
        }
        Method::Ploc { radius } => host::ploc::build(&radix, radius as usize),
        Method::Hploc(Window { size, radius }) => {
            host::hploc::build(&radix, host::hploc::Window { size: size as usize, radius: radius as usize })
        }
    };
    let tree = match &options.optimise {
        None => tree,
        Some(optimise) => tree.reinserted(optimise),
    };
    tree.collapsed(&options.collapse)
}

/// The same bytes; otherwise tells what differs first.
#[track_caller]
pub fn assert_same(got: &Bvh2, expected: &Bvh2, what: &str) {
    if got.to_bytes() == expected.to_bytes() {
        return;
    }
    assert_eq!(got.header, expected.header, "{what}");
    for (i, (got, expected)) in got.records.iter().zip(&expected.records).enumerate() {
        assert_eq!(got, expected, "{what}: record {i}");
    }
    for (i, (got, expected)) in got.nodes.iter().zip(&expected.nodes).enumerate() {
        assert_eq!(got, expected, "{what}: node {i}");
    }
    panic!("{what}: other bytes");
}
