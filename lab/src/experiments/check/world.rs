//! A small world of instances, built through a back end, and what a ray meets in it by brute force in double precision.
#![allow(missing_docs, reason = "names and types say it all: groups and tests are the only readers")]

use super::backend::{Backend, Built};
use super::probe::{CONFIRM, CONFIRM_ODD, ProbeRay, flags};
use super::shapes::Corners;
use crate::device::{Buffer, Device};
use ash::vk;
use hedgerow::accel::Instance;

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

/// Vulkan's struct for instances, or pointers to them.
pub fn instances_at(at: u64, by_pointers: bool) -> Geometry {
    let instances =
        vk::AccelerationStructureGeometryInstancesDataKHR::default().array_of_pointers(by_pointers).data(address(at));
    vk::AccelerationStructureGeometryKHR::default()
        .geometry_type(vk::GeometryTypeKHR::INSTANCES)
        .geometry(vk::AccelerationStructureGeometryDataKHR { instances })
}

/// Builds a top level of them alone.
pub fn top_level(
    backend: &dyn Backend,
    instances: &Geometry,
    range: Range,
    flags: vk::BuildAccelerationStructureFlagsKHR,
) -> Built {
    let info = vk::AccelerationStructureBuildGeometryInfoKHR::default()
        .ty(vk::AccelerationStructureTypeKHR::TOP_LEVEL)
        .flags(flags)
        .geometries(std::slice::from_ref(instances));
    Built::new(backend, &info, &[range], 0)
}

/// Builds a bottom level of them alone.
pub fn bottom_level(backend: &dyn Backend, geometries: &[Geometry], ranges: &[Range]) -> Built {
    let info = vk::AccelerationStructureBuildGeometryInfoKHR::default()
        .ty(vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL)
        .geometries(geometries);
    Built::new(backend, &info, ranges, 0)
}

impl Part {
    /// Vulkan's structs over uploaded data.
    pub fn geometries(&self, device: &'static Device) -> (Vec<Geometry>, Vec<Range>, Vec<Buffer<'static>>) {
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
                    let memory = device.upload("corners", corners).expect("memory");
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
                    let memory = device.upload("boxes", boxes).expect("memory");
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
        let (geometries, ranges, memory) = self.geometries(backend.device());
        (bottom_level(backend, &geometries, &ranges), memory)
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
        self.build_over(backend, parts, memory)
    }

    /// Builds the top level over parts that are built, and keeps their memory.
    pub fn build_over(&self, backend: &dyn Backend, parts: Vec<Built>, mut memory: Vec<Buffer<'static>>) -> BuiltWorld {
        let placed = self.placed(backend, &parts);
        let mut instances = backend.device().upload("instances", &placed).expect("memory");
        if self.by_pointers {
            let pointers: Vec<u64> =
                (0..placed.len() as u64).map(|i| instances.address() + i * size_of::<Instance>() as u64).collect();
            memory.push(std::mem::replace(
                &mut instances,
                backend.device().upload("pointers", &pointers).expect("memory"),
            ));
        }
        let geometry = instances_at(instances.address(), self.by_pointers);
        let range = Range::default().primitive_count(placed.len() as u32);
        let top = top_level(backend, &geometry, range, self.flags);
        BuiltWorld { top, parts, instances, geometry, _memory: memory }
    }

