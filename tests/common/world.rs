//! A small world of instances, built through a back end, and what a ray meets in it by brute force in double precision.

use super::backends::{Backend, Built};
use super::device;
use super::probe::{CONFIRM, CONFIRM_ODD, ProbeRay, flags};
use super::shapes::Corners;
use hedgerow::accel::Instance;
use hedgerow::ash::vk;
use hedgerow::gpu::Buffer;

type Flags = vk::GeometryInstanceFlagsKHR;
type GeometryFlags = vk::GeometryFlagsKHR;
type Geometry = vk::AccelerationStructureGeometryKHR<'static>;
type Range = vk::AccelerationStructureBuildRangeInfoKHR;

/// Geometries of a bottom-level structure, each with its flags.
#[derive(Clone)]
pub enum Part {
    Triangles(Vec<(Corners, GeometryFlags)>),
    /// Least and greatest corners.
    Boxes(Vec<(Vec<[[f32; 3]; 2]>, GeometryFlags)>),
}

/// Parts, and instances whose `structure` is 1 + the number of a part, or 0.
#[derive(Clone)]
pub struct World {
    pub parts: Vec<Part>,
    pub instances: Vec<Instance>,
    pub flags: vk::BuildAccelerationStructureFlagsKHR,
    /// Whether the instances are given by pointers.
    pub by_pointers: bool,
}

/// The structures of a world, and their memory.
pub struct BuiltWorld {
    pub top: Built,
    pub parts: Vec<Built>,
    pub instances: Buffer<'static>,
    pub geometry: Geometry,
    _memory: Vec<Buffer<'static>>,
}

fn address(device_address: u64) -> vk::DeviceOrHostAddressConstKHR {
    vk::DeviceOrHostAddressConstKHR { device_address }
}

impl Part {
    /// Vulkan's structs over uploaded data.
    pub fn geometries(&self) -> (Vec<Geometry>, Vec<Range>, Vec<Buffer<'static>>) {
        let mut all = (Vec::new(), Vec::new(), Vec::new());
        let mut add = |kind, data, flags, count: usize, memory| {
            let geometry =
                vk::AccelerationStructureGeometryKHR::default().geometry_type(kind).geometry(data).flags(flags);
            all.0.push(geometry);
            all.1.push(Range::default().primitive_count(count as u32));
            all.2.push(memory);
        };
        match self {
            Part::Triangles(geometries) => {
                for (corners, flags) in geometries {
                    let memory = device().upload("corners", corners).expect("memory");
                    let triangles = vk::AccelerationStructureGeometryTrianglesDataKHR::default()
                        .vertex_format(vk::Format::R32G32B32_SFLOAT)
                        .vertex_data(address(memory.address()))
                        .vertex_stride(12)
                        .max_vertex((3 * corners.len()).max(1) as u32 - 1)
                        .index_type(vk::IndexType::NONE_KHR);
                    let data = vk::AccelerationStructureGeometryDataKHR { triangles };
                    add(vk::GeometryTypeKHR::TRIANGLES, data, *flags, corners.len(), memory);
                }
            }
            Part::Boxes(geometries) => {
                for (boxes, flags) in geometries {
                    let memory = device().upload("boxes", boxes).expect("memory");
                    let aabbs = vk::AccelerationStructureGeometryAabbsDataKHR::default()
                        .data(address(memory.address()))
                        .stride(24);
                    let data = vk::AccelerationStructureGeometryDataKHR { aabbs };
                    add(vk::GeometryTypeKHR::AABBS, data, *flags, boxes.len(), memory);
                }
            }
        }
        all
    }

    /// Builds it alone.
    pub fn build(&self, backend: &dyn Backend) -> (Built, Vec<Buffer<'static>>) {
        let (geometries, ranges, memory) = self.geometries();
        let info = vk::AccelerationStructureBuildGeometryInfoKHR::default()
            .ty(vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL)
            .geometries(&geometries);
        (Built::new(backend, &info, &ranges, 0), memory)
    }
}

impl World {
    /// Instances of parts, with no build flags.
    pub fn new(parts: Vec<Part>, instances: Vec<Instance>) -> World {
        World { parts, instances, flags: vk::BuildAccelerationStructureFlagsKHR::empty(), by_pointers: false }
    }

    /// The instances as they are given to a back end whose parts are these.
    pub fn placed(&self, backend: &dyn Backend, parts: &[Built]) -> Vec<Instance> {
        let structure = |number: u64| match number {
            0 => 0,
            number => backend.address(parts[number as usize - 1].structure),
        };
        self.instances.iter().map(|i| Instance { structure: structure(i.structure), ..*i }).collect()
    }

