//! A small world of instances, built through a back end, and what a ray meets in it by brute force in double precision.
#![allow(missing_docs, reason = "names and types say it all: groups and tests are the only readers")]

use super::backend::{Backend, Built};
use super::probe::{CONFIRM, CONFIRM_ODD, ProbeRay, flags};
use super::shapes::Corners;
use crate::device::{Buffer, Device};
pub use crate::subjects::structures::instances_at;
use crate::subjects::structures::{BuildInfo, Geometry, Range, address};
use ash::vk;
use glam::DVec3;
use hedgerow::accel::{ANY_HIT_ORDER, Instance};

type Flags = vk::GeometryInstanceFlagsKHR;
type GeometryFlags = vk::GeometryFlagsKHR;
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
    /// Of the top level.
    pub flags: vk::BuildAccelerationStructureFlagsKHR,
    /// Of the first part, the second, and so on in turn: ours are then of nodes of two and of eight.
    pub part_flags: [vk::BuildAccelerationStructureFlagsKHR; 2],
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

/// Builds a top level of them alone.
pub fn top_level(
    backend: &dyn Backend,
    instances: &Geometry,
    range: Range,
    flags: vk::BuildAccelerationStructureFlagsKHR,
) -> Built {
    let info = BuildInfo::default()
        .ty(vk::AccelerationStructureTypeKHR::TOP_LEVEL)
        .flags(flags)
        .geometries(std::slice::from_ref(instances));
    Built::new(backend, &info, &[range], 0)
}

/// Builds a bottom level of them alone.
pub fn bottom_level(backend: &dyn Backend, geometries: &[Geometry], ranges: &[Range]) -> Built {
    let info = BuildInfo::default().ty(vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL).geometries(geometries);
    Built::new(backend, &info, ranges, 0)
}

impl Part {
    /// Vulkan's structs over uploaded data.
    pub fn geometries(&self, device: &'static Device) -> (Vec<Geometry>, Vec<Range>, Vec<Buffer<'static>>) {
        let built_over = |kind, data, flags, count: usize, memory| {
            let geometry = Geometry::default().geometry_type(kind).geometry(data).flags(flags);
            (geometry, Range::default().primitive_count(count as u32), memory)
        };
        let triangles_of = |(corners, flags): &(Corners, GeometryFlags)| {
            let memory = device.upload("corners", corners).expect("memory");
            let triangles = vk::AccelerationStructureGeometryTrianglesDataKHR::default()
                .vertex_format(vk::Format::R32G32B32_SFLOAT)
                .vertex_data(address(memory.address()))
                .vertex_stride(12)
                .max_vertex((3 * corners.len()).max(1) as u32 - 1)
                .index_type(vk::IndexType::NONE_KHR);
            let data = vk::AccelerationStructureGeometryDataKHR { triangles };
            built_over(vk::GeometryTypeKHR::TRIANGLES, data, *flags, corners.len(), memory)
        };
        let boxes_of = |(boxes, flags): &(Vec<[[f32; 3]; 2]>, GeometryFlags)| {
            let memory = device.upload("boxes", boxes).expect("memory");
            let aabbs =
                vk::AccelerationStructureGeometryAabbsDataKHR::default().data(address(memory.address())).stride(24);
            let data = vk::AccelerationStructureGeometryDataKHR { aabbs };
            built_over(vk::GeometryTypeKHR::AABBS, data, *flags, boxes.len(), memory)
        };
        match self {
            Part::Triangles(geometries) => geometries.iter().map(triangles_of).collect(),
            Part::Boxes(geometries) => geometries.iter().map(boxes_of).collect(),
        }
    }

    /// Everything in it that a line meets, or may, as of instance 0 and opaque by its geometry alone.
    fn meetings(&self, line: &Line) -> Vec<Met> {
        match self {
            Part::Triangles(geometries) => meetings_of(geometries, |triangle| triangle_met(triangle, line)),
            Part::Boxes(geometries) => meetings_of(geometries, |corners| box_met(corners, line)),
        }
    }

    /// Builds it alone.
    pub fn build(&self, backend: &dyn Backend) -> (Built, Vec<Buffer<'static>>) {
        self.build_with(backend, vk::BuildAccelerationStructureFlagsKHR::empty())
    }

    /// The same with build flags.
    pub fn build_with(
        &self,
        backend: &dyn Backend,
        flags: vk::BuildAccelerationStructureFlagsKHR,
    ) -> (Built, Vec<Buffer<'static>>) {
        let (geometries, ranges, memory) = self.geometries(backend.device());
        let bottom = vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL;
        let info = BuildInfo::default().ty(bottom).flags(flags).geometries(&geometries);
        (Built::new(backend, &info, &ranges, 0), memory)
    }
}

