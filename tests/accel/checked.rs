//! Checked devices refuse what breaks a rule before anything is recorded, by the name of the field.

use crate::common::device;
use crate::common::shapes::soup;
use hedgerow::accel::{AccelOptions, Device};
use hedgerow::ash::vk;
use hedgerow::ash::vk::Handle;
use hedgerow::gpu::Recorder;
use hedgerow_lab::device::Buffer;
use vk::BuildAccelerationStructureFlagsKHR as Flags;
use vk::BuildAccelerationStructureModeKHR as Mode;

type BuildInfo<'a> = vk::AccelerationStructureBuildGeometryInfoKHR<'a>;
type Geometry = vk::AccelerationStructureGeometryKHR<'static>;
type Range = vk::AccelerationStructureBuildRangeInfoKHR;

const COUNT: u32 = 50;

/// A device with checks, triangles, and two structures with scratch memory for them.
struct Bench {
    ours: Device<'static>,
    geometry: [Geometry; 1],
    places: [vk::AccelerationStructureKHR; 2],
    bytes: u64,
    scratch_bytes: u64,
    scratch: [Buffer<'static>; 2],
    memory: Vec<Buffer<'static>>,
}

impl Bench {
    fn new() -> Bench {
        let ours = Device::with_options(device(), AccelOptions::CHECKED);
        let corners = device().upload("corners", &soup(COUNT as usize, 0.3, 1)).expect("memory");
        let triangles = vk::AccelerationStructureGeometryTrianglesDataKHR::default()
            .vertex_format(vk::Format::R32G32B32_SFLOAT)
            .vertex_data(vk::DeviceOrHostAddressConstKHR { device_address: corners.address() })
            .vertex_stride(12)
            .max_vertex(3 * COUNT - 1)
            .index_type(vk::IndexType::NONE_KHR);
        let geometry = [vk::AccelerationStructureGeometryKHR::default()
            .geometry_type(vk::GeometryTypeKHR::TRIANGLES)
            .geometry(vk::AccelerationStructureGeometryDataKHR { triangles })];
        let info = bottom_level(&geometry);
        let mut sizes = vk::AccelerationStructureBuildSizesInfoKHR::default();
        let place = vk::AccelerationStructureBuildTypeKHR::DEVICE;
        unsafe { ours.get_acceleration_structure_build_sizes(place, &info, &[COUNT], &mut sizes) }.expect("sizes");
        let bytes = sizes.acceleration_structure_size;
        let scratch_bytes = sizes.build_scratch_size.max(sizes.update_scratch_size);
        let scratch = [(); 2].map(|()| device().buffer("scratch", scratch_bytes).expect("memory"));
        let mut memory = vec![corners];
        let places = [(); 2].map(|()| {
            let buffer = device().buffer("structure", bytes).expect("memory");
            let create = create_info(&buffer, 0, bytes, vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL);
            let structure = unsafe { ours.create_acceleration_structure(&create, None) }.expect("it fits");
            memory.push(buffer);
            structure
        });
        Bench { ours, geometry, places, bytes, scratch_bytes, scratch, memory }
    }

    /// A build into a place, with its scratch memory.
    fn info<'a>(&self, geometry: &'a [Geometry], at: usize) -> BuildInfo<'a> {
        bottom_level(geometry).dst_acceleration_structure(self.places[at]).scratch_data(address(&self.scratch[at]))
    }

    fn build(&self, infos: &[BuildInfo<'_>], ranges: &[&[Range]]) -> hedgerow::Result<()> {
        let record = |recorder: &mut Recorder<'_>| unsafe {
            self.ours.cmd_build_acceleration_structures(recorder.commands(), infos, ranges)
        };
        device().run(None, record).map_err(Into::into)
    }

    #[track_caller]
    fn assert_refused(&self, info: BuildInfo<'_>, range: Range, says: &[&str]) {
        assert_says(self.build(&[info], &[&[range]]), says);
    }
}

#[track_caller]
fn assert_says(result: hedgerow::Result<()>, says: &[&str]) {
    let error = result.expect_err(says[0]).to_string();
    assert!(says.iter().all(|part| error.contains(part)), "{error} should say {says:?}");
}

fn bottom_level(geometry: &[Geometry]) -> BuildInfo<'_> {
    BuildInfo::default()
        .ty(vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL)
        .flags(Flags::ALLOW_UPDATE)
        .geometries(geometry)
}

fn address(buffer: &Buffer<'_>) -> vk::DeviceOrHostAddressKHR {
    vk::DeviceOrHostAddressKHR { device_address: buffer.address() }
}

fn create_info<'a>(
    buffer: &Buffer<'_>,
    offset: u64,
    size: u64,
    ty: vk::AccelerationStructureTypeKHR,
) -> vk::AccelerationStructureCreateInfoKHR<'a> {
    vk::AccelerationStructureCreateInfoKHR::default().buffer(buffer.raw()).offset(offset).size(size).ty(ty)
}

fn all() -> Range {
    Range::default().primitive_count(COUNT)
}

#[test]
fn what_follows_the_rules_is_built() {
    let bench = Bench::new();
    let infos = [bench.info(&bench.geometry, 0), bench.info(&bench.geometry, 1)];
    bench.build(&infos, &[&[all()], &[all()]]).expect("both are right");
}