    /// Builds everything.
    pub fn build(&self, backend: &dyn Backend) -> BuiltWorld {
        let mut memory = Vec::new();
        let mut parts = Vec::new();
        for part in &self.parts {
            let (built, data) = part.build(backend);
            parts.push(built);
            memory.extend(data);
        }
        let placed = self.placed(backend, &parts);
        let mut instances = device().upload("instances", &placed).expect("memory");
        if self.by_pointers {
            let pointers: Vec<u64> =
                (0..placed.len() as u64).map(|i| instances.address() + i * size_of::<Instance>() as u64).collect();
            memory.push(std::mem::replace(&mut instances, device().upload("pointers", &pointers).expect("memory")));
        }
        let data = vk::AccelerationStructureGeometryInstancesDataKHR::default()
            .array_of_pointers(self.by_pointers)
            .data(address(instances.address()));
        let geometry = vk::AccelerationStructureGeometryKHR::default()
            .geometry_type(vk::GeometryTypeKHR::INSTANCES)
            .geometry(vk::AccelerationStructureGeometryDataKHR { instances: data });
        let geometries = [geometry];
        let info = vk::AccelerationStructureBuildGeometryInfoKHR::default()
            .ty(vk::AccelerationStructureTypeKHR::TOP_LEVEL)
            .flags(self.flags)
            .geometries(&geometries);
        let range = Range::default().primitive_count(placed.len() as u32);
        let top = Built::new(backend, &info, &[range], 0);
        BuiltWorld { top, parts, instances, geometry, _memory: memory }
    }

    /// Everything that a ray meets between its limits and may not cull, by brute force, nearest first.
    pub fn meetings(&self, ray: &ProbeRay) -> Vec<Met> {
        let mut all = Vec::new();
        for (i, instance) in self.instances.iter().enumerate() {
            if instance.structure == 0 || instance.index_and_mask >> 24 & ray.mask & 0xff == 0 {
                continue;
            }
            let instance_flags = Flags::from_raw(instance.offset_and_flags >> 24);
            let to_object = inverse(&instance.transform);
            let origin = transformed(&to_object, ray.origin.map(f64::from), 1.0);
            let direction = transformed(&to_object, ray.direction.map(f64::from), 0.0);
            let is_opaque = |geometry: GeometryFlags| {
                let mut is_opaque = geometry.contains(GeometryFlags::OPAQUE);
                is_opaque |= instance_flags.contains(Flags::FORCE_OPAQUE);
                is_opaque &= !instance_flags.contains(Flags::FORCE_NO_OPAQUE);
                (is_opaque || ray.flags & flags::OPAQUE != 0) && ray.flags & flags::NO_OPAQUE == 0
            };
            let is_culled =
                |is_opaque: bool| ray.flags & (if is_opaque { flags::CULL_OPAQUE } else { flags::CULL_NO_OPAQUE }) != 0;
            let limits = [f64::from(ray.t_min), f64::from(ray.t_max)];
            let mut add = |geometry: usize, primitive: usize, is_opaque: bool, met: Met| {
                if !is_culled(is_opaque) {
                    let place = [i as u32, geometry as u32, primitive as u32];
                    all.push(Met { place, is_opaque, ..met });
                }
            };
            match &self.parts[instance.structure as usize - 1] {
                Part::Triangles(_) if ray.flags & flags::SKIP_TRIANGLES != 0 => {}
                Part::Boxes(_) if ray.flags & flags::SKIP_BOXES != 0 => {}
                Part::Triangles(geometries) => {
                    for (g, (corners, geometry_flags)) in geometries.iter().enumerate() {
                        for (p, triangle) in corners.iter().enumerate() {
                            let Some(mut met) = triangle_met(triangle, origin, direction, limits) else { continue };
                            met.is_front ^= instance_flags.contains(Flags::TRIANGLE_FLIP_FACING);
                            let culled = if met.is_front { flags::CULL_FRONT } else { flags::CULL_BACK };
                            if ray.flags & culled == 0 || instance_flags.contains(Flags::TRIANGLE_FACING_CULL_DISABLE) {
                                add(g, p, is_opaque(*geometry_flags), met);
                            }
                        }
                    }
                }
                Part::Boxes(geometries) => {
                    for (g, (boxes, geometry_flags)) in geometries.iter().enumerate() {
                        for (p, corners) in boxes.iter().enumerate() {
                            if let Some(met) = box_met(corners, origin, direction, limits) {
                                add(g, p, is_opaque(*geometry_flags), met);
                            }
                        }
                    }
                }
            }
        }
        all.sort_by(|a, b| a.t.total_cmp(&b.t).then(a.place.cmp(&b.place)));
        all
    }