    /// Everything that a ray meets between its limits and may not cull, by brute force, nearest first; and what rounding might
    /// make it meet.
    fn possible_meetings(&self, ray: &ProbeRay) -> Vec<Met> {
        let mut all = Vec::new();
        for (i, instance) in self.instances.iter().enumerate() {
            if instance.structure == 0 || instance.index_and_mask >> 24 & ray.mask & 0xff == 0 {
                continue;
            }
            let instance_flags = Flags::from_raw(instance.offset_and_flags >> 24);
            let line = Line::in_object(&instance.transform, ray);
            let is_opaque = |geometry: GeometryFlags| {
                let mut is_opaque = geometry.contains(GeometryFlags::OPAQUE);
                is_opaque |= instance_flags.contains(Flags::FORCE_OPAQUE);
                is_opaque &= !instance_flags.contains(Flags::FORCE_NO_OPAQUE);
                (is_opaque || ray.flags & flags::OPAQUE != 0) && ray.flags & flags::NO_OPAQUE == 0
            };
            let is_culled =
                |is_opaque: bool| ray.flags & (if is_opaque { flags::CULL_OPAQUE } else { flags::CULL_NO_OPAQUE }) != 0;
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
                            let Some(mut met) = triangle_met(triangle, &line) else { continue };
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
                            if let Some(met) = box_met(corners, &line) {
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

    /// What a ray meets, and what its query commits to; nothing where rounding may decide: an edge or a limit is near, or two
    /// meetings are, or a box that is farther than a hit is generated before it.
    pub fn expected(&self, ray: &ProbeRay) -> Option<Expected> {
        let mut meetings = self.possible_meetings(ray);
        if meetings.iter().any(|met| met.is_unsure) {
            return None;
        }
        meetings.retain(|met| met.is_met);
        let confirms = |met: &Met| match ray.decision {
            CONFIRM => true,
            CONFIRM_ODD => met.place[2] % 2 == 1,
            _ => false,
        };
        let hits = meetings.iter().filter_map(|met| match met.is_box {
            true => confirms(met).then(|| Met { t: f64::from(ray.generated_t), t_error: 0.0, ..*met }),
            false => (met.is_opaque || confirms(met)).then_some(*met),
        });
        let mut hits: Vec<Met> = hits.collect();
        hits.sort_by(|a, b| a.t.total_cmp(&b.t).then(a.place.cmp(&b.place)));
        let are_twins = |pair: &[Met]| {
            !(pair[0].is_box && pair[1].is_box) && pair[1].t - pair[0].t <= pair[0].t_error + pair[1].t_error
        };
        // The box may be a candidate before the nearer triangle is a hit, or never.
        let generated = hits.first().is_some_and(|hit| hit.is_box);
        let nearest = hits.iter().find(|hit| !hit.is_box).map_or(f64::INFINITY, |hit| hit.t);
        let is_late = |met: &Met| met.is_box && confirms(met) && met.t > nearest;
        if hits.windows(2).any(are_twins) || generated && meetings.iter().any(is_late) {
            return None;
        }
        Some(Expected { meetings, committed: hits.first().copied() })
    }
}

/// What a query of a ray must say.
#[derive(Debug, Clone)]
pub struct Expected {
    /// Nearest first.
    pub meetings: Vec<Met>,
    /// The nearest of what is opaque, confirmed or generated.
    pub committed: Option<Met>,
}

/// What a ray meets, or may.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Met {
    pub t: f64,
    pub weights: [f64; 2],
    /// Instance, geometry, primitive.
    pub place: [u32; 3],
    pub is_front: bool,
    pub is_opaque: bool,
    pub is_box: bool,
    /// What float32 may be off by.
    pub t_error: f64,
    pub weight_error: f64,
    pub is_met: bool,
    /// Whether rounding may decide on it.
    is_unsure: bool,
}

/// A ray in the space of an instance.
struct Line {
    origin: [f64; 3],
    direction: [f64; 3],
    limits: [f64; 2],
    /// How far off float32 may place its origin, and a point at t = 1 in addition.
    origin_error: f64,
    direction_error: f64,
}

impl Line {
    fn in_object(transform: &[[f32; 4]; 3], ray: &ProbeRay) -> Line {
        let (origin, direction) = (ray.origin.map(f64::from), ray.direction.map(f64::from));
        let to_object = inverse(transform);
        Line {
            origin: transformed(&to_object, origin, 1.0),
            direction: transformed(&to_object, direction, 0.0),
            limits: [ray.t_min.into(), ray.t_max.into()],
            origin_error: transform_error(transform, origin, 1.0),
            direction_error: transform_error(transform, direction, 0.0),
        }
    }

    /// How far off a point at t may be beside something at `corner`.
    fn error_at(&self, t: f64, corner: [f64; 3]) -> f64 {
        self.origin_error + t.abs() * self.direction_error + PRECISION * length(corner)
    }
}

/// A generous bound on what float32 may lose in a few operations, relative to their terms.
const PRECISION: f64 = 1e-6;

/// How far off float32 may be in the transform of a point (or, with w = 0, of a direction) to the space of an instance: each
/// row of the inverse is a product of two columns divided by the determinant, and lost digits of these.
pub fn transform_error(to_world: &[[f32; 4]; 3], p: [f64; 3], w: f64) -> f64 {
    let column = |k: usize| to_world.map(|row| f64::from(row[k]));
    let columns = [column(0), column(1), column(2)];
    let determinant = dot(columns[0], cross(columns[1], columns[2])).abs();
    let lengths = columns.map(length);
    let rows = lengths.map(|own| lengths[0] * lengths[1] * lengths[2] / own / determinant);
    PRECISION * length(rows) * (length(p) + w * length(column(3)))
}

pub type Matrix = [[f64; 4]; 3];

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

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[i] - b[i])
}