fn meetings_of<P>(geometries: &[(Vec<P>, GeometryFlags)], met: impl Fn(&P) -> Option<Met>) -> Vec<Met> {
    let mut all = Vec::new();
    for (g, (primitives, flags)) in geometries.iter().enumerate() {
        let is_opaque = flags.contains(GeometryFlags::OPAQUE);
        for (p, primitive) in primitives.iter().enumerate() {
            let place = [0, g as u32, p as u32];
            all.extend(met(primitive).map(|met| Met { place, is_opaque, ..met }));
        }
    }
    all
}

impl World {
    /// Instances of parts, every second of which is built for fast rays; otherwise with no build flags.
    pub fn new(parts: Vec<Part>, instances: Vec<Instance>) -> World {
        let flags = vk::BuildAccelerationStructureFlagsKHR::empty();
        let part_flags = [flags, vk::BuildAccelerationStructureFlagsKHR::PREFER_FAST_TRACE];
        World { parts, instances, flags, part_flags, by_pointers: false }
    }

    /// The instances as they are given to a back end whose parts are these.
    pub fn placed(&self, backend: &dyn Backend, parts: &[Built]) -> Vec<Instance> {
        let structure = |number: u64| match number {
            0 => 0,
            number => backend.address(parts[number as usize - 1].structure),
        };
        self.instances.iter().map(|i| Instance { structure: structure(i.structure), ..*i }).collect()
    }

    /// Builds everything. Of the flags, which are the top level's, [`ANY_HIT_ORDER`] holds for the parts, too.
    pub fn build(&self, backend: &dyn Backend) -> BuiltWorld {
        let flags = self.part_flags.map(|flags| flags | self.flags & ANY_HIT_ORDER);
        let each = self.parts.iter().zip(flags.into_iter().cycle());
        let (parts, memory): (_, Vec<_>) = each.map(|(part, flags)| part.build_with(backend, flags)).unzip();
        self.build_over(backend, parts, memory.into_iter().flatten().collect())
    }

