//! Triangles of quantised trees: two that share an edge are one record, without losing a bit of a vertex
//! (glsl/bvh/wide/pairs.glsl).
//!
//! Records lie in a stream of units of 8 bytes. One of a triangle alone is a [`Triangle`], 40 bytes. One of two has the fourth
//! vertex and the second's primitive index behind it, 56 bytes:
//!
//! | bytes | |
//! | --- | --- |
//! | 36 | the vertices of the first triangle, in its order |
//! | 4 | its primitive index in the lower 27 bits; bit 27: there is a second; bits 28 to 31: which of the four vertices are its first and second |
//! | 12 | the vertex that is not of the first |
//! | 4 | the second's primitive index in the lower 27 bits; bits 27 and 28: which vertex is its third |
//!
//! So both triangles have their own order of vertices, and all that follows from it: u and v, the side that faces the ray, the last
//! bit of a hit. Vertices are shared where their bits are the same.
//!
//! The leaves of the binary tree decide who can be a pair: each record takes the first of the [`WINDOW`] behind it that is free and
//! shares an edge with it.

use crate::bvh::layout::{Record, Triangle};
use std::ops::Range;

/// Units of 8 bytes of a record of one triangle.
pub const UNITS_OF_ONE: u32 = 5;
/// Units of a record of two.
pub const UNITS_OF_TWO: u32 = 7;
/// Bytes that a pair saves.
pub(crate) const SAVED_BY_PAIR: u64 = 8 * (2 * UNITS_OF_ONE - UNITS_OF_TWO) as u64;
/// How many of the records behind it may be a record's partner.
pub const WINDOW: usize = 8;
/// Triangles of a quantised tree, at most: tracers have 27 bits for where a record is.
pub const TRIANGLES_AT_MOST: u32 = (1 << 27) / UNITS_OF_ONE;
/// Leaves of more triangles are nodes of their own: a byte holds the units of others, if none of them are pairs.
pub(crate) const LEAF_MAX: u32 = 255 / UNITS_OF_ONE;

const PRIMITIVE_BITS: u32 = 27;
const PRIMITIVE_MASK: u32 = (1 << PRIMITIVE_BITS) - 1;
const HAS_SECOND: u32 = 1 << PRIMITIVE_BITS;

/// Which of four vertices are those of the second triangle of a pair, in its order: 3 is the one that the first does not have.
pub type Order = [u32; 3];

/// How a record of a leaf is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// Alone.
    One,
    /// As the first of two; the second lies so many records behind it in the binary tree.
    First(usize, Order),
    /// As the second of two.
    Second,
}

/// How the second of two triangles is made of the first and one more vertex; `None` if they share no edge.
pub fn order_of(first: &Triangle, second: &Triangle) -> Option<Order> {
    let bits = |v: [f32; 3]| v.map(f32::to_bits);
    let of_first = [first.v0, first.v1, first.v2].map(bits);
    let found = [second.v0, second.v1, second.v2].map(|v| of_first.iter().position(|&of| of == bits(v)));
    // Of several that may be the new one the first, as two triangles may be the same.
    let new = (0..3).find(|&new| (0..3).all(|i| i == new || found[i].is_some()))?;
    Some(std::array::from_fn(|i| if i == new { 3 } else { found[i].expect("shared") as u32 }))
}

/// How the records of a leaf are written.
pub fn parts_of(leaf: &[Triangle]) -> Vec<Part> {
    let mut parts = vec![Part::One; leaf.len()];
    for i in 0..leaf.len() {
        if parts[i] != Part::One {
            continue;
        }
        let mut behind = (i + 1)..leaf.len().min(i + 1 + WINDOW);
        let partner = behind.find_map(|j| {
            let free = parts[j] == Part::One;
            free.then(|| order_of(&leaf[i], &leaf[j])).flatten().map(|order| (j, order))
        });
        if let Some((j, order)) = partner {
            (parts[i], parts[j]) = (Part::First(j - i, order), Part::Second);
        }
    }
    parts
}

/// Units of records that are written like this.
pub fn units_of(parts: &[Part]) -> u32 {
    let units = |part: &Part| match part {
        Part::One => UNITS_OF_ONE,
        Part::First(..) => UNITS_OF_TWO,
        Part::Second => 0,
    };
    parts.iter().map(units).sum()
}

