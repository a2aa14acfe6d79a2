//! Top levels on the host, plainly: entry by entry, round by round. The twin of `glsl/accel/`: the same bytes as the device's.

mod parts;
pub mod rebraid;
pub mod serialize;
mod world_box;

pub use parts::Below;

use super::{AccelOptions, Instance, Tree, quality};
use crate::bvh::builder::{Method, Primitives};
use crate::bvh::codes::{CodePlan, Codes};
use crate::bvh::layout::{self, Child, status};
use crate::bvh::{self, twin::lbvh};
use crate::geometry::Aabb;
use ash::vk;

/// A box in the world over an instance or a part of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Entry {
    /// The box, or why the instance is left out: bits of [`status`], 0 for one that is inactive.
    pub bounds: Result<Aabb, u32>,
    /// Position of the instance in the input.
    pub instance: u32,
    /// Where it begins in the instance's structure: a part (`glsl/accel/parts.glsl`).
    pub start: Child,
}

/// The top level over `instances`, built as a [`Device`](super::Device) with these options builds it by these flags. `below`
/// finds the bottom-level structure at an address, if there is one.
pub fn top_level<'a>(
    instances: &[Instance],
    below: impl Fn(u64) -> Option<Below<'a>>,
    flags: vk::BuildAccelerationStructureFlagsKHR,
    options: &AccelOptions,
) -> Tree<layout::InstanceRecord> {
    let mut entries = entries(instances, &below);
    if let Some(capacity) = quality::opened_to(flags, options, entries.len() as u32) {
        rebraid::rebraid(&mut entries, instances, &below, capacity);
        let none = Entry { bounds: Err(0), instance: u32::MAX, start: Child::UNUSED };
        entries.resize(capacity as usize, none);
    }
    let boxes: Vec<_> = entries.iter().map(|entry| entry.bounds).collect();
    let is_wide = quality::is_wide(flags, options, Primitives::Instances, boxes.len() as u32);
    let mut options = quality::build_options(flags, options, Primitives::Instances, boxes.len() as u32);
    // As the builder does.
    if boxes.len() < 2 {
        options.method = Method::Lbvh;
    }
    let codes = options.codes.unwrap_or_else(|| Codes::for_count(boxes.len() as u32));
    let codes = options.bits_up_to.map_or(codes, |most| codes.by_spread(&boxes, most));
    let record = |entry: u32| record_of(&entries[entry as usize], instances, &below);
    let plan = CodePlan::new(codes, &boxes);
    let lbvh = |finish| lbvh::build_boxes(&boxes, record, codes, finish);
    let mut tree = bvh::twin::build_within(&options, codes, plan.core(), lbvh);
    tree.header.build_flags = options.build_flags;
    Tree::of(tree, is_wide)
}

/// One entry for each instance (`entries.comp`).
pub fn entries<'a>(instances: &[Instance], below: &impl Fn(u64) -> Option<Below<'a>>) -> Vec<Entry> {
    (0..instances.len() as u32).map(|i| entry_of(i, &instances[i as usize], below)).collect()
}

fn entry_of<'a>(number: u32, instance: &Instance, below: &impl Fn(u64) -> Option<Below<'a>>) -> Entry {
    let without = |why_not| Entry { bounds: Err(why_not), instance: number, start: Child::UNUSED };
    if instance.structure == 0 {
        return without(0);
    }
    let m = &instance.transform;
    let (Some(below), Some(_)) = (below(instance.structure), inverse_of(m)) else {
        return without(status::BAD_INSTANCE);
    };
    if below.header.active == 0 || below.header.status & status::UNUSABLE != 0 {
        return without(0);
    }
    let start = below.whole();
    let bounds = below.world_box(m, &start);
    if !bounds.lo.iter().chain(&bounds.hi).all(|x| x.is_finite()) {
        return without(status::BAD_INSTANCE);
    }
    Entry { bounds: Ok(bounds), instance: number, start }
}

/// The record of an entry; all zero for one that is left out.
fn record_of<'a>(
    entry: &Entry,
    instances: &[Instance],
    below: &impl Fn(u64) -> Option<Below<'a>>,
) -> layout::InstanceRecord {
    let none = layout::InstanceRecord { instance: entry.instance, ..bytemuck::Zeroable::zeroed() };
    if entry.bounds.is_err() {
        return none;
    }
    let given = &instances[entry.instance as usize];
    let Some(below) = below(given.structure) else { return none };
    let record = layout::InstanceRecord {
        to_object: inverse_of(&given.transform).unwrap_or_default(),
        to_world: given.transform,
        structure: given.structure,
        index_and_mask: given.index_and_mask,
        offset_and_flags: given.offset_and_flags,
        ..none
    };
    record.over(&entry.start, below.header)
}

/// The inverse of an affine matrix, by its adjugate; `None` if it is not finite (`instances.glsl`).
fn inverse_of(m: &[[f32; 4]; 3]) -> Option<[[f32; 4]; 3]> {
    let is_finite = |m: &[[f32; 4]; 3]| m.iter().flatten().all(|x| x.is_finite());
    if !is_finite(m) {
        return None;
    }
    let greatest = m.iter().flat_map(|row| &row[..3]).fold(0f32, |a, x| a.max(x.abs()));
    let exponent = greatest.to_bits() >> 23 & 0xff;
    let scale = f32::from_bits((254 - exponent).clamp(1, 254) << 23);
    let [a, b, c] = m.map(|[x, y, z, _]| [x * scale, y * scale, z * scale]);
    let columns = [cross(b, c), cross(c, a), cross(a, b)];
    let determinant = a[0] * columns[0][0] + a[1] * columns[0][1] + a[2] * columns[0][2];
    let reciprocal = scale * (1.0 / determinant);
    let inverse = std::array::from_fn(|row| {
        let r = columns.map(|column| column[row] * reciprocal);
        [r[0], r[1], r[2], -(r[0] * m[0][3] + r[1] * m[1][3] + r[2] * m[2][3])]
    });
    (is_finite(&inverse) && determinant != 0.0).then_some(inverse)
}

fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