    /// What a query commits to: the nearest of what is opaque, confirmed or generated.
    pub fn committed(&self, ray: &ProbeRay) -> Option<Met> {
        let confirms = |met: &Met| match ray.decision {
            CONFIRM => true,
            CONFIRM_ODD => met.place[2] % 2 == 1,
            _ => false,
        };
        let hits = self.meetings(ray).into_iter().filter_map(|met| match met.is_box {
            true => confirms(&met).then(|| Met { t: f64::from(ray.generated_t), ..met }),
            false => (met.is_opaque || confirms(&met)).then_some(met),
        });
        hits.min_by(|a, b| a.t.total_cmp(&b.t).then(a.place.cmp(&b.place)))
    }

    /// Whether rounding may change what the ray meets: an edge or a limit is near, or two meetings are.
    pub fn is_close_call(&self, ray: &ProbeRay) -> bool {
        let wide = ProbeRay { t_min: ray.t_min - 1e-3, t_max: ray.t_max + 1e-3, ..*ray };
        let all = self.meetings(&wide);
        let near_limit =
            |met: &Met| [ray.t_min, ray.t_max].iter().any(|&limit| (met.t - f64::from(limit)).abs() < 2e-3);
        let twins = all.windows(2).any(|pair| (pair[0].t - pair[1].t).abs() < 1e-4 * pair[0].t.abs().max(1e-3));
        twins || all.iter().any(|met| met.margin < 1e-4 || !met.is_box && near_limit(met))
    }
}

/// What a ray meets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Met {
    pub t: f64,
    pub weights: [f64; 2],
    /// Instance, geometry, primitive.
    pub place: [u32; 3],
    pub is_front: bool,
    pub is_opaque: bool,
    pub is_box: bool,
    /// How far from an edge, as a weight.
    pub margin: f64,
}

type Matrix = [[f64; 4]; 3];

pub fn transformed(m: &Matrix, p: [f64; 3], w: f64) -> [f64; 3] {
    m.map(|[a, b, c, d]| a * p[0] + b * p[1] + c * p[2] + d * w)
}

/// The inverse of an affine matrix, by Cramer's rule.
pub fn inverse(m: &[[f32; 4]; 3]) -> Matrix {
    let m: Matrix = m.map(|row| row.map(f64::from));
    let row = |i: usize| [m[i][0], m[i][1], m[i][2]];
    let columns = [cross(row(1), row(2)), cross(row(2), row(0)), cross(row(0), row(1))];
    let determinant = dot(row(0), columns[0]);
    std::array::from_fn(|i| {
        let r = columns.map(|column| column[i] / determinant);
        [r[0], r[1], r[2], -dot(r, [m[0][3], m[1][3], m[2][3]])]
    })
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Möller and Trumbore 1997.
fn triangle_met(triangle: &[[f32; 3]; 3], origin: [f64; 3], direction: [f64; 3], limits: [f64; 2]) -> Option<Met> {
    let [v0, v1, v2] = triangle.map(|v| v.map(f64::from));
    let minus = |a: [f64; 3], b: [f64; 3]| -> [f64; 3] { std::array::from_fn(|i| a[i] - b[i]) };
    let (e1, e2, from_v0) = (minus(v1, v0), minus(v2, v0), minus(origin, v0));
    let across = cross(direction, e2);
    let determinant = dot(e1, across);
    if determinant == 0.0 {
        return None;
    }
    let q = cross(from_v0, e1);
    let (u, v, t) = (dot(from_v0, across) / determinant, dot(direction, q) / determinant, dot(e2, q) / determinant);
    let margin = u.min(v).min(1.0 - u - v);
    // The front is where the normal looks, by the right hand: clockwise in left-handed coordinates, as the field says it.
    let is_front = dot(cross(e1, e2), direction) < 0.0;
    let met = Met { t, weights: [u, v], place: [0; 3], is_front, is_opaque: false, is_box: false, margin };
    (margin >= 0.0 && limits[0] < t && t < limits[1]).then_some(met)
}

fn box_met(corners: &[[f32; 3]; 2], origin: [f64; 3], direction: [f64; 3], limits: [f64; 2]) -> Option<Met> {
    let (mut enter, mut leave) = (limits[0], limits[1]);
    for k in 0..3 {
        let at = |side: usize| (f64::from(corners[side][k]) - origin[k]) / direction[k];
        if direction[k] == 0.0 {
            let inside = f64::from(corners[0][k]) <= origin[k] && origin[k] <= f64::from(corners[1][k]);
            if !inside {
                return None;
            }
        } else {
            enter = enter.max(at(0).min(at(1)));
            leave = leave.min(at(0).max(at(1)));
        }
    }
    // Relative to how far the ray goes, so that close calls are told.
    let margin = (leave - enter) / leave.abs().max(enter.abs()).max(1e-3);
    let met =
        Met { t: enter, weights: [0.0; 2], place: [0; 3], is_front: false, is_opaque: false, is_box: true, margin };
    (enter <= leave).then_some(met)
}