    /// Builds the top level over parts that are built, and keeps their memory.
    pub fn build_over(&self, backend: &dyn Backend, parts: Vec<Built>, mut memory: Vec<Buffer<'static>>) -> BuiltWorld {
        let placed = self.placed(backend, &parts);
        let mut instances = backend.device().upload("instances", &placed).expect("memory");
        if self.by_pointers {
            let pointer = |i| instances.address() + (i * size_of::<Instance>()) as u64;
            let pointers: Vec<u64> = (0..placed.len()).map(pointer).collect();
            let pointers = backend.device().upload("pointers", &pointers).expect("memory");
            memory.push(std::mem::replace(&mut instances, pointers));
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
            for mut met in self.parts[instance.structure as usize - 1].meetings(&line) {
                met.place[0] = i as u32;
                met.is_opaque |= instance_flags.contains(Flags::FORCE_OPAQUE);
                met.is_opaque &= !instance_flags.contains(Flags::FORCE_NO_OPAQUE);
                met.is_opaque |= ray.flags & flags::OPAQUE != 0;
                met.is_opaque &= ray.flags & flags::NO_OPAQUE == 0;
                let mut culled = if met.is_opaque { flags::CULL_OPAQUE } else { flags::CULL_NO_OPAQUE };
                if met.is_box {
                    culled |= flags::SKIP_BOXES;
                } else {
                    culled |= flags::SKIP_TRIANGLES;
                    met.is_front ^= instance_flags.contains(Flags::TRIANGLE_FLIP_FACING);
                    if !instance_flags.contains(Flags::TRIANGLE_FACING_CULL_DISABLE) {
                        culled |= if met.is_front { flags::CULL_FRONT } else { flags::CULL_BACK };
                    }
                }
                if ray.flags & culled == 0 {
                    all.push(met);
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
#[derive(Debug, Clone, Copy, Default, PartialEq)]
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
    origin: DVec3,
    direction: DVec3,
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
            origin: transformed(&to_object, origin, 1.0).into(),
            direction: transformed(&to_object, direction, 0.0).into(),
            limits: [ray.t_min.into(), ray.t_max.into()],
            origin_error: transform_error(transform, origin, 1.0),
            direction_error: transform_error(transform, direction, 0.0),
        }
    }

    /// How far off a point at t may be beside something at `corner`.
    fn error_at(&self, t: f64, corner: DVec3) -> f64 {
        self.origin_error + t.abs() * self.direction_error + PRECISION * corner.length()
    }
}

/// A generous bound on what float32 may lose in a few operations, relative to their terms.
const PRECISION: f64 = 1e-6;

/// How far off float32 may be in the transform of a point (or, with w = 0, of a direction) to the space of an instance: each
/// row of the inverse is a product of two columns divided by the determinant, and lost digits of these.
pub fn transform_error(to_world: &[[f32; 4]; 3], p: [f64; 3], w: f64) -> f64 {
    let column = |k: usize| DVec3::from(to_world.map(|row| f64::from(row[k])));
    let columns = [column(0), column(1), column(2)];
    let determinant = columns[0].dot(columns[1].cross(columns[2])).abs();
    let lengths = columns.map(DVec3::length);
    let rows = DVec3::from(lengths.map(|own| lengths[0] * lengths[1] * lengths[2] / own / determinant));
    PRECISION * rows.length() * (DVec3::from(p).length() + w * column(3).length())
}

pub type Matrix = [[f64; 4]; 3];

pub fn transformed(m: &Matrix, p: [f64; 3], w: f64) -> [f64; 3] {
    m.map(|[a, b, c, d]| a * p[0] + b * p[1] + c * p[2] + d * w)
}

/// The inverse of an affine matrix, by Cramer's rule.
pub fn inverse(m: &[[f32; 4]; 3]) -> Matrix {
    let m: Matrix = m.map(|row| row.map(f64::from));
    let row = |i: usize| DVec3::new(m[i][0], m[i][1], m[i][2]);
    let columns = [row(1).cross(row(2)), row(2).cross(row(0)), row(0).cross(row(1))];
    let determinant = row(0).dot(columns[0]);
    let offset = DVec3::from(m.map(|row| row[3]));
    std::array::from_fn(|i| {
        let r = DVec3::from(columns.map(|column| column[i] / determinant));
        [r.x, r.y, r.z, -r.dot(offset)]
    })
}

/// Möller and Trumbore 1997. Nothing where even rounding does not lead to a meeting.
fn triangle_met(triangle: &[[f32; 3]; 3], line: &Line) -> Option<Met> {
    let [v0, v1, v2] = triangle.map(|v| DVec3::from(v.map(f64::from)));
    let (e1, e2, from_v0) = (v1 - v0, v2 - v0, line.origin - v0);
    let (normal, across) = (e1.cross(e2), line.direction.cross(e2));
    if normal.length() == 0.0 {
        return None;
    }
    let q = from_v0.cross(e1);
    let [u, v, t] = [from_v0.dot(across), line.direction.dot(q), e2.dot(q)].map(|x| x / e1.dot(across));
    // The front is where the normal looks, by the right hand: clockwise in left-handed coordinates, as the field says it.
    let is_front = normal.dot(line.direction) < 0.0;
    let (t_error, weight_error) = (f64::INFINITY, f64::INFINITY);
    let mut met = Met { t, weights: [u, v], is_front, t_error, weight_error, is_unsure: true, ..Met::default() };
    let farthest = farther(v0, farther(v1, v2));
    let cosine = normal.dot(line.direction).abs() / (normal.length() * line.direction.length());
    if cosine < 1e-6 {
        // In its plane: no meeting, unless rounding takes the ray out of it.
        let off = from_v0.dot(normal).abs() / normal.length();
        let near = (from_v0.length() + e1.length() + e2.length()) / line.direction.length();
        return (off < line.error_at(near, farthest) && normal.dot(line.direction) != 0.0).then_some(met);
    }
    let error = line.error_at(t, farthest) / cosine;
    let longest = e1.length().max(e2.length()).max((v2 - v1).length());
    met.t_error = error / line.direction.length();
    met.weight_error = error * longest / normal.length();
    let inside = u.min(v).min(1.0 - u - v);
    let from_limits = (t - line.limits[0]).min(line.limits[1] - t);
    met.is_met = inside >= 0.0 && from_limits > 0.0;
    met.is_unsure = inside.abs() < met.weight_error || from_limits.abs() < met.t_error;
    (inside > -met.weight_error && from_limits > -met.t_error).then_some(met)
}

/// The one that is farther from the origin.
fn farther(a: DVec3, b: DVec3) -> DVec3 {
    if a.length() > b.length() { a } else { b }
}

/// The same for a box, which implementations may enlarge a little.
fn box_met(corners: &[[f32; 3]; 2], line: &Line) -> Option<Met> {
    let corners = corners.map(|corner| DVec3::from(corner.map(f64::from)));
    if corners[0].x.is_nan() {
        return None;
    }
    let farthest = farther(corners[0], corners[1]);
    let until = (farthest - line.origin).length() / line.direction.length();
    let error = line.error_at(until, farthest);
    let t_error = error / line.direction.length();
    let enter_within = |by: f64, late: f64| -> Option<f64> {
        let (mut enter, mut leave) = (line.limits[0] - late, line.limits[1] + late);
        let [lows, highs] = [corners[0] - by, corners[1] + by];
        for k in 0..3 {
            let (lo, hi) = (lows[k], highs[k]);
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
    // Limits are inclusive for boxes, and an origin on one's face is exact.
    let sure = enter_within(-error, 0.0).is_some();
    enter_within(error, t_error).map(|possible| Met {
        t: enter.unwrap_or(possible),
        is_box: true,
        t_error,
        is_met: enter.is_some(),
        is_unsure: !sure,
        ..Met::default()
    })
}