/// Where the records of a tree lie.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Places {
    /// One behind the other; leaves count records.
    InOrder,
    /// In this unit each, two of a pair in the same; leaves count units.
    Units(Vec<u32>),
}

impl Places {
    /// Which records a leaf holds; it may name some that there are not.
    pub fn records(&self, first: u32, count: u32) -> Range<usize> {
        let end = u64::from(first) + u64::from(count);
        match self {
            Places::InOrder => first as usize..end as usize,
            Places::Units(units) => {
                let at = |unit: u64| units.partition_point(|&place| u64::from(place) < unit);
                let is_pair = units.len() > 1 && units[units.len() - 2] == units[units.len() - 1];
                let units_of_last = if is_pair { UNITS_OF_TWO } else { UNITS_OF_ONE };
                let last = units.last().map_or(0, |&place| u64::from(place) + u64::from(units_of_last));
                if end > last { at(first.into())..units.len() + 1 } else { at(first.into())..at(end) }
            }
        }
    }

    /// How many records are the second of a pair.
    pub fn pairs(&self) -> u32 {
        match self {
            Places::InOrder => 0,
            Places::Units(units) => units.windows(2).filter(|two| two[0] == two[1]).count() as u32,
        }
    }
}

/// The bytes of records that lie there.
pub(super) fn to_bytes<R: Record>(records: &[R], places: &Places) -> Vec<u8> {
    let Places::Units(units) = places else { return bytemuck::cast_slice(records).to_vec() };
    let triangles: &[Triangle] = bytemuck::cast_slice(records);
    let mut bytes = Vec::new();
    let mut at = 0;
    while at < triangles.len() {
        let first = triangles[at];
        let second = triangles.get(at + 1).filter(|_| units.get(at + 1) == Some(&units[at]));
        let order = second.and_then(|second| order_of(&first, second).map(|order| (second, order)));
        let Some((second, order)) = order else {
            bytes.extend_from_slice(bytemuck::bytes_of(&first));
            at += 1;
            continue;
        };
        let primitive = first.primitive | HAS_SECOND | order[0] << 28 | order[1] << 30;
        bytes.extend_from_slice(bytemuck::bytes_of(&Triangle { primitive, ..first }));
        let new = order.iter().position(|&of| of == 3).expect("one is new");
        bytes.extend_from_slice(bytemuck::bytes_of(&[second.v0, second.v1, second.v2][new]));
        bytes.extend_from_slice(bytemuck::bytes_of(&(second.primitive | order[2] << PRIMITIVE_BITS)));
        at += 2;
    }
    bytes
}