fn length(a: [f64; 3]) -> f64 {
    dot(a, a).sqrt()
}

/// Möller and Trumbore 1997. Nothing where even rounding does not lead to a meeting.
fn triangle_met(triangle: &[[f32; 3]; 3], line: &Line) -> Option<Met> {
    let [v0, v1, v2] = triangle.map(|v| v.map(f64::from));
    let (e1, e2, from_v0) = (minus(v1, v0), minus(v2, v0), minus(line.origin, v0));
    let (normal, across) = (cross(e1, e2), cross(line.direction, e2));
    let determinant = dot(e1, across);
    if length(normal) == 0.0 {
        return None;
    }
    let q = cross(from_v0, e1);
    let [u, v, t] = [dot(from_v0, across), dot(line.direction, q), dot(e2, q)].map(|x| x / determinant);
    // The front is where the normal looks, by the right hand: clockwise in left-handed coordinates, as the field says it.
    let is_front = dot(normal, line.direction) < 0.0;
    let mut met = Met {
        t,
        weights: [u, v],
        place: [0; 3],
        is_front,
        is_opaque: false,
        is_box: false,
        t_error: f64::INFINITY,
        weight_error: f64::INFINITY,
        is_met: false,
        is_unsure: true,
    };
    let farthest = if length(v0) > length(v1).max(length(v2)) {
        v0
    } else if length(v1) > length(v2) {
        v1
    } else {
        v2
    };
    let cosine = dot(normal, line.direction).abs() / (length(normal) * length(line.direction));
    if cosine < 1e-6 {
        // In its plane: no meeting, unless rounding takes the ray out of it.
        let off = dot(from_v0, normal).abs() / length(normal);
        let near = (length(from_v0) + length(e1) + length(e2)) / length(line.direction);
        return (off < line.error_at(near, farthest) && dot(normal, line.direction) != 0.0).then_some(met);
    }
    let error = line.error_at(t, farthest) / cosine;
    let longest = length(e1).max(length(e2)).max(length(minus(v2, v1)));
    met.t_error = error / length(line.direction);
    met.weight_error = error * longest / length(normal);
    let inside = u.min(v).min(1.0 - u - v);
    let from_limits = (t - line.limits[0]).min(line.limits[1] - t);
    met.is_met = inside >= 0.0 && from_limits > 0.0;
    met.is_unsure = inside.abs() < met.weight_error || from_limits.abs() < met.t_error;
    (inside > -met.weight_error && from_limits > -met.t_error).then_some(met)
}

/// The same for a box, which implementations may enlarge a little.
fn box_met(corners: &[[f32; 3]; 2], line: &Line) -> Option<Met> {
    let corners = corners.map(|corner| corner.map(f64::from));
    if corners[0][0].is_nan() {
        return None;
    }
    let farthest = if length(corners[0]) > length(corners[1]) { corners[0] } else { corners[1] };
    let until = length(minus(farthest, line.origin)) / length(line.direction);
    let error = line.error_at(until, farthest);
    let t_error = error / length(line.direction);
    let enter_within = |by: f64, late: f64| -> Option<f64> {
        let (mut enter, mut leave) = (line.limits[0] - late, line.limits[1] + late);
        for (k, (least, most)) in corners[0].iter().zip(&corners[1]).enumerate() {
            let (lo, hi) = (least - by, most + by);
            if line.direction[k] == 0.0 {
                if !(lo <= line.origin[k] && line.origin[k] <= hi) {
                    return None;
                }
            } else {
                let [a, b] = [lo, hi].map(|x| (x - line.origin[k]) / line.direction[k]);
                enter = enter.max(a.min(b));
                leave = leave.min(a.max(b));
            }
        }
        (enter <= leave).then_some(enter)
    };
    let enter = enter_within(0.0, 0.0);
    // Limits are inclusive for boxes, and an origin on one's face is no question of rounding.
    let sure = enter_within(-error, 0.0).is_some();
    enter_within(error, t_error).map(|possible| Met {
        t: enter.unwrap_or(possible),
        weights: [0.0; 2],
        place: [0; 3],
        is_front: false,
        is_opaque: false,
        is_box: true,
        t_error,
        weight_error: 0.0,
        is_met: enter.is_some(),
        is_unsure: !sure,
    })
}