#[test]
fn places_that_do_not_fit_are_refused() {
    let bench = Bench::new();
    let small = bench.memory.last().expect("memory");
    let bottom = vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL;
    let behind = create_info(small, 0, 1 << 40, bottom);
    let error = unsafe { bench.ours.create_acceleration_structure(&behind, None) }.map(|_| ());
    assert_says(error, &["size", "reach behind"]);
    // Too small for the build, created as another type, never created, destroyed.
    let buffer = device().buffer("structure", 2 * bench.bytes + 512).expect("memory");
    let create = |offset, size, ty| {
        unsafe { bench.ours.create_acceleration_structure(&create_info(&buffer, offset, size, ty), None) }
            .expect("it fits")
    };
    let too_small = create(0, bench.bytes - 1, bottom);
    let info = bench.info(&bench.geometry, 0);
    let needs = bench.bytes.to_string();
    bench.assert_refused(info.dst_acceleration_structure(too_small), all(), &["dstAccelerationStructure", &needs]);
    let top = create(256, bench.bytes, vk::AccelerationStructureTypeKHR::TOP_LEVEL);
    bench.assert_refused(info.dst_acceleration_structure(top), all(), &["type is BOTTOM_LEVEL", "TOP_LEVEL"]);
    let nowhere = vk::AccelerationStructureKHR::from_raw(buffer.address() + 512);
    bench.assert_refused(info.dst_acceleration_structure(nowhere), all(), &["is not a structure of this device"]);
    let gone = create(512, bench.bytes, bottom);
    bench.ours.destroy_acceleration_structure(gone, None);
    bench.assert_refused(info.dst_acceleration_structure(gone), all(), &["is not a structure of this device"]);
}

#[test]
fn memory_that_overlaps_is_refused() {
    let bench = Bench::new();
    let (first, second) = (bench.info(&bench.geometry, 0), bench.info(&bench.geometry, 1));
    let ranges: [&[Range]; 2] = [&[all()], &[all()]];
    let same_scratch = second.scratch_data(address(&bench.scratch[0]));
    assert_says(
        bench.build(&[first, same_scratch], &ranges),
        &["pInfos[0].scratchData", "pInfos[1].scratchData", "overlap"],
    );
    let same_place = second.dst_acceleration_structure(bench.places[0]);
    assert_says(bench.build(&[first, same_place], &ranges), &["dstAccelerationStructure", "overlap"]);
    let end = bench.scratch[0].address() + bench.scratch_bytes - 16;
    let into = vk::DeviceOrHostAddressKHR { device_address: end & !15 };
    assert_says(bench.build(&[first, second.scratch_data(into)], &ranges), &["scratchData", "overlap"]);
    let own = vk::DeviceOrHostAddressKHR { device_address: bench.places[0].as_raw() + 16 };
    bench.assert_refused(first.scratch_data(own), all(), &["dstAccelerationStructure", "scratchData", "overlap"]);
}

#[test]
fn misaligned_data_is_refused() {
    let bench = Bench::new();
    let with = |change: fn(&mut vk::AccelerationStructureGeometryTrianglesDataKHR<'static>)| {
        let mut geometry = bench.geometry;
        unsafe { change(&mut geometry[0].geometry.triangles) };
        geometry
    };
    let shifted = with(|t| unsafe { t.vertex_data.device_address += 2 });
    bench.assert_refused(bench.info(&shifted, 0), all(), &["pGeometries[0].vertexData", "multiple of 4"]);
    let no_vertices = with(|t| t.vertex_data.device_address = 0);
    bench.assert_refused(bench.info(&no_vertices, 0), all(), &["pGeometries[0].vertexData is 0"]);
    let indices = with(|t| {
        t.index_type = vk::IndexType::UINT32;
        t.index_data.device_address = unsafe { t.vertex_data.device_address } + 1;
    });
    bench.assert_refused(bench.info(&indices, 0), all(), &["pGeometries[0].indexData", "multiple of 4"]);
    let transform = with(|t| t.transform_data.device_address = unsafe { t.vertex_data.device_address } + 4);
    bench.assert_refused(bench.info(&transform, 0), all(), &["pGeometries[0].transformData", "multiple of 16"]);
    let range = Range { primitive_offset: 6, primitive_count: 1, ..all() };
    bench.assert_refused(bench.info(&bench.geometry, 0), range, &["ranges[0].primitiveOffset is 6", "multiple of 4"]);
}

#[test]
fn updates_that_change_more_than_data_are_refused() {
    let bench = Bench::new();
    let update =
        |geometry, at: usize| bench.info(geometry, at).mode(Mode::UPDATE).src_acceleration_structure(bench.places[at]);
    bench.assert_refused(update(&bench.geometry, 0), all(), &["srcAccelerationStructure", "not built"]);
    bench.build(&[bench.info(&bench.geometry, 0).flags(Flags::empty())], &[&[all()]]).expect("it builds");
    bench.assert_refused(update(&bench.geometry, 0), all(), &["srcAccelerationStructure", "ALLOW_UPDATE"]);
    bench.build(&[bench.info(&bench.geometry, 0)], &[&[all()]]).expect("it builds");
    let fewer = Range { primitive_count: COUNT - 1, ..all() };
    bench.assert_refused(update(&bench.geometry, 0), fewer, &["ranges[0].primitiveCount is 49 and was 50"]);
    let faster = update(&bench.geometry, 0).flags(Flags::ALLOW_UPDATE | Flags::PREFER_FAST_BUILD);
    bench.assert_refused(faster, all(), &["flags are", "an update changes none"]);
    let mut opaque = bench.geometry;
    opaque[0].flags = vk::GeometryFlagsKHR::OPAQUE;
    bench.assert_refused(update(&opaque, 0), all(), &["pGeometries[0]", "an update changes data alone"]);
    bench.build(&[update(&bench.geometry, 0)], &[&[all()]]).expect("it updates");
}