/// The records in `bytes`, and where they lie; those of a stream that ends in the middle of one are the ones before.
pub(super) fn from_bytes<R: Record>(bytes: &[u8], is_paired: bool) -> (Vec<R>, Places) {
    if !is_paired {
        return (bytemuck::pod_collect_to_vec(bytes), Places::InOrder);
    }
    let words: Vec<u32> = bytemuck::pod_collect_to_vec(bytes);
    let (mut triangles, mut units): (Vec<Triangle>, _) = (Vec::new(), Vec::new());
    let mut rest = &words[..];
    while let Some((one, behind)) = rest.split_first_chunk::<{ 2 * UNITS_OF_ONE as usize }>() {
        let unit = ((words.len() - rest.len()) / 2) as u32;
        let tagged: Triangle = bytemuck::cast(*one);
        let first = Triangle { primitive: tagged.primitive & PRIMITIVE_MASK, ..tagged };
        triangles.push(first);
        units.push(unit);
        rest = behind;
        if tagged.primitive & HAS_SECOND == 0 {
            continue;
        }
        let Some((&[x, y, z, id], behind)) = rest.split_first_chunk() else { break };
        let vertices = [first.v0, first.v1, first.v2, [x, y, z].map(f32::from_bits)];
        let order = [tagged.primitive >> 28, tagged.primitive >> 30, id >> PRIMITIVE_BITS];
        let [v0, v1, v2] = order.map(|of| vertices[(of & 3) as usize]);
        triangles.push(Triangle { v0, v1, v2, primitive: id & PRIMITIVE_MASK });
        units.push(unit);
        rest = behind;
    }
    (bytemuck::allocation::cast_vec(triangles), Places::Units(units))
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: [f32; 3] = [0.0, 0.0, 0.0];
    const B: [f32; 3] = [1.0, 0.0, 0.0];
    const C: [f32; 3] = [0.0, 1.0, 0.0];
    const D: [f32; 3] = [1.0, 1.0, 0.0];

    fn triangle(primitive: u32, [v0, v1, v2]: [[f32; 3]; 3]) -> Triangle {
        Triangle { v0, v1, v2, primitive }
    }

    fn round_trip(leaf: &[Triangle]) -> u32 {
        let parts = parts_of(leaf);
        let (mut records, mut units, mut unit) = (Vec::new(), Vec::new(), 0);
        for (i, part) in parts.iter().enumerate() {
            let these: &[usize] = match part {
                Part::One => &[i],
                Part::First(behind, _) => &[i, i + behind],
                Part::Second => continue,
            };
            records.extend(these.iter().map(|&i| leaf[i]));
            units.extend(these.iter().map(|_| unit));
            unit += units_of(&[*part]);
        }
        let places = Places::Units(units);
        let bytes = to_bytes(&records, &places);
        assert_eq!(bytes.len() as u32, 8 * units_of(&parts));
        let (back, where_) = from_bytes::<Triangle>(&bytes, true);
        assert_eq!(bytemuck::cast_slice::<_, u32>(&back), bytemuck::cast_slice::<_, u32>(&records));
        assert_eq!(where_, places);
        assert_eq!(back.iter().map(|t| t.primitive).collect::<std::collections::BTreeSet<_>>().len(), leaf.len());
        places.pairs()
    }

    /// Every way in which the second can have two vertices of the first, in every order of its own.
    #[test]
    fn triangles_that_share_an_edge_come_back_to_the_bit_in_any_order_of_vertices() {
        for shared in [[A, B], [B, C], [C, A], [B, A], [C, B], [A, C]] {
            for new in 0..3 {
                let mut second = [shared[0], shared[1], D];
                second.rotate_right(new);
                let leaf = [triangle(7, [A, B, C]), triangle((1 << 27) - 1, second)];
                assert_eq!(round_trip(&leaf), 1, "{second:?}");
            }
        }
    }

    #[test]
    fn vertices_are_shared_by_bits_and_partners_found_in_the_window() {
        let other_zero = [-0.0, 0.0, 0.0];
        assert_eq!(order_of(&triangle(0, [A, B, C]), &triangle(1, [other_zero, B, D])), None);
        assert_eq!(order_of(&triangle(0, [A, B, C]), &triangle(1, [D, other_zero, B])), None);
        assert_eq!(order_of(&triangle(0, [A, B, C]), &triangle(1, [D, C, B])), Some([3, 2, 1]));
        // The same triangle again, and one without an area.
        assert_eq!(order_of(&triangle(0, [A, B, C]), &triangle(1, [C, A, B])), Some([3, 0, 1]));
        assert_eq!(order_of(&triangle(0, [A, B, C]), &triangle(1, [D, A, A])), Some([3, 0, 0]));
        let lone = |i: u32| triangle(i, [[i as f32 + 5.0; 3], [i as f32 + 6.5; 3], [0.25; 3]]);
        for between in [0, 3, WINDOW as u32 - 1, WINDOW as u32] {
            let mut leaf = vec![triangle(100, [A, B, C])];
            leaf.extend((0..between).map(lone));
            leaf.push(triangle(200, [C, B, D]));
            assert_eq!(round_trip(&leaf), u32::from(between < WINDOW as u32), "{between}");
        }
        assert_eq!(round_trip(&[triangle(0, [A, B, C]); 1]), 0);
        let fan: Vec<Triangle> =
            (0..5).map(|i| triangle(i, [A, [i as f32, 1.0, 0.0], [i as f32 + 1.0, 1.0, 0.0]])).collect();
        assert_eq!(round_trip(&fan), 2);
    }

    #[test]
    fn leaves_find_their_records_by_units() {
        let places = Places::Units(vec![0, 0, 7, 12, 12, 19]);
        assert_eq!(places.records(0, 12), 0..3);
        assert_eq!(places.records(7, 5), 2..3);
        assert_eq!(places.records(12, 12), 3..6);
        assert_eq!(places.records(12, 13).end, 7);
        assert_eq!(places.pairs(), 2);
        // Behind the last there is nothing.
        assert_eq!(places.records(19, 70).end, 7);
        assert_eq!(Places::InOrder.records(3, 4), 3..7);
    }
}
