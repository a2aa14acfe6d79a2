//! Builds whose arguments lie in memory: the bytes of those whose arguments are push constants.

use crate::common::device;
use crate::common::geometries::Owned;
use crate::common::shapes::soup;
use hedgerow::accel::{self, AccelOptions, Placement, Request, Wide};
use hedgerow::ash::vk;
use hedgerow::bvh::geometry::{Geometry, IndexFormat, VertexFormat};
use hedgerow::bvh::layout::{self, Header};
use hedgerow::gpu::ArgumentMemory;
use hedgerow_lab::device::Buffer;

type Flags = vk::BuildAccelerationStructureFlagsKHR;

/// Small ones of all flags, of one geometry and of several and of other formats; and two that a chain of dispatches builds.
fn requests() -> (Vec<Request>, Vec<[Buffer<'static>; 3]>) {
    let formats = [(VertexFormat::FLOAT3, IndexFormat::U32), (VertexFormat::HALF3, IndexFormat::U16)];
    let (geometries, buffers): (Vec<Geometry>, Vec<_>) = formats
        .map(|(vertices, indices)| Owned::of(&soup(4000, 0.5, 5), vertices, indices, 4).upload(0, 0))
        .into_iter()
        .unzip();
    let flags = [
        Flags::PREFER_FAST_BUILD,
        Flags::PREFER_FAST_BUILD | Flags::ALLOW_UPDATE,
        Flags::empty(),
        Flags::PREFER_FAST_TRACE,
    ];
    let small = (0..120usize).map(|i| {
        let count = (i * 37 % 290) as u32;
        let all = [(geometries[i / 7 % 2], count), (geometries[i % 2], 1 + count / 2), (geometries[0], 3)];
        Request::triangles(&all[..1 + i % 3]).with_flags(flags[i % 4])
    });
    let large = flags.map(|flags| Request::triangles(&[(geometries[0], 2500), (geometries[1], 900)]).with_flags(flags));
    (small.chain(large).collect(), buffers)
}

/// The bytes of the structures that are in use, built in one call. What lies behind them has been scratch memory.
fn built(structures: &accel::Device<'_>, requests: &[Request]) -> hedgerow::Result<Vec<Vec<u8>>> {
    let memory: Vec<[Buffer<'_>; 2]> = requests
        .iter()
        .map(|request| {
            let sizes = request.sizes(structures).expect("sizes");
            [sizes.structure, sizes.scratch].map(|bytes| device().buffer("memory", bytes).expect("memory"))
        })
        .collect();
    let placement = |(request, [structure, scratch]): (_, &[Buffer<'_>; 2])| Placement {
        request,
        structure: structure.region(),
        scratch: scratch.region(),
    };
    let placements: Vec<Placement<'_>> = requests.iter().zip(&memory).map(placement).collect();
    let mut refused = Ok(());
    device()
        .run(None, |recorder| {
            // SAFETY: recorded by `run`, and all memory lives until it has run.
            refused = unsafe { structures.record(recorder.commands(), &placements) };
            Ok(())
        })
        .expect("it runs");
    let in_use = |structure: &Buffer<'_>| {
        let header: Header = structure.read(1)[0];
        let record_bytes = layout::record_bytes(header.kind).expect("a structure of ours");
        structure.read(header.offsets(record_bytes).bytes as usize)
    };
    refused.map(|()| memory.iter().map(|[structure, _]| in_use(structure)).collect())
}

#[test]
fn builds_with_arguments_in_memory_have_the_bytes_of_those_without() {
    let (requests, _geometries) = requests();
    let pushed = accel::Device::with_options(device(), AccelOptions { wide: Wide::Always, ..AccelOptions::DEFAULT });
    let bytes = accel::Device::argument_bytes(requests.len() as u64, 3 * requests.len() as u64);
    let arguments = device().upload("arguments", &vec![0xa5u8; 48 + bytes as usize]).expect("memory");
    let memory = ArgumentMemory { buffer: arguments.raw(), offset: 32, bytes };
    // SAFETY: buffers of the tests' device have the usage.
    let in_memory = unsafe { pushed.with_arguments_in(memory) };
    let [expected, got] = [&pushed, &in_memory].map(|structures| built(structures, &requests).expect("they build"));
    for (i, (expected, got)) in expected.iter().zip(&got).enumerate() {
        assert!(expected == got, "build {i}: {:?}", requests[i]);
    }
    let table: Vec<u8> = arguments.read(48 + bytes as usize);
    assert!(table[32..].iter().any(|&byte| byte != 0xa5), "arguments were written");
    assert!(table[..32].iter().chain(&table[32 + bytes as usize..]).all(|&byte| byte == 0xa5), "and nothing outside");

    // The memory is taken again by the next call, and the same command buffer would find it as it was.
    assert!(built(&in_memory, &requests).expect("they build") == expected, "a second time");
}

#[test]
fn memory_for_arguments_that_is_too_small_or_lies_wrong_is_refused() {
    let (requests, _geometries) = requests();
    let pushed = accel::Device::new(device());
    let arguments = device().buffer("arguments", 1 << 16).expect("memory");
    let error_of = |offset, bytes| {
        let memory = ArgumentMemory { buffer: arguments.raw(), offset, bytes };
        // SAFETY: buffers of the tests' device have the usage.
        built(&unsafe { pushed.with_arguments_in(memory) }, &requests).expect_err("refused").to_string()
    };
    // Two records of 40 bytes fit, three more, aligned, do not.
    assert!(error_of(0, 100).contains("memory for arguments of 100 bytes, at least 208"), "{}", error_of(0, 100));
    assert!(error_of(8, 1 << 15).contains("its address is a multiple of 16"), "{}", error_of(8, 1 << 15));
    // Nothing is read of memory that nothing needs.
    let none: [Request; 0] = [];
    let memory = ArgumentMemory { buffer: arguments.raw(), offset: 0, bytes: 0 };
    // SAFETY: as above.
    assert!(built(&unsafe { pushed.with_arguments_in(memory) }, &none).expect("nothing to build").is_empty());
}
